"""Mie-Grueneisen equation of state with the Hugoniot curve as its reference."""

from __future__ import annotations

from math import log1p, sqrt
from typing import NamedTuple

from karamelo_py.compiler.compile import real, shared
from karamelo_py.compiler.tuples import plus
from karamelo_py.points.laws.eos import (
    bulk_modulus,
    compression_energy,
    give_specific_volume,
    pressure,
    ratio_at_pressure,
)
from karamelo_py.points.laws.temperatures import excess

# S (1 - J) from where on the pressure goes on along its tangent: at 1 the Hugoniot has a pole.
_STEEPEST = 0.9


class Shock(NamedTuple):
    """Shock speed U = c0 + S u in proportion to the particle speed u."""

    specific_volume: float  # reference volume per mass
    modulus: float  # rho0 c0^2
    S: float
    thermal: float  # Gamma rho0 cv, pressure per kelvin above Tr
    Tr: float


give_specific_volume(Shock)


@shared
def tangent_from(eos, j):
    """The compression 1 - J beyond which pressure is a straight line."""
    limit = real(_STEEPEST, j)
    return limit / eos.S if limit < eos.S else limit


@shared
def cold_pressure(eos, j):
    """Pressure of the Hugoniot curve; rho0 c0^2 mu in tension."""
    one = real(1, j)
    closed = one - j
    if closed < 0:
        return eos.modulus * closed / j
    inside = min(closed, tangent_from(eos, j))
    y = eos.S * inside
    flat = one - y
    slope = (one + y) / (flat * flat * flat)
    return eos.modulus * (inside / (flat * flat) + slope * (closed - inside))


@pressure.on(Shock)
def _(eos, j, memory, heat):
    return plus(cold_pressure(eos, j), excess(heat, eos.Tr, eos.thermal))


@bulk_modulus.on(Shock)
def _(eos, j, memory, heat):
    one = real(1, j)
    closed = one - j
    if closed < 0:
        return eos.modulus / j
    y = eos.S * min(closed, tangent_from(eos, j))
    flat = one - y
    return j * eos.modulus * (one + y) / (flat * flat * flat)


@compression_energy.on(Shock)
def _(eos, j, memory):
    one = real(1, j)
    half = real(0.5, j)
    closed = one - j
    if closed < 0:
        # rho0 c0^2 (1 - J) / J from J to 1
        return -eos.modulus * (closed + log1p(-closed))
    inside = min(closed, tangent_from(eos, j))
    y = eos.S * inside
    if y < real(1e-3, j):  # the closed form is a small difference there
        energy = inside * inside * (half + y * (real(2 / 3, j) + real(0.75, j) * y))
    else:
        energy = (y / (one - y) + log1p(-y)) / (eos.S * eos.S)
    flat = one - y
    slope = (one + y) / (flat * flat * flat)
    further = closed - inside
    line = further * (inside / (flat * flat) + half * slope * further)
    return eos.modulus * (energy + line)


@ratio_at_pressure.on(Shock)
def _(eos, p, heat):
    one = real(1, p)
    two = real(2, p)
    cold = (p - plus(real(0, p), excess(heat, eos.Tr, eos.thermal))) / eos.modulus
    if cold < 0:
        return one / max(one + cold, real(1e-6, p))
    inside = tangent_from(eos, cold)
    y = eos.S * inside
    flat = one - y
    top = inside / (flat * flat)
    if cold > top:
        return one - inside - (cold - top) * flat * flat * flat / (one + y)
    k = two * cold * eos.S + one
    return one - two * cold / (k + sqrt(real(4, p) * cold * eos.S + one))
