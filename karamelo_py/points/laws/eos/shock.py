"""eos shock: Mie-Grueneisen equation of state."""

from math import sqrt
from typing import Annotated, NamedTuple

from karamelo_py.compiler.compile import choose, point_function, real, shared
from karamelo_py.compiler.powers import logarithm
from karamelo_py.language.rules import known_failure
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.eos import (
    bulk_modulus,
    compression_energy,
    pressure,
    ratio_at_pressure,
)
from karamelo_py.points.laws.temperatures import Warm
from karamelo_py.points.laws.viscosity.artificial import artificial_viscosity

# S (1 - J) from where on the pressure goes on along its tangent: at 1 the Hugoniot has a pole.
_STEEPEST = 0.9


class Shock(NamedTuple):
    """Pressure of shocked metals: the Hugoniot curve, heat, and artificial viscosity.

    Parameters
    ----------
    rho0
        Density before deformation.
    K
        Bulk modulus, as Karamelo's scripts have it. Nothing depends on it: the stiffness is that of
        the Hugoniot curve, rho0 c0^2 at first.
    c0
        Speed of sound without shear, at zero pressure.
    S
        Slope of the shock speed U = c0 + S u over the speed u of the material behind the shock.
    Gamma
        Grueneisen's parameter, of the density before deformation.
    cv
        Heat capacity per mass.
    Tr
        Temperature above which heat adds to the pressure.
    Q1, Q2
        Coefficients of artificial viscosity, quadratic and linear; 0 and 0 for none.

    Example
    -------
    eos(copper, shock, 8940, 110e9, 3933, 1.5, 1.99, 385, 294, 1.5, 0.06)

    Notes
    -----
    With mu = rho/rho0 - 1, p = rho0 c0^2 mu (1 + mu) / (1 - (S - 1) mu)^2 + Gamma rho0 cv (T - Tr)
    for T above Tr (Meyers 1994, chapter 5): the curve of the shocked states, shifted by the heat of
    plastic work. There is heat where the material has a temperature. In tension the first part is
    rho0 c0^2 mu. The curve has a pole at (S - 1) mu = 1; from where S (1 - rho0/rho) = 0.9 the
    pressure goes on along the tangent.

    Where the material is compressed at a rate d < 0 of its volume, the viscous pressure
    rho h (Q1 h d^2 - Q2 c d) is added, with the cell size h and the speed of sound c (von Neumann &
    Richtmyer 1950; Landshoff 1955). It spreads a shock over a few cells, and the time step takes
    account of it.

    See Also
    --------
    linear, ideal-gas, strength johnson_cook, material eos-strength
    """

    in_lanes = True
    one_by_one = ("ratio_at_pressure",)

    specific_volume: float  # reference volume per mass
    modulus: float  # rho0 c0^2
    S: float
    thermal: float  # Gamma rho0 cv, pressure per kelvin above Tr
    Tr: float

    @classmethod
    def given(
        cls,
        rho0: Annotated[float, Positive],
        K: Annotated[float, Positive],
        c0: Annotated[float, Positive],
        S: Annotated[float, NonNegative],
        Gamma: Annotated[float, NonNegative],
        cv: Annotated[float, NonNegative],
        Tr: float,
        Q1: Annotated[float, NonNegative],
        Q2: Annotated[float, NonNegative],
    ):
        """The equation of state and its artificial viscosity."""
        eos = cls(1 / rho0, rho0 * c0**2, S, Gamma * rho0 * cv, Tr)
        return {"eos": eos, **artificial_viscosity(Q1, Q2)}


def _fast(eos, scene):
    smears = not scene.linear and scene.kept <= 0.99
    fast = scene.moves and not smears and scene.speed > 0.6
    return {"place": scene.method.place} if fast else None


known_failure(
    Shock,
    "fast shocks",
    when=_fast,
    reason="points move at {scene.speed:.2g} times the speed of waves, and {scene.transfer_name} "
    "with {scene.basis_name} functions carries such a shock 1 to 3 % too fast",
    cure="method(ulmpm, TPIC, quadratic-spline)",
)


@shared
def tangent_from(eos, j):
    """The compression 1 - J beyond which pressure is a straight line."""
    limit = real(_STEEPEST, j)
    return choose(limit < eos.S, limit / max(eos.S, limit), limit)


@shared
def cold_pressure(eos, j):
    """Pressure of the Hugoniot curve; rho0 c0^2 mu in tension."""
    one = real(1, j)
    closed = one - j
    inside = min(closed, tangent_from(eos, j))
    y = eos.S * inside
    flat = one - y
    in_tension = closed < 0
    inverse = one / choose(in_tension, j, flat)
    slope = (one + y) * inverse
    curve = (inside + slope * (closed - inside)) * (inverse * inverse)
    return eos.modulus * choose(in_tension, closed * inverse, curve)


@point_function(otherwise=True)
def heated(heat, p, Tr, factor):
    """p + factor (T - Tr) above the temperature Tr, p without a temperature."""
    return p


@heated.on(Warm)
def _heated_warm(heat, p, Tr, factor):
    return p + max(heat.T - Tr, real(0, Tr)) * factor


@pressure.on(Shock)
def _pressure_shock(eos, j, memory, heat):
    return heated(heat, cold_pressure(eos, j), eos.Tr, eos.thermal)


@bulk_modulus.on(Shock)
def _bulk_modulus_shock(eos, j, memory, heat):
    one = real(1, j)
    closed = one - j
    y = eos.S * min(closed, tangent_from(eos, j))
    in_tension = closed < 0
    inverse = one / choose(in_tension, j, one - y)
    curve = j * (one + y) * (inverse * inverse)
    return eos.modulus * choose(in_tension, inverse, curve * inverse)


@compression_energy.on(Shock)
def _compression_energy_shock(eos, j, memory):
    one, half = real(1, j), real(0.5, j)
    closed = one - j
    inside = min(closed, tangent_from(eos, j))
    y = eos.S * inside
    flat = one - y
    in_tension, near = closed < 0, y < real(1e-3, j)
    log_of = logarithm(choose(in_tension, j, flat))
    # From J to 1 rho0 c0^2 (1 - J) / J in tension; the closed form is a small difference near 1.
    few = inside * inside * (half + y * (real(2 / 3, j) + real(0.75, j) * y))
    log_of_flat = log_of + ((one - flat) - y) / flat  # y is not what 1 - y is rounded to
    energy = choose(near, few, (y / flat + log_of_flat) / choose(near, one, eos.S * eos.S))
    slope = (one + y) / (flat * flat * flat)
    further = closed - inside
    line = further * (inside / (flat * flat) + half * slope * further)
    return eos.modulus * choose(in_tension, -(closed + log_of), energy + line)


@ratio_at_pressure.on(Shock)
def _ratio_at_pressure_shock(eos, p, heat):
    one = real(1, p)
    two = real(2, p)
    cold = (p - heated(heat, real(0, p), eos.Tr, eos.thermal)) / eos.modulus
    if cold < 0:
        return one / max(one + cold, real(1e-6, p))
    inside = tangent_from(eos, cold)
    y = eos.S * inside
    flat = one - y
    top = inside / (flat * flat)
    if cold > top:
        return one - inside - (cold - top) * flat * flat * flat / (one + y)
    k = two * cold * eos.S + one
    return one - two * cold / (k + sqrt(real(4, p) * cold * eos.S + one))
