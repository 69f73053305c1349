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
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from karamelo_py.compile import kernel
from karamelo_py.kernels.arrays import DT, TIMESTEP
from karamelo_py.kernels.step import touch, touch_velocity
from karamelo_py.points.kinematics import dimension

REPEATS = 16  # at most, where more than two fields meet; what remains falls by a half or more


class SeparateFields(NamedTuple):
    """Solids touch where their fields meet. F fields of equal grids, S solids."""

    stride: int  # from a node to the same place in the next field
    friction: np.ndarray  # (F, F) coefficient of each pair of fields; infinite: no slip
    pair: np.ndarray  # (F, F) slot of the published force of a pair on its first field, or -1
    slot: np.ndarray  # (F,) slot of the published force on each field
    copies: np.ndarray  # (k, 2) slots: from a field to the other solids that share it
    touched: np.ndarray  # (N, F) int32: the last step (from 1) in which a node touched that of
    #                      another field, which comes later; minus that where the two stuck
    held: np.ndarray  # (N, d) 1 + slot of the reaction, where a fix prescribes the velocity, else 0
    meeting: np.ndarray  # (F,) int64 scratch: the fields that meet at a place
    partners: np.ndarray  # (F,) int64 scratch: with how many others each of them is in contact
    change: np.ndarray  # (F, d) scratch: of the velocity of each of them


@kernel
def _yielding(held, n, m, k, per_a, per_b):
    """Change of the relative velocity with an impulse along direction k."""
    return (0.0 if held[n, k] else per_a) + (0.0 if held[m, k] else per_b)


@kernel
def _shares(contact, d, nodes, n, m):
    """Weights of the two bodies' outward sums in their common normal.

    The sum of m grad N points out of a body. Where a body has little mass or ends in an edge it
    says little about the direction: the larger sum decides (after Lemiale, Nairn & Hurmane 2010),
    equal ones are averaged. A body that is held knows its surface best.
    """
    of_n = 0.0
    of_m = 0.0
    held_n = False
    held_m = False
    for k in range(d):
        of_n += nodes.normal[n, k] * nodes.normal[n, k]
        of_m += nodes.normal[m, k] * nodes.normal[m, k]
        held_n = held_n or contact.held[n, k] != 0
        held_m = held_m or contact.held[m, k] != 0
    if not of_n + of_m > 0:
        return 0.0, 0.0
    if held_n != held_m and (of_n if held_n else of_m) > 0:
        return (1.0, 0.0) if held_n else (0.0, 1.0)
    share = of_n / (of_n + of_m)
    return share**4, (1 - share) ** 4


@kernel
def _outward(nodes, shares, n, m, k):
    """Component k of the common normal, not normalised, from the body at `n` to that at `m`."""
    return shares[0] * nodes.normal[n, k] - shares[1] * nodes.normal[m, k]


@kernel
def _slide(contact, nodes, shares, n, m, k, per_a, per_b, push):
    """Component of the relative velocity once the impulse `push` m grad N has been given."""
    along = push * _outward(nodes, shares, n, m, k)
    yielding = _yielding(contact.held, n, m, k, per_a, per_b)
    return nodes.update[n, k] - nodes.update[m, k] - along * yielding


@kernel
def _take(contact, values, a, i, n, k, impulse, per_mass):
    """A node takes a component of an impulse; one that is held hands it on to what holds it."""
    held = contact.held[n, k]
    if not held:
        contact.change[i, k] += impulse * per_mass
    force = impulse / values[DT]
    values[contact.slot[a] + k] += force
    if held:
        values[held - 1 + k] -= force


@kernel
def _meet(contact, nodes, n):
    """Put the fields that have mass at the place of node `n` into `meeting`; their number.

    It is 0 where a field that comes before that of `n` is among them: a place is visited once.
    """
    a = n // contact.stride
    for b in range(a):
        if nodes.sums[n - (a - b) * contact.stride, 0] > 0:
            return 0
    count = 0
    for b in range(a, contact.slot.size):
        if nodes.sums[n + (b - a) * contact.stride, 0] > 0:
            contact.meeting[count] = b
            count += 1
    return count


