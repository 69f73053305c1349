"""The loops: over tiles of points (gather, settle, scatter), tiles of nodes and nodes in use.

The points of a tile give to a buffer of their own: a dense box of the nodes that they may reach.
Then each tile of nodes sums the boxes that reach it. Threads share out tiles and need no atomics;
sums are made in one order, whatever the number of threads.
"""

from math import inf
from typing import NamedTuple

from karamelo_py.compiler.compile import (
    by_type,
    choose,
    first_failing,
    in_all,
    index,
    largest,
    looping,
    point_function,
    real,
    shared,
)
from karamelo_py.compiler.fields import load_vector
from karamelo_py.compiler.fingerprint import classes_in
from karamelo_py.compiler.held import at_hand, hold
from karamelo_py.compiler.lanes import Eights, Fours, group, join, lanes_for, spread
from karamelo_py.compiler.loops import entered, subkernel
from karamelo_py.compiler.threads import Serial, Threaded, shared_out
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.affine import (
    affine_parts,
    gathered_at_once_all,
    gathered_by_arms,
    give_affine,
)
from karamelo_py.kernels.arrays import Places
from karamelo_py.kernels.clock import common_velocity
from karamelo_py.kernels.corners import (
    all_by_corners,
    gather_corners,
    in_block,
    scatter_corners,
    shows_corners,
)
from karamelo_py.kernels.g2p import SecondStrain, Strain, empty_all, gathered_all, settled_all
from karamelo_py.kernels.nodes import at_node
from karamelo_py.kernels.p2g import load_all, scattered_all
from karamelo_py.kernels.sums import sum_share
from karamelo_py.kernels.visit import Work, ask_ahead, place_at, present_stencil
from karamelo_py.points.basis import locate, support
from karamelo_py.points.basis.cpdi.block import block_of, is_one_block, is_whole, of_one
from karamelo_py.points.basis.cpdi.corners import CornerStencil
from karamelo_py.points.basis.product import Stencil, evenly, sees_same_nodes, with_one_node
from karamelo_py.points.frames import Total, Updated, follows
from karamelo_py.points.grid import inside, renumbered

ROUNDING = 1e-3  # cells by which distances in cells may be rounded


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
def _(weights, w, stencil, p):
    return stencil


@restencil.on(PresentWeights)
def _(weights, w, stencil, p):
    return present_stencil(w.frame, w, stencil, p)


@point_function()
def fits(weights, room, moved):
    """Whether points still give to nodes of their tile's box.

    If not, they will be sorted before the next step, and what they would give now is given then.
    """


@fits.on(OldWeights)
def _(weights, room, moved):
    return True


@fits.on(PresentWeights)
def _(weights, room, moved):
    return in_all(moved <= room)


@point_function()
def places_of(frame, points, now, then):
    """Where the weights of a sweep belong, and where the points are before and after it."""


@places_of.on(Updated)
def _(frame, points, now, then):
    return Places(points.x[now], points.x[now], points.x[then])


@places_of.on(Total)
def _(frame, points, now, then):
    return Places(points.home, points.x[now], points.x[then])


# --- one point or several ---------------------------------------------------------------------


class OneByOne(NamedTuple):
    """The points are visited one by one."""

    width = 1


def in_lanes(visit, s, block):
    """Whether points are visited in lanes, and how many at once: `OneByOne`, `Fours` or `Eights`.

    Interpreted, and where a part of the visit does not know lanes, they are visited one by one.
    """
    return OneByOne()


@by_type(in_lanes)
def _in_lanes(visit, s, block):
    tasks, quantities = visit[0], visit[1]
    of_scene = (s[s.fields.index(name)] for name in ("basis", "transfer", "averaging"))
    law = block[block.fields.index("laws")]
    parts = {part.instance_class for part in (*tasks, *quantities, *of_scene)}
    made = _lanes_if_known(parts, law, block[0][block[0].fields.index("mass")])
    return lambda visit, s, block: made()


def _lanes_if_known(parts, laws, mass):
    """The lanes for points of such `mass`, or none where a part does not know them."""
    if all(getattr(part, "in_lanes", False) for part in (*parts, *classes_in(laws))):
        return lanes_for(mass.dtype.bitwidth)
    return OneByOne


def lanes_of_law(laws, mass):
    """The same as `in_lanes`, where only a law is asked."""
    return OneByOne()


@by_type(lanes_of_law)
def _lanes_of_law(laws, mass):
    made = _lanes_if_known((), laws, mass)
    return lambda laws, mass: made()


def width_of(width):
    """How many points are visited at once; constant at compile time."""
    return width.width


@by_type(width_of)
def _width_of(width):
    number = width.instance_class.width
    return lambda width: number


@point_function()
def points_from(width, q, end):
    """The points to visit, from number `q` on, before `end`."""


@points_from.on(OneByOne)
def _(width, q, end):
    return index(q)


