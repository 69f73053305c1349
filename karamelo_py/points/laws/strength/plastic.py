"""Elastic shear up to a yield stress, constant or in proportion to plastic strain (von Mises)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.points.kinematics import von_mises
from karamelo_py.points.laws.strength import shear_response
from karamelo_py.points.laws.strength.elastic import elastic_trial
from karamelo_py.points.laws.strength.hardening import give_plastic_strain, returned


class Plastic(NamedTuple):
    """Shear modulus and yield stress; the memory is the equivalent plastic strain."""

    G: float  # shear modulus
    yield_stress: float  # in uniaxial stress


class LinearHardening(NamedTuple):
    """The same with a yield stress that rises by H for each unit of plastic strain."""

    G: float  # shear modulus
    yield_stress: float  # in uniaxial stress, at first
    H: float  # hardening modulus


give_plastic_strain(Plastic)
give_plastic_strain(LinearHardening)


@shear_response.on(Plastic)
def _(strength, kin, s, strain, memory, heat, dt):
    trial = elastic_trial(kin, strength.G, s, strain)
    q = von_mises(kin, trial)
    if q > strength.yield_stress:
        increment = (q - strength.yield_stress) / (real(3, q) * strength.G)
        return returned(trial, q, strength.yield_stress, memory, increment)
    return trial, memory, real(0, q)


@shear_response.on(LinearHardening)
def _(strength, kin, s, strain, memory, heat, dt):
    trial = elastic_trial(kin, strength.G, s, strain)
    q = von_mises(kin, trial)
    flow_stress = strength.yield_stress + strength.H * memory[0]
    if q > flow_stress:
        increment = (q - flow_stress) / (real(3, q) * strength.G + strength.H)
        return returned(trial, q, flow_stress + strength.H * increment, memory, increment)
    return trial, memory, real(0, q)