@kernel
def _clear_change(contact, d, count):
    for i in range(count):
        for k in range(d):
            contact.change[i, k] = 0.0


@kernel
def _approach(contact, d, nodes, n, m):
    """How fast two bodies approach, times the length of their normal."""
    shares = _shares(contact, d, nodes, n, m)
    approach = 0.0
    for k in range(d):
        normal = _outward(nodes, shares, n, m, k)
        approach += normal * (nodes.update[n, k] - nodes.update[m, k])
    return approach


@kernel
def _touch_pair(contact, d, nodes, values, i, j, place, share):
    """`share` of the impulse between the `i`-th and the `j`-th of the fields that meet."""
    a, b = contact.meeting[i], contact.meeting[j]
    n, m = place + a * contact.stride, place + b * contact.stride
    approach = _approach(contact, d, nodes, n, m)
    if not approach > 0:
        return
    shares = _shares(contact, d, nodes, n, m)
    size = 0.0
    for k in range(d):
        normal = _outward(nodes, shares, n, m, k)
        size += normal * normal
    if not size > 0:
        return
    size = sqrt(size)
    approach /= size
    per_a = 1.0 / nodes.sums[n, 0]
    per_b = 1.0 / nodes.sums[m, 0]
    compliance = 0.0
    for k in range(d):
        normal = _outward(nodes, shares, n, m, k) / size
        compliance += normal * normal * _yielding(contact.held, n, m, k, per_a, per_b)
    if not compliance > 0:
        return  # both are held
    push = share * approach / compliance
    step = int(values[TIMESTEP]) + 1
    rub = 0.0
    friction = contact.friction[a, b]
    slip = 0.0
    if friction > 0:
        compliance = 0.0
        for k in range(d):
            slide = _slide(contact, nodes, shares, n, m, k, per_a, per_b, push / size)
            slip += slide * slide
            compliance += slide * slide * _yielding(contact.held, n, m, k, per_a, per_b)
        slip = sqrt(slip)
        if compliance > 0:
            stop = share * slip * slip * slip / compliance
            if stop <= friction * push:
                step = -step
            rub = min(stop, friction * push) / slip
    contact.touched[n, b] = step
    for k in range(d):
        impulse = push * _outward(nodes, shares, n, m, k) / size
        if rub > 0:
            slide = _slide(contact, nodes, shares, n, m, k, per_a, per_b, push / size)
            impulse += rub * slide
        _take(contact, values, a, i, n, k, -impulse, per_a)
        _take(contact, values, b, j, m, k, impulse, per_b)
        if contact.pair[a, b] >= 0:
            values[contact.pair[a, b] + k] -= impulse / values[DT]
        if contact.pair[b, a] >= 0:
            values[contact.pair[b, a] + k] += impulse / values[DT]


@kernel
def _share(contact, i, j):
    return 1.0 / max(contact.partners[i], contact.partners[j], 1)


@kernel
def _count_approaching(contact, d, nodes, place, count):
    """Note in how many pairs that approach each of the fields is; whether any is."""
    if count == 2:
        contact.partners[:count] = 1  # whether they approach, the pair itself looks at
        return True
    found = False
    contact.partners[:count] = 0
    for i in range(count):
        for j in range(i + 1, count):
            n = place + contact.meeting[i] * contact.stride
            m = place + contact.meeting[j] * contact.stride
            if _approach(contact, d, nodes, n, m) > 0:
                contact.partners[i] += 1
                contact.partners[j] += 1
                found = True
    return found


@kernel
def _touch_place(contact, d, nodes, values, place, count):
    """Resolve contact where `count` fields meet."""
    for _ in range(REPEATS if count > 2 else 1):
        if not _count_approaching(contact, d, nodes, place, count):
            return
        _clear_change(contact, d, count)
        for i in range(count):
            for j in range(i + 1, count):
                share = _share(contact, i, j)
                _touch_pair(contact, d, nodes, values, i, j, place, share)
        for i in range(count):
            n = place + contact.meeting[i] * contact.stride
            for k in range(d):
                nodes.update[n, k] += contact.change[i, k]
                nodes.update[n, d + k] += contact.change[i, k]


