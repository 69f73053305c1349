"""A step from the table of its scheme, and the loop over steps.

The same source serves two drivers: compiled, where many steps run in one call, and plain Python,
where hooks that are written in Python are called between the rows.
"""

import functools
from math import sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import implements, real
from karamelo_py.compiler.fields import load_vector
from karamelo_py.compiler.held import at_hand
from karamelo_py.compiler.loops import kernel
from karamelo_py.compiler.threads import by_team
from karamelo_py.kernels import clock as clocks
from karamelo_py.kernels import table
from karamelo_py.kernels.arrays import DT, TIME, NoHooks, Setup, Tag
from karamelo_py.kernels.hook_loop import at_nodes, at_points
from karamelo_py.kernels.sweep import sweep, sweep_nodes
from karamelo_py.kernels.views import deformation_of, state_at
from karamelo_py.kernels.watch import look, look_at_heat
from karamelo_py.points.frames import inverse_stretch_squared
from karamelo_py.points.laws import wave_speed_squared


class Fused(NamedTuple):
    """As few visits of the points as the scheme allows; no hooks between them on points."""


class Staged(NamedTuple):
    """One visit for each stage, so that hooks on points can act in between."""


def rows_of(scheme: Any, visits: Any) -> list[Any]:
    """List the rows of a step of `scheme`."""
    return table.fused(scheme.rows) if visits is Fused else table.staged(scheme.rows)


def first_rows(scheme: Any, visits: Any) -> list[Any]:
    """List the row that fused steps expect before them: the scatter of the last visit, alone."""
    if visits is not Fused:
        return []
    return [rows_of(scheme, Fused)[-1]._replace(gathers=False, only_if_more=False, moves=False)]


def _take(row, s, mode, hooks, more):
    """Take one row of the table; tell whether all points went well."""
    if isinstance(row, table.AtPoints):
        at_points(hooks, row.stage, row.then, s)
    elif isinstance(row, table.AtNodes):
        at_nodes(hooks, row.stage, row.target, s)
    elif isinstance(row, table.ByFixes):
        row.function(hooks, *row.arguments, s)
    elif isinstance(row, table.NodeTask):
        task = row.task(s) if callable(row.task) else row.task
        here = row.at(s) if row.at else s
        sweep_nodes(mode, task, here.kin, here.nodes, s.ranges, (row.length or clocks.kick)(s))
    elif isinstance(row, table.EachNode):
        row.loop(s)
    elif isinstance(row, table.EachPoint):
        for block in s.blocks:
            if isinstance(block.laws, row.law):
                row.loop(s, block)
    elif isinstance(row, table.Once):
        row.function(s)
    elif isinstance(row, table.Repeated):
        for k in range(row.count(s)):
            _take_all(row.rows(k), s, mode, hooks, more)
    elif isinstance(row, table.Check):
        return clocks.check_moves(s, mode)
    else:
        return _visit(row, s, mode, more)
    return True


def _visit(row, s, mode, more):
    """Visit the points; tell whether all went well."""
    whole = clocks.last_step_size(s) if row.of_last_step else clocks.step_size(s)
    dt = whole if row.share == 1 else real(row.share, whole) * whole
    scatters = more if row.only_if_more else row.scatters
    here = row.at(s) if row.at else s
    sweep(here, mode, row.visit, dt, row.gathers, scatters, row.moves)
    return clocks.all_well(s, row.reported) if row.reported else True


def _take_all(rows, s, mode, hooks, more):
    for row in table.plain(rows, s):  # noqa: SIM110  (no more rows after what went wrong)
        if not _take(row, s, mode, hooks, more):
            return False
    return True


_step_rows: Any = functools.cache(rows_of)  # interpreted
_begin_rows: Any = functools.cache(first_rows)


def step(scheme: Tag, visits: Tag, mode: Tag, s: Setup, hooks: Tag, more: bool) -> bool:
    """Take a step of `scheme`. With `more`, a fused one leaves the next one's sums on the nodes.

    Returns whether all points went well.
    """
    return _take_all(_step_rows(type(scheme), type(visits)), s, mode, hooks, more)


