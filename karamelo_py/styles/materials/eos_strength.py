"""material eos-strength: pressure from an equation of state, deviatoric stress from a strength."""

from __future__ import annotations

from karamelo_py.language.signature import Argument
from karamelo_py.points.laws.damages import NoDamage
from karamelo_py.points.laws.eos_strength import EosStrength as EosStrengthLaw
from karamelo_py.points.laws.temperatures import Isothermal
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material
from karamelo_py.scene.part import Part
from karamelo_py.script.errors import ScriptError, nearest
from karamelo_py.styles.damages.base import Damage
from karamelo_py.styles.eos.base import Eos
from karamelo_py.styles.strengths.base import Strength
from karamelo_py.styles.temperatures.base import Temperature


class Option(Part):
    """For signatures: a damage or a temperature."""

    script_kind = "the ID of a damage or of a temperature"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Part:
        """The part that `argument` names."""
        word = argument.word()
        known = {**hub.temperatures, **hub.damages}
        if word in known:
            return known[word]
        close = nearest(word, known) if word else None
        raise ScriptError(
            f"unknown damage or temperature '{argument.text}'",
            place=argument.place,
            expected=f"one of {', '.join(known)}" if known else "none is defined yet",
            hint=f"did you mean '{close}'?" if close else None,
        )


class EosStrength(Material):
    """Pressure from an equation of state, deviatoric stress from a strength.

    Parameters
    ----------
    eos
        ID of an equation of state, which has the density too.
    strength
        ID of a strength.
    first, second
        ID of a damage, ID of a temperature, in either order; each may be left out.

    Example
    -------
    eos(bulk, linear, 7850, 160e9)
    strength(mild, plastic, 80e9, 400e6)
    material(body, eos-strength, bulk, mild)

    Notes
    -----
    sigma = s - p I. The deviatoric stress s turns with the point (Jaumann rate; Hughes & Winget
    1980). The elastic strain is that of s and, with J the volume over the reference volume,
    ln J / 3; of soils, J is its elastic part. The strain energy is what unloading would give back;
    plastic work is not in it, compute dissipated_energy measures it. Where fix initial_stress sets
    a pressure, the points get the volume that has this pressure.

    See Also
    --------
    eos, strength, damage, temperature, compute max_plastic_strain, compute dissipated_energy
    """

    syntax = "eos, strength[, damage][, temperature]"

    def __init__(
        self,
        hub: Hub,
        eos: Eos,
        strength: Strength,
        first: Option | None = None,
        second: Option | None = None,
    ):
        given = [part for part in (first, second) if part is not None]
        damages = [part for part in given if isinstance(part, Damage)]
        temperatures = [part for part in given if isinstance(part, Temperature)]
        for parts in (damages, temperatures):
            if len(parts) > 1:
                raise ScriptError(
                    f"'{parts[0].id}' and '{parts[1].id}' are both a {parts[0].catalogue[:-1]}",
                    argument="second",
                    expected="one damage and one temperature at most",
                )
        self.parts = (eos, strength, *given)
        self.law = EosStrengthLaw(
            eos.law,
            strength.law,
            eos.viscosity,
            damages[0].law if damages else NoDamage(),
            temperatures[0].law if temperatures else Isothermal(),
        )
