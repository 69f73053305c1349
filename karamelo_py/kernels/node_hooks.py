"""Compiled hooks of fixes on nodes, those of heat too (`karamelo_py.kernels.hooks`)."""

import numpy as np

from karamelo_py.compiler.addresses import caller_of
from karamelo_py.compiler.compile import point_function, shared
from karamelo_py.compiler.formula import BLOCK
from karamelo_py.compiler.held import hold
from karamelo_py.compiler.loops import entered, subkernel
from karamelo_py.compiler.threads import Serial, Threaded, shared_out
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels import arrays, totals
from karamelo_py.kernels.hooks import (
    NODE_FUNCTION,
    NONE,
    clear_total,
    directions,
    evaluate,
    publish_total,
    with_items_of,
)
from karamelo_py.kernels.loss import FrictionalHeat
from karamelo_py.kernels.searching import first_from
from karamelo_py.kernels.walls import FRICTION, rub, stick
from karamelo_py.points.grid import node_position
from karamelo_py.points.kinematics import dimension, planar

_call_node_function = caller_of(NODE_FUNCTION)

COUNT, ACT, RUB, LOADS = 0, 1, 2, 3  # what is done with the members of a hook
DONE = -1  # in the place of a stage
END = np.iinfo(np.int64).max  # behind the last of them


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
def _clear_held(kin, ranges, held):
    """Nobody holds a node yet."""
    if held.size > 0:
        for r in range(ranges[0, 0], ranges[ranges[0, 0] - 1, 1]):
            for n in range(ranges[r, 0], ranges[r, 1]):
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
            if totals.counts(control.ranks, n):
                totals.add_to(control.totals, held.slot - 1, -before)
        held.slot = 1 + hooks.table[h].slot + c
        held.force = before + force
    return before


@subkernel
def _apply_at_nodes(target, kin, nodes, hooks, control, dt, kept, h, count, share):
    """Act on the chosen nodes; add to the totals, and to the work that is done."""
    step_back = min(
        control.clock[0].last_dt, control.values[arrays.TIME]
    )  # nothing was before time 0
    slot = hooks.table[h].slot
    stage = hooks.table[h].stage
    remaps = target == arrays.ON_VELOCITY and stage == arrays.POST_VELOCITIES_TO_GRID
    # What is strained by before the forces belongs to the last step, and to what held it then.
    strains_first = target == arrays.ON_VELOCITY and stage == arrays.POST_UPDATE_GRID_STATE
    strains_first = strains_first and hooks.table[h].holds > 0
    given = arrays.BEFORE if strains_first and hooks.table[h].uses_before else arrays.VALUE
    for c in range(directions(hooks)):
        if hooks.programs[h, c].begin < 0:
            continue
        evaluate(hooks, h, c, count, control, np.int64(arrays.VALUE), 0.0)
        if hooks.table[h].uses_before:
            evaluate(hooks, h, c, count, control, np.int64(arrays.BEFORE), -step_back)
        for q in range(count):
            n = hooks.chosen[q]
            work = before = 0.0
            mass = nodes.sums[n, arrays.MASS]
            if target == arrays.ON_SUMS:
                v = nodes.sums[n, arrays.of_momentum(kin) + c] / mass
                star = v
            elif target == arrays.ON_UPDATE:
                star = nodes.update[n, c]
                v = star - nodes.update[n, arrays.of_change(kin) + c]
            else:
                v = nodes.velocity[n, c]
                star = v
                last = nodes.update[n, c]  # before the forces, that of the step before
                if remaps or (strains_first and last == hooks.scratch[given, q]):
                    star = last
            old, old_star = v, star
            old_force = nodes.sums[n, arrays.of_force(kin) + c]
            v, star, force, total = _call_node_function(
                hooks.table[h].address,
                mass,
                v,
                star,
                old_force,
                hooks.scratch[given, q],
                hooks.scratch[arrays.BEFORE, q],
                dt,
                share,
            )
            if target == arrays.ON_UPDATE:
                # Points that keep their velocity take the change v* - v: another v is an impulse.
                total += kept * mass * (old - v) / dt
                if star == hooks.scratch[arrays.VALUE, q]:
                    before = _taken_over(hooks, control, h, n, c, total)
            if target == arrays.ON_SUMS:
                hooks.loads[n, c] += force - old_force  # see _work_of_loads
                nodes.sums[n, arrays.of_force(kin) + c] = force
            elif target == arrays.ON_UPDATE:
                # Impulse times the mean of the velocities before and after it.
                work = 0.5 * mass * (star - old_star + kept * (old - v)) * (v + star)
                clock = control.clock[0]
                clock.set_low, clock.set_high = min(clock.set_low, star), max(clock.set_high, star)
                nodes.update[n, c] = star
                nodes.update[n, arrays.of_change(kin) + c] = star - v
            else:
                nodes.velocity[n, c] = star if strains_first else v
            # Formulas have been taken: their rows hold what is to be added up.
            own = totals.counts(control.ranks, n)
            hooks.scratch[arrays.VALUE, q] = total if own else 0.0
            hooks.scratch[arrays.BEFORE, q] = work if own else 0.0
            if own and before != 0:
                totals.add_to(control.totals, slot + c, before)
        totals.add_many(control.totals, totals.WORK, hooks.scratch[arrays.BEFORE], count)
        if slot >= 0:
            totals.add_many(control.totals, slot + c, hooks.scratch[arrays.VALUE], count)


