"""strength plastic: plasticity of von Mises."""

from __future__ import annotations

from typing import Annotated

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.strength.plastic import LinearHardening
from karamelo_py.points.laws.strength.plastic import Plastic as PlasticLaw
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.strengths.base import Strength


class Plastic(Strength):
    """Elastic shear up to a yield stress, constant or with linear hardening (von Mises).

    Parameters
    ----------
    G
        Shear modulus.
    yield_stress
        Yield stress in uniaxial tension; in pure shear it yields at 1/sqrt(3) of it.
    H
        Hardening modulus: by how much the yield stress rises for each unit of plastic strain.

    Example
    -------
    strength(mild, plastic, 80e9, 400e6)
    strength(copper, plastic, 43.3e9, 400e6, 100e6)

    Notes
    -----
    Where the von Mises stress q = sqrt(3/2 s:s) of an elastic step is above the yield stress Y, the
    equivalent plastic strain (the column ep of dumps) grows by (q - Y)/(3 G + H) and the deviatoric
    stress s shrinks to the yield stress (radial return; Wilkins 1964; de Souza Neto et al. 2008,
    section 7.3).

    See Also
    --------
    linear, johnson_cook, swift, eos, material eos-strength, compute max_plastic_strain
    """

    def __init__(
        self,
        hub: Hub,
        G: Annotated[float, Positive],
        yield_stress: Annotated[float, Positive],
        H: Annotated[float, NonNegative] = 0.0,
    ):
        self.law = LinearHardening(G, yield_stress, H) if H > 0 else PlasticLaw(G, yield_stress)
