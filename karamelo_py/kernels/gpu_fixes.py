"""Hooks of fixes, totals and the energy monitor on a GPU, as functions of one thread.

Members are processed one by one with private scratch (:mod:`karamelo_py.kernels.hook_loop`). Totals
are sums of integers, exact in any order; several copies reduce collisions.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import index
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.gpu import counted, raise_to
from karamelo_py.compiler.lanes import room_for
from karamelo_py.compiler.programs import ROWS, STACK
from karamelo_py.kernels import arrays, hook_loop, totals, watch
from karamelo_py.kernels.arrays import TIMESTEP, known_to_laws, with_items
from karamelo_py.kernels.clock import checked_move, kick, move_check, step_size
from karamelo_py.kernels.contact import SeparateFields
from karamelo_py.kernels.equations.internal_force import Force
from karamelo_py.kernels.equations.node_updates import WorkAtNodes
from karamelo_py.kernels.equations.transfer_loss import TransferLoss
from karamelo_py.kernels.gpu import CHUNK, MOVED, STATUS, goes_wrong, is_last
from karamelo_py.kernels.heat import heat_of
from karamelo_py.kernels.step import GAINED


def _hooks_with_room(hooks):
    scratch = room_for(1, (0.0,) * (STACK + ROWS + 1))
    scratch[:6] = 0.0
    chosen = room_for(1, (0,))[0]
    return with_items(hook_loop.without_whole(hooks), chosen=chosen, scratch=scratch)


def _copy_of(copies, i):
    return copies[index((i // 32) % len(copies))]


def _control(count: int) -> Callable:
    def own_values(values):
        room = room_for(count, (0.0,))[0]
        for k in range(count):
            room[k] = values[k]
        return room

    def control_of(s, copies, i):
        copy = _copy_of(copies, i)
        if count:
            return with_items(s.control, totals=copy, values=own_values(s.control.values))
        return with_items(s.control, totals=copy)

    return control_of


_CONTROL = _control(0)


def clear_held(i, outcome, holders):
    for c in range(holders.shape[1]):
        holders[i, c].slot = 0


class Act(NamedTuple):
    hooks: NamedTuple
    h: int
    heavy: np.ndarray  # (hooks,) members with mass
    copies: np.ndarray  # copies of the totals


def _member(hooks, h, i):
    begin = hooks.table[h].begin
    return i if begin < 0 else hooks.members[begin + i]


def count_node(i, outcome, s, about):
    if s.nodes.sums[_member(about.hooks, about.h, i), arrays.MASS] > 0:
        counted(about.heavy, about.h, 1)


def hooked_nodes(target: int, of_heat: bool = False) -> Callable:
    return lambda s: hook_loop.hooked_nodes(s, target, 1.0 if of_heat else s.control.step[0].kept)


def whole_nodes(target: int, stage: int) -> Callable:
    return lambda s, tag: hook_loop.whole_nodes(s, tag, stage, target)


def work_of_loads(i, outcome, s, about, target):
    if s.nodes.sums[i, arrays.MASS] > 0:
        hooks = _hooks_with_room(about.hooks)
        hooks.chosen[0] = i
        call = hook_loop.Call(hooks, _CONTROL(s, about.copies, i), float(kick(s)), 0, 1.0)
        hook_loop.act(hook_loop.hooked_nodes(s, target, 0.0), hook_loop.ACT, call, 1)


def on_node(nodes_of: Callable, task: int, values: int = 0, length: Callable = kick) -> Callable:
    """Return the thread function of a hook's `task` at a node, for the time that `length` gives."""
    control_of = _control(values)

    def visit_member(i, outcome, s, about, *tag):
        hooks = about.hooks
        n = _member(hooks, about.h, i)
        if s.nodes.sums[n, arrays.MASS] > 0:
            private = _hooks_with_room(hooks)
            private.chosen[0] = n
            shared = hooks.table[about.h].uses_share
            share = 1.0 / max(about.heavy[about.h], 1) if shared else 1.0
            control = control_of(s, about.copies, i)
            call = hook_loop.Call(private, control, float(length(s)), about.h, share)
            hook_loop.act(nodes_of(s, *tag), task, call, 1)

    return visit_member


def clear_force(i, outcome, s, block):
    force = field(block.points.fields, Force)
    if force is not None:
        for c in range(force.shape[0]):
            force[c, i] = 0


def whole_points(heats: bool) -> Callable:
    return lambda s, block, then, tag: hook_loop.whole_points(
        tag, s, block, then, heat_of(block.points) if heats else ()
    )


def on_point(points_of: Callable, then: int, values: int = 0) -> Callable:
    control_of = _control(values)

    def visit_point(i, outcome, s, block, about, *tag):
        hooks, control = _hooks_with_room(about.hooks), control_of(s, about.copies, i)
        members = points_of(s, block, then, *tag)
        call = hook_loop.Call(hooks, control, float(step_size(s)), about.h, 1.0)
        count, _ = hook_loop.choose_points(members, call, i, i + 1)
        if count > 0:
            hook_loop.act(members, hook_loop.ACT, call, 1)

    return visit_point


def check_point(i, outcome, s, block):
    points = block.points
    cells, good = checked_move(move_check(s), points, i)
    if good:
        raise_to(outcome, MOVED, cells)
    else:
        goes_wrong(outcome, points.id[i])


