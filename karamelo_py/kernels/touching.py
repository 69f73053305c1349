"""Contact of points with the surface of a shape, which may move, in the loop over points.

A point is a ball; its force is along the steepest descent of its depth.
"""

from collections.abc import Callable
from math import sqrt
from typing import NamedTuple

from numba import types

from karamelo_py.compiler import caller_of, importable, noinline, point_function
from karamelo_py.compiler.fields import field, load_vector, store
from karamelo_py.kernels import hooks
from karamelo_py.kernels.equations.internal_force import Force
from karamelo_py.kernels.surfaces import depth, slopes
from karamelo_py.kernels.views import volume_of
from karamelo_py.points.bodies import FrictionMemory, along, radius, rub
from karamelo_py.points.kinematics import dot, zero_vector

SOFT = 0.1  # fraction of the penetration removed in a step
ASIDE = 0.05  # step of depth differences, over the reach
LEVEL = 1e-3  # change of depth over that step, below which there is no direction
CALL = types.int64(types.int64)

_call = caller_of(CALL)


class Touch(NamedTuple):
    """A shape that pushes points out, for a hook on whole points (`kernels.hooks`)."""

    row: int
    values: tuple
    shape: NamedTuple
    mu: float
    reach: float  # largest known depth
    lost: int  # address of a function called for a point without a way out

    of_nodes = False
    of_time = True  # formulas of time, also at the end of the step


def direction_of(falls, step):
    """Return the unit direction of depth differences over two steps; 0 if level."""
    size = sqrt(falls.squared())
    return (1 / size if size > LEVEL * step else 0.0) * falls


@point_function()
def grip_of(tag, members):
    pass


@grip_of.on(Touch)
def _grip_of_none(tag, members):
    return None


@noinline
def force_of(tag, members, volume, one):
    """Return a shape's force (d,) on a point, a `~.hooks.Member`."""
    kin, d, (p, _, _, values, dt) = members.kin, members.kin.dimension, one
    none = zero_vector(kin, 0.0)
    way = none._make(values[:d])
    position = none._make([float(x) for x in load_vector(kin, members.x, p)])
    ball = radius(kin, float(volume), position)
    x = position - way
    grip = grip_of(tag, members)
    # most points are far, and a short reach is cheap
    within = depth(tag.shape, kin, x, 1.001 * ball)
    if within <= -ball:
        if grip is not None and grip[d, p] != 0:
            store(grip, p, (0.0,) * (2 * d + 2))
        return none
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
    contact_dt, contact_kick, kick = values[2 * d :]
    stiffness = float(members.points.mass[p]) / (contact_dt * contact_kick)
    # removing all penetration within a step would throw bodies back
    push = SOFT * (within + ball) + contact_dt * dot(slip, normal)
    load = stiffness * max(push, 0.0)
    if grip is None:
        return load * normal
    hold = none._make([float(grip[k, p]) for k in range(d)])
    mean, unused = float(grip[d, p]), float(grip[d + 1, p])
    slid = none
    if mean > 0:  # from positions, because velocities are noisy
        slid = none._make([float(grip[d + 2 + k, p]) for k in range(d)]) - x
        slip = 1 / (2 * kick - dt) * slid
    hold = along(hold + SOFT * stiffness * slid, normal)
    stop = along(contact_dt * stiffness * slip, normal)
    rubbed, memory = rub(tag.mu, load, FrictionMemory(hold, mean, unused), stop)
    store(grip, p, (*memory.hold, memory.mean, memory.unused, *x))
    return load * normal + rubbed


def touch_kind(grip: type | None) -> type[Touch]:
    if grip is None:
        return Touch
    name = f"Touch{grip.__name__}"

    def made() -> type:
        kind = type(name, (Touch,), {"__module__": __name__})

        @grip_of.on(kind)
        def _grip_of(tag, members):
            return field(members.points.fields, grip)

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
def _written_of_touch(tag, members, p, values):
    force = field(members.points.fields, Force)
    for c in range(members.kin.dimension):
        force[c, p] += values[c]
    return values
