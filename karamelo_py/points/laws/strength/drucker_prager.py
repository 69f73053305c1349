"""Drucker-Prager strength: a cone around the axis of pressure, cut off in tension."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.compiler.tuples import scale
from karamelo_py.points.kinematics import contract
from karamelo_py.points.laws.strength import pressure_response
from karamelo_py.points.laws.strength.frictional import give_friction, surface


class DruckerPrager(NamedTuple):
    """sqrt(s:s / 2) <= cohesion + friction p, and p >= -tension."""

    G: float  # shear modulus
    cohesion: float
    friction: float
    dilation: float
    tension: float
    residual_cohesion: float  # at the end of softening
    residual_friction: float
    softening: float  # share of the way to the residual for each unit of plastic strain, or 0


give_friction(DruckerPrager)


@pressure_response.on(DruckerPrager)
def _(strength, kin, s, p, K, strain):
    cohesion, friction, dilation = surface(strength, strain)
    zero = real(0, p)
    trial = sqrt(real(0.5, p) * contract(kin, s, s))
    lowest = -strength.tension
    if friction > 0:
        lowest = max(lowest, -cohesion / friction)
    f = trial - cohesion - friction * p
    root = trial
    if f > 0:
        x = f / (strength.G + K * friction * dilation)
        p += K * dilation * x
        root = cohesion + friction * p
        if p < lowest:
            # Beyond the end of the cone: the trial pressure counts again, see below.
            p -= K * dilation * x
    if p < lowest:
        p = lowest
        root = min(trial, cohesion + friction * lowest)
    if root < trial:
        return scale(max(root, zero) / trial, s), p
    return s, p
