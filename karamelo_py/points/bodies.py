"""Points as bodies: the face that one shows to heat, forces between two that touch as spheres."""

from math import pi, sqrt
from typing import NamedTuple

from karamelo_py.compiler.compile import point_function
from karamelo_py.compiler.powers import power
from karamelo_py.points.kinematics import Axisymmetric, dot

NEW = 0.05  # share of the load of a step in the mean load


class Hertz(NamedTuple):
    """Spheres (in the plane, disks) that are pressed together elastically."""

    modulus: float  # E* with 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2


class MinimizePenetration(NamedTuple):
    """The force that undoes the penetration of two free points within a step; and rubs."""

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
def force_between(law, kin, dx, r, radius1, radius2, mass1, mass2, dt, kick):
    """Force across the surface on point 1 from point 2, at dx = x2 - x1.

    |dx| = r is below the sum of the radii.
    """


@force_between.on(Hertz)
def _force_between_hertz(law, kin, dx, r, radius1, radius2, mass1, mass2, dt, kick):
    p = radius1 + radius2 - r
    round_ = radius1 * radius2 / (radius1 + radius2)
    stiffness = 4.0 / 3.0 if kin.dimension == 3 else pi / 4.0
    return -stiffness * law.modulus * sqrt(round_ * p * p * p) / r * dx


@force_between.on(MinimizePenetration)
def _force_between_minimize_penetration(law, kin, dx, r, radius1, radius2, mass1, mass2, dt, kick):
    reduced = mass1 * mass2 / (mass1 + mass2)
    p = radius1 + radius2 - r
    return -reduced * p / (dt * kick) / r * dx


def rub(mu, hold, load, mean, unused, stop):
    """Coulomb friction that remembers what it holds: its force, and the memory after the step.

    A point that nothing else holds is stopped by m v/dt, the force `stop`. One that others lean on
    carries their load in each step, and would creep. Therefore a spring along the surface, as stiff
    as the contact across it, is stretched by all that the point slides. Its force `hold` returns to
    the cone of friction (Wriggers 2006, "Computational Contact Mechanics", chapter 5).

    The load of a point comes in pulses, since it bounces on a stiff contact: a step may use what
    friction left `unused` in the last steps, up to mu times their `mean` load. A point that slides
    all the time has mu times the load of each step.
    """
    mean = mean + NEW * (load - mean)
    unused = (1 - NEW) * unused + mu * load
    bound = mu * max(mean, load)
    force = _shortened(hold + stop, min(bound, unused))
    # Never below 0, not even by rounding: friction would drive the slip, and ever more.
    return force, _shortened(hold, bound), mean, max(unused - sqrt(force.squared()), 0.0)


def along(v, normal):
    """Return the part of a vector along a surface; all of it where the normal is 0."""
    square = normal.squared()
    return v + -(dot(v, normal) / square if square > 0 else 0.0) * normal


def _shortened(v, most):
    """Return a vector, shortened to a length."""
    size = sqrt(v.squared())
    return (most / size if size > most else 1.0) * v
