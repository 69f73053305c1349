"""Means of a log column over stretches of a run, by which it keeps, grows or falls."""

from math import ceil, inf

import numpy as np

from karamelo_py.kernels.watch import growth


def grown(first: float, later: float) -> float:
    """Growth from one mean to a later one, as a share of the first; NaN from nothing."""
    return growth(first, later, first) if first else np.nan


def ends(x: np.ndarray, y: np.ndarray, share: float) -> tuple[float, float]:
    """Means of a column `y` over the first and the last `share` of the way along `x`."""
    span = share * (x[-1] - x[0])
    return float(y[x <= x[0] + span].mean()), float(y[x >= x[-1] - span].mean())


def most(y: np.ndarray, share: float) -> tuple[float, float]:
    """Mean of the magnitude of a column over its first rows, a `share` of all, and the largest.

    From rest, where the first is 0, what is usual stands for it. Infinite where a row is NaN.
    """
    if not len(y):
        return 0.0, 0.0
    if not np.isfinite(y).all():
        return 0.0, inf
    rows = max(1, ceil(share * len(y)))
    means = np.convolve(np.abs(y), np.full(rows, 1 / rows), "valid")
    first = float(means[0]) or float(np.median(np.abs(y)))
    return first, float(means.max())
