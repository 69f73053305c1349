"""Blocks on slopes that lean to the grid, for `comparisons.defaults`."""

from math import cos, radians, sin

import numpy as np

from comparisons.defaults import Case
from comparisons.results import Result

G = 10.0


def acceleration(result: Result) -> float:
    """The acceleration along the slope, in the later half: the block bounces at first."""
    log = result.log
    late = log.Time >= log.Time[-1] / 2
    return float(np.polyfit(log.Time[late], log.along[late], 1)[0])


def friction(result: Result, angle: float, mu: float) -> float:
    """The error of the acceleration, with the normal force that the block really has.

    A block that bounces presses on the slope with m (g cos + dv_n/dt), and slides with mu times
    that, so v + mu v_n has the exact acceleration.
    """
    log, case = result.log, slope(angle, mu)
    late = log.Time >= log.Time[-1] / 2
    found = np.polyfit(log.Time[late], (log.along + mu * log.out)[late], 1)[0]
    return abs(case.error(float(found)))


def slope(angle: float, mu: float) -> Case:
    """The case of a slope of so many degrees and a coefficient of friction."""
    return Case(
        quantity=f"acceleration down a slope of {angle} degrees, friction {mu}",
        exact=G * (sin(radians(angle)) - mu * cos(radians(angle))),
        measure=acceleration,
        source="Coulomb",
    )