@kernel
def _touch_nodes(contact, kin, nodes, spans, values):
    """Resolve contact in v* and the change of velocity of this step; publish the forces."""
    d = dimension(kin)
    fields = contact.slot.size
    for a in range(fields):
        for k in range(3):
            values[contact.slot[a] + k] = 0.0
            for b in range(fields):
                if contact.pair[a, b] >= 0:
                    values[contact.pair[a, b] + k] = 0.0
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            if not nodes.sums[n, 0] > 0:
                continue
            count = _meet(contact, nodes, n)
            if count > 1:
                _touch_place(contact, d, nodes, values, n % contact.stride, count)
    for c in range(len(contact.copies)):
        for k in range(3):
            values[contact.copies[c, 1] + k] = values[contact.copies[c, 0] + k]


@kernel
def _stay_pair(contact, d, nodes, i, j, n, m, share, sticks):
    """Take `share` of the relative velocity across the surface, or of all where the pair sticks."""
    v = nodes.velocity
    per_a = 1.0 / nodes.sums[n, 0]
    per_b = 1.0 / nodes.sums[m, 0]
    shares = _shares(contact, d, nodes, n, m)
    across = 0.0
    compliance = 0.0
    for k in range(d):
        normal = _outward(nodes, shares, n, m, k)
        across += normal * (v[n, k] - v[m, k])
        compliance += normal * normal * _yielding(contact.held, n, m, k, per_a, per_b)
    push = share * across / compliance if compliance > 0 else 0.0
    for k in range(d):
        yielding = _yielding(contact.held, n, m, k, per_a, per_b)
        if not yielding > 0:
            continue
        impulse = push * _outward(nodes, shares, n, m, k)
        if sticks:
            impulse = share * (v[n, k] - v[m, k]) / yielding
        if not contact.held[n, k]:
            contact.change[i, k] -= impulse * per_a
        if not contact.held[m, k]:
            contact.change[j, k] += impulse * per_b


@kernel
def _count_touched(contact, place, count, step):
    """Note in how many pairs that touched in `step` each of the fields is; whether any is."""
    found = False
    contact.partners[:count] = 0
    for i in range(count):
        n = place + contact.meeting[i] * contact.stride
        for j in range(i + 1, count):
            if abs(contact.touched[n, contact.meeting[j]]) == step:
                contact.partners[i] += 1
                contact.partners[j] += 1
                found = True
    return found


@kernel
def _stay_place(contact, d, nodes, place, count, step):
    if not _count_touched(contact, place, count, step):
        return
    for _ in range(REPEATS if count > 2 else 1):
        _clear_change(contact, d, count)
        for i in range(count):
            n = place + contact.meeting[i] * contact.stride
            for j in range(i + 1, count):
                touched = contact.touched[n, contact.meeting[j]]
                if abs(touched) == step:
                    m = place + contact.meeting[j] * contact.stride
                    share = _share(contact, i, j)
                    _stay_pair(contact, d, nodes, i, j, n, m, share, touched < 0)
        for i in range(count):
            n = place + contact.meeting[i] * contact.stride
            for k in range(d):
                nodes.velocity[n, k] += contact.change[i, k]


@kernel
def _stay_nodes(contact, kin, nodes, spans, step):
    """Where contact acted in `step`, keep the velocity that deforms from opening or closing it.

    Where that velocity is mapped apart from v*, the surfaces would seem to move in it although they
    are pressed together, and stress would do work on nothing: a collision of bars then quadruples
    their energy, or doubles it when only approach is taken away.
    """
    if step == 0:
        return  # nothing has touched yet
    d = dimension(kin)
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            if not nodes.sums[n, 0] > 0:
                continue
            count = _meet(contact, nodes, n)
            if count > 1:
                _stay_place(contact, d, nodes, n % contact.stride, count, step)


@touch.on(SeparateFields)
def _(contact, s):
    _touch_nodes(contact, s.kin, s.nodes, s.spans, s.control.values)


@touch_velocity.on(SeparateFields)
def _(contact, s, steps):
    step = int(s.control.values[TIMESTEP]) + steps
    _stay_nodes(contact, s.kin, s.nodes, s.spans, step)
