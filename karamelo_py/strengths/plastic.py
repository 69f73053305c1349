"""strength plastic: perfect plasticity of von Mises."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from karamelo_py.points.materials.strength.plastic import Plastic as PlasticLaw
from karamelo_py.signature import Positive
from karamelo_py.strengths.base import Strength

if TYPE_CHECKING:
    from karamelo_py.hub import Hub


class Plastic(Strength):
    """Elastic shear up to a constant yield stress: perfect plasticity of von Mises.

    Parameters
    ----------
    G
        Shear modulus.
    yield_stress
        Yield stress in uniaxial tension; in pure shear it yields at 1/sqrt(3) of it.

    Example
    -------
    strength(mild, plastic, 80e9, 400e6)

    Notes
    -----
    Where the von Mises stress q = sqrt(3/2 s:s) of an elastic step is above the yield stress Y, the
    equivalent plastic strain (the column ep of dumps) grows by (q - Y)/(3 G) and the deviatoric
    stress s shrinks to Y/q of itself (radial return; Wilkins 1964).

    See Also
    --------
    linear, eos, material eos-strength, compute max_plastic_strain
    """

    def __init__(
        self,
        hub: Hub,
        G: Annotated[float, Positive],
        yield_stress: Annotated[float, Positive],
    ):
        self.law = PlasticLaw(G, yield_stress)
