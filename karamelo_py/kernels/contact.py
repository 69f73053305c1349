"""Contact on the grid between solids with separate velocity fields.

Where two fields have mass at a node, an impulse along their common normal removes the approach
velocity (Bardenhagen et al. 2001, CMES 2(4)). Coulomb friction adds a tangential impulse of at most
mu times the normal one. Momentum is conserved to round-off.

Where more than two fields meet, all pairs start from the same velocities, so the order of solids
does not matter. Each impulse is divided by the larger of the two bodies' numbers of approaching
pairs, so that energy does not grow; iterations remove the remaining approach.

Fields overlap up to two cells before the bodies touch. The gap is therefore measured from the mean
positions of each body's points (`karamelo_py.points.basis.surface`), along the normal and along the
grid axes, as normals tilt where faces end. Any positive gap means that convex bodies are apart.

In liquids and granular materials some points lie closer to a wall than their mean suggests, so each
apparent gap would let them sink in. For 100 steps after a contact such bodies may leave a wall, but
not approach it. Liquids are an exception: where their points do not fill the cells, liquids close
1 % of a gap per step, whatever the step size. (If gaps in full cells closed, too, water with APIC
and a linear basis would sink into thin walls by 48 % of a cell in 16 000 steps, not 16 %; with FLIP
1 water sinks by up to 46 %. At more than 1 %, water sinks half a cell into an inclined thin wall in
20 000 steps; at less, a gap remains around a floating box. With such a rule for solids, the force
on a Hertzian disk is 4 % too low.) Only faces towards the other body count, so walls may be one
cell thick.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import kernel, noinline, point_function
from karamelo_py.compiler.fields import Field, field
from karamelo_py.compiler.threads import add_among, shared_out
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import (
    DT,
    MASS,
    ON_UPDATE,
    POST_CONTACT,
    TIMESTEP,
    Nodes,
    Tag,
    of_change,
    of_force,
    of_momentum,
    vector_at,
)
from karamelo_py.kernels.equations.loss import FrictionalHeat, warm_node
from karamelo_py.kernels.equations.mass_momentum import Centre, ContactImpulse, Normal
from karamelo_py.kernels.table import AtNodes, EachNode, Once
from karamelo_py.kernels.totals import (
    CONTACT_LOSS,
    WORK,
    add_to,
    add_torque,
    carry,
    counts,
    publish,
)
from karamelo_py.points.basis.surface import ENTRIES
from karamelo_py.points.grid import node_position
from karamelo_py.points.kinematics import dot, vector, zero_vector

# Mean squared sine of the angle between a body's outward directions and their mean:
SCATTER = 0.003  # at a plane face
EDGE = 0.03  # above which a face ends or is round
FACING = 0.3  # directions with a larger cosine count as the same
FULL = 1.05  # filled fraction of the cells around a node above which a liquid has no gap
MEMORY = 100  # steps after a contact in which bodies without a firm surface approach a wall slowly
FEW = 4  # fields up to which the masses of all of them at a place are looked up
NOWHERE = -1  # after the last place of a list
REPEATS = 16  # iterations for more than two fields; each at least halves the remaining approach


class StrainingChange(Field):
    """Change of a node's straining velocity by the last active contact."""

    shape = staticmethod(lambda kin: kin.dimension)


class SeparateFields(NamedTuple):
    """Contact at nodes where several of F fields have mass; S solids."""

    node_fields = (Normal, Centre, ContactImpulse, StrainingChange)
    looks_beyond = 1  # cells beyond the points' nodes where sums are used

    stride: int  # difference of node numbers between consecutive fields, at one position
    beside: np.ndarray  # (d, 2) stride, and number of nodes, along each axis
    per_mass: np.ndarray  # (F,) specific volume / h^(d - 1)
    friction: np.ndarray  # (F, F) coefficient; infinite: no slip
    warmth: np.ndarray  # (F, F) fraction of frictional heat to the first field
    pair: np.ndarray  # (F, F) slot of the force on the first field, or -1
    slot: np.ndarray  # (F,) slot of the force
    copies: np.ndarray  # (k, 2) slot of a field, slot of another solid that gets its force
    touched: np.ndarray  # (N, F) int32 last step of contact with a later field, < 0: stuck
    prescribed: np.ndarray  # (N, k) 1 + slot of the reaction where v is prescribed, else 0
    reactions: np.ndarray  # number of slots, then the slots; negative for a torque
    forces: np.ndarray  # number of slots, then the slots
    rigid: np.ndarray  # (F,) bool: not moved by contact
    free: np.ndarray  # (F,) bool: rigid and moved by fix rigid_body
    torque: np.ndarray  # (F,) slot of the torque
    torques: np.ndarray  # (values,) slot of the torque of the force in each slot, or 0
    memory: np.ndarray  # (F,) steps for which a contact is remembered
    fluid: np.ndarray  # (F,) bool
    surface: np.ndarray  # (F, k) distance to the surface by mean position, in cells
    places: np.ndarray  # (N,) scratch: nodes where fields meet
    number: np.ndarray  # (stride, 1) scratch: number of fields at a place, of more than `FEW`
    meeting: np.ndarray  # (F,) int64 scratch: fields that meet
    partners: np.ndarray  # (F,) int64 scratch: contacts of each field
    change: np.ndarray  # (F, k) scratch: velocity changes


