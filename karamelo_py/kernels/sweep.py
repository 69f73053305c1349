"""Sweeps over points, tile by tile, and over the nodes in use.

A tile's points scatter to a separate buffer, a dense box of the nodes in reach. Then each tile of
nodes sums the boxes that reach the tile. Threads divide tiles without atomics, so the order of sums
does not depend on their number.
"""

from math import inf
from typing import Any, NamedTuple

from karamelo_py.compiler import (
    all_lanes,
    at_hand,
    hold,
    index,
    noinline,
    point_function,
    real,
    where,
)
from karamelo_py.compiler.fields import load, load_vector, store
from karamelo_py.compiler.lanes import first_false_lane, largest, room_for
from karamelo_py.compiler.threads import by_threads
from karamelo_py.compiler.tuples import flat, nested_as, record
from karamelo_py.kernels.arrays import Block, Index, Locations, Nodes, Number, Points, Setup, Tag
from karamelo_py.kernels.clock import common_velocity
from karamelo_py.kernels.equations import empty_all, load_all, updated_all
from karamelo_py.kernels.equations.node_updates import at_node
from karamelo_py.kernels.lanes import (
    lanes_of_update,
    lanes_with,
    one_loop_each,
    points_from,
    zero_of,
)
from karamelo_py.kernels.stencils import gathered_by, scatter_nodes
from karamelo_py.kernels.sums import adds, sum_shares
from karamelo_py.kernels.totals import take_over
from karamelo_py.kernels.views import PointView, Work, ask_ahead, location_at
from karamelo_py.points.basis import locate
from karamelo_py.points.grid import Grid, inside, renumbered
from karamelo_py.points.kinematics import zero_vector
from karamelo_py.points.transfers import in_step

ROUNDING = 1e-3  # tolerance of distances, in cells
STRETCH = 64  # number of points whose totals and arrays fit into the L1 cache


class Visit(NamedTuple):
    """A pass over points: tasks, then quantities to scatter."""

    tasks: tuple
    quantities: tuple
    weights: Tag  # weights of the scatter: old or present


class Extent(NamedTuple):
    dt: Number
    gathers: bool
    scatters: bool
    moves: bool  # new locations go to the other of two arrays


class Context(NamedTuple):
    """The part of a `Setup` that a sweep needs; its type selects the kernel."""

    frame: Tag
    kin: Tag
    basis: Tag
    transfer: Tag
    averaging: Tag
    grids: Grid
    nodes: Nodes
    buffers: Nodes  # nodes to which points scatter
    now: int
    room: Number  # cells that points may still move within the box of their tile
    stride: Number
    common: tuple  # (d,)
    then: int  # index of the new locations
    gathers: bool
    scatters: bool
    dt: Number
    kick: Number


class OldWeights(NamedTuple):
    pass


class PresentWeights(NamedTuple):
    pass


def work_of(s: Context, grid: Grid, nodes: Nodes, block: Block, locations: Locations) -> Work:
    return Work(
        s.frame, s.kin, s.basis, grid, s.transfer, s.averaging, nodes, block.points, block.laws,
        locations, s.common, s.kick,
    )  # fmt: skip


def recompute_stencil(weights: Tag, w: Work, stencil: tuple, p: Index) -> tuple:
    if isinstance(weights, OldWeights) or not w.frame.moves:
        return stencil
    return locate(w.basis, w.kin, w.grid, location_at(w.basis, w.kin, w.locations.y, p))


def stays_in_box(weights: Tag, room: Number, moved: Number) -> bool:
    """Return True while points remain in the box of their tile; once False, sort them."""
    return isinstance(weights, OldWeights) or all_lanes(moved <= room)


def locations_of(frame: Tag, points: Points, now: int, then: int) -> Locations:
    weighed: Any = points.x[now] if frame.moves else points.home
    return Locations(weighed, points.x[now], points.x[then])


def position_of(w: Work, p: Index) -> tuple:
    return load_vector(w.kin, w.locations.x, p)


def stencil_of(w: Work, p: Index) -> tuple:
    return locate(w.basis, w.kin, w.grid, location_at(w.basis, w.kin, w.locations.where, p))


