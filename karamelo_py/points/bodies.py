"""Points as bodies: the face that one shows to heat, forces between two that touch as spheres."""

from math import pi, sqrt
from typing import NamedTuple

from karamelo_py.compiler.compile import point_function
from karamelo_py.compiler.powers import power
from karamelo_py.points.kinematics import Axisymmetric, dot


class Hertz(NamedTuple):
    """Spheres (in the plane, disks) that are pressed together elastically."""

    modulus: float  # E* with 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2


class MinimizePenetration(NamedTuple):
    """The force that undoes the penetration of two free points within a step, with friction."""

    friction: float  # coefficient of Coulomb friction


def face(kin, volume, x):
    """Area that a point of this volume shows to what is around it: the side of a cube.

    Per length across the plane, per radian where axisymmetric.
    """
    if isinstance(kin, Axisymmetric):
        return sqrt(volume * x[0])  # r times the side of the square volume / r
    if kin.dimension == 2:
        return sqrt(volume)
    return power(volume, 2 / 3) if kin.dimension == 3 else 1


def radius(kin, volume, x):
    """Radius of the point's body: half the side of a cube of its volume."""
    if isinstance(kin, Axisymmetric):
        # The volume is that of one radian of a ring.
        return 0.5 * sqrt(volume / x[0]) if x[0] > 0 else 0.0
    if kin.dimension == 2:
        return 0.5 * sqrt(volume)
    return 0.5 * volume ** (1.0 / 3.0) if kin.dimension == 3 else 0.5 * volume


@point_function()
def force_between(law, kin, dx, r, radius1, radius2, mass1, mass2, dv, dt, kick):
    """Force on point 1 from point 2, at dx = x2 - x1 with |dx| = r below the sum of the radii."""


@force_between.on(Hertz)
def _force_between_hertz(law, kin, dx, r, radius1, radius2, mass1, mass2, dv, dt, kick):
    p = radius1 + radius2 - r
    round_ = radius1 * radius2 / (radius1 + radius2)
    stiffness = 4.0 / 3.0 if kin.dimension == 3 else pi / 4.0
    return -stiffness * law.modulus * sqrt(round_ * p * p * p) / r * dx


@force_between.on(MinimizePenetration)
def _force_between_minimize_penetration(
    law, kin, dx, r, radius1, radius2, mass1, mass2, dv, dt, kick
):
    reduced = mass1 * mass2 / (mass1 + mass2)
    p = radius1 + radius2 - r
    push = reduced * p / (dt * kick)
    force = -push / r * dx
    if law.friction > 0:
        along = dot(dv, dx)
        slide = dv + -along / (r * r) * dx
        slip = sqrt(slide.squared())
        if slip > 0:
            # Friction stops the slip of two free points at most: it does not turn it around.
            rub = min(law.friction * push, reduced * slip / kick)
            force = force + rub / slip * slide
    return force
