"""Artificial viscosity, which spreads shocks over a few cells.

An equation of state adds it to `eos_strength` as a part, with a pressure q as history variable.
"""

from math import sqrt
from typing import NamedTuple

from karamelo_py.compiler import point_function


class ArtificialViscosity(NamedTuple):
    """q = rho h (Q1 h d^2 - Q2 c d) for a negative rate of volume change d."""

    in_lanes = True

    Q1: float
    Q2: float
    cell_size: float  # h, set when the scene is lowered


@point_function(otherwise=True)
def inviscid(law):
    """Return the law without viscous terms that shorten the stable step."""
    return law


def artificial_viscosity(Q1: float, Q2: float) -> dict[str, NamedTuple]:
    return {"viscosity": ArtificialViscosity(Q1, Q2, 0.0)} if Q1 > 0 or Q2 > 0 else {}


def viscous_pressure(viscosity, rate, density, sound):
    closing = max(-rate, 0)
    h = viscosity.cell_size
    return density * h * closing * (viscosity.Q1 * h * closing + viscosity.Q2 * sound)


def viscous_speed(viscosity, q, density, sound):
    """Return nu / h = Q1 h |d| + Q2 c, where nu is the viscosity, from q / rho >= Q1 (h d)^2."""
    return sqrt(viscosity.Q1 * q / density) + viscosity.Q2 * sound


def damped(squared, a):
    """Return the square of c' = sqrt(c^2 + a^2) + a, a = nu / h.

    Viscosity nu damps the shortest wave of a cell by xi = nu / (c h): c dt / h falls to sqrt(1 +
    xi^2) - xi (Belytschko et al. 2014, eq. 6.3.10), as if c were c'.
    """
    speed = sqrt(squared + a * a) + a
    return speed * speed