class Bodies(NamedTuple):
    contact: SeparateFields
    kin: Tag
    nodes: Nodes


# With rotation around an axis there is a further sliding speed, and friction has a torque.


@point_function(otherwise=True)
def around_of(kin, contact, nodes, pair, again):
    """Return sliding speed around the axis, its change per impulse, and speed before the step.

    `again`: from the velocities that strain points, instead of w*. Returns () without rotation.
    """
    return ()


@point_function(otherwise=True)
def take_around(kin, bodies, control, sides, impulse):
    """Apply an impulse on the second side to the angular velocities, and sum the torque."""


@point_function(otherwise=True)
def work_around(kin, nodes, n):
    """Return the work of contact around the axis in the step."""
    return 0.0


@point_function(otherwise=True)
def stay_around(kin, bodies, pair, sides, share):
    """Equalise the angular velocities that strain the points of a sticking pair."""


@point_function(otherwise=True)
def turn(kin, nodes, n, change, again):
    """Add a change to a field's angular velocity, or if `again` to the one that strains points."""


class Where(NamedTuple):
    node: int  # number of the node in the first field
    x: tuple  # (d,)
    h: float
    dt: float
    step: int  # number of the step, from 1


class Touched(NamedTuple):
    """Selects the pairs that were in contact in a step."""

    step: int


class Together(NamedTuple):
    node: int
    count: int  # number of bodies that meet at the node


class Side(NamedTuple):
    field: int
    i: int  # index among the meeting fields
    n: int
    per_mass: float
    x: tuple  # (d,)


class NodePair(NamedTuple):
    n: int
    m: int
    per_n: float  # 1 / mass
    per_m: float
    outward: tuple  # common normal out of the first body, not normalised
    scatter: float  # the smaller scatter of the two outward directions
    yielding: tuple  # (d,) change of relative velocity per impulse
    relative: tuple  # velocity of the first relative to the second
    wall: bool  # exactly one body has a prescribed velocity
    hollow: bool  # a wall with a corner that the other body fills


