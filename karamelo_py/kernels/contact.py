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


class SeparateFields(NamedTuple):
    """Solids touch where their fields meet. F fields of equal grids, S solids."""

    stride: int  # from a node to the same place in the next field
    friction: np.ndarray  # (F, F) coefficient of each pair of fields; infinite: no slip
    pair: np.ndarray  # (F, F) slot of the published force of a pair on its first field, or -1
    slot: np.ndarray  # (F,) slot of the published force on each field
    copies: np.ndarray  # (k, 2) slots: from a field to the other solids that share it
    held: np.ndarray  # (N, d) 1 + slot of the reaction, where a fix prescribes the velocity, else 0


@kernel
def _yielding(held, n, m, k, per_a, per_b):
    """Change of the relative velocity with an impulse along direction k."""
    return (0.0 if held[n, k] else per_a) + (0.0 if held[m, k] else per_b)


@kernel
def _slide(contact, nodes, array, n, m, k, per_a, per_b, push):
    """Component of the relative velocity once the impulse `push` m grad N has been given."""
    along = push * (nodes.normal[n, k] - nodes.normal[m, k])
    yielding = _yielding(contact.held, n, m, k, per_a, per_b)
    return array[n, k] - array[m, k] - along * yielding


@kernel
def _take(contact, array, updates, values, d, a, n, k, impulse, per_mass):
    """A node takes a component of an impulse; one that is held hands it on to what holds it."""
    held = contact.held[n, k]
    if not held:
        change = impulse * per_mass
        array[n, k] += change
        if updates:
            array[n, d + k] += change
    if updates:
        force = impulse / values[DT]
        values[contact.slot[a] + k] += force
        if held:
            values[held - 1 + k] -= force


@kernel
def _touch_pair(contact, d, nodes, array, updates, values, a, b, n, m):
    """The impulse between field `a` at node `n` and field `b` at node `m`, the same place."""
    size = 0.0
    approach = 0.0
    for k in range(d):
        # Sums of m grad N point out of a body. One normal for both keeps momentum.
        normal = nodes.normal[n, k] - nodes.normal[m, k]
        size += normal * normal
        approach += normal * (array[n, k] - array[m, k])
    if not (approach > 0 and size > 0):
        return
    size = sqrt(size)
    approach /= size
    per_a = 1.0 / nodes.sums[n, 0]
    per_b = 1.0 / nodes.sums[m, 0]
    compliance = 0.0
    for k in range(d):
        normal = (nodes.normal[n, k] - nodes.normal[m, k]) / size
        compliance += normal * normal * _yielding(contact.held, n, m, k, per_a, per_b)
    if not compliance > 0:
        return  # both are held
    push = approach / compliance
    rub = 0.0
    friction = contact.friction[a, b]
    slip = 0.0
    if friction > 0:
        compliance = 0.0
        for k in range(d):
            slide = _slide(contact, nodes, array, n, m, k, per_a, per_b, push / size)
            slip += slide * slide
            compliance += slide * slide * _yielding(contact.held, n, m, k, per_a, per_b)
        slip = sqrt(slip)
        if compliance > 0:
            rub = min(slip * slip * slip / compliance, friction * push) / slip
    for k in range(d):
        impulse = push * (nodes.normal[n, k] - nodes.normal[m, k]) / size
        if rub > 0:
            slide = _slide(contact, nodes, array, n, m, k, per_a, per_b, push / size)
            impulse += rub * slide
        _take(contact, array, updates, values, d, a, n, k, -impulse, per_a)
        _take(contact, array, updates, values, d, b, m, k, impulse, per_b)
        if updates:
            if contact.pair[a, b] >= 0:
                values[contact.pair[a, b] + k] -= impulse / values[DT]
            if contact.pair[b, a] >= 0:
                values[contact.pair[b, a] + k] += impulse / values[DT]


@kernel
def _touch_nodes(contact, kin, nodes, array, updates, spans, values):
    """Resolve contact in `array`, the velocity in its first d columns.

    With `updates`, its next columns hold the change of velocity in this step, which changes alike,
    and forces are published.
    """
    d = dimension(kin)
    fields = contact.slot.size
    if updates:
        for a in range(fields):
            for k in range(3):
                values[contact.slot[a] + k] = 0.0
                for b in range(fields):
                    if contact.pair[a, b] >= 0:
                        values[contact.pair[a, b] + k] = 0.0
    # Spans go field by field, so that pairs are met in the order of their fields.
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            if not nodes.sums[n, 0] > 0:
                continue
            a = n // contact.stride
            for b in range(a + 1, fields):
                m = n + (b - a) * contact.stride
                if nodes.sums[m, 0] > 0:
                    _touch_pair(contact, d, nodes, array, updates, values, a, b, n, m)
    if updates:
        for c in range(len(contact.copies)):
            for k in range(3):
                values[contact.copies[c, 1] + k] = values[contact.copies[c, 0] + k]


@touch.on(SeparateFields)
def _(contact, s):
    _touch_nodes(contact, s.kin, s.nodes, s.nodes.update, True, s.spans, s.control.values)


@touch_velocity.on(SeparateFields)
def _(contact, s):
    _touch_nodes(contact, s.kin, s.nodes, s.nodes.velocity, False, s.spans, s.control.values)
