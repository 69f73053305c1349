"""Damage by plastic strain (Johnson & Cook 1985)."""

from __future__ import annotations

from math import exp, log
from typing import NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.compiler.tuples import plus, scale
from karamelo_py.points.laws.damages import (
    damage_after,
    damage_begun,
    initial_damage,
    integrity,
)
from karamelo_py.points.laws.temperatures import homologous

# Under triaxialities below this, failure strain is without bounds for most metals.
_CLOSED = -3.0
_SMALLEST_FAILURE_STRAIN = 1e-6
# Damage grows from 0 to 1 while the sum of strain over failure strain grows from 1 by 1 / this.
_BRITTLENESS = 10.0


class JohnsonCookDamage(NamedTuple):
    """Failure strain (d1 + d2 exp(d3 t)) (1 + d4 ln(rate/epsdot0)) (1 + d5 T*)."""

    d1: float
    d2: float
    d3: float
    d4: float
    d5: float
    epsdot0: float
    Tr: float
    Tm: float


@initial_damage.on(JohnsonCookDamage)
def _(damage, like):
    return (real(0, like),)


@damage_after.on(JohnsonCookDamage)
def _(damage, memory, strain, triaxiality, heat, dt):
    if not (strain > 0 and triaxiality > real(_CLOSED, strain)):
        return memory
    one = real(1, strain)
    failure = damage.d1 + damage.d2 * exp(min(damage.d3 * triaxiality, real(50, strain)))
    rate = max(strain / (dt * damage.epsdot0), one)
    failure *= one + damage.d4 * log(rate)
    failure *= plus(one, scale(damage.d5, homologous(heat, damage.Tr, damage.Tm)))
    return (memory[0] + strain / max(failure, real(_SMALLEST_FAILURE_STRAIN, strain)),)


@integrity.on(JohnsonCookDamage)
def _(damage, memory):
    one = real(1, memory[0])
    zero = real(0, memory[0])
    D = real(_BRITTLENESS, memory[0]) * (memory[0] - one)
    return (one - min(max(D, zero), one),)


@damage_begun.on(JohnsonCookDamage)
def _(damage, memory):
    return memory[0]
