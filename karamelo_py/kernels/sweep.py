"""The two loops: over points (gather, settle, scatter) and over nodes in use.

Points are visited tile by tile and colour by colour. Tiles of one colour never touch the same
node, so threads need no atomics; the sums of a node are made in the order of colours, tiles and
points, whatever the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

from numba import prange

from karamelo_py.compile import index, kernel, point_function
from karamelo_py.kernels.stages import (
    at_node,
    empty,
    gathered,
    load,
    restencil,
    scattered,
    settled,
)
from karamelo_py.points.basis import locate, support
from karamelo_py.points.kinematics import vector_at


class Serial(NamedTuple):
    """One thread."""


class Threaded(NamedTuple):
    """All threads that Numba was given."""


@kernel
def sweep_tile(
    gather, scatter, kin, basis, transfer, nodes, points, laws, tiling, x_all, y_all, dt, t
):
    """Visit the points of the t-th occupied tile of a block."""
    furthest = dt - dt
    fastest = dt - dt
    wrong = 0
    for q in range(tiling.range[t, 0], tiling.range[t, 1]):
        p = index(q)
        x = vector_at(kin, x_all, p)
        stencil = locate(basis, kin, x)
        total = empty(gather, transfer, kin, x)
        for k in range(support(basis, kin)):
            total = gathered(gather, transfer, kin, basis, stencil, k, nodes, total)
        moved, rate = settled(
            gather, transfer, kin, basis, points, laws, x, y_all, p, dt, total, fastest
        )
        if not (moved <= 1 and rate < 1e300):  # so written, NaN counts as wrong too
            wrong = q + 1
            continue
        furthest = max(furthest, moved)
        fastest = rate
        stencil = restencil(scatter, kin, basis, stencil, vector_at(kin, y_all, p))
        burden = load(scatter, transfer, kin, basis, points, laws, p, dt)
        for k in range(support(basis, kin)):
            scattered(scatter, transfer, kin, basis, stencil, k, nodes, burden)
    tiling.report[t, 0] = furthest
    tiling.report[t, 1] = fastest
    tiling.report[t, 2] = wrong


@kernel
def _tiles_serial(gather, scatter, kin, basis, transfer, nodes, points, laws, tiling, x, y, dt):
    for t in range(tiling.colour[-1]):
        sweep_tile(gather, scatter, kin, basis, transfer, nodes, points, laws, tiling, x, y, dt, t)


@kernel(parallel=True)
def _tiles_threaded(gather, scatter, kin, basis, transfer, nodes, points, laws, tiling, x, y, dt):
    for c in range(tiling.colour.size - 1):
        for t in prange(tiling.colour[c], tiling.colour[c + 1]):
            sweep_tile(
                gather, scatter, kin, basis, transfer, nodes, points, laws, tiling, x, y, dt, t
            )


@point_function()
def sweep_tiles(mode, gather, scatter, kin, basis, transfer, nodes, points, laws, tiling, x, y, dt):
    """Sweep over the points of one block: from the positions `x` to the positions `y`."""


@sweep_tiles.on(Serial)
def _(mode, gather, scatter, kin, basis, transfer, nodes, points, laws, tiling, x, y, dt):
    _tiles_serial(gather, scatter, kin, basis, transfer, nodes, points, laws, tiling, x, y, dt)


@sweep_tiles.on(Threaded)
def _(mode, gather, scatter, kin, basis, transfer, nodes, points, laws, tiling, x, y, dt):
    _tiles_threaded(gather, scatter, kin, basis, transfer, nodes, points, laws, tiling, x, y, dt)


@kernel
def visit_span(task, kin, nodes, spans, dt, s):
    """Do `task` at the nodes of the s-th span."""
    for n in range(spans[s, 0], spans[s, 1]):
        at_node(task, kin, nodes, index(n), dt)


@kernel
def _spans_serial(task, kin, nodes, spans, dt):
    for s in range(1, 1 + spans[0, 0]):
        visit_span(task, kin, nodes, spans, dt, s)


@kernel(parallel=True)
def _spans_threaded(task, kin, nodes, spans, dt):
    for s in prange(1, 1 + spans[0, 0]):
        visit_span(task, kin, nodes, spans, dt, s)


@point_function()
def sweep_nodes(mode, task, kin, nodes, spans, dt):
    """Do `task` at every node in use."""


@sweep_nodes.on(Serial)
def _(mode, task, kin, nodes, spans, dt):
    _spans_serial(task, kin, nodes, spans, dt)


@sweep_nodes.on(Threaded)
def _(mode, task, kin, nodes, spans, dt):
    _spans_threaded(task, kin, nodes, spans, dt)
