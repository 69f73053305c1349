"""material eos-strength: pressure from an equation of state, deviatoric stress from a strength."""

from __future__ import annotations

from typing import TYPE_CHECKING

from karamelo_py.eos.base import Eos
from karamelo_py.material import Material
from karamelo_py.points.materials.eos_strength import EosStrength as EosStrengthLaw
from karamelo_py.strengths.base import Strength

if TYPE_CHECKING:
    from karamelo_py.hub import Hub


class EosStrength(Material):
    """Pressure from an equation of state, deviatoric stress from a strength.

    Parameters
    ----------
    eos
        ID of an equation of state, which has the density too.
    strength
        ID of a strength.

    Example
    -------
    eos(bulk, linear, 7850, 160e9)
    strength(mild, plastic, 80e9, 400e6)
    material(body, eos-strength, bulk, mild)

    Notes
    -----
    sigma = s - p I. The deviatoric stress s turns with the point (Jaumann rate; Hughes & Winget
    1980). The elastic strain is that of s and, with J the volume over the reference volume,
    ln J / 3. The strain energy is what unloading would give back; plastic work is not in it. Where
    fix initial_stress sets a pressure, the points get the volume that has this pressure.

    See Also
    --------
    eos, strength, compute max_plastic_strain
    """

    def __init__(self, hub: Hub, eos: Eos, strength: Strength):
        self.law = EosStrengthLaw(eos.law, strength.law)
