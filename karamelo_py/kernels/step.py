"""A step from the table of its scheme, and the loop over steps.

The same source serves two drivers: compiled, where many steps run in one call, and plain Python,
where hooks that are written in Python are called between the rows.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import (
    by_type,
    define,
    entered,
    loop,
    over_blocks,
    point_function,
    real,
    shared,
)
from karamelo_py.compiler.fields import field, load, load_vector
from karamelo_py.compiler.held import at_hand
from karamelo_py.compiler.threads import by_team
from karamelo_py.compiler.tuples import clear_first, record, subtract
from karamelo_py.kernels import table
from karamelo_py.kernels.arrays import (
    DT,
    MASS,
    ON_SUMS,
    ON_UPDATE,
    POST_ADVANCE_PARTICLES,
    POST_GRID_TO_POINT,
    POST_PARTICLES_TO_GRID,
    POST_UPDATE_GRID_STATE,
    TIME,
    TIMESTEP,
    Hooks,
    NoHooks,
    of_change,
    of_force,
    of_momentum,
)
from karamelo_py.kernels.averaging import FBar
from karamelo_py.kernels.g2p import STRAINS, AverageStress, Move, SeriesTerm, TrialStrain
from karamelo_py.kernels.hooks import Motion, clear_totals, node_hooks, point_hooks, publish_totals
from karamelo_py.kernels.loss import Lost, Rubbed
from karamelo_py.kernels.nodes import (
    ClearRubbed,
    ExtendSeries,
    KeepLoss,
    MomentumToVelocity,
    StartSeries,
    SumsToVelocity,
    TakeMean,
    TakeMeanStress,
    Update,
    UpdateToVelocity,
)
from karamelo_py.kernels.p2g import (
    AveragedForce,
    InternalForce,
    MassMomentum,
    MomentumAgain,
    Normal,
    SeriesBack,
    Volumes,
)
from karamelo_py.kernels.sums import adds
from karamelo_py.kernels.sweep import (
    OldWeights,
    Visit,
    sum_buffers,
    sweep_nodes,
    sweep_points,
)
from karamelo_py.kernels.totals import Alone, agree_on_reports, take_over
from karamelo_py.kernels.visit import deformation_of
from karamelo_py.kernels.watch import look, look_at_heat
from karamelo_py.points.basis import placed
from karamelo_py.points.frames import follows, inverse_stretch_squared
from karamelo_py.points.grid import inside
from karamelo_py.points.kinematics import Axisymmetric, dimension, largest_component
from karamelo_py.points.laws import initial_state, wave_speed_squared
from karamelo_py.points.transfers.xpic import XPIC


class Fused(NamedTuple):
    """As few visits of the points as the scheme allows; no hooks between them on points."""


class Staged(NamedTuple):
    """One visit for each stage, so that hooks on points can act in between."""


# --- visits -----------------------------------------------------------------------------------


def _sweep(block, s, mode, visit, then, gathers, scatters, dt):
    sweep_points(mode, visit, s, block, then, gathers, scatters, dt)


sweep_blocks = over_blocks(_sweep)


@point_function()
def sweep_all(ranks, s, mode, visit, then, gathers, scatters, dt):
    """Sweep over the points of all blocks; begin to pass on what they give to other processes."""


@sweep_all.on(Alone)
def _(ranks, s, mode, visit, then, gathers, scatters, dt):
    sweep_blocks(s, mode, visit, then, gathers, scatters, dt)


@entered
def _read_reports(tiling, control):
    clock = control.clock[0]
    rate = 0.0
    moved = 0.0
    for t in range(tiling.count[0]):
        moved = max(moved, tiling.report[t, 0])
        rate = max(rate, tiling.report[t, 1])
        if tiling.report[t, 2] > 0:
            clock.wrong = 1
    clock.new_move = max(clock.new_move, moved)
    clock.new_rate = max(clock.new_rate, rate)


def _survey(block, s):
    _read_reports(block.tiling, s.control)


_survey_blocks = over_blocks(_survey)


@shared
def read_reports(s):
    """Gather what the tiles reported: largest rate and move, and whether a point went wrong."""
    clock = s.control.clock[0]
    clock.new_rate = 0.0
    clock.new_move = 0.0
    _survey_blocks(s)
    agree_on_reports(s.control.ranks, s.control)


@shared
def _visit(s, mode, visit, then, gathers, scatters, dt):
    # Where points give to the nodes themselves, these start from zero.
    direct = s.buffers.count[1]
    anew = tuple(quantity for quantity in visit.quantities if not adds(quantity))
    sum_all(mode, anew, s, scatters & (direct == 1))
    sweep_all(s.control.ranks, s, mode, visit, then, gathers, scatters, dt)
    sum_all(mode, visit.quantities, s, scatters & (direct == 0))


@shared
def sum_all(mode, quantities, s, due):
    """Sum at the nodes what the points gave, if they did."""
    if len(quantities):
        take_over(s.control.ranks, due & (s.buffers.count[1] == 0))
        sum_buffers(mode, quantities, s, due)


@shared
def visit_here(s, mode, visit, dt, gathers, scatters):
    """Visit all points at their places now, where nothing can go wrong."""
    _visit(s, mode, visit, s.control.clock[0].now, gathers, scatters, dt)


@shared
def sweep(s, mode, visit, dt, gathers, scatters, moves):
    """Visit all points; whether all went well. With `moves` new places go to the other array."""
    clock = s.control.clock[0]
    then = 1 - clock.now if moves else clock.now
    _visit(s, mode, visit, then, gathers, scatters, dt)
    read_reports(s)
    # Points move in one sweep of a step, and their domains may grow in another.
    clock.move += clock.new_move
    if clock.new_rate > 0:
        clock.rate = clock.new_rate
    return clock.wrong == 0


@entered
def _look_at_moves(frame, kin, grids, points, tiling, control):
    clock = control.clock[0]
    now = clock.now
    for p in range(points.mass.size):
        grid = record(grids, points.grid[p])
        y = load_vector(kin, points.x[1 - now], p)
        step = largest_component(kin, subtract(y, load_vector(kin, points.x[now], p)))
        cells = step * grid.inv_h
        clock.move = max(clock.move, cells)
        if not (cells <= 1 and (inside(grid, kin, y) or not follows(frame))):
            clock.wrong = 1
            tiling.report[0, 2] = p + 1


def _check_moves(block, s):
    _look_at_moves(s.frame, s.kin, s.grids, block.points, block.tiling, s.control)


_check_moves_of_blocks = over_blocks(_check_moves)


@shared
def check_moves(s):
    """Look at the new positions again, after hooks that may have changed them."""
    _check_moves_of_blocks(s)
    agree_on_reports(s.control.ranks, s.control)
    return s.control.clock[0].wrong == 0


# --- time -------------------------------------------------------------------------------------


@shared
def step_size(s):
    """dt of the present step, in the precision of the run: how long points move."""
    return real(s.control.values[DT], s.nodes.sums[0, MASS])


@shared
def last_step_size(s):
    """dt of the step before, which the velocity at the start of this one belongs to.

    Before the first step there was none: the state at the start has its strain already. It takes
    next to nothing, since rates of strain are asked for.
    """
    share = NEXT_TO_NOTHING if s.control.values[TIMESTEP] == 0 else 1.0
    return real(share * s.control.clock[0].last_dt, s.nodes.sums[0, MASS])


@shared
def kick(s):
    """How long forces act in this step.

    Places belong to the ends of steps, velocities to their middles: forces lead from the middle of
    one step to that of the next.
    """
    return real(s.control.clock[0].kick, s.nodes.sums[0, MASS])


NEXT_TO_NOTHING = 1e-9  # of a step
ROUNDING = 1e-6  # of a step: what additions of a million steps may be off

# Points that go from cell to cell feed energy to a body, by so much a cell, and the more the longer
# the step. Until they have gone so far, in cells, a scene takes the steps of bodies at rest.
STILL = 0.25


@entered
def choose_dt(control):
    """dt of the next step, from the rate of the fastest point or as fixed; shortened at the end.

    The last two steps are shortened alike. Where velocities are mapped or prescribed, a step takes
    impulses that do not vanish with its length: in a last step that is a small part of the others,
    forces (impulses over dt) would be many times what they are before.
    """
    clock = control.clock[0]
    limit = clock.courant * clock.spacing / clock.rate if clock.rate > 0 else inf
    dt = min(clock.dt_factor * limit, clock.heat_factor * clock.heat_limit)
    dt = clock.fixed_dt if clock.fixed_dt > 0 else dt
    limit = min(limit, clock.heat_limit)
    clock.limit = limit
    clock.over_limit = clock.over_limit + 1 if dt > limit else 0
    remaining = clock.end_time - control.values[TIME]
    # The tolerance swallows the rounding of many additions of dt: no step of 1e-16 at the end, and
    # none more than there are.
    if 0 < remaining <= dt * (1 + ROUNDING):
        dt = remaining
    elif 0 < remaining < 2 * dt * (1 - ROUNDING):
        dt = 0.5 * remaining
    control.values[DT] = dt
    if control.values[TIMESTEP] == 0:
        clock.last_dt = dt
    clock.kick = 0.5 * (clock.last_dt + dt)


@entered
def finish(control):
    """End of a step: the points are where they moved to, time goes on, the next dt is chosen."""
    clock = control.clock[0]
    clock.now = 1 - clock.now
    dt = control.values[DT]
    clock.last_dt = dt
    time = control.values[TIME] + dt
    # Exactly the end, when this step was shortened to reach it.
    control.values[TIME] = clock.end_time if clock.end_time - control.values[TIME] == dt else time
    control.values[TIMESTEP] += 1
    clock.drift += clock.move
    clock.path += clock.move
    clock.pace = max(clock.pace, clock.move)
    clock.move = 0.0
    if clock.path > STILL:
        clock.courant, clock.dt_factor = clock.courant_moving, clock.dt_factor_moving
    choose_dt(control)


# --- fixes ------------------------------------------------------------------------------------


@point_function()
def at_nodes(hooks, stage, target, s):
    """Let the fixes act on the nodes."""


@at_nodes.on(NoHooks)
def _(hooks, stage, target, s):
    return None


@at_nodes.on(Hooks)
def _(hooks, stage, target, s):
    clock = s.control.clock[0]
    node_hooks(
        stage, target, s.kin, s.grids, s.nodes, s.spans, hooks, s.control, kick(s), clock.kept
    )
    clock.set_low = clock.set_high = 0.0  # of temperatures only


@shared
def corners_that_move(s):
    """How many corners stand behind the position of a point, and move with it."""
    return placed(s.basis, s.kin) if follows(s.frame) else 0


def _point_hooks(block, s, hooks, stage, now, then):
    points = block.points
    motion = Motion(points.v, points.mass, points.x[now], points.x[then], corners_that_move(s))
    point_hooks(stage, motion, s.kin, points.id, hooks, s.control, step_size(s))


hook_points = over_blocks(_point_hooks)


@point_function()
def at_points(hooks, stage, then, s):
    """Let the fixes act on the points; `then` is 1 when their new positions are known, else 0."""


@at_points.on(NoHooks)
def _(hooks, stage, then, s):
    return None


@at_points.on(Hooks)
def _(hooks, stage, then, s):
    clear_totals(stage, hooks, s.control)
    now = s.control.clock[0].now
    hook_points(s, hooks, stage, now, 1 - now if then else now)
    publish_totals(stage, hooks, s.control)


# --- what only some scenes have ---------------------------------------------------------------


class Insulated(NamedTuple):
    """No heat flows between points."""


@point_function()
def conduct(heat, s, mode, hooks):
    """Let heat flow between points for the length of a step; by default none does."""


@conduct.otherwise
def _(heat, s, mode, hooks):
    return None


@point_function()
def touch(contact, s):
    """Let solids with velocity fields of their own act on each other; by default there are none."""


@touch.otherwise
def _(contact, s):
    return None


@point_function()
def touch_velocity(contact, s, steps):
    """See that the velocity that deforms the points agrees with contact, where it is not v*.

    `steps` is 1 when v* of this step is known, and 0 before: what touched in the last step counts.
    """


@touch_velocity.otherwise
def _(contact, s, steps):
    return None


@entered
def _clear_radial(kin, nodes, grids):
    for g in range(grids.first.size):
        if abs(grids.x0[g]) > grids.slack[g] * grids.h[g]:
            continue
        for n in range(grids.first[g], grids.first[g] + grids.step_x[g]):
            if nodes.sums[n, MASS] > 0:
                nodes.sums[n, of_momentum(kin)] = 0
                nodes.sums[n, of_force(kin)] = 0
                nodes.update[n, 0] = 0
                nodes.update[n, of_change(kin)] = 0
                nodes.velocity[n, 0] = 0
                clear_first(field(nodes.fields, Normal), n)


@point_function()
def hold_axis(kin, s):
    """Let no node on an axis of symmetry leave it; by default there is none."""


@hold_axis.otherwise
def _(kin, s):
    return None


@hold_axis.on(Axisymmetric)
def _(kin, s):
    # v_r = 0 at r = 0: N / r of a node there grows without bound where a point comes near. And a
    # body that touches another on the axis has a normal along it.
    _clear_radial(kin, s.nodes, s.grids)


@point_function()
def sum_series(transfer, s, mode):
    """Put the new velocity of XPIC in the place of the change of velocity; others need nothing."""


@sum_series.otherwise
def _(transfer, s, mode):
    return None


@sum_series.on(XPIC)
def _(transfer, s, mode):
    # (I - (I - S S+)^m) v_p = S sum_k (I - S+ S)^k S+ v, the sum from 0 to m - 1
    dt = step_size(s)
    sweep_nodes(mode, StartSeries(), s.kin, s.nodes, s.spans, dt)
    for k in range(transfer.order - 1):
        visit = Visit((SeriesTerm(k),), (SeriesBack(),), OldWeights())
        visit_here(s, mode, visit, dt, True, True)
        sweep_nodes(mode, ExtendSeries(), s.kin, s.nodes, s.spans, dt)
    hold_axis(s.kin, s)


@point_function()
def average_volumes(averaging, s, mode, dt):
    """Average the change of volume of the strain to come at the nodes; by default it is not."""


@average_volumes.otherwise
def _(averaging, s, mode, dt):
    return None


@average_volumes.on(FBar)
def _(averaging, s, mode, dt):
    visit_here(s, mode, Visit((TrialStrain(),), (Volumes(),), OldWeights()), dt, True, True)
    sweep_nodes(mode, TakeMean(), s.kin, s.nodes, s.spans, dt)


@point_function()
def average_stress(averaging, s, mode):
    """Put the averaged mean stress in the place of the points' own; by default each has its own."""


