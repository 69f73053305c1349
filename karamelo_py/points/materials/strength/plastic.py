"""Elastic shear up to a yield stress that stays as it is: perfect plasticity of von Mises."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compile import real, shared
from karamelo_py.points.kinematics import von_mises
from karamelo_py.points.materials.strength import (
    equivalent_plastic_strain,
    initial_memory,
    shear_response,
)
from karamelo_py.points.materials.strength.elastic import elastic_trial, give_elastic_shear
from karamelo_py.tensors import scale


class Plastic(NamedTuple):
    """Shear modulus and yield stress; the memory is the equivalent plastic strain."""

    G: float  # shear modulus
    yield_stress: float  # in uniaxial stress


@shared
def radial_return(kin, G, flow_stress, trial):
    """Deviatoric stress and plastic strain increment for an elastic trial (Wilkins 1964).

    Where q = sqrt(3/2 s:s) of the trial is above the flow stress Y, the plastic strain increment is
    (q - Y)/(3 G) and s shrinks to Y/q of itself.
    """
    q = von_mises(kin, trial)
    if q > flow_stress:
        return scale(flow_stress / q, trial), (q - flow_stress) / (real(3, G) * G)
    return trial, real(0, G)


give_elastic_shear(Plastic)


@initial_memory.on(Plastic)
def _(strength, like):
    return (real(0, like),)


@shear_response.on(Plastic)
def _(strength, kin, s, strain, memory, dt):
    trial = elastic_trial(kin, strength.G, s, strain)
    returned, increment = radial_return(kin, strength.G, strength.yield_stress, trial)
    return returned, (memory[0] + increment,)


@equivalent_plastic_strain.on(Plastic)
def _(strength, memory):
    return memory[0]