@subkernel
def _rub_at_nodes(target, kin, nodes, hooks, control, dt, kept, h, count):
    """Friction of the chosen nodes along their wall."""
    programs = hooks.programs[h]
    if target == arrays.ON_VELOCITY:
        if (
            hooks.table[h].stage == arrays.POST_VELOCITIES_TO_GRID
        ):  # else v* is that of the step before
            for q in range(count):
                stick(kin, nodes, programs, hooks.chosen[q])
        return
    evaluate(hooks, h, FRICTION, count, control, np.int64(arrays.VALUE), 0.0)
    slot = hooks.table[h].slot
    for q in range(count):
        n, mu = hooks.chosen[q], hooks.scratch[arrays.VALUE, q]
        rub(kin, nodes, programs, hooks.held, n, mu, dt, kept, control, slot)


@subkernel
def _node(hooks, h, m):
    """The number of a member of the group; where that is of all nodes, `m` itself."""
    if hooks.table[h].begin < 0:
        return m
    return hooks.members[m] if m < hooks.table[h].end else END


@subkernel
def _choose_nodes(nodes, ranges, hooks, h, row, end, member):
    """The next members in use with mass, up to a block: how many, and where to go on."""
    of_all = hooks.table[h].begin < 0
    behind = hooks.table[h].end
    member = max(member, hooks.table[h].begin)
    count = 0
    # Members ascend as rows do: a wall may have many more nodes than a body reaches.
    while row < end:
        low, high = ranges[row, 0], ranges[row, 1]
        if of_all:
            member = max(member, low)
        elif member < behind and hooks.members[member] < low:
            member = first_from(hooks.members, member, behind, low)
        n = _node(hooks, h, member)
        while n < high:
            member += 1
            if nodes.sums[n, arrays.MASS] > 0:
                hooks.chosen[count] = n
                count += 1
                if count == BLOCK:
                    return count, row, member
            n = _node(hooks, h, member)
        row += 1
    return count, row, member


@subkernel
def _go_through(
    task, target, kin, grids, nodes, ranges, hooks, control, dt, kept, h, share, first, end
):
    """Do `task` with the members that have mass in shares of the nodes; return their number."""
    heavy = 0
    for k in range(first, end):
        count, row, member = BLOCK if task != LOADS else 0, ranges[k, 0], NONE
        if task == LOADS:
            _work_at_nodes(kin, nodes, ranges, hooks, control, dt, k)
        while count == BLOCK:
            count, row, member = _choose_nodes(nodes, ranges, hooks, h, row, ranges[k, 1], member)
            if task == COUNT:
                for q in range(count):
                    heavy += totals.counts(control.ranks, hooks.chosen[q])
            elif count > 0:
                _do_at_nodes(
                    task, target, kin, grids, nodes, hooks, control, dt, kept, h, count, share
                )
    return heavy


@subkernel
def _do_at_nodes(task, target, kin, grids, nodes, hooks, control, dt, kept, h, count, share):
    if hooks.table[h].uses_place:
        _locate_nodes(kin, grids, hooks, count)
    if task == RUB:
        _rub_at_nodes(target, kin, nodes, hooks, control, dt, kept, h, count)
    else:
        _apply_at_nodes(target, kin, nodes, hooks, control, dt, kept, h, count, share)


@subkernel
def _work_at_nodes(kin, nodes, ranges, hooks, control, dt, k):
    """Work of the loads on the nodes of the k-th share."""
    count = 0
    for r in range(ranges[k, 0], ranges[k, 1]):
        for n in range(ranges[r, 0], ranges[r, 1]):
            for c in range(dimension(kin)):
                load = hooks.loads[n, c]
                if load == 0:
                    continue
                hooks.loads[n, c] = 0
                if not totals.counts(control.ranks, n):
                    continue
                change = nodes.update[n, arrays.of_change(kin) + c]
                hooks.scratch[arrays.VALUE, count] = dt * load * (nodes.update[n, c] - 0.5 * change)
                count += 1
                if count == BLOCK:
                    totals.add_many(control.totals, totals.WORK, hooks.scratch[arrays.VALUE], count)
                    count = 0
    totals.add_many(control.totals, totals.WORK, hooks.scratch[arrays.VALUE], count)


# --- threads ----------------------------------------------------------------------------------


