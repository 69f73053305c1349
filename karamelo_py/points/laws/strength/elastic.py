"""Elastic shear without limit, and the elastic part that strengths with a limit share."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compiler.compile import real, shared
from karamelo_py.compiler.tuples import add_scaled, scale
from karamelo_py.points.kinematics import contract, deviator
from karamelo_py.points.laws.strength import (
    equivalent_plastic_strain,
    initial_memory,
    shear_energy,
    shear_modulus,
    shear_response,
    shear_strain,
)


class Elastic(NamedTuple):
    """s' = 2 G dev(d); nothing to remember."""

    G: float  # shear modulus


@shared
def elastic_trial(kin, G, s, strain):
    """Deviatoric stress after a strain increment, were it all elastic."""
    # The deviator of the sum: rounding errors of many steps would give s a trace otherwise.
    return deviator(kin, add_scaled(s, real(2, G) * G, strain))


def give_elastic_shear(strength: type) -> None:
    """Give `strength` (a class with a shear modulus ``G``) Hooke's law for its elastic part."""

    @shear_modulus.on(strength)
    def _(strength):
        return strength.G

    @shear_strain.on(strength)
    def _(strength, kin, s):
        return scale(real(0.5, strength.G) / strength.G, s)

    @shear_energy.on(strength)
    def _(strength, kin, s):
        return real(0.25, strength.G) / strength.G * contract(kin, s, s)


give_elastic_shear(Elastic)


@initial_memory.on(Elastic)
def _(strength, like):
    return ()


@shear_response.on(Elastic)
def _(strength, kin, s, strain, memory, heat, dt):
    return elastic_trial(kin, strength.G, s, strain), memory, real(0, strength.G)


@equivalent_plastic_strain.on(Elastic)
def _(strength, memory):
    return real(0, strength.G)
