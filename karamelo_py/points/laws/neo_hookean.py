"""Compressible neo-Hookean solid: hyperelastic, so objective and without dissipation."""

from __future__ import annotations

from math import log
from typing import NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.compiler.tuples import scale
from karamelo_py.points.kinematics import (
    add_pressure,
    deform,
    determinant,
    identity,
    largest_row_sum,
    left_cauchy_green,
    right_cauchy_green,
    trace,
)
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    deformation,
    elastic_strain,
    energy_density,
    initial_state,
    jacobian,
    kirchhoff_stress,
    specific_volume,
    wave_speed_squared,
)


class Hyperelastic(NamedTuple):
    """Parameters of the law; the state of a point is the deformation gradient F."""

    specific_volume: float  # reference volume per mass
    lam: float  # Lame's first parameter
    G: float  # shear modulus


@initial_state.on(Hyperelastic)
def _(law, kin, like):
    return identity(kin, like)


@advance.on(Hyperelastic)
def _(law, kin, state, dl, dt):
    return deform(kin, dl, state)


@kirchhoff_stress.on(Hyperelastic)
def _(law, kin, state):
    # P = G (F - F^-T) + lam ln J F^-T, so tau = P F^T = G (b - I) + lam ln J I
    pressure = law.lam * log(determinant(kin, state)) - law.G
    return add_pressure(kin, law.G, left_cauchy_green(kin, state), pressure)


@cauchy_stress.on(Hyperelastic)
def _(law, kin, state):
    inverse = real(1, law.G) / determinant(kin, state)
    return scale(inverse, kirchhoff_stress(law, kin, state))


@deformation.on(Hyperelastic)
def _(law, kin, state):
    return state


@jacobian.on(Hyperelastic)
def _(law, kin, state):
    return determinant(kin, state)


@wave_speed_squared.on(Hyperelastic)
def _(law, kin, state):
    # Along a principal direction of stretch a, the tangent of P gives
    # rho c^2 = G (1 + a^2) + lam (1 - ln J); the largest row sum of b bounds the largest a^2.
    one = real(1, law.G)
    stretch = largest_row_sum(kin, left_cauchy_green(kin, state))
    bulk = law.lam * (one - log(determinant(kin, state)))
    return (law.G * (one + stretch) + max(bulk, real(0, law.G))) * law.specific_volume


@energy_density.on(Hyperelastic)
def _(law, kin, state):
    half = real(0.5, law.G)
    ln_j = log(determinant(kin, state))
    excess = trace(left_cauchy_green(kin, state)) - real(3, law.G)
    return half * law.G * excess - law.G * ln_j + half * law.lam * ln_j * ln_j


@elastic_strain.on(Hyperelastic)
def _(law, kin, state):
    """Green-Lagrange strain (F^T F - I) / 2."""
    half = real(0.5, law.G)
    return add_pressure(kin, half, right_cauchy_green(kin, state), -half)


@specific_volume.on(Hyperelastic)
def _(law):
    return law.specific_volume