@points_from.on(Fours)
@points_from.on(Eights)
def _(width, q, end):
    return group(width, q, min(width_of(width), end - q))


def settled_width(width, visit):
    """How many points are settled at once: of doubles twice as many as gather, where laws wait.

    Chains of operations that wait for each other serve eight points in the time of four. To gather
    and to scatter, four are faster.
    """
    return width


@by_type(settled_width)
def _settled_width(width, visit):
    tasks = {task.instance_class for task in visit[0]}
    both = width.instance_class is Fours and tasks and tasks <= {Strain, SecondStrain}
    made = Eights if both else width.instance_class
    return lambda width, visit: made()


@point_function(tags=2)
def groups_of(width, wide, q, end):
    """The groups of points that are gathered and scattered one after another."""


@groups_of.on(OneByOne, OneByOne)
@groups_of.on(Fours, Fours)
@groups_of.on(Eights, Eights)
def _(width, wide, q, end):
    return (points_from(width, q, end),)


@groups_of.on(Fours, Eights)
def _(width, wide, q, end):
    # Where there is no second one it is the first again, and gives nothing.
    second = q + 4 if q + 4 < end else q
    return points_from(width, q, end), points_from(width, second, end)


@shared
def joined(p, parts):
    """What the points of a group have, from that of the groups it is made of."""
    if len(parts) == 1:
        return parts[0]
    if isinstance(parts[0], tuple):
        return tuple([joined(p, inner) for inner in zip(*parts, strict=True)])
    return join(p, *parts)


@point_function()
def zero_of(width, like):
    """0 as a number of a visit."""


@zero_of.on(OneByOne)
def _(width, like):
    return like - like


@zero_of.on(Fours)
@zero_of.on(Eights)
def _(width, like):
    return spread(width, like - like)


@looping
def _gather(tasks, w, stencil, totals):
    for k in range(support(w.basis, w.kin)):
        totals = gathered_all(tasks, w, stencil, k, totals)
    return totals


@looping
def _scatter(quantities, w, stencil, loads):
    for k in range(support(w.basis, w.kin)):
        scattered_all(quantities, w, stencil, k, loads)


@shared
def _even(w, stencil, asked):
    """Whether D^-1 is the same for all points of a group; not asked where nothing depends on it."""
    return in_all(evenly(w.basis, w.grid, stencil)) if asked else True


@point_function(tags=2, otherwise=True)
def gather_nodes(width, stencil, tasks, w, totals):
    """The totals of the tasks over all nodes of the stencil."""
    return _gather(tasks, w, stencil, totals)


@gather_nodes.on(OneByOne, Stencil)
def _(width, stencil, tasks, w, totals):
    if not _even(w, stencil, len(gathered_by_arms(w))):
        return _gather(tasks, w, stencil, totals)
    return _gather_parts(tasks, w, stencil, totals)


@gather_nodes.on(Fours, Stencil)
@gather_nodes.on(Eights, Stencil)
def _(width, stencil, tasks, w, totals):
    if not _even(w, stencil, len(gathered_by_arms(w))):
        return _gather(tasks, w, stencil, totals)
    # Sorted points mostly see the same nodes: their records are loaded once for all lanes.
    if sees_same_nodes(stencil):
        return _gather_parts(tasks, w, with_one_node(stencil), totals)
    return _gather_parts(tasks, w, stencil, totals)


@gather_nodes.on(OneByOne, CornerStencil)
def _(width, stencil, tasks, w, totals):
    if all_by_corners(tasks, w):
        return gather_corners(tasks, w, stencil, totals)
    return _gather(tasks, w, stencil, totals)


@gather_nodes.on(Fours, CornerStencil)
@gather_nodes.on(Eights, CornerStencil)
def _(width, stencil, tasks, w, totals):
    by_corners = all_by_corners(tasks, w)
    if by_corners and shows_corners(tasks, w):
        return gather_corners(tasks, w, stencil, totals)
    block = block_of(w.kin, w.grid, stencil)
    if is_one_block(block):
        return _gather(tasks, in_block(w), of_one(block), totals)
    if by_corners:
        return gather_corners(tasks, w, stencil, totals)
    return _gather(tasks, w, stencil, totals)


@shared
def _gather_parts(tasks, w, stencil, totals):
    """What can be is gathered from all nodes at once, the rest node by node."""
    found = gathered_at_once_all(tasks, w, stencil, totals)
    rest = [k for k, total in enumerate(found) if not len(total)]
    own = _gather(tuple([tasks[k] for k in rest]), w, stencil, tuple([totals[k] for k in rest]))
    return tuple([own[rest.index(k)] if k in rest else total for k, total in enumerate(found)])


@point_function(tags=2, otherwise=True)
def scatter_nodes(width, stencil, quantities, w, loads):
    """Give all nodes of the stencil their parts."""
    _scatter(quantities, w, stencil, loads)


