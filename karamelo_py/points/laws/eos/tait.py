"""Pressure of a liquid from a power of its density (Tait)."""

from __future__ import annotations

from math import inf, log
from typing import NamedTuple

from karamelo_py.compiler.compile import real, round_off
from karamelo_py.points.laws.eos import (
    bulk_modulus,
    compression_energy,
    give_specific_volume,
    pressure,
    ratio_at_pressure,
)


class Tait(NamedTuple):
    """p = K ((rho / rho0)^gamma - 1), but not below -tension."""

    specific_volume: float  # reference volume per mass
    K: float  # reference pressure; K gamma is the bulk modulus
    gamma: float
    tension: float = inf  # that the liquid bears; from K on what the formula says


give_specific_volume(Tait)


@pressure.on(Tait)
def _(eos, j, memory, heat):
    return max(eos.K * (j ** (-eos.gamma) - real(1, j)), -eos.tension)


@bulk_modulus.on(Tait)
def _(eos, j, memory, heat):
    return eos.K * eos.gamma * j ** (-eos.gamma)


@compression_energy.on(Tait)
def _(eos, j, memory):
    one = real(1, j)
    power = one - eos.gamma
    whole = j if eos.tension >= eos.K else min(j, ratio_at_pressure(eos, -eos.tension, ()))
    grown = -log(whole) if power == 0 else (one - whole**power) / power
    energy = eos.K * (grown - (one - whole))
    # From there on at constant tension.
    return energy + eos.tension * (j - whole) if j > whole else energy


@ratio_at_pressure.on(Tait)
def _(eos, p, heat):
    # Tension of K would need an infinite volume.
    one = real(1, p)
    borne = max(p, -eos.tension)
    return max(one + borne / eos.K, round_off(p)) ** (-one / eos.gamma)
