"""Linear elasticity in rate form."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compiler.compile import point_function, real
from karamelo_py.compiler.tuples import add, scale
from karamelo_py.points.kinematics import (
    add_pressure,
    contract,
    spin,
    symmetric_part,
    trace,
    volume_ratio,
    zero_symmetric,
)
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    elastic_strain,
    energy_density,
    initial_state,
    jacobian,
    kirchhoff_stress,
    specific_volume,
    wave_speed_squared,
    with_stress,
)


class Jaumann(NamedTuple):
    """Parameters of the law whose stress turns with the spin of the point.

    The state of a point is (det F, Cauchy stress).
    """

    specific_volume: float  # reference volume per mass
    lam: float  # Lame's first parameter
    G: float  # shear modulus


class FixedFrame(NamedTuple):
    """The same law without the turn: its stress stays behind when a point turns (Karamelo's)."""

    specific_volume: float  # reference volume per mass
    lam: float  # Lame's first parameter
    G: float  # shear modulus


@point_function()
def turned(law, kin, dl, stress):
    """The old stress in the frame after the increment dl."""


@turned.on(Jaumann)
def _(law, kin, dl, stress):
    return spin(kin, dl, stress)


@turned.on(FixedFrame)
def _(law, kin, dl, stress):
    return stress


@initial_state.on(Jaumann)
@initial_state.on(FixedFrame)
def _(law, kin, like):
    return (real(1, like),) + zero_symmetric(kin, like)


@advance.on(Jaumann)
@advance.on(FixedFrame)
def _(law, kin, state, dl, dt):
    strain = symmetric_part(kin, dl)
    old = turned(law, kin, dl, state[1:])
    pressure = law.lam * trace(strain)
    increment = add_pressure(kin, real(2, law.G) * law.G, strain, pressure)
    return (state[0] * volume_ratio(kin, dl),) + add(old, increment)


@kirchhoff_stress.on(Jaumann)
@kirchhoff_stress.on(FixedFrame)
def _(law, kin, state):
    return scale(state[0], state[1:])


@cauchy_stress.on(Jaumann)
@cauchy_stress.on(FixedFrame)
def _(law, kin, state):
    return state[1:]


@jacobian.on(Jaumann)
@jacobian.on(FixedFrame)
def _(law, kin, state):
    return state[0]


@wave_speed_squared.on(Jaumann)
@wave_speed_squared.on(FixedFrame)
def _(law, kin, state):
    # (lam + 2 G) / rho: the moduli are constant, the volume per mass has grown by det F
    return (law.lam + real(2, law.G) * law.G) * law.specific_volume * state[0]


@elastic_strain.on(Jaumann)
@elastic_strain.on(FixedFrame)
def _(law, kin, state):
    # Hooke's law is isotropic and turns with the point, so the strain follows from the stress.
    stress = state[1:]
    half = real(0.5, law.G)
    mean = law.lam / (real(3, law.G) * law.lam + real(2, law.G) * law.G) * trace(stress)
    return scale(half / law.G, add_pressure(kin, real(1, law.G), stress, -mean))


@energy_density.on(Jaumann)
@energy_density.on(FixedFrame)
def _(law, kin, state):
    strain = elastic_strain(law, kin, state)
    return real(0.5, law.G) * state[0] * contract(kin, state[1:], strain)


@with_stress.on(Jaumann)
@with_stress.on(FixedFrame)
def _(law, kin, state, stress):
    return (state[0],) + stress


@specific_volume.on(Jaumann)
@specific_volume.on(FixedFrame)
def _(law):
    return law.specific_volume
