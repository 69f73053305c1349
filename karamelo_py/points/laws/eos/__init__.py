"""Equations of state: pressure of a point from its volume, positive in compression.

An equation of state is a NamedTuple of parameters with a `specific_volume`, a part of
`eos_strength`. `j` is det F, `heat` the temperature (`Warm`) or (), `memory` history variables.
"""

from typing import Any, NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.points.laws.parameters import AboveZero


@point_function(otherwise=True)
def initial_energy(eos, template):
    return ()


class VolumeStep(NamedTuple):
    before: Any  # volume ratio before the step
    j: Any  # volume ratio after the step
    dt: Any


@point_function(otherwise=True)
def compressed(eos, memory, step, heating):
    """Return the history after a `VolumeStep`; `heating`: plastic and viscous work per volume."""
    return memory


@point_function(otherwise=True)
def initial_loss(eos, template):
    """Return (0,) if the equation of state dissipates energy, else ()."""
    return ()


@point_function(otherwise=True)
def crush_work(eos, before, after, step):
    """Return the work of crushing pores between two states of the history variables."""
    return 0


@point_function(otherwise=True)
def crushed_strain(eos, before, after):
    """Return the volume strain of pores crushed between two states of the history variables."""
    return 0


@point_function(otherwise=True)
def ignited(eos, memory, since):
    """Return (memory,) of an explosive a time `since` after ignition, else ()."""
    return ()


@point_function(otherwise=True)
def taken_heat(eos, memory, heat):
    """Return (heat,), the part of `heat` that becomes internal energy, or ()."""
    return ()


@point_function(otherwise=True)
def stored_heat(eos, loss):
    """Return the dissipated energy that `compression_energy` contains."""
    return loss - loss


@point_function()
def pressure(eos, j, memory, heat):
    pass


@point_function()
def bulk_modulus(eos, j, memory, heat):
    pass


@point_function()
def compression_energy(eos, j, memory):
    """Return the integral of p dj from j to 1, per reference volume."""


@point_function()
def ratio_at_pressure(eos, p, heat):
    """Return the volume ratio at the pressure p, or at the nearest pressure the law reaches."""


@point_function(otherwise=True)
def at_pressure(eos, j, memory, p, heat):
    """Return volume ratio and history variables at the pressure p (fix initial_stress)."""
    return ratio_at_pressure(eos, p, heat), memory


class LinearPressure(NamedTuple):
    """Pressure proportional to the volume change.

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
    p = K (1 - J), with J = volume / volume before deformation; positive in compression.

    See Also
    --------
    strength, material eos-strength
    """

    in_lanes = True

    specific_volume: float
    K: float

    @classmethod
    def given(cls, rho0: AboveZero, K: AboveZero):
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
