"""Contact of points, as balls, with the surface of a shape that may move.

Forces act along the steepest descent of the depth.
"""

from collections.abc import Callable
from math import sqrt
from typing import Any, NamedTuple

from numba import types

from karamelo_py.compiler import caller_of, importable, kernel, noinline, point_function
from karamelo_py.compiler.fields import field, increase, load_vector, store
from karamelo_py.kernels import hooks
from karamelo_py.kernels.arrays import vector_at
from karamelo_py.kernels.equations.internal_force import (
    DAMPING,
    DEPTH,
    FOLLOWED,
    RADIUS,
    RATE,
    ContactLoss,
    Force,
)
from karamelo_py.kernels.surfaces import depth, slopes
from karamelo_py.kernels.views import volume_of
from karamelo_py.points.bodies import FrictionMemory, along, radius, rub
from karamelo_py.points.kinematics import dot, zero_vector

STIFF = 0.5  # stiffness / (m / dt^2)
DAMPED = 0.02  # damping / (m / dt)
STIFFENING = 0.02  # growth of the stiffness of a deep contact per step
ASIDE = 0.05  # finite-difference step of the depth / reach
LEVEL = 1e-3  # relative change of depth below which there is no direction
CALL = types.int64(types.int64)

_call = caller_of(CALL)


class Touch(NamedTuple):
    """A shape that pushes points out, for a hook on whole points (`kernels.hooks`)."""

    row: int
    values: tuple
    shape: NamedTuple
    mu: float
    reach: float  # largest depth that is computed
    lost: int  # address of a function that reports points without a way out

    of_nodes = False
    of_time = ahead = True  # evaluates formulas of time also at the end of the step


def direction_of(falls, step):
    """Return the unit direction of depth differences in two steps; 0 if depth is constant."""
    size = sqrt(falls.squared())
    return (1 / size if size > LEVEL * step else 0.0) * falls


@point_function()
def memory_of(tag, members):
    """Return the fix's arrays of lever, grip (or None) and loss."""


def ball_at_first(ball, within, closer):
    """Return the radius of a point at first contact; `closer` is its approach in the last step.

    Points that begin inside, as at stair-stepped faces, must not gain energy: the radius of their
    balls is the distance to the surface.
    """
    room = max(closer, 0.0) - within
    return min(ball, room) if room > 0 else ball


def spring_rate(before, now, within, reach):
    """Return stiffness / mass, constant from the first touch on to conserve energy.

    A larger stiffness would add energy; a much smaller one would let points pass through.
    """
    if before == 0:
        return now
    return min(now, (1 + STIFFENING) * before if within > 0.5 * reach else before)


class NearPoint(NamedTuple):
    """One or more points near a shape: centre, depth, way out, radius at first contact."""

    x: Any  # (d,) in the shape's frame
    within: Any
    normal: Any  # (d,)
    whole: Any
    slip: Any  # (d,) velocity of the shape relative to the point
    mass: Any


def reach_of(lever, p, whole, d):
    """Return the radius, and the depth due to `follow_strain`."""
    if lever[d + RATE, p] > 0:
        return float(lever[d + RADIUS, p]), float(lever[d + FOLLOWED, p])
    return whole, 0.0


def leave(memory, p, near):
    (lever, grip, _), d, none = memory, len(near.x), near.x - near.x
    if lever[d + RATE, p] > 0:
        ball, aside = reach_of(lever, p, near.whole, d)
        kept = 1.0 if near.within > -near.whole else 0.0
        depths = kept * ball, kept * lever[d + RATE, p], near.within + ball + aside, 0.0
        store(lever, p, (*none, *depths, kept * aside, 0.0))
    if grip is not None and grip[d, p] != 0:
        store(grip, p, (0.0,) * (2 * d + 2))
    return none


