"""Hooks of fixes, their totals, and the watch over energy on a GPU: the work of one thread.

The functions of :mod:`karamelo_py.kernels.hook_loop` do the work, for one member at a time: each
thread has the tables of the hooks with a private scratch. Totals are sums of integers, which
threads may add to in any order: a few copies of them spread the traffic.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.compile import index
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.formula import ROWS, STACK
from karamelo_py.compiler.gpu import counted, raise_to
from karamelo_py.compiler.lanes import room_for
from karamelo_py.kernels import arrays, hook_loop, totals, watch
from karamelo_py.kernels.arrays import TIMESTEP, known_to_laws, with_items_of
from karamelo_py.kernels.clock import checked_move, kick, step_size
from karamelo_py.kernels.contact import Scratch, SeparateFields
from karamelo_py.kernels.gpu import MOVED, STATUS, goes_wrong, is_last
from karamelo_py.kernels.heat import heat_of
from karamelo_py.kernels.p2g import Force, WorkOfForces
from karamelo_py.kernels.step import GAINED
from karamelo_py.points.kinematics import planar


class Own(NamedTuple):
    """Arrays of a thread instead of those in `Hooks`."""

    chosen: np.ndarray
    scratch: np.ndarray


class OwnTotals(NamedTuple):
    """Totals of a thread instead of those in `Control`."""

    totals: np.ndarray


class OwnValues(NamedTuple):
    """Published values of a thread, whose time it may set back."""

    totals: np.ndarray
    values: np.ndarray


def _hooks_with_room(hooks):
    """Return the hooks with room for one member."""
    own = Own(room_for(1, (0,))[0], room_for(1, (0.0,) * (STACK + ROWS + 1)))
    own.scratch[:6] = 0.0
    return with_items_of(hook_loop.without_whole(hooks), own)


def _control(count: int) -> Callable:
    """Make the control of a thread; `count` private values, or 0."""

    def own_values(values):
        room = room_for(count, (0.0,))[0]
        for k in range(count):
            room[k] = values[k]
        return room

    def control_of(s, copies, i):
        own = copies[index((i // 32) % len(copies))]
        if count:
            return with_items_of(s.control, OwnValues(own, own_values(s.control.values)))
        return with_items_of(s.control, OwnTotals(own))

    return control_of


_CONTROL = _control(0)


# --- nodes ------------------------------------------------------------------------------------


def clear_held(i, fate, held):
    """Clear the record of what holds a node."""
    for c in range(held.shape[1]):
        held[i, c].slot = 0


def _member(hooks, h, i):
    begin = hooks.table[h].begin
    return i if begin < 0 else hooks.members[begin + i]


def count_node(i, fate, nodes, hooks, h, heavy):
    """Count a member with mass."""
    if nodes.sums[_member(hooks, h, i), arrays.MASS] > 0:
        counted(heavy, h, 1)


def _share(hooks, h, heavy):
    return 1.0 / max(heavy[h], 1) if hooks.table[h].uses_share else 1.0


def _planar_nodes(nodes):
    """Return the nodes with the fields for hooks."""
    known = hook_loop.known_to_hooks(nodes)
    return arrays.Nodes(nodes.sums, nodes.update, nodes.velocity, known)


def on_node(target: int, task: int, values: int, of_heat: bool = False) -> Callable:
    """Make what a member of a hook on nodes does; `task` is ACT or RUB."""
    control_of = _control(values)
    length = step_size if of_heat else kick

    def visit_member(i, fate, s, hooks, h, heavy, copies):
        n = _member(hooks, h, i)
        if not s.nodes.sums[n, arrays.MASS] > 0:
            return
        own = _hooks_with_room(hooks)
        own.chosen[0] = n
        # For temperatures always FLIP, whatever the transfer of velocity.
        control, kept = control_of(s, copies, i), 1.0 if of_heat else s.control.clock[0].kept
        nodes = _planar_nodes(s.nodes)
        what = hook_loop.HookedNodes(target, planar(s.kin), s.grids, nodes, s.ranges, kept)
        hook_loop.act(what, task, own, control, float(length(s)), h, 1, _share(hooks, h, heavy))

    return visit_member


def on_whole_node(target: int, early: bool) -> Callable:
    """Make the same of a hook on whole nodes; `early` before the update."""

    def visit_whole_member(i, fate, s, hooks, tag, h, copies):
        n = _member(hooks, h, i)
        if not s.nodes.sums[n, arrays.MASS] > 0:
            return
        own = _hooks_with_room(hooks)
        own.chosen[0] = n
        what = hook_loop.WholeNodes(tag, planar(s.kin), s.grids, s.nodes, s.ranges, early, target)
        hook_loop.act(what, hook_loop.ACT, own, _CONTROL(s, copies, i), float(kick(s)), h, 1, 1.0)

    return visit_whole_member


def work_of_loads(i, fate, s, hooks, copies):
    """Sum the work of loads on a node, and clear them."""
    if s.nodes.sums[i, arrays.MASS] > 0:
        own = _hooks_with_room(hooks)
        own.chosen[0] = i
        what = hook_loop.HookedNodes(
            hook_loop.LOADS, planar(s.kin), s.grids, _planar_nodes(s.nodes), s.ranges, 0.0
        )
        hook_loop.act(what, hook_loop.ACT, own, _CONTROL(s, copies, i), float(kick(s)), 0, 1, 1.0)


# --- points -----------------------------------------------------------------------------------


def clear_force(i, fate, s, block):
    """Clear the force of fixes on a point."""
    force = field(block.points.fields, Force)
    if force is not None:
        for c in range(s.kin.dimension):
            force[c, i] = 0


def _act_on_point(what, control_of, i, s, hooks, h, copies):
    own = _hooks_with_room(hooks)
    count, _ = hook_loop.choose_points(what, own, h, i, i + 1)
    if count > 0:
        hook_loop.act(
            what, hook_loop.ACT, own, control_of(s, copies, i), float(step_size(s)), h, 1, 1.0
        )


def on_point(what_of: Callable, then: int, values: int) -> Callable:
    """Make a point's function for a hook on the result of `what_of`; `then` is 1 after the move."""
    control_of = _control(values)

    def visit_point(i, fate, s, block, hooks, h, copies):
        _act_on_point(what_of(s, block, then), control_of, i, s, hooks, h, copies)

    return visit_point


