"""Loop of fixes' compiled hooks (`karamelo_py.kernels.hooks`) over members at nodes and points.

The class of `members` selects how a block is chosen and processed.
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import caller_of, hold, kernel, noinline, point_function
from karamelo_py.compiler.fields import field, load_vector
from karamelo_py.compiler.programs import BLOCK, ROWS, STACK, call_evaluate
from karamelo_py.compiler.threads import Threaded, shared_out
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels import arrays, totals
from karamelo_py.kernels import hooks as kinds
from karamelo_py.kernels.arrays import first_from
from karamelo_py.kernels.clock import kick, step_size
from karamelo_py.kernels.equations import RigidSums
from karamelo_py.kernels.equations.internal_force import Force
from karamelo_py.kernels.equations.loss import FrictionalHeat
from karamelo_py.kernels.equations.pore_water import WaterSums
from karamelo_py.kernels.views import state_at
from karamelo_py.kernels.walls import FRICTION, rub, stick
from karamelo_py.points.basis import placed
from karamelo_py.points.bodies import face
from karamelo_py.points.grid import node_position
from karamelo_py.points.kinematics import dot, planar
from karamelo_py.points.laws import is_rigid
from karamelo_py.points.transfers import Moment

# with a NumPy type, as each plain number would be a separate type in kernels
NONE, THIRD = np.int64(0), np.int64(STACK + ROWS)
VALUE, BEFORE = np.int64(arrays.VALUE), np.int64(arrays.BEFORE)
TERMS, WORKS = np.int64(STACK), np.int64(STACK + 1)  # rows of the stack, unused after evaluation
END = np.iinfo(np.int64).max  # larger than any member
TURN = 4 * BLOCK  # points that a thread takes at a time
COUNT, ACT, RUB = 0, 1, 2  # tasks
LOADS, LOADS_AGAIN = 3, 4  # targets for the work of loads: with v*, or with the re-mapped velocity
DONE, FREE = -1, 1e-3  # no stage; fraction of the force above which a node counts as held

_call_node_function = caller_of(kinds.NODE_FUNCTION)
_call_point_function = caller_of(kinds.POINT_FUNCTION)
_call_heat_function = caller_of(kinds.HEAT_FUNCTION)


class Call(NamedTuple):
    """A call of hook `h`; `share` is 1 / number of members with mass."""

    hooks: NamedTuple
    control: NamedTuple
    dt: float
    h: arrays.Number
    share: float


class HookedNodes(NamedTuple):
    target: int  # `arrays.ON_SUMS`, `ON_UPDATE`, `ON_VELOCITY`, `LOADS`, `LOADS_AGAIN`
    kin: NamedTuple
    grids: np.ndarray
    nodes: NamedTuple
    ranges: np.ndarray
    kept: float  # FLIP coefficient
    tag: NamedTuple = ()  # type: ignore[assignment]
    before_update: bool = False
    water: np.ndarray = ()  # type: ignore[assignment]  # nodal sums of pore water, or of all


class WholeNodes(HookedNodes):
    """Nodes for functions of whole nodes; `tag` is from `kinds.vector_hook`."""


class MovingPoints(NamedTuple):
    """Points for point functions; in `y`, corners follow the d coordinates."""

    ids: np.ndarray
    v: np.ndarray  # (d, n)
    mass: np.ndarray
    x: np.ndarray  # (w, n)
    y: np.ndarray
    corners: int
    rigid: bool
    moments: tuple  # (`Moment`,), (d*d, n), or ()


class WholePoints(NamedTuple):
    """Points of one law for functions of whole points."""

    tag: NamedTuple  # from `kinds.vector_hook`
    ids: np.ndarray
    kin: NamedTuple
    points: NamedTuple
    laws: NamedTuple
    x: np.ndarray  # (w, n)
    heat: tuple  # supply and capacity, (1, n) each, or ()


class HeatedPoints(NamedTuple):
    ids: np.ndarray
    kin: NamedTuple
    capacity: np.ndarray  # (1, n)
    temperature: np.ndarray
    volume: np.ndarray
    supply: np.ndarray
    share: np.ndarray
    x: np.ndarray  # (w, n)


def _turns(members, k, parts):
    """Return begin, end and stride of thread `k`'s chunks."""
    if isinstance(members, HookedNodes):
        shares = members.ranges[0, 0]
        return shares * k // parts, shares * (k + 1) // parts, NONE + 1
    # Interleaved chunks, as members may be clustered.
    size = TURN if parts > 1 else max(members.ids.size, 1)
    return k * size, members.ids.size, parts * size