@subkernel
def _go_through_part(
    task, target, kin, grids, nodes, ranges, hooks, control, dt, kept, h, share, k
):
    """The part of thread `k`, with a scratch and totals of its own: totals do not round."""
    apart = hooks.apart
    own = record(apart, k)
    for i in range(control.values.size):
        own.values[i] = control.values[i]
    clock = own.clock[0]
    clock.last_dt, clock.set_low, clock.set_high = control.clock[0].last_dt, np.inf, -np.inf
    here, mine = hold(with_items_of(hooks, own)), hold(with_items_of(control, own))
    shares, parts = ranges[0, 0], apart.chosen.shape[0]
    first, end = shares * k // parts, shares * (k + 1) // parts
    _go_through(
        task, target, kin, grids, nodes, ranges, here, mine, dt, kept, h, share, first, end
    )  # fmt: skip
    totals.hand_over(own.totals, control.totals, totals.WORK)
    for other in range(len(hooks.table)):
        slot = hooks.table[other].slot
        for row in range(max(slot, 0), min(slot + 3, own.totals.shape[0]) if slot >= 0 else 0):
            totals.hand_over(own.totals, control.totals, row)


_go_through_parts = shared_out(
    _go_through_part,
    "task, target, kin, grids, nodes, ranges, hooks, control, dt, kept, h, share",
)


@point_function()
def go_through(mode, task, target, kin, grids, nodes, ranges, hooks, control, dt, kept, h, share):
    """Do `task` with all members of a hook that have mass."""


@go_through.on(Serial)
def _go_through_serial(
    mode, task, target, kin, grids, nodes, ranges, hooks, control, dt, kept, h, share
):
    _go_through(
        task, target, kin, grids, nodes, ranges, hooks, control, dt, kept, h, share,
        NONE, ranges[0, 0],
    )  # fmt: skip


@go_through.on(Threaded)
def _go_through_threaded(
    mode, task, target, kin, grids, nodes, ranges, hooks, control, dt, kept, h, share
):
    parts = hooks.apart.chosen.shape[0]
    _go_through_parts(
        mode, parts, task, target, kin, grids, nodes, ranges, hooks, control, dt, kept, h, share
    )
    if target == arrays.ON_UPDATE:
        clock = control.clock[0]
        for k in range(parts):
            clock.set_low = min(clock.set_low, hooks.apart.clock[k, 0].set_low)
            clock.set_high = max(clock.set_high, hooks.apart.clock[k, 0].set_high)


@subkernel
def _work_of_loads(kin, grids, nodes, ranges, hooks, control, dt):
    """Add up what the loads on nodes have done, and forget them; v* is that of the points now.

    Force times the mean of the velocities before and after the step: what stress and those who hold
    a node do to it in the same step counts, or the work would be of first order.
    """
    if hooks.loads.size == 0:
        return
    go_through(
        hooks.mode,
        LOADS,
        arrays.ON_SUMS,
        kin,
        grids,
        nodes,
        ranges,
        hooks,
        control,
        dt,
        0.0,
        NONE,
        1.0,
    )
    totals.carry(control.totals[totals.WORK])


@shared
def _rubbed_alone(nodes):
    """The nodes with that of their declared fields which walls know."""
    fields = tuple([one for one in nodes.fields if type(one) is FrictionalHeat])
    return arrays.Nodes(nodes.sums, nodes.update, nodes.velocity, fields)


@shared
def node_hooks(stage, target, kin, grids, nodes, ranges, hooks, control, dt, kept):
    """Call the node functions of `stage` on the members that have mass.

    `kept` is the share of its own velocity that a point keeps, and changes by what nodes change by.
    When all is `DONE` the work of the loads is added up: here, so that the way through the nodes is
    compiled once.
    """
    nodes = _rubbed_alone(nodes)
    _node_hooks(
        stage, target, planar(kin), grids, nodes, ranges, hooks, control, float(dt), kept
    )  # fmt: skip


@entered
def _node_hooks(stage, target, kin, grids, nodes, ranges, hooks, control, dt, kept):
    if stage == DONE:
        _work_of_loads(kin, grids, nodes, ranges, hooks, control, dt)
        return
    if target == arrays.ON_UPDATE:
        _clear_held(kin, ranges, hooks.held)
    for h in range(len(hooks.table)):
        if hooks.table[h].stage != stage:
            continue
        clear_total(hooks, h, control)
        share = 1.0
        if hooks.table[h].uses_share:
            heavy = _go_through(
                COUNT, target, kin, grids, nodes, ranges, hooks, control, dt, kept, h, share,
                NONE, ranges[0, 0],
            )  # fmt: skip
            share = 1.0 / max(totals.number_of_all(control.ranks, control, heavy), 1)
        go_through(
            hooks.mode, ACT, target, kin, grids, nodes, ranges, hooks, control, dt, kept, h, share
        )
        publish_total(hooks, h, control)
    # Walls rub when it is known which of them hold a node.
    for h in range(len(hooks.table)):
        if hooks.table[h].stage != stage:
            continue
        rubs = hooks.programs[h, FRICTION].begin >= 0
        if rubs:
            go_through(
                hooks.mode, RUB, target, kin, grids, nodes, ranges, hooks, control, dt, kept, h, 1.0
            )
        if rubs or (hooks.table[h].holds and hooks.held.size > 0):
            publish_total(hooks, h, control)
