"""Compiled hooks of fixes on points: velocities, places, heat (`karamelo_py.kernels.hooks`)."""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.addresses import caller_of
from karamelo_py.compiler.compile import point_function
from karamelo_py.compiler.fields import load_vector
from karamelo_py.compiler.formula import BLOCK
from karamelo_py.compiler.held import hold
from karamelo_py.compiler.loops import entered, subkernel
from karamelo_py.compiler.threads import Serial, Threaded, shared_out
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import BEFORE, TIME, VALUE
from karamelo_py.kernels.hooks import (
    HEAT_FUNCTION,
    NONE,
    POINT_FUNCTION,
    clear_total,
    directions,
    evaluate,
    publish_total,
    with_items_of,
)
from karamelo_py.kernels.totals import WORK, add_to, hand_over
from karamelo_py.points.heat import face

TURN = 4 * BLOCK  # points that a thread takes at a time
_call_point_function = caller_of(POINT_FUNCTION)
_call_heat_function = caller_of(HEAT_FUNCTION)


class Motion(NamedTuple):
    """What point functions change: velocity, and the places y that follow from x.

    Behind the d coordinates of a point, `y` has those of `corners` corners of its domain.
    """

    v: np.ndarray  # (d, n)
    mass: np.ndarray
    x: np.ndarray  # (w, n)
    y: np.ndarray
    corners: int


class Warmth(NamedTuple):
    """What heat functions change: the heat that points get."""

    capacity: np.ndarray  # (1, n)
    temperature: np.ndarray
    volume: np.ndarray
    supply: np.ndarray
    share: np.ndarray
    mass: np.ndarray
    x: np.ndarray  # (w, n)


@point_function()
def act_on_points(what, kin, hooks, control, dt, h, count):
    """Call a function for the chosen points; add to the totals."""


@act_on_points.on(Motion)
def _act_on_points_motion(what, kin, hooks, control, dt, h, count):
    v, y = what.v, what.y
    step_back = min(control.clock[0].last_dt, control.values[TIME])
    d = directions(hooks)
    for c in range(d):
        if hooks.programs[h, c].begin < 0:
            continue
        evaluate(hooks, h, c, count, control, np.int64(VALUE), 0.0)
        if hooks.table[h].uses_before:
            evaluate(hooks, h, c, count, control, np.int64(BEFORE), -step_back)
        slot = hooks.table[h].slot
        for q in range(count):
            p = hooks.chosen[q]
            velocity, place, total = _call_point_function(
                hooks.table[h].address,
                what.mass[p],
                v[c, p],
                what.x[c, p],
                y[c, p],
                hooks.scratch[VALUE, q],
                hooks.scratch[BEFORE, q],
                dt,
                control.clock[0].kick,
            )
            speed = float(v[c, p])
            work = 0.5 * float(what.mass[p]) * (velocity * velocity - speed * speed)
            add_to(control.totals, WORK, work)
            v[c, p] = velocity
            # As far as a point moves, its corners do.
            for corner in range(what.corners):
                y[d + d * corner + c, p] += place - y[c, p]
            y[c, p] = place
            if slot >= 0:
                add_to(control.totals, slot + c, total)


@act_on_points.on(Warmth)
def _act_on_points_warmth(what, kin, hooks, control, dt, h, count):
    evaluate(hooks, h, 0, count, control, np.int64(VALUE), 0.0)
    if hooks.programs[h, 1].begin >= 0:
        evaluate(hooks, h, 1, count, control, np.int64(BEFORE), 0.0)
    slot = hooks.table[h].slot
    clock = control.clock[0]
    for q in range(count):
        p = hooks.chosen[q]
        before = what.supply[0, p]
        share, supply, T = _call_heat_function(
            hooks.table[h].address,
            what.capacity[0, p],
            what.temperature[0, p],
            face(kin, what.volume[0, p], load_vector(kin, what.x, p)),
            before,
            hooks.scratch[VALUE, q],
            hooks.scratch[BEFORE, q],
            dt,
        )
        what.share[0, p] = min(what.share[0, p], share)
        what.supply[0, p] = supply
        what.temperature[0, p] = T
        if slot >= 0:
            add_to(control.totals, slot, supply - before)
        # What a temperature is led to bounds it: what it has come to be says nothing.
        if hooks.table[h].holds > 0:
            T = hooks.scratch[BEFORE, q]
        elif what.capacity[0, p] > 0:
            # What the fastest point takes, another may have got before.
            rate = supply / what.capacity[0, p]
            clock.rise, clock.fall = max(clock.rise, rate), min(clock.fall, rate)
        if share == 0 or hooks.table[h].holds > 0:
            clock.coldest, clock.hottest = min(clock.coldest, T), max(clock.hottest, T)


