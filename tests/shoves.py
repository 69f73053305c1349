"""Functions for fix python that remember nothing."""

import threading

import numpy as np


def push(points):
    """Push as far as points have gone."""
    points.force[:, 0] += points.mass * np.sin(points.position[:, 0])
    return points.force.sum(axis=0)


def brake(nodes):
    """Brake the nodes."""
    nodes.velocity_update[:] *= 0.9
    return float(np.abs(nodes.velocity_update).sum())


def sway(view):
    """Points or nodes are a bit faster where they are high."""
    view.velocity[:, 0] *= 1 + 0.01 * np.sin(9 * view.position[:, 1])
    return view.velocity.sum(axis=0)


def sway_alone(view):
    """The same for each point or node on its own."""
    view.velocity[:, 0] *= 1 + 0.01 * np.sin(9 * view.position[:, 1])
    return view.total(view.velocity)


sway_alone.point_by_point = True


def warm(view):
    """Nodes are a bit warmer where they are far, or points are heated there."""
    far = 1 + 0.01 * np.sin(9 * view.position[:, 0])
    if hasattr(view, "heat_supply"):
        view.heat_supply[:] += far
    else:
        view.velocity[:, 0] *= far


def carry(points):
    """Points go a bit further at the start of each step, by themselves, some beyond their tile."""
    points.position[:, 0] += 0.02 * (1 + np.sin(9 * points.position[:, 1]))


def _is_second():
    return threading.current_thread().name == "rank 1"  # see comms.py


def is_silent(points):
    """What one process answers, and another does not."""
    return None if _is_second() else 1


def differs(points):
    """What is another number on each process."""
    return 0.1 + _is_second()


def asks(points):
    """What asks for a total on one process."""
    return points.total(points.mass) if _is_second() else 1.0


for function in (asks, is_silent, differs):
    function.point_by_point = True
