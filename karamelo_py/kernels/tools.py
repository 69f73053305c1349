"""Tools of simple shapes that push points: depth of a point, and the force on it.

The values of a tool are its formulas of time, at the start of the step.
"""

from collections.abc import Callable
from math import cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import classes_in, implements, importable, kernel, point_function
from karamelo_py.compiler.fields import field, increase, load_vector, store
from karamelo_py.kernels import hooks
from karamelo_py.kernels.arrays import first_from, vector_at
from karamelo_py.kernels.equations.internal_force import ContactLoss
from karamelo_py.kernels.touching import written_force
from karamelo_py.kernels.views import volume_of
from karamelo_py.points.bodies import FrictionMemory, along, face, radius, rub
from karamelo_py.points.kinematics import dot, vector, zero_vector
from karamelo_py.points.laws import can, damage, defined_by

CLOSE = 0.5  # distance in radii within which a bouncing point retains its friction spring


class FlatSide(NamedTuple):
    """Values: a position (d,), and the normal (d,) towards the side of the points."""


class Ball(NamedTuple):
    """Values: radius, centre (d,), and, with friction, velocity (d,)."""


class Wedge(NamedTuple):
    """Values: tip (2,), and a position on each face (2,)."""


class Channel(NamedTuple):
    """A cylinder around a square channel.

    Values: half the width of the channel, position of the axis (2,), angle of rotation, lower and
    upper end, radius.
    """

    axis = 0


class ChannelY(Channel):
    axis = 1


class ChannelZ(Channel):
    axis = 2


CHANNELS = {"x": Channel, "y": ChannelY, "z": ChannelZ}


@point_function()
def way_out(shape, kin, values, x):
    """Return the depth of `x` in a shape, negative outside, and the unit direction out (d,)."""


@way_out.on(FlatSide)
def _way_out_plane(shape, kin, values, x):
    normal = x._make(values[kin.dimension : 2 * kin.dimension])
    normal = 1 / sqrt(normal.squared()) * normal
    return dot(x._make(values[: kin.dimension]) - x, normal), normal


@way_out.on(Ball)
def _way_out_ball(shape, kin, values, x):
    away = x - x._make(values[1 : 1 + kin.dimension])
    r = sqrt(away.squared())
    return values[0] - r, (1 / r if r > 0 else 0.0) * away


@way_out.on(Wedge)
def _way_out_wedge(shape, kin, values, x):
    tip = x._make(values[:2])
    a, b = x._make(values[2:4]) - tip, x._make(values[4:6]) - tip
    turn = a[0] * b[1] - a[1] * b[0]
    side = turn / abs(turn)  # NaN if the faces lie in one line
    first = side / sqrt(a.squared()) * x._make((a[1], -a[0]))
    second = side / sqrt(b.squared()) * x._make((-b[1], b[0]))
    of_first, of_second = dot(tip - x, first), dot(tip - x, second)
    if of_first <= of_second:
        return of_first, first
    return of_second, second


@way_out.on(Channel)
def _way_out_channel(shape, kin, values, x):
    """The shortest way leads into the channel, out of the cylinder, or past the lower end."""
    width, c1, c2, angle, low, high, end = values[:7]
    first, second = [k for k in range(3) if k != shape.axis]
    height, q, p = x[shape.axis] - low, x[first] - c1, x[second] - c2
    turned = (cos(angle) * q + sin(angle) * p, cos(angle) * p - sin(angle) * q)
    r, into = sqrt(q * q + p * p), [min(max(t, -width), width) - t for t in turned]
    outward = end / r - 1 if r > 0 else 0.0
    across = (
        cos(angle) * into[0] - sin(angle) * into[1],
        sin(angle) * into[0] + cos(angle) * into[1],
    )
    ways = [(*across, 0.0), (outward * q, outward * p, 0.0), (0.0, 0.0, -height)]
    shortest, square = ways[0], into[0] ** 2 + into[1] ** 2
    for way in ways[1:]:
        length = way[0] ** 2 + way[1] ** 2 + way[2] ** 2
        if length < square:
            shortest, square = way, length
    depth = min(height, high - low - height, end - r, max(abs(turned[0]), abs(turned[1])) - width)
    places = {first: 0, second: 1, shape.axis: 2}
    out = vector(kin, [shortest[places[k]] for k in range(3)])
    size = sqrt(square)
    depth = size if depth > 0 else depth
    return depth, (1 / size if size > 0 else 0.0) * out