def scatter_point(visit: Visit, lanes: Tag, pt: PointView, out: Work) -> None:
    stencil = recompute_stencil(visit.weights, pt.w, pt.stencil, pt.p)
    scatter_nodes(stencil, lanes, visit.quantities, out, load_all(visit.quantities, pt))


class TileVisit(NamedTuple):
    visit: Visit
    s: Context
    lanes: Tag
    w: Work  # nodes to gather from
    out: Work  # Visit the points of tile `t` of a block; if a point fails, nothing is scattered.
    begin: int
    end: int


@noinline
def visit_tile(visit: Visit, s: Context, block: Block, t: int) -> None:
    """Visit the points of the t-th tile of a block; if a point fails, nothing is scattered."""
    s, block = at_hand(s), at_hand(block)
    points, tiling = block.points, block.tiling
    grid = record(s.grids, tiling.grid[t])
    locations = locations_of(s.frame, points, s.now, s.then)
    w = hold(work_of(s, grid, s.nodes, block, locations))
    box = tiling.buffer
    numbered = renumbered(grid, box[t, 2], box[t, 3], box[t, 4])
    out = work_of(s, numbered, s.buffers, block, locations)
    parts = (*visit.tasks, *visit.quantities, s.basis, s.transfer, s.averaging)
    lanes = lanes_with(parts, block.laws, points.mass)
    tile = TileVisit(visit, s, lanes, w, out, tiling.range[t, 0], tiling.range[t, 1])
    if one_loop_each(lanes, visit):
        furthest, fastest, wrong = _visit_in_stretches(tile)
    else:
        furthest, fastest, wrong = _visit_at_once(tile)
    tiling.report[t, 0] = largest(furthest)
    tiling.report[t, 1] = largest(fastest)
    tiling.report[t, 2] = wrong


def _without_gather(tile, p, moved):
    s, w = tile.s, tile.w
    if not s.frame.moves:
        return moved
    return where(inside(w.grid, s.kin, position_of(w, p)), moved, real(inf, moved))


def is_good(stride, moved, rate):
    """Return False if a point failed or a number is NaN."""
    return (moved <= stride) & (rate < 1e300)


def _visit_at_once(tile):
    visit, s, lanes, w, out, begin, end = tile
    dt = s.dt
    furthest = fastest = zero_of(lanes, dt)
    wrong = 0
    for q in range(begin, end, lanes.width):
        p = points_from(lanes, q, end)
        ask_ahead(w, p, dt, False)
        stencil = stencil_of(w, p)
        moved = zero_of(lanes, dt)
        rate = fastest
        if s.gathers:
            totals = gathered_by(lanes, visit.tasks, w, stencil, position_of(w, p))
            moved, rate = updated_all(visit.tasks, PointView(w, stencil, p, dt), totals, fastest)
        else:
            moved = _without_gather(tile, p, moved)
        good = is_good(s.stride, moved, rate)
        if not all_lanes(good):
            wrong = q + 1 + first_false_lane(good)
            continue
        furthest = max(furthest, moved)
        fastest = rate
        if s.scatters and stays_in_box(visit.weights, s.room, moved):
            scatter_point(visit, lanes, PointView(w, stencil, p, dt), out)
    return furthest, fastest, wrong