@noinline
def _immovable(contact, n, k):
    return contact.prescribed[n, k] != 0 or contact.rigid[n // contact.stride]


def _yielding(contact, n, k, per_mass):
    return 0.0 if _immovable(contact, n, k) else per_mass


@noinline
def _led(contact, kin, n):
    """Return True if the velocity is prescribed, so that faces retain their directions."""
    led = False
    for k in range(kin.dimension):
        led = led or _immovable(contact, n, k)
    return led


@noinline
def _place(contact, n, k):
    return n % contact.stride // contact.beside[k, 0] % contact.beside[k, 1]


def _places(bodies, n):
    """Return the indices of node `n` along the axes."""
    return tuple([_place(bodies.contact, n, k) for k in range(bodies.kin.dimension)])


def _kept(contact, place, k):
    return 1.0 if 0 < place < contact.beside[k, 1] - 1 else 0.0


@noinline
def _face(bodies, n, places, which):
    """Return the outward direction at neighbour `which` of node `n`, and whether it exists."""
    contact, kin, nodes = bodies
    ways = [which // 3**k % 3 - 1 for k in range(kin.dimension)]
    beside, inside = n, True
    for k, way in enumerate(ways):
        beside += way * contact.beside[k, 0]
        inside = inside and 0 <= places[k] + way < contact.beside[k, 1]
    at = beside if inside else n
    face = vector_at(kin, field(nodes.fields, Normal), at, 0, zero_vector(kin, 0.0))
    kept = [_kept(contact, places[k] + way, k) for k, way in enumerate(ways)]
    return vector(kin, [a * b for a, b in zip(kept, face, strict=True)]), inside


def _cosine_above(a, b, least):
    return dot(a, b) > least * sqrt(dot(a, a) * dot(b, b))


@noinline
def _normal(bodies, n, other):
    """Return the outward normal of a body, and the squared sine of its scatter.

    The sums of m grad N of neighbouring nodes are averaged with weights 1/4, 1/2, 1/4 along each
    axis. This average is accurate to 2 degrees on a plane face. The sum of a single node has errors
    of tens of degrees while inclined rows of points pass it. A node is omitted if its sum has the
    direction of `other`, the other body's normal: only one face of a thin wall counts.

    The length of the normal is its weight relative to the other body's: it increases with surface
    and decreases with scatter. (With the larger sum, as in Lemiale, Nairn & Hurmane 2010, the
    normal at the edge of a block on a base of equal density is tilted by 15 degrees.)
    """
    contact, kin, _ = bodies
    total, lengths, places = zero_vector(kin, 0.0), 0.0, _places(bodies, n)
    per_mass = contact.per_mass[n // contact.stride]
    for which in range(3**kin.dimension):
        face, inside = _face(bodies, n, places, which)
        if inside:
            term = per_mass * face
            for k in range(kin.dimension):
                term = (0.5 if which // 3**k % 3 == 1 else 0.25) * term
            if not _cosine_above(term, other, FACING):
                total = total + term
                lengths += sqrt(dot(term, term))
    square, scatter = dot(total, total), 1.0
    if square > 0:
        scatter = max(1.0 - square / (lengths * lengths), 0.0) + SCATTER
        total = square / (scatter * scatter) * total
    if kin.hoops:  # no radial component on the axis
        total = vector(kin, [_kept(contact, places[0], 0) * total[0], *total[1:]])
    return total, scatter


@noinline
def _is_hollow(bodies, n, normal, other):
    """Return True if two faces towards the other body face each other around a node."""
    kin, places = bodies.kin, _places(bodies, n)
    turn, square = 0.0, dot(normal, normal)
    for which in range(3**kin.dimension):
        face, inside = _face(bodies, n, places, which)
        if inside and square > 0 and _cosine_above(face, -1.0 * other, FACING):
            way = vector(kin, [float(which // 3**k % 3 - 1) for k in range(kin.dimension)])
            turn += dot(face, way) - dot(face, normal) * dot(way, normal) / square
    return turn < 0


@noinline
def _entering(bodies, n, other, velocity, least):
    """Return the largest velocity component, if above `least`, into a face towards `other`."""
    kin, places = bodies.kin, _places(bodies, n)
    most, penetrating = least, zero_vector(kin, 0.0)
    for which in range(3**kin.dimension):
        face, inside = _face(bodies, n, places, which)
        speed, square = -dot(face, velocity), dot(face, face)
        if inside and speed > most * sqrt(square) and _cosine_above(face, -1.0 * other, FACING):
            most = speed / sqrt(square)
            penetrating = (-speed / square) * face
    return penetrating


def _across(direction, other):
    square = dot(other, other)
    return direction - (dot(direction, other) / square if square > 0 else 0.0) * other


@noinline
def _entering_corner(bodies, n, other, velocity):
    """Return the part of a velocity that enters the faces of a hollow corner.

    The remainder is along a face or edge, or 0. As parts are perpendicular, one impulse is enough.
    """
    least = 1e-6 * sqrt(dot(velocity, velocity))
    first = _entering(bodies, n, other, velocity, least)
    left = velocity - first
    second = _across(_entering(bodies, n, other, left, least), first)
    left = _across(left, second)
    third = _entering(bodies, n, other, left, least)
    return velocity - _across(left, _across(_across(third, first), second))


@noinline
def _normal_of_led(bodies, n, other, velocity, may_be_hollow):
    normal, scatter = _normal(bodies, n, other)
    hollow = may_be_hollow and scatter >= EDGE and _is_hollow(bodies, n, normal, other)
    if hollow:
        into = _entering_corner(bodies, n, other, velocity)
        normal = -1.0 * into if dot(into, into) > 0 else normal
    return normal, scatter, hollow


@noinline
def _pair_of(bodies, records, n, m, may_be_hollow):
    contact, kin, nodes = bodies
    per_n, per_m = 1.0 / nodes.sums[n, MASS], 1.0 / nodes.sums[m, MASS]
    zero = zero_vector(kin, 0.0)
    relative = vector_at(kin, records, n, 0, zero) - vector_at(kin, records, m, 0, zero)
    led_n, led_m = _led(contact, kin, n), _led(contact, kin, m)
    hollow = False
    if led_n and not led_m:
        of_m, scatter_m = _normal(bodies, m, zero)
        of_n, scatter_n, hollow = _normal_of_led(bodies, n, of_m, -1.0 * relative, may_be_hollow)
        if hollow or scatter_n < EDGE:
            of_m = 0.0 * of_m
    elif led_m and not led_n:
        of_n, scatter_n = _normal(bodies, n, zero)
        of_m, scatter_m, hollow = _normal_of_led(bodies, m, of_n, relative, may_be_hollow)
        if hollow or scatter_m < EDGE:
            of_n = 0.0 * of_n
    else:
        of_n, scatter_n = _normal(bodies, n, zero)
        of_m, scatter_m = _normal(bodies, m, zero)
    axes = range(kin.dimension)
    yielding = [_yielding(contact, n, k, per_n) + _yielding(contact, m, k, per_m) for k in axes]
    scatter = min(scatter_n, scatter_m)
    # Opposite tilts of two faces with a common end cancel in the difference.
    outward = of_n - of_m
    wall, yields = led_n != led_m, vector(kin, yielding)
    return NodePair(n, m, per_n, per_m, outward, scatter, yields, relative, wall, hollow)


def _left(pair, push):
    items = zip(pair.relative, pair.outward, pair.yielding, strict=True)
    return pair.relative._make([v - push * n * yielding for v, n, yielding in items])


@noinline
def _reach(bodies, outward, n, where, side):
    """Return the distance along the normal from node `n` to the surface of its body.

    `side` is 1 for the first body, -1 for the second.
    """
    contact, _, nodes = bodies
    centre = field(nodes.fields, Centre)
    mean = 0.0
    for k, component in enumerate(outward):
        mean += side * component * (centre[n, k] / nodes.sums[n, MASS] - where.x[k])
    table = contact.surface[n // contact.stride]
    row = (mean / (sqrt(dot(outward, outward)) * where.h) + 3) * ENTRIES
    low = min(max(int(row), 0), table.size - 2)
    share = min(max(row - low, 0.0), 1.0)
    return where.h * (table[low] + share * (table[low + 1] - table[low]))


@noinline
def _gap(bodies, outward, pair, where):
    gap = -_reach(bodies, outward, pair.n, where, 1)
    return gap - _reach(bodies, outward, pair.m, where, -1)


@noinline
def _is_beyond(bodies, pair, where):
    """Return True for a fluid's node more than half a cell outside of a rigid surface.

    If such nodes stuck to the body, the fluid would come to rest half a cell before the surface.
    """
    contact, led, side = bodies.contact, pair.n, 1
    fluid = contact.fluid[pair.m // contact.stride]
    if contact.rigid[pair.m // contact.stride]:
        led, side, fluid = pair.m, -1, contact.fluid[pair.n // contact.stride]
    if not (fluid and contact.rigid[led // contact.stride]):
        return False
    return _reach(bodies, pair.outward, led, where, side) < -0.5 * where.h


def _directions(bodies, pair):
    """Return further directions along which there may be a gap; zeros where there is none.

    These are the grid axes and, where the faces of both bodies end, the vector between the mean
    positions. Next to a plane face, this vector may be parallel to the face.
    """
    _, kin, nodes = bodies
    centre, zero = field(nodes.fields, Centre), zero_vector(kin, 0.0)
    between = pair.per_m * vector_at(kin, centre, pair.m, 0, zero)
    between = between - pair.per_n * vector_at(kin, centre, pair.n, 0, zero)
    axes = range(kin.dimension)
    along = [[c if i == k else 0.0 for i, c in enumerate(between)] for k in axes]
    across = (1.0 if pair.scatter > EDGE else 0.0) * between
    return across, *[vector(kin, components) for components in along]


@noinline
def _last_contact(bodies, pair):
    """Return the last step of contact at a pair's nodes, 0 if none.

    Nodes that a moving rigid wall has just left are included.
    """
    contact, kin, nodes = bodies
    other = pair.m // contact.stride
    last = abs(contact.touched[pair.n, other])
    led = pair.n if contact.rigid[pair.n // contact.stride] else pair.m
    for k in range(kin.dimension):
        speed = nodes.update[led, k]
        way = -1 if speed > 0 else 1
        inside = 0 <= _place(contact, led, k) + way < contact.beside[k, 1]
        if contact.rigid[led // contact.stride] and speed != 0 and inside:
            last = max(last, abs(contact.touched[pair.n + way * contact.beside[k, 0], other]))
    return last


@noinline
def closing_part(bodies, pair, x, h):
    """Return the fraction of a gap that may close in a step, up to `MEMORY` steps after a contact.

    A liquid has a gap only where its points do not fill the cells around the nodes.
    """
    (contact, kin, nodes), (n, m) = bodies, pair
    a, b = n // contact.stride, m // contact.stride
    filled = contact.per_mass[a] * nodes.sums[n, MASS] + contact.per_mass[b] * nodes.sums[m, MASS]
    # Cells around a node on the axis have a radius, too; this is the sum of two points per cell.
    if filled > FULL * h * max(x[0], 3 / 16 * h) ** kin.hoops:
        return 0.0
    return max(contact.fluid[a] / contact.memory[a], contact.fluid[b] / contact.memory[b])


@noinline
def _excess_of(bodies, pair, where):
    """Return by how much the approach velocity exceeds (gap that may close) / dt, or 0."""
    contact, size = bodies.contact, sqrt(dot(pair.outward, pair.outward))
    if not size > 0:
        return 0.0
    approach = dot(pair.outward, pair.relative)
    if not approach > 0:
        return 0.0
    memory = max(contact.memory[pair.n // contact.stride], contact.memory[pair.m // contact.stride])
    closing = 1.0  # fraction of a gap that may close in this step
    if pair.wall and memory > 1:
        last = _last_contact(bodies, pair)
        # With three bodies, a pair may have touched earlier in this step.
        if last > 0 and last >= where.step - memory:
            closing = closing_part(bodies, (pair.n, pair.m), where.x, where.h)
    for direction in _directions(bodies, pair):
        length = sqrt(dot(direction, direction))
        if length > 0:
            gap = closing * _gap(bodies, direction, pair, where)
            if gap > 0 and dot(direction, pair.relative) * where.dt <= gap * length:
                return 0.0
    gap = closing * _gap(bodies, pair.outward, pair, where)
    return approach / size - max(gap, 0.0) / where.dt


@noinline
def _friction_of(yielding, friction, push, slide, share):
    """Return tangential impulse / sliding speed, and whether the impulse stops all sliding."""
    compliance = dot(slide, slide, yielding)
    if not compliance > 0:
        return 0.0, False
    slip = sqrt(dot(slide, slide))
    stop = share * slip * slip * slip / compliance
    return min(stop, friction * push) / slip, stop <= friction * push


@noinline
def _meet(contact, nodes, n):
    """List the fields that meet at node `n`; return their number (0 if `n` is not in the first)."""
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


def _is_shared(contact, nodes, n):
    """Return True if several fields have mass at node `n`, whose field is the first of them."""
    count, others = 0, 0
    if nodes.sums[n, MASS] > 0:
        a = n // contact.stride
        for b in range(contact.slot.size):
            if nodes.sums[n + (b - a) * contact.stride, MASS] > 0:
                count += 1
                others += 1 if b < a else 0
    return count > 1 and others == 0


@noinline
def _node(contact, node, i):
    return node + contact.meeting[i] * contact.stride


@noinline
def _count_partners(which, bodies, node, count):
    contact, some_pair = bodies.contact, False
    contact.partners[:count] = 0
    for i in range(count):
        n = _node(contact, node, i)
        for j in range(i + 1, count):
            if isinstance(which, Touched):
                belongs = abs(contact.touched[n, contact.meeting[j]]) == which.step
            else:
                m = _node(contact, node, j)
                pair = _pair_of(bodies, bodies.nodes.update, n, m, True)
                belongs = _excess_of(bodies, pair, which) > 0
            if belongs:
                contact.partners[i] += 1
                contact.partners[j] += 1
                some_pair = True
    return some_pair


@noinline
def _share(contact, i, j):
    return 1.0 / max(contact.partners[i], contact.partners[j], 1)


@noinline
def _take(bodies, control, side, k, impulse):
    contact, (field_, i, n, per_mass, x) = bodies.contact, side
    slot = contact.prescribed[n, k]
    if not _immovable(contact, n, k):
        contact.change[i, k] += impulse * per_mass
        field(bodies.nodes.fields, ContactImpulse)[n, k] += impulse
    if not counts(control.ranks, n):
        return
    if _immovable(contact, n, k) and not contact.free[field_]:
        add_to(control.totals, CONTACT_LOSS, -float(impulse * bodies.nodes.update[n, k]))
    force = impulse / control.step[0].kick
    add_to(control.totals, contact.slot[field_] + k, force)
    add_torque(control.totals, contact.torque[field_], x, k, force)
    if slot:
        add_to(control.totals, slot - 1 + k, -force)
        if contact.torques[slot - 1]:
            add_torque(control.totals, contact.torques[slot - 1], x, k, -force)


def _before(kin, nodes, n, per_mass):
    return per_mass * vector_at(kin, nodes.sums, n, of_momentum(kin), zero_vector(kin, 0.0))


@noinline
def _touch_pair(bodies, control, i, j, where):
    contact, kin, nodes = bodies
    share = _share(contact, i, j)
    a, b = contact.meeting[i], contact.meeting[j]
    n, m = _node(contact, where.node, i), _node(contact, where.node, j)
    pair = _pair_of(bodies, nodes.update, n, m, True)
    excess = _excess_of(bodies, pair, where)
    if not excess > 0:
        return
    size = sqrt(dot(pair.outward, pair.outward))
    normal = pair.outward._make([outward / size for outward in pair.outward])
    compliance = dot(normal, normal, pair.yielding)
    if not compliance > 0:
        return  # both velocities are prescribed, so there is no impulse
    push = share * excess / compliance
    left = _left(pair, push / size)
    # Friction does not act on the normal velocity that closes the gap.
    slide = left - dot(pair.outward, left) / (size * size) * pair.outward
    rub, sticks = 0.0, False
    around = around_of(kin, contact, nodes, pair, False)
    slides, yields = (*slide, *around[:1]), (*pair.yielding, *around[1:2])
    if contact.friction[a, b] > 0 and not _is_beyond(bodies, pair, where):
        rub, sticks = _friction_of(yields, contact.friction[a, b], push, slides, share)
    contact.touched[n, b] = -where.step if sticks else where.step
    heat = 0.0
    if rub > 0:
        # Heat is impulse times mean sliding speed in the step, with the effect of internal forces.
        before = _before(kin, nodes, n, pair.per_n) - _before(kin, nodes, m, pair.per_m)
        for speed, first, yielding in zip(slides, (*before, *around[2:3]), yields, strict=True):
            heat += rub * speed * 0.5 * (first + speed * (1.0 - rub * yielding))
        warmth = contact.warmth[a, b]
        warm_node(field(nodes.fields, FrictionalHeat), n, warmth * heat * pair.per_n)
        warm_node(field(nodes.fields, FrictionalHeat), m, (1.0 - warmth) * heat * pair.per_m)
    first, second = Side(a, i, n, pair.per_n, where.x), Side(b, j, m, pair.per_m, where.x)
    if rub > 0:
        for speed in around[:1]:
            take_around(kin, bodies, control, (first, second), rub * speed)
    for k in range(kin.dimension):
        impulse = push * pair.outward[k] / size
        if rub > 0:
            impulse += rub * slide[k]
        _take(bodies, control, first, k, -impulse)
        _take(bodies, control, second, k, impulse)
        for slot, sign in ((contact.pair[a, b], -1.0), (contact.pair[b, a], 1.0)):
            if slot >= 0 and counts(control.ranks, n):
                force = sign * impulse / control.step[0].kick
                add_to(control.totals, slot + k, force)
                if contact.torques[slot]:
                    add_torque(control.totals, contact.torques[slot], where.x, k, force)


@noinline
def _touch_place(bodies, control, count, where):
    contact, kin, nodes = bodies
    last = len(kin.Unknown._fields) - 1
    contact.partners[:count] = 1  # for a single pair, approach is checked later
    for _ in range(REPEATS if count > 2 else 1):
        if count > 2 and not _count_partners(where, bodies, where.node, count):
            return
        contact.change[:count] = 0.0
        for i in range(count):
            for j in range(i + 1, count):
                _touch_pair(bodies, control, i, j, where)
        for i in range(count):
            n = _node(contact, where.node, i)
            for k in range(kin.dimension):
                nodes.update[n, k] += contact.change[i, k]
                nodes.update[n, of_change(kin) + k] += contact.change[i, k]
            turn(kin, nodes, n, contact.change[i, last], False)


@noinline
def _count_work(control, n, work):
    """Add the work of contact on a node's body; the loss is minus the sum over all bodies."""
    if counts(control.ranks, n):
        add_to(control.totals, WORK, work)
        add_to(control.totals, CONTACT_LOSS, -work)


@noinline
def _count_impulses(bodies, control, place, now):
    """Count the work of impulses, with the mean velocities in the step.

    `now`: velocities (N, d) after the step. If they are mapped from the points, FLIP 1 is exact.
    """
    contact, kin, nodes = bodies
    impulse = field(nodes.fields, ContactImpulse)
    for i in range(place.count):
        n, work = _node(contact, place.node, i), 0.0
        for k in range(kin.dimension):
            before = nodes.sums[n, of_momentum(kin) + k] / nodes.sums[n, MASS]
            work += float(impulse[n, k] * 0.5 * (before + now[n, k]))
        _count_work(control, n, work + work_around(kin, nodes, n))


@noinline
def _count_strain(bodies, control, place):
    """Sum half of the stress work lost because contact changes the straining velocity.

    Stress does work with the mean of the straining velocities before and after the forces.
    """
    contact, kin, nodes = bodies
    change = field(nodes.fields, StrainingChange)
    for i in range(place.count):
        n, work = _node(contact, place.node, i), 0.0
        for k in range(kin.dimension):
            work -= float(nodes.sums[n, of_force(kin) + k] * change[n, k])
        _count_work(control, n, 0.5 * control.step[0].kick * work)


@noinline
def _forget_changes(bodies, place):
    change = field(bodies.nodes.fields, StrainingChange)
    for i in range(place.count):
        for k in range(bodies.kin.dimension):
            change[_node(bodies.contact, place.node, i), k] = 0


@noinline
def _begin_to_count(bodies, control, place):
    contact, last = bodies.contact, 0
    for i in range(place.count):
        n = _node(contact, place.node, i)
        for j in range(i + 1, place.count):
            last = max(last, abs(contact.touched[n, contact.meeting[j]]))
    if last > 0 and last == int(control.values[TIMESTEP]):
        _count_strain(bodies, control, place)
    else:
        _forget_changes(bodies, place)


@noinline
def touch_node(bodies, grids, control, n):
    contact = bodies.contact
    count = _meet(contact, bodies.nodes, n)
    if count > 1:
        node, x = n % contact.stride, node_position(record(grids, n // contact.stride), n)
        _begin_to_count(bodies, control, Together(node, count))
        h, step = record(grids, n // contact.stride).h, int(control.values[TIMESTEP]) + 1
        _touch_place(bodies, control, count, Where(node, x, h, control.values[DT], step))


def _begin_node(s, n):
    contact, kin, nodes = s.contact, s.kin, s.nodes
    impulse, change = field(nodes.fields, ContactImpulse), field(nodes.fields, StrainingChange)
    for k in range(len(kin.Unknown._fields)):
        impulse[n, k] = 0
    for k in range(0 if nodes.sums[n, MASS] > 0 else kin.dimension):
        change[n, k] = 0
    if contact.rigid[n // contact.stride] and nodes.sums[n, MASS] > 0:
        for k in range(kin.dimension):
            v = nodes.sums[n, of_momentum(kin) + k] / nodes.sums[n, MASS]
            nodes.update[n, k] = v
            nodes.update[n, of_change(kin) + k] = 0


@kernel
def _begin_forces(s):
    forces = s.contact.forces
    for c in range(1, 1 + forces[0]):
        s.control.totals[forces[c] : forces[c] + 3] = 0


@kernel
def _publish_forces(s):
    contact, control, forces = s.contact, s.control, s.contact.forces
    carry(control.totals[WORK])
    carry(control.totals[CONTACT_LOSS])
    for c in range(1, 1 + forces[0]):
        publish(control, forces[c], 3)
    for c in range(contact.reactions[0]):
        slot = contact.reactions[1 + c]
        if slot < 0:
            publish(control, -slot, 1)
        else:
            publish(control, slot, s.kin.dimension)
            if contact.torques[slot]:
                publish(control, contact.torques[slot], 3)
    for c in range(len(contact.copies)):
        for k in range(3):
            control.values[contact.copies[c, 1] + k] = control.values[contact.copies[c, 0] + k]


def _bodies(s):
    return Bodies(s.contact, s.kin, s.nodes)


@shared_out
def _clear_numbers(s, k):
    for n in range(s.spans[k + 1, 0], s.spans[k + 1, 1]):
        s.contact.number[n % s.contact.stride, 0] = 0


@shared_out
def _count_fields(s, k):
    for n in range(s.spans[k + 1, 0], s.spans[k + 1, 1]):
        if s.nodes.sums[n, MASS] > 0:
            add_among(s.contact.number, n % s.contact.stride, 0, 1)


def _listing(begin):
    """Make a loop that lists the places where fields meet, after ``begin(s, n)`` for each node."""

    @shared_out
    def list_places(s, k):
        first, end = s.spans[k + 1, 0], s.spans[k + 1, 1]
        found = first
        for n in range(first, end):
            begin(s, n)
            some = s.contact.slot.size <= FEW or s.contact.number[n % s.contact.stride, 0] > 1
            if some and _is_shared(s.contact, s.nodes, n):
                s.contact.places[found] = n
                found += 1
        if found < end:
            s.contact.places[found] = NOWHERE

    @kernel
    def loop(s, mode):
        if s.contact.slot.size > FEW:
            _clear_numbers(mode, s.spans[0, 0], s)
            _count_fields(mode, s.spans[0, 0], s)
        list_places(mode, s.spans[0, 0], s)

    return loop


_list_places = _listing(lambda s, n: None)


def _each_place(function, anew):
    """Visit the places where several fields meet, which are listed `anew` or already."""

    @kernel
    def loop(s, mode):
        if anew:
            _list_places(s, mode)
        for k in range(1, 1 + s.spans[0, 0]):
            for q in range(s.spans[k, 0], s.spans[k, 1]):
                if s.contact.places[q] == NOWHERE:
                    break
                function(s, s.contact.places[q])

    return EachNode(function, loop)


SeparateFields.rows = (  # type: ignore[attr-defined]
    Once(_begin_forces),
    EachNode(_begin_node, _listing(_begin_node)),
    _each_place(lambda s, n: touch_node(_bodies(s), s.grids, s.control, n), False),
    Once(_publish_forces),
    AtNodes(POST_CONTACT, ON_UPDATE),
)


class ListedPairs(NamedTuple):
    nodes: np.ndarray  # (n, 2)
    normals: np.ndarray  # (n, d) unit, out of the first body
    gaps: np.ndarray  # (n,)


def has_nodes(contact, spans, r, of):
    """Return True if range `r` has nodes of field `of`."""
    return spans[r, 0] // contact.stride <= of <= (spans[r, 1] - 1) // contact.stride


def _first_field(contact, nodes, n):
    """Return the node of the first field that has mass at the place of node `n`, else `n`."""
    for b in range(n // contact.stride):
        first = n % contact.stride + b * contact.stride
        if nodes.sums[first, MASS] > 0:
            return first
    return n


@kernel
def list_pairs(bodies, grids, spans, pairs, of):
    """Fill `pairs` with the node pairs where field `of` meets others; return their number.

    With `of` < 0, list the pairs of all fields.
    """
    contact, kin, nodes = bodies
    count = 0
    for s in range(1, 1 + spans[0, 0]):
        if of >= 0 and not has_nodes(contact, spans, s, of):
            continue
        for one in range(spans[s, 0], spans[s, 1]):
            if of >= 0 and one // contact.stride != of:
                continue
            first = _first_field(contact, nodes, one) if of >= 0 else one
            meeting = _meet(contact, nodes, first)
            node = first % contact.stride
            grid = record(grids, first // contact.stride)
            where = Where(node, node_position(grid, first), grid.h, 1.0, 0)
            for i in range(meeting if meeting > 1 else 0):
                for j in range(i + 1, meeting):
                    if of >= 0 and contact.meeting[i] != of and contact.meeting[j] != of:
                        continue
                    n, m = _node(contact, node, i), _node(contact, node, j)
                    pair = _pair_of(bodies, nodes.update, n, m, False)
                    size = sqrt(dot(pair.outward, pair.outward))
                    if size > 0:
                        pairs.nodes[count, 0], pairs.nodes[count, 1] = n, m
                        for k in range(kin.dimension):
                            pairs.normals[count, k] = pair.outward[k] / size
                        gap = _gap(bodies, pair.outward, pair, where)
                        for direction in _directions(bodies, pair):
                            if dot(direction, direction) > 0:
                                gap = max(gap, _gap(bodies, direction, pair, where))
                        pairs.gaps[count] = gap
                        count += 1
    return count


@noinline
def _stay_pair(bodies, i, j, pair, sticks):
    """Remove a pair's normal relative velocity, or all of it if it sticks.

    In a corner, the part along v* remains.
    """
    contact, kin, nodes = bodies
    share, taken = _share(contact, i, j), pair.relative
    if pair.hollow:
        zero = zero_vector(kin, 0.0)
        free = vector_at(kin, nodes.update, pair.n, 0, zero)
        free = free - vector_at(kin, nodes.update, pair.m, 0, zero)
        if dot(free, free) > 0:
            taken = taken - dot(taken, free) / dot(free, free) * free
    across = dot(pair.outward, pair.relative)
    compliance = dot(pair.outward, pair.outward, pair.yielding)
    push = share * across / compliance if compliance > 0 else 0.0
    for k, yielding in enumerate(pair.yielding):
        if yielding > 0:
            impulse = push * pair.outward[k]
            if sticks or pair.hollow:
                impulse = share * taken[k] / yielding
            if not _immovable(contact, pair.n, k):
                contact.change[i, k] -= impulse * pair.per_n
            if not _immovable(contact, pair.m, k):
                contact.change[j, k] += impulse * pair.per_m
    if sticks:
        stay_around(kin, bodies, pair, (i, j), share)


@noinline
def _stay_place(bodies, s, place, steps):
    (contact, kin, nodes), (node, count) = bodies, place
    step = int(s.control.values[TIMESTEP]) + steps
    last = len(kin.Unknown._fields) - 1
    if not _count_partners(Touched(step), bodies, node, count):
        return
    for _ in range(REPEATS if count > 2 else 1):
        contact.change[:count] = 0.0
        for i in range(count):
            n = _node(contact, node, i)
            for j in range(i + 1, count):
                touched = contact.touched[n, contact.meeting[j]]
                if abs(touched) == step:
                    pair = _pair_of(bodies, nodes.velocity, n, _node(contact, node, j), True)
                    _stay_pair(bodies, i, j, pair, touched < 0)
        for i in range(count):
            n = _node(contact, node, i)
            for k in range(kin.dimension):
                nodes.velocity[n, k] += contact.change[i, k]
                field(nodes.fields, StrainingChange)[n, k] += contact.change[i, k]
            turn(kin, nodes, n, contact.change[i, last], True)


def _stay(steps):
    """Remove opening and closing of active contacts from the velocity that strains points.

    Otherwise stress does spurious work on surfaces pressed together: the energy of colliding bars
    would grow by a factor of four, or of two if only approach were removed. `steps`: 1 for active
    contacts of this step (v* is known), 0 for contacts of the last step.
    """

    def stay(s, n):
        bodies = _bodies(s)
        count = _meet(bodies.contact, bodies.nodes, n)
        if count > 1:
            place = Together(n % s.contact.stride, count)
            _forget_changes(bodies, place)
            if steps:
                _count_impulses(bodies, s.control, place, s.nodes.velocity)
            if int(s.control.values[TIMESTEP]) + steps > 0:  # none before the first step
                _stay_place(bodies, s, place, steps)
            if steps:
                _count_strain(bodies, s.control, place)

    return (_each_place(stay, not steps),)


def _work_by_update(s, n):
    count = _meet(s.contact, s.nodes, n)
    if count > 1:
        place = Together(n % s.contact.stride, count)
        _count_impulses(_bodies(s), s.control, place, s.nodes.update)
        _count_strain(_bodies(s), s.control, place)  # usf strains once


SeparateFields.rows_before = _stay(0)  # type: ignore[attr-defined]
SeparateFields.rows_after = _stay(1)  # type: ignore[attr-defined]
SeparateFields.rows_work = (_each_place(_work_by_update, False),)  # type: ignore[attr-defined]