@implements(step, by_type=True)
def _step(scheme, visits, mode, s, hooks, more):
    rows = rows_of(scheme.instance_class, visits.instance_class)
    return lambda scheme, visits, mode, s, hooks, more: _take_all(rows, s, mode, hooks, more)


def begin(scheme: Tag, visits: Tag, mode: Tag, s: Setup) -> bool:
    """Prepare the first of several steps; tell whether all points are on the grid."""
    return _take_all(_begin_rows(type(scheme), type(visits)), s, mode, NoHooks(), True)


@implements(begin, by_type=True)
def _begin(scheme, visits, mode, s):
    rows = first_rows(scheme.instance_class, visits.instance_class)
    return lambda scheme, visits, mode, s: _take_all(rows, s, mode, NoHooks(), True)


def take_rows(rows: tuple, s: Setup, mode: Tag, hooks: Tag) -> bool:
    """Take a part of a step from Python; returns whether all points went well."""
    return _take_all(_alone(rows), s, mode, hooks, False)


_alone: Any = functools.cache(table.one_by_one)


DONE, STOPPED, ABOVE_LIMIT, SORT, SHRUNK, GAINED, HEATED = range(7)
PATIENCE = 50  # steps above the stable limit before a run is stopped
SMALLEST = 1e-6  # fraction of the first stable step at which a run is stopped: it would never end


def run_steps(scheme: Tag, visits: Tag, mode: Tag, s: Setup, hooks: Tag, count: int) -> int:
    """Take up to `count` steps, as far as the end time; say why it stopped.

    Returns DONE, STOPPED (a point went wrong), ABOVE_LIMIT (the step is above the stable limit),
    SHRUNK (the stable step has become next to nothing), GAINED (spurious energy gain), HEATED
    (temperatures that no source explains) or SORT: the points must be sorted before one can have
    left the surroundings of its tile. When that is depends on the points only, never on where a run
    is interrupted.
    """
    values = s.control.values
    clock = s.control.clock[0]
    if not begin(scheme, visits, mode, s):
        return STOPPED
    for n in range(count):
        time = values[TIME] + values[DT]
        last = n + 1 == count or time >= clock.end_time
        if not step(scheme, visits, mode, s, hooks, not last):
            return STOPPED
        clocks.finish(s.control)
        if not look(s, mode):
            return GAINED
        if not look_at_heat(s):
            return HEATED
        if clock.watch_limit > 0 and clock.over_limit >= PATIENCE:
            return ABOVE_LIMIT
        if clock.limit < SMALLEST * clock.first_limit:
            return SHRUNK
        if clock.drift > clock.drift_limit:
            return SORT
        if last:
            break
    return DONE


def _led(mode, scheme, visits, s, hooks, count):
    return run_steps(scheme, visits, mode, s, hooks, count)


_by_team = by_team(_led)


@kernel
def advance(scheme: Tag, visits: Tag, mode: Tag, s: Setup, hooks: Tag, count: int) -> int:
    """Call `run_steps`, by a team of threads where there are some."""
    return _by_team(mode, scheme, visits, s, hooks, count)


@kernel
def _fastest(frame, kin, points, laws, control):
    points, laws = at_hand(points), at_hand(laws)
    clock = control.clock[0]
    rate = 0.0
    common = clocks.common_velocity(kin, clock, clock.rate)
    for p in range(points.mass.size):
        law, state = state_at(kin, points, laws, p)
        f = deformation_of(frame, kin, points, (law, state), p)
        shorter = inverse_stretch_squared(frame, kin, f, points.mass[p])
        speed = sqrt(wave_speed_squared(law, kin, state) * shorter)
        v = load_vector(kin, points.v, p) - common
        rate = max(rate, speed + v.largest())
    clock.rate = max(clock.rate, rate)


def measure(s: Setup) -> None:
    """Measure the rate of the present state, for the first dt."""
    s.control.clock[0].rate = 0.0
    for block in s.blocks:
        _fastest(s.frame, s.kin, block.points, block.laws, s.control)