@average_stress.otherwise
def _(averaging, s, mode):
    return None


@average_stress.on(FBar)
def _(averaging, s, mode):
    dt = step_size(s)
    sweep_nodes(mode, TakeMeanStress(), s.kin, s.nodes, s.spans, dt)
    visit_here(s, mode, Visit((AverageStress(),), (AveragedForce(),), OldWeights()), dt, True, True)


@shared
def sum_loss(s, mode):
    """At the nodes, what they do not keep of kinetic energy, where it becomes heat."""
    if field(s.nodes.fields, Rubbed) is not None:
        sweep_nodes(mode, ClearRubbed(), s.kin, s.nodes, s.spans, step_size(s))
    if field(s.nodes.fields, Lost) is not None:
        sweep_nodes(mode, KeepLoss(), s.kin, s.nodes, s.spans, step_size(s))


@shared
def light_node(s):
    """Nodal mass below which USL limits the gradient: d (c dt / h)^2 of a point that the node sees.

    Less than one: a share below m / m_p would be less than what comes back to the node through the
    points' velocities, and the strain of the node would run ahead of its stress.
    """
    clock = s.control.clock[0]
    courant = clock.rate * s.control.values[DT] / clock.spacing
    masses = min(dimension(s.kin) * courant * courant, 1.0)
    return UpdateToVelocity(real(masses, s.nodes.sums[0, MASS]))


