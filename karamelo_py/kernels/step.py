"""The rows of a step, compiled or interpreted, and the loop over steps.

Many steps run in one compiled call; with hooks in Python the same source is interpreted.
"""

import functools
from collections.abc import Callable, Iterable
from math import sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler import at_hand, implements, kernel, real
from karamelo_py.compiler.fields import load_vector
from karamelo_py.compiler.threads import by_team
from karamelo_py.kernels import clock as clocks
from karamelo_py.kernels import table
from karamelo_py.kernels.arrays import DT, TIME, NoHooks, Setup, Tag
from karamelo_py.kernels.hook_loop import add_work, at_nodes, at_points
from karamelo_py.kernels.sweep import Extent, sweep, sweep_nodes
from karamelo_py.kernels.table import Processor, take
from karamelo_py.kernels.views import deformation_of, state_at
from karamelo_py.kernels.watch import look, look_at_heat
from karamelo_py.points.frames import inverse_stretch_squared
from karamelo_py.points.laws import meeting, wave_speed_squared


class Fused(NamedTuple):
    """As few passes over the points as possible, without hooks on points between them."""


class Staged(NamedTuple):
    """One pass per stage, with hooks on points between passes."""


def rows_of(scheme: Any, visits: Any) -> list[Any]:
    return table.fused(scheme.rows) if visits is Fused else table.staged(scheme.rows)


def first_rows(scheme: Any, visits: Any) -> list[Any]:
    """List the rows that make the nodal sums needed by the first fused step."""
    if visits is not Fused:
        return []
    return [rows_of(scheme, Fused)[-1]._replace(gathers=False, only_if_more=False, moves=False)]


def untaken(rows: Iterable[Any], backend: type) -> list[str]:
    kinds = [kind for kind in dict.fromkeys(map(type, rows)) if kind not in table.COMBINED]
    return [kind.__name__ for kind in kinds if not take.defined(kind, backend)]


class InStep(NamedTuple):
    mode: Tag
    hooks: Tag
    more: bool  # another step follows, for which a fused step leaves sums at the nodes


class StepKind(NamedTuple):
    scheme: Tag
    visits: Tag  # `Fused` or `Staged`
    mode: Tag  # one thread or several


@take.on(table.AtPoints, Processor)
def _at_points(row, s, step):
    at_points(step.hooks, row.stage, row.then, s)


@take.on(table.AtNodes, Processor)
def _at_nodes(row, s, step):
    at_nodes(step.hooks, row.stage, row.target, row.at(s) if row.at else s)


@take.on(table.WorkOfLoads, Processor)
def _work_of_loads(row, s, step):
    add_work(step.hooks, s, row.again)


@take.on(table.NodeTask, Processor)
def _node_task(row, s, step):
    task = row.make(s) if row.make else row.task
    here = row.at(s) if row.at else s
    sweep_nodes(step.mode, task, here, (row.length or clocks.kick)(s))


@take.on(table.EachNode, Processor)
def _each_node(row, s, step):
    row.loop(s, step.mode)


@take.on(table.EachPoint, Processor)
def _each_point(row, s, step):
    for block in s.blocks:
        if isinstance(block.laws, row.law):
            row.loop(s, block)


@take.on(table.Once, Processor)
def _once(row, s, step):
    return row.function(s)


@take.on(table.InThreads, Processor)
def _in_threads(row, s, step):
    return row.function(s, step.mode)


@take.on(table.Repeated, Processor)
def _repeated(row, s, step):
    for k in range(row.count(s)):
        _take_all(row.rows(k), s, step)


@take.on(table.Check, Processor)
def _check(row, s, step):
    return clocks.check_moves(s, step.mode)


@take.on(table.Sweep, Processor)
def _sweep(row, s, step):
    whole = clocks.last_step_size(s) if row.of_last_step else clocks.step_size(s)
    dt = whole if row.share == 1 else real(row.share, whole) * whole
    scatters = step.more if row.only_if_more else row.scatters
    here = row.at(s) if row.at else s
    sweep(here, step.mode, row.visit, Extent(dt, row.gathers, scatters, row.moves))
    return clocks.all_well(s, row.reported) if row.reported else True