class PushedPoint(NamedTuple):
    x: Any  # (d,)
    mass: Any
    side: Any  # of a cube of the point's volume
    modulus: Any  # shear modulus, reduced by damage; 0 for laws that do not use it


class BySquare(NamedTuple):
    """Force m K p^2 at the depth p; K is the first value."""


class ByModulus(NamedTuple):
    """Force K G p, times the side of the point if `by_side`; K is the first value."""

    by_side: bool
    moduli: np.ndarray | None = None  # (S,) shear moduli of the solids
    firsts: np.ndarray | None = None  # (S,) ids of their first points


class Stiff(NamedTuple):
    """Force m p / dt^2 on a point as a ball, and friction."""

    mu: float


@point_function(otherwise=True)
def modulus_of(law, members, one):
    return 0.0


@modulus_of.on(ByModulus)
def _modulus_of_by_modulus(law, members, one):
    solid = first_from(law.firsts, 0, law.firsts.size, members.ids[one.p] + 1) - 1
    return law.moduli[solid] * (1 - float(damage_of(one.law, members.kin, one.state)))


def damage_of(law, kin, state):
    """Return the damage of a point, 0 for laws without."""
    return damage(law, kin, state) if can(law, damage) else 0.0


@implements(damage_of, by_type=True)
def _damage_of(law, kin, state):
    if defined_by(classes_in(law), damage):
        return lambda law, kin, state: damage(law, kin, state)  # a point function needs a caller
    return lambda law, kin, state: 0.0


@point_function()
def push(law, kin, values, point, out):
    """Return the force (d,) on a point; `out`: its depth in the shape and the direction out."""


@push.on(BySquare)
def _push_by_square(law, kin, values, point, out):
    depth, normal = out
    return point.mass * values[0] * max(depth, 0.0) ** 2 * normal


@push.on(ByModulus)
def _push_by_modulus(law, kin, values, point, out):
    depth, normal = out
    size = values[0] * point.modulus * max(depth, 0.0)
    return (size * point.side if law.by_side else size) * normal


@kernel
def push_points(kin, tag, values, points, force):
    """Set the forces (n, d) on n points, given by a `PushedPoint` of arrays."""
    none = zero_vector(kin, 0.0)
    for p in range(points.mass.size):
        x = vector_at(kin, points.x, p, 0, none)
        point = PushedPoint(x, points.mass[p], points.side[p], points.modulus[p])
        out = way_out(tag.shape, kin, values[1:], x)
        pushed = push(tag.law, kin, values, point, out)
        for k in range(kin.dimension):
            force[p, k] = pushed[k]


@kernel
def find_depths(kin, shape, values, x, depths):
    for p in range(depths.size):
        depths[p], _ = way_out(shape, kin, values, vector_at(kin, x, p, 0, zero_vector(kin, 0.0)))


class Press(NamedTuple):
    """A tool for a hook on whole points (`kernels.hooks`)."""

    row: int
    values: tuple
    shape: NamedTuple
    law: NamedTuple

    of_nodes = False
    of_time = True
    ahead = False


hooks.written.on(Press)(written_force)


class PressSquare(Press):
    """Also publishes the number of points that are pushed."""


class PressStiffly(Press):
    """Friction of fix `grip` (`points.bodies.rub`), if any, is remembered at points."""


class PressBall(PressStiffly):
    """Also publishes the area of contact."""


@point_function(otherwise=True)
def grip_of(tag, members):
    """Return the field of a fix's friction state, or None."""
    return None


def _position(members, one):
    kin = members.kin
    return zero_vector(kin, 0.0)._make([float(a) for a in load_vector(kin, members.x, one.p)])


def _pushed_point(members, one, x):
    """Return a point at `x`, without its modulus, and its volume."""
    kin = members.kin
    volume = float(volume_of(kin, members.points, one.law, one.state, one.p))
    mass = float(members.points.mass[one.p])
    return PushedPoint(x, mass, 2 * radius(kin, volume, x), 0.0), volume