@scatter_nodes.on(Fours, Stencil)
@scatter_nodes.on(Eights, Stencil)
def _(width, stencil, quantities, w, loads):
    parts = affine_parts(quantities, w, stencil, loads)
    if not _even(w, stencil, any(len(part) and len(part[-1]) for part in parts)):
        _scatter(quantities, w, stencil, loads)
    elif sees_same_nodes(stencil):
        _scatter_parts(width, quantities, w, with_one_node(stencil), loads, parts)
    else:
        _scatter_parts(width, quantities, w, stencil, loads, parts)


@scatter_nodes.on(OneByOne, CornerStencil)
def _(width, stencil, quantities, w, loads):
    if all_by_corners(quantities, w):
        scatter_corners(quantities, w, stencil, loads)
    else:
        _scatter(quantities, w, stencil, loads)


@scatter_nodes.on(Fours, CornerStencil)
@scatter_nodes.on(Eights, CornerStencil)
def _(width, stencil, quantities, w, loads):
    block = block_of(w.kin, w.grid, stencil)
    if is_one_block(block):
        _scatter_block(width, quantities, w, of_one(block), loads)
    elif is_whole(block):
        _scatter_block(width, quantities, w, block, loads)
    elif all_by_corners(quantities, w):
        scatter_corners(quantities, w, stencil, loads)
    else:
        _scatter(quantities, w, stencil, loads)


@shared
def _scatter_block(width, quantities, w, block, loads):
    at = in_block(w)
    _scatter_parts(width, quantities, at, block, loads, affine_parts(quantities, at, block, loads))


@shared
def _scatter_parts(width, quantities, w, stencil, loads, parts):
    """What is affine at all nodes at once, the rest node by node."""
    known = tuple([part for part in parts if len(part)])
    if len(known):
        give_affine(width, w, stencil, known)
    rest = [k for k, part in enumerate(parts) if not len(part)]
    if len(rest):
        _scatter(tuple([quantities[k] for k in rest]), w, stencil, tuple([loads[k] for k in rest]))


@shared
def gathered_by(width, tasks, w, stencil, x):
    """What the tasks gather over the nodes of a stencil."""
    return gather_nodes(width, stencil, tasks, w, empty_all(tasks, w, x))


@subkernel
def visit_tile(visit, s, block, then, gathers, scatters, dt, t):
    """Visit the points of the t-th occupied tile of a block in the context `s`.

    With `gathers` the tasks of the visit are done, with `scatters` its quantities scattered: one
    loop serves a scheme's fused and its single stages. `then` says which of the two arrays of
    places takes the new ones.
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
    furthest = zero_of(wide, dt)
    fastest = furthest
    wrong = 0
    end = tiling.range[t, 1]
    for q in range(tiling.range[t, 0], end, width_of(wide)):
        p = points_from(wide, q, end)
        groups = groups_of(width, wide, q, end)
        ask_ahead(w, p, dt)
        stencils = tuple(
            [
                locate(s.basis, s.kin, grid, place_at(s.basis, s.kin, places.where, g))
                for g in groups
            ]
        )
        moved = zero_of(wide, dt)
        rate = fastest
        if gathers:
            totals = tuple(
                [
                    gathered_by(width, visit.tasks, w, stencil, load_vector(s.kin, places.x, g))
                    for stencil, g in zip(stencils, groups, strict=True)
                ]
            )
            totals = joined(p, totals)
            moved, rate = settled_all(visit.tasks, w, stencils[0], p, dt, totals, fastest)
        elif follows(s.frame):
            here = inside(grid, s.kin, load_vector(s.kin, places.x, p))
            moved = choose(here, moved, real(inf, moved))
        good = (moved <= 1) & (rate < 1e300)  # so written, NaN counts as wrong too
        if not in_all(good):
            wrong = q + 1 + first_failing(good)
            continue
        furthest = max(furthest, moved)
        fastest = rate
        if scatters and fits(visit.weights, s.room, moved):
            for k, g in enumerate(groups):
                if k * width_of(width) < end - q:
                    stencil = restencil(visit.weights, w, stencils[k], g)
                    loads = load_all(visit.quantities, w, g, dt)
                    scatter_nodes(width, stencil, visit.quantities, out, loads)
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
def _(mode, visit, s, block, then, gathers, scatters, dt):
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
def _(mode, quantities, s, due):
    _sum_all(mode, quantities, s.kin, s.nodes, s.buffers, due)


@point_function()
def sweep_nodes(mode, task, kin, nodes, ranges, dt):
    """Do `task` at every node in use."""


@entered
def _visit_all_nodes(mode, task, kin, nodes, ranges, dt):
    _visit_shares_of_nodes(mode, ranges[0, 0], task, kin, nodes, ranges, dt)


@sweep_nodes.on(Serial)
@sweep_nodes.on(Threaded)
def _(mode, task, kin, nodes, ranges, dt):
    _visit_all_nodes(mode, task, kin, nodes, ranges, dt)
