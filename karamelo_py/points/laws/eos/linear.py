"""eos linear: pressure in proportion to the change of volume."""

from typing import Annotated, NamedTuple

from karamelo_py.language.signature import Positive
from karamelo_py.points.laws.eos import (
    bulk_modulus,
    compression_energy,
    pressure,
    ratio_at_pressure,
)


class LinearPressure(NamedTuple):
    """Pressure in proportion to the change of volume.

    Parameters
    ----------
    rho0
        Density before deformation.
    K
        Bulk modulus.

    Example
    -------
    eos(bulk, linear, 7850, 160e9)

    Notes
    -----
    p = K (1 - J), with J the volume over the volume before deformation; positive in compression.

    See Also
    --------
    strength, material eos-strength
    """

    in_lanes = True

    specific_volume: float  # reference volume per mass
    K: float

    @classmethod
    def given(cls, rho0: Annotated[float, Positive], K: Annotated[float, Positive]):
        """The law from density and bulk modulus."""
        return cls(1 / rho0, K)


@pressure.on(LinearPressure)
def _pressure_linear_pressure(eos, j, memory, heat):
    return eos.K * (1 - j)


@bulk_modulus.on(LinearPressure)
def _bulk_modulus_linear_pressure(eos, j, memory, heat):
    return eos.K * j


@compression_energy.on(LinearPressure)
def _compression_energy_linear_pressure(eos, j, memory):
    change = 1 - j
    return 0.5 * eos.K * change * change


@ratio_at_pressure.on(LinearPressure)
def _ratio_at_pressure_linear_pressure(eos, p, heat):
    return 1 - p / eos.K
