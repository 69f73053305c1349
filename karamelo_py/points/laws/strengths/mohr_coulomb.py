"""Strength mohr-coulomb."""

from math import cos, sin, sqrt
from typing import NamedTuple

from karamelo_py.points.kinematics import inner
from karamelo_py.points.kinematics.principal import from_principal, principal
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.parameters import AboveZero, FromZero
from karamelo_py.points.laws.strengths import pressure_response
from karamelo_py.points.laws.strengths.frictional import (
    Soil,
    frictional,
    peak_and_residual,
    surface,
)


class MohrCoulomb(NamedTuple):
    """Soil strength from cohesion and friction, with dilatancy and optional softening.

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
    residual_cohesion, residual_phi
        Residual cohesion and friction angle; default: no softening.
    softening
        Equivalent plastic strain over which c cos(phi) and sin(phi) fall linearly.

    Example
    -------
    eos(ground, linear, 2100, 58.3e6)
    strength(clay, mohr-coulomb, 26.9e6, 10e3, 20, 0)
    material(soil, eos-strength, ground, clay)

    Notes
    -----
    s1 - s3 + (s1 + s3) sin(phi) <= 2 c cos(phi), with s1 the largest and s3 the smallest principal
    stress (tension positive). Principal stresses are returned to a plane, an edge or, in tension,
    the apex p = -c cot(phi) (Simpson 2017, Practical Finite Element Modeling in Earth Science using
    Matlab, section 11.4; de Souza Neto et al. 2008, section 8.2). Pressure follows from the elastic
    part of J. A step uses the strength at its beginning. With softening, results depend on the cell
    size.

    See Also
    --------
    drucker-prager, eos linear, material eos-strength, compute max_plastic_strain
    """

    in_lanes = True
    traits = LawTraits(flows=True)
    scalarised = ("respond",)

    G: float
    cohesion: float  # c cos(phi)
    friction: float  # sin(phi)
    dilation: float  # sin(psi)
    residual_cohesion: float  # value after softening
    residual_friction: float
    softening: float  # softening per unit of plastic strain, or 0

    @classmethod
    def given(
        cls,
        G: AboveZero,
        cohesion: FromZero,
        phi: float,
        psi: float = 0.0,
        *,
        residual_cohesion: FromZero | None = None,
        residual_phi: FromZero | None = None,
        softening: AboveZero | None = None,
    ):
        soil = Soil(cohesion, phi, psi, residual_cohesion, residual_phi, softening)
        return cls(G, *peak_and_residual(soil, lambda c, angle: (c * cos(angle), sin(angle))))


frictional(MohrCoulomb)


def returned_to_plane(s, yield_surface, G, K):
    """Return the principal stresses s1 >= s2 >= s3 of an elastic trial to the yield surface.

    They are returned to a plane; to an edge if this would change their order; otherwise to the apex
    (Simpson 2017, section 11.4; de Souza Neto et al. 2008, box 8.4). `yield_surface` is c cos(phi),
    sin(phi), sin(psi).
    """
    k, sin_phi, sin_psi = yield_surface
    lam = K - 2 / 3 * G
    # Normals of yield function and plastic potential are (1 + sin, 0, sin - 1).
    mean = 4 * lam * sin_phi * sin_psi
    up = 2 * G * (1 + sin_phi) * (1 + sin_psi)
    down = 2 * G * (1 - sin_phi) * (1 - sin_psi)
    f = s[0] - s[2] + (s[0] + s[2]) * sin_phi - 2 * k
    volume = 2 * lam * sin_psi  # lam tr(m)
    rise = 2 * G * (1 + sin_psi) + volume  # C m of the largest stress
    fall = volume - 2 * G * (1 - sin_psi)  # fall of the smallest; `volume` of the other
    x = f / (up + down + mean)
    s1, s2, s3 = s[0] - x * rise, s[1] - x * volume, s[2] - x * fall
    if s1 >= s2 and s2 >= s3:
        return s1, s2, s3
    if s2 > s1:
        # Triaxial extension: both planes 1-3 and 2-3 are active.
        other = s[1] - s[2] + (s[1] + s[2]) * sin_phi - 2 * k
        cross = down + mean
    else:
        # Triaxial compression: both planes 1-3 and 1-2 are active.
        other = s[0] - s[1] + (s[0] + s[1]) * sin_phi - 2 * k
        cross = up + mean
    a = up + down + mean
    determinant = a * a - cross * cross
    x = (a * f - cross * other) / determinant
    y = (a * other - cross * f) / determinant
    if s2 > s1:
        t1 = s[0] - x * rise - y * volume
        t3 = s[2] - (x + y) * fall
        # From both planes, which give equal values except for round-off.
        t1 = (2 * k + (1 - sin_phi) * t3) / (1 + sin_phi)
        if t1 >= t3:
            return t1, t1, t3
    else:
        t1 = s[0] - (x + y) * rise
        t3 = ((1 + sin_phi) * t1 - 2 * k) / (1 - sin_phi)
        if t1 >= t3:
            return t1, t3, t3
    apex = k / sin_phi
    return apex, apex, apex


@pressure_response.on(MohrCoulomb)
def _pressure_response_mohr_coulomb(strength, kin, trial, strain):
    s, p, K = trial
    k, sin_phi, _ = yield_surface = surface(strength, strain)
    # A cheap bound of the yield function.
    root = sqrt(0.5 * inner(s, s))
    bound = 2 * root + sin_phi * (root / sqrt(3) - 2 * p) - 2 * k
    if bound <= 0:
        return s, p
    (a, b, c), directions = principal(s)
    at_a = (1 if b > a else 0) + (1 if c > a else 0)
    at_b = (1 if a >= b else 0) + (1 if c > b else 0)
    at_c = (1 if a >= c else 0) + (1 if b >= c else 0)
    largest = max(a, max(b, c))
    smallest = min(a, min(b, c))
    middle = -largest - smallest
    ordered = (largest - p, middle - p, smallest - p)
    f = largest - smallest + (ordered[0] + ordered[2]) * sin_phi - 2 * k
    if f <= 0:
        return s, p
    new = returned_to_plane(ordered, yield_surface, strength.G, K)
    mean = (new[0] + new[1] + new[2]) / 3
    shear = tuple([of_three(new, rank) - mean for rank in (at_a, at_b, at_c)])
    return from_principal(s, shear, directions), -mean


def of_three(values, k):
    return values[0] if k == 0 else values[1] if k == 1 else values[2]
