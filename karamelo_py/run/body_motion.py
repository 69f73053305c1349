"""Motion of each solid, from sums over its points."""

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from karamelo_py.kernels.totals import LIMBS, add_all, values_of
from karamelo_py.run.boxes import unique
from karamelo_py.run.state import SceneState


class BodyMotion(NamedTuple):
    number: int
    mass: float
    centre: np.ndarray  # (d,) centre of mass
    velocity: np.ndarray  # (d,) velocity of the centre of mass
    spread: np.ndarray  # (d, d) sum m X X, where X is the position relative to the centre
    shear: np.ndarray  # (d, d) sum m X V, with velocities V relative to the centre
    low: np.ndarray  # (d,) corners of the bounding box: low, high
    high: np.ndarray
    slow: np.ndarray  # (d,) extreme velocity components: slow, fast
    fast: np.ndarray

    @property
    def size(self) -> float:
        return float((self.high - self.low).max()) / 2

    def drift(self, free: int) -> np.ndarray:
        return np.where(np.arange(len(self.velocity)) < free, 0.0, self.velocity)

    @property
    def turning(self) -> np.ndarray:
        """Angular velocity (3,), I^-1 L, but 0 about an axis on which all points lie."""
        spread, shear = np.zeros((2, 3, 3))
        d = len(self.centre)
        spread[:d, :d], shear[:d, :d] = self.spread, self.shear
        inertia, skew = np.trace(spread) * np.eye(3) - spread, shear - shear.T
        momentum = np.array([skew[1, 2], skew[2, 0], skew[0, 1]])
        return np.linalg.pinv(inertia, rcond=1e-9, hermitian=True) @ momentum

    @property
    def spin(self) -> float:
        return float(np.linalg.norm(self.turning))

    @property
    def reach(self) -> float:
        """Largest distance from the rotation axis to the ellipsoid in the bounding box."""
        w, half = self.turning, np.zeros(3)
        half[: len(self.centre)] = (self.high - self.low) / 2
        across = np.dot(w, w) * np.eye(3) - np.outer(w, w)
        return float(np.linalg.norm(across * half, 2)) / (np.dot(w, w) or 1.0)

    @property
    def rate(self) -> float:
        """Largest principal rate of stretch, from a least-squares fit of the velocity gradient."""
        gradient = np.linalg.lstsq(self.spread, self.shear, rcond=None)[0]
        return float(np.abs(np.linalg.eigvalsh(gradient + gradient.T)).max()) / 2


def motions(simulation: SceneState) -> list[BodyMotion]:
    d, count = simulation.kin.dimension, len(simulation.hub.solids)
    limbs = np.zeros((count, 1 + 2 * d + 2 * d * d, LIMBS), np.int64)
    ends = np.full((count, 4 * d), -np.inf)
    for k, m, x, v in _pieces(simulation, d):
        xv = np.concatenate([x, v])
        terms = [m, *(m * a for a in xv), *(m * a * b for a, b in product(x, xv))]
        add_all(limbs[k], np.array(terms))
        ends[k] = np.maximum(ends[k], np.concatenate([xv.max(axis=1), -xv.min(axis=1)]))
    comm = simulation.comm
    limbs, ends = comm.allreduce(limbs), comm.allreduce_max(ends)
    bodies = []
    for k, (sums_of_solid, end) in enumerate(zip(limbs, ends, strict=True)):
        mass, *sums = values_of(sums_of_solid).tolist()
        if not mass > 0:
            continue
        mean = np.array(sums[: 2 * d]) / mass
        moments = np.array(sums[2 * d :]).reshape(d, 2 * d) - mass * np.outer(mean[:d], mean)
        high, fast, low, slow = end.reshape(4, d) * [[1], [1], [-1], [-1]]
        about_centre = mean[:d], mean[d:], moments[:, :d], moments[:, d:]
        bodies.append(BodyMotion(k, mass, *about_centre, low, high, slow, fast))
    return bodies


def _pieces(simulation: SceneState, d: int) -> Iterator[tuple]:
    firsts = [solid.first_id for solid in simulation.hub.solids.values()]
    for block, rows in simulation.points.rows_of(None):
        points = block.points
        solid = np.searchsorted(firsts, points.id[rows], side="right") - 1
        for k in unique(solid):
            here = rows[solid == k]
            x, v = points.x[simulation.now][:d, here], points.v[:, here]
            yield k, *(a.astype(float) for a in (points.mass[here], x, v))
