"""What a sweep over the points takes from the nodes and gives to them.

A sweep visits every point once: it gathers from the nodes of the point's stencil, settles the
point, and scatters to nodes again. *What* is gathered and scattered are tags, so that one loop
(:mod:`karamelo_py.kernels.sweep`) serves every scheme, fused or stage by stage.

The tags name the fields of a point that they read and write, for `karamelo-py bench` to count.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

from karamelo_py.compile import index, point_function, real, shared
from karamelo_py.points.basis import entry, inside, locate, mapped_again
from karamelo_py.points.kinematics import (
    add_outer,
    add_symmetric_dot,
    dimension,
    largest_component,
    vector_at,
    zero_tensor,
)
from karamelo_py.points.materials import (
    advance,
    initial_state,
    jacobian,
    kirchhoff_stress,
    specific_volume,
    wave_speed_squared,
)
from karamelo_py.points.transfers import (
    add_moment,
    add_momentum,
    updated_velocity,
    zero_moment,
)
from karamelo_py.tensors import (
    add,
    add_scaled,
    moment_at,
    put_at,
    put_moment,
    record,
    row,
    scale,
    subtract,
)


class Nothing(NamedTuple):
    """Gather or scatter nothing."""

    reads = ()
    writes = ()


class Velocity(NamedTuple):
    """Gather v* and its change; settle velocity and new position."""

    reads = ("x", "v")
    writes = ("x moved", "v", "moment")


class Gradient(NamedTuple):
    """Gather the gradient of the nodal velocity; settle the state of the law."""

    reads = ("x", "v", "state", "material")
    writes = ("state",)


class VelocityAndGradient(NamedTuple):
    """Gather both in one visit."""

    reads = ("x", "v", "state", "material")
    writes = ("x moved", "v", "moment", "state")


class Momentum(NamedTuple):
    """Scatter momentum to the velocity array, with the weights of the gather."""

    reads = ("mass", "v", "moment")
    writes = ()


class Force(NamedTuple):
    """Scatter the internal force, with the weights of the gather."""

    reads = ("mass", "state", "material")
    writes = ()


class MassMomentum(NamedTuple):
    """Scatter mass and momentum, with the weights of the present position."""

    reads = ("x moved", "mass", "v", "moment")
    writes = ()


class Everything(NamedTuple):
    """Scatter mass, momentum and internal force, with the weights of the present position."""

    reads = ("x moved", "mass", "v", "moment", "state", "material")
    writes = ()


# --- gather -----------------------------------------------------------------------------------


@point_function()
def empty(gather, transfer, kin, x):
    """What a gather sums up, before the first node."""


@empty.on(Nothing)
def _(gather, transfer, kin, x):
    return ()


@empty.on(Velocity)
def _(gather, transfer, kin, x):
    zero = subtract(x, x)
    return zero, zero, zero_moment(transfer, kin, x[0])


@empty.on(Gradient)
def _(gather, transfer, kin, x):
    return zero_tensor(kin, x[0])


@empty.on(VelocityAndGradient)
def _(gather, transfer, kin, x):
    zero = subtract(x, x)
    return zero, zero, zero_moment(transfer, kin, x[0]), zero_tensor(kin, x[0])


@point_function()
def gathered(gather, transfer, kin, basis, stencil, k, nodes, total):
    """`total` with the part of the k-th node of the stencil."""


@gathered.on(Nothing)
def _(gather, transfer, kin, basis, stencil, k, nodes, total):
    return total


@gathered.on(Velocity)
def _(gather, transfer, kin, basis, stencil, k, nodes, total):
    i, weight, _ = entry(basis, kin, stencil, k)
    v = row(nodes.update, i, 0, total[0])
    dv = row(nodes.update, i, len(v), v)
    return (
        add_scaled(total[0], weight, v),
        add_scaled(total[1], weight, dv),
        add_moment(transfer, kin, basis, stencil, k, weight, v, total[2]),
    )


@gathered.on(Gradient)
def _(gather, transfer, kin, basis, stencil, k, nodes, total):
    i, _, gradient = entry(basis, kin, stencil, k)
    v = vector_at(kin, nodes.velocity, i)
    return add_outer(kin, total, v, gradient)


@gathered.on(VelocityAndGradient)
def _(gather, transfer, kin, basis, stencil, k, nodes, total):
    i, weight, gradient = entry(basis, kin, stencil, k)
    v = row(nodes.update, i, 0, total[0])
    dv = row(nodes.update, i, len(v), v)
    return (
        add_scaled(total[0], weight, v),
        add_scaled(total[1], weight, dv),
        add_moment(transfer, kin, basis, stencil, k, weight, v, total[2]),
        add_outer(kin, total[3], vector_at(kin, nodes.velocity, i), gradient),
    )


# --- settle -----------------------------------------------------------------------------------


@point_function()
def settled(gather, transfer, kin, basis, points, laws, x, to, p, dt, total, fastest):
    """Store what follows from `total`; return how far the point moved in cells, and its rate.

    The rate, c + max |v_i|, bounds the stable step; what is returned is the larger of it and
    `fastest`, the largest so far. A point that went wrong (det F <= 0, NaN, outside the domain)
    returns a distance or a rate of NaN or infinity.
    """


@settled.on(Nothing)
def _(gather, transfer, kin, basis, points, laws, x, to, p, dt, total, fastest):
    if not inside(basis, kin, x):
        return real(inf, dt), fastest
    return real(0, dt), fastest


@settled.on(Velocity)
def _(gather, transfer, kin, basis, points, laws, x, to, p, dt, total, fastest):
    return _move(transfer, kin, basis, points, x, to, p, dt, total), fastest


@settled.on(Gradient)
def _(gather, transfer, kin, basis, points, laws, x, to, p, dt, total, fastest):
    return real(0, dt), _strain(kin, points, laws, p, dt, total, fastest)


@settled.on(VelocityAndGradient)
def _(gather, transfer, kin, basis, points, laws, x, to, p, dt, total, fastest):
    moved = _move(transfer, kin, basis, points, x, to, p, dt, total)
    return moved, _strain(kin, points, laws, p, dt, total[3], fastest)


@shared
def _move(transfer, kin, basis, points, x, to, p, dt, total):
    v = updated_velocity(transfer, vector_at(kin, points.v, p), total[0], total[1])
    put_at(points.v, p, 0, v)
    put_moment(points.moment, p, total[2])
    step = scale(dt, total[0])
    y = add(x, step)
    put_at(to, p, 0, y)
    if not inside(basis, kin, y):
        return real(inf, dt)
    return largest_component(kin, step) * basis.inv_h


@shared
def _strain(kin, points, laws, p, dt, gradient, fastest):
    law = record(laws, index(points.material[p]))
    like = initial_state(law, kin, dt)
    state = advance(law, kin, row(points.state, p, 0, like), scale(dt, gradient), dt)
    put_at(points.state, p, 0, state)
    if not jacobian(law, kin, state) > 0:
        return real(inf, dt)
    # The square root is only taken of the few points that are faster than all before them.
    squared = wave_speed_squared(law, kin, state)
    speed = largest_component(kin, vector_at(kin, points.v, p))
    slack = fastest - speed
    if slack < 0 or not squared <= slack * slack:  # so written, NaN is noticed too
        return sqrt(squared) + speed
    return fastest


# --- scatter ----------------------------------------------------------------------------------


@point_function()
def restencil(scatter, kin, basis, stencil, y):
    """The stencil of the scatter: the gather's own, or that of the present position `y`."""


