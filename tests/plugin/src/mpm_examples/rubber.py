"""Rubber by Arruda & Boyce (1993): eight chains in a cube, with a limit of their stretch."""

from typing import Annotated, NamedTuple

from karamelo_py.compiler.powers import power
from karamelo_py.language.signature import Positive
from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, det, dev, tr
from karamelo_py.points.laws.elastic import OfDeformation

SERIES = 1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750


class _ArrudaBoyce(NamedTuple):
    specific_volume: float  # volume per mass before deformation
    mu: float
    N: float
    K: float


class ArrudaBoyce(OfDeformation, _ArrudaBoyce):
    """Rubber whose chains have a limit of their stretch.

    Parameters
    ----------
    rho
        Density before deformation.
    mu
        Shear modulus of the chains.
    N
        Segments of a chain; it locks at the stretch sqrt(N).
    K
        Bulk modulus.

    Example
    -------
    material(seal, mpm_examples.rubber.ArrudaBoyce, 1000, 3e5, 25, 1e8)
    """

    in_lanes = True  # several points at once

    @classmethod
    def given(
        cls,
        rho: Annotated[float, Positive],
        mu: Annotated[float, Positive],
        N: Annotated[float, Positive],
        K: Annotated[float, Positive],
    ):
        """The law from density, moduli and segments."""
        return cls(1 / rho, mu, N, K)


def slopes(law, x):
    """First and second derivative of the chain energy by x = J^(-2/3) tr b."""
    first = law.mu * sum(i * c * (x / law.N) ** (i - 1) for i, c in enumerate(SERIES, 1))
    second = sum(i * (i - 1) * c * (x / law.N) ** (i - 2) for i, c in enumerate(SERIES[1:], 2))
    return first, law.mu / law.N * second


@laws.kirchhoff_stress.on(ArrudaBoyce)
def kirchhoff_stress(law, kin, state):
    J, b = det(state.F), state.F.left_cauchy_green()
    part = power(J, -2 / 3)
    first, _ = slopes(law, part * tr(b))
    return 2 * first * part * dev(b) + law.K * J * (J - 1) * I


@laws.energy_density.on(ArrudaBoyce)
def energy_density(law, kin, state):
    J = det(state.F)
    x = power(J, -2 / 3) * tr(state.F.left_cauchy_green())
    chains = sum(c / law.N ** (i - 1) * (x**i - 3**i) for i, c in enumerate(SERIES, 1))
    return law.mu * chains + 0.5 * law.K * (J - 1) * (J - 1)


@laws.wave_speed_squared.on(ArrudaBoyce)
def wave_speed_squared(law, kin, state):
    """A bound: the largest stretch squared is below the largest row sum of b."""
    J, b = det(state.F), state.F.left_cauchy_green()
    part = power(J, -2 / 3)
    first, second = slopes(law, part * tr(b))
    a = part * b.largest_row_sum()
    modulus = 8 / 3 * first * a + 4 * second * a * a + law.K * J * max(2 * J - 1, 0)
    return modulus * law.specific_volume
