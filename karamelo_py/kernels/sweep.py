"""The loops: over tiles of points (gather, settle, scatter), tiles of nodes and nodes in use.

The points of a tile give to a buffer of their own: a dense box of the nodes that they may reach.
Then each tile of nodes sums the boxes that reach it. Threads share out tiles and need no atomics;
sums are made in one order, whatever the number of threads.
"""

from math import inf
from typing import NamedTuple

from karamelo_py.compiler.compile import (
    choose,
    first_failing,
    in_all,
    index,
    largest,
    point_function,
    real,
    shared,
)
from karamelo_py.compiler.fields import load, load_vector, store
from karamelo_py.compiler.held import at_hand, hold
from karamelo_py.compiler.lanes import room_for
from karamelo_py.compiler.loops import entered, subkernel
from karamelo_py.compiler.threads import Serial, Threaded, shared_out
from karamelo_py.compiler.tuples import flat, nested_as, record
from karamelo_py.kernels.arrays import Places
from karamelo_py.kernels.clock import common_velocity
from karamelo_py.kernels.g2p import empty_all, settled_all
from karamelo_py.kernels.nodes import at_node
from karamelo_py.kernels.p2g import load_all
from karamelo_py.kernels.stencils import gathered_by, scatter_nodes
from karamelo_py.kernels.sums import sum_share
from karamelo_py.kernels.visit import (
    Work,
    ask_ahead,
    ask_ahead_of_stretch,
    place_at,
    present_stencil,
)
from karamelo_py.kernels.width import (
    in_lanes,
    in_stretches,
    points_from,
    settled_width,
    width_of,
    zero_of,
)
from karamelo_py.points.basis import locate
from karamelo_py.points.frames import Total, Updated, follows
from karamelo_py.points.grid import inside, renumbered
from karamelo_py.points.kinematics import zero_vector

ROUNDING = 1e-3  # cells by which distances in cells may be rounded
STRETCH = 64  # points: what they gather, and what they have, stays in the nearest cache
WHOLE = 1 << 40  # points, more than any tile has


class Visit(NamedTuple):
    """What a visit of the points does: tags of its tasks, then of what it scatters."""

    tasks: tuple
    quantities: tuple
    weights: NamedTuple  # of the scatter


class Context(NamedTuple):
    """What of a setup a sweep over the points needs."""

    frame: NamedTuple
    kin: NamedTuple
    basis: NamedTuple
    transfer: NamedTuple
    averaging: NamedTuple
    grids: NamedTuple
    nodes: NamedTuple
    buffers: NamedTuple  # nodes that are given to
    now: int
    room: float  # cells that points may still go before their tile's box does not hold them
    common: tuple  # velocity that speeds are measured from


class OldWeights(NamedTuple):
    """The weights of the gather, of the place before the move."""


class PresentWeights(NamedTuple):
    """The weights of the place after the move."""


@shared
def work_of(s, grid, nodes, block, places):
    """What a visit of points of a block works with; `nodes` are those of `grid`."""
    return Work(
        s.frame, s.kin, s.basis, grid, s.transfer, s.averaging, nodes, block.points, block.laws,
        places, s.common,
    )  # fmt: skip


@point_function()
def restencil(weights, w, stencil, p):
    """The stencil of the scatter."""


@restencil.on(OldWeights)
def _restencil_old_weights(weights, w, stencil, p):
    return stencil


@restencil.on(PresentWeights)
def _restencil_present_weights(weights, w, stencil, p):
    return present_stencil(w.frame, w, stencil, p)


@point_function()
def fits(weights, room, moved):
    """Whether points still give to nodes of their tile's box.

    If not, they will be sorted before the next step, and what they would give now is given then.
    """


@fits.on(OldWeights)
def _fits_old_weights(weights, room, moved):
    return True


@fits.on(PresentWeights)
def _fits_present_weights(weights, room, moved):
    return in_all(moved <= room)


@point_function()
def places_of(frame, points, now, then):
    """Where the weights of a sweep belong, and where the points are before and after it."""


