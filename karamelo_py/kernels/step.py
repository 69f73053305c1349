"""The parts of a step that schemes put together, and the loop over steps.

Every part takes a :class:`~karamelo_py.kernels.arrays.Setup` and runs over all its blocks. The
same source serves two drivers: compiled, where many steps run in one call, and plain Python, where
hooks that are written in Python are called between the parts.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

from karamelo_py.compiler.compile import kernel, over_blocks, point_function, real, shared
from karamelo_py.compiler.tuples import record, row, subtract
from karamelo_py.kernels.arrays import (
    COURANT,
    DRIFT,
    DRIFT_LIMIT,
    DT,
    DT_FACTOR,
    END_TIME,
    FIRST_LIMIT,
    FIXED_DT,
    HEAT_LIMIT,
    KEPT,
    LIGHTEST,
    LIMIT,
    MOVE,
    NEW_MOVE,
    NEW_RATE,
    NOW,
    OVER_LIMIT,
    POST_ADVANCE_PARTICLES,
    POST_GRID_TO_POINT,
    POST_PARTICLES_TO_GRID,
    POST_UPDATE_GRID_STATE,
    RATE,
    SPACING,
    TIME,
    TIMESTEP,
    WATCH_LIMIT,
    WRONG,
    Hooks,
    NoHooks,
    Places,
)
from karamelo_py.kernels.hooks import (
    ON_SUMS,
    ON_UPDATE,
    Motion,
    clear_totals,
    node_hooks,
    point_hooks,
)
from karamelo_py.kernels.stages import (
    AveragedGradient,
    AveragedSecondGradient,
    AveragedVelocityAndGradient,
    AverageGrowth,
    ClearGrowth,
    ClearSums,
    Echo,
    ExtendSeries,
    Gradient,
    Growth,
    Nothing,
    SecondGradient,
    Series,
    StartSeries,
    Trial,
    Update,
    Velocity,
    VelocityAndGradient,
    deformation_of,
)
from karamelo_py.kernels.sweep import sweep_nodes, sweep_tiles
from karamelo_py.points.basis import placed
from karamelo_py.points.frames import Total, Updated, follows, thinning
from karamelo_py.points.grid import inside
from karamelo_py.points.kinematics import dimension, largest_component, vector_at
from karamelo_py.points.laws import initial_state, wave_speed_squared
from karamelo_py.points.transfers.xpic import XPIC


class Fused(NamedTuple):
    """As few visits of the points as the scheme allows; no hooks between them on points."""


class Staged(NamedTuple):
    """One visit for each stage, so that hooks on points can act in between."""


@point_function(tags=2)
def step(scheme, visits, mode, s, hooks, more):
    """One step of `scheme`. With `more`, a fused step leaves the next step's sums on the nodes."""


# --- parts ------------------------------------------------------------------------------------


@point_function()
def places_of(frame, block, now, then):
    """Where the weights of a sweep belong, and where the points are before and after it."""


@places_of.on(Updated)
def _(frame, block, now, then):
    return Places(block.x[now], block.x[now], block.x[then])


@places_of.on(Total)
def _(frame, block, now, then):
    return Places(block.home, block.x[now], block.x[then])


def _sweep(block, s, mode, gather, scatter, dt):
    now = s.control.whole[NOW]
    sweep_tiles(mode, gather, scatter, s, block, places_of(s.frame, block, now, 1 - now), dt)


def _sweep_here(block, s, mode, gather, scatter, dt):
    now = s.control.whole[NOW]
    sweep_tiles(mode, gather, scatter, s, block, places_of(s.frame, block, now, now), dt)


_sweep_blocks = over_blocks(_sweep)
_sweep_blocks_here = over_blocks(_sweep_here)


@kernel
def _read_reports(tiling, control):
    rate = 0.0
    moved = 0.0
    for t in range(tiling.colour[-1]):
        moved = max(moved, tiling.report[t, 0])
        rate = max(rate, tiling.report[t, 1])
        if tiling.report[t, 2] > 0:
            control.whole[WRONG] = 1
    control.real[NEW_MOVE] = max(control.real[NEW_MOVE], moved)
    control.real[NEW_RATE] = max(control.real[NEW_RATE], rate)


