"""Moduli of isotropic elasticity."""

from typing import NamedTuple

from karamelo_py.script.errors import ScriptError


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


def lame_parameters(E: float, nu: float) -> LameParameters:
    """Lame's parameters from Young's modulus and Poisson's ratio."""
    return LameParameters(lam=E * nu / ((1 + nu) * (1 - 2 * nu)), G=E / (2 * (1 + nu)))
