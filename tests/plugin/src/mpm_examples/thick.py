"""A viscous strength that tells the step of its viscosity."""

from math import sqrt
from typing import NamedTuple

from karamelo_py.points.kinematics import dev, inner
from karamelo_py.points.laws import strengths
from karamelo_py.points.laws.viscosity import damped


@strengths.without_shear_stiffness
class Bingham(NamedTuple):
    """Mud that flows beyond a yield stress.

    strength(mud, mpm_examples.thick.Bingham, 5, 20)
    """

    mu: float  # plastic viscosity
    yield_stress: float  # in shear
    slowest: float = 1e-2  # rate below which it is a thick fluid
    cell_size: float = 0.0  # set by the program


def viscosity(strength, rate):
    return strength.mu + strength.yield_stress / (rate + strength.slowest)


@strengths.shear_response.on(Bingham)
def shear_response(strength, kin, step, memory, heat):
    d = dev(step.strain)
    new = 2 / step.dt * viscosity(strength, sqrt(2 * inner(d, d)) / step.dt) * d
    return new, memory, inner(new, d)  # stress, memory, dissipated work per volume


@strengths.damped_speed_squared.on(Bingham)
def damped_speed_squared(strength, squared, density):
    nu = 4 / 3 * viscosity(strength, 0) / density
    return damped(squared, nu / strength.cell_size)  # makes the step shorter
