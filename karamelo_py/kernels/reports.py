"""The reports of tiles: how far points went, at what rate, and which one went wrong."""

from karamelo_py.compiler.compile import over_blocks, shared
from karamelo_py.compiler.fields import load_vector
from karamelo_py.compiler.held import at_hand
from karamelo_py.compiler.loops import kernel, noinline
from karamelo_py.compiler.threads import shared_out
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import Setup, Tag
from karamelo_py.kernels.totals import agree_on_reports
from karamelo_py.points.grid import inside


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


@over_blocks
def _survey_blocks(block, s):
    _read_reports(block.tiling, s.control)


@shared
def read_reports(s: Setup) -> None:
    """Gather the reports of all tiles in the clock: largest rate and move, and any wrong point."""
    clock = s.control.clock[0]
    clock.new_rate = 0.0
    clock.new_move = 0.0
    _survey_blocks(s)
    agree_on_reports(s.control.ranks, s.control)


@shared
def all_well(s: Setup) -> bool:
    """Take over the reports of a sweep of a step; return True if no point went wrong."""
    clock = s.control.clock[0]
    read_reports(s)
    # Points move in one sweep of a step, and their domains may grow in another.
    clock.move += clock.new_move
    if clock.new_rate > 0:
        clock.rate = clock.new_rate
    return clock.wrong == 0


@noinline
def _check_share(frame, kin, grids, points, tiling, now, k):
    """Report the largest move of the points of the k-th share, and the point that went wrong."""
    grids, points, tiling = at_hand(grids), at_hand(points), at_hand(tiling)
    for place in range(tiling.share[k], tiling.share[k + 1]):
        t = tiling.order[place]
        furthest = 0.0
        wrong = 0
        for p in range(tiling.range[t, 0], tiling.range[t, 1]):
            grid = record(grids, points.grid[p])
            y = load_vector(kin, points.x[1 - now], p)
            step = (y - load_vector(kin, points.x[now], p)).largest()
            cells = float(step * grid.inv_h)
            furthest = max(furthest, cells)
            if not (cells <= 1 and (inside(grid, kin, y) or not frame.moves)):
                wrong = p + 1
        tiling.report[t, 0] = furthest
        tiling.report[t, 2] = wrong


_check_shares = shared_out(_check_share, "frame, kin, grids, points, tiling, now")


@kernel
def _check_points(mode, frame, kin, grids, points, tiling, control):
    clock = control.clock[0]
    _check_shares(mode, tiling.count[1], frame, kin, grids, points, tiling, clock.now)
    for t in range(tiling.count[0]):
        clock.move = max(clock.move, tiling.report[t, 0])
        if tiling.report[t, 2] > 0:
            clock.wrong = 1


@over_blocks
def _check_blocks(block, s, mode):
    _check_points(mode, s.frame, s.kin, s.grids, block.points, block.tiling, s.control)


@shared
def check_moves(s: Setup, mode: Tag) -> bool:
    """Look at the new positions again, after hooks that may have changed them."""
    _check_blocks(s, mode)
    agree_on_reports(s.control.ranks, s.control)
    return s.control.clock[0].wrong == 0
