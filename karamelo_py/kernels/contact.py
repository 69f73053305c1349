"""Contact on the grid between solids that have velocity fields of their own.

Where two fields have mass at a node, the part of their relative velocity by which they approach
each other along their common normal is taken away by an impulse, after Bardenhagen et al. 2001 ("An
improved contact algorithm for the material point method and application to stress propagation in
granular material", CMES 2(4)); friction adds an impulse along the surface, at most mu times as
large (Coulomb). What leaves one field enters the other: momentum is kept to round-off.

Where more than two fields meet, all pairs take their impulses from the same velocities, so that it
does not matter in which order the solids were defined. Each pair takes the share 1 / k of its own,
where k is the number of pairs of the one of its two bodies that is in more of them: then no body
gets more than would stop it, and energy does not grow. What remains is taken in the same way again.

Fields meet at nodes up to two cells before the bodies do (the reach of the functions). Therefore
the gap between the surfaces is measured, from the mean places of the points of each body that a
node sees (`karamelo_py.points.basis.surface`). Bodies may approach until the gap is closed, and are
stopped where it would be less than nothing at the end of the step.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.compile import point_function
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.loops import kernel, noinline
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import DT, MASS, TIMESTEP, of_change, of_momentum
from karamelo_py.kernels.loss import FrictionalHeat, warm_node
from karamelo_py.kernels.p2g import Centre, Normal
from karamelo_py.kernels.table import touch, touch_velocity
from karamelo_py.kernels.totals import add_to, counts, publish
from karamelo_py.points.basis.surface import ENTRIES
from karamelo_py.points.grid import node_position
from karamelo_py.points.kinematics import dimension


class Where(NamedTuple):
    """A place where fields meet, and the length of the step."""

    x: tuple  # position of the node
    h: float
    dt: float


class NodePair(NamedTuple):
    """Two bodies at a place: a node of each, mass and share in the common normal."""

    n: int
    m: int
    per_a: float  # 1 / mass
    per_b: float
    share_a: float
    share_b: float


@noinline
def immovable(contact, n, k):
    """Return True if contact cannot move a node in direction k."""
    return contact.prescribed[n, k] != 0 or contact.rigid[n // contact.stride]


@noinline
def _shares(contact, d, nodes, n, m):
    """Weights of the two bodies' outward sums in their common normal.

    The sum of m grad N points out of a body. Where a body has little mass or ends in an edge it
    says little about the direction: the larger sum decides (after Lemiale, Nairn & Hurmane 2010),
    equal ones are averaged. A body with a prescribed velocity knows its surface best.
    """
    normal = field(nodes.fields, Normal)
    of_n = 0.0
    of_m = 0.0
    prescribed_n = False
    prescribed_m = False
    for k in range(d):
        of_n += normal[n, k] * normal[n, k]
        of_m += normal[m, k] * normal[m, k]
        prescribed_n = prescribed_n or immovable(contact, n, k)
        prescribed_m = prescribed_m or immovable(contact, m, k)
    if not of_n + of_m > 0:
        return 0.0, 0.0
    if prescribed_n != prescribed_m and (of_n if prescribed_n else of_m) > 0:
        return (1.0, 0.0) if prescribed_n else (0.0, 1.0)
    share = of_n / (of_n + of_m)
    return share**4, (1 - share) ** 4


@noinline
def pair_of(contact, d, nodes, n, m):
    per_a, per_b = 1.0 / nodes.sums[n, MASS], 1.0 / nodes.sums[m, MASS]
    share_a, share_b = _shares(contact, d, nodes, n, m)
    return NodePair(n, m, per_a, per_b, share_a, share_b)


@noinline
def yielding_of(contact, pair, k):
    """Change of the relative velocity with an impulse along direction k."""
    of_n = 0.0 if immovable(contact, pair.n, k) else pair.per_a
    of_m = 0.0 if immovable(contact, pair.m, k) else pair.per_b
    return of_n + of_m


@noinline
def outward_of(nodes, pair, k):
    """Component k of the common normal, not normalised, from the first body to the second."""
    normal = field(nodes.fields, Normal)
    return pair.share_a * normal[pair.n, k] - pair.share_b * normal[pair.m, k]


@noinline
def _left(contact, nodes, pair, k, push):
    """Component of the relative velocity once the impulse `push` m grad N has been given."""
    along = push * outward_of(nodes, pair, k)
    relative = nodes.update[pair.n, k] - nodes.update[pair.m, k]
    return relative - along * yielding_of(contact, pair, k)


@noinline
def approach_left(contact, d, nodes, pair, push, size):
    """Return the rest of the approach velocity after `push`, over the length of m grad N.

    Friction does not act on it: bodies that are still apart come together freely.
    """
    across = 0.0
    for k in range(d):
        across += outward_of(nodes, pair, k) * _left(contact, nodes, pair, k, push)
    return across / (size * size)


@noinline
def slide_of(contact, nodes, pair, k, push, across):
    """Component of the relative velocity along the surface, once `push` has been given."""
    return _left(contact, nodes, pair, k, push) - across * outward_of(nodes, pair, k)


@noinline
def length_of(d, nodes, pair):
    """Length of the common normal."""
    size = 0.0
    for k in range(d):
        normal = outward_of(nodes, pair, k)
        size += normal * normal
    return sqrt(size)


@noinline
def _reach(contact, d, nodes, pair, n, where, side):
    """Return the distance from node `n` to the surface of its body, along the normal out of it.

    `side` is 1 for the first body of the pair and -1 for the second.
    """
    centre = field(nodes.fields, Centre)
    mean = 0.0
    for k in range(d):
        place = centre[n, k] / nodes.sums[n, MASS] - where.x[k]
        mean += side * outward_of(nodes, pair, k) * place
    table = contact.surface[n // contact.stride]
    row = (mean / (length_of(d, nodes, pair) * where.h) + 3) * ENTRIES
    low = min(max(int(row), 0), table.size - 2)
    share = min(max(row - low, 0.0), 1.0)
    return where.h * (table[low] + share * (table[low + 1] - table[low]))


@noinline
def excess_of(contact, d, nodes, pair, where):
    """Return the excess of the approach velocity over the one that closes the gap in a step."""
    size = length_of(d, nodes, pair)
    if not size > 0:
        return 0.0
    approach = 0.0
    for k in range(d):
        normal = outward_of(nodes, pair, k)
        approach += normal * (nodes.update[pair.n, k] - nodes.update[pair.m, k])
    if not approach > 0:
        return 0.0
    gap = -_reach(contact, d, nodes, pair, pair.n, where, 1)
    gap -= _reach(contact, d, nodes, pair, pair.m, where, -1)
    return approach / size - max(gap, 0.0) / where.dt


@noinline
def compliance_of(contact, d, nodes, pair, size):
    """Change of the relative velocity along the normal, of length `size`, with an impulse."""
    compliance = 0.0
    for k in range(d):
        normal = outward_of(nodes, pair, k) / size
        compliance += normal * normal * yielding_of(contact, pair, k)
    return compliance


@noinline
def friction_of(contact, d, nodes, pair, friction, push, size, across, share):
    """Impulse along the surface over the speed of sliding, and whether it stops all sliding."""
    compliance = 0.0
    slip = 0.0
    for k in range(d):
        slide = slide_of(contact, nodes, pair, k, push / size, across)
        slip += slide * slide
        compliance += slide * slide * yielding_of(contact, pair, k)
    if not compliance > 0:
        return 0.0, False
    slip = sqrt(slip)
    stop = share * slip * slip * slip / compliance
    return min(stop, friction * push) / slip, stop <= friction * push


@noinline
def work_of_friction(contact, d, nodes, pair, push, across, rub):
    """Return the energy that friction dissipates: impulse times mean of the sliding speeds."""
    work = 0.0
    for k in range(d):
        slide = slide_of(contact, nodes, pair, k, push, across)
        work += rub * slide * slide * (1.0 - 0.5 * rub * yielding_of(contact, pair, k))
    return work


REPEATS = 16  # at most, where more than two fields meet; what remains falls by a half or more


class SeparateFields(NamedTuple):
    """Solids touch where their fields meet. F fields of equal grids, S solids."""

    node_fields = (Normal, Centre)

    stride: int  # from a node to the same place in the next field
    friction: np.ndarray  # (F, F) coefficient of each pair of fields; infinite: no slip
    warmth: np.ndarray  # (F, F) share of the heat of friction that goes to the first of two fields
    pair: np.ndarray  # (F, F) slot of the published force of a pair on its first field, or -1
    slot: np.ndarray  # (F,) slot of the published force on each field
    copies: np.ndarray  # (k, 2) slots: from a field to the other solids that share it
    touched: np.ndarray  # (N, F) int32: the last step (from 1) in which a node touched that of
    #                      another field, which comes later; minus that where the two stuck
    prescribed: (
        np.ndarray
    )  # (N, d) 1 + slot of the reaction, where a fix prescribes the velocity, else 0
    reactions: np.ndarray  # number of slots of such reactions, and these
    rigid: np.ndarray  # (F,) bool: whether contact does not move a field
    torque: np.ndarray  # (F,) slot of the published torque on each field
    surface: np.ndarray  # (F, k) distance of the surface by the mean place of the points, in cells
    meeting: np.ndarray  # (F,) int64 scratch: the fields that meet at a place
    partners: np.ndarray  # (F,) int64 scratch: with how many others each of them is in contact
    change: np.ndarray  # (F, d) scratch: of the velocity of each of them


@noinline
def _take(contact, control, a, i, n, k, impulse, per_mass, x):
    """A node takes a component of an impulse; a fix that prescribes its velocity takes it over."""
    slot = contact.prescribed[n, k]
    if not immovable(contact, n, k):
        contact.change[i, k] += impulse * per_mass
    if not counts(control.ranks, n):
        return
    force = impulse / control.clock[0].kick
    add_to(control.totals, contact.slot[a] + k, force)
    # A force along k turns about the two other axes.
    add_to(control.totals, contact.torque[a] + (k + 1) % 3, x[(k + 2) % 3] * force)
    add_to(control.totals, contact.torque[a] + (k + 2) % 3, -x[(k + 1) % 3] * force)
    if slot:
        add_to(control.totals, slot - 1 + k, -force)


@noinline
def _meet(contact, nodes, n):
    """Put the fields that have mass at the place of node `n` into `meeting`; their number.

    It is 0 where a field that comes before that of `n` is among them: a place is visited once.
    """
    if not nodes.sums[n, MASS] > 0:
        return 0
    a = n // contact.stride
    for b in range(a):
        if nodes.sums[n - (a - b) * contact.stride, MASS] > 0:
            return 0
    count = 0
    for b in range(a, contact.slot.size):
        if nodes.sums[n + (b - a) * contact.stride, MASS] > 0:
            contact.meeting[count] = b
            count += 1
    return count


@noinline
def _node(contact, place, i):
    """The node at a place of the `i`-th of the fields that meet there."""
    return place + contact.meeting[i] * contact.stride


@noinline
def _clear_change(contact, d, count):
    for i in range(count):
        for k in range(d):
            contact.change[i, k] = 0.0


class Approaching(NamedTuple):
    """Pairs of bodies that approach each other further than they may."""

    where: Where


class Touched(NamedTuple):
    """Pairs of bodies that contact acted between in a step."""

    step: int


@point_function()
def _belongs(which, contact, d, nodes, n, m, b):
    """Return True if the bodies at `n` and `m`, the latter of field `b`, are such a pair."""


@_belongs.on(Approaching)
def _belongs_approaching(which, contact, d, nodes, n, m, b):
    return (
        excess_of(
            contact, d, nodes, pair_of(contact, d, nodes, n, m), which.where
        )
        > 0
    )


@_belongs.on(Touched)
def _belongs_touched(which, contact, d, nodes, n, m, b):
    return abs(contact.touched[n, b]) == which.step


@noinline
def _count_partners(which, contact, d, nodes, place, count):
    """Note in how many such pairs each of the fields that meet is; whether any is."""
    found = False
    contact.partners[:count] = 0
    for i in range(count):
        n = _node(contact, place, i)
        for j in range(i + 1, count):
            m = _node(contact, place, j)
            if _belongs(which, contact, d, nodes, n, m, contact.meeting[j]):
                contact.partners[i] += 1
                contact.partners[j] += 1
                found = True
    return found


@noinline
def _share(contact, i, j):
    return 1.0 / max(contact.partners[i], contact.partners[j], 1)


@noinline
def _touch_pair(contact, d, nodes, control, i, j, place, share, where):
    """`share` of the impulse between the `i`-th and the `j`-th of the fields that meet."""
    a, b = contact.meeting[i], contact.meeting[j]
    pair = pair_of(
        contact, d, nodes, _node(contact, place, i), _node(contact, place, j)
    )
    excess = excess_of(contact, d, nodes, pair, where)
    if not excess > 0:
        return
    size = length_of(d, nodes, pair)
    compliance = compliance_of(contact, d, nodes, pair, size)
    if not compliance > 0:
        return  # the fixes move both
    push = share * excess / compliance
    rub, sticks, across = 0.0, False, 0.0
    friction = contact.friction[a, b]
    if friction > 0:
        across = approach_left(contact, d, nodes, pair, push / size, size)
        rub, sticks = friction_of(
            contact, d, nodes, pair, friction, push, size, across, share
        )
    step = int(control.values[TIMESTEP]) + 1
    contact.touched[pair.n, b] = -step if sticks else step
    if rub > 0:
        heat = work_of_friction(contact, d, nodes, pair, push / size, across, rub)
        share = contact.warmth[a, b]
        warm_node(field(nodes.fields, FrictionalHeat), pair.n, share * heat * pair.per_a)
        warm_node(field(nodes.fields, FrictionalHeat), pair.m, (1.0 - share) * heat * pair.per_b)
    for k in range(d):
        impulse = push * outward_of(nodes, pair, k) / size
        if rub > 0:
            impulse += rub * slide_of(contact, nodes, pair, k, push / size, across)
        _take(contact, control, a, i, pair.n, k, -impulse, pair.per_a, where.x)
        _take(contact, control, b, j, pair.m, k, impulse, pair.per_b, where.x)
        force = impulse / control.clock[0].kick
        if contact.pair[a, b] >= 0 and counts(control.ranks, pair.n):
            add_to(control.totals, contact.pair[a, b] + k, -force)
        if contact.pair[b, a] >= 0 and counts(control.ranks, pair.n):
            add_to(control.totals, contact.pair[b, a] + k, force)


@noinline
def _touch_place(contact, kin, nodes, control, place, count, where):
    """Resolve contact where `count` fields meet."""
    d = dimension(kin)
    contact.partners[:count] = 1  # whether a single pair approaches, it looks itself
    for _ in range(REPEATS if count > 2 else 1):
        which = Approaching(where)
        if count > 2 and not _count_partners(which, contact, d, nodes, place, count):
            return
        _clear_change(contact, d, count)
        for i in range(count):
            for j in range(i + 1, count):
                _touch_pair(contact, d, nodes, control, i, j, place, _share(contact, i, j), where)
        for i in range(count):
            n = _node(contact, place, i)
            for k in range(d):
                nodes.update[n, k] += contact.change[i, k]
                nodes.update[n, of_change(kin) + k] += contact.change[i, k]


@kernel
def _keep_rigid(contact, kin, nodes, spans):
    """Rigid bodies have their velocity, whatever acts on the nodes."""
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            if contact.rigid[n // contact.stride] and nodes.sums[n, MASS] > 0:
                for k in range(dimension(kin)):
                    v = nodes.sums[n, of_momentum(kin) + k] / nodes.sums[n, MASS]
                    nodes.update[n, k] = v
                    nodes.update[n, of_change(kin) + k] = 0


@noinline
def touch_node(contact, kin, grids, nodes, control, n):
    """Resolve contact at the place of node `n`, if its field is the first of those that meet."""
    count = _meet(contact, nodes, n)
    if count > 1:
        grid = record(grids, n // contact.stride)
        where = Where(node_position(grid, n), grid.h, control.values[DT])
        _touch_place(contact, kin, nodes, control, n % contact.stride, count, where)


@kernel
def _touch_nodes(contact, kin, grids, nodes, spans, control):
    """Resolve contact in v* and the change of velocity of this step; publish the forces."""
    d = dimension(kin)
    fields = contact.slot.size
    values, totals = control.values, control.totals
    for a in range(fields):
        totals[contact.slot[a] : contact.slot[a] + 3] = 0
        totals[contact.torque[a] : contact.torque[a] + 3] = 0
        for b in range(fields):
            if contact.pair[a, b] >= 0:
                totals[contact.pair[a, b] : contact.pair[a, b] + 3] = 0
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            touch_node(contact, kin, grids, nodes, control, n)
    for a in range(fields):
        publish(control, contact.slot[a], 3)
        publish(control, contact.torque[a], 3)
        for b in range(fields):
            if contact.pair[a, b] >= 0:
                publish(control, contact.pair[a, b], 3)
    for c in range(contact.reactions[0]):
        publish(control, contact.reactions[1 + c], d)
    for c in range(len(contact.copies)):
        for k in range(3):
            values[contact.copies[c, 1] + k] = values[contact.copies[c, 0] + k]


@noinline
def _stay_pair(contact, d, nodes, i, j, pair, share, sticks):
    """Take `share` of the relative velocity across the surface, or of all where the pair sticks."""
    v = nodes.velocity
    across = 0.0
    compliance = 0.0
    for k in range(d):
        normal = outward_of(nodes, pair, k)
        across += normal * (v[pair.n, k] - v[pair.m, k])
        compliance += normal * normal * yielding_of(contact, pair, k)
    push = share * across / compliance if compliance > 0 else 0.0
    for k in range(d):
        yielding = yielding_of(contact, pair, k)
        if not yielding > 0:
            continue
        impulse = push * outward_of(nodes, pair, k)
        if sticks:
            impulse = share * (v[pair.n, k] - v[pair.m, k]) / yielding
        if not immovable(contact, pair.n, k):
            contact.change[i, k] -= impulse * pair.per_a
        if not immovable(contact, pair.m, k):
            contact.change[j, k] += impulse * pair.per_b


@noinline
def _stay_place(contact, d, nodes, place, count, step):
    if not _count_partners(Touched(step), contact, d, nodes, place, count):
        return
    for _ in range(REPEATS if count > 2 else 1):
        _clear_change(contact, d, count)
        for i in range(count):
            n = _node(contact, place, i)
            for j in range(i + 1, count):
                touched = contact.touched[n, contact.meeting[j]]
                if abs(touched) == step:
                    pair = pair_of(contact, d, nodes, n, _node(contact, place, j))
                    share = _share(contact, i, j)
                    _stay_pair(contact, d, nodes, i, j, pair, share, touched < 0)
        for i in range(count):
            n = _node(contact, place, i)
            for k in range(d):
                nodes.velocity[n, k] += contact.change[i, k]


@noinline
def stay_node(contact, kin, nodes, step, n):
    """The same for the velocity that deforms, where contact acted in `step`."""
    count = _meet(contact, nodes, n)
    if count > 1:
        _stay_place(contact, dimension(kin), nodes, n % contact.stride, count, step)


@kernel
def _stay_nodes(contact, kin, nodes, spans, step):
    """Keep the velocity that deforms from opening or closing contact that acted in `step`.

    Where that velocity is mapped apart from v*, the surfaces would seem to move in it although they
    are pressed together, and stress would do work on nothing: a collision of bars then quadruples
    their energy, or doubles it when only approach is taken away.
    """
    if step == 0:
        return  # nothing has touched yet
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            stay_node(contact, kin, nodes, step, n)


@touch.on(SeparateFields)
def _touch_separate_fields(contact, s):
    _keep_rigid(contact, s.kin, s.nodes, s.spans)
    _touch_nodes(contact, s.kin, s.grids, s.nodes, s.spans, s.control)


@touch_velocity.on(SeparateFields)
def _touch_velocity_separate_fields(contact, s, steps):
    step = int(s.control.values[TIMESTEP]) + steps
    _stay_nodes(contact, s.kin, s.nodes, s.spans, step)
