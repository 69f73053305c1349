"""Tiles cut into compact parts of nearly as much work each."""

import numpy as np


def bisected(places: np.ndarray, work: np.ndarray, parts: int, rows: float = 1) -> np.ndarray:
    """Cut tiles into parts: halves across the longest direction, and halves of these.

    After Berger, M. J. and Bokhari, S. H. (1987), "A partitioning strategy for nonuniform problems
    on multiprocessors", IEEE Transactions on Computers C-36, 570-580. Where the work of a layer of
    tiles has to be shared, it is cut across the next longest direction.

    Parameters
    ----------
    places
        (T, d) lower corners of the tiles.
    work
        (T,) in whole numbers; tiles without work fill the parts, wherever they lie.
    rows
        How many times as long as the others the last direction is to be where it is cut.
    """
    d = places.shape[1]
    least = np.append(np.ones(d - 1), rows)
    part = np.zeros(len(work), np.int64)
    left = [(np.arange(len(work)), 0, parts)]
    while left:
        tiles, first, count = left.pop()
        if count == 1:
            part[tiles] = first
            continue
        busy = places[tiles[work[tiles] > 0]]
        lengths = np.ptp(busy, axis=0) if len(busy) else np.ones(d)
        # The longest last; of equal ones that whose neighbours are furthest apart in memory.
        long = np.argsort(-lengths / least, kind="stable")[::-1]
        tiles = tiles[np.lexsort([places[tiles, k] for k in long])]
        ends = np.cumsum(work[tiles])
        half = count // 2
        # A tile is of the one that has its middle.
        cut = np.searchsorted(ends - 0.5 * work[tiles], ends[-1:].sum() * (half / count))
        left += [(tiles[:cut], first, half), (tiles[cut:], first + half, count - half)]
    return part
