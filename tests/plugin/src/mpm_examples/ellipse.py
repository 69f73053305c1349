"""region ellipse."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import Positive
from karamelo_py.scene.region import Region


class Ellipse(Region):
    """An ellipse in the plane.

    Parameters
    ----------
    x, y
        Its centre.
    a, b
        Its half axes along x and y.

    Example
    -------
    region(egg, ellipse, 0, 0, 0.2, 0.1)
    """

    def __init__(
        self, hub, x: float, y: float, a: Annotated[float, Positive], b: Annotated[float, Positive]
    ):
        self.centre, self.half = np.array([x, y]), np.array([a, b])
        super().__init__(hub, self.centre - self.half, self.centre + self.half)

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Which of the positions (n, 3) lie in it, (n,)."""
        return (((x[:, :2] - self.centre) / self.half) ** 2).sum(axis=1) <= 1
