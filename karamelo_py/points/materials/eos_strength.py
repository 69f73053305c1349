"""A law in two parts: pressure from an equation of state, deviatoric stress from a strength.

The parts are NamedTuples inside the law's, so that their types select their point functions. The
state of a point is (det F, deviatoric stress, memory of the strength).
"""

from __future__ import annotations

from math import log
from typing import Any, NamedTuple

from karamelo_py.compile import real
from karamelo_py.points.kinematics import (
    add_pressure,
    after_symmetric,
    deviator,
    leading_symmetric,
    spin,
    symmetric_part,
    trace,
    volume_ratio,
    zero_symmetric,
)
from karamelo_py.points.materials import (
    advance,
    assemble,
    cauchy_stress,
    elastic_strain,
    energy_density,
    initial_state,
    jacobian,
    kirchhoff_stress,
    plastic_strain,
    separate,
    specific_volume,
    wave_speed_squared,
    with_stress,
)
from karamelo_py.points.materials.eos import (
    bulk_modulus,
    compression_energy,
    pressure,
    ratio_at_pressure,
)
from karamelo_py.points.materials.strength import (
    equivalent_plastic_strain,
    initial_memory,
    shear_energy,
    shear_modulus,
    shear_response,
    shear_strain,
)


class EosStrength(NamedTuple):
    """sigma = s - p I."""

    eos: Any  # parameters of an equation of state (karamelo_py.points.materials.eos)
    strength: Any  # parameters of a strength (karamelo_py.points.materials.strength)


class EosStrengthParts(NamedTuple):
    """Tag of the law while its parts travel one by one."""


@separate.on(EosStrength)
def _(law):
    return EosStrengthParts(), law.eos, law.strength


@assemble.on(EosStrengthParts)
def _(tag, first, second):
    return EosStrength(first, second)


@initial_state.on(EosStrength)
def _(law, kin, like):
    at_rest = (real(1, like),) + zero_symmetric(kin, like)
    return at_rest + initial_memory(law.strength, like)


@advance.on(EosStrength)
def _(law, kin, state, dl, dt):
    old = spin(kin, dl, leading_symmetric(kin, state[1:]))
    memory = after_symmetric(kin, state[1:])
    s, memory = shear_response(law.strength, kin, old, symmetric_part(kin, dl), memory, dt)
    return (state[0] * volume_ratio(kin, dl),) + s + memory


@cauchy_stress.on(EosStrength)
def _(law, kin, state):
    s = leading_symmetric(kin, state[1:])
    return add_pressure(kin, real(1, state[0]), s, -pressure(law.eos, state[0]))


@kirchhoff_stress.on(EosStrength)
def _(law, kin, state):
    j = state[0]
    return add_pressure(kin, j, leading_symmetric(kin, state[1:]), -j * pressure(law.eos, j))


@jacobian.on(EosStrength)
def _(law, kin, state):
    return state[0]


@wave_speed_squared.on(EosStrength)
def _(law, kin, state):
    # (K + 4/3 G) / rho, with the elastic moduli: plastic waves are slower.
    j = state[0]
    modulus = bulk_modulus(law.eos, j) + real(4 / 3, j) * shear_modulus(law.strength)
    return modulus * specific_volume(law.eos) * j


@energy_density.on(EosStrength)
def _(law, kin, state):
    """What unloading gives back: plastic work is not stored."""
    j = state[0]
    s = leading_symmetric(kin, state[1:])
    return compression_energy(law.eos, j) + j * shear_energy(law.strength, kin, s)


@elastic_strain.on(EosStrength)
def _(law, kin, state):
    """ln J / 3, the mean of the strain increments, and the elastic shear of the strength."""
    strain = shear_strain(law.strength, kin, leading_symmetric(kin, state[1:]))
    return add_pressure(kin, real(1, state[0]), strain, real(1 / 3, state[0]) * log(state[0]))


@plastic_strain.on(EosStrength)
def _(law, kin, state):
    return equivalent_plastic_strain(law.strength, after_symmetric(kin, state[1:]))


@with_stress.on(EosStrength)
def _(law, kin, state, stress):
    # Pressure follows from volume, so the point gets the volume that has this pressure.
    j = ratio_at_pressure(law.eos, -trace(stress) * real(1 / 3, state[0]))
    return (j,) + deviator(kin, stress) + after_symmetric(kin, state[1:])


@specific_volume.on(EosStrength)
def _(law):
    return specific_volume(law.eos)
