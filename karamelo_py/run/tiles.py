"""The grids cut into tiles: which points lie in which, and which nodes are in use."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from karamelo_py.compiler.lanes import lanes_for
from karamelo_py.kernels.arrays import Block, Setup, Tiling, arrays_of
from karamelo_py.kernels.nodes import ClearSums
from karamelo_py.kernels.sorting import order_in_tiles, order_points, widest
from karamelo_py.kernels.step import step_size
from karamelo_py.kernels.sweep import sweep_nodes
from karamelo_py.scene.lattice import Lattice

TILE_SIZES = {1: 32, 2: 8, 3: 4}
LEAST_DRIFT = 0.5  # cells; sorting more often would cost more than larger tiles do


def drift_limit(size: int, cells: float) -> float:
    """How many cells a point may be from where it was sorted before the points are sorted again.

    Tiles of one colour are one tile apart. A point that has drifted by `m` cells sees `cells` nodes
    more than those of one corner of its cell, so ``size + cells + 2 m <= 2 size`` keeps the nodes
    of two such tiles apart; a step may move a point by one cell more.
    """
    return min(2.0, (size - cells) / 2 - 1)


def tile_size(dimension: int, cells: float) -> int:
    """Cells of a tile per direction, for points that see `cells` nodes beyond one."""
    size = TILE_SIZES[dimension]
    while drift_limit(size, cells) < LEAST_DRIFT:
        size *= 2
    return size


class Tiles:
    """Sorts the points of a setup by tile; keeps the scratch that takes.

    Attributes
    ----------
    size
        Cells of a tile per direction. It grows when domains of points reach further.
    count
        Number of tiles, of all grids.
    used
        (count,) 1 where points are, 2 where they may give to nodes, else 0.
    """

    def __init__(self, lattices: Sequence[Lattice], basis: Any):
        self.lattices = list(lattices)
        self.dimension = lattices[0].dimension
        self.cells = type(basis).cells
        self.per_cell = type(basis).nodes_per_cell
        self.sorts = 0
        self.lay(tile_size(self.dimension, self.cells))

    def lay(self, size: int) -> None:
        """Cut the grids into tiles of `size` cells."""
        self.size = size
        nodes = size * self.per_cell
        shapes = [[-(-n // nodes) for n in x.shape[: self.dimension]] for x in self.lattices]
        self.shapes = np.array([shape + [1] * (3 - len(shape)) for shape in shapes], np.int64)
        counts = np.prod(self.shapes, axis=1)
        self.first = np.concatenate([[0], np.cumsum(counts)])
        self.count = int(self.first[-1])
        self.used = np.zeros(self.count, np.uint8)
        self._start = np.zeros(self.count + 1, np.int64)

    def empty_spans(self) -> np.ndarray:
        """Room for the spans of nodes in use, (1 + rows, 2): none is."""
        rows = 0
        last = self.dimension - 1
        for lattice, shape in zip(self.lattices, self.shapes, strict=True):
            lines = lattice.node_count // lattice.shape[last]
            rows += lines * ((int(shape[last]) + 1) // 2)
        return np.zeros((1 + rows, 2), np.int64)

    def empty_tiling(self) -> Tiling:
        """Room for the tiles of a block."""
        return Tiling(
            range=np.zeros((self.count + 1, 2), np.int64),
            colour=np.zeros(2**self.dimension + 1, np.int64),
            grid=np.zeros(self.count + 1, np.int64),
            report=np.zeros((self.count + 1, 3)),
        )

    def sort(self, s: Setup, mode: Any) -> None:
        """Sort all points by tile and find the nodes in use; all sums are zero then."""
        sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, step_size(s))
        self._make_room(s)
        self.used[:] = 0
        for block in s.blocks:
            self._sort_block(s, block)
        begin = end = 0
        for lattice, shape, first in zip(self.lattices, self.shapes, self.first, strict=False):
            end = self._find_nodes(lattice, shape, first, s.spans[1 + begin :]) + begin
            begin = end
        s.spans[0, 0] = end
        s.control.clock[0].drift = 0.0
        self.sorts += 1

    def _make_room(self, s: Setup) -> None:
        """Larger tiles where domains of points have come to reach far beyond them."""
        if not s.frame.moves:
            s.control.clock[0].drift_limit = np.inf  # nothing drifts: sorted once
            return
        cells = self.cells
        if s.blocks[0].points.x.shape[1] > self.dimension:
            now = s.control.clock[0].now
            points = (block.points for block in s.blocks)
            far = max(widest(s.kin, s.basis, s.grids, p.x[now], p.grid) for p in points)
            # Corners lie in cells of their own, on both sides.
            cells = max(cells, 2 * far + 2) if 0 < far < np.inf else cells
        size = max(self.size, tile_size(self.dimension, cells))
        if size != self.size:
            self.lay(size)
        s.control.clock[0].drift_limit = drift_limit(size, cells)

    def _sort_block(self, s: Setup, block: Block) -> None:
        points = block.points
        x = points.x[s.control.clock[0].now] if points.home is None else points.home
        tile, order = np.empty((2, x.shape[1]), np.int64)
        order_points(
            s.kin, s.grids, self.size, self.shapes, self.first, x, points.grid, self._start, tile,
            order,
        )  # fmt: skip
        ends = self._start[:-1]
        begins = np.concatenate([[0], ends[:-1]])
        occupied = np.flatnonzero(ends > begins)
        self.used[occupied] = 1
        width = lanes_for(8 * x.itemsize).width
        cells = np.empty((2, x.shape[1]), np.int64)
        bins = np.empty((2, self.size**self.dimension), np.int64)
        order_in_tiles(
            s.kin, s.grids, s.basis, self.size, points, x, begins[occupied], ends[occupied], width,
            bins, cells, order,
        )  # fmt: skip
        grid = np.searchsorted(self.first, occupied, side="right") - 1
        # Tiles of one colour have places of the same parity in every direction.
        colour = np.zeros(len(occupied), np.int64)
        place = occupied - self.first[grid]
        for axis in range(self.dimension - 1, -1, -1):
            place, along = np.divmod(place, self.shapes[grid, axis])
            colour |= along % 2 << axis
        by_colour = np.argsort(colour, kind="stable")
        tiling = block.tiling
        count = len(occupied)
        chosen = occupied[by_colour]
        tiling.range[:count] = np.stack([begins[chosen], ends[chosen]], axis=1)
        tiling.grid[:count] = grid[by_colour]
        tiling.colour[:] = np.searchsorted(np.sort(colour), np.arange(len(tiling.colour)))
        del tile, cells, bins  # their memory is needed again at once
        for _, array in arrays_of(points):
            # Component by component: a copy of a whole field would be the peak of the set-up.
            for k in np.ndindex(array.shape[:-1]):
                array[k] = array[k][order]

    def _find_nodes(
        self, lattice: Lattice, shape: np.ndarray, first: int, spans: np.ndarray
    ) -> int:
        """List the spans of a grid's nodes that points may reach before the next sort.

        A tile of nodes is in use when it or a neighbour holds points. Returns the number of spans.
        """
        count = int(np.prod(shape))
        mine = self.used[first : first + count]
        used = mine.reshape(shape) > 0
        for axis in range(self.dimension):
            ahead = np.moveaxis(used, axis, 0)
            wider = ahead.copy()
            wider[1:] |= ahead[:-1]
            wider[:-1] |= ahead[1:]
            used = np.moveaxis(wider, 0, axis)
        mine[(mine == 0) & used.ravel()] = 2
        # Rows of nodes run along the last direction; each lies in a line of tiles.
        last = self.dimension - 1
        size = self.size * self.per_cell
        lines = used.reshape(*shape[:last], shape[last])
        edges = np.diff(np.pad(lines, [(0, 0)] * last + [(1, 1)]).astype(np.int8), axis=last)
        *line, begin = np.nonzero(edges == 1)
        end = np.nonzero(edges == -1)[-1]
        begin, end = begin * size, np.minimum(end * size, lattice.shape[last])
        row = np.zeros(len(begin), np.int64)
        for axis, place in enumerate(line):
            # Each line of tiles holds `size` rows in every direction across it.
            nodes = (place[:, None] * size + np.arange(size)).ravel()
            inside = nodes < lattice.shape[axis]
            row, begin, end = (np.repeat(values, size)[inside] for values in (row, begin, end))
            row = row * lattice.shape[axis] + nodes[inside]
            for later in range(axis + 1, len(line)):
                line[later] = np.repeat(line[later], size)[inside]
        start = lattice.first + row * lattice.shape[last]
        spans[: len(row), 0] = start + begin
        spans[: len(row), 1] = start + end
        return len(row)
