"""Viscous shear of a Newtonian fluid."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.compiler.tuples import scale
from karamelo_py.points.kinematics import contract, deviator, zero_symmetric
from karamelo_py.points.laws.strength import (
    equivalent_plastic_strain,
    initial_loss,
    initial_memory,
    shear_energy,
    shear_modulus,
    shear_response,
    shear_strain,
    viscosity_of,
)


class Viscous(NamedTuple):
    """s = 2 mu dev(D); nothing to remember."""

    mu: float  # dynamic viscosity
    cell_size: float  # h, known when the scene is lowered


@initial_memory.on(Viscous)
def _(strength, like):
    return ()


@initial_loss.on(Viscous)
def _(strength, like):
    return (real(0, like),)


@shear_response.on(Viscous)
def _(strength, kin, s, strain, memory, heat, dt):
    new = scale(real(2, dt) * strength.mu / dt, deviator(kin, strain))
    return new, memory, contract(kin, new, strain)


@viscosity_of.on(Viscous)
def _(strength):
    return (strength.mu, strength.cell_size)


@shear_modulus.on(Viscous)
def _(strength):
    return real(0, strength.mu)


@shear_strain.on(Viscous)
def _(strength, kin, s):
    return zero_symmetric(kin, strength.mu)


@shear_energy.on(Viscous)
def _(strength, kin, s):
    return real(0, strength.mu)


@equivalent_plastic_strain.on(Viscous)
def _(strength, memory):
    return real(0, strength.mu)
