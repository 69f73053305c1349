"""The loop of compiled hooks of fixes over the members of their groups, at nodes and at points.

Hooks act on a tuple (`HookedNodes`, `MovingPoints`, `HeatedPoints`), whose class determines how the
next members are chosen and a block of them is processed. The functions of the hooks are described
in `karamelo_py.kernels.hooks`.
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.compile import point_function
from karamelo_py.compiler.fields import field, load_vector
from karamelo_py.compiler.formula import BLOCK, ROWS, STACK, call_evaluate
from karamelo_py.compiler.held import hold
from karamelo_py.compiler.loops import caller_of, kernel, noinline
from karamelo_py.compiler.threads import Threaded, shared_out
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels import arrays, totals
from karamelo_py.kernels import hooks as kinds
from karamelo_py.kernels.arrays import first_from
from karamelo_py.kernels.clock import kick, step_size
from karamelo_py.kernels.loss import FrictionalHeat
from karamelo_py.kernels.p2g import Force, RigidSums
from karamelo_py.kernels.visit import state_at
from karamelo_py.kernels.walls import FRICTION, rub, stick
from karamelo_py.points.basis import placed
from karamelo_py.points.bodies import face
from karamelo_py.points.grid import node_position
from karamelo_py.points.kinematics import dot, planar
from karamelo_py.points.laws import moves_as_told

# Bare numbers would each be a type.
NONE, THIRD = np.int64(0), np.int64(STACK + ROWS)
VALUE, BEFORE = np.int64(arrays.VALUE), np.int64(arrays.BEFORE)
END = np.iinfo(np.int64).max  # after the last member
TURN = 4 * BLOCK  # points that a thread takes at a time
COUNT, ACT, RUB = 0, 1, 2  # task for the members of a hook
LOADS = 3  # as a target: for all nodes
DONE = -1  # instead of a stage

_call_node_function = caller_of(kinds.NODE_FUNCTION)
_call_point_function = caller_of(kinds.POINT_FUNCTION)
_call_heat_function = caller_of(kinds.HEAT_FUNCTION)


class HookedNodes(NamedTuple):
    """Nodes that node functions change, nodes of heat included.

    `kept` is the fraction of its velocity that a point retains, and changes by nodal increments.
    """

    target: int  # position in the arrays of nodes
    kin: NamedTuple
    grids: np.ndarray
    nodes: NamedTuple
    ranges: np.ndarray
    kept: float


class WholeNodes(NamedTuple):
    """Nodes that functions of whole nodes change."""

    tag: NamedTuple  # the function, and what it reads and writes: see `kinds.vector_hook`
    kin: NamedTuple
    grids: np.ndarray
    nodes: NamedTuple
    ranges: np.ndarray
    before_update: bool  # else after it
    target: int


class MovingPoints(NamedTuple):
    """Points whose velocity point functions change, with the places y that follow from x.

    After the d coordinates of a point, `y` has `corners` corners of its domain. Moving rigid points
    does no work on other points; they do work where they touch them.
    """

    ids: np.ndarray
    v: np.ndarray  # (d, n)
    mass: np.ndarray
    x: np.ndarray  # (w, n)
    y: np.ndarray
    corners: int
    rigid: bool


class WholePoints(NamedTuple):
    """Points of one law that functions of whole points change."""

    tag: NamedTuple  # the function, and what it reads and writes: see `kinds.vector_hook`
    ids: np.ndarray
    kin: NamedTuple
    points: NamedTuple
    laws: NamedTuple
    x: np.ndarray  # (w, n)
    heat: tuple  # supply and capacity, (1, n) each, if heat is supplied


class HeatedPoints(NamedTuple):
    """Points that get heat, which heat functions change."""

    ids: np.ndarray
    kin: NamedTuple
    capacity: np.ndarray  # (1, n)
    temperature: np.ndarray
    volume: np.ndarray
    supply: np.ndarray
    share: np.ndarray
    x: np.ndarray  # (w, n)


# --- the loop ---------------------------------------------------------------------------------


def _turns(what, k, parts):
    """Return begin, end and stride of the chunks of thread `k` of `parts`."""
    if isinstance(what, (HookedNodes, WholeNodes)):
        shares = what.ranges[0, 0]
        return shares * k // parts, shares * (k + 1) // parts, NONE + 1
    # Interleaved, because members may be clustered.
    size = TURN if parts > 1 else max(what.ids.size, 1)
    return k * size, what.ids.size, parts * size


def _bounds(what, turn, parts):
    """Return the range of members in a chunk."""
    if isinstance(what, (HookedNodes, WholeNodes)):
        return what.ranges[turn, 0], what.ranges[turn, 1]
    return turn, min(turn + TURN, what.ids.size) if parts > 1 else what.ids.size


@point_function()
def act(what, task, hooks, control, dt, h, count, share):
    """Do `task` with the chosen members and add to the totals; return how many count."""


@noinline
def _act_on_part(what, task, hooks, control, dt, h, share, k, parts):
    """Do `task` with the members of hook `h` in the part of thread `k`; return how many count."""
    found = 0
    hooks.scratch[:6] = 0.0
    first, last, step = _turns(what, k, parts)
    for turn in range(first, last, step):
        place, end = _bounds(what, turn, parts)
        count, member = BLOCK, NONE
        while count == BLOCK:
            if isinstance(what, (HookedNodes, WholeNodes)):
                count, place, member = _choose_nodes(what, hooks, h, place, end, member)
            else:
                count, place = choose_points(what, hooks, h, place, end)
            if count > 0:
                found += act(what, task, hooks, control, dt, h, count, share)
    return found


@shared_out
def _act_on_parts(what, task, hooks, control, dt, h, share, k):
    """Act in the part of thread `k`, with private scratch and totals: totals do not round."""
    own = record(hooks.apart, k)
    for i in range(control.values.size):
        own.values[i] = control.values[i]
    clock, there = control.clock[0], own.clock[0]
    there.last_dt, there.kick = clock.last_dt, clock.kick
    there.contact_dt, there.contact_kick = clock.contact_dt, clock.contact_kick
    there.set_low, there.set_high = clock.set_low, clock.set_high
    there.rise, there.fall = clock.rise, clock.fall
    there.coldest, there.hottest = clock.coldest, clock.hottest
    here, mine = hold(arrays.with_items_of(hooks, own)), hold(arrays.with_items_of(control, own))
    _act_on_part(what, task, here, mine, dt, h, share, k, hooks.apart.chosen.shape[0])
    totals.hand_over(own.totals, control.totals, totals.WORK)
    # If other hooks have held the nodes before, their totals change, too.
    several = hooks.held.size > 0
    for other in range(0 if several else h, len(hooks.table) if several else h + 1):
        first, count = _published(hooks, other)
        for row in range(first, first + count):
            totals.hand_over(own.totals, control.totals, row)


def _act_on_all(what, task, hooks, control, dt, h, share):
    """Do `task` with all members of a hook."""
    mode = hooks.mode
    if not isinstance(mode, Threaded):
        _act_on_part(what, task, hooks, control, dt, h, share, NONE, NONE + 1)
        return
    parts = hooks.apart.chosen.shape[0]
    _act_on_parts(mode, parts, what, task, hooks, control, dt, h, share)
    clock = control.clock[0]
    for k in range(parts):
        own = hooks.apart.clock[k, 0]
        clock.set_low = min(clock.set_low, own.set_low)
        clock.set_high = max(clock.set_high, own.set_high)
        clock.rise, clock.fall = max(clock.rise, own.rise), min(clock.fall, own.fall)
        clock.coldest = min(clock.coldest, own.coldest)
        clock.hottest = max(clock.hottest, own.hottest)


# --- formulas and totals ----------------------------------------------------------------------


def directions(hooks):
    """Return their number at run time, so that loops over them are not unrolled."""
    return hooks.x0.shape[1]


@noinline
def evaluate(hooks, h, component, count, control, result, shift):
    """Evaluate the formula of a component for the chosen members, at the present time plus `shift`.

    The results go to the row `result` of the scratch. A formula without code is a number.
    """
    program = hooks.programs[h, component]
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
def _evaluate_now_and_before(hooks, h, c, count, control):
    """Evaluate the formula of direction `c`, and one step earlier if it is used."""
    evaluate(hooks, h, c, count, control, VALUE, 0.0)
    if hooks.table[h].uses_before:
        # There is nothing before time 0.
        step_back = min(control.clock[0].last_dt, control.values[arrays.TIME])
        evaluate(hooks, h, c, count, control, BEFORE, -step_back)


@noinline
def _published(hooks, h):
    """Return the first total of a hook, and its number of totals."""
    slot = hooks.table[h].slot
    if hooks.table[h].address == arrays.WHOLE:
        return slot, hooks.table[h].totals
    rubs = hooks.programs[h, FRICTION].begin >= 0
    first, last = 3, -1
    for c in range(3):
        if slot >= 0 and (rubs or hooks.programs[h, c].begin >= 0):
            first, last = min(first, c), c
    return slot + first, last - first + 1


@noinline
def _clear_total(hooks, h, control):
    """Let the totals of a hook start from zero."""
    first, count = _published(hooks, h)
    for row in range(first, first + count):
        control.totals[row] = 0


@noinline
def publish_total(hooks, h, control):
    """Publish the totals of a hook."""
    totals.carry(control.totals[totals.WORK])  # it accumulates over steps
    first, count = _published(hooks, h)
    if count > 0:
        totals.publish(control, first, count)


# --- nodes ------------------------------------------------------------------------------------


def _choose_nodes(what, hooks, h, row, end, member):
    """Choose up to a block of members in use, with mass; return their number and where to continue.

    Members ascend like rows: a wall may have more members than are in use.
    """
    ranges, sums = what.ranges, what.nodes.sums
    of_all = what.target == LOADS or hooks.table[h].begin < 0
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
    """Return the number of a member of the group."""
    return hooks.members[m] if m < hooks.table[h].end else END


@act.on(HookedNodes)
def _act_at_nodes(what, task, hooks, control, dt, h, count, share):
    if task == COUNT:
        found = 0
        for q in range(count):
            found += totals.counts(control.ranks, hooks.chosen[q])
        return found
    if what.target == LOADS:
        _work_at_nodes(what, hooks, control, dt, count)
        return 0
    if hooks.table[h].uses_place:
        locate_nodes(what.grids, hooks, count)
    if task == RUB:
        _rub_at_nodes(what, hooks, control, dt, h, count)
    else:
        _change_nodes(what, hooks, control, dt, h, count, share)
    return 0


@noinline
def locate_nodes(grids, hooks, count):
    """Find the positions of the chosen nodes."""
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
def _clear_held(what, held):
    """Clear the record of what holds nodes."""
    kin, ranges = what.kin, what.ranges
    if held.size > 0:
        for r in range(ranges[0, 0], ranges[ranges[0, 0] - 1, 1]):
            for n in range(ranges[r, 0], ranges[r, 1]):
                for c in range(kin.dimension):
                    held[n, c].slot = 0


@noinline
def _take_over(hooks, control, h, n, c, force):
    """Let hook `h` hold node `n` by `force`; return the force of the previous hooks on it."""
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


@noinline
def _moves_as_told(hooks, n):
    """Return True if a node belongs to the field of a rigid solid: no work is done on it."""
    told = hooks.told
    return told.size > 0 and told[n // (hooks.loads.shape[0] // told.size)]


def _is_taken(rigid, n):
    """Return True if rigid points set the velocity of a node that other points also see."""
    return rigid is not None and rigid[n, arrays.MASS] > 0


@noinline
def _change_nodes(what, hooks, control, dt, h, count, share):
    """Act on the chosen nodes; add to the totals, and to the work."""
    target, kin, nodes, kept = what.target, what.kin, what.nodes, what.kept
    slot = hooks.table[h].slot
    stage = hooks.table[h].stage
    remaps = target == arrays.ON_VELOCITY and stage == arrays.POST_VELOCITIES_TO_GRID
    # Strain before the forces belongs to the last step, and to the hooks that held then.
    strains_first = target == arrays.ON_VELOCITY and stage == arrays.POST_UPDATE_GRID_STATE
    strains_first = strains_first and hooks.table[h].holds > 0
    given = BEFORE if strains_first and hooks.table[h].uses_before else VALUE
    # Contact may take the velocity of a free node, and a rigid body the velocity of any node.
    late = stage == arrays.POST_UPDATE_GRID_STATE
    yields, rigid = late and hooks.table[h].holds == 0, field(nodes.fields, RigidSums)
    for c in range(directions(hooks)):
        if hooks.programs[h, c].begin < 0:
            continue
        _evaluate_now_and_before(hooks, h, c, count, control)
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
                last = nodes.update[n, c]  # before the forces, from the step before
                if remaps or (strains_first and last == hooks.scratch[given, q]):
                    star = last
            old, old_star = v, star
            old_force = nodes.sums[n, arrays.of_force(kin) + c]
            v, star, force, total = _call_node_function(
                hooks.table[h].address, mass, v, star, old_force,
                hooks.scratch[given, q], hooks.scratch[BEFORE, q], dt, share,
            )  # fmt: skip
            if target == arrays.ON_UPDATE:
                # Points that retain velocity take the change v* - v: another v is an impulse.
                total += kept * mass * (old - v) / dt
                if star == hooks.scratch[VALUE, q]:
                    before = _take_over(hooks, control, h, n, c, total)
            if target == arrays.ON_SUMS:
                hooks.loads[n, c] += force - old_force  # see _work_at_nodes
                nodes.sums[n, arrays.of_force(kin) + c] = force
            elif target == arrays.ON_UPDATE:
                # Impulse times the mean of the velocities before and after it; or of the holding
                # hook, as a node stopped by a bound has not moved with the wall before.
                moved = v + star
                if hooks.table[h].uses_before and star == hooks.scratch[VALUE, q]:
                    moved = hooks.scratch[BEFORE, q] + star
                impulse = mass * (star - old_star + kept * (old - v))
                if yields or (late and _is_taken(rigid, n)):
                    hooks.loads[n, c] += impulse / dt  # see _work_at_nodes
                elif not _moves_as_told(hooks, n):
                    work = 0.5 * impulse * moved
                clock = control.clock[0]
                clock.set_low, clock.set_high = min(clock.set_low, star), max(clock.set_high, star)
                nodes.update[n, c] = star
                nodes.update[n, arrays.of_change(kin) + c] = star - v
            else:
                nodes.velocity[n, c] = star if strains_first else v
            # Formulas have been used: their rows hold the terms to be summed.
            own = totals.counts(control.ranks, n)
            hooks.scratch[VALUE, q] = total if own else 0.0
            hooks.scratch[BEFORE, q] = work if own else 0.0
            if own and before != 0:
                totals.add_to(control.totals, slot + c, before)
        totals.add_many(control.totals, totals.WORK, hooks.scratch[BEFORE], count)
        if slot >= 0:
            totals.add_many(control.totals, slot + c, hooks.scratch[VALUE], count)


@noinline
def _rub_at_nodes(what, hooks, control, dt, h, count):
    """Apply friction to the chosen nodes along their wall."""
    target, kin, nodes, kept = what.target, what.kin, what.nodes, what.kept
    programs = hooks.programs[h]
    if target == arrays.ON_VELOCITY:
        # Otherwise v* belongs to the step before.
        if hooks.table[h].stage == arrays.POST_VELOCITIES_TO_GRID:
            for q in range(count):
                stick(kin, nodes, programs, hooks.chosen[q])
        return
    evaluate(hooks, h, FRICTION, count, control, VALUE, 0.0)
    slot = hooks.table[h].slot
    for q in range(count):
        n, mu = hooks.chosen[q], hooks.scratch[VALUE, q]
        rub(kin, nodes, programs, hooks, n, mu, dt, kept, control, slot)


@noinline
def _work_at_nodes(what, hooks, control, dt, count):
    """Sum the work of loads on the chosen nodes, and clear them; v* is the points' velocity.

    Force times the mean of the velocities before and after the step: the effect of stress,
    constraints and contact in the same step counts, or the work would be of first order.
    """
    update, change = what.nodes.update, arrays.of_change(what.kin)
    terms = hooks.scratch[VALUE]
    for c in range(what.kin.dimension):
        for q in range(count):
            n = hooks.chosen[q]
            load = hooks.loads[n, c]
            hooks.loads[n, c] = 0
            counts = load != 0 and totals.counts(control.ranks, n)
            counts = counts and not _moves_as_told(hooks, n)
            terms[q] = dt * load * (update[n, c] - 0.5 * update[n, change + c]) if counts else 0.0
        totals.add_many(control.totals, totals.WORK, terms, count)


@act.on(WholeNodes)
def _act_on_whole_nodes(what, task, hooks, control, dt, h, count, share):
    tag, nodes, kin = what.tag, what.nodes, what.kin
    if hooks.table[h].uses_place:
        locate_nodes(what.grids, hooks, count)
    rows, first = (VALUE, BEFORE, THIRD), arrays.of_force(kin)
    for c in range(len(tag.values)):
        evaluate(hooks, h, c, count, control, rows[c], 0.0)
    for q in range(count):
        n = hooks.chosen[q]
        values = tuple([hooks.scratch[rows[c], q] for c in range(len(tag.values))])
        force = tuple([nodes.sums[n, first + c] for c in range(kin.dimension)])
        star = tuple([nodes.update[n, c] for c in range(kin.dimension)])
        found = kinds.results(tag, what, kin, kin, n, values, dt)
        numbers = kinds.written(tag, what, n, found)
        own = totals.counts(control.ranks, n)
        for c in range(kin.dimension):
            load = nodes.sums[n, first + c] - force[c]
            if not what.before_update:
                load = nodes.sums[n, arrays.MASS] * (nodes.update[n, c] - star[c]) / dt
            hooks.loads[n, c] += load  # see _work_at_nodes
        if own and hooks.table[h].slot >= 0:
            for c in range(len(numbers)):
                totals.add_to(control.totals, hooks.table[h].slot + c, float(numbers[c]))
    return 0


class _NoWhole(NamedTuple):
    """Takes the place of the functions of whole points in loops without them."""

    whole: tuple


def without_whole(hooks):
    """Omit functions of whole points: otherwise loops are compiled again for each of them."""
    return arrays.with_items_of(hooks, _NoWhole(()))


def known_to_hooks(nodes):
    """Return the declared fields that the loop uses: others would have it compiled again."""
    return tuple([one for one in nodes.fields if type(one) in (FrictionalHeat, RigidSums)])


def node_hooks(stage, target, kin, grids, nodes, ranges, hooks, control, dt, kept):
    """Call the node functions of `stage` on the members that have mass.

    `kept` is the fraction of its velocity that a point retains, and changes by nodal increments.
    For `LOADS` the work is summed: here, so that the loop over the nodes is compiled once.
    """
    fields = known_to_hooks(nodes)
    early, flat = stage == arrays.POST_PARTICLES_TO_GRID, planar(kin)
    whole = tuple(
        [
            WholeNodes(tag, flat, grids, nodes, ranges, early, target)
            for tag in hooks.whole
            if tag.of_nodes
        ]
    )
    nodes = arrays.Nodes(nodes.sums, nodes.update, nodes.velocity, fields)
    kin, dt, hooks = planar(kin), float(dt), without_whole(hooks)
    _node_hooks(stage, target, kin, grids, nodes, ranges, whole, hooks, control, dt, kept)


@kernel
def _node_hooks(stage, target, kin, grids, nodes, ranges, whole, hooks, control, dt, kept):
    what = hold(HookedNodes(target, kin, grids, nodes, ranges, kept))
    if target == LOADS:
        if hooks.loads.size > 0:
            _act_on_all(what, ACT, hooks, control, dt, NONE, 1.0)
            totals.carry(control.totals[totals.WORK])
        return
    if target == arrays.ON_UPDATE:
        _clear_held(what, hooks.held)
    for h in range(len(hooks.table)):
        if hooks.table[h].stage != stage:
            continue
        _clear_total(hooks, h, control)
        share = 1.0
        if hooks.table[h].uses_share:
            heavy = _act_on_part(what, COUNT, hooks, control, dt, h, share, NONE, NONE + 1)
            share = 1.0 / max(totals.number_of_all(control.ranks, control, heavy), 1)
        if hooks.table[h].address == arrays.WHOLE:
            for one in whole:
                # Before the forces (usf) v* belongs to the step before.
                if one.tag.row == h and target != arrays.ON_VELOCITY:
                    _act_on_all(one, ACT, hooks, control, dt, h, share)
        else:
            _act_on_all(what, ACT, hooks, control, dt, h, share)
        publish_total(hooks, h, control)
    # Friction at walls follows when it is known which of them hold a node.
    for h in range(len(hooks.table)):
        if hooks.table[h].stage != stage:
            continue
        rubs = hooks.programs[h, FRICTION].begin >= 0
        if rubs:
            _act_on_all(what, RUB, hooks, control, dt, h, 1.0)
        if rubs or (hooks.table[h].holds and hooks.held.size > 0):
            publish_total(hooks, h, control)


@point_function(otherwise=True)
def at_nodes(hooks, stage, target, s):
    """Let the fixes act on the nodes."""


@at_nodes.on(arrays.Hooks)
def _at_nodes_hooks(hooks, stage, target, s):
    clock = s.control.clock[0]
    node_hooks(
        stage, target, s.kin, s.grids, s.nodes, s.ranges, hooks, s.control, kick(s), clock.kept
    )
    clock.set_low = clock.set_high = 0.0  # of temperatures only


@point_function(otherwise=True)
def add_work(hooks, s):
    """Sum the work of the loads on nodes."""


@add_work.on(arrays.Hooks)
def _add_work_hooks(hooks, s):
    node_hooks(NONE, LOADS, s.kin, s.grids, s.nodes, s.ranges, hooks, s.control, kick(s), 0.0)


# --- points -----------------------------------------------------------------------------------


def choose_points(what, hooks, h, p, end):
    """Choose up to a block of members; return their number, where to continue. Store places."""
    begin, ids, where = hooks.table[h].begin, what.ids, hooks.scratch
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


@act.on(MovingPoints)
def _act_on_motion(what, task, hooks, control, dt, h, count, share):
    v, y = what.v, what.y
    d = directions(hooks)
    for c in range(d):
        if hooks.programs[h, c].begin < 0:
            continue
        _evaluate_now_and_before(hooks, h, c, count, control)
        slot = hooks.table[h].slot
        # Forces act while a hook leads a point from its initial velocity in the step.
        leads = hooks.table[h].stage == arrays.POST_ADVANCE_PARTICLES
        leads = leads and hooks.table[h].uses_before > 0
        for q in range(count):
            p = hooks.chosen[q]
            velocity, place, total = _call_point_function(
                hooks.table[h].address, what.mass[p], v[c, p], what.x[c, p], y[c, p],
                hooks.scratch[VALUE, q], hooks.scratch[BEFORE, q], dt, control.clock[0].kick,
            )  # fmt: skip
            speed = float(v[c, p])
            first = hooks.scratch[BEFORE, q] if leads else speed
            work = 0.5 * float(what.mass[p]) * (velocity - speed) * (velocity + first)
            totals.add_to(control.totals, totals.WORK, 0.0 if what.rigid else work)
            v[c, p] = velocity
            # Corners move with their point.
            for corner in range(what.corners):
                y[d + d * corner + c, p] += place - y[c, p]
            y[c, p] = place
            if slot >= 0:
                totals.add_to(control.totals, slot + c, total)
    return 0


@act.on(HeatedPoints)
def _act_on_warmth(what, task, hooks, control, dt, h, count, share):
    evaluate(hooks, h, 0, count, control, VALUE, 0.0)
    if hooks.programs[h, 1].begin >= 0:
        evaluate(hooks, h, 1, count, control, BEFORE, 0.0)
    slot = hooks.table[h].slot
    clock = control.clock[0]
    for q in range(count):
        p = hooks.chosen[q]
        before = what.supply[0, p]
        share, supply, T = _call_heat_function(
            hooks.table[h].address, what.capacity[0, p], what.temperature[0, p],
            face(what.kin, what.volume[0, p], load_vector(what.kin, what.x, p)),
            before, hooks.scratch[VALUE, q], hooks.scratch[BEFORE, q], dt,
        )  # fmt: skip
        what.share[0, p] = min(what.share[0, p], share)
        what.supply[0, p] = supply
        what.temperature[0, p] = T
        if slot >= 0:
            totals.add_to(control.totals, slot, supply - before)
        # A prescribed temperature bounds it: the resulting one does not.
        if hooks.table[h].holds > 0:
            T = hooks.scratch[BEFORE, q]
        elif what.capacity[0, p] > 0:
            # Another point may have got earlier what the fastest point takes.
            rate = supply / what.capacity[0, p]
            clock.rise, clock.fall = max(clock.rise, rate), min(clock.fall, rate)
        if share == 0 or hooks.table[h].holds > 0:
            clock.coldest, clock.hottest = min(clock.coldest, T), max(clock.hottest, T)
    return 0


def _of_time(tag, kin, hooks, control, dt, h):
    """Return formulas of time now and at the end of the step, 0 without; and contact times."""
    found = []
    for shift in (0.0, dt):
        for c in range(kin.dimension):
            if c < len(tag.values):
                evaluate(hooks, h, c, 1, control, VALUE, shift)
                found.append(hooks.scratch[VALUE, 0])
            else:
                found.append(0.0)
    clock = control.clock[0]
    return (*found, clock.contact_dt, clock.contact_kick, clock.kick)


@act.on(WholePoints)
def _act_on_whole_points(what, task, hooks, control, dt, h, count, share):
    tag, points, kin = what.tag, what.points, what.kin
    rows = (VALUE, BEFORE, THIRD)
    led = _of_time(tag, kin, hooks, control, dt, h) if tag.of_time else ()
    for c in range(0 if tag.of_time else len(tag.values)):
        evaluate(hooks, h, c, count, control, rows[c], 0.0)
    for q in range(count):
        p = hooks.chosen[q]
        law, state = state_at(kin, points, what.laws, p)
        values = led
        if not tag.of_time:
            values = tuple([hooks.scratch[rows[c], q] for c in range(len(tag.values))])
        old = load_vector(kin, points.v, p)
        found = kinds.results(tag, what, law, state, p, values, dt)
        numbers = kinds.written(tag, what, p, found)
        new = load_vector(kin, points.v, p)
        work = 0.5 * float(points.mass[p]) * dot(new - old, new + old)
        totals.add_to(control.totals, totals.WORK, 0.0 if moves_as_told(what.laws) else float(work))
        if hooks.table[h].slot >= 0:
            for c in range(len(numbers)):
                totals.add_to(control.totals, hooks.table[h].slot + c, float(numbers[c]))
        if len(what.heat):
            supply, capacity = what.heat
            if capacity[0, p] > 0:
                rate = float(supply[0, p]) / float(capacity[0, p])
                clock = control.clock[0]
                clock.rise, clock.fall = max(clock.rise, rate), min(clock.fall, rate)
    return 0


@kernel
def _point_hooks(stage, what, whole, hooks, control, dt):
    dt = float(dt)
    for h in range(len(hooks.table)):
        if hooks.table[h].stage != stage:
            continue
        if hooks.table[h].address == arrays.WHOLE:
            for one in whole:
                if one.tag.row == h:
                    _act_on_all(one, ACT, hooks, control, dt, h, 1.0)
        else:
            _act_on_all(what, ACT, hooks, control, dt, h, 1.0)


@kernel
def _begin_or_end_totals(stage, hooks, control, begin):
    for h in range(len(hooks.table)):
        if hooks.table[h].stage == stage:
            if begin:
                _clear_total(hooks, h, control)
            else:
                publish_total(hooks, h, control)


def point_hooks(stage, then, hooks, s, what_of, heat_of):
    """Call the point functions of `stage` on the members in each block; sum over them.

    ``what_of(s, block, then)`` gives the argument of functions of one component, and
    ``heat_of(points)`` the heat arguments of functions of whole points.
    """
    control, dt, without = s.control, step_size(s), without_whole(hooks)
    of_points = [tag for tag in hooks.whole if not tag.of_nodes]
    _begin_or_end_totals(stage, without, control, True)
    for block in s.blocks:
        heat = heat_of(block.points)
        whole = tuple([whole_points(tag, s, block, then, heat) for tag in of_points])
        _point_hooks(stage, what_of(s, block, then), whole, without, control, dt)
    _begin_or_end_totals(stage, without, control, False)


def _positions(s, points, then):
    """Return the positions before a step, and after it if `then`, else the same."""
    now = s.control.clock[0].now
    return points.x[now], points.x[1 - now if then else now]


def whole_points(tag, s, block, then, heat):
    """Return the argument of a function of whole points."""
    points = block.points
    _, y = _positions(s, points, then)
    return WholePoints(tag, points.id, s.kin, points, block.laws, y, heat)


def moving_points(s, block, then):
    """Return the argument of point functions."""
    points, rigid = block.points, moves_as_told(block.laws)
    x, y = _positions(s, points, then)
    return MovingPoints(points.id, points.v, points.mass, x, y, corners_that_move(s), rigid)


def clear_forces(kin, force, count):
    """Clear the forces of fixes on points."""
    if force is not None:
        for c in range(kin.dimension):
            for p in range(count):
                force[c, p] = 0


def corners_that_move(s):
    """Count the corners that are stored after the position of a point, and move with it."""
    return placed(s.basis, s.kin) if s.frame.moves else 0


@point_function(otherwise=True)
def at_points(hooks, stage, then, s):
    """Let the fixes act on the points; `then` is 1 when their new positions are known, else 0."""


@at_points.on(arrays.Hooks)
def _at_points_hooks(hooks, stage, then, s):
    if stage == arrays.INITIAL_INTEGRATE and len(hooks.whole):
        for block in s.blocks:
            clear_forces(s.kin, field(block.points.fields, Force), block.points.mass.size)
    point_hooks(stage, then, hooks, s, moving_points, lambda points: ())