def _survey(block, s):
    _read_reports(block.tiling, s.control)


_survey_blocks = over_blocks(_survey)


@shared
def read_reports(s):
    """Gather what the tiles reported: largest rate and move, and whether a point went wrong."""
    s.control.real[NEW_RATE] = 0.0
    s.control.real[NEW_MOVE] = 0.0
    _survey_blocks(s)


@shared
def _survey_all(s):
    """Take over what the tiles reported; whether all points went well."""
    read_reports(s)
    # Points move in one sweep of a step, and their domains may grow in another.
    s.control.real[MOVE] += s.control.real[NEW_MOVE]
    if s.control.real[NEW_RATE] > 0:
        s.control.real[RATE] = s.control.real[NEW_RATE]
    return s.control.whole[WRONG] == 0


@shared
def visit_here(s, mode, gather, scatter, dt):
    """Visit all points at their positions now, where nothing can go wrong."""
    _sweep_blocks_here(s, mode, gather, scatter, dt)


@shared
def sweep(s, mode, gather, scatter, dt):
    """Visit all points, moving from the positions now to the next; whether all went well."""
    _sweep_blocks(s, mode, gather, scatter, dt)
    return _survey_all(s)


@shared
def sweep_here(s, mode, gather, scatter, dt):
    """Visit all points at their positions now; whether all went well."""
    _sweep_blocks_here(s, mode, gather, scatter, dt)
    return _survey_all(s)


@kernel
def _look_at_moves(frame, kin, grids, x, of, tiling, control):
    now = control.whole[NOW]
    for p in range(x.shape[1]):
        grid = record(grids, of[p])
        y = vector_at(kin, x[1 - now], p)
        step = largest_component(kin, subtract(y, vector_at(kin, x[now], p)))
        cells = step * grid.inv_h
        control.real[MOVE] = max(control.real[MOVE], cells)
        if not (cells <= 1 and (inside(grid, kin, y) or not follows(frame))):
            control.whole[WRONG] = 1
            tiling.report[0, 2] = p + 1


def _check_moves(block, s):
    _look_at_moves(s.frame, s.kin, s.grids, block.x, block.grid, block.tiling, s.control)


_check_moves_of_blocks = over_blocks(_check_moves)


@shared
def check_moves(s):
    """Look at the new positions again, after hooks that may have changed them."""
    _check_moves_of_blocks(s)
    return s.control.whole[WRONG] == 0


@shared
def step_size(s):
    """dt of the present step, in the precision of the run."""
    return real(s.control.values[DT], s.nodes.sums[0, 0])


@kernel
def choose_dt(control):
    """dt of the next step, from the rate of the fastest point or as fixed; shortened at the end.

    The last two steps are shortened alike. Where velocities are mapped or prescribed, a step takes
    impulses that do not vanish with its length: in a last step that is a small part of the others,
    forces (impulses over dt) would be many times what they are before.
    """
    real_, whole = control.real, control.whole
    limit = real_[COURANT] * real_[SPACING] / real_[RATE] if real_[RATE] > 0 else inf
    limit = min(limit, real_[HEAT_LIMIT])
    real_[LIMIT] = limit
    fixed = real_[FIXED_DT]
    dt = fixed if fixed > 0 else real_[DT_FACTOR] * limit
    whole[OVER_LIMIT] = whole[OVER_LIMIT] + 1 if dt > limit else 0
    remaining = real_[END_TIME] - control.values[TIME]
    # The tolerance swallows the rounding of many additions of dt: no step of 1e-16 at the end.
    if 0 < remaining <= dt * (1 + 1e-9):
        dt = remaining
    elif 0 < remaining < 2 * dt * (1 - 1e-9):
        dt = 0.5 * remaining
    control.values[DT] = dt


