"""strength mohr-coulomb: cohesion and friction."""

from __future__ import annotations

from math import cos, sin
from typing import Annotated

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.strength.mohr_coulomb import MohrCoulomb as MohrCoulombLaw
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.strengths.base import Strength
from karamelo_py.styles.strengths.soils import angles, residual


class MohrCoulomb(Strength):
    """Strength of soil by cohesion and friction, with dilatancy and perhaps softening.

    Parameters
    ----------
    G
        Shear modulus.
    cohesion
        Cohesion c.
    phi
        Angle of internal friction in degrees, below 90.
    psi
        Angle of dilatancy in degrees, from 0 (no plastic change of volume by shear) to phi.
    residual_cohesion, residual_phi
        What cohesion and friction angle fall to; they stay as they are when left out.
    softening
        Equivalent plastic strain over which they fall, in a straight line of c cos(phi) and
        sin(phi).

    Example
    -------
    eos(ground, linear, 2100, 58.3e6)
    strength(clay, mohr-coulomb, 26.9e6, 10e3, 20, 0)
    material(soil, eos-strength, ground, clay)

    Notes
    -----
    s1 - s3 + (s1 + s3) sin(phi) <= 2 c cos(phi), with s1 the largest and s3 the smallest principal
    stress (tension positive). A stress beyond is brought back in principal stresses: to the plane,
    an edge (two equal principal stresses) or the apex of the surface, p = -c cot(phi), in tension
    (Simpson 2017, Practical Finite Element Modeling in Earth Science using Matlab, section 11.4; de
    Souza Neto et al. 2008, section 8.2). The plastic change of volume is kept, and pressure follows
    from the elastic part of J. While strength falls, a step uses that of its beginning. Where it
    falls, results depend on the size of the cells.

    See Also
    --------
    drucker-prager, eos linear, material eos-strength, compute max_plastic_strain
    """

    def __init__(
        self,
        hub: Hub,
        G: Annotated[float, Positive],
        cohesion: Annotated[float, NonNegative],
        phi: float,
        psi: float = 0.0,
        *,
        residual_cohesion: Annotated[float, NonNegative] | None = None,
        residual_phi: Annotated[float, NonNegative] | None = None,
        softening: Annotated[float, Positive] | None = None,
    ):
        a, b = angles(cohesion, phi, psi)
        end = residual(cohesion, phi, residual_cohesion, residual_phi, softening)
        peak = (cohesion * cos(a), sin(a), sin(b))
        left = (end.cohesion * cos(end.phi), sin(end.phi), end.softening)
        self.law = MohrCoulombLaw(G, *peak, *left)
