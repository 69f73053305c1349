"""Eos shock."""

from math import inf, sqrt
from typing import NamedTuple

from karamelo_py.compiler import where
from karamelo_py.compiler.powers import logarithm
from karamelo_py.language.rules import known_failure
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.eos import (
    bulk_modulus,
    compression_energy,
    pressure,
    ratio_at_pressure,
)
from karamelo_py.points.laws.parameters import AboveZero, ByName, FromZero
from karamelo_py.points.laws.viscosity import artificial_viscosity
from karamelo_py.script.errors import ScriptError

# S (1 - J) beyond which the pressure follows the tangent; the Hugoniot has a pole at 1
_STEEPEST = 0.9


class ShockConstants(NamedTuple):
    """Pressure of shocked metals: Hugoniot curve, thermal pressure and artificial viscosity.

    Parameters
    ----------
    rho0
        Density before deformation.
    K
        Bulk modulus, unused (Karamelo's syntax): the initial stiffness is rho0 c0^2.
    c0
        Speed of sound without shear, at zero pressure.
    S
        Slope of the shock speed U = c0 + S u against the material speed u after the shock.
    Gamma
        Grueneisen parameter, at the density before deformation.
    cv
        Heat capacity per unit mass.
    Tr
        Temperature above which heat adds to the pressure.
    Q1, Q2
        Coefficients of artificial viscosity, quadratic and linear; 0 and 0 for none.
    tension
        Tension at which the material spalls (0: no tension). Default: the limit of the formula.

    Example
    -------
    eos(copper, shock, 8940, 110e9, 3933, 1.5, 1.99, 385, 294, 1.5, 0.06)
    eos(spalling, shock, 8940, 110e9, 3933, 1.5, 1.99, 385, 294, 1.5, 0.06, tension=1.2e9)

    Notes
    -----
    With mu = rho/rho0 - 1, p = rho0 c0^2 mu (1 + mu) / (1 - (S - 1) mu)^2 + Gamma rho0 cv (T - Tr)
    for T above Tr (Meyers 1994, chapter 5). Without a temperature, the pressure is the Hugoniot
    curve. In tension the first term is rho0 c0^2 mu. The curve has a pole where (S - 1) mu = 1;
    beyond S (1 - rho0/rho) = 0.9 the pressure follows the tangent.

    Voids open at constant tension and close before the material sustains pressure again. In the
    acoustic approximation the free surface velocity drops by 2 tension/(rho0 c0) (Antoun et al.
    2003, Spall Fracture, section 4.2). The tension that remains slows the spalled layer further,
    unless a damage releases it.

    In compression, with the rate of volume change d < 0, cell size h and speed of sound c, the
    viscous pressure is rho h (Q1 h d^2 - Q2 c d) (von Neumann & Richtmyer 1950; Landshoff 1955).
    Viscosity spreads shocks over a few cells, and shortens the time step.

    See Also
    --------
    linear, ideal-gas, strength johnson_cook, material eos-strength
    """

    rho0: AboveZero
    K: AboveZero
    c0: AboveZero
    S: FromZero
    Gamma: FromZero
    cv: FromZero
    Tr: float
    Q1: FromZero
    Q2: FromZero
    tension: ByName[FromZero] = inf

    def checked(self):
        rho0, K, c0, S, Gamma, cv, Tr, *viscous, tension = self
        if 0.5 < rho0 * K**2 / c0 < 2 and not 0.5 < rho0 * c0**2 / K < 2:
            raise ScriptError(
                f"K = {K:g} and c0 = {c0:g} are swapped: c0 is a speed, and K is near rho0 c0^2",
                argument="K",
                expected="the bulk modulus K, then the speed of sound c0",
                hint=f"eos(ID, shock, {rho0:g}, {c0:g}, {K:g}, ...)",
            )
        eos = Shock(1 / rho0, rho0 * c0**2, S, Gamma * rho0 * cv, Tr, tension)
        return {"eos": eos, **artificial_viscosity(*viscous)}


