"""Artificial viscosity: quadratic (von Neumann & Richtmyer) and linear (Landshoff)."""

from math import sqrt
from typing import NamedTuple

from karamelo_py.points.laws.viscosity import (
    initial_viscous_pressure,
    viscous_pressure,
    viscous_speed,
)


class ArtificialViscosity(NamedTuple):
    """q = rho h (Q1 h d^2 - Q2 c d) where the rate of volume change d is negative."""

    in_lanes = True

    Q1: float  # quadratic coefficient
    Q2: float  # linear coefficient
    cell_size: float  # h, known when the scene is lowered


def artificial_viscosity(Q1: float, Q2: float) -> dict[str, NamedTuple]:
    """The part that an equation of state with these coefficients brings; none where both are 0."""
    return {"viscosity": ArtificialViscosity(Q1, Q2, 0.0)} if Q1 > 0 or Q2 > 0 else {}


@initial_viscous_pressure.on(ArtificialViscosity)
def _initial_viscous_pressure_artificial_viscosity(viscosity, like):
    return (0.0,)


@viscous_pressure.on(ArtificialViscosity)
def _viscous_pressure_artificial_viscosity(viscosity, rate, density, sound):
    closing = max(-rate, 0)
    h = viscosity.cell_size
    return (density * h * closing * (viscosity.Q1 * h * closing + viscosity.Q2 * sound),)


@viscous_speed.on(ArtificialViscosity)
def _viscous_speed_artificial_viscosity(viscosity, memory, density, sound):
    # nu / h = Q1 h |d| + Q2 c, and q / rho >= Q1 (h d)^2
    return sqrt(viscosity.Q1 * memory[0] / density) + viscosity.Q2 * sound
