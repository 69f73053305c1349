"""Size of points as bodies, and the force between two touching spheres."""

from math import pi, sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.compiler.powers import power
from karamelo_py.points.kinematics import dot, product

NEW = 0.05  # weight of the last step in the mean load
DEEP = 0.1  # overlap above which springs are as stiff as the step allows, in sums of the radii
SQUARE = 0.9  # from parts of a cone to the mean of parts of a square, which a lattice adds up to 1


class Hertz(NamedTuple):
    """Spheres (disks in 2D) pressed together elastically."""

    modulus: float  # E* with 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2


class MinimizePenetration(NamedTuple):
    """Removes the overlap of two free points within a step, with Coulomb friction."""

    friction: float


class MeetingFaces(NamedTuple):
    """Removes the overlap of two faces within a step, with Coulomb friction."""

    friction: float


class Springs(NamedTuple):
    """Springs with Coulomb friction; deep overlaps are removed as by `MinimizePenetration`."""

    friction: float
    rate: float  # stiffness / reduced mass


def face(kin, volume, x):
    """Return the face area of a cubic point: per unit thickness in 2D, per angle in axisymmetry."""
    if kin.hoops and kin.dimension == 1:
        return product([x[0]] * kin.hoops)
    if kin.hoops:
        return sqrt(volume * x[0])  # r times the side of a square of area volume / r
    if kin.dimension == 2:
        return sqrt(volume)
    return power(volume, 2 / 3) if kin.dimension == 3 else 1


def radius(kin, volume, x):
    if kin.hoops and kin.dimension == 1:
        return 0.5 * volume / face(kin, volume, x) if x[0] > 0 else 0.0
    if kin.hoops:
        return 0.5 * sqrt(volume / x[0]) if x[0] > 0 else 0.0
    if kin.dimension == 2:
        return 0.5 * sqrt(volume)
    return 0.5 * volume ** (1.0 / 3.0) if kin.dimension == 3 else 0.5 * volume


class TouchingPair(NamedTuple):
    dx: Any
    r: Any  # |dx|, which is below the sum of the radii
    radii: tuple
    masses: tuple
    dt: Any
    kick: Any
    faces: tuple = ()  # two `Face`


class Face(NamedTuple):
    """A part of a body's surface next to a point."""

    normal: Any  # outward unit vector
    near: Any  # distance of the point from the face
    wide: Any  # width of the face; 0 for points in the interior
    flat: Any  # 1; 0 next to an edge


@point_function()
def force_between(law, kin, pair):
    """Return the force on the first point, and the stiffness of the pair against slip."""


@force_between.on(Hertz)
def _force_between_hertz(law, kin, pair):
    radius1, radius2 = pair.radii
    p = radius1 + radius2 - pair.r
    reduced = radius1 * radius2 / (radius1 + radius2)
    stiffness = 4.0 / 3.0 if kin.dimension == 3 else pi / 4.0
    return -stiffness * law.modulus * sqrt(reduced * p * p * p) / pair.r * pair.dx, 0.0


@force_between.on(MinimizePenetration)
def _force_between_minimize_penetration(law, kin, pair):
    (radius1, radius2), (mass1, mass2) = pair.radii, pair.masses
    reduced = mass1 * mass2 / (mass1 + mass2)
    p = radius1 + radius2 - pair.r
    force = -reduced * p / (pair.dt * pair.kick) / pair.r * pair.dx
    return force, reduced / (pair.dt * pair.kick)


@force_between.on(MeetingFaces)
def _force_between_faces(law, kin, pair):
    (face1, face2), (mass1, mass2) = pair.faces, pair.masses
    # A point next to an edge is a ball inside the body, so symmetric bodies meet symmetrically.
    edge1, edge2 = 1 - face1.flat, 1 - face2.flat
    n1, n2 = face1.flat * face1.normal, face2.flat * face2.normal
    facing = edge1 + edge2 > 0 or dot(n1, n2) < 0
    normal = n1 - n2 + edge1 * edge2 / pair.r * pair.dx
    normal = 1 / sqrt(normal.squared() if facing else 1.0) * normal
    apart, narrow = dot(pair.dx, normal), min(face1.wide, face2.wide)
    aside = sqrt(max(pair.r * pair.r - apart * apart, 0.0))
    p = face1.near * (edge1 + dot(n1, normal)) + face2.near * (edge2 - dot(n2, normal)) - apart
    common = min(0.5 * (face1.wide + face2.wide) - aside, narrow)
    touching = facing and 0 < p < narrow and common > 0
    # The widths of a body's faces add up to its surface, so the forces on a face do not depend on
    # how its points are opposite the points of the other body (in 3D by 4 % for equal widths).
    part = common / (narrow if narrow > 0 else 1.0)
    part *= 1 - (SQUARE * (1 - part) * (0.5 - part) if kin.dimension == 3 else 0.0)
    reduced = part * mass1 * mass2 / (mass1 + mass2)
    stiffness = reduced / (pair.dt * pair.kick) if touching else 0.0
    return -stiffness * p * normal, stiffness


@force_between.on(Springs)
def _force_between_springs(law, kin, pair):
    """Return minus the derivative of an energy of the overlap, as long as the step is constant."""
    (radius1, radius2), (mass1, mass2) = pair.radii, pair.masses
    reduced, both = mass1 * mass2 / (mass1 + mass2), radius1 + radius2
    p = both - pair.r
    most = 1 / (pair.dt * pair.kick)
    push = min(law.rate, most) * p + max(most - law.rate, 0.0) * max(p - DEEP * both, 0.0)
    return -reduced * push / pair.r * pair.dx, reduced * most


class FrictionMemory(NamedTuple):
    hold: Any  # force of the friction spring along the surface
    mean: Any  # mean load of the steps
    unused: Any  # friction that earlier steps did not use


def rub(mu, load, memory, stop):
    """Return the force of Coulomb friction with history, and the history after the step.

    The force `stop` = m v/dt would stop a free point, but loaded points would creep. Therefore slip
    also stretches a spring as stiff as the normal contact, whose force `hold` is returned to the
    friction cone (Wriggers 2006, "Computational Contact Mechanics", chapter 5). As points bounce on
    stiff contacts, friction left `unused` by earlier steps may be used later, up to mu times the
    `mean` load. On a point that always slides, friction is mu times the load of each step.
    """
    hold, mean, unused = memory
    mean = mean + NEW * (load - mean)
    unused = (1 - NEW) * unused + mu * load
    bound = mu * max(mean, load)
    force = _shortened(hold + stop, min(bound, unused))
    # Rounding must not make friction negative, which would accelerate the slip.
    left = max(unused - sqrt(force.squared()), 0.0)
    return force, FrictionMemory(_shortened(hold, bound), mean, left)


def along(v, normal):
    square = normal.squared()
    return v + -(dot(v, normal) / square if square > 0 else 0.0) * normal


def _shortened(v, most):
    size = sqrt(v.squared())
    return (most / size if size > most else 1.0) * v
