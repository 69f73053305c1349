"""Artificial viscosity, which spreads shocks over a few cells.

An equation of state adds viscosity to `eos_strength` as a part, with a pressure q as history
variable. A heat flux may accompany it (Noh 1987, "Errors for calculations of strong shocks using an
artificial viscosity and an artificial heat flux", J. Comput. Phys. 72): viscosity alone overheats
gas at a wall, an axis or a point.
"""

from math import sqrt
from typing import NamedTuple

from karamelo_py.compiler import point_function, where
from karamelo_py.points.laws import law_kind


class ArtificialViscosity(NamedTuple):
    """q = rho h (Q1 h d^2 - Q2 c d) for a negative rate of volume change d."""

    in_lanes = True

    Q1: float
    Q2: float
    cell_size: float  # h, set when the scene is lowered


class ViscosityWithFlux(NamedTuple):
    """Artificial viscosity nu, and diffusion of the internal energy with the diffusivity Qh nu."""

    in_lanes = True

    Q1: float
    Q2: float
    Qh: float
    cell_size: float


def diffuses_energy(law: NamedTuple) -> bool:
    return ViscosityWithFlux in law_kind(law)


@point_function(otherwise=True)
def inviscid(law):
    """Return the law without viscous terms that shorten the stable step."""
    return law


def artificial_viscosity(Q1: float, Q2: float, Qh: float = 0.0) -> dict[str, NamedTuple]:
    if Qh > 0:
        return {"viscosity": ViscosityWithFlux(Q1, Q2, Qh, 0.0)}
    return {"viscosity": ArtificialViscosity(Q1, Q2, 0.0)} if Q1 > 0 or Q2 > 0 else {}


def viscous_pressure(viscosity, rate, density, sound):
    closing = max(-rate, 0)
    h = viscosity.cell_size
    return density * h * closing * (viscosity.Q1 * h * closing + viscosity.Q2 * sound)


def viscous_speed(viscosity, q, density, sound):
    """Return nu / h = Q1 h |d| + Q2 c, where nu is the viscosity, from q / rho >= Q1 (h d)^2."""
    return sqrt(viscosity.Q1 * q / density) + viscosity.Q2 * sound


def energy_diffusivity(viscosity, q, density, sound):
    nu = viscosity.cell_size * viscous_speed(viscosity, q, density, sound)
    return where(q > 0, viscosity.Qh * nu, 0)


def damped(squared, a):
    """Return the square of c' = sqrt(c^2 + a^2) + a, a = nu / h.

    Viscosity nu damps the shortest wave of a cell by xi = nu / (c h): c dt / h falls to sqrt(1 +
    xi^2) - xi (Belytschko et al. 2014, eq. 6.3.10), as if c were c'.
    """
    speed = sqrt(squared + a * a) + a
    return speed * speed
