"""What a picture needs to know of points, of some of them after others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np

MARKS = 1 << 16  # points that are drawn together
# A circle of this diameter has the area of a unit square.
ROUND = np.sqrt(4 / np.pi)


class Extent(NamedTuple):
    """What points fill.

    Attributes
    ----------
    count
        How many there are.
    lo, hi
        (3,) corners around their positions.
    ends
        The least and the largest finite value, (2,), or none, (0,).
    """

    count: int
    lo: np.ndarray
    hi: np.ndarray
    ends: np.ndarray


class Look(NamedTuple):
    """From where points are seen, and what shows of them.

    Attributes
    ----------
    view, middle
        (3, 3) directions to the right, upwards and towards the eye, around a place (3,); None for
        coordinates as they are.
    limits
        Values at the ends of the colours; None where values are shown as they are.
    lo, cell, shape
        A grid in space in which points are counted for what light falls on them; None without.
    kind
        The type of numbers that are passed on.
    """

    view: np.ndarray | None = None
    middle: np.ndarray | None = None
    limits: tuple[float, float] | None = None
    lo: np.ndarray | None = None
    cell: float = 0.0
    shape: tuple[int, ...] | None = None
    kind: type = np.float32

    @property
    def cells(self) -> int:
        """Number of cells for light."""
        return int(np.prod(self.shape))

    def cells_of(self, x: np.ndarray) -> np.ndarray:
        """(n,) the number of the cell of each point at x (n, 3)."""
        at = tuple(((x - self.lo) / self.cell).astype(int).T + 2)
        return np.ravel_multi_index(at, self.shape)

    def marks(self, ids: np.ndarray, x: np.ndarray, values: np.ndarray) -> tuple:
        """Keys (n,) in whose order points at x (n, 3) are drawn, and rows of what shows.

        Rows are the places on paper, a value, and the cell where there is light. Order is from far
        to near, and by id.
        """
        keys = ids.astype(np.int64)
        places = x
        if self.view is not None:
            places = (x - self.middle) @ self.view.T
            bits = places[:, 2].astype(np.float32).view(np.int32).astype(np.int64)
            # Those of negative numbers are in the order of their magnitudes.
            keys |= np.where(bits < 0, -0x80000000 - bits, bits) << 32
        if self.limits is not None:
            values = (values - self.limits[0]) / (self.limits[1] - self.limits[0])
        rows = [*places.T[:2], values]
        if self.shape is not None:
            rows.append(self.cells_of(x))
        return keys, np.array(rows, self.kind)


class Seen(Protocol):
    """Points that a picture asks."""

    side: float  # of a typical point

    def extent(self) -> Extent:
        """What they fill."""

    def counts(self, look: Look) -> np.ndarray:
        """How many there are in each cell."""

    def marks(self, look: Look) -> Iterator[np.ndarray]:
        """Rows (k, n) of what shows of them, so many at a time, in the order of drawing."""


class AtHand:
    """Points whose arrays are there: x (n, 3), values (n,)."""

    def __init__(self, x: np.ndarray, values: np.ndarray, side: float):
        self.x, self.values, self.side = x, values, side

    def extent(self) -> Extent:
        """What they fill."""
        return joined([extent(self.x, self.values)])

    def counts(self, look: Look) -> np.ndarray:
        """How many there are in each cell."""
        return np.bincount(look.cells_of(self.x), minlength=look.cells)

    def marks(self, look: Look) -> Iterator[np.ndarray]:
        """Rows of what shows of them."""
        keys, rows = look.marks(np.arange(len(self.x)), self.x, self.values)
        yield from in_pieces([rows[:, np.argsort(keys)]])


def extent(x: np.ndarray, values: np.ndarray) -> Extent | None:
    """What points at x (n, 3) with such values fill, if there are any."""
    if not len(x):
        return None
    finite = values[np.isfinite(values)]
    ends = np.array([finite.min(), finite.max()]) if len(finite) else np.empty(0)
    return Extent(len(x), x.min(axis=0), x.max(axis=0), ends)


def joined(parts: list[Extent | None]) -> Extent:
    """What all parts fill together."""
    found = [part for part in parts if part is not None]
    if not found:
        return Extent(0, np.zeros(3), np.zeros(3), np.empty(0))
    counts, lows, highs, ends = zip(*found, strict=True)
    of_all = np.concatenate(ends)
    ends_of_all = np.array([of_all.min(), of_all.max()]) if len(of_all) else of_all
    return Extent(sum(counts), np.min(lows, axis=0), np.max(highs, axis=0), ends_of_all)


def in_pieces(found: Iterable[np.ndarray]) -> Iterator[np.ndarray]:
    """Rows (k, n) cut anew: pictures are the same bytes however many came together."""
    rest = None
    for rows in found:
        rows = rows if rest is None else np.concatenate([rest, rows], axis=1)
        cuts = [*range(0, rows.shape[1], MARKS), rows.shape[1]]
        for begin, end in pairwise(cuts[:-1]):
            yield rows[:, begin:end]
        rest = rows[:, cuts[-2] :] if len(cuts) > 1 else rows
    if rest is not None and rest.shape[1]:
        yield rest
