"""Finds where a plane of cases changes, with few runs: a search by halves in two directions."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from itertools import pairwise
from math import ceil

Cell = tuple[int, int]


def explore(
    shape: tuple[int, int],
    classify: Callable[[Sequence[Cell]], Sequence[Hashable]],
    stride: int = 5,
) -> tuple[dict[Cell, Hashable], dict[Cell, Hashable]]:
    """The class of every cell of a plane, most of them by inference.

    The plane is cut into blocks of about `stride` cells. A block whose corners are of one class is
    taken to be of that class throughout; any other is halved along its longer side, until it has
    no inner cells. So edges are found to the cell, and what lies wholly inside a block is missed.

    Parameters
    ----------
    shape
        Number of cells along each direction.
    classify
        Gives the classes of cells; it is asked for all corners of a generation at once.
    stride
        Cells between corners of the first blocks.

    Returns
    -------
    known, inferred
        Classes of the cells that were asked for, and of the others.
    """
    known: dict[Cell, Hashable] = {}
    lines = [_cuts(count, stride) for count in shape]
    blocks = [
        (i0, i1, j0, j1)
        for i0, i1 in _spans(lines[0])
        for j0, j1 in _spans(lines[1])
    ]  # fmt: skip
    inferred: dict[Cell, Hashable] = {}
    while blocks:
        corners = {(i, j) for i0, i1, j0, j1 in blocks for i in (i0, i1) for j in (j0, j1)}
        unknown = sorted(corners - known.keys())
        if unknown:
            known.update(zip(unknown, classify(unknown), strict=True))
        halves = []
        for i0, i1, j0, j1 in blocks:
            classes = {known[i, j] for i in (i0, i1) for j in (j0, j1)}
            if len(classes) == 1:
                found = classes.pop()
                for i in range(i0, i1 + 1):
                    for j in range(j0, j1 + 1):
                        inferred.setdefault((i, j), found)
            elif i1 - i0 > 1 and i1 - i0 >= j1 - j0:
                middle = (i0 + i1) // 2
                halves += [(i0, middle, j0, j1), (middle, i1, j0, j1)]
            elif j1 - j0 > 1:
                middle = (j0 + j1) // 2
                halves += [(i0, i1, j0, middle), (i0, i1, middle, j1)]
        blocks = halves
    return known, {cell: found for cell, found in inferred.items() if cell not in known}


def _cuts(count: int, stride: int) -> list[int]:
    pieces = max(1, ceil((count - 1) / stride))
    return sorted({round(k * (count - 1) / pieces) for k in range(pieces + 1)})


def _spans(cuts: Sequence[int]) -> list[tuple[int, int]]:
    return list(pairwise(cuts)) or [(0, 0)]