light_node.goes_through = UpdateToVelocity.goes_through


def _call(text: str, says: Callable[[Any], str | None]) -> table.Call:
    """A row that is the call `text`; `says` tells what it does in a scene."""
    function = define("s, mode, hooks", text, **globals())
    shared(function)
    function.says = says
    return table.Call(function)


HEAT = _call(
    "conduct(s.heat, s, mode, hooks)",
    lambda s: (
        None
        if isinstance(s.heat, Insulated)
        else "heat to the nodes, its flow, temperature of the points"
    ),
)
LOSS = _call(
    "sum_loss(s, mode)",
    lambda s: (
        None
        if field(s.nodes.fields, Lost) is None
        else "kinetic energy that the nodes do not keep, as heat to the points"
    ),
)
AVERAGED = _call(
    "average_stress(s.averaging, s, mode)",
    lambda s: (
        "force of the averaged mean stress in one visit of the points"
        if isinstance(s.averaging, FBar)
        else None
    ),
)
CONTACT = _call(
    "touch(s.contact, s)",
    lambda s: "contact of v*" if touch.defined(type(s.contact)) else None,
)
CONTACT_BEFORE = _call("touch_velocity(s.contact, s, 0)", lambda s: None)
CONTACT_AFTER = _call("touch_velocity(s.contact, s, 1)", lambda s: None)
AXIS = _call(
    "hold_axis(s.kin, s)",
    lambda s: "v_r = 0 on the axis" if hold_axis.defined(type(s.kin)) else None,
)
SERIES = _call(
    "sum_series(s.transfer, s, mode)",
    lambda s: "series of XPIC" if isinstance(s.transfer, XPIC) else None,
)