def _bounds(members, turn, parts):
    if isinstance(members, HookedNodes):
        return members.ranges[turn, 0], members.ranges[turn, 1]
    return turn, min(turn + TURN, members.ids.size) if parts > 1 else members.ids.size


@point_function()
def act(members, task, call, count):
    """Carry out `task` with the chosen members and add to totals; return the number of members."""


@noinline
def _act_on_part(members, task, call, k, parts):
    handled = 0
    call.hooks.scratch[:6] = 0.0
    first, last, step = _turns(members, k, parts)
    for turn in range(first, last, step):
        position, end = _bounds(members, turn, parts)
        count, member = BLOCK, NONE
        while count == BLOCK:
            if isinstance(members, HookedNodes):
                count, position, member = _choose_nodes(members, call, position, end, member)
            else:
                count, position = choose_points(members, call, position, end)
            if count > 0:
                handled += act(members, task, call, count)
    return handled


@shared_out
def _act_on_parts(members, task, call, k):
    """Act on the members of thread `k`, with private scratch arrays and exact private totals."""
    hooks, control, h = call.hooks, call.control, call.h
    private = record(hooks.apart, k)
    for i in range(control.values.size):
        private.values[i] = control.values[i]
    step, heat = control.step[0], control.heat[0]
    my_step, my_heat = private.step[0], private.heat[0]
    my_step.last_dt, my_step.kick = step.last_dt, step.kick
    my_step.contact_dt, my_step.contact_kick = step.contact_dt, step.contact_kick
    my_heat.set_low, my_heat.set_high = heat.set_low, heat.set_high
    my_heat.rise, my_heat.fall = heat.rise, heat.fall
    my_heat.coldest, my_heat.hottest = heat.coldest, heat.hottest
    here = hold(arrays.with_items(hooks, chosen=private.chosen, scratch=private.scratch))
    values, sums = private.values, private.totals
    mine = hold(
        arrays.with_items(control, values=values, totals=sums, step=private.step, heat=private.heat)
    )
    mine_call = Call(here, mine, call.dt, h, call.share)
    _act_on_part(members, task, mine_call, k, hooks.apart.chosen.shape[0])
    totals.hand_over(private.totals, control.totals, totals.WORK)
    # The totals of other hooks that prescribe these nodes change, too.
    several = hooks.holders.size > 0
    for other in range(0 if several else h, len(hooks.table) if several else h + 1):
        first, count = _published(hooks, other)
        for row in range(first, first + count):
            totals.hand_over(private.totals, control.totals, row)
        first = _torque_of(hooks, hooks.table[other].slot)
        for row in range(first, first + 3 if first > 0 else 0):
            totals.hand_over(private.totals, control.totals, row)


def _act_on_all(members, task, call):
    hooks = call.hooks
    if not isinstance(hooks.mode, Threaded):
        _act_on_part(members, task, call, NONE, NONE + 1)
        return
    parts = hooks.apart.chosen.shape[0]
    _act_on_parts(hooks.mode, parts, members, task, call)
    heat = call.control.heat[0]
    for k in range(parts):
        private = hooks.apart.heat[k, 0]
        heat.set_low = min(heat.set_low, private.set_low)
        heat.set_high = max(heat.set_high, private.set_high)
        heat.rise, heat.fall = max(heat.rise, private.rise), min(heat.fall, private.fall)
        heat.coldest = min(heat.coldest, private.coldest)
        heat.hottest = max(heat.hottest, private.hottest)


def directions(hooks):
    """Return the dimension as a run-time value, so that loops are not unrolled."""
    return hooks.x0.shape[1]


@noinline
def evaluate(call, component, count, result, shift):
    """Evaluate a component's formula at the present time plus `shift` into row `result`."""
    hooks, control = call.hooks, call.control
    program = hooks.programs[call.h, component]
    if program.begin == program.end:
        number = hooks.constants[program.first]
        for q in range(count):
            hooks.scratch[result, q] = number
        return
    time = control.values[arrays.TIME]
    control.values[arrays.TIME] = time + shift
    call_evaluate(
        hooks.evaluate, hooks.code, hooks.constants, control.values, hooks.scratch,
        program.begin, program.end, program.first, program.last, count, result,
    )  # fmt: skip
    control.values[arrays.TIME] = time


