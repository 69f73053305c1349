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
    """Return dt, the time for which points move, in the precision of the run."""
    return real(s.control.values[DT], s.nodes.sums[0, MASS])


def last_step_size(s: Setup) -> Number:
    """Return the previous dt. Before the first step dt is tiny, but not 0, as laws divide by it."""
    last = s.control.step[0].last_dt
    least = NEXT_TO_NOTHING * s.control.values[DT]
    return real(last if last > 0 else least, s.nodes.sums[0, MASS])


def kick(s: Setup) -> Number:
    """Return the time for which forces act, between the middles of the last and this step.

    The first step returns dt (initial velocities are half a step old), or dt / 2 (start=half).
    """
    return real(s.control.step[0].kick, s.nodes.sums[0, MASS])


def common_velocity(kin: Tag, motion: Any, template: Number) -> tuple:
    """Return the velocity (d,) relative to which speeds are measured, in the type of `template`."""
    return vector(kin, [real(motion.common[0, k], template) for k in range(kin.dimension)])


NEXT_TO_NOTHING = 1e-9  # fraction of a step
ROUNDING = 1e-6  # fraction of a step: round-off of a million additions

# If dt drops suddenly (set_dt), the dt of the contact stiffness decreases by this fraction of the
# new dt per step, so that loaded springs stiffen over several periods.
FOLLOWING = 0.01
NOT_SOLVED = 2  # value of `motion.wrong` if no solution for the pressure was found
STILL = 0.25  # path in cells after which the smaller stable step for crossing cells applies
# Cells that a point may move in a step if the step ignores a common drift.
STRIDE = 0.65


@kernel
def choose_dt(control: Control) -> None:
    """Choose the next dt: from the fastest point, or fixed; shorter at the end of a run.

    The last two steps are equal. A very short last step would have huge forces, since impulses of
    prescribed or mapped velocities do not vanish with dt. Contact with a stiffness of m/dt^2 uses
    an unshortened dt, since suddenly stiffer springs would throw bodies back.
    """
    step, motion, heat = control.step[0], control.motion[0], control.heat[0]
    if motion.weight > 1:
        # The drift may have rotated since it was measured; `speed` is an upper bound.
        motion.rate = max(motion.rate, motion.wave + motion.speed * step.spacing)
    rate = max(motion.rate, motion.closing)
    limit = step.courant * step.spacing / rate if rate > 0 else inf
    dt = min(step.dt_factor * limit, step.heat_factor * heat.heat_limit)
    if motion.weight != 1 and motion.speed * dt > STRIDE:
        dt = STRIDE / motion.speed
    dt = step.fixed_dt if step.fixed_dt > 0 else dt
    anew = step.last_dt == 0
    if step.release > 0 and not anew:
        held = step.held * step.dt_factor
        if 0 < held < dt <= step.release * held:
            dt = held
        else:
            step.held = dt / step.dt_factor
    whole = dt
    limit = min(limit, heat.heat_limit)
    step.limit = limit
    step.over_limit = step.over_limit + 1 if dt > limit else 0
    remaining = step.end_time - control.values[TIME]
    # Round-off must not leave a final step of 1e-16.
    if 0 < remaining <= dt * (1 + ROUNDING):
        dt = remaining
    elif 0 < remaining < 2 * dt * (1 - ROUNDING):
        dt = 0.5 * remaining
    control.values[DT] = dt
    last, last_contact = (dt, whole) if anew else (step.last_dt, step.last_contact_dt)
    step.kick = 0.5 * (last + dt)
    step.contact_dt = max(whole, last_contact - FOLLOWING * dt)
    step.contact_kick = 0.5 * (last_contact + step.contact_dt)
    if anew:
        step.kick *= step.first_kick
        step.contact_kick *= step.first_kick
    if step.kept_by_time > 0:
        step.kept = step.kept_by_time ** (dt / step.limit)


@kernel
def finish(control: Control) -> None:
    step, motion = control.step[0], control.motion[0]
    motion.now = 1 - motion.now
    dt = control.values[DT]
    step.last_dt = dt
    step.last_contact_dt = step.contact_dt
    time = control.values[TIME] + dt
    control.values[TIME] = step.end_time if step.end_time - control.values[TIME] == dt else time
    control.values[TIMESTEP] += 1
    motion.drift += motion.move
    motion.path += motion.move
    motion.pace = max(motion.pace, motion.move)
    motion.speed = motion.move / dt if dt > 0 else 0.0
    motion.move = motion.closing = 0.0
    if motion.path > STILL:
        step.courant, step.dt_factor = step.courant_moving, step.dt_factor_moving
    choose_dt(control)


@kernel
def _read_reports(tiling, control):
    motion = control.motion[0]
    rate = 0.0
    moved = 0.0
    for t in range(tiling.count[0]):
        moved = max(moved, tiling.report[t, 0])
        rate = max(rate, tiling.report[t, 1])
        if tiling.report[t, 2] > 0:
            motion.wrong = 1
    motion.new_move = max(motion.new_move, moved)
    motion.new_rate = max(motion.new_rate, rate)


def read_reports(s: Setup) -> None:
    motion = s.control.motion[0]
    motion.new_rate = 0.0
    motion.new_move = 0.0
    for block in s.blocks:
        _read_reports(block.tiling, s.control)
    agree_on_reports(s.control.ranks, s.control)


def take_reports(control: Control) -> None:
    motion = control.motion[0]
    # Points move in one sweep of a step; domains may grow in another.
    motion.move += motion.new_move
    if motion.new_rate > 0:
        motion.rate = motion.new_rate


def all_well(s: Setup, take: Any = take_reports) -> bool:
    """Read the reports of a sweep; return False if a point failed."""
    read_reports(s)
    take(s.control)
    return s.control.motion[0].wrong == 0


class MoveCheck(NamedTuple):
    frame: Tag
    kin: Tag
    grids: Grid
    now: int
    stride: float


def move_check(s: Setup) -> MoveCheck:
    motion = s.control.motion[0]
    return MoveCheck(s.frame, s.kin, s.grids, motion.now, motion.stride)


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
    motion = s.control.motion[0]
    for block in s.blocks:
        _check_points(mode, block.tiling.count[1], move_check(s), block.points, block.tiling)
    read_reports(s)
    motion.move = max(motion.move, motion.new_move)
    return motion.wrong == 0
