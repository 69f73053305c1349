"""The two loops: over points (gather, settle, scatter) and over nodes in use.

Points are visited tile by tile and colour by colour. Tiles of one colour never touch the same
node, so threads need no atomics; the sums of a node are made in the order of colours, tiles and
points, whatever the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

from numba import prange

from karamelo_py.compiler.compile import index, kernel, point_function
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.stages import (
    Work,
    at_node,
    empty,
    gathered,
    load,
    place_at,
    restencil,
    scattered,
    settled,
)
from karamelo_py.points.basis import locate, support
from karamelo_py.points.kinematics import vector_at
from karamelo_py.points.laws import assemble, separate


class Serial(NamedTuple):
    """One thread."""


class Threaded(NamedTuple):
    """All threads that Numba was given."""


@kernel
def sweep_tile(
    gather, scatter, frame, kin, basis, grids, transfer, nodes, points, laws, tiling, places, dt, t
):
    """Visit the points of the t-th occupied tile of a block."""
    grid = record(grids, tiling.grid[t])
    w = Work(frame, kin, basis, grid, transfer, nodes, points, laws, places)
    furthest = dt - dt
    fastest = dt - dt
    wrong = 0
    for q in range(tiling.range[t, 0], tiling.range[t, 1]):
        p = index(q)
        x = vector_at(kin, places.x, p)
        stencil = locate(basis, kin, grid, place_at(basis, kin, places.where, p))
        total = empty(gather, w, x)
        for k in range(support(basis, kin)):
            total = gathered(gather, w, stencil, k, total)
        moved, rate = settled(gather, w, stencil, p, dt, total, fastest)
        if not (moved <= 1 and rate < 1e300):  # so written, NaN counts as wrong too
            wrong = q + 1
            continue
        furthest = max(furthest, moved)
        fastest = rate
        stencil = restencil(scatter, w, stencil, p)
        burden = load(scatter, w, p, dt)
        for k in range(support(basis, kin)):
            scattered(scatter, w, stencil, k, burden)
    tiling.report[t, 0] = furthest
    tiling.report[t, 1] = fastest
    tiling.report[t, 2] = wrong


@kernel
def _tiles_serial(
    gather, scatter, frame, kin, basis, grids, transfer, nodes, points, laws, tiling, places, dt
):
    for t in range(tiling.colour[-1]):
        sweep_tile(
            gather, scatter, frame, kin, basis, grids, transfer, nodes, points, laws, tiling,
            places, dt, t,
        )  # fmt: skip


@kernel(parallel=True)
def _tiles_threaded(
    gather, scatter, frame, kin, basis, grids, transfer, nodes, points, law, first, second, third,
    fourth, fifth, tiling, places, dt,
):  # fmt: skip
    for c in range(tiling.colour.size - 1):
        for t in prange(tiling.colour[c], tiling.colour[c + 1]):
            laws = assemble(law, first, second, third, fourth, fifth)
            sweep_tile(
                gather, scatter, frame, kin, basis, grids, transfer, nodes, points, laws, tiling,
                places, dt, t,
            )  # fmt: skip


@point_function()
def sweep_tiles(mode, gather, scatter, s, block, places, dt):
    """Sweep over the points of one block of the setup `s`."""


@sweep_tiles.on(Serial)
def _(mode, gather, scatter, s, block, places, dt):
    _tiles_serial(
        gather, scatter, s.frame, s.kin, s.basis, s.grids, s.transfer, s.nodes, block.points,
        block.laws, block.tiling, places, dt,
    )  # fmt: skip


@sweep_tiles.on(Threaded)
def _(mode, gather, scatter, s, block, places, dt):
    law, parts = separate(block.laws)
    _tiles_threaded(
        gather, scatter, s.frame, s.kin, s.basis, s.grids, s.transfer, s.nodes, block.points, law,
        parts[0], parts[1], parts[2], parts[3], parts[4], block.tiling, places, dt,
    )  # fmt: skip


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
