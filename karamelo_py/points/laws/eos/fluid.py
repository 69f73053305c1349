"""eos fluid: Tait's equation of state."""

from math import inf
from typing import Annotated, NamedTuple

from karamelo_py.compiler.compile import real, round_off
from karamelo_py.compiler.powers import logarithm, power
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.eos import (
    bulk_modulus,
    compression_energy,
    pressure,
    ratio_at_pressure,
)


class Tait(NamedTuple):
    """Pressure of a liquid from a power of its density (Tait).

    Parameters
    ----------
    rho0
        Density at zero pressure.
    K
        Reference pressure; the bulk modulus is K gamma.
    gamma
        Exponent, 7 for water.
    tension
        Tension that the liquid bears (0: none); by default what the formula gives, up to K.

    Example
    -------
    eos(water, fluid, 1000, 2.2e9/7, 7)
    eos(spray, fluid, 1000, 1e5, 7, tension=0)

    Notes
    -----
    p = K ((rho/rho0)^gamma - 1) (Cole 1948; Monaghan 1994). The speed of sound is
    sqrt(K gamma/rho0) at zero pressure. A smaller K than that of the liquid allows longer time
    steps, and the density stays within 1 % where no speed is above a tenth of that of sound.
    Where a liquid splashes, drops that are pulled apart swell and cling together by tension:
    ``tension=0`` lets them go.

    See Also
    --------
    strength fluid, ideal-gas, material eos-strength
    """

    in_lanes = True
    any_speed = True
    one_by_one = ("compression_energy",)

    specific_volume: float  # reference volume per mass
    K: float  # reference pressure; K gamma is the bulk modulus
    gamma: float
    tension: float = inf  # that the liquid bears; from K on what the formula says

    @classmethod
    def given(
        cls,
        rho0: Annotated[float, Positive],
        K: Annotated[float, Positive],
        gamma: Annotated[float, Positive],
        *,
        tension: Annotated[float, NonNegative] = inf,
    ):
        """The law from density, reference pressure and exponent."""
        return cls(1 / rho0, K, gamma, tension)


@pressure.on(Tait)
def _pressure_tait(eos, j, memory, heat):
    return max(eos.K * (power(j, -eos.gamma) - real(1, j)), -eos.tension)


@bulk_modulus.on(Tait)
def _bulk_modulus_tait(eos, j, memory, heat):
    return eos.K * eos.gamma * power(j, -eos.gamma)


@compression_energy.on(Tait)
def _compression_energy_tait(eos, j, memory):
    one = real(1, j)
    exponent = one - eos.gamma
    whole = j if eos.tension >= eos.K else min(j, ratio_at_pressure(eos, -eos.tension, ()))
    grown = -logarithm(whole) if exponent == 0 else (one - power(whole, exponent)) / exponent
    energy = eos.K * (grown - (one - whole))
    # From there on at constant tension.
    return energy + eos.tension * (j - whole) if j > whole else energy


@ratio_at_pressure.on(Tait)
def _ratio_at_pressure_tait(eos, p, heat):
    # Tension of K would need an infinite volume.
    one = real(1, p)
    borne = max(p, -eos.tension)
    return power(max(one + borne / eos.K, round_off(p)), -one / eos.gamma)
