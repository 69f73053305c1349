"""Finds where a plane of cases changes with few runs, by halves along rows and columns."""

from collections.abc import Callable, Hashable, Iterator, Sequence
from itertools import pairwise
from math import ceil

import numpy as np

Cell = tuple[int, int]
UNKNOWN = -1


def explore(
    shape: tuple[int, int],
    classify: Callable[[Sequence[Cell]], Sequence[Hashable]],
    stride: int = 6,
) -> tuple[dict[Cell, Hashable], dict[Cell, Hashable]]:
    """Find the class of every cell of a plane, most of them by inference.

    First lines and columns about `stride` cells apart are crossed. What lies in a row or a column
    between two cells of one class is taken to be like them, the nearest ones first; between unlike
    ones the middle is asked for, in the longest gaps first. Where an edge goes along a row, one in
    three of its cells is asked for, so that no bow of it is cut off. So edges are found to the
    cell; an island that lies wholly between the cells that were asked for is missed.

    `classify` gives the classes of cells; it is asked for several at once, none of which tells
    another. Returns the classes of those cells, and of the others.
    """
    classes: list[Hashable] = []  # those of the numbers in the planes
    known = np.full(shape, UNKNOWN)
    cells = [(i, j) for i in _cuts(shape[0], stride) for j in _cuts(shape[1], stride)]
    while cells:
        for cell, kind in zip(cells, classify(cells), strict=True):
            if kind not in classes:
                classes.append(kind)
            known[cell] = classes.index(kind)
        found = _filled(known, stride)
        cells = _apart([*_halves(found)] or [*_unproved(known, found)])
    asked = {cell: classes[k] for cell, k in np.ndenumerate(known) if k != UNKNOWN}
    return asked, {cell: classes[k] for cell, k in np.ndenumerate(found) if cell not in asked}


def unseen(shape: tuple[int, int], stride: int) -> int:
    """Count the cells across islands and strips that no run needs to meet."""
    return max((b - a - 1 for n in shape for a, b in pairwise(_cuts(n, stride))), default=0)


def _cuts(count: int, stride: int) -> list[int]:
    pieces = max(1, ceil((count - 1) / stride))
    return sorted({round(k * (count - 1) / pieces) for k in range(pieces + 1)})


def _gaps(line: np.ndarray) -> Iterator[tuple[int, int]]:
    """Neighbours in a line between which nothing is known."""
    return ((a, b) for a, b in pairwise(np.flatnonzero(line != UNKNOWN)) if b - a > 1)


def _filled(known: np.ndarray, stride: int) -> np.ndarray:
    """Fill in what lies between like cells; where row and column disagree, nothing."""
    found, reach = known.copy(), 2
    while reach <= stride:
        rows, columns = _between(found, reach), _between(found.T, reach).T
        agreed = np.where((rows == columns) | (columns == UNKNOWN), rows, columns)
        agreed[(rows != columns) & (np.minimum(rows, columns) != UNKNOWN)] = UNKNOWN
        new = (found == UNKNOWN) & (agreed != UNKNOWN)
        found[new] = agreed[new]
        reach = 2 if new.any() else reach + 1
    return found


def _between(plane: np.ndarray, reach: int) -> np.ndarray:
    """Fill each row between like cells at most `reach` apart."""
    said = np.full(plane.shape, UNKNOWN)
    for line, out in zip(plane, said, strict=True):
        for a, b in _gaps(line):
            if b - a <= reach and line[a] == line[b]:
                out[a + 1 : b] = line[a]
    return said


def _halves(found: np.ndarray) -> Iterator[tuple[int, Cell]]:
    """The middles of gaps in rows and columns, each with the length of its gap."""
    for i, line in enumerate(found):
        yield from ((b - a, (i, (a + b) // 2)) for a, b in _gaps(line))
    for j, line in enumerate(found.T):
        yield from ((b - a, ((a + b) // 2, j)) for a, b in _gaps(line))


def _unproved(known: np.ndarray, found: np.ndarray) -> Iterator[tuple[int, Cell]]:
    """The middles of stretches along an edge in which no cell is known, with their lengths."""
    for i, k in np.ndindex(found.shape[0] - 1, 2):
        for stretch in _stretches(known[i + k], found[i], found[i + 1], k):
            yield len(stretch), (i + k, stretch[len(stretch) // 2])
    for j, k in np.ndindex(found.shape[1] - 1, 2):
        for stretch in _stretches(known[:, j + k], found[:, j], found[:, j + 1], k):
            yield len(stretch), (stretch[len(stretch) // 2], j + k)


def _stretches(known: np.ndarray, near: np.ndarray, far: np.ndarray, which: int) -> list[list[int]]:
    """Find stretches longer than 1 where two lines differ and nothing is known of one of them."""
    line = (near, far)[which]
    stretches: list[list[int]] = [[]]
    for i in np.flatnonzero((near != far) & (known == UNKNOWN)):
        last = stretches[-1]
        if last and (i > last[-1] + 1 or line[i] != line[last[-1]]):
            stretches.append([])
        stretches[-1].append(int(i))
    return [stretch for stretch in stretches if len(stretch) > 1]


def _apart(wanted: list[tuple[int, Cell]]) -> list[Cell]:
    """Cells of the longest gaps, those left out that lie within half the gap of another."""
    chosen: list[tuple[int, Cell]] = []
    for size, (i, j) in sorted(wanted, key=lambda one: (-one[0], one[1])):
        if all(max(abs(i - k), abs(j - m)) > longer // 2 for longer, (k, m) in chosen):
            chosen.append((size, (i, j)))
    return [cell for _, cell in chosen]
