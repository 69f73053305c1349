"""The tiles of a scene shared out among processes: who has which, and what they pass on.

Tiles are numbered grid after grid. Each process has all points in a range of numbers, so that one
process after another has the points in the order of a single one. Nodes that several reach are
summed by each of them, from the same boxes in the same order.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from karamelo_py.kernels.arrays import Block, Points, Setup, Tiling, arrays_of
from karamelo_py.run.crew import Crew
from karamelo_py.run.tiles import (
    Boxes,
    Tiles,
    between,
    buffers_of,
    chosen_of,
    ragged,
    rows_of,
    steps_of,
)
from karamelo_py.scene.lattice import Lattice

IMBALANCE = 1.1  # largest share of the points over the mean: above it they are shared out anew


class SharedTiles(Tiles):
    """Tiles of a process among others.

    Parameters
    ----------
    crew
        The processes.
    one_place
        Whether a node has others at its place, in grids that are alike: bodies in contact.
    """

    def __init__(
        self,
        crew: Crew,
        lattices: Sequence[Lattice],
        basis: Any,
        points: int,
        sparse: bool,
        *,
        one_place: bool,
    ):
        super().__init__(lattices, basis, points, sparse)
        self.crew = crew
        self.one_place = one_place
        self.cuts = np.full(crew.size + 1, self.count)
        self.cuts[0] = 0
        self.foreign = np.zeros(int(self._first_node[-1] + self._nodes[-1].prod()), np.uint8)
        self._marked = np.empty(0, np.int64)
        self.given: dict[int, np.ndarray] = {}  # rows of the buffers, by rank
        self._taken: dict[int, slice] = {}

    # --- points -----------------------------------------------------------------------------------

    def share_out(self, per_tile: np.ndarray) -> None:
        """Cut the tiles into ranges of nearly as many points each."""
        self.cuts[1:] = self.count
        if not self.direct:
            ends = np.cumsum(per_tile)
            parts = np.arange(1, self.crew.size) * ends[-1] / self.crew.size
            # A tile is of the one that has its middle.
            self.cuts[1:-1] = np.searchsorted(ends - 0.5 * per_tile, parts)

    def points_in(self, blocks: Iterable[Block]) -> np.ndarray:
        """Number of the points in each tile, of blocks that are sorted."""
        per_tile = np.zeros(self.count, np.int64)
        for block in blocks:
            np.add.at(per_tile, *occupied(block.tiling))
        return per_tile

    def migrate(self, s: Setup) -> Setup:
        """Hand over the points that have gone to the tiles of others."""
        tiles = [self._by_tile(s, block)[1] for block in s.blocks]
        here = sum(np.bincount(of, minlength=self.count) for of in tiles)
        per_tile = self.crew.added(here)
        shares = np.diff(np.append(0, np.cumsum(per_tile))[self.cuts])
        if shares.max() > IMBALANCE * shares.mean():
            self.share_out(per_tile)
        own = here[self.cuts[self.crew.rank] : self.cuts[self.crew.rank + 1]].sum()
        leaving = int(here.sum() - own)
        if self.crew.added(np.array([leaving]))[0] == 0:
            return s
        self.empty_nodes(s)
        gone: list[list] = [[] for _ in range(self.crew.size)]
        for block, of in zip(s.blocks, tiles, strict=True):
            to = np.searchsorted(self.cuts, of, side="right") - 1
            for rank, parts in enumerate(gone):
                chosen = np.flatnonzero(to == rank)
                parts.append([np.take(a, chosen, axis=-1) for _, a in arrays_of(block.points)])
        # What stays is not packed and unpacked.
        stay, gone[self.crew.rank] = gone[self.crew.rank], []
        come = self.crew.swapped(gone)
        come[self.crew.rank] = stay
        blocks = tuple(
            block._replace(points=joined(block.points, [parts[k] for parts in come]))
            for k, block in enumerate(s.blocks)
        )
        return s._replace(blocks=blocks)

    def _reach(self, s: Setup, block: Block, x: np.ndarray) -> float:
        return float(self.crew.largest(np.array([super()._reach(s, block, x)]))[0])

    # --- nodes ------------------------------------------------------------------------------------

    def _boxes(self, s: Setup) -> Boxes:
        own = super()._boxes(s)
        block = np.repeat(np.arange(len(s.blocks)), [b.tiling.count[0] for b in s.blocks])
        all_of = self.crew.everyone((block, own.grid, own.lo, own.hi))
        me = self.crew.rank
        ranks = [me, *(rank for rank in range(self.crew.size) if rank != me)]
        block, grid, lo, hi = (
            np.concatenate(part) for part in zip(*(all_of[rank] for rank in ranks), strict=True)
        )
        self._of = np.repeat(ranks, [len(all_of[rank][0]) for rank in ranks])
        order = np.empty(len(grid), np.int64)
        order[np.lexsort((self._of, block))] = np.arange(len(grid))
        return Boxes(order, grid, lo, hi)

    def _reached(self, boxes: Boxes) -> tuple[np.ndarray, ...]:
        box, tile, begin, end = super()._reached(boxes)
        of, place = self._of[box], self._place(tile)
        me = self.crew.rank
        self._first_of_place = np.full(int(self._first_of_nodes[-1]), self.crew.size)
        np.minimum.at(self._first_of_place, place, of)
        mine = np.isin(place, place[of == me])
        self._rows_for: dict[int, tuple[np.ndarray, ...]] = {}
        for rank in np.unique(of[mine]):
            if rank != me:
                both = (of == me) & np.isin(place, place[of == rank])
                self._rows_for[int(rank)] = _hulls(box[both], begin[both], end[both])
        return box[mine], tile[mine], begin[mine], end[mine]

    def _place(self, tile: np.ndarray) -> np.ndarray:
        """The number of the place of a tile of nodes."""
        return tile % int(self._first_of_nodes[1]) if self.one_place else tile

    def _number(self, s: Setup, boxes: Boxes, *reached: np.ndarray) -> tuple[np.ndarray, ...]:
        # Of others' boxes there are only the parts that reach nodes in use here.
        box, begin, end = reached
        other = self._of[box] != self.crew.rank
        lo, hi = boxes.lo.copy(), boxes.hi.copy()
        others = self._of != self.crew.rank
        lo[others], hi[others] = 0, -1
        found, lo[found], hi[found] = _hulls(box[other], begin[other], end[other])
        first, steps = super()._number(s, boxes._replace(lo=lo, hi=hi), *reached)
        if self.direct:
            return first, steps
        ends = np.append(0, np.cumsum(np.prod(hi - lo + 1, axis=1)))
        self._taken = {}
        for rank in np.unique(self._of[found]):
            has = np.flatnonzero(self._of == rank)
            self._taken[int(rank)] = slice(int(ends[has[0]]), int(ends[has[-1] + 1]))
        self.given = {
            rank: _rows(low, high, first[which], steps[which])
            for rank, (which, low, high) in self._rows_for.items()
        }
        return first, steps

    def _own_nodes(self, tiles: np.ndarray, own: np.ndarray) -> None:
        self.foreign[self._marked] = 0
        away = own[self._first_of_place[self._place(tiles)] != self.crew.rank]
        self._marked = between(*rows_of(away))
        self.foreign[self._marked] = 1

    def exchange(self, s: Setup, number: int, what: int) -> None:
        """Pass on what the own tiles give to nodes of others, and get what theirs give to own."""
        arrays = chosen_of(buffers_of(s)[number].nodes, what)
        width = sum(array.shape[1] for array in arrays)
        given = {
            rank: np.concatenate([array[rows] for array in arrays], axis=1)
            for rank, rows in self.given.items()
        }
        taken = {
            rank: np.empty((rows.stop - rows.start, width), arrays[0].dtype)
            for rank, rows in self._taken.items()
        }
        self.crew.passed(given, taken)
        for rank, rows in self._taken.items():
            first = 0
            for array in arrays:
                array[rows] = taken[rank][:, first : first + array.shape[1]]
                first += array.shape[1]


def occupied(tiling: Tiling) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the occupied tiles of a block, and how many points they have."""
    count = tiling.count[0]
    return tiling.number[:count], np.diff(tiling.range[:count], axis=1)[:, 0]


