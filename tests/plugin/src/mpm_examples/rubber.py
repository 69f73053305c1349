"""Rubber of Gent (1996): a law of the deformation gradient."""

from typing import NamedTuple

from karamelo_py.compiler.powers import logarithm, power
from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, det, dev, tr
from karamelo_py.points.laws.elastic import OfDeformation


class Parameters(NamedTuple):
    specific_volume: float
    mu: float
    Jm: float
    K: float


class Gent(OfDeformation, Parameters):
    """Rubber whose I1 - 3 has a limit Jm.

    material(seal, mpm_examples.rubber.Gent, 1000, 3e5, 80, 1e8)
    """

    in_lanes = True  # several points at once

    @classmethod
    def given(cls, rho: float, mu: float, Jm: float, K: float):
        return cls(1 / rho, mu, Jm, K)


def isochoric(state):
    J = det(state.F)
    return J, power(J, -2 / 3) * state.F.left_cauchy_green()


@laws.kirchhoff_stress.on(Gent)
def kirchhoff_stress(law, kin, state):
    J, b = isochoric(state)
    return law.mu * law.Jm / (law.Jm + 3 - tr(b)) * dev(b) + law.K * J * (J - 1) * I


@laws.energy_density.on(Gent)
def energy_density(law, kin, state):
    J, b = isochoric(state)
    chains = -0.5 * law.mu * law.Jm * logarithm(1 - (tr(b) - 3) / law.Jm)
    return chains + 0.5 * law.K * (J - 1) * (J - 1)


@laws.wave_speed_squared.on(Gent)
def wave_speed_squared(law, kin, state):
    J, b = isochoric(state)
    largest, slope = b.largest_row_sum(), law.mu * law.Jm / (law.Jm + 3 - tr(b))
    chains = slope * largest * (4 / 3 + 2 * slope * largest / (law.mu * law.Jm))
    return (chains + law.K * J * max(2 * J - 1, 0)) * law.specific_volume
