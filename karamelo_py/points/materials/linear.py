"""Linear elasticity in rate form with an objective (Jaumann) stress rate."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from karamelo_py.compile import real
from karamelo_py.points.kinematics import (
    add_pressure,
    contract,
    spin,
    symmetric_part,
    trace,
    volume_ratio,
    zero_symmetric,
)
from karamelo_py.points.materials import (
    advance,
    cauchy_stress,
    elastic_strain,
    energy_density,
    initial_state,
    jacobian,
    kirchhoff_stress,
    reference_density,
    wave_speed,
    with_stress,
)
from karamelo_py.tensors import add, scale


class Hypoelastic(NamedTuple):
    """Parameters of the law; the state of a point is (det F, Cauchy stress)."""

    rho: float  # reference density
    lam: float  # Lame's first parameter
    G: float  # shear modulus
    c: float  # speed of pressure waves at the reference density


@initial_state.on(Hypoelastic)
def _(law, kin, like):
    return (real(1, like),) + zero_symmetric(kin, like)


@advance.on(Hypoelastic)
def _(law, kin, state, dl, dt):
    strain = symmetric_part(kin, dl)
    turned = spin(kin, dl, state[1:])
    pressure = law.lam * trace(strain)
    increment = add_pressure(kin, real(2, law.G) * law.G, strain, pressure)
    return (state[0] * volume_ratio(kin, dl),) + add(turned, increment)


@kirchhoff_stress.on(Hypoelastic)
def _(law, kin, state):
    return scale(state[0], state[1:])


@cauchy_stress.on(Hypoelastic)
def _(law, kin, state):
    return state[1:]


@jacobian.on(Hypoelastic)
def _(law, kin, state):
    return state[0]


@wave_speed.on(Hypoelastic)
def _(law, kin, state):
    return law.c * sqrt(state[0])  # the density is rho / det F, the moduli are constant


@elastic_strain.on(Hypoelastic)
def _(law, kin, state):
    # Hooke's law is isotropic and turns with the point, so the strain follows from the stress.
    stress = state[1:]
    half = real(0.5, law.G)
    mean = law.lam / (real(3, law.G) * law.lam + real(2, law.G) * law.G) * trace(stress)
    return scale(half / law.G, add_pressure(kin, real(1, law.G), stress, -mean))


@energy_density.on(Hypoelastic)
def _(law, kin, state):
    strain = elastic_strain(law, kin, state)
    return real(0.5, law.G) * state[0] * contract(kin, state[1:], strain)


@with_stress.on(Hypoelastic)
def _(law, kin, state, stress):
    return (state[0],) + stress


@reference_density.on(Hypoelastic)
def _(law):
    return law.rho
