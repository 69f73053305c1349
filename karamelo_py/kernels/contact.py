"""Contact on the grid between solids that have velocity fields of their own.

Where two fields have mass at a node, the part of their relative velocity by which they approach
each other along their common normal is taken away by an impulse, after Bardenhagen et al. 2001 ("An
improved contact algorithm for the material point method and application to stress propagation in
granular material", CMES 2(4)); friction adds an impulse along the surface, at most mu times as
large (Coulomb). What leaves one field enters the other: momentum is kept to round-off.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from karamelo_py.compile import kernel
from karamelo_py.kernels.arrays import DT
from karamelo_py.kernels.step import touch, touch_velocity
from karamelo_py.points.kinematics import dimension

APART, SLIDES, STICKS = range(3)


class SeparateFields(NamedTuple):
    """Solids touch where their fields meet. F fields of equal grids, S solids."""

    stride: int  # from a node to the same place in the next field
    friction: np.ndarray  # (F, F) coefficient of each pair of fields; infinite: no slip
    pair: np.ndarray  # (F, F) slot of the published force of a pair on its first field, or -1
    slot: np.ndarray  # (F,) slot of the published force on each field
    copies: np.ndarray  # (k, 2) slots: from a field to the other solids that share it
    touching: np.ndarray  # (N,) uint8: whether contact acted last: APART, SLIDES or STICKS
    held: np.ndarray  # (N, d) 1 + slot of the reaction, where a fix prescribes the velocity, else 0


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
def _take(contact, nodes, values, d, a, n, k, impulse, per_mass):
    """A node takes a component of an impulse; one that is held hands it on to what holds it."""
    held = contact.held[n, k]
    if not held:
        change = impulse * per_mass
        nodes.update[n, k] += change
        nodes.update[n, d + k] += change
    force = impulse / values[DT]
    values[contact.slot[a] + k] += force
    if held:
        values[held - 1 + k] -= force


@kernel
def _touch_pair(contact, d, nodes, values, a, b, n, m):
    """The impulse between field `a` at node `n` and field `b` at node `m`, the same place."""
    shares = _shares(contact, d, nodes, n, m)
    size = 0.0
    approach = 0.0
    for k in range(d):
        normal = _outward(nodes, shares, n, m, k)
        size += normal * normal
        approach += normal * (nodes.update[n, k] - nodes.update[m, k])
    if not (approach > 0 and size > 0):
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
    push = approach / compliance
    state = SLIDES
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
            stop = slip * slip * slip / compliance
            if stop <= friction * push:
                state = STICKS
            rub = min(stop, friction * push) / slip
    contact.touching[n] = state
    contact.touching[m] = state
    for k in range(d):
        impulse = push * _outward(nodes, shares, n, m, k) / size
        if rub > 0:
            slide = _slide(contact, nodes, shares, n, m, k, per_a, per_b, push / size)
            impulse += rub * slide
        _take(contact, nodes, values, d, a, n, k, -impulse, per_a)
        _take(contact, nodes, values, d, b, m, k, impulse, per_b)
        if contact.pair[a, b] >= 0:
            values[contact.pair[a, b] + k] -= impulse / values[DT]
        if contact.pair[b, a] >= 0:
            values[contact.pair[b, a] + k] += impulse / values[DT]


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
            contact.touching[n] = APART
    # Spans go field by field, so that pairs are met in the order of their fields.
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            if not nodes.sums[n, 0] > 0:
                continue
            a = n // contact.stride
            for b in range(a + 1, fields):
                m = n + (b - a) * contact.stride
                if nodes.sums[m, 0] > 0:
                    _touch_pair(contact, d, nodes, values, a, b, n, m)
    for c in range(len(contact.copies)):
        for k in range(3):
            values[contact.copies[c, 1] + k] = values[contact.copies[c, 0] + k]


@kernel
def _stay_pair(contact, d, nodes, n, m):
    """Take the relative velocity across the surface, or all of it where the pair sticks."""
    sticks = contact.touching[n] == STICKS and contact.touching[m] == STICKS
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
    push = across / compliance if compliance > 0 else 0.0
    for k in range(d):
        yielding = _yielding(contact.held, n, m, k, per_a, per_b)
        if not yielding > 0:
            continue
        impulse = push * _outward(nodes, shares, n, m, k)
        if sticks:
            impulse = (v[n, k] - v[m, k]) / yielding
        if not contact.held[n, k]:
            v[n, k] -= impulse * per_a
        if not contact.held[m, k]:
            v[m, k] += impulse * per_b


@kernel
def _stay_nodes(contact, kin, nodes, spans):
    """Where contact acted, keep the velocity that deforms the points from opening or closing it.

    Where that velocity is mapped apart from v*, the surfaces would seem to move in it although they
    are pressed together, and stress would do work on nothing: a collision of bars then quadruples
    their energy, or doubles it when only approach is taken away.
    """
    d = dimension(kin)
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            if contact.touching[n] == APART or not nodes.sums[n, 0] > 0:
                continue
            a = n // contact.stride
            for b in range(a + 1, contact.slot.size):
                m = n + (b - a) * contact.stride
                if contact.touching[m] != APART and nodes.sums[m, 0] > 0:
                    _stay_pair(contact, d, nodes, n, m)


@touch.on(SeparateFields)
def _(contact, s):
    _touch_nodes(contact, s.kin, s.nodes, s.spans, s.control.values)


@touch_velocity.on(SeparateFields)
def _(contact, s):
    _stay_nodes(contact, s.kin, s.nodes, s.spans)