SUMS = table.Scatter((MassMomentum(), InternalForce()))
MASS_AND_MOMENTUM = table.Scatter((MassMomentum(),))
# For schemes that strain first.
VELOCITY_BEFORE = (MASS_AND_MOMENTUM, AXIS, table.Nodes(SumsToVelocity()))
FORCE = table.Scatter((InternalForce(),), OldWeights())
# v* = v + dt f / m, with what the fixes add and prescribe; and heat flows.
ACCELERATE = (
    LOSS,
    AVERAGED,
    HEAT,
    table.AtNodes(POST_PARTICLES_TO_GRID, ON_SUMS),
    AXIS,
    table.Nodes(Update()),
    table.AtNodes(POST_UPDATE_GRID_STATE, ON_UPDATE),
    CONTACT,
)
MOVE = (
    table.Gather(Move()),
    table.AtPoints(POST_GRID_TO_POINT, 1),
    table.AtPoints(POST_ADVANCE_PARTICLES, 1),
    table.Check(),
)
# The velocity of the moved points, at the nodes once more.
MOMENTUM_AGAIN = (
    table.Scatter((MomentumAgain(),), OldWeights()),
    table.Nodes(MomentumToVelocity()),
    AXIS,
)


# --- a step -----------------------------------------------------------------------------------