def on_whole_point(then: int, heats: bool = False) -> Callable:
    """Make the same of a hook on whole points."""

    def visit_whole_point(i, fate, s, block, hooks, tag, h, copies):
        heat = heat_of(block.points) if heats else ()
        what = hook_loop.whole_points(tag, s, block, then, heat)
        _act_on_point(what, _CONTROL, i, s, hooks, h, copies)

    return visit_whole_point


def check_point(i, fate, s, block):
    """Check the new position of a point again, after hooks that may have changed it."""
    points, clock = block.points, s.control.clock[0]
    cells, good = checked_move(s.frame, s.kin, s.grids, points, clock.now, clock.stride, i)
    if good:
        raise_to(fate, MOVED, cells)
    else:
        goes_wrong(fate, points.id[i])


def take_moves(i, fate, s):
    """Accept the distances that points have moved."""
    clock = s.control.clock[0]
    clock.move = max(clock.move, fate[MOVED])
    fate[MOVED] = 0.0


# --- functions of nodes, of points, and between loops -------------------------------------------


class OwnParts(NamedTuple):
    """Items of a thread instead of those in `Setup`."""

    contact: NamedTuple
    control: NamedTuple


def _setup(s: arrays.Setup) -> Callable:
    """Make the setup of a thread, with private copies of arrays that threads would overwrite."""
    contact = s.contact
    fields = len(contact.slot) if isinstance(contact, SeparateFields) else 0
    d = s.kin.dimension

    def contact_of(s):
        if fields == 0:
            return s.contact
        own = room_for(2, (0,) * fields)
        room = Scratch(own[:, 0], own[:, 1], room_for(d, (0.0,) * fields))
        return with_items_of(s.contact, room)

    def setup_of(s, copies, i):
        return with_items_of(s, OwnParts(contact_of(s), _CONTROL(s, copies, i)))

    return setup_of


def each_node(function: Callable, s: arrays.Setup) -> Callable:
    """Make what a node does for a row of a function."""
    setup_of = _setup(s)

    def visit_each_node(i, fate, s, use, copies):
        if use[i] == 0:
            return
        function(setup_of(s, copies, i), i)

    return visit_each_node