@restencil.on(Nothing)
@restencil.on(Momentum)
@restencil.on(Force)
def _(scatter, kin, basis, stencil, y):
    return stencil


@restencil.on(MassMomentum)
@restencil.on(Everything)
def _(scatter, kin, basis, stencil, y):
    return locate(basis, kin, y)


@point_function()
def load(scatter, transfer, kin, basis, points, laws, p, like):
    """What a point brings to the nodes."""


@load.on(Nothing)
def _(scatter, transfer, kin, basis, points, laws, p, like):
    return ()


@load.on(Momentum)
def _(scatter, transfer, kin, basis, points, laws, p, like):
    moment = moment_at(points.moment, p, zero_moment(transfer, kin, like))
    return points.mass[p], vector_at(kin, points.v, p), mapped_again(basis, moment)


@load.on(MassMomentum)
def _(scatter, transfer, kin, basis, points, laws, p, like):
    moment = moment_at(points.moment, p, zero_moment(transfer, kin, like))
    return points.mass[p], vector_at(kin, points.v, p), moment


@load.on(Force)
def _(scatter, transfer, kin, basis, points, laws, p, like):
    return _force(kin, points, laws, p, like)


@load.on(Everything)
def _(scatter, transfer, kin, basis, points, laws, p, like):
    moment = moment_at(points.moment, p, zero_moment(transfer, kin, like))
    return points.mass[p], vector_at(kin, points.v, p), moment, _force(kin, points, laws, p, like)


@shared
def _force(kin, points, laws, p, like):
    """Minus volume times stress: (m / rho) tau, with the sign of the internal force."""
    law = record(laws, index(points.material[p]))
    state = row(points.state, p, 0, initial_state(law, kin, like))
    volume = points.mass[p] * specific_volume(law)
    return scale(-volume, kirchhoff_stress(law, kin, state))


@point_function()
def scattered(scatter, transfer, kin, basis, stencil, k, nodes, burden):
    """Give the k-th node of the stencil its part."""


@scattered.on(Nothing)
def _(scatter, transfer, kin, basis, stencil, k, nodes, burden):
    return None


