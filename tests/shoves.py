"""Functions for fix python that remember nothing."""

import numpy as np


def push(points):
    """Push as far as points have gone."""
    points.force[:, 0] += points.mass * np.sin(points.position[:, 0])
    return points.force.sum(axis=0)


def brake(nodes):
    """Brake the nodes."""
    nodes.velocity_update[:] *= 0.9
    return float(np.abs(nodes.velocity_update).sum())