def each_point(function: Callable, s: arrays.Setup) -> Callable:
    """Make what a point does for a row of a function."""
    setup_of = _setup(s)

    def visit_each_point(i, fate, s, block, copies):
        function(setup_of(s, copies, i), block, i)

    return visit_each_point


def once(function: Callable) -> Callable:
    """Make what is done once for a row of a function."""

    def do_once(i, fate, s):
        function(s)

    return do_once


# --- totals -----------------------------------------------------------------------------------


def clear_totals(i, fate, copies, first, count):
    """Clear a number of the totals in rows from `first` on, `count` of them, in all copies."""
    limbs = copies.shape[2]
    k, rest = i // (count * limbs), i % (count * limbs)
    copies[k, first + rest // limbs, rest % limbs] = 0


def clear_rows(i, fate, sums, first):
    """Clear a number of the totals from row `first` on."""
    sums[first + i // sums.shape[1], i % sums.shape[1]] = 0


def collect_total(i, fate, copies, sums, first):
    """Add up a number of the totals, in rows from `first` on, over the copies."""
    row, limb = first + i // copies.shape[2], i % copies.shape[2]
    total = sums[row, limb]
    for k in range(copies.shape[0]):
        total += copies[k, row, limb]
        copies[k, row, limb] = 0
    sums[row, limb] = total


def publish(i, fate, s, hooks, always):
    """Publish the totals of all hooks, if they are read."""
    if always or is_last(s):
        for h in range(len(hooks.table)):
            hook_loop.publish_total(hooks, h, s.control)


def publish_hook(i, fate, s, hooks, h):
    """Publish the totals of one hook."""
    hook_loop.publish_total(hooks, h, s.control)


# --- the watch over energy --------------------------------------------------------------------


def add_energies(i, fate, s, block, copies, threads):
    """Sum the energies of some points, and mass and momentum of their solids."""
    points, laws, kin = known_to_laws(block.points), block.laws, s.kin
    own = copies[index(i % len(copies))]
    firsts, first_row = s.control.firsts, s.control.values.size
    kinetic = stored = 0.0
    solid, begin, behind = -1, 0, 0
    total, of_all = (0.0,) * (1 + kin.dimension), (0.0,) * (1 + kin.dimension)
    for p in range(i, points.mass.size, threads):
        mass, v, of_motion, elastic, of_strain = watch.energies_of(kin, points, laws, index(p))
        kinetic += of_motion
        stored += of_strain
        if not begin <= points.id[p] < behind:
            _add_all(own, first_row, solid, total)
            total = (0.0,) * (1 + kin.dimension)
            solid = watch.solid_of(firsts, points.id[p])
            begin, behind = firsts[solid], firsts[solid + 1]
        more = zip(total, (mass, *[mass * x for x in v]), strict=True)
        total = tuple([part + x for part, x in more])
        more = zip(of_all, (elastic, *[elastic * x for x in v]), strict=True)
        of_all = tuple([part + x for part, x in more])
    totals.add_to(own, totals.KINETIC, kinetic)
    totals.add_to(own, totals.STORED, stored)
    _add_all(own, first_row, solid, total)
    _add_all(own, first_row, firsts.size - 1, of_all)


def _add_all(own, first_row, solid, total):
    if solid >= 0:
        for k, number in enumerate(total):
            totals.add_to(own, first_row + solid * len(total) + k, number)


def add_work(i, fate, s, block, copies):
    """Add the work of forces on a point to the work of loads on nodes."""
    work = field(block.points.fields, WorkOfForces)
    if work is not None:
        totals.add_to(copies[index((i // 32) % len(copies))], totals.WORK, float(work[0, i]))
        work[0, i] = 0


def look_before(i, fate, s):
    """Store the energies of a step if the next one is checked."""
    totals.carry(s.control.totals[totals.WORK])
    watch.take_energies(s)
    watch.note_before(s.control.clock[0], int(s.control.values[TIMESTEP]))


def look_behind(i, fate, s):
    """Check the energy; the run ends at a spurious gain."""
    clock = s.control.clock[0]
    if clock.stored_at != int(s.control.values[TIMESTEP]) - 1:
        return
    totals.carry(s.control.totals[totals.WORK])
    watch.take_energies(s)
    watch.take_drift(s)
    if not watch.judge(s.control):
        fate[STATUS] = 1.0 + GAINED
