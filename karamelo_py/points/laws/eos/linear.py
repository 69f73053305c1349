"""Pressure in proportion to the change of volume."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.points.laws.eos import (
    bulk_modulus,
    compression_energy,
    give_specific_volume,
    pressure,
    ratio_at_pressure,
)


class LinearPressure(NamedTuple):
    """p = K (1 - J)."""

    specific_volume: float  # reference volume per mass
    K: float  # bulk modulus


give_specific_volume(LinearPressure)


@pressure.on(LinearPressure)
def _(eos, j, memory, heat):
    return eos.K * (real(1, eos.K) - j)


@bulk_modulus.on(LinearPressure)
def _(eos, j, memory, heat):
    return eos.K * j


@compression_energy.on(LinearPressure)
def _(eos, j, memory):
    change = real(1, eos.K) - j
    return real(0.5, eos.K) * eos.K * change * change


@ratio_at_pressure.on(LinearPressure)
def _(eos, p, heat):
    return real(1, eos.K) - p / eos.K
