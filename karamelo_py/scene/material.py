"""Materials: a constitutive law with its parameters, named in the script."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from karamelo_py.points.laws.thermoelastic import Expansion, Thermoelastic
from karamelo_py.scene.part import Part
from karamelo_py.script.errors import ScriptError


class Material(Part):
    """Base of the material styles; `law` is the whole law, of `parts` where it has any."""

    script_kind = "the ID of a material"
    catalogue = "materials"
    parts: Sequence[Part] = ()

    @property
    def words(self) -> str:
        """ID, style, and the styles of its parts: ``steel (eos-strength: linear, plastic)``."""
        parts = ", ".join(part.style for part in self.parts)
        return f"{self.id} ({self.style}{': ' if parts else ''}{parts})"


class LameParameters(NamedTuple):
    """Isotropic elasticity, in consistent units of stress."""

    lam: float  # Lame's first parameter
    G: float  # shear modulus


def check_poisson_ratio(nu: float) -> None:
    """Refuse a Poisson's ratio for which the elastic energy is not positive or not finite."""
    if not -1 < nu < 0.5:
        raise ScriptError(
            f"Poisson's ratio {nu:g} is impossible",
            argument="nu",
            expected="a number above -1 and below 0.5",
        )


def expanding(
    law: NamedTuple, moduli: LameParameters, cp: float | None, kappa: float | None, alpha: float
) -> NamedTuple:
    """An elastic law with a temperature where heat capacity and conductivity are given."""
    if cp is None or kappa is None:
        if cp is not None:
            raise ScriptError(
                "with the heat capacity cp the conductivity kappa is needed",
                argument="cp",
                expected="cp and kappa, or neither",
            )
        return law
    bulk = moduli.lam + 2 / 3 * moduli.G
    return Thermoelastic(law, Expansion(cp, kappa, alpha, 3 * bulk * alpha, 0.0))


def lame_parameters(E: float, nu: float) -> LameParameters:
    """Lame's parameters from Young's modulus and Poisson's ratio."""
    return LameParameters(lam=E * nu / ((1 + nu) * (1 - 2 * nu)), G=E / (2 * (1 + nu)))