class Shock(NamedTuple):
    style = "shock"
    in_lanes = True
    traits = LawTraits(of_solids=True)
    scalarised = ("ratio_at_pressure",)

    specific_volume: float
    modulus: float  # rho0 c0^2
    S: float
    thermal: float  # Gamma rho0 cv, per kelvin above Tr
    Tr: float
    tension: float = inf  # largest tension


known_failure(
    Shock,
    "fast shocks",
    when=lambda eos, scene: (
        (scene.moves and not scene.linear and scene.kept > 0.99 and scene.speed > 0.6)
        and {"mark": scene.method.mark}
    ),
    reason="points move at {scene.speed:.2g} times the speed of waves, and {scene.transfer_name} "
    "with {scene.basis_name} functions carries such a shock 1 to 3 % too fast",
    cure="method(ulmpm, TPIC, quadratic-spline)",
)


def tangent_from(eos, j):
    """Return the compression 1 - J beyond which the pressure is linear."""
    return where(_STEEPEST < eos.S, _STEEPEST / max(eos.S, _STEEPEST), _STEEPEST)


def cold_pressure(eos, j):
    closed = 1 - j
    inside = min(closed, tangent_from(eos, j))
    y = eos.S * inside
    flat = 1 - y
    in_tension = closed < 0
    inverse = 1 / where(in_tension, j, flat)
    slope = (1 + y) * inverse
    curve = (inside + slope * (closed - inside)) * (inverse * inverse)
    return eos.modulus * where(in_tension, closed * inverse, curve)


def with_heat(heat, p, Tr, factor):
    return p + max(heat.T - Tr, 0) * factor if len(heat) else p


@pressure.on(Shock)
def _pressure_shock(eos, j, memory, heat):
    return max(with_heat(heat, cold_pressure(eos, j), eos.Tr, eos.thermal), -eos.tension)


@bulk_modulus.on(Shock)
def _bulk_modulus_shock(eos, j, memory, heat):
    closed = 1 - j
    y = eos.S * min(closed, tangent_from(eos, j))
    in_tension = closed < 0
    inverse = 1 / where(in_tension, j, 1 - y)
    curve = j * (1 + y) * (inverse * inverse)
    return eos.modulus * where(in_tension, inverse, curve * inverse)


@compression_energy.on(Shock)
def _compression_energy_shock(eos, j, memory):
    # The energy is constant beyond the volume ratio at which cold material spalls.
    most = min(eos.tension, eos.modulus)
    bounded = most < eos.modulus
    whole = where(bounded, eos.modulus / where(bounded, eos.modulus - most, 1), inf)
    gaping = max(j - whole, 0)
    j = min(j, whole)
    closed = 1 - j
    inside = min(closed, tangent_from(eos, j))
    y = eos.S * inside
    flat = 1 - y
    in_tension, near = closed < 0, y < 1e-3
    log_of = logarithm(where(in_tension, j, flat))
    # near 1 the closed form is a small difference of large terms
    few = inside * inside * (0.5 + y * (2 / 3 + 0.75 * y))
    log_of_flat = log_of + ((1 - flat) - y) / flat  # corrects the rounding of 1 - y
    energy = where(near, few, (y / flat + log_of_flat) / where(near, 1, eos.S * eos.S))
    slope = (1 + y) / (flat * flat * flat)
    further = closed - inside
    line = further * (inside / (flat * flat) + 0.5 * slope * further)
    return eos.modulus * where(in_tension, -(closed + log_of), energy + line) + most * gaping


@ratio_at_pressure.on(Shock)
def _ratio_at_pressure_shock(eos, p, heat):
    cold = (max(p, -eos.tension) - with_heat(heat, 0, eos.Tr, eos.thermal)) / eos.modulus
    if cold < 0:
        return 1 / max(1 + cold, 1e-6)
    inside = tangent_from(eos, cold)
    y = eos.S * inside
    flat = 1 - y
    top = inside / (flat * flat)
    if cold > top:
        return 1 - inside - (cold - top) * flat * flat * flat / (1 + y)
    k = 2 * cold * eos.S + 1
    return 1 - 2 * cold / (k + sqrt(4 * cold * eos.S + 1))
