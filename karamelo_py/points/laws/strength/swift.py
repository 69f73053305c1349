"""Flow stress with a plateau, then a power of plastic strain (Swift 1952)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.points.laws.strength.hardening import flow_stress, give_hardening
from karamelo_py.points.laws.strength.johnson_cook import power_law


class Swift(NamedTuple):
    """A + B (ep - C)^n where ep > C, else A; the memory is the plastic strain."""

    G: float  # shear modulus
    A: float  # flow stress at first
    B: float  # hardening
    C: float  # plastic strain at the end of the plateau
    n: float


give_hardening(Swift)


@flow_stress.on(Swift)
def _(strength, strain, increment, heat, dt):
    hard, slope = power_law(strength.B, strength.n, strain + increment - strength.C)
    return strength.A + hard, slope
