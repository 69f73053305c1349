"""Ideal gas, whose energy follows from the work done on it."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.points.laws.eos import (
    at_pressure,
    bulk_modulus,
    compressed,
    compression_energy,
    give_specific_volume,
    initial_energy,
    kept_heat,
    pressure,
)


class IdealGas(NamedTuple):
    """p = (gamma - 1) E / J; the memory is the internal energy E per reference volume."""

    specific_volume: float  # reference volume per mass
    gamma: float  # ratio of specific heats
    energy: float  # E at the start


give_specific_volume(IdealGas)


@initial_energy.on(IdealGas)
def _(eos, like):
    return (eos.energy,)


@compressed.on(IdealGas)
def _(eos, memory, before, j, heating):
    # dE = -p dJ has the solution E J^(gamma - 1) = const, whatever the size of the step.
    return (memory[0] * (before / j) ** (eos.gamma - real(1, j)) + heating,)


@kept_heat.on(IdealGas)
def _(eos, loss):
    return loss


@pressure.on(IdealGas)
def _(eos, j, memory, heat):
    return (eos.gamma - real(1, j)) * memory[0] / j


@bulk_modulus.on(IdealGas)
def _(eos, j, memory, heat):
    return eos.gamma * (eos.gamma - real(1, j)) * memory[0] / j


@compression_energy.on(IdealGas)
def _(eos, j, memory):
    return memory[0] - eos.energy


@at_pressure.on(IdealGas)
def _(eos, j, memory, p, heat):
    # The volume stays, the energy follows; a gas bears no tension.
    return j, (max(p, real(0, p)) * j / (eos.gamma - real(1, p)),)