@hooks.results.on(Press)
def _results_of_press(tag, members, one):
    values, x = one.values, _position(members, one)
    out = way_out(tag.shape, members.kin, values[1:], x)
    if out[0] <= 0:  # not NaN, for a shape without a direction
        return x - x
    point, _ = _pushed_point(members, one, x)
    point = point._replace(modulus=modulus_of(tag.law, members, one))
    return push(tag.law, members.kin, values, point, out)


@hooks.results.on(PressSquare)
def _results_of_press_square(tag, members, one):
    force = _results_of_press(tag, members, one)
    return (*force, *(0.0,) * (3 - len(force)), 1.0 if force.squared() > 0 else 0.0)


@point_function(otherwise=True)
def velocity_of(shape, kin, values):
    """Return the velocity of a tool that rubs on points (d,)."""
    return zero_vector(kin, 0.0)


@velocity_of.on(Ball)
def _velocity_of_ball(shape, kin, values):
    return zero_vector(kin, 0.0)._make(values[1 + kin.dimension : 1 + 2 * kin.dimension])


@hooks.results.on(PressStiffly)
def _results_of_press_stiffly(tag, members, one):
    point, _ = _pushed_point(members, one, _position(members, one))
    force, _ = _press_stiffly(tag, members, one, point)
    return force


@hooks.results.on(PressBall)
def _results_of_press_ball(tag, members, one):
    point, volume = _pushed_point(members, one, _position(members, one))
    force, overlap = _press_stiffly(tag, members, one, point)
    area = face(members.kin, volume, point.x) if overlap > 0 else 0.0
    return (*force, *(0.0,) * (3 - len(force)), area)


def _press_stiffly(tag, members, one, point):
    """Return the force that moves a free point out of the shape in a step, and the overlap.

    Friction, at most mu times this force (de Vaucorbeil & Nguyen 2021), stops and reverses the
    slip.
    """
    kin, d, values, dt = members.kin, members.kin.dimension, one.values, one.dt
    contact_dt, contact_kick, kick = values[len(values) - 3 :]
    depth, normal = way_out(tag.shape, kin, values, point.x)
    depth, none = depth + 0.5 * point.side, point.x - point.x
    stiffness = point.mass / (contact_dt * contact_kick)
    load, grip = stiffness * max(depth, 0.0), grip_of(tag, members)
    force = load * normal
    if grip is None:
        return force, depth
    if not depth > -CLOSE * 0.5 * point.side:
        if grip[d, one.p] != 0:
            store(grip, one.p, (0.0,) * (2 * d + 2))
        return force, depth
    velocity, way = velocity_of(tag.shape, kin, values), none
    now = none._make([float(v) for v in load_vector(kin, members.points.v, one.p)])
    slip = velocity - now
    if grip[d, one.p] > 0:  # from displacements, as velocities contain null-space noise
        before = none._make([float(grip[d + 2 + k, one.p]) for k in range(d)])
        way = dt * velocity - (point.x - before)
        slip = 1 / (2 * kick - dt) * way
    hold = none._make([float(grip[k, one.p]) for k in range(d)])
    memory = FrictionMemory(
        along(hold + stiffness * way, normal), float(grip[d, one.p]), float(grip[d + 1, one.p])
    )
    rubbed, after = rub(tag.law.mu, load, memory, along(contact_dt * stiffness * slip, normal))
    store(grip, one.p, (*after.hold, after.mean, after.unused, *point.x))
    increase(field(members.points.fields, ContactLoss), one.p, (kick * dot(rubbed, slip),))
    return force + rubbed, depth


def press_kind(base: type, grip: type | None) -> type[Press]:
    """Return the class of a tool's tag whose friction is remembered in the field `grip`."""
    if grip is None:
        return base
    name = f"{base.__name__}{grip.__name__}"

    def made() -> type:
        kind = type(name, (base,), {"__module__": __name__})

        @grip_of.on(kind)
        def _grip_of(tag, members):
            return field(members.points.fields, grip)

        return kind

    return importable(__name__, name, made)


def press_hook(tag: Callable) -> hooks.CompiledHook:
    """Make the hook of a fix; ``tag(row, values)`` makes a `Press`."""
    return hooks.CompiledHook(
        push, hooks.WHOLE_POINTS, True, False, False, False, tag, internal=True
    )
