"""Foamed rubber of Blatz and Ko (1962): a law of the deformation gradient."""

from typing import NamedTuple

from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, det, inv, tr
from karamelo_py.points.laws.elastic import of_deformation
from karamelo_py.points.laws.parameters import AboveZero


@of_deformation
class BlatzKo(NamedTuple):
    """Rubber with Poisson's ratio 1/4: W = mu/2 (tr b^-1 + 2 J - 5), with b = F F^T.

    material(seal, mpm_examples.rubber.BlatzKo, 1000, 3e5)
    """

    in_lanes = True  # several points at once

    rho: AboveZero
    mu: AboveZero


@laws.kirchhoff_stress.on(BlatzKo)
def kirchhoff_stress(law, kin, state):
    return law.mu * (det(state.F) * I - inv(state.F.left_cauchy_green()))


@laws.energy_density.on(BlatzKo)
def energy_density(law, kin, state):
    return law.mu / 2 * (tr(inv(state.F.left_cauchy_green())) + 2 * det(state.F) - 5)


@laws.wave_speed_squared.on(BlatzKo)
def wave_speed_squared(law, kin, state):
    # along a principal stretch l: l^2 d2W/dl^2 = 3 mu/l^2
    return 3 * law.mu * inv(state.F.left_cauchy_green()).largest_row_sum() / law.rho