def _take_all(rows, s, step):
    for row in table.plain(rows, s):
        well = take.find((type(row), Processor))(row, s, step)
        if well is not None and not well:
            return False
    return True


def _taking(rows_of_kind: Callable) -> Callable[[StepKind, Setup, Tag, bool], bool]:
    """Make a function that carries out the rows of a scheme. It returns False if a point failed."""
    cached: Any = functools.cache(rows_of_kind)  # for interpreted runs

    def take_all(kind, s, hooks, more):
        scheme, visits, mode = kind
        return _take_all(cached(type(scheme), type(visits)), s, InStep(mode, hooks, more))

    @implements(take_all, by_type=True)
    def take_all_of(kind, s, hooks, more):
        rows = rows_of_kind(*(tag.instance_class for tag in kind.types[:2]))
        return lambda kind, s, hooks, more: _take_all(rows, s, InStep(kind.mode, hooks, more))

    return take_all


# Take a step, or the rows before the first step; with `more`, a fused step leaves sums.
step, begin = _taking(rows_of), _taking(first_rows)


def take_rows(rows: tuple, s: Setup, mode: Tag, hooks: Tag) -> bool:
    return _take_all(_alone(rows), s, InStep(mode, hooks, False))


_alone: Any = functools.cache(table.one_by_one)


DONE, STOPPED, ABOVE_LIMIT, SORT, SHRUNK, GAINED, HEATED = range(7)
MOST_ABOVE_LIMIT = 50  # consecutive steps above the stable limit that stop a run
SMALLEST = 1e-6  # fraction of the first stable step below which a run stops


def run_steps(kind: StepKind, s: Setup, hooks: Tag, count: int) -> int:
    """Take up to `count` steps, not beyond the end time; return why they ended.

    The result is DONE, STOPPED (a point failed), ABOVE_LIMIT (dt above the stable limit), SHRUNK
    (stable dt near 0), GAINED (spurious energy), HEATED (unexplained temperatures), SORT (a point
    may soon leave the nodes of its tile).
    """
    values = s.control.values
    stepping, motion = s.control.step[0], s.control.motion[0]
    if not begin(kind, s, NoHooks(), True):
        return STOPPED
    for n in range(count):
        time = values[TIME] + values[DT]
        last = n + 1 == count or time >= stepping.end_time
        if not step(kind, s, hooks, not last):
            return STOPPED
        clocks.finish(s.control)
        if not look(s, kind.mode):
            return GAINED
        if not look_at_heat(s):
            return HEATED
        if stepping.watch_limit > 0 and stepping.over_limit >= MOST_ABOVE_LIMIT:
            return ABOVE_LIMIT
        if stepping.limit < SMALLEST * stepping.first_limit:
            return SHRUNK
        if motion.drift > motion.drift_limit:
            return SORT
        if last:
            break
    return DONE


_by_team = by_team(lambda mode, kind, s, hooks, count: run_steps(kind, s, hooks, count))


@kernel
def advance(kind: StepKind, s: Setup, hooks: Tag, count: int) -> int:
    return _by_team(kind.mode, kind, s, hooks, count)


@kernel
def _fastest(frame, kin, points, laws, control):
    points, laws = at_hand(points), at_hand(laws)
    motion = control.motion[0]
    rate, closing, first = 0.0, 0.0, control.step[0].last_dt == 0
    common = clocks.common_velocity(kin, motion, motion.rate)
    for p in range(points.mass.size):
        law, state = state_at(kin, points, laws, p)
        f = deformation_of(frame, kin, points, (law, state), p)
        shorter = inverse_stretch_squared(frame, kin, f, points.mass[p])
        v = (load_vector(kin, points.v, p) - common).largest()
        rate = max(rate, sqrt(wave_speed_squared(law, kin, state) * shorter) + v)
        if first:
            state = meeting(law, state, v)
            closing = max(closing, sqrt(wave_speed_squared(law, kin, state) * shorter) + v)
    motion.rate, motion.closing = max(motion.rate, rate), max(motion.closing, closing)


def measure(s: Setup) -> None:
    s.control.motion[0].rate = s.control.motion[0].closing = 0.0
    for block in s.blocks:
        _fastest(s.frame, s.kin, block.points, block.laws, s.control)
