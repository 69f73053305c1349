"""Forecasts of the next finer runs: errors by their order, times by steps and points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from karamelo_py.app.studies.curves import column, order, usable


@dataclass(frozen=True)
class Forecast:
    """Forecast of a run that has not been made.

    Attributes
    ----------
    error, low, high
        The error as it is expected, and between which bounds.
    cost
        What it will cost.
    """

    error: float
    low: float
    high: float
    cost: float


def forecast(
    x: float, xs: Sequence[float], rows: Sequence[Mapping[str, Any]], accuracy: str, cost: str
) -> Forecast | None:
    """Expect a run at `x` from the runs at `xs`, coarse ones first.

    The error goes on with the order between the last two. Its bounds are those of the least and the
    largest order so far, at least a third of the expected order away; an order that has fallen may
    fall by as much again. The time is steps times
    (a + b points), fitted to the runs; any other cost goes on as between the last two.

    Returns
    -------
    Forecast or None
        None where fewer than two runs have an error, or the last one got worse.
    """
    xs = np.asarray(xs, float)
    error = column(rows, accuracy)
    good = np.isfinite(error) & (error > 0)
    if good.sum() < 2 or not good[-1]:
        return None
    xs, error = xs[good], error[good]
    rows = [row for row, is_good in zip(rows, good, strict=True) if is_good]
    local = np.diff(np.log(error)) / np.diff(np.log(xs))
    # Signs such that finer means a larger way.
    way = abs(np.log(x / xs[-1]))
    fall = local * np.sign(np.diff(np.log(xs)))
    if fall[-1] >= 0:
        return None
    expected = -fall[-1]
    rates = [-f for f in fall if f < 0]
    # An order that falls may go on falling.
    drop = max(-fall[-2] - expected, 0.0) if len(fall) > 1 else 0.0
    slow = max(min(*rates, 2 / 3 * expected, expected - drop), 0.0)
    fast = max(*rates, 4 / 3 * expected)
    at = [float(error[-1] * np.exp(-rate * way)) for rate in (expected, fast, slow)]
    return Forecast(*at, _cost(x, xs, rows, cost))


def _cost(x: float, xs: np.ndarray, rows: Sequence[Mapping[str, Any]], cost: str) -> float:
    values = column(rows, cost)
    if cost == "seconds" and all(usable(a) for a in values):
        steps, points = (np.array(column(rows, name), float) for name in ("steps", "points"))
        # Relative errors count alike; neither part of the time can be negative.
        matrix = np.stack([steps, steps * points], axis=1) / values[:, None]
        parts = np.linalg.lstsq(matrix, np.ones(len(values)), rcond=None)[0]
        if (parts < 0).any():
            best = int(np.argmax(parts))
            parts = np.zeros(2)
            parts[best] = 1 / np.mean(matrix[:, best])
        more = [_power(x, xs, of) for of in (steps, points)]
        return float(more[0] * (parts[0] + parts[1] * more[1]))
    return _power(x, xs, values)


def _power(x: float, xs: np.ndarray, values: np.ndarray) -> float:
    """A power law through the last two values."""
    exponent = order(xs[-2:], values[-2:]).exponent
    return float(values[-1] * (x / xs[-1]) ** (exponent if np.isfinite(exponent) else 0.0))