@scattered.on(Momentum)
def _(scatter, transfer, kin, basis, stencil, k, nodes, burden):
    i, weight, _ = entry(basis, kin, stencil, k)
    mass, v, moment = burden
    old = vector_at(kin, nodes.velocity, i)
    new = add_momentum(transfer, kin, basis, stencil, k, weight * mass, mass, v, moment, old)
    put_at(nodes.velocity, i, 0, new)


@scattered.on(Force)
def _(scatter, transfer, kin, basis, stencil, k, nodes, burden):
    i, _, gradient = entry(basis, kin, stencil, k)
    first = 1 + len(gradient)
    old = row(nodes.sums, i, first, gradient)
    put_at(nodes.sums, i, first, add_symmetric_dot(kin, old, burden, gradient))


@scattered.on(MassMomentum)
def _(scatter, transfer, kin, basis, stencil, k, nodes, burden):
    i, weight, _ = entry(basis, kin, stencil, k)
    mass, v, moment = burden
    part = weight * mass
    old = row(nodes.sums, i, 1, v)
    p = add_momentum(transfer, kin, basis, stencil, k, part, mass, v, moment, old)
    put_at(nodes.sums, i, 0, (nodes.sums[i, 0] + part,) + p)


@scattered.on(Everything)
def _(scatter, transfer, kin, basis, stencil, k, nodes, burden):
    i, weight, gradient = entry(basis, kin, stencil, k)
    mass, v, moment, force = burden
    part = weight * mass
    old_p = row(nodes.sums, i, 1, v)
    old_f = row(nodes.sums, i, 1 + len(v), v)
    p = add_momentum(transfer, kin, basis, stencil, k, part, mass, v, moment, old_p)
    f = add_symmetric_dot(kin, old_f, force, gradient)
    put_at(nodes.sums, i, 0, (nodes.sums[i, 0] + part,) + p + f)


# --- nodes ------------------------------------------------------------------------------------


class ClearSums(NamedTuple):
    """Mass, momentum and force of the nodes start from zero."""


class ClearVelocity(NamedTuple):
    """The velocity array starts from zero, to take momentum."""


class Update(NamedTuple):
    """v* = v + dt f / m from the sums."""


class MomentumToVelocity(NamedTuple):
    """The momentum in the velocity array over the mass: the re-mapped velocity of MUSL."""


class SumsToVelocity(NamedTuple):
    """Velocity from the momentum in the sums, before the update (USF)."""


class UpdateToVelocity(NamedTuple):
    """The velocity whose gradient deforms the points is v*, limited at light nodes (USL).

    A point of mass m that gives a node the share N of it gets back the strain of f dt / (N m) from
    there: an oscillation that grows when (c dt / h)^2 > N, in d directions at once. Nodes lighter
    than `light` = d (c dt / h)^2 m count as such; the limit vanishes with the step.
    """

    light: float


@point_function()
def at_node(task, kin, nodes, n, dt):
    """Do `task` at node `n`. Nodes without mass stay at rest."""


@at_node.on(ClearSums)
def _(task, kin, nodes, n, dt):
    for k in range(1 + 2 * dimension(kin)):
        nodes.sums[n, k] = 0


@at_node.on(ClearVelocity)
def _(task, kin, nodes, n, dt):
    for k in range(dimension(kin)):
        nodes.velocity[n, k] = 0


@at_node.on(Update)
def _(task, kin, nodes, n, dt):
    d = dimension(kin)
    mass = nodes.sums[n, 0]
    per_mass = real(1, dt) / mass if mass > 0 else real(0, dt)
    for k in range(d):
        dv = dt * nodes.sums[n, 1 + d + k] * per_mass
        nodes.update[n, k] = nodes.sums[n, 1 + k] * per_mass + dv
        nodes.update[n, d + k] = dv


@at_node.on(MomentumToVelocity)
def _(task, kin, nodes, n, dt):
    mass = nodes.sums[n, 0]
    per_mass = real(1, dt) / mass if mass > 0 else real(0, dt)
    for k in range(dimension(kin)):
        nodes.velocity[n, k] *= per_mass


@at_node.on(SumsToVelocity)
def _(task, kin, nodes, n, dt):
    mass = nodes.sums[n, 0]
    per_mass = real(1, dt) / mass if mass > 0 else real(0, dt)
    for k in range(dimension(kin)):
        nodes.velocity[n, k] = nodes.sums[n, 1 + k] * per_mass


@at_node.on(UpdateToVelocity)
def _(task, kin, nodes, n, dt):
    # See UpdateToVelocity.light: the change of a light node's velocity enters the gradient by the
    # share of its mass. Points take the whole change: momentum is kept.
    d = dimension(kin)
    one = real(1, dt)
    mass = nodes.sums[n, 0]
    share = mass / task.light if mass < task.light else one
    for k in range(d):
        nodes.velocity[n, k] = nodes.update[n, k] - (one - share) * nodes.update[n, d + k]