@places_of.on(Updated)
def _places_of_updated(frame, points, now, then):
    return Places(points.x[now], points.x[now], points.x[then])


@places_of.on(Total)
def _places_of_total(frame, points, now, then):
    return Places(points.home, points.x[now], points.x[then])


# --- tiles of points ---------------------------------------------------------------------------


@shared
def place_of(w, p):
    """Where the points of a group are."""
    return load_vector(w.kin, w.places.x, p)


@shared
def stencil_of(w, p):
    """What the points of a group see before they move."""
    return locate(w.basis, w.kin, w.grid, place_at(w.basis, w.kin, w.places.where, p))


@shared
def give(visit, width, w, out, stencil, p, dt):
    """Scatter the quantities of the points of a group."""
    stencil = restencil(visit.weights, w, stencil, p)
    loads = load_all(visit.quantities, w, p, dt)
    scatter_nodes(width, stencil, visit.quantities, out, loads)


@subkernel
def visit_tile(visit, s, block, then, gathers, scatters, dt, t):
    """Visit the points of the t-th occupied tile of a block in the context `s`.

    With `gathers` the tasks of the visit are done, with `scatters` its quantities scattered: one
    loop serves a scheme's fused and its single stages. `then` says which of the two arrays of
    places takes the new ones. Points are gathered, settled and scattered group after group, or in
    stretches (see `in_stretches`).
    """
    s, block = at_hand(s), at_hand(block)
    points, tiling = block.points, block.tiling
    grid = record(s.grids, tiling.grid[t])
    places = places_of(s.frame, points, s.now, then)
    w = hold(work_of(s, grid, s.nodes, block, places))
    box = tiling.buffer
    numbered = renumbered(grid, box[t, 2], box[t, 3], box[t, 4])
    out = work_of(s, numbered, s.buffers, block, places)
    width = in_lanes(visit, s, block)
    wide = settled_width(width, visit)
    apart = in_stretches(width, visit)
    stretch = STRETCH if apart else WHOLE
    like = empty_all(visit.tasks, w, zero_vector(s.kin, dt)) if apart else ()
    room = room_for(STRETCH, flat(like)) if apart else ()
    furthest = zero_of(wide, dt)
    fastest = furthest
    wrong = 0
    begin, end = tiling.range[t, 0], tiling.range[t, 1]
    for k in range((end - begin + stretch - 1) // stretch):
        first = begin + k * stretch
        last = min(first + stretch, end)
        if apart and gathers:
            for q in range(first, last, width_of(width)):
                p = points_from(width, q, last)
                if (q - first) % width_of(wide) == 0:
                    ask_ahead_of_stretch(w, p, dt)
                totals = gathered_by(width, visit.tasks, w, stencil_of(w, p), place_of(w, p))
                store(room, points_from(width, q - first, last - first), flat(totals))
        for q in range(first, last, width_of(wide)):
            p = points_from(wide, q, last)
            if not apart:
                ask_ahead(w, p, dt)
            stencil = () if apart else stencil_of(w, p)
            moved = zero_of(wide, dt)
            rate = fastest
            if gathers:
                if apart:
                    found = load(room, points_from(wide, q - first, last - first), flat(like))
                    totals = nested_as(like, found)
                else:
                    totals = gathered_by(width, visit.tasks, w, stencil, place_of(w, p))
                moved, rate = settled_all(visit.tasks, w, stencil, p, dt, totals, fastest)
            elif follows(s.frame):
                moved = choose(inside(grid, s.kin, place_of(w, p)), moved, real(inf, moved))
            good = (moved <= 1) & (rate < 1e300)  # so written, NaN counts as wrong too
            if not in_all(good):
                wrong = q + 1 + first_failing(good)
                continue
            furthest = max(furthest, moved)
            fastest = rate
            if not apart and scatters and fits(visit.weights, s.room, moved):
                give(visit, width, w, out, stencil, p, dt)
        # From the first point on that has gone wrong, or does not fit, a tile gives nothing more:
        # the run ends, or points are sorted and give all anew.
        if apart and scatters and wrong == 0 and fits(visit.weights, s.room, furthest):
            for q in range(first, last, width_of(width)):
                p = points_from(width, q, last)
                give(visit, width, w, out, stencil_of(w, p), p, dt)
    tiling.report[t, 0] = largest(furthest)
    tiling.report[t, 1] = largest(fastest)
    tiling.report[t, 2] = wrong


@subkernel
def visit_share(visit, s, block, then, gathers, scatters, dt, first, k):
    """Visit the points of the tiles of the k-th share behind the `first`, one thread's work."""
    share, order = block.tiling.share, block.tiling.order
    for t in range(share[first + k], share[first + k + 1]):
        visit_tile(visit, s, block, then, gathers, scatters, dt, order[t])


@subkernel
def visit_nodes(task, kin, nodes, ranges, dt, k):
    """Do `task` at the nodes of the k-th share."""
    nodes = at_hand(nodes)
    for r in range(ranges[k, 0], ranges[k, 1]):
        for n in range(ranges[r, 0], ranges[r, 1]):
            at_node(task, kin, nodes, index(n), dt)


# --- threads ----------------------------------------------------------------------------------

_visit_shares = shared_out(visit_share, "visit, s, block, then, gathers, scatters, dt, first")
_sum_shares = shared_out(sum_share, "quantities, kin, nodes, buffers")
_visit_shares_of_nodes = shared_out(visit_nodes, "task, kin, nodes, ranges, dt")


@point_function()
def sweep_points(mode, visit, s, block, then, gathers, scatters, dt):
    """Sweep over the points of one block of the setup `s`."""


@entered
def _visit_all(mode, visit, s, block, then, gathers, scatters, dt, first, count):
    _visit_shares(mode, count, visit, s, block, then, gathers, scatters, dt, first)


@sweep_points.on(Serial)
@sweep_points.on(Threaded)
def _sweep_points_threaded(mode, visit, s, block, then, gathers, scatters, dt):
    shares = block.tiling.count[1]
    sweep_shares(mode, visit, s, block, then, gathers, scatters, dt, 0, shares)


@shared
def sweep_shares(mode, visit, s, block, then, gathers, scatters, dt, first, count):
    """Sweep over `count` shares of the points of a block, from the `first` on."""
    clock = s.control.clock[0]
    # A little more, so that points are sorted next whenever one did not fit (see run.tiles).
    room = clock.drift_limit - clock.drift - clock.move + 0.5 * ROUNDING
    context = Context(
        s.frame, s.kin, s.basis, s.transfer, s.averaging, s.grids, s.nodes, s.buffers.nodes,
        clock.now, real(room, dt), common_velocity(s.kin, clock, dt),
    )  # fmt: skip
    _visit_all(mode, visit, context, block, then, gathers, scatters, dt, first, count)


@point_function()
def sum_buffers(mode, quantities, s, due):
    """Sum at the nodes what the points gave of the quantities, if that is due."""


@entered
def _sum_all(mode, quantities, kin, nodes, buffers, due):
    count = buffers.count[0] if due else 0
    _sum_shares(mode, count, quantities, kin, nodes, buffers)


@sum_buffers.on(Serial)
@sum_buffers.on(Threaded)
def _sum_buffers_threaded(mode, quantities, s, due):
    _sum_all(mode, quantities, s.kin, s.nodes, s.buffers, due)


@point_function()
def sweep_nodes(mode, task, kin, nodes, ranges, dt):
    """Do `task` at every node in use."""


@entered
def _visit_all_nodes(mode, task, kin, nodes, ranges, dt):
    _visit_shares_of_nodes(mode, ranges[0, 0], task, kin, nodes, ranges, dt)


@sweep_nodes.on(Serial)
@sweep_nodes.on(Threaded)
def _sweep_nodes_threaded(mode, task, kin, nodes, ranges, dt):
    _visit_all_nodes(mode, task, kin, nodes, ranges, dt)