@kernel
def finish(control):
    """End of a step: the points are where they moved to, time goes on, the next dt is chosen."""
    control.whole[NOW] = 1 - control.whole[NOW]
    dt = control.values[DT]
    time = control.values[TIME] + dt
    end = control.real[END_TIME]
    # Exactly the end, when this step was shortened to reach it.
    control.values[TIME] = end if end - control.values[TIME] == dt else time
    control.values[TIMESTEP] += 1
    control.real[DRIFT] += control.real[MOVE]
    control.real[MOVE] = 0.0
    choose_dt(control)


# --- hooks ------------------------------------------------------------------------------------


@point_function()
def at_nodes(hooks, stage, target, s):
    """Let the fixes act on the nodes."""


@at_nodes.on(NoHooks)
def _(hooks, stage, target, s):
    return None


@at_nodes.on(Hooks)
def _(hooks, stage, target, s):
    dt = step_size(s)
    kept = s.control.real[KEPT]
    node_hooks(stage, target, s.kin, s.grids, s.nodes, s.spans, hooks, s.control, dt, kept)


@shared
def corners_that_move(s):
    """How many corners stand behind the position of a point, and move with it."""
    return placed(s.basis, s.kin) if follows(s.frame) else 0


def _point_hooks(block, s, hooks, stage, now, then):
    x = block.x[now]
    y = block.x[then]
    points = block.points
    motion = Motion(points.v, points.mass, x, y, corners_that_move(s))
    point_hooks(stage, motion, s.kin, block.id, hooks, s.control, step_size(s))


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
    now = s.control.whole[NOW]
    hook_points(s, hooks, stage, now, 1 - now if then else now)


@shared
def light_node(s):
    """Nodal mass below which USL limits the gradient: d (c dt / h)^2 of the lightest point.

    Less than one: a share below m / m_p would be less than what comes back to the node through the
    points' velocities, and the strain of the node would run ahead of its stress.
    """
    courant = s.control.real[RATE] * s.control.values[DT] / s.control.real[SPACING]
    masses = min(dimension(s.kin) * courant * courant, 1.0)
    return real(masses * s.control.real[LIGHTEST], s.nodes.sums[0, 0])


# --- stages that schemes share ----------------------------------------------------------------


@shared
def map_to_nodes(s, mode, scatter):
    """Fresh sums on the nodes, from the positions now; whether all points are on the grid."""
    dt = step_size(s)
    sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, dt)
    return sweep_here(s, mode, Nothing(), scatter, dt)


@shared
def accelerate_nodes(s, mode, hooks):
    """v* = v + dt f / m, with what the fixes add and prescribe; and heat flows."""
    conduct(s.heat, s, mode, hooks)
    at_nodes(hooks, POST_PARTICLES_TO_GRID, ON_SUMS, s)
    sweep_nodes(mode, Update(), s.kin, s.nodes, s.spans, step_size(s))
    at_nodes(hooks, POST_UPDATE_GRID_STATE, ON_UPDATE, s)
    touch(s.contact, s)


@shared
def update_nodes(s, mode, hooks):
    """All of the nodes' update: what points gather is ready then."""
    accelerate_nodes(s, mode, hooks)
    sum_series(s.transfer, s, mode)


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


@point_function()
def sum_series(transfer, s, mode):
    """Put the new velocity of XPIC in the place of the change of velocity; others need nothing."""


@sum_series.otherwise
def _(transfer, s, mode):
    return None


@sum_series.on(XPIC)
def _(transfer, s, mode):
    # (I - (I - S S+)^m) v_p = S sum_k (-1)^(k+1) C(m, k) (S+ S)^(k-1) v, the sum from 1 to m
    dt = step_size(s)
    order = transfer.order
    factor = float(order)
    sweep_nodes(mode, StartSeries(real(factor - 1, dt)), s.kin, s.nodes, s.spans, dt)
    for k in range(2, order + 1):
        visit_here(s, mode, Series(), Echo(), dt)
        factor *= -float(order - k + 1) / k
        sweep_nodes(mode, ExtendSeries(real(factor, dt)), s.kin, s.nodes, s.spans, dt)


class PointByPoint(NamedTuple):
    """Every point has its own change of volume."""