@noinline
def _evaluate_now_and_before(call, c, count):
    evaluate(call, c, count, VALUE, 0.0)
    if call.hooks.table[call.h].uses_before:
        # the formulas start at time 0
        control = call.control
        step_back = min(control.step[0].last_dt, control.values[arrays.TIME])
        evaluate(call, c, count, BEFORE, -step_back)


@noinline
def _published(hooks, h):
    slot = hooks.table[h].slot
    if hooks.table[h].address == arrays.WHOLE:
        return slot, hooks.table[h].totals
    rubs = hooks.programs[h, FRICTION].begin >= 0
    first, last = 3, -1
    for c in range(3):
        if slot >= 0 and (rubs or hooks.programs[h, c].begin >= 0):
            first, last = min(first, c), c
    return slot + first, last - first + 1


def _torque_of(hooks, slot):
    """Return the first row of the torque that belongs to the force in rows from `slot` on, or 0."""
    return hooks.torques[slot] if slot >= 0 else NONE


@noinline
def _add_torque(call, q, c, slot, force):
    """Add the torque of component `c` of a force at the `q`-th chosen member."""
    positions, row = call.hooks.scratch, _torque_of(call.hooks, slot)
    if row > 0 and force != 0:
        x = (positions[0, q], positions[1, q], positions[2, q])
        totals.add_torque(call.control.totals, row, x, c, force)


def _add_numbers(call, q, kin, numbers):
    """Add the values that the `q`-th member's function publishes, and the torque of its force."""
    slot = call.hooks.table[call.h].slot
    if slot >= 0:
        for c in range(len(numbers)):
            totals.add_to(call.control.totals, slot + c, float(numbers[c]))
            if c < kin.dimension:
                _add_torque(call, q, c, slot, float(numbers[c]))


@noinline
def _clear_total(hooks, h, control):
    first, count = _published(hooks, h)
    for row in range(first, first + count):
        control.totals[row] = 0
    first = _torque_of(hooks, hooks.table[h].slot)
    for row in range(first, first + 3 if first > 0 else 0):
        control.totals[row] = 0


@noinline
def publish_total(hooks, h, control):
    totals.carry(control.totals[totals.WORK])  # the work accumulates over steps
    first, count = _published(hooks, h)
    if count > 0:
        totals.publish(control, first, count)
    first = _torque_of(hooks, hooks.table[h].slot)
    if first > 0:
        totals.publish(control, first, 3)


def _choose_nodes(members, call, row, end, member):
    """Choose up to a block of members with mass; return their number and the next member."""
    hooks, h, ranges, sums = call.hooks, call.h, members.ranges, members.nodes.sums
    of_all = members.target >= LOADS or hooks.table[h].begin < 0
    behind = hooks.table[h].end
    member = max(member, NONE if of_all else hooks.table[h].begin)
    count = 0
    while row < end:
        low, high = ranges[row, 0], ranges[row, 1]
        if of_all:
            member = max(member, low)
        elif member < behind and hooks.members[member] < low:
            member = first_from(hooks.members, member, behind, low)
        n = member if of_all else _node(hooks, h, member)
        while n < high:
            member += 1
            if sums[n, arrays.MASS] > 0:
                hooks.chosen[count] = n
                count += 1
                if count == BLOCK:
                    return count, row, member
            n = member if of_all else _node(hooks, h, member)
        row += 1
    return count, row, member


@noinline
def _node(hooks, h, m):
    return hooks.members[m] if m < hooks.table[h].end else END


@act.on(HookedNodes)
def _act_at_nodes(members, task, call, count):
    hooks = call.hooks
    if task == COUNT:
        number = 0
        for q in range(count):
            number += totals.counts(call.control.ranks, hooks.chosen[q])
        return number
    if members.target >= LOADS:
        _work_at_nodes(members, call, count)
        return 0
    if hooks.table[call.h].uses_place:
        locate_nodes(members.grids, hooks, count)
    if task == RUB:
        _rub_at_nodes(members, call, count)
    else:
        _change_nodes(members, call, count)
    return 0


@noinline
def locate_nodes(grids, hooks, count):
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


@noinline
def _clear_held(members, holders):
    kin, ranges = members.kin, members.ranges
    if holders.size > 0:
        for r in range(ranges[0, 0], ranges[ranges[0, 0] - 1, 1]):
            for n in range(ranges[r, 0], ranges[r, 1]):
                for c in range(kin.dimension):
                    holders[n, c].slot = 0


