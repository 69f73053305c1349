"""Drift of a conserved quantity from its first value."""

import numpy as np


class Drift:
    """|value - first value|, relative to the largest scale there has been so far."""

    remembers = ("_first", "_scale")

    def __init__(self) -> None:
        self._first: np.ndarray | None = None
        self._scale = 0.0

    def __call__(self, value: np.ndarray | float, scale: float) -> float:
        """The drift now; `scale` is a size that the value could have, above 0."""
        value = np.atleast_1d(np.asarray(value, float))
        if self._first is None:
            self._first = value
        self._scale = max(self._scale, scale)
        distance = float(np.linalg.norm(value - self._first))
        return distance / self._scale if self._scale > 0 else distance
