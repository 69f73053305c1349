"""Visits of all points, and what their tiles report."""

from karamelo_py.compiler.compile import over_blocks, point_function, shared
from karamelo_py.compiler.fields import load_vector
from karamelo_py.compiler.held import at_hand
from karamelo_py.compiler.loops import entered, subkernel
from karamelo_py.compiler.threads import shared_out
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.sums import adds
from karamelo_py.kernels.sweep import sum_buffers, sweep_points
from karamelo_py.kernels.totals import agree_on_reports, take_over
from karamelo_py.points.frames import follows
from karamelo_py.points.grid import inside


@over_blocks
def sweep_blocks(block, s, mode, visit, then, gathers, scatters, dt):
    sweep_points(mode, visit, s, block, then, gathers, scatters, dt)


@point_function(otherwise=True)
def sweep_all(ranks, s, mode, visit, then, gathers, scatters, dt):
    """Sweep over the points of all blocks; begin to pass on what they give to other processes."""
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


@over_blocks
def _survey_blocks(block, s):
    _read_reports(block.tiling, s.control)


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


@subkernel
def _check_share(frame, kin, grids, points, tiling, now, k):
    """How far the points of the tiles of the k-th share have gone, and who went wrong."""
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
            if not (cells <= 1 and (inside(grid, kin, y) or not follows(frame))):
                wrong = p + 1
        tiling.report[t, 0] = furthest
        tiling.report[t, 2] = wrong


_check_shares = shared_out(_check_share, "frame, kin, grids, points, tiling, now")


@entered
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
def check_moves(s, mode):
    """Look at the new positions again, after hooks that may have changed them."""
    _check_blocks(s, mode)
    agree_on_reports(s.control.ranks, s.control)
    return s.control.clock[0].wrong == 0
