"""The grid cut into tiles: which points lie in which, and which nodes are in use."""

from __future__ import annotations

from typing import Any

import numpy as np

from karamelo_py.kernels.arrays import DRIFT, NOW, Block, Setup, Tiling
from karamelo_py.kernels.sorting import order_points
from karamelo_py.kernels.stages import ClearSums
from karamelo_py.kernels.step import step_size
from karamelo_py.kernels.sweep import sweep_nodes

TILE_SIZES = {1: 32, 2: 8, 3: 4}


def tile_size(dimension: int, width: int) -> int:
    """Cells of a tile per direction, for a basis with `width` nodes a direction.

    Tiles of one colour are one tile apart. Points may have drifted by `m` cells and see
    ``width - 1`` nodes beyond their cell, so ``size + width - 1 + 2 m <= 2 size`` keeps the nodes
    of two such tiles apart; a step may move a point by one cell, and half a cell is for the time
    between two sorts.
    """
    size = TILE_SIZES[dimension]
    while drift_limit(size, width) < 0.5:
        size *= 2
    return size


def drift_limit(size: int, width: int) -> float:
    """How many cells a point may be from where it was sorted before the points are sorted again."""
    return min(2.0, (size - (width - 1)) / 2 - 1)


class Tiles:
    """Sorts the points of a setup by tile; keeps the scratch that takes.

    Attributes
    ----------
    size
        Cells of a tile per direction.
    shape
        Tiles per direction, (3,).
    count
        Number of tiles.
    used
        (count,) 1 where points are, 2 where they may give to nodes, else 0.
    """

    def __init__(self, nodes: tuple[int, int, int], dimension: int, width: int):
        self.nodes = nodes
        self.dimension = dimension
        self.size = tile_size(dimension, width)
        self.drift_limit = drift_limit(self.size, width)
        self.shape = tuple(-(-n // self.size) if k < dimension else 1 for k, n in enumerate(nodes))
        self.count = int(np.prod(self.shape))
        self.used = np.zeros(self.count, np.uint8)
        self.sorts = 0
        self._start = np.zeros(self.count + 1, np.int64)

    def empty_spans(self) -> np.ndarray:
        """Room for the spans of nodes in use, (1 + rows, 2): none is."""
        row_tiles = self.shape[self.dimension - 1]
        rows = self.count // row_tiles * self.size ** (self.dimension - 1) * ((row_tiles + 1) // 2)
        return np.zeros((1 + rows, 2), np.int64)

    def empty_tiling(self) -> Tiling:
        """Room for the tiles of a block."""
        return Tiling(
            range=np.zeros((self.count + 1, 2), np.int64),
            colour=np.zeros(2**self.dimension + 1, np.int64),
            report=np.zeros((self.count + 1, 3)),
        )

    def sort(self, s: Setup, mode: Any) -> None:
        """Sort all points by tile and find the nodes in use; all sums are zero then."""
        sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, step_size(s))
        self.used[:] = 0
        for block in s.blocks:
            self._sort_block(s, block)
        self._find_nodes(s.spans)
        s.control.real[DRIFT] = 0.0
        self.sorts += 1

    def _sort_block(self, s: Setup, block: Block) -> None:
        x = block.x[s.control.whole[NOW]]
        tile, order = np.empty((2, len(x)), np.int64)
        order_points(s.kin, s.basis, self.size, self.shape, x, self._start, tile, order)
        ends = self._start[:-1]
        begins = np.concatenate([[0], ends[:-1]])
        occupied = np.flatnonzero(ends > begins)
        self.used[occupied] = 1
        # Tiles of one colour have places of the same parity in every direction.
        places = np.unravel_index(occupied, self.shape)[: self.dimension]
        colour = sum(place % 2 << axis for axis, place in enumerate(places))
        by_colour = occupied[np.argsort(colour, kind="stable")]
        tiling = block.tiling
        tiling.range[: len(occupied)] = np.stack([begins[by_colour], ends[by_colour]], axis=1)
        tiling.colour[:] = np.searchsorted(np.sort(colour), np.arange(len(tiling.colour)))
        for field in (*block.x, *block.points, block.id):
            if field is not None:
                field[:] = field[order]

    def _find_nodes(self, spans: np.ndarray) -> None:
        """List the spans of nodes that points may reach before the next sort.

        A tile of nodes is in use when it or a neighbour holds points.
        """
        used = self.used.reshape(self.shape) > 0
        for axis in range(self.dimension):
            ahead = np.moveaxis(used, axis, 0)
            wider = ahead.copy()
            wider[1:] |= ahead[:-1]
            wider[:-1] |= ahead[1:]
            used = np.moveaxis(wider, 0, axis)
        self.used[(self.used == 0) & used.ravel()] = 2
        # Rows of nodes run along the last direction; each lies in a line of tiles.
        last = self.dimension - 1
        lines = used.reshape(*self.shape[:last], self.shape[last])
        edges = np.diff(np.pad(lines, [(0, 0)] * last + [(1, 1)]).astype(np.int8), axis=last)
        *line, begin = np.nonzero(edges == 1)
        end = np.nonzero(edges == -1)[-1]
        begin, end = begin * self.size, np.minimum(end * self.size, self.nodes[last])
        row = np.zeros(len(begin), np.int64)
        for axis, place in enumerate(line):
            # Each line of tiles holds `size` rows in every direction across it.
            nodes = (place[:, None] * self.size + np.arange(self.size)).ravel()
            inside = nodes < self.nodes[axis]
            row, begin, end = (np.repeat(values, self.size)[inside] for values in (row, begin, end))
            row = row * self.nodes[axis] + nodes[inside]
            for later in range(axis + 1, len(line)):
                line[later] = np.repeat(line[later], self.size)[inside]
        spans[0, 0] = len(row)
        spans[1 : 1 + len(row), 0] = row * self.nodes[last] + begin
        spans[1 : 1 + len(row), 1] = row * self.nodes[last] + end
