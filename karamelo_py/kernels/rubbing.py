"""Friction of points on tools, point by point and in double precision."""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import kernel
from karamelo_py.kernels.arrays import vector_at
from karamelo_py.points.bodies import FrictionMemory, along, rub
from karamelo_py.points.kinematics import zero_vector


class Rubbing(NamedTuple):
    normal: np.ndarray  # (n, d) unit
    load: np.ndarray  # (n,)
    pull: np.ndarray  # (n, d) force due to the stretch of springs in the step
    stop: np.ndarray  # (n, d) force that would stop the slip


def rubbed(mu, load, hold, stop, at):
    """Return the friction (d,) on a point, and update its contact history ``at`` = (grip, row)."""
    (grip, i), d = at, len(hold)
    memory = FrictionMemory(hold, grip[i, d], grip[i, d + 1])
    force, (hold, mean, unused) = rub(mu, load, memory, stop)
    for k in range(d):
        grip[i, k] = hold[k]
    grip[i, d], grip[i, d + 1] = mean, unused
    return force


@kernel
def rub_points(kin, mu, rubbing, grip, force):
    """Add the friction of n points to `force` (n, d); update `grip` (n, d + 2)."""
    normal, load, pull, stop = rubbing
    d, none = kin.dimension, zero_vector(kin, 0.0)
    for i in range(load.size):
        n = vector_at(kin, normal, i, 0, none)
        hold = along(vector_at(kin, grip, i, 0, none) + vector_at(kin, pull, i, 0, none), n)
        stopping = along(vector_at(kin, stop, i, 0, none), n)
        friction = rubbed(mu, load[i], hold, stopping, (grip, i))
        for k in range(d):
            force[i, k] += friction[k]
