"""Search for the boxes that may hold a position, filed in the cells of a coarse grid."""

from collections.abc import Iterator

import numpy as np

# Boxes are filed in so many cells on average at most; larger ones make the cells larger.
_MOST = 32


class Bins:
    """Boxes, filed so that the few that may hold a position are found at once.

    Parameters
    ----------
    lo, hi
        Corners of the boxes, (m, d).
    """

    def __init__(self, lo: np.ndarray, hi: np.ndarray):
        count, d = lo.shape
        self.lo, self.hi = lo.min(axis=0), hi.max(axis=0)
        extent = np.maximum(self.hi - self.lo, np.finfo(float).tiny)
        # As many cells as boxes, more or less.
        size = max((extent.prod() / count) ** (1 / d), extent.max() / count)
        while True:
            self.size = size
            self.cells = np.maximum(1, np.ceil(extent / size)).astype(np.int64)
            first, last = self._index(lo), self._index(hi)
            spans = last - first + 1
            filed = spans.prod(axis=1)
            if filed.sum() <= _MOST * count:
                break
            size *= 1.5
        self.first, self.items = self._file(first, spans, filed)

    def _index(self, x: np.ndarray) -> np.ndarray:
        return np.clip(((x - self.lo) / self.size).astype(np.int64), 0, self.cells - 1)

    def _number(self, index: np.ndarray) -> np.ndarray:
        number = index[:, 0].copy()
        for axis in range(1, index.shape[1]):
            number = number * self.cells[axis] + index[:, axis]
        return number

    def _file(self, first, spans, filed) -> tuple[np.ndarray, np.ndarray]:
        """Boxes in the order of cells, and where those of each cell begin."""
        box = np.repeat(np.arange(len(filed)), filed)
        place = np.arange(len(box)) - np.repeat(np.cumsum(filed) - filed, filed)
        index = np.empty((len(box), spans.shape[1]), np.int64)
        for axis in range(spans.shape[1] - 1, -1, -1):
            place, along = np.divmod(place, spans[box, axis])
            index[:, axis] = first[box, axis] + along
        number = self._number(index)
        order = np.argsort(number, kind="stable")
        begin = np.searchsorted(number[order], np.arange(int(self.cells.prod()) + 1))
        return begin, box[order]

    def candidates(
        self, x: np.ndarray, done: np.ndarray | None = None
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Pairs of positions and boxes that may hold them: rows of `x` (k,) and boxes (k,).

        Each batch names a position once. Positions that `done` (n,) marks meanwhile are left out.
        """
        rows = np.flatnonzero(((x >= self.lo) & (x <= self.hi)).all(axis=1))
        cell = self._number(self._index(x[rows]))
        place, end = self.first[cell], self.first[cell + 1]
        while True:
            kept = place < end
            if done is not None:
                kept &= ~done[rows]
            rows, place, end = rows[kept], place[kept], end[kept]
            if not len(rows):
                return
            yield rows, self.items[place]
            place = place + 1