@noinline
def _take_over(call, q, c, force):
    """Let a hook hold the chosen node `q` by `force`; return the force of earlier holders."""
    hooks, control, h, before = call.hooks, call.control, call.h, 0.0
    n = hooks.chosen[q]
    if hooks.holders.size > 0 and hooks.table[h].holds:
        holder = hooks.holders[n, c]
        if holder.slot > 0:
            before = holder.force
            if totals.counts(control.ranks, n):
                totals.add_to(control.totals, holder.slot - 1, -before)
                _add_torque(call, q, c, holder.slot - 1 - c, -before)
        holder.slot = 1 + hooks.table[h].slot + c
        holder.force = before + force
    return before


@noinline
def _is_of_rigid(hooks, n):
    rigid = hooks.rigid_fields
    return rigid.size > 0 and rigid[n // (hooks.loads.shape[0] // rigid.size)]


@noinline
def _change_nodes(members, call, count):
    hooks, control, slot = call.hooks, call.control, call.hooks.table[call.h].slot
    for c in range(directions(hooks)):
        if hooks.programs[call.h, c].begin < 0:
            continue
        _evaluate_now_and_before(call, c, count)
        for q in range(count):
            if members.target == arrays.ON_SUMS:
                total, work, before = _change_force(members, call, c, q), 0.0, 0.0
            elif members.target == arrays.ON_UPDATE:
                total, work, before = _change_update(members, call, c, q)
            else:
                total, work, before = _change_velocity(members, call, c, q), 0.0, 0.0
            counted = totals.counts(control.ranks, hooks.chosen[q])
            hooks.scratch[TERMS, q] = total if counted else 0.0
            hooks.scratch[WORKS, q] = work if counted else 0.0
            if counted and before != 0:
                totals.add_to(control.totals, slot + c, before)
            if counted:
                _add_torque(call, q, c, slot, total + before)
        totals.add_many(control.totals, totals.WORK, hooks.scratch[WORKS], count)
        if slot >= 0:
            totals.add_many(control.totals, slot + c, hooks.scratch[TERMS], count)


def _called(call, state, force, values):
    hook = call.hooks.table[call.h]
    return _call_node_function(hook.address, *state, force, *values, call.dt, call.share)


@noinline
def _change_force(members, call, c, q):
    """Change the force on a node; return the total. Work is summed in `_work_at_nodes`."""
    hooks, water = call.hooks, members.water
    total = _push(members, call, members.nodes.sums, c, q)
    if hooks.table[call.h].accelerates and water[hooks.chosen[q], arrays.MASS] > 0:
        _push(members, call, water, c, q)
    return total


def _push(members, call, sums, c, q):
    kin, hooks, n = members.kin, call.hooks, call.hooks.chosen[q]
    mass, values = sums[n, arrays.MASS], (hooks.scratch[VALUE, q], hooks.scratch[BEFORE, q])
    v, old = sums[n, arrays.of_momentum(kin) + c] / mass, sums[n, arrays.of_force(kin) + c]
    _, _, force, total = _called(call, (mass, v, v), old, values)
    hooks.loads[n, c] += force - old
    sums[n, arrays.of_force(kin) + c] = force
    return total


@noinline
def _change_update(members, call, c, q):
    """Change v* of a node; return total, work, and force of hooks that held it before.

    Work is the impulse times the mean velocity in the step. If the hook holds the node, this is the
    velocity of the wall, as a node stopped by a bound moved differently before.
    """
    kin, nodes, hooks, n = members.kin, members.nodes, call.hooks, call.hooks.chosen[q]
    hook, dt, kept, work, before = hooks.table[call.h], call.dt, members.kept, 0.0, 0.0
    mass, values = nodes.sums[n, arrays.MASS], (hooks.scratch[VALUE, q], hooks.scratch[BEFORE, q])
    old_star, change = nodes.update[n, c], arrays.of_change(kin) + c
    old = old_star - nodes.update[n, change]
    force = nodes.sums[n, arrays.of_force(kin) + c]
    v, star, _, total = _called(call, (mass, old, old_star), force, values)
    # Points take v* - v, so a change of v is an impulse, too.
    total += kept * mass * (old - v) / dt
    holds = star == values[0]
    if holds:
        before = _take_over(call, q, c, total)
    moved = values[1] + star if hook.uses_before and holds else v + star
    impulse = mass * (star - old_star + kept * (old - v))
    # Later, contact may change velocities of free nodes, and rigid bodies velocities of any node.
    late = hook.stage == arrays.POST_UPDATE_GRID_STATE or hook.stage == arrays.POST_CONTACT
    rigid = field(nodes.fields, RigidSums)
    is_taken = rigid is not None and rigid[n, arrays.MASS] > 0
    if late and (hook.holds == 0 or is_taken):
        hooks.loads[n, c] += impulse / dt  # see _work_at_nodes
    elif not _is_of_rigid(hooks, n):
        work = 0.5 * impulse * moved
    heat = call.control.heat[0]
    heat.set_low, heat.set_high = min(heat.set_low, star), max(heat.set_high, star)
    nodes.update[n, c] = star
    nodes.update[n, change] = star - v
    return total, work, before


@noinline
def _change_velocity(members, call, c, q):
    kin, nodes, hooks, n = members.kin, members.nodes, call.hooks, call.hooks.chosen[q]
    hook, v, last = hooks.table[call.h], nodes.velocity[n, c], nodes.update[n, c]
    # Strain before the forces uses the nodal velocity of the last step: hooks that held it act
    # again.
    strains_first = hook.stage == arrays.POST_UPDATE_GRID_STATE and hook.holds > 0
    value = hooks.scratch[BEFORE if strains_first and hook.uses_before else VALUE, q]
    # v* is from the last step
    remaps = hook.stage == arrays.POST_VELOCITIES_TO_GRID
    star = last if remaps or (strains_first and last == value) else v
    state, force = (nodes.sums[n, arrays.MASS], v, star), nodes.sums[n, arrays.of_force(kin) + c]
    v, star, _, total = _called(call, state, force, (value, hooks.scratch[BEFORE, q]))
    nodes.velocity[n, c] = star if strains_first else v
    return total


@noinline
def _rub_at_nodes(members, call, count):
    hooks = call.hooks
    if members.target == arrays.ON_VELOCITY:
        # otherwise v* is from the last step
        if hooks.table[call.h].stage == arrays.POST_VELOCITIES_TO_GRID:
            for q in range(count):
                stick(members.kin, members.nodes, hooks.programs[call.h], hooks.chosen[q])
        return
    evaluate(call, FRICTION, count, VALUE, 0.0)
    for q in range(count):
        rub(members, call, q, hooks.scratch[VALUE, q])


@noinline
def _work_at_nodes(members, call, count):
    """Sum the work of loads on the chosen nodes, and clear the loads.

    Work is the force times the mean of the velocities before and after the step, including stress,
    constraints and contact. With the velocity mapped again after the step it is exact for FLIP, as
    this is the velocity of the points; v* has an error of order dt, which is large at light nodes.
    """
    update, change = members.nodes.update, arrays.of_change(members.kin)
    velocity, again = members.nodes.velocity, members.target == LOADS_AGAIN
    sums, momentum = members.nodes.sums, arrays.of_momentum(members.kin)
    hooks, control, dt, terms = call.hooks, call.control, call.dt, call.hooks.scratch[WORKS]
    for c in range(members.kin.dimension):
        for q in range(count):
            n = hooks.chosen[q]
            load = hooks.loads[n, c]
            hooks.loads[n, c] = 0
            counts = load != 0 and totals.counts(control.ranks, n) and not _is_of_rigid(hooks, n)
            # XPIC has replaced the change of v*.
            moved = 2 * update[n, c] - update[n, change + c]
            if again and counts:
                # Fixes that hold nodes prescribe v before the step, too; in free fall v is v*.
                v, mass, force = velocity[n, c], sums[n, arrays.MASS], arrays.of_force(members.kin)
                before, pushed = sums[n, momentum + c] / mass, dt * sums[n, force + c] / mass
                fixed = v == update[n, c] and abs(v - before - pushed) > FREE * abs(pushed)
                moved = v + (v if fixed else before)
            terms[q] = 0.5 * dt * load * moved if counts else 0.0
        totals.add_many(control.totals, totals.WORK, terms, count)


@act.on(WholeNodes)
def _act_on_whole_nodes(members, task, call, count):
    tag, nodes, kin = members.tag, members.nodes, members.kin
    hooks, control, dt, h = call.hooks, call.control, call.dt, call.h
    if hooks.table[h].uses_place:
        locate_nodes(members.grids, hooks, count)
    rows, first = (VALUE, BEFORE, THIRD), arrays.of_force(kin)
    for c in range(len(tag.values)):
        evaluate(call, c, count, rows[c], 0.0)
    for q in range(count):
        n = hooks.chosen[q]
        values = tuple([hooks.scratch[rows[c], q] for c in range(len(tag.values))])
        force = tuple([nodes.sums[n, first + c] for c in range(kin.dimension)])
        star = tuple([nodes.update[n, c] for c in range(kin.dimension)])
        if tag.shares:
            values = (*values, call.share)
        results = kinds.results(tag, members, kinds.Member(n, kin, kin, values, dt))
        numbers = kinds.written(tag, members, n, results)
        counted = totals.counts(control.ranks, n)
        for c in range(kin.dimension):
            load = nodes.sums[n, first + c] - force[c]
            if not members.before_update:
                load = nodes.sums[n, arrays.MASS] * (nodes.update[n, c] - star[c]) / dt
            hooks.loads[n, c] += load  # see _work_at_nodes
        if counted:
            _add_numbers(call, q, kin, numbers)
    return 0


def without_whole(hooks):
    """Omit functions of whole points: with them, loops would be compiled again."""
    return arrays.with_items(hooks, whole=())


def hooked_nodes(s, target, kept):
    """Return nodes for node functions; `kept` is the FLIP coefficient."""
    nodes = s.nodes  # with the fields that the loop uses; for others it would be compiled again
    fields = tuple([one for one in nodes.fields if type(one) in (FrictionalHeat, RigidSums)])
    trimmed = arrays.Nodes(nodes.sums, nodes.update, nodes.velocity, fields)
    water = field(s.nodes.fields, WaterSums)
    water = s.nodes.sums if water is None else water
    return HookedNodes(target, planar(s.kin), s.grids, trimmed, s.ranges, kept, water=water)


def whole_nodes(s, tag, stage, target):
    early = stage == arrays.POST_PARTICLES_TO_GRID
    return WholeNodes(target, planar(s.kin), s.grids, s.nodes, s.ranges, 0.0, tag, early)


def node_hooks(stage, members, hooks, s, dt):
    tags = [tag for tag in hooks.whole if tag.of_nodes]
    whole = tuple([whole_nodes(s, tag, stage, members.target) for tag in tags])
    _node_hooks(stage, members, whole, Call(without_whole(hooks), s.control, float(dt), NONE, 1.0))


@kernel
def _node_hooks(stage, members, whole, call):
    members, hooks, control, dt = hold(members), call.hooks, call.control, call.dt
    if members.target >= LOADS:
        if hooks.loads.size > 0:
            _act_on_all(members, ACT, call)
            totals.carry(control.totals[totals.WORK])
        return
    if members.target == arrays.ON_UPDATE:
        _clear_held(members, hooks.holders)
    for h in range(len(hooks.table)):
        if hooks.table[h].stage != stage:
            continue
        _clear_total(hooks, h, control)
        share = 1.0
        if hooks.table[h].uses_share:
            heavy = _act_on_part(members, COUNT, Call(hooks, control, dt, h, share), NONE, NONE + 1)
            share = 1.0 / max(totals.number_of_all(control.ranks, control, heavy), 1)
        hook_call = Call(hooks, control, dt, h, share)
        if hooks.table[h].address == arrays.WHOLE:
            for one in whole:
                # before the forces (usf), v* is from the last step
                if one.tag.row == h and members.target != arrays.ON_VELOCITY:
                    _act_on_all(one, ACT, hook_call)
        else:
            _act_on_all(members, ACT, hook_call)
        publish_total(hooks, h, control)
    # Friction comes last, when all walls that hold a node are known.
    for h in range(len(hooks.table)):
        if hooks.table[h].stage != stage:
            continue
        rubs = hooks.programs[h, FRICTION].begin >= 0
        if rubs:
            _act_on_all(members, RUB, Call(hooks, control, dt, h, 1.0))
        if rubs or (hooks.table[h].holds and hooks.holders.size > 0):
            publish_total(hooks, h, control)


@point_function(otherwise=True)
def at_nodes(hooks, stage, target, s):
    pass


@at_nodes.on(arrays.Hooks)
def _at_nodes_hooks(hooks, stage, target, s):
    step, heat = s.control.step[0], s.control.heat[0]
    node_hooks(stage, hooked_nodes(s, target, step.kept), hooks, s, kick(s))
    heat.set_low = heat.set_high = 0.0  # temperatures only


@point_function(otherwise=True)
def add_work(hooks, s, again):
    pass


@add_work.on(arrays.Hooks)
def _add_work_hooks(hooks, s, again):
    node_hooks(NONE, hooked_nodes(s, LOADS_AGAIN if again else LOADS, 0.0), hooks, s, kick(s))


def choose_points(members, call, p, end):
    """Choose up to a block of members; return their number and the next point."""
    hooks, h = call.hooks, call.h
    begin, ids, where = hooks.table[h].begin, members.ids, hooks.scratch
    count = 0
    while p < end and count < BLOCK:
        if begin < 0 or hooks.members[begin + (ids[p] >> 6)] >> (ids[p] & 63) & 1 != 0:
            hooks.chosen[count] = p
            if hooks.table[h].uses_place:
                for c in range(directions(hooks)):
                    where[c, count] = members.x[c, p]
                    if hooks.x0.shape[0] > 0:
                        where[3 + c, count] = hooks.x0[ids[p], c]
            count += 1
        p += 1
    return count, p


@act.on(MovingPoints)
def _act_on_motion(members, task, call, count):
    v, y, hooks, control, h = members.v, members.y, call.hooks, call.control, call.h
    d = directions(hooks)
    for c in range(d):
        if hooks.programs[h, c].begin < 0:
            continue
        _evaluate_now_and_before(call, c, count)
        slot = hooks.table[h].slot
        # Work is counted from the velocity that the hook prescribed one step earlier.
        leads = hooks.table[h].stage == arrays.POST_ADVANCE_PARTICLES
        leads = leads and hooks.table[h].uses_before > 0
        for q in range(count):
            p = hooks.chosen[q]
            velocity, position, total = _call_point_function(
                hooks.table[h].address, members.mass[p], v[c, p], members.x[c, p], y[c, p],
                hooks.scratch[VALUE, q], hooks.scratch[BEFORE, q], call.dt, control.step[0].kick,
            )  # fmt: skip
            speed = float(v[c, p])
            first = hooks.scratch[BEFORE, q] if leads else speed
            work = 0.5 * float(members.mass[p]) * (velocity - speed) * (velocity + first)
            totals.add_to(control.totals, totals.WORK, 0.0 if members.rigid else work)
            v[c, p] = velocity
            for corner in range(members.corners):
                y[d + d * corner + c, p] += position - y[c, p]
            y[c, p] = position
            for moment in members.moments:
                # set to 0, otherwise nodes and strains follow the grid velocity of the point
                for k in range(d if leads else 0):
                    moment[d * c + k, p] = 0
                for k in range(d * d + c if leads else moment.shape[0], moment.shape[0], d):
                    moment[k, p] = 0  # mixed derivatives
            if slot >= 0:
                totals.add_to(control.totals, slot + c, total)
                _add_torque(call, q, c, slot, total)
    return 0


@act.on(HeatedPoints)
def _act_on_warmth(members, task, call, count):
    hooks, control, h = call.hooks, call.control, call.h
    evaluate(call, 0, count, VALUE, 0.0)
    if hooks.programs[h, 1].begin >= 0:
        evaluate(call, 1, count, BEFORE, 0.0)
    slot = hooks.table[h].slot
    heat = control.heat[0]
    for q in range(count):
        p = hooks.chosen[q]
        before = members.supply[0, p]
        share, supply, T = _call_heat_function(
            hooks.table[h].address, members.capacity[0, p], members.temperature[0, p],
            face(members.kin, members.volume[0, p], load_vector(members.kin, members.x, p)),
            before, hooks.scratch[VALUE, q], hooks.scratch[BEFORE, q], call.dt,
        )  # fmt: skip
        members.share[0, p] = min(members.share[0, p], share)
        members.supply[0, p] = supply
        members.temperature[0, p] = T
        if slot >= 0:
            totals.add_to(control.totals, slot, supply - before)
        # the bound is the prescribed temperature
        if hooks.table[h].holds > 0:
            T = hooks.scratch[BEFORE, q]
        elif members.capacity[0, p] > 0:
            rate = supply / members.capacity[0, p]
            heat.rise, heat.fall = max(heat.rise, rate), min(heat.fall, rate)
        if share == 0 or hooks.table[h].holds > 0:
            heat.coldest, heat.hottest = min(heat.coldest, T), max(heat.hottest, T)
    return 0


def _of_time(tag, kin, call):
    """Return the formulas of time now and at the end of the step, dt and kick of contact, kick."""
    values = []
    for k in range(0 if tag.ahead else len(tag.values)):
        values.append(_one_of_time(call, FRICTION + 1 + k, 0.0))
    for shift in (0.0, call.dt) if tag.ahead else ():
        for c in range(kin.dimension):
            values.append(_one_of_time(call, c, shift) if c < len(tag.values) else 0.0)
    step = call.control.step[0]
    return (*values, step.contact_dt, step.contact_kick, step.kick)


def _one_of_time(call, component, shift):
    evaluate(call, component, 1, VALUE, shift)
    return call.hooks.scratch[VALUE, 0]


@act.on(WholePoints)
def _act_on_whole_points(members, task, call, count):
    tag, points, kin = members.tag, members.points, members.kin
    hooks, control, dt = call.hooks, call.control, call.dt
    rows = (VALUE, BEFORE, THIRD)
    led = _of_time(tag, kin, call) if tag.of_time else ()
    for c in range(0 if tag.of_time else len(tag.values)):
        evaluate(call, c, count, rows[c], 0.0)
    for q in range(count):
        p = hooks.chosen[q]
        law, state = state_at(kin, points, members.laws, p)
        values = led
        if not tag.of_time:
            values = tuple([hooks.scratch[rows[c], q] for c in range(len(tag.values))])
        old = load_vector(kin, points.v, p)
        results = kinds.results(tag, members, kinds.Member(p, law, state, values, dt))
        numbers = kinds.written(tag, members, p, results)
        new = load_vector(kin, points.v, p)
        work = 0.5 * float(points.mass[p]) * dot(new - old, new + old)
        totals.add_to(control.totals, totals.WORK, 0.0 if is_rigid(members.laws) else float(work))
        _add_numbers(call, q, kin, numbers)
        if len(members.heat):
            supply, capacity = members.heat
            if capacity[0, p] > 0:
                rate = float(supply[0, p]) / float(capacity[0, p])
                heat = control.heat[0]
                heat.rise, heat.fall = max(heat.rise, rate), min(heat.fall, rate)
    return 0


@kernel
def _point_hooks(stage, members, whole, call):
    hooks, control, dt = call.hooks, call.control, float(call.dt)
    for h in range(len(hooks.table)):
        if hooks.table[h].stage != stage:
            continue
        hook_call = Call(hooks, control, dt, h, 1.0)
        if hooks.table[h].address == arrays.WHOLE:
            for one in whole:
                if one.tag.row == h:
                    _act_on_all(one, ACT, hook_call)
        else:
            _act_on_all(members, ACT, hook_call)


@kernel
def _begin_or_end_totals(stage, hooks, control, begin):
    for h in range(len(hooks.table)):
        if hooks.table[h].stage == stage:
            if begin:
                _clear_total(hooks, h, control)
            else:
                publish_total(hooks, h, control)


def point_hooks(stage, then, hooks, s, arguments_of):
    """Call the point functions of `stage` in each block.

    `arguments_of` holds two functions: one returns the arguments of a block's point functions, the
    other its heat arrays.
    """
    control, without, (what_of, heat_of) = s.control, without_whole(hooks), arguments_of
    call = Call(without, control, step_size(s), NONE, 1.0)
    of_points = [tag for tag in hooks.whole if not tag.of_nodes]
    _begin_or_end_totals(stage, without, control, True)
    for block in s.blocks:
        heat = heat_of(block.points)
        whole = tuple([whole_points(tag, s, block, then, heat) for tag in of_points])
        _point_hooks(stage, what_of(s, block, then), whole, call)
    _begin_or_end_totals(stage, without, control, False)


def _positions(s, points, then):
    now = s.control.motion[0].now
    return points.x[now], points.x[1 - now if then else now]


def whole_points(tag, s, block, then, heat):
    points = block.points
    _, y = _positions(s, points, then)
    return WholePoints(tag, points.id, s.kin, points, block.laws, y, heat)


def moving_points(s, block, then):
    points, rigid, corners = block.points, is_rigid(block.laws), corners_that_move(s)
    x, y = _positions(s, points, then)
    moment = field(points.fields, Moment)
    moments = () if moment is None else (moment,)
    return MovingPoints(points.id, points.v, points.mass, x, y, corners, rigid, moments)


def clear_forces(kin, force, count):
    if force is not None:
        for c in range(force.shape[0]):
            for p in range(count):
                force[c, p] = 0


def corners_that_move(s):
    return placed(s.basis, s.kin) if s.frame.moves else 0


@point_function(otherwise=True)
def at_points(hooks, stage, then, s):
    """Apply fixes to points; `then` is 1 once their new positions are known, else 0."""


@at_points.on(arrays.Hooks)
def _at_points_hooks(hooks, stage, then, s):
    if stage == arrays.INITIAL_INTEGRATE and len(hooks.whole):
        for block in s.blocks:
            clear_forces(s.kin, field(block.points.fields, Force), block.points.mass.size)
    point_hooks(stage, then, hooks, s, (moving_points, lambda points: ()))
