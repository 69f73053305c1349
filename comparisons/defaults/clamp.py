"""A beam of splines, clamped inside the grid: its first frequency."""

from math import cos, cosh, sin, sinh, sqrt

import numpy as np

from comparisons.defaults import Case
from comparisons.results import Result

SLENDER = 8.0  # length over height; height, density and modulus are 1, Poisson's ratio 0
UNIT = sqrt(1e6 / 1000)  # speed of waves over height


def timoshenko() -> float:
    """First frequency of a clamped beam (Huang 1961, J. Appl. Mech. 28, 579), coefficient 5/6."""
    inertia = 1 / 12
    r2 = inertia / SLENDER**2
    s2 = inertia / (5 / 6 * 0.5) / SLENDER**2

    def left(frequency: float) -> float:
        b = frequency * SLENDER**2 / sqrt(inertia)
        root = sqrt((r2 - s2) ** 2 + 4 / b**2)
        alpha, beta = sqrt((root - r2 - s2) / 2), sqrt((root + r2 + s2) / 2)
        first = 2 + (b**2 * (r2 - s2) ** 2 + 2) * cosh(b * alpha) * cos(b * beta)
        second = b * (r2 + s2) / sqrt(1 - b**2 * r2 * s2)
        return first - second * sinh(b * alpha) * sin(b * beta)

    euler = 1.8751**2 / SLENDER**2 * sqrt(inertia)
    low, high = 0.8 * euler, 1.01 * euler
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if left(low) * left(middle) <= 0 else (middle, high)
    return UNIT * low


def measure(result: Result) -> float:
    """Frequency of the sine that fits the height of the centre best."""
    time, height = result.log.Time, result.log.x_y

    def misfit(frequency: float) -> float:
        angle = frequency * time
        waves = np.stack([np.sin(angle), np.cos(angle), np.ones_like(time)], axis=1)
        return float(np.linalg.lstsq(waves, height, rcond=None)[1][0])

    exact = timoshenko()
    return min(exact * np.linspace(0.7, 1.3, 3001), key=misfit) / exact


CASE = Case(
    quantity="first frequency of a beam clamped inside the grid over Timoshenko's",
    exact=1.0,
    measure=measure,
    source="Huang 1961",
)
