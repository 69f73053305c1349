"""Strength drucker-prager."""

from math import cos, inf, radians, sin, sqrt, tan
from typing import Literal, NamedTuple

from karamelo_py.points.kinematics import inner
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.parameters import AboveZero, FromZero
from karamelo_py.points.laws.strengths import pressure_response
from karamelo_py.points.laws.strengths.frictional import (
    Soil,
    frictional,
    lowest_pressure,
    peak_and_residual,
    sines,
    surface,
    tension_bound,
)


def cone(fit: str, c: float, phi: float, psi: float) -> tuple[float, float]:
    """Return xi c and eta for friction and dilatancy angles in radians (see `DruckerPrager`)."""
    if fit == "plane-strain":
        t = tan(min(psi, phi))
        dilation = 3 * t / sqrt(9 + 12 * t * t)
        below = sqrt(1 - dilation**2 / 3) + dilation * sin(phi) / 3
        return cos(phi) / below * c, sin(phi) / below
    sign = -1 if fit == "compression" else 1
    below = sqrt(3) * (3 + sign * sin(phi))
    return 6 * cos(phi) / below * c, 6 * sin(phi) / below


class DruckerPrager(NamedTuple):
    """Soil strength as a cone of cohesion and friction around the pressure axis.

    Parameters
    ----------
    G
        Shear modulus.
    cohesion
        Cohesion c.
    phi
        Angle of internal friction in degrees, below 90.
    psi
        Angle of dilatancy in degrees, from 0 (no plastic volume change in shear) to phi.
    fit
        Match with mohr-coulomb: ``compression`` or ``extension`` in triaxial tests, or
        ``plane-strain`` at the limit load in plane strain.
    tension
        Largest mean stress in tension; default: the apex of the cone.
    residual_cohesion, residual_phi
        Residual cohesion and friction angle; default: no softening.
    softening
        Equivalent plastic strain over which the coefficients of the cone fall linearly.

    Example
    -------
    eos(ground, linear, 2100, 58.3e6)
    strength(sand, drucker-prager, 26.9e6, 0, 30, 5, fit=plane-strain)
    material(soil, eos-strength, ground, sand)

    Notes
    -----
    sqrt(s:s/2) <= xi c + eta p (Drucker & Prager 1952; de Souza Neto et al. 2008, section 6.4). For
    compression xi = 6 cos(phi)/(sqrt(3) (3 - sin(phi))) and eta = 6 sin(phi)/(sqrt(3) (3 -
    sin(phi))). For extension 3 + sin(phi) replaces 3 - sin(phi). For plane-strain xi = cos(phi)/b
    and eta = sin(phi)/b, where b = sqrt(1 - d^2/3) + d sin(phi)/3 and d = 3 tan(psi)/sqrt(9 + 12
    tan(psi)^2). At the limit load s_zz is -2/3 d sqrt(s:s/2), so the limit in plane strain is
    mohr-coulomb's for any psi. The dilatancy coefficient is d, and for the other fits eta of psi.
    Tension beyond -p = tension, or the apex, is cut off. Pressure follows from the elastic part of
    J. A step uses the strength at its beginning. With softening, results depend on the cell size.

    See Also
    --------
    mohr-coulomb, eos linear, material eos-strength, compute max_plastic_strain
    """

    in_lanes = True
    traits = LawTraits(flows=True)
    scalarised = ("respond",)

    G: float
    cohesion: float
    friction: float
    dilation: float
    tension: float
    residual_cohesion: float  # value after softening
    residual_friction: float
    softening: float  # loss of the coefficients per unit of plastic strain; 0 without softening

    @classmethod
    def given(
        cls,
        G: AboveZero,
        cohesion: FromZero,
        phi: float,
        psi: float = 0.0,
        *,
        fit: Literal["compression", "extension", "plane-strain"] = "compression",
        tension: FromZero | None = None,
        residual_cohesion: FromZero | None = None,
        residual_phi: FromZero | None = None,
        softening: AboveZero | None = None,
    ):
        soil = Soil(cohesion, phi, psi, residual_cohesion, residual_phi, softening)
        numbers = peak_and_residual(soil, lambda c, phi: cone(fit, c, phi, radians(psi)))
        return cls(G, *numbers[:3], inf if tension is None else tension, *numbers[3:])


frictional(DruckerPrager)


@tension_bound.on(DruckerPrager)
def _tension_bound_drucker_prager(strength, lowest):
    return max(lowest, -strength.tension)


@sines.on(DruckerPrager)
def _sines_drucker_prager(strength, friction, dilation):
    # In flow: half of the in-plane principal stress difference over sqrt(J2), and the dilatancy.
    in_plane = sqrt(max(1 - dilation * dilation / 3, 1e-6))
    return friction * in_plane / max(1 - friction * dilation / 3, 1e-6), dilation / in_plane


@pressure_response.on(DruckerPrager)
def _pressure_response_drucker_prager(strength, kin, trial, strain):
    s, p, K = trial
    cohesion, friction, dilation = surface(strength, strain)
    trial_root = sqrt(0.5 * inner(s, s))
    lowest = lowest_pressure(strength, strain)
    f = trial_root - cohesion - friction * p
    root = trial_root
    if f > 0:
        x = f / (strength.G + K * friction * dilation)
        p += K * dilation * x
        root = cohesion + friction * p
        if p < lowest:
            # Beyond the apex the trial pressure is used (below).
            p -= K * dilation * x
    if p < lowest:
        p = lowest
        root = min(trial_root, cohesion + friction * lowest)
    if root < trial_root:
        return max(root, 0) / trial_root * s, p
    return s, p