def sized(points: Points, count: int) -> Points:
    """Points of the kind of `points`, so many: these, where they are as many already."""
    if points.mass.size == count:
        return points
    empty = [np.empty((*a.shape[:-1], count), a.dtype) for _, a in arrays_of(points)]
    return joined(points, [empty])


def joined(points: Points, parts: list[list[np.ndarray]]) -> Points:
    """Points of the kind of `points` from the arrays that `arrays_of` has given, in parts."""
    arrays = (np.concatenate(same, axis=-1) for same in zip(*parts, strict=True))
    own = {
        name: None if array is None else next(arrays)
        for name, array in points._asdict().items()
        if name != "fields"
    }
    return Points(**own, fields=tuple(type(one)(next(arrays)) for one in points.fields))


def _hulls(box: np.ndarray, begin: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, ...]:
    """For each box that there is: the least and largest nodes of its parts (k, d)."""
    order = np.argsort(box, kind="stable")
    box, begin, end = box[order], begin[order], end[order]
    starts = np.flatnonzero(np.diff(box, prepend=-1))
    if not len(starts):
        return box, begin, end
    low, high = np.minimum.reduceat(begin, starts), np.maximum.reduceat(end, starts)
    return box[starts], low, high


def _rows(lo: np.ndarray, hi: np.ndarray, first: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Rows of the buffers of all nodes from `lo` to `hi` (k, d), box after box."""
    shape = hi - lo + 1
    box, left = ragged(np.prod(shape, axis=1))
    inner = steps_of(shape)[box]
    places = lo[box] + left[:, None] // inner % shape[box]
    return first[box] + (places * steps[box]).sum(axis=1)
