"""Positions and motion of the solids of a scene: sums over their points, without the points."""

from collections.abc import Iterator
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.kernels.totals import LIMBS, add_all, rounded
from karamelo_py.output.fields import PIECE
from karamelo_py.run.tiles.unique import unique


class BodyMotion(NamedTuple):
    """Motion of a solid with points.

    Attributes
    ----------
    number
        Of the solid among those of the scene.
    mass
        Its mass.
    centre, velocity
        (d,) Of the centre of mass.
    spread
        (d, d) sum m X X, with X from the centre.
    shear
        (d, d) sum m X V, with X and V from those of the centre.
    low, high, slow, fast
        (d,) Least and largest coordinates and velocities of points.
    """

    number: int
    mass: float
    centre: np.ndarray
    velocity: np.ndarray
    spread: np.ndarray
    shear: np.ndarray
    low: np.ndarray
    high: np.ndarray
    slow: np.ndarray
    fast: np.ndarray

    @property
    def size(self) -> float:
        """Half of the longest side of the box around it."""
        return float((self.high - self.low).max()) / 2

    def drift(self, axisymmetric: bool) -> np.ndarray:
        """(d,) Velocity of the body as a whole: along the radius it has none."""
        return np.array([0.0, self.velocity[1]]) if axisymmetric else self.velocity

    @property
    def turning(self) -> np.ndarray:
        """(3,) Angular velocity, I^-1 L; a body without extent across an axis has none about it."""
        spread, shear = np.zeros((2, 3, 3))
        d = len(self.centre)
        spread[:d, :d], shear[:d, :d] = self.spread, self.shear
        inertia, skew = np.trace(spread) * np.eye(3) - spread, shear - shear.T
        momentum = np.array([skew[1, 2], skew[2, 0], skew[0, 1]])
        return np.linalg.pinv(inertia, rcond=1e-9, hermitian=True) @ momentum

    @property
    def spin(self) -> float:
        """Angular velocity."""
        return float(np.linalg.norm(self.turning))

    @property
    def reach(self) -> float:
        """Largest distance, from the axis that it turns about, of an ellipsoid in its box."""
        w, half = self.turning, np.zeros(3)
        half[: len(self.centre)] = (self.high - self.low) / 2
        across = np.dot(w, w) * np.eye(3) - np.outer(w, w)
        return float(np.linalg.norm(across * half, 2)) / (np.dot(w, w) or 1.0)

    @property
    def rate(self) -> float:
        """Largest stretching of the gradient that is nearest to the velocities of all points."""
        gradient = np.linalg.lstsq(self.spread, self.shear, rcond=None)[0]
        return float(np.abs(np.linalg.eigvalsh(gradient + gradient.T)).max()) / 2


def motions(simulation: Any) -> list[BodyMotion]:
    """Measure how all solids with points move; all processes know it.

    Each looks at its own points, so many at a time; sums are without rounding.
    """
    d, count = simulation.kin.dimension, len(simulation.hub.solids)
    limbs = np.zeros((count, 1 + 2 * d + 2 * d * d, LIMBS), np.int64)
    ends = np.full((count, 4 * d), -np.inf)
    for k, m, x, v in _pieces(simulation, d):
        xv = np.concatenate([x, v])
        terms = [m, *(m * a for a in xv), *(m * a * b for a, b in product(x, xv))]
        for row, values in enumerate(terms):
            add_all(limbs[k], row, values)
        ends[k] = np.maximum(ends[k], np.concatenate([xv.max(axis=1), -xv.min(axis=1)]))
    limbs, ends = simulation.of_all(limbs), simulation.most(ends)
    found = []
    for k, (own, end) in enumerate(zip(limbs, ends, strict=True)):
        mass, *sums = map(rounded, own)
        if not mass > 0:
            continue
        mean = np.array(sums[: 2 * d]) / mass
        moments = np.array(sums[2 * d :]).reshape(d, 2 * d) - mass * np.outer(mean[:d], mean)
        high, fast, low, slow = end.reshape(4, d) * [[1], [1], [-1], [-1]]
        found.append(
            BodyMotion(
                k, mass, mean[:d], mean[d:], moments[:, :d], moments[:, d:], low, high, slow, fast
            )
        )
    return found


def _pieces(simulation: Any, d: int) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
    """Number of a solid, masses (n,), places and velocities (d, n) of some of its points."""
    firsts = [solid.first_id for solid in simulation.hub.solids.values()]
    for block in simulation.setup.blocks:
        points = block.points
        for begin in range(0, len(points.id), PIECE):
            own = slice(begin, begin + PIECE)
            solid = np.searchsorted(firsts, points.id[own], side="right") - 1
            for k in unique(solid):
                here = solid == k
                x, v = points.x[simulation.now, :d, own], points.v[:, own]
                yield k, *(a[..., here].astype(float) for a in (points.mass[own], x, v))