class FBar(NamedTuple):
    """Changes of volume are averaged over the surroundings, against volumetric locking."""


@point_function()
def averaged(gather):
    """The gather that takes the averaged change of volume."""


@averaged.on(Gradient)
def _(gather):
    return AveragedGradient()


@averaged.on(SecondGradient)
def _(gather):
    return AveragedSecondGradient()


@averaged.on(VelocityAndGradient)
def _(gather):
    return AveragedVelocityAndGradient()


@point_function()
def strain(averaging, s, mode, gather, scatter, dt):
    """Gather and settle, the gradient among it; whether all went well."""


@strain.on(PointByPoint)
def _(averaging, s, mode, gather, scatter, dt):
    return sweep(s, mode, gather, scatter, dt)


@strain.on(FBar)
def _(averaging, s, mode, gather, scatter, dt):
    sweep_nodes(mode, ClearGrowth(), s.kin, s.nodes, s.spans, dt)
    visit_here(s, mode, Trial(), Growth(), dt)
    sweep_nodes(mode, AverageGrowth(), s.kin, s.nodes, s.spans, dt)
    return sweep(s, mode, averaged(gather), scatter, dt)


@shared
def move_points(s, mode, hooks):
    """New velocities and positions, stage by stage; whether all points are on the grid."""
    if not sweep(s, mode, Velocity(), Nothing(), step_size(s)):
        return False
    at_points(hooks, POST_GRID_TO_POINT, 1, s)
    at_points(hooks, POST_ADVANCE_PARTICLES, 1, s)
    return check_moves(s)


# --- loop -------------------------------------------------------------------------------------


@point_function(tags=2)
def begin(scheme, visits, mode, s):
    """Before the first of several steps: fused steps expect the sums on the nodes.

    Returns whether all points are on the grid.
    """


DONE, STOPPED, ABOVE_LIMIT, SORT, SHRUNK = range(5)
PATIENCE = 50  # steps above the stable limit before a run is stopped
SMALLEST = 1e-6  # share of the first stable step at which a run is stopped: it would never end


def run_steps(scheme, visits, mode, s, hooks, count):
    """Take up to `count` steps, as far as the end time; say why it stopped.

    Returns DONE, STOPPED (a point went wrong), ABOVE_LIMIT (the step is above the stable limit),
    SHRUNK (the stable step has become next to nothing) or SORT: the points must be sorted before
    one can have left the surroundings of its tile. When that is depends on the points only, never
    on where a run is interrupted.
    """
    control = s.control
    if not begin(scheme, visits, mode, s):
        return STOPPED
    for n in range(count):
        time = control.values[TIME] + control.values[DT]
        last = n + 1 == count or time >= control.real[END_TIME]
        if not step(scheme, visits, mode, s, hooks, not last):
            return STOPPED
        finish(control)
        if control.whole[WATCH_LIMIT] > 0 and control.whole[OVER_LIMIT] >= PATIENCE:
            return ABOVE_LIMIT
        if control.real[LIMIT] < SMALLEST * control.real[FIRST_LIMIT]:
            return SHRUNK
        if control.real[DRIFT] > control.real[DRIFT_LIMIT]:
            return SORT
        if last:
            break
    return DONE


advance = kernel(run_steps)


@kernel
def _fastest(frame, kin, points, laws, control):
    rate = 0.0
    for p in range(points.mass.size):
        law = record(laws, points.material[p])
        mass = points.mass[p]
        state = row(points.state, p, 0, initial_state(law, kin, mass))
        f = deformation_of(frame, kin, law, state, points, p)
        speed = sqrt(wave_speed_squared(law, kin, state) * thinning(frame, kin, f, mass))
        rate = max(rate, speed + largest_component(kin, vector_at(kin, points.v, p)))
    control.real[RATE] = max(control.real[RATE], rate)


def _measure(block, s):
    _fastest(s.frame, s.kin, block.points, block.laws, s.control)


measure_blocks = over_blocks(_measure)


@shared
def measure(s):
    """The rate of the present state, for the first dt."""
    s.control.real[RATE] = 0.0
    measure_blocks(s)
