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


def carry(points):
    """Points go a bit further at the start of each step, by themselves, some beyond their tile."""
    points.position[:, 0] += 0.02 * (1 + np.sin(9 * points.position[:, 1]))
