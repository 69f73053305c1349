"""Pressure of a liquid from a power of its density (Tait)."""

from __future__ import annotations

from math import log
from typing import NamedTuple

from karamelo_py.compile import real, round_off
from karamelo_py.points.materials.eos import (
    bulk_modulus,
    compression_energy,
    give_specific_volume,
    pressure,
    ratio_at_pressure,
)


class Tait(NamedTuple):
    """p = K ((rho / rho0)^gamma - 1)."""

    specific_volume: float  # reference volume per mass
    K: float  # reference pressure; K gamma is the bulk modulus
    gamma: float


give_specific_volume(Tait)


@pressure.on(Tait)
def _(eos, j, memory, heat):
    return eos.K * (j ** (-eos.gamma) - real(1, j))


@bulk_modulus.on(Tait)
def _(eos, j, memory, heat):
    return eos.K * eos.gamma * j ** (-eos.gamma)


@compression_energy.on(Tait)
def _(eos, j, memory):
    one = real(1, j)
    power = one - eos.gamma
    grown = -log(j) if power == 0 else (one - j**power) / power
    return eos.K * (grown - (one - j))


@ratio_at_pressure.on(Tait)
def _(eos, p, heat):
    # Tension of K would need an infinite volume.
    one = real(1, p)
    return max(one + p / eos.K, round_off(p)) ** (-one / eos.gamma)