class _Spelled:
    """Text of a function that takes the rows of a table in turn."""

    # A class attribute, where the cache of kernels sees what a step is made of.
    words = (
        at_nodes,
        at_points,
        average_volumes,
        check_moves,
        kick,
        last_step_size,
        real,
        step_size,
        sweep,
        sweep_nodes,
    )

    def __init__(self) -> None:
        self.names: dict[str, Any] = {word.__name__: word for word in self.words}
        self.lines = ["dt = step_size(s)"]

    def name(self, thing: Any, stem: str) -> str:
        """A name for something that the text refers to."""
        name = f"{stem}{len(self.names)}"
        self.names[name] = thing
        return name

    def tag(self, tag: NamedTuple) -> str:
        """An expression that makes a tag without numbers, or a tuple of such."""
        if type(tag) is tuple:
            return f"({''.join(self.tag(one) + ', ' for one in tag)})"
        made = self.name(type(tag), "tag")
        return f"{made}({', '.join(self.tag(part) for part in tag)})"

    def row(self, row: Any) -> None:
        """One row of the table."""
        add = self.lines.append
        if isinstance(row, table.AtPoints):
            add(f"at_points(hooks, {row.stage}, {row.then}, s)")
        elif isinstance(row, table.AtNodes):
            add(f"at_nodes(hooks, {row.stage}, {row.target}, s)")
        elif isinstance(row, table.Call):
            add(f"{self.name(row.function, 'call')}(s, mode, hooks)")
        elif isinstance(row, table.Check):
            add("if not check_moves(s): return False")
        elif isinstance(row, table.Nodes):
            made = callable(row.task)
            task = f"{self.name(row.task, 'make')}(s)" if made else self.tag(row.task)
            add(f"sweep_nodes(mode, {task}, s.kin, s.nodes, s.spans, kick(s))")
        else:
            self.sweep(row)

    def sweep(self, row: table.Sweep) -> None:
        """A visit of the points, and what comes before it."""
        add = self.lines.append
        whole = "last_step_size(s)" if row.of_last_step else "dt"
        length = whole if row.share == 1 else f"real({row.share}, dt) * {whole}"
        if row.gathers and any(isinstance(tag, STRAINS) for tag in row.visit.tasks):
            add(f"average_volumes(s.averaging, s, mode, {length})")
        scatters = "more" if row.only_if_more else str(row.scatters)
        add(
            f"if not sweep(s, mode, {self.tag(row.visit)}, {length}, {row.gathers}, {scatters}, "
            f"{row.moves}): return False"
        )