def take_moves(i, outcome, s):
    motion = s.control.motion[0]
    motion.move = max(motion.move, outcome[MOVED])
    outcome[MOVED] = 0.0


def _setup(s: arrays.Setup) -> Callable:
    fields = len(s.contact.slot) if isinstance(s.contact, SeparateFields) else 0
    unknown = len(s.kin.Unknown._fields)

    def contact_of(s):
        if fields == 0:
            return s.contact
        scratch = room_for(2, (0,) * fields)
        change = room_for(unknown, (0.0,) * fields)
        return with_items(s.contact, meeting=scratch[:, 0], partners=scratch[:, 1], change=change)

    def setup_of(s, copies, i):
        return with_items(s, contact=contact_of(s), control=_CONTROL(s, copies, i))

    return setup_of


def each_node(function: Callable, s: arrays.Setup) -> Callable:
    setup_of = _setup(s)

    def visit_each_node(i, outcome, s, use, copies):
        if use[i] > 0:
            function(setup_of(s, copies, i), i)

    return visit_each_node


def each_point(function: Callable, s: arrays.Setup) -> Callable:
    setup_of = _setup(s)

    def visit_each_point(i, outcome, s, block, copies):
        function(setup_of(s, copies, i), block, i)

    return visit_each_point


def once(function: Callable) -> Callable:
    def do_once(i, outcome, s):
        function(s)

    return do_once


def clear_totals(i, outcome, copies, first, count):
    limbs = copies.shape[2]
    k, rest = i // (count * limbs), i % (count * limbs)
    copies[k, first + rest // limbs, rest % limbs] = 0


def clear_rows(i, outcome, sums, first):
    sums[first + i // sums.shape[1], i % sums.shape[1]] = 0


def collect_total(i, outcome, copies, sums, first):
    row, limb = first + i // copies.shape[2], i % copies.shape[2]
    total = sums[row, limb]
    for k in range(copies.shape[0]):
        total += copies[k, row, limb]
        copies[k, row, limb] = 0
    sums[row, limb] = total


def publish(i, outcome, s, hooks, which):
    """Publish totals of hooks `which` = (first, end, always), or only at the end of a run."""
    begin, end, always = which
    if always or is_last(s):
        for h in range(begin, end):
            hook_loop.publish_total(hooks, h, s.control)


def add_energies(i, outcome, s, block, copies):
    points, laws, kin = known_to_laws(block.points), block.laws, s.kin
    threads = -(-points.mass.size // CHUNK)
    copy = copies[index(i % len(copies))]
    firsts, first_row = s.control.firsts, s.control.values.size
    kinetic = stored = lost = 0.0
    gone = field(block.points.fields, TransferLoss)
    solid, begin, behind = -1, 0, 0
    total, of_all = (0.0,) * (1 + kin.dimension), (0.0,) * (1 + kin.dimension)
    for p in range(i, points.mass.size, threads):
        mass, v, of_motion, elastic, of_strain = watch.energies_of(kin, points, laws, index(p))
        kinetic += of_motion
        stored += of_strain
        lost += float(gone[0, p]) if gone is not None else 0.0
        if not begin <= points.id[p] < behind:
            _add_all(copy, first_row, solid, total)
            total = (0.0,) * (1 + kin.dimension)
            solid = watch.solid_of(firsts, points.id[p])
            begin, behind = firsts[solid], firsts[solid + 1]
        more = zip(total, (mass, *[mass * x for x in v]), strict=True)
        total = tuple([old + x for old, x in more])
        more = zip(of_all, (elastic, *[elastic * x for x in v]), strict=True)
        of_all = tuple([old + x for old, x in more])
    totals.add_to(copy, totals.KINETIC, kinetic)
    totals.add_to(copy, totals.STORED, stored)
    totals.add_to(copy, totals.TRANSFER_LOSS, lost)
    _add_all(copy, first_row, solid, total)
    _add_all(copy, first_row, firsts.size - 1, of_all)


def _add_all(copy, first_row, solid, total):
    if solid >= 0:
        for k, number in enumerate(total):
            totals.add_to(copy, first_row + solid * len(total) + k, number)


def add_work_at_node(i, outcome, s, copies):
    work = field(s.nodes.fields, WorkAtNodes)
    totals.add_to(_copy_of(copies, i), totals.WORK, float(work[i, 0]))
    work[i, 0] = 0


def add_more(i, outcome, s, block, copies):
    points, more = known_to_laws(block.points), watch.more_of(block)
    kinetic, done = watch.take_more(s.kin, points, more, index(i))
    totals.add_to(_copy_of(copies, i), totals.KINETIC, kinetic)
    totals.add_to(_copy_of(copies, i), totals.WORK, done)


def look_before(i, outcome, s):
    totals.carry(s.control.totals[totals.WORK])
    watch.take_energies(s)
    watch.note_before(s.control.energy[0], int(s.control.values[TIMESTEP]))


def look_behind(i, outcome, s):
    energy = s.control.energy[0]
    if energy.stored_at != int(s.control.values[TIMESTEP]) - 1:
        return
    totals.carry(s.control.totals[totals.WORK])
    watch.take_energies(s)
    watch.take_drift(s)
    if not watch.judge(s.control):
        outcome[STATUS] = 1.0 + GAINED
