"""Flow stress that depends on plastic strain, its rate, and temperature (Johnson & Cook 1983)."""

from __future__ import annotations

from math import log
from typing import NamedTuple

from karamelo_py.compiler.compile import by_type, real, shared
from karamelo_py.points.laws.strength.hardening import flow_stress, give_hardening
from karamelo_py.points.laws.temperatures import homologous


class JohnsonCook(NamedTuple):
    """(A + B ep^n) (1 + C ln(rate/epsdot0)) (1 - T*^m); the memory is the plastic strain."""

    G: float  # shear modulus
    A: float  # flow stress at first
    B: float  # hardening
    n: float
    epsdot0: float  # reference rate, at and below which the factor of the rate is 1
    C: float
    m: float  # 0 for no thermal softening
    Tr: float
    Tm: float


give_hardening(JohnsonCook)


@shared
def power_law(factor, exponent, strain):
    """factor strain^exponent and its slope; at no strain the slope is left out."""
    if strain > 0:
        value = factor * strain**exponent
        return value, exponent * value / strain
    return real(0, strain), real(0, strain)


@shared
def softening(star, m):
    """1 - star^m, and 1 for m = 0."""
    one = real(1, m)
    return one - star**m if m > 0 else one


def softened(stress, star, m):
    """`stress` times the factor of the homologous temperature (star,), if there is one."""
    return stress * softening(star[0], m) if len(star) else stress


@by_type(softened)
def _softened(stress, star, m):
    if len(star) == 0:
        return lambda stress, star, m: stress
    return lambda stress, star, m: stress * softening(star[0], m)


@flow_stress.on(JohnsonCook)
def _(strength, strain, increment, heat, dt):
    one = real(1, strain)
    hard, slope = power_law(strength.B, strength.n, strain + increment)
    static = softened(strength.A + hard, homologous(heat, strength.Tr, strength.Tm), strength.m)
    slope = softened(slope, homologous(heat, strength.Tr, strength.Tm), strength.m)
    rate = increment / (dt * strength.epsdot0)
    if rate > one:
        factor = one + strength.C * log(rate)
        return static * factor, slope * factor + static * strength.C / increment
    return static, slope
