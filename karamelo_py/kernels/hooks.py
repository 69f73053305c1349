"""Compiled hooks of fixes: a scalar function of one component at one node or point.

A fix that is "a formula acting on a group" (all built-in ones are) gives a tiny function; the loops
here choose the members, evaluate the formula over them block by block and apply the function. The
functions are called by address, so a new list of fixes compiles nothing but the functions it adds.

Node function ``(mass, v, v_star, force, value, before, dt, share) -> (v, v_star, force, total)``
    `value` and `before` are the formula at the time of the step and one step earlier, `share` is
    one over the number of members with mass; the totals are summed and published, with what
    a change of v before the update adds to the momentum of points over dt. Of the hooks that hold
    a node, the last to bring v_star to its value decides: it gets what the others had of that node.
    `dt` is the time that forces act for in the step, half of the last step and half of this one.
    Of the velocity that deforms, mapped apart from v_star, v is set; before the forces (usf, usavg)
    that is done with the hooks of the update, where those that hold make it their v_star.
Point function ``(mass, v, x_old, x, value, before, dt, kick) -> (v, x, total)``
    `dt` is the time that the point moves for, `kick` the time that forces act for.
Heat function ``(capacity, T, face, supply, value, other, dt) -> (share, supply, T)``
    acts on points where heat flows: `value` and `other` are the first and the second formula,
    `face` is the area that the point shows, `supply` the heat it gets per time, `share` how much it
    takes of the change of the nodes' temperature. The total is of what it supplies. Of a hook that
    holds, `other` is the temperature that points are brought to.
The node functions of heat see capacity, temperature before and after the step, and heat flow.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import types

from karamelo_py.compiler.compile import caller_of, entered, point_function, shared, subkernel
from karamelo_py.compiler.fields import load_vector
from karamelo_py.compiler.formula import BLOCK, call_evaluate
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import (
    BEFORE,
    FINAL_INTEGRATE,
    INITIAL_INTEGRATE,
    MASS,
    ON_SUMS,
    ON_UPDATE,
    ON_VELOCITY,
    POST_ADVANCE_PARTICLES,
    POST_GRID_TO_POINT,
    POST_HEAT_TO_GRID,
    POST_PARTICLES_TO_GRID,
    POST_UPDATE_GRID_HEAT,
    POST_UPDATE_GRID_STATE,
    POST_VELOCITIES_TO_GRID,
    SUPPLY_HEAT,
    TIME,
    VALUE,
    of_change,
    of_force,
    of_momentum,
)
from karamelo_py.kernels.totals import WORK, add_many, add_to, carry, counts, number_of_all, publish
from karamelo_py.kernels.walls import FRICTION, rub, stick
from karamelo_py.points.grid import node_position
from karamelo_py.points.heat import face
from karamelo_py.points.kinematics import dimension

NONE = np.int64(0)  # a bare 0 would be a type of its own

_F8 = types.float64
NODE_FUNCTION = types.UniTuple(_F8, 4)(*[_F8] * 8)
POINT_FUNCTION = types.UniTuple(_F8, 3)(*[_F8] * 8)
HEAT_FUNCTION = types.UniTuple(_F8, 3)(*[_F8] * 7)

FUNCTIONS = {"nodes": NODE_FUNCTION, "points": POINT_FUNCTION, "heated points": HEAT_FUNCTION}

_call_node_function = caller_of(NODE_FUNCTION)
_call_point_function = caller_of(POINT_FUNCTION)
_call_heat_function = caller_of(HEAT_FUNCTION)


NODE_STAGES = {
    "post_particles_to_grid": POST_PARTICLES_TO_GRID,
    "post_update_grid_state": POST_UPDATE_GRID_STATE,
    "post_velocities_to_grid": POST_VELOCITIES_TO_GRID,
}
POINT_STAGES = {
    "initial_integrate": INITIAL_INTEGRATE,
    "post_grid_to_point": POST_GRID_TO_POINT,
    "post_advance_particles": POST_ADVANCE_PARTICLES,
    "final_integrate": FINAL_INTEGRATE,
}
HEAT_STAGES = {
    "post_heat_to_grid": POST_HEAT_TO_GRID,
    "supply_heat": SUPPLY_HEAT,
    "post_update_grid_heat": POST_UPDATE_GRID_HEAT,
}
STAGES = NODE_STAGES | POINT_STAGES | HEAT_STAGES

COUNT, ACT, RUB = 0, 1, 2  # what is done with the members of a hook


class CompiledHook(NamedTuple):
    """A scalar function that the compiled loop applies to each component of each member."""

    function: Callable
    where: str  # nodes (of heat, too), points, or heated points
    publishes: bool  # its totals become ID_x, ID_y, ID_z
    uses_before: bool  # needs the formulas one step earlier as well
    uses_share: bool  # needs one over the number of members with mass
    holds: bool  # sets v_star, or bounds it: one of several decides; leads a temperature

    @property
    def on_nodes(self) -> bool:
        """Whether it acts on nodes."""
        return self.where == "nodes"

    @property
    def signature(self) -> types.Type:
        """What its function takes and returns."""
        return FUNCTIONS[self.where]


# What a compiled hook acts on at each moment.
ACTS_ON = {
    **dict.fromkeys([*NODE_STAGES, "post_heat_to_grid", "post_update_grid_heat"], "nodes"),
    **dict.fromkeys(POINT_STAGES, "points"),
    "supply_heat": "heated points",
}


def node_hook(
    function: Callable,
    *,
    publishes: bool = True,
    uses_before: bool = False,
    shares: bool = False,
    holds: bool = False,
) -> CompiledHook:
    """A compiled hook on nodes: `function` as described at the head of this file."""
    return CompiledHook(function, "nodes", publishes, uses_before, shares, holds)


def point_hook(
    function: Callable, *, publishes: bool = False, uses_before: bool = False
) -> CompiledHook:
    """A compiled hook on points: `function` as described at the head of this file."""
    return CompiledHook(function, "points", publishes, uses_before, False, False)


def heat_hook(function: Callable, *, publishes: bool = False, holds: bool = False) -> CompiledHook:
    """A compiled hook for ``supply_heat``: `function` as described at the head of this file."""
    return CompiledHook(function, "heated points", publishes, False, False, holds)


@shared
def directions(hooks):
    """How many there are: a number that is read, so that no loop over them is unrolled."""
    return hooks.x0.shape[1]


@subkernel
def _evaluate(hooks, h, component, count, control, result, shift):
    """Formula of one component over the chosen members, at the present time plus `shift`.

    The results go to the row `result` of the scratch.
    """
    time = control.values[TIME]
    control.values[TIME] = time + shift
    program = hooks.programs[h, component]
    call_evaluate(
        hooks.evaluate,
        hooks.code,
        hooks.constants,
        control.values,
        hooks.scratch,
        program.begin,
        program.end,
        program.first,
        program.last,
        count,
        result,
    )
    control.values[TIME] = time


@subkernel
def _locate_nodes(kin, grids, hooks, count):
    """Positions of the chosen nodes."""
    where = hooks.scratch
    for q in range(count):
        n = hooks.chosen[q]
        g = 0
        while g + 1 < grids.first.size and n >= grids.first[g + 1]:
            g += 1
        x = node_position(record(grids, g), n)
        for axis in range(3):
            where[axis, q] = x[axis]
            where[3 + axis, q] = x[axis]


@subkernel
def _clear_held(kin, spans, held):
    """Nobody holds a node yet."""
    if held.size > 0:
        for s in range(1, 1 + spans[0, 0]):
            for n in range(spans[s, 0], spans[s, 1]):
                for c in range(dimension(kin)):
                    held[n, c].slot = 0


@subkernel
def _taken_over(hooks, control, h, n, c, force):
    """Hook `h` holds node `n` by `force`: what those had of it that held it before."""
    before = 0.0
    if hooks.held.size > 0 and hooks.table[h].holds:
        held = hooks.held[n, c]
        if held.slot > 0:
            before = held.force
            if counts(control.ranks, n):
                add_to(control.totals, held.slot - 1, -before)
        held.slot = 1 + hooks.table[h].slot + c
        held.force = before + force
    return before


@subkernel
def _apply_at_nodes(target, kin, nodes, hooks, control, dt, kept, h, count, share):
    """Act on the chosen nodes; add to the totals, and to the work that is done."""
    step_back = min(control.clock[0].last_dt, control.values[TIME])  # nothing was before time 0
    slot = hooks.table[h].slot
    stage = hooks.table[h].stage
    remaps = target == ON_VELOCITY and stage == POST_VELOCITIES_TO_GRID
    # What is strained by before the forces belongs to the last step, and to what held it then.
    strains_first = target == ON_VELOCITY and stage == POST_UPDATE_GRID_STATE
    strains_first = strains_first and hooks.table[h].holds > 0
    given = BEFORE if strains_first and hooks.table[h].uses_before else VALUE
    for c in range(directions(hooks)):
        if hooks.programs[h, c].begin < 0:
            continue
        _evaluate(hooks, h, c, count, control, np.int64(VALUE), 0.0)
        if hooks.table[h].uses_before:
            _evaluate(hooks, h, c, count, control, np.int64(BEFORE), -step_back)
        for q in range(count):
            n = hooks.chosen[q]
            work = before = 0.0
            mass = nodes.sums[n, MASS]
            if target == ON_SUMS:
                v = nodes.sums[n, of_momentum(kin) + c] / mass
                star = v
            elif target == ON_UPDATE:
                star = nodes.update[n, c]
                v = star - nodes.update[n, of_change(kin) + c]
            else:
                v = nodes.velocity[n, c]
                star = v
                last = nodes.update[n, c]  # before the forces, that of the step before
                if remaps or (strains_first and last == hooks.scratch[given, q]):
                    star = last
            old, old_star = v, star
            old_force = nodes.sums[n, of_force(kin) + c]
            v, star, force, total = _call_node_function(
                hooks.table[h].address,
                mass,
                v,
                star,
                old_force,
                hooks.scratch[given, q],
                hooks.scratch[BEFORE, q],
                dt,
                share,
            )
            if target == ON_UPDATE:
                # Points that keep their velocity take the change v* - v: another v is an impulse.
                total += kept * mass * (old - v) / dt
                if star == hooks.scratch[VALUE, q]:
                    before = _taken_over(hooks, control, h, n, c, total)
            # Impulse times the mean of the velocities before and after it.
            if target == ON_SUMS:
                work = dt * (force - old_force) * (v + 0.5 * dt * (force + old_force) / mass)
                nodes.sums[n, of_force(kin) + c] = force
            elif target == ON_UPDATE:
                work = 0.5 * mass * (star - old_star + kept * (old - v)) * (v + star)
                clock = control.clock[0]
                clock.set_low, clock.set_high = min(clock.set_low, star), max(clock.set_high, star)
                nodes.update[n, c] = star
                nodes.update[n, of_change(kin) + c] = star - v
            else:
                nodes.velocity[n, c] = star if strains_first else v
            # Formulas have been taken: their rows hold what is to be added up.
            own = counts(control.ranks, n)
            hooks.scratch[VALUE, q] = total if own else 0.0
            hooks.scratch[BEFORE, q] = work if own else 0.0
            if own and before != 0:
                add_to(control.totals, slot + c, before)
        add_many(control.totals, WORK, hooks.scratch[BEFORE], count)
        if slot >= 0:
            add_many(control.totals, slot + c, hooks.scratch[VALUE], count)


@subkernel
def _rub_at_nodes(target, kin, nodes, hooks, control, dt, kept, h, count):
    """Friction of the chosen nodes along their wall."""
    programs = hooks.programs[h]
    if target == ON_VELOCITY:
        if hooks.table[h].stage == POST_VELOCITIES_TO_GRID:  # else v* is that of the step before
            for q in range(count):
                stick(kin, nodes, programs, hooks.chosen[q])
        return
    _evaluate(hooks, h, FRICTION, count, control, np.int64(VALUE), 0.0)
    slot = hooks.table[h].slot
    for q in range(count):
        n, mu = hooks.chosen[q], hooks.scratch[VALUE, q]
        rub(kin, nodes, programs, hooks.held, n, mu, dt, kept, control, slot)


@subkernel
def clear_total(hooks, h, control):
    """The totals of a hook start from zero."""
    slot = hooks.table[h].slot
    rubs = hooks.programs[h, FRICTION].begin >= 0
    for c in range(3):
        if slot >= 0 and (rubs or hooks.programs[h, c].begin >= 0):
            control.totals[slot + c] = 0


@subkernel
def publish_total(hooks, h, control):
    """Publish the totals of a hook."""
    carry(control.totals[WORK])  # it grows from step to step
    slot = hooks.table[h].slot
    rubs = hooks.programs[h, FRICTION].begin >= 0
    first, last = 3, -1
    for c in range(3):
        if slot >= 0 and (rubs or hooks.programs[h, c].begin >= 0):
            first, last = min(first, c), c
    if last >= 0:
        publish(control, slot + first, last - first + 1)


@subkernel
def _choose_nodes(nodes, spans, hooks, h, span, member):
    """The next members with mass, up to a block: how many, and where to go on."""
    begin = hooks.table[h].begin
    ranges = spans[0, 0] if begin < 0 else 1
    count = 0
    while span < ranges:
        low = spans[1 + span, 0] if begin < 0 else begin
        high = spans[1 + span, 1] if begin < 0 else hooks.table[h].end
        for m in range(max(low, member), high):
            n = m if begin < 0 else hooks.members[m]
            if nodes.sums[n, MASS] > 0:
                hooks.chosen[count] = n
                count += 1
                if count == BLOCK:
                    return count, span, m + 1
        span, member = span + 1, NONE
    return count, span, member


@subkernel
def _go_through(task, target, kin, grids, nodes, spans, hooks, control, dt, kept, h, share):
    """Do `task` with the members that have mass, block by block; return their number here."""
    heavy = 0
    count, span, member = BLOCK, NONE, NONE
    while count == BLOCK:
        count, span, member = _choose_nodes(nodes, spans, hooks, h, span, member)
        if task == COUNT:
            for q in range(count):
                heavy += counts(control.ranks, hooks.chosen[q])
        else:
            _do_at_nodes(task, target, kin, grids, nodes, hooks, control, dt, kept, h, count, share)
    return heavy


@subkernel
def _do_at_nodes(task, target, kin, grids, nodes, hooks, control, dt, kept, h, count, share):
    if hooks.table[h].uses_place:
        _locate_nodes(kin, grids, hooks, count)
    if task == RUB:
        _rub_at_nodes(target, kin, nodes, hooks, control, dt, kept, h, count)
    else:
        _apply_at_nodes(target, kin, nodes, hooks, control, dt, kept, h, count, share)


@entered
def node_hooks(stage, target, kin, grids, nodes, spans, hooks, control, dt, kept):
    """Call the node functions of `stage` on the members that have mass.

    `kept` is the share of its own velocity that a point keeps, and changes by what nodes change by.
    """
    dt = float(dt)
    if target == ON_UPDATE:
        _clear_held(kin, spans, hooks.held)
    for h in range(len(hooks.table)):
        if hooks.table[h].stage != stage:
            continue
        clear_total(hooks, h, control)
        share = 1.0
        if hooks.table[h].uses_share:
            heavy = _go_through(
                COUNT, target, kin, grids, nodes, spans, hooks, control, dt, kept, h, share
            )
            share = 1.0 / max(number_of_all(control.ranks, control, heavy), 1)
        _go_through(ACT, target, kin, grids, nodes, spans, hooks, control, dt, kept, h, share)
        publish_total(hooks, h, control)
    # Walls rub when it is known which of them hold a node.
    for h in range(len(hooks.table)):
        if hooks.table[h].stage != stage:
            continue
        rubs = hooks.programs[h, FRICTION].begin >= 0
        if rubs:
            _go_through(RUB, target, kin, grids, nodes, spans, hooks, control, dt, kept, h, 1.0)
        if rubs or (hooks.table[h].holds and hooks.held.size > 0):
            publish_total(hooks, h, control)


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
def _(what, kin, hooks, control, dt, h, count):
    v, y = what.v, what.y
    step_back = min(control.clock[0].last_dt, control.values[TIME])
    d = directions(hooks)
    for c in range(d):
        if hooks.programs[h, c].begin < 0:
            continue
        _evaluate(hooks, h, c, count, control, np.int64(VALUE), 0.0)
        if hooks.table[h].uses_before:
            _evaluate(hooks, h, c, count, control, np.int64(BEFORE), -step_back)
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
def _(what, kin, hooks, control, dt, h, count):
    _evaluate(hooks, h, 0, count, control, np.int64(VALUE), 0.0)
    if hooks.programs[h, 1].begin >= 0:
        _evaluate(hooks, h, 1, count, control, np.int64(BEFORE), 0.0)
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
def _choose_points(what, ids, hooks, h, p):
    """The next members from point `p` on, up to a block, and where they are before the step.

    Returns how many, and where to go on.
    """
    begin = hooks.table[h].begin
    where = hooks.scratch
    count = 0
    while p < ids.size and count < BLOCK:
        if begin < 0 or hooks.members[begin + ids[p]] != 0:
            hooks.chosen[count] = p
            if hooks.table[h].uses_place:
                for c in range(directions(hooks)):
                    where[c, count] = what.x[c, p]
                    if hooks.x0.shape[0] > 0:
                        where[3 + c, count] = hooks.x0[ids[p], c]
            count += 1
        p += 1
    return count, p


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
    hooks.scratch[:6] = 0.0
    for h in range(len(hooks.table)):
        if hooks.table[h].stage != stage:
            continue
        count, p = BLOCK, NONE
        while count == BLOCK:
            count, p = _choose_points(what, ids, hooks, h, p)
            act_on_points(what, kin, hooks, control, dt, h, count)