def _visit_in_stretches(tile):
    """Gather, update and scatter stretches of points in three separate loops (`one_loop_each`)."""
    visit, s, lanes, w, out, begin, end = tile
    dt, wide = s.dt, lanes_of_update(lanes, visit)
    template = empty_all(visit.tasks, w, zero_vector(s.kin, dt))
    room = room_for(STRETCH, flat(template))
    furthest = fastest = zero_of(wide, dt)
    wrong = 0
    for first in range(begin, end, STRETCH):
        last = min(first + STRETCH, end)
        if s.gathers:
            for q in range(first, last, lanes.width):
                p = points_from(lanes, q, last)
                if (q - first) % wide.width == 0:
                    ask_ahead(w, p, dt, True)
                totals = gathered_by(lanes, visit.tasks, w, stencil_of(w, p), position_of(w, p))
                store(room, points_from(lanes, q - first, last - first), flat(totals))
        for q in range(first, last, wide.width):
            p = points_from(wide, q, last)
            moved = zero_of(wide, dt)
            rate = fastest
            if s.gathers:
                numbers = load(room, points_from(wide, q - first, last - first), flat(template))
                totals = nested_as(template, numbers)
                moved, rate = updated_all(visit.tasks, PointView(w, (), p, dt), totals, fastest)
            else:
                moved = _without_gather(tile, p, moved)
            good = is_good(s.stride, moved, rate)
            if not all_lanes(good):
                wrong = q + 1 + first_false_lane(good)
                continue
            furthest = max(furthest, moved)
            fastest = rate
        if s.scatters and wrong == 0 and stays_in_box(visit.weights, s.room, furthest):
            for q in range(first, last, lanes.width):
                p = points_from(lanes, q, last)
                scatter_point(visit, lanes, PointView(w, stencil_of(w, p), p, dt), out)
    return furthest, fastest, wrong


@by_threads
def visit_shares(visit: Visit, s: Context, block: Block, first: int, k: int) -> None:
    share, order = block.tiling.share, block.tiling.order
    for t in range(share[first + k], share[first + k + 1]):
        visit_tile(visit, s, block, order[t])


@by_threads
def _visit_nodes(task: Tag, used: tuple, dt: Number, k: int) -> None:
    kin, nodes, ranges = at_hand(used)
    for r in range(ranges[k, 0], ranges[k, 1]):
        for n in range(ranges[r, 0], ranges[r, 1]):
            at_node(task, kin, nodes, index(n), dt)


def context_of(s: Setup, extent: Extent) -> Context:
    step, motion, (dt, gathers, scatters, moves) = s.control.step[0], s.control.motion[0], extent
    # slightly more, as points are sorted as soon as one leaves its box (run.tiles)
    room = motion.drift_limit - motion.drift - motion.move + 0.5 * ROUNDING
    return Context(
        s.frame, s.kin, s.basis, in_step(s.transfer, step.kept), s.averaging, s.grids, s.nodes,
        s.buffers.nodes, motion.now, real(room, dt), real(motion.stride, dt),
        common_velocity(s.kin, motion, dt),
        1 - motion.now if moves else motion.now, gathers, scatters, dt,
        real(step.kick, dt),
    )  # fmt: skip


@point_function(otherwise=True)
def sweep_points(mode: Tag, visit: Visit, s: Context, block: Block) -> None:
    visit_shares(mode, block.tiling.count[1], visit, s, block, 0)


@point_function(otherwise=True)
def sum_buffers(mode: Tag, quantities: tuple, s: Setup, due: bool) -> None:
    count = s.buffers.count[0] if due else 0
    sum_shares(mode, count, quantities, s.kin, s.nodes, s.buffers)


@point_function(otherwise=True)
def sweep_nodes(mode: Tag, task: Tag, s: Setup, dt: Number) -> None:
    _visit_nodes(mode, s.ranges[0, 0], task, (s.kin, s.nodes, s.ranges), dt)


@point_function(otherwise=True)
def sweep_blocks(ranks: Tag, s: Setup, mode: Tag, visit: Visit, context: Context) -> None:
    """Sweep over all blocks, and begin sending to other processes."""
    for block in s.blocks:
        sweep_points(mode, visit, context, block)


def sweep(s: Setup, mode: Tag, visit: Visit, extent: Extent) -> None:
    """Visit all points and sum at the nodes; reports are stored by tile (`clock.read_reports`)."""
    # without buffers, nodes must be set to zero first
    direct, scatters = s.buffers.count[1], extent.scatters
    anew = tuple(quantity for quantity in visit.quantities if not adds(quantity))
    sum_given(mode, anew, s, scatters & (direct == 1))
    context = context_of(s, extent)
    sweep_blocks(s.control.ranks, s, mode, visit, context)
    sum_given(mode, visit.quantities, s, scatters & (direct == 0))


def sum_given(mode: Tag, quantities: tuple, s: Setup, due: bool) -> None:
    if len(quantities):
        take_over(s.control.ranks, due & (s.buffers.count[1] == 0))
        sum_buffers(mode, quantities, s, due)
