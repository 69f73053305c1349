"""A viscous strength that tells the step of its viscosity."""

from math import sqrt
from typing import NamedTuple

from karamelo_py.points.kinematics import dev, inner, nothing
from karamelo_py.points.laws import strengths


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
    # c' = sqrt(c^2 + a^2) + a for a = nu/h makes the program take steps below h^2/(2 nu).
    a = 4 / 3 * viscosity(strength, 0) / (density * strength.cell_size)
    return (sqrt(squared + a * a) + a) ** 2


strengths.shear_modulus.on(Bingham)(lambda strength: 0)
strengths.shear_energy.on(Bingham)(lambda strength, kin, s: 0)
strengths.shear_strain.on(Bingham)(lambda strength, kin, s: nothing(kin))
strengths.initial_loss.on(Bingham)(strengths.no_loss_yet)