def push(terms, memory, p, near):
    """Return the force (d,) on a touching point; update its history `memory`.

    `terms`: friction coefficient, largest known depth, dt, contact dt and kick, and kick.
    """
    (lever, grip, losses), (x, within, normal, whole, slip, mass) = memory, near
    mu, reach, dt, contact_dt, contact_kick, kick = terms
    d, last_dt, closer = len(x), dt, dt * dot(slip, normal)
    ball, aside = reach_of(lever, p, whole, d)
    rate = spring_rate(lever[d + RATE, p], STIFF / (contact_dt * contact_kick), within, reach)
    if lever[d + RATE, p] > 0:  # from positions, as velocities are noisy
        closer, last_dt = within + ball + aside - float(lever[d + DEPTH, p]), 2 * kick - dt
    else:
        ball = ball_at_first(ball, within, closer)
    pressed = within + ball + aside
    spring = mass * rate * pressed
    load = max(spring + mass * DAMPED / contact_kick * closer / last_dt, 0.0)
    lost = 0.5 * (load - spring + lever[d + DAMPING, p]) * closer
    store(lever, p, (*(sqrt(load * ball) * normal), ball, rate, pressed, load - spring))
    if grip is None:
        increase(losses, p, (lost,))
        return load * normal
    hold = x._make([float(grip[k, p]) for k in range(d)])
    mean, unused = float(grip[d, p]), float(grip[d + 1, p])
    slid = x - x
    if mean > 0:  # from positions, as velocities are noisy
        slid = x._make([float(grip[d + 2 + k, p]) for k in range(d)]) - x
        slip = 1 / (2 * kick - dt) * slid
    hold = along(hold + mass * rate * slid, normal)
    stop = along(mass / contact_kick * slip, normal)
    rubbed, after = rub(mu, load, FrictionMemory(hold, mean, unused), stop)
    store(grip, p, (*after.hold, after.mean, after.unused, *x))
    increase(losses, p, (lost + kick * dot(rubbed, slip),))
    return load * normal + rubbed


@kernel
def push_points(kin, terms, memory, near, force):
    """Set the forces (n, d) on n points of a shape that kernels do not know."""
    d, none = kin.dimension, zero_vector(kin, 0.0)
    x, within, normal, whole, slip, mass = near
    for p in range(mass.size):
        vectors = [vector_at(kin, array, p, 0, none) for array in (x, normal, slip)]
        one = NearPoint(vectors[0], within[p], vectors[1], whole[p], vectors[2], mass[p])
        touches = one.within + sum(reach_of(memory[0], p, one.whole, d)) > 0
        pushed = push(terms, memory, p, one) if touches else leave(memory, p, one)
        for k in range(d):
            force[p, k] = pushed[k]


@noinline
def force_of(tag, members, volume, one):
    """Return the force (d,) of a shape on a point; `one` is a `~.hooks.Member`."""
    kin, d, (p, _, _, values, dt) = members.kin, members.kin.dimension, one
    none = zero_vector(kin, 0.0)
    way = none._make(values[:d])
    position = none._make([float(x) for x in load_vector(kin, members.x, p)])
    whole, memory = radius(kin, float(volume), position), memory_of(tag, members)
    ball, aside = reach_of(memory[0], p, whole, d)
    x, mass = position - way, float(members.points.mass[p])
    # Most points are far away, and a search within a short distance is cheap.
    within = depth(tag.shape, kin, x, 1.001 * max(ball + aside, whole))
    if within + ball + aside <= 0:
        return leave(memory, p, NearPoint(x, within, none, whole, none, mass))
    if within > ball:
        within = depth(tag.shape, kin, x, tag.reach)
    step = ASIDE * tag.reach
    normal = direction_of(slopes(tag.shape, kin, x, tag.reach, (within, step)), step)
    if normal.squared() == 0:
        if within > 0 and _call(tag.lost, members.ids[p]) == 0:
            raise RuntimeError("a point has no way out")
        return none
    velocity = (1 / dt) * (none._make(values[d : 2 * d]) - way)
    slip = velocity - none._make([float(v) for v in load_vector(kin, members.points.v, p)])
    near = NearPoint(x, within, normal, whole, slip, mass)
    return push((tag.mu, tag.reach, dt, *values[2 * d :]), memory, p, near)


def touch_kind(lever: type, grip: type | None) -> type[Touch]:
    name = f"Touch{lever.__name__}{grip.__name__ if grip else ''}"

    def made() -> type:
        kind = type(name, (Touch,), {"__module__": __name__})

        @memory_of.on(kind)
        def _memory_of(tag, members):
            fields = members.points.fields
            memory = field(fields, grip) if grip else None
            return field(fields, lever), memory, field(fields, ContactLoss)

        return kind

    return importable(__name__, name, made)


def touch_hook(tag: Callable) -> hooks.CompiledHook:
    """Make the hook of a fix; ``tag(row, values)`` makes a `Touch`."""
    return hooks.CompiledHook(
        force_of, hooks.WHOLE_POINTS, True, False, False, False, tag, internal=True
    )


@hooks.results.on(Touch)
def _results_of_touch(tag, members, one):
    volume = volume_of(members.kin, members.points, one.law, one.state, one.p)
    return force_of(tag, members, volume, one)


@hooks.written.on(Touch)
def written_force(tag, members, p, values):
    force = field(members.points.fields, Force)
    for c in range(members.kin.dimension):
        force[c, p] += values[c]
    return values
