"""eos logarithmic: pressure from the logarithm of the volume."""

from math import exp, log
from typing import Annotated, NamedTuple

from karamelo_py.language.signature import Positive
from karamelo_py.points.laws.eos import (
    bulk_modulus,
    compression_energy,
    pressure,
    ratio_at_pressure,
)


class Logarithmic(NamedTuple):
    """Pressure p = -K ln J, with J the volume over the volume before deformation.

    Parameters
    ----------
    rho0
        Density before deformation.
    K
        Bulk modulus.

    Example
    -------
    eos(bulk, logarithmic, 7850, 160e9)
    """

    specific_volume: float
    K: float

    @classmethod
    def given(cls, rho0: Annotated[float, Positive], K: Annotated[float, Positive]):
        """The law from density and bulk modulus."""
        return cls(1 / rho0, K)


@pressure.on(Logarithmic)
def _pressure_logarithmic(eos, j, memory, heat):
    return -eos.K * log(j)


@bulk_modulus.on(Logarithmic)
def _bulk_modulus_logarithmic(eos, j, memory, heat):
    return eos.K


@compression_energy.on(Logarithmic)
def _compression_energy_logarithmic(eos, j, memory):
    # The integral of p dj from j to 1.
    return eos.K * (1 - j + j * log(j))


@ratio_at_pressure.on(Logarithmic)
def _ratio_at_pressure_logarithmic(eos, p, heat):
    return exp(-p / eos.K)