def rows_of(scheme: type, visits: type) -> list[Any]:
    """The rows of a step of `scheme`."""
    return table.fused(scheme.rows) if visits is Fused else table.staged(scheme.rows)


def _spelled_step(scheme: type, visits: type) -> Callable:
    """One step, row after row."""
    text = _Spelled()
    for row in rows_of(scheme, visits):
        text.row(row)
    names = "scheme, visits, mode, s, hooks, more"
    return define(names, *text.lines, "return True", **text.names)


def _spelled_begin(scheme: type, visits: type) -> Callable:
    """Fused steps expect the sums on the nodes: the scatter of the last visit, alone."""
    text = _Spelled()
    if visits is Fused:
        last = rows_of(scheme, Fused)[-1]
        text.row(last._replace(gathers=False, only_if_more=False, moves=False))
    return define("scheme, visits, mode, s", *text.lines, "return True", **text.names)


def _spelled(spell: Callable, scheme: type, visits: type) -> Callable:
    """What `spell` makes for interpreted steps, made once."""
    # Beside the function, not in a global: what kernels are made of does not change in a run.
    made = vars(spell).setdefault("made", {})
    if (scheme, visits) not in made:
        made[scheme, visits] = spell(scheme, visits)
    return made[scheme, visits]


def step(scheme, visits, mode, s, hooks, more):
    """One step of `scheme`. With `more`, a fused step leaves the next step's sums on the nodes.

    Returns whether all points went well.
    """
    take = _spelled(_spelled_step, type(scheme), type(visits))
    return take(scheme, visits, mode, s, hooks, more)


@by_type(step)
def _step(scheme, visits, mode, s, hooks, more):
    return _spelled_step(scheme.instance_class, visits.instance_class)


def begin(scheme, visits, mode, s):
    """Before the first of several steps; returns whether all points are on the grid."""
    return _spelled(_spelled_begin, type(scheme), type(visits))(scheme, visits, mode, s)


@by_type(begin)
def _begin(scheme, visits, mode, s):
    return _spelled_begin(scheme.instance_class, visits.instance_class)


# --- loop -------------------------------------------------------------------------------------

DONE, STOPPED, ABOVE_LIMIT, SORT, SHRUNK, GAINED, HEATED = range(7)
PATIENCE = 50  # steps above the stable limit before a run is stopped
SMALLEST = 1e-6  # share of the first stable step at which a run is stopped: it would never end


def run_steps(scheme, visits, mode, s, hooks, count):
    """Take up to `count` steps, as far as the end time; say why it stopped.

    Returns DONE, STOPPED (a point went wrong), ABOVE_LIMIT (the step is above the stable limit),
    SHRUNK (the stable step has become next to nothing), GAINED (energy from nowhere), HEATED
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
        finish(s.control)
        if not look(s):
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


shared(run_steps)
_by_team = by_team(_led, "scheme, visits, s, hooks, count")


@loop
def advance(scheme, visits, mode, s, hooks, count):
    """`run_steps`, by a team of threads where there are some."""
    return _by_team(mode, scheme, visits, s, hooks, count)


@loop
def _fastest(frame, kin, points, laws, control):
    points, laws = at_hand(points), at_hand(laws)
    clock = control.clock[0]
    rate = 0.0
    for p in range(points.mass.size):
        law = record(laws, points.material[p])
        mass = points.mass[p]
        state = load(points.state, p, initial_state(law, kin, mass))
        f = deformation_of(frame, kin, law, state, points, p)
        speed = sqrt(
            wave_speed_squared(law, kin, state) * inverse_stretch_squared(frame, kin, f, mass)
        )
        rate = max(rate, speed + largest_component(kin, load_vector(kin, points.v, p)))
    clock.rate = max(clock.rate, rate)


def _measure(block, s):
    _fastest(s.frame, s.kin, block.points, block.laws, s.control)


measure_blocks = over_blocks(_measure)


@shared
def measure(s):
    """The rate of the present state, for the first dt."""
    s.control.clock[0].rate = 0.0
    measure_blocks(s)