@subkernel
def _choose_points(what, ids, hooks, h, p, end):
    """The next members from `p` to before `end`, up to a block; where they are before the step.

    Returns how many, and where to go on.
    """
    begin = hooks.table[h].begin
    where = hooks.scratch
    count = 0
    while p < end and count < BLOCK:
        if begin < 0 or hooks.members[begin + (ids[p] >> 6)] >> (ids[p] & 63) & 1 != 0:
            hooks.chosen[count] = p
            if hooks.table[h].uses_place:
                for c in range(directions(hooks)):
                    where[c, count] = what.x[c, p]
                    if hooks.x0.shape[0] > 0:
                        where[3 + c, count] = hooks.x0[ids[p], c]
            count += 1
        p += 1
    return count, p


@subkernel
def _act_on_range(what, kin, ids, hooks, control, dt, h, p, end):
    """Call the function of hook `h` on its members from point `p` to before `end`."""
    hooks.scratch[:6] = 0.0
    count = BLOCK
    while count == BLOCK:
        count, p = _choose_points(what, ids, hooks, h, p, end)
        act_on_points(what, kin, hooks, control, dt, h, count)


@subkernel
def _act_on_part(what, kin, ids, hooks, control, dt, h, k):
    """The part of thread `k`, with a scratch and totals of its own: totals do not round."""
    own = record(hooks.apart, k)
    for i in range(control.values.size):
        own.values[i] = control.values[i]
    clock, there = control.clock[0], own.clock[0]
    there.last_dt, there.kick = clock.last_dt, clock.kick
    there.rise, there.fall = clock.rise, clock.fall
    there.coldest, there.hottest = clock.coldest, clock.hottest
    parts = hooks.apart.chosen.shape[0]
    here, mine = hold(with_items_of(hooks, own)), hold(with_items_of(control, own))
    # By turns: members may lie beside each other.
    for first in range(k * TURN, ids.size, parts * TURN):
        end = min(first + TURN, ids.size)
        _act_on_range(what, kin, ids, here, mine, dt, h, first, end)
    hand_over(own.totals, control.totals, WORK)
    slot = hooks.table[h].slot
    for row in range(max(slot, 0), min(slot + 3, own.totals.shape[0]) if slot >= 0 else 0):
        hand_over(own.totals, control.totals, row)


_act_on_parts = shared_out(_act_on_part, "what, kin, ids, hooks, control, dt, h")


@point_function()
def act_on_all(mode, what, kin, ids, hooks, control, dt, h):
    """Call the function of a hook on all its members in a block."""


@act_on_all.on(Serial)
def _act_on_all_serial(mode, what, kin, ids, hooks, control, dt, h):
    _act_on_range(what, kin, ids, hooks, control, dt, h, NONE, ids.size)


@act_on_all.on(Threaded)
def _act_on_all_threaded(mode, what, kin, ids, hooks, control, dt, h):
    parts = hooks.apart.chosen.shape[0]
    _act_on_parts(mode, parts, what, kin, ids, hooks, control, dt, h)
    clock = control.clock[0]
    for k in range(parts):
        own = hooks.apart.clock[k, 0]
        clock.rise, clock.fall = max(clock.rise, own.rise), min(clock.fall, own.fall)
        clock.coldest = min(clock.coldest, own.coldest)
        clock.hottest = max(clock.hottest, own.hottest)


@entered
def clear_totals(stage, hooks, control):
    """Totals of point functions start from zero: they are summed over the blocks."""
    for h in range(len(hooks.table)):
        if hooks.table[h].stage == stage:
            clear_total(hooks, h, control)


@entered
def publish_totals(stage, hooks, control):
    """Publish the totals of point functions."""
    for h in range(len(hooks.table)):
        if hooks.table[h].stage == stage:
            publish_total(hooks, h, control)


@entered
def point_hooks(stage, what, kin, ids, hooks, control, dt):
    """Call the point functions of `stage` on the members in a block."""
    dt = float(dt)
    for h in range(len(hooks.table)):
        if hooks.table[h].stage == stage:
            act_on_all(hooks.mode, what, kin, ids, hooks, control, dt, h)
