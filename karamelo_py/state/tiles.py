"""The grid cut into tiles: which points lie in which, and which nodes are in use."""

from __future__ import annotations

from typing import Any

import numpy as np

from karamelo_py.kernels.sorting import (
    find_nodes,
    list_tiles,
    order_points,
    reorder,
    reorder_scalars,
)
from karamelo_py.kernels.stages import ClearSums
from karamelo_py.kernels.step import step_size
from karamelo_py.kernels.sweep import sweep_nodes
from karamelo_py.state.arrays import DRIFT, NOW, Block, Setup, Tiling

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
        """Sort all points by tile and find the nodes in use; the sums of all nodes are zero then."""
        sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, step_size(s))
        self.used[:] = 0
        for block in s.blocks:
            self._sort_block(s, block)
        find_nodes(s.kin, self.size, self.shape, self.nodes, self.used, s.spans)
        s.control.real[DRIFT] = 0.0
        self.sorts += 1

    def _sort_block(self, s: Setup, block: Block) -> None:
        x = block.x[s.control.whole[NOW]]
        order = np.empty((2, len(x)), np.int64)
        order_points(s.kin, s.basis, self.size, self.shape, x, self._start, order)
        list_tiles(s.kin, self.shape, self._start, self.used, block.tiling)
        points = block.points
        fields = [block.x[0], block.x[1], points.v, points.state]
        if points.moment is not None:
            fields.append(points.moment)
        spare = np.empty((len(x), max(field.shape[1] for field in fields)), x.dtype)
        for field in fields:
            reorder(field, order[1], spare)
        reorder_scalars(points.mass, points.material, block.id, order[1], spare)
