"""Step size, reports of sweeps, and the end of a step."""

from math import inf
from typing import Any, NamedTuple

from karamelo_py.compiler import at_hand, index, kernel, real
from karamelo_py.compiler.fields import load_vector
from karamelo_py.compiler.threads import by_threads
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import DT, MASS, TIME, TIMESTEP, Control, Number, Setup, Tag
from karamelo_py.kernels.totals import agree_on_reports
from karamelo_py.points.grid import Grid, inside
from karamelo_py.points.kinematics import vector


def step_size(s: Setup) -> Number:
    """Return dt, the time that points move, in the precision of the run."""
    return real(s.control.values[DT], s.nodes.sums[0, MASS])


def last_step_size(s: Setup) -> Number:
    """Return dt of the previous step; tiny, not 0, if there is none: laws divide by it."""
    last = s.control.clock[0].last_dt
    least = NEXT_TO_NOTHING * s.control.values[DT]
    return real(last if last > 0 else least, s.nodes.sums[0, MASS])


def kick(s: Setup) -> Number:
    """Return the time for which forces act in this step.

    Velocities belong to the middles of steps: forces act from the middle of the last step to the
    middle of this one. In the first step they act for all of it, since initial velocities belong to
    half a step earlier, unless the script requests half.
    """
    return real(s.control.clock[0].kick, s.nodes.sums[0, MASS])


def common_velocity(kin: Tag, clock: Any, like: Number) -> tuple:
    """Return the reference velocity (d,) for speeds, in the type of `like`."""
    return vector(kin, [real(clock.common[0, k], like) for k in range(kin.dimension)])


NEXT_TO_NOTHING = 1e-9  # of a step
ROUNDING = 1e-6  # of a step: round-off of a million additions

# Contact stiffness depends on dt. If dt drops suddenly (set_dt), the dt of the stiffness drops by
# this fraction of the time: loaded springs stiffen over several periods.
FOLLOWING = 0.01

# Crossing cells adds energy, more with a longer step. Until points have moved this far, in cells,
# the stable step is the one at rest.
STILL = 0.25
# Cells that a point may move in a step, if the step ignores a common drift.
STRIDE = 0.65


@kernel
def choose_dt(control: Control) -> None:
    """Choose dt of the next step: from the fastest point, or fixed; less at the end.

    The last two steps are equally shortened: prescribed or mapped velocities give impulses that do
    not vanish with dt, so a very short step would have huge forces. Contact with a stiffness of
    m/dt^2 uses a whole step: suddenly stiffer springs would throw bodies back. The first step after
    load steps begins as in a new scene.
    """
    clock = control.clock[0]
    if clock.weight > 1:
        # The common drift may have rotated since it was measured: bounded by the speeds.
        clock.rate = max(clock.rate, clock.wave + clock.speed * clock.spacing)
    limit = clock.courant * clock.spacing / clock.rate if clock.rate > 0 else inf
    dt = min(clock.dt_factor * limit, clock.heat_factor * clock.heat_limit)
    if clock.weight != 1 and clock.speed * dt > STRIDE:
        dt = STRIDE / clock.speed
    dt = clock.fixed_dt if clock.fixed_dt > 0 else dt
    whole = dt
    limit = min(limit, clock.heat_limit)
    clock.limit = limit
    clock.over_limit = clock.over_limit + 1 if dt > limit else 0
    remaining = clock.end_time - control.values[TIME]
    # Tolerance for rounding in many additions of dt: no final step of 1e-16.
    if 0 < remaining <= dt * (1 + ROUNDING):
        dt = remaining
    elif 0 < remaining < 2 * dt * (1 - ROUNDING):
        dt = 0.5 * remaining
    control.values[DT] = dt
    anew = clock.last_dt == 0
    last, last_contact = (dt, whole) if anew else (clock.last_dt, clock.last_contact_dt)
    clock.kick = 0.5 * (last + dt)
    clock.contact_dt = max(whole, last_contact - FOLLOWING * dt)
    clock.contact_kick = 0.5 * (last_contact + clock.contact_dt)
    if anew:
        clock.kick *= clock.first_kick
        clock.contact_kick *= clock.first_kick
    if clock.kept_by_time > 0:
        clock.kept = clock.kept_by_time ** (dt / clock.limit)


@kernel
def finish(control: Control) -> None:
    """End a step: advance time, swap the arrays of places, choose the next dt."""
    clock = control.clock[0]
    clock.now = 1 - clock.now
    dt = control.values[DT]
    clock.last_dt = dt
    clock.last_contact_dt = clock.contact_dt
    time = control.values[TIME] + dt
    control.values[TIME] = clock.end_time if clock.end_time - control.values[TIME] == dt else time
    control.values[TIMESTEP] += 1
    clock.drift += clock.move
    clock.path += clock.move
    clock.pace = max(clock.pace, clock.move)
    clock.speed = clock.move / dt if dt > 0 else 0.0
    clock.move = 0.0
    if clock.path > STILL:
        clock.courant, clock.dt_factor = clock.courant_moving, clock.dt_factor_moving
    choose_dt(control)


@kernel
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


def read_reports(s: Setup) -> None:
    """Put the largest rate and move of all tiles, and any failure, in the clock."""
    clock = s.control.clock[0]
    clock.new_rate = 0.0
    clock.new_move = 0.0
    for block in s.blocks:
        _read_reports(block.tiling, s.control)
    agree_on_reports(s.control.ranks, s.control)


def take_reports(clock: Any) -> None:
    # Points move in one sweep of a step; domains may grow in another.
    clock.move += clock.new_move
    if clock.new_rate > 0:
        clock.rate = clock.new_rate


def all_well(s: Setup, take: Any = take_reports) -> bool:
    """Read and accept the reports of a sweep; return whether no point failed."""
    clock = s.control.clock[0]
    read_reports(s)
    take(clock)
    return clock.wrong == 0


class MoveCheck(NamedTuple):
    frame: Tag
    kin: Tag
    grids: Grid
    now: int
    stride: float


def move_check(s: Setup) -> MoveCheck:
    clock = s.control.clock[0]
    return MoveCheck(s.frame, s.kin, s.grids, clock.now, clock.stride)


def checked_move(check, points, p):
    """Return the move of point `p` in cells, and whether it is allowed."""
    frame, kin, grids, now, stride = check
    grid = record(grids, index(points.grid[p]))
    y = load_vector(kin, points.x[1 - now], p)
    step = (y - load_vector(kin, points.x[now], p)).largest()
    cells = float(step * grid.inv_h)
    return cells, cells <= stride and (inside(grid, kin, y) or not frame.moves)


@by_threads
def _check_points(check, points, tiling, k):
    check, points, tiling = at_hand(check), at_hand(points), at_hand(tiling)
    for position in range(tiling.share[k], tiling.share[k + 1]):
        t = tiling.order[position]
        furthest = 0.0
        wrong = 0
        for p in range(tiling.range[t, 0], tiling.range[t, 1]):
            cells, good = checked_move(check, points, p)
            furthest = max(furthest, cells)
            wrong = wrong if good else p + 1
        tiling.report[t, 0] = furthest
        tiling.report[t, 2] = wrong


def check_moves(s: Setup, mode: Tag) -> bool:
    """Check the new positions again, after hooks on them."""
    clock = s.control.clock[0]
    for block in s.blocks:
        _check_points(mode, block.tiling.count[1], move_check(s), block.points, block.tiling)
    read_reports(s)
    clock.move = max(clock.move, clock.new_move)
    return clock.wrong == 0
