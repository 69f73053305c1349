"""eos ideal-gas: a gas whose energy follows from the work done on it."""

from typing import Annotated, Any, NamedTuple

from karamelo_py.compiler.powers import power
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.eos import (
    at_pressure,
    bulk_modulus,
    compressed,
    compression_energy,
    initial_energy,
    pressure,
    stored_heat,
    taken_heat,
)
from karamelo_py.points.laws.viscosity.artificial import artificial_viscosity
from karamelo_py.script.errors import ScriptError


class IdealGas(NamedTuple):
    """Pressure of an ideal gas without conduction of heat.

    Parameters
    ----------
    rho0
        Density at the start.
    gamma
        Ratio of specific heats, above 1.
    p
        Pressure at the start.
    e
        Internal energy per mass at the start, in the place of p.
    Q1, Q2
        Coefficients of artificial viscosity, quadratic and linear, as in eos shock.

    Example
    -------
    eos(air, ideal-gas, 1.2, 1.4, p=1e5)

    Notes
    -----
    p = (gamma - 1) rho e, and de = -p dv with the volume v per mass: along an adiabat e grows as
    rho^(gamma - 1), which each step follows exactly. Viscous work heats the gas, and so does the
    kinetic energy that PIC, FLIP, APIC, MLS and TPIC take. Where there are shocks, Q1 = 2 and
    Q2 = 0.2 are usual.

    The gas presses on what is around it from the first step: a free surface expands. Fix
    initial_stress sets the pressure by the energy, and leaves the volume.

    See Also
    --------
    fluid, shock, strength fluid, material eos-strength
    """

    in_lanes = True
    any_speed = True
    least_density = 1e-3  # kg/m^3

    specific_volume: float  # reference volume per mass
    gamma: float  # ratio of specific heats
    energy: float  # E at the start, per reference volume

    @classmethod
    def given(
        cls,
        rho0: Annotated[float, Positive],
        gamma: float,
        *,
        p: Annotated[float, Positive] | None = None,
        e: Annotated[float, Positive] | None = None,
        Q1: Annotated[float, NonNegative] = 0.0,
        Q2: Annotated[float, NonNegative] = 0.0,
    ):
        """The gas and its artificial viscosity; the memory is its energy."""
        if not gamma > 1:
            raise ScriptError(
                f"the ratio of specific heats {gamma:g} is impossible",
                argument="gamma",
                expected="a number above 1, such as 1.4",
            )
        if (p is None) == (e is None):
            raise ScriptError(
                "the gas needs a pressure or an energy at the start"
                if p is None
                else "pressure and energy at the start are given; one follows from the other",
                expected="p=pressure or e=energy per mass",
            )
        energy = rho0 * e if p is None else p / (gamma - 1)
        return {"eos": cls(1 / rho0, gamma, energy), **artificial_viscosity(Q1, Q2)}


class InternalEnergy(NamedTuple):
    """State of a point."""

    E: Any  # per reference volume


@initial_energy.on(IdealGas)
def _initial_energy_ideal_gas(eos, like):
    return InternalEnergy(eos.energy)


@compressed.on(IdealGas)
def _compressed_ideal_gas(eos, memory, before, j, heating):
    # dE = -p dJ has the solution E J^(gamma - 1) = const, whatever the size of the step.
    return InternalEnergy(memory.E * power(before / j, eos.gamma - 1) + heating)


@taken_heat.on(IdealGas)
def _taken_heat_ideal_gas(eos, memory, heat):
    # A moment may hold a little more than there was: a cold gas does not pay all of that at once.
    return (max(heat, -0.1 * memory.E),)


@stored_heat.on(IdealGas)
def _stored_heat_ideal_gas(eos, loss):
    return loss


@pressure.on(IdealGas)
def _pressure_ideal_gas(eos, j, memory, heat):
    return (eos.gamma - 1) * memory.E / j


@bulk_modulus.on(IdealGas)
def _bulk_modulus_ideal_gas(eos, j, memory, heat):
    return eos.gamma * (eos.gamma - 1) * memory.E / j


@compression_energy.on(IdealGas)
def _compression_energy_ideal_gas(eos, j, memory):
    return memory.E - eos.energy


@at_pressure.on(IdealGas)
def _at_pressure_ideal_gas(eos, j, memory, p, heat):
    # The volume stays, the energy follows; a gas bears no tension.
    return j, InternalEnergy(max(p, 0) * j / (eos.gamma - 1))
