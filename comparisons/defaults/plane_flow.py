"""Grains flow down a rough plane: the pressure of the points."""

from math import cos, radians

import numpy as np

from comparisons.defaults import Case
from comparisons.results import Result

H = 0.02  # m, depth


def scatter(result: Result, degrees: float = 25) -> float:
    """Deviation of the pressures from those by the weight above, in the lower half but the floor.

    The ends of the layer have sent nothing there yet.
    """
    (*_, last) = result.snapshots("points")
    here = (last.x > 10 * H) & (last.x < 12 * H) & (last.y > H / 8) & (last.y < H / 2)
    exact = 1500 * 9.81 * cos(radians(degrees)) * (H - last.y[here])
    return float(np.sqrt(np.mean((-last.s22[here] / exact - 1) ** 2)))


CASE = Case(
    quantity="scatter of the pressure, of what it should be",
    exact=0.0,
    measure=scatter,
    source="equilibrium",
    refine=(1,),
    advice="pressure of grains",
)
