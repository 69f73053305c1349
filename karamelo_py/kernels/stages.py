"""What a sweep over the points takes from the nodes and gives to them.

A sweep visits every point once: it gathers from the nodes of the point's stencil, settles the
point, and scatters to nodes again. *What* is gathered and scattered are tags, so that one loop
(:mod:`karamelo_py.kernels.sweep`) serves every scheme, fused or stage by stage.

The tags name the fields of a point that they read and write, for `karamelo-py bench` to count.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

from numba import types

from karamelo_py.compiler.compile import by_type, fma, index, point_function, real, shared
from karamelo_py.compiler.tuples import (
    add_optional,
    add_row,
    add_scaled,
    add_to_optional,
    clear_optional,
    optional_row,
    put_at,
    put_from,
    put_optional,
    record,
    row,
    scale,
    subtract,
)
from karamelo_py.points.basis import (
    blank,
    carried,
    carrier,
    carriers,
    carry,
    deformed,
    entry,
    extent,
    locate,
    mapped_again,
)
from karamelo_py.points.boundary import reflected
from karamelo_py.points.frames import (
    Total,
    Updated,
    add_force,
    follows,
    force_stress,
    scaled_increment,
    spatial_increment,
    thinning,
)
from karamelo_py.points.grid import inside
from karamelo_py.points.kinematics import (
    add_outer,
    deform,
    dimension,
    largest_component,
    vector_at,
    volume_ratio,
    zero_tensor,
)
from karamelo_py.points.laws import (
    advance,
    constrained_velocity,
    deformation,
    initial_state,
    jacobian,
    kirchhoff_stress,
    specific_volume,
    wave_speed_squared,
)
from karamelo_py.points.transfers import (
    add_moment,
    add_momentum,
    displacing_velocity,
    gradient_weight,
    kept_gradient,
    straining,
    updated_velocity,
    zero_moment,
)


class Work(NamedTuple):
    """What a visit of a point works with; made once a tile."""

    frame: NamedTuple
    kin: NamedTuple
    basis: NamedTuple
    grid: NamedTuple
    transfer: NamedTuple
    nodes: NamedTuple
    points: NamedTuple
    laws: NamedTuple
    places: NamedTuple


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

    reads = ("x", "v", "state", "material", "deformation")
    writes = ("state", "deformation")


class SecondGradient(NamedTuple):
    """The same for the second of two strain increments of a step."""

    reads = Gradient.reads
    writes = Gradient.writes


class VelocityAndGradient(NamedTuple):
    """Gather both in one visit."""

    reads = Gradient.reads
    writes = (*Velocity.writes, *Gradient.writes)


class Trial(NamedTuple):
    """Gather the gradient; settle only by what factor it would change the volume (F-bar)."""

    reads = Gradient.reads
    writes = ("growth",)


class AveragedGradient(NamedTuple):
    """`Gradient`, with the change of volume averaged over the surroundings (F-bar)."""

    reads = (*Gradient.reads, "growth")
    writes = Gradient.writes


class AveragedSecondGradient(NamedTuple):
    """`SecondGradient`, with the change of volume averaged over the surroundings (F-bar)."""

    reads = AveragedGradient.reads
    writes = Gradient.writes


class AveragedVelocityAndGradient(NamedTuple):
    """`VelocityAndGradient`, with the change of volume averaged (F-bar)."""

    reads = AveragedGradient.reads
    writes = VelocityAndGradient.writes


class Series(NamedTuple):
    """Gather the present term of the series of XPIC."""

    reads = ("x",)
    writes = ("echo",)


class Echo(NamedTuple):
    """Scatter what `Series` gathered, times mass."""

    reads = ("mass", "echo")
    writes = ()


class Growth(NamedTuple):
    """Scatter volume, after and before the trial increment."""

    reads = ("mass", "state", "material", "growth")
    writes = ()


class Momentum(NamedTuple):
    """Scatter momentum to the velocity array, with the weights of the gather."""

    reads = ("mass", "v", "moment")
    writes = ()


class Force(NamedTuple):
    """Scatter the internal force, with the weights of the gather."""

    reads = ("mass", "state", "material", "deformation", "force")
    writes = ()


class MassMomentum(NamedTuple):
    """Scatter mass and momentum, with the weights of the present position."""

    reads = ("x moved", "mass", "v", "moment")
    writes = ()


class Everything(NamedTuple):
    """Scatter mass, momentum and internal force, with the weights of the present position."""

    reads = (*MassMomentum.reads, *Force.reads)
    writes = ()


# --- gather -----------------------------------------------------------------------------------


@shared
def place_at(basis, kin, array, p):
    """The place of point `p`: its position and the shape of its domain."""
    return row(array, p, 0, blank(basis, kin, vector_at(kin, array, p)))


@point_function()
def empty(gather, w, x):
    """What a gather sums up, before the first node."""


@empty.on(Nothing)
def _(gather, w, x):
    return ()


@empty.on(Velocity)
def _(gather, w, x):
    zero = subtract(x, x)
    return zero, zero, zero_moment(w.transfer, w.kin, x[0])


@empty.on(Gradient)
@empty.on(SecondGradient)
@empty.on(Trial)
def _(gather, w, x):
    return zero_tensor(w.kin, x[0])


@empty.on(AveragedGradient)
@empty.on(AveragedSecondGradient)
def _(gather, w, x):
    return zero_tensor(w.kin, x[0]), real(0, x[0])


@empty.on(VelocityAndGradient)
def _(gather, w, x):
    zero = subtract(x, x)
    strain = straining(w.transfer, w.kin, zero_tensor(w.kin, x[0]))
    return zero, zero, zero_moment(w.transfer, w.kin, x[0]), strain


@empty.on(AveragedVelocityAndGradient)
def _(gather, w, x):
    zero = subtract(x, x)
    none = zero_moment(w.transfer, w.kin, x[0])
    return zero, zero, none, zero_tensor(w.kin, x[0]), real(0, x[0])


@empty.on(Series)
def _(gather, w, x):
    return subtract(x, x)


@point_function()
def gathered(gather, w, stencil, k, total):
    """`total` with the part of the k-th node of the stencil."""


@gathered.on(Nothing)
def _(gather, w, stencil, k, total):
    return total


@shared
def _velocity(w, stencil, k, total):
    i, weight, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    g = gradient_weight(w.transfer, w.basis, w.kin, w.grid, stencil, k, gradient)
    v = row(w.nodes.update, i, 0, total[0])
    dv = row(w.nodes.update, i, len(v), v)
    return (
        add_scaled(total[0], weight, v),
        add_scaled(total[1], weight, dv),
        add_moment(w.transfer, w.kin, w.basis, w.grid, stencil, k, weight, g, v, total[2]),
    )


@shared
def _gradient(w, stencil, k, total):
    i, _, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    g = gradient_weight(w.transfer, w.basis, w.kin, w.grid, stencil, k, gradient)
    return add_outer(w.kin, total, vector_at(w.kin, w.nodes.velocity, i), g)


def add_gradient(w, stencil, k, total):
    """`_gradient`, where it is gathered at all."""
    return _gradient(w, stencil, k, total) if len(total) else total


@by_type(add_gradient)
def _add_gradient(w, stencil, k, total):
    if len(total) == 0:
        return lambda w, stencil, k, total: total
    return lambda w, stencil, k, total: _gradient(w, stencil, k, total)


@shared
def _growth(w, stencil, k, total):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    return fma(weight, w.nodes.growth[i, 0], total)


@gathered.on(Velocity)
def _(gather, w, stencil, k, total):
    return _velocity(w, stencil, k, total)


@gathered.on(Gradient)
@gathered.on(SecondGradient)
@gathered.on(Trial)
def _(gather, w, stencil, k, total):
    return _gradient(w, stencil, k, total)


@gathered.on(AveragedGradient)
@gathered.on(AveragedSecondGradient)
def _(gather, w, stencil, k, total):
    return (
        _gradient(w, stencil, k, total[0]),
        _growth(w, stencil, k, total[1]),
    )


@gathered.on(VelocityAndGradient)
def _(gather, w, stencil, k, total):
    moved = _velocity(w, stencil, k, total[:3])
    return moved + (add_gradient(w, stencil, k, total[3]),)


@gathered.on(AveragedVelocityAndGradient)
def _(gather, w, stencil, k, total):
    moved = _velocity(w, stencil, k, total[:3])
    return moved + (
        _gradient(w, stencil, k, total[3]),
        _growth(w, stencil, k, total[4]),
    )


@gathered.on(Series)
def _(gather, w, stencil, k, total):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    return add_scaled(total, weight, vector_at(w.kin, w.nodes.series, i))


# --- settle -----------------------------------------------------------------------------------


@point_function()
def settled(gather, w, stencil, p, dt, total, fastest):
    """Store what follows from `total`; return how far the point moved in cells, and its rate.

    The rate, c + max |v_i|, bounds the stable step; what is returned is the larger of it and
    `fastest`, the largest so far. A point that went wrong (det F <= 0, NaN, outside the domain)
    returns a distance or a rate of NaN or infinity.
    """


@settled.on(Nothing)
def _(gather, w, stencil, p, dt, total, fastest):
    if follows(w.frame) and not inside(w.grid, w.kin, vector_at(w.kin, w.places.x, p)):
        return real(inf, dt), fastest
    return real(0, dt), fastest


@settled.on(Velocity)
def _(gather, w, stencil, p, dt, total, fastest):
    moved = _move(w, stencil, p, dt, total)
    return moved, fastest


@settled.on(Gradient)
def _(gather, w, stencil, p, dt, total, fastest):
    dl = scale(dt, total)
    return _strain(w, w.places.x, p, dt, dl, fastest)


@settled.on(SecondGradient)
def _(gather, w, stencil, p, dt, total, fastest):
    dl = scale(dt, total)
    return _strain(w, w.places.y, p, dt, dl, fastest)


@settled.on(AveragedGradient)
def _(gather, w, stencil, p, dt, total, fastest):
    dl = _averaged(w, p, scale(dt, total[0]), total[1])
    return _strain(w, w.places.x, p, dt, dl, fastest)


@settled.on(AveragedSecondGradient)
def _(gather, w, stencil, p, dt, total, fastest):
    dl = _averaged(w, p, scale(dt, total[0]), total[1])
    return _strain(w, w.places.y, p, dt, dl, fastest)


@settled.on(VelocityAndGradient)
def _(gather, w, stencil, p, dt, total, fastest):
    moved = _move(w, stencil, p, dt, total)
    dl = scale(dt, kept_gradient(w.transfer, w.kin, total[2], total[3]))
    grown, fastest = _strain(w, w.places.x, p, dt, dl, fastest)
    return moved + grown, fastest


@settled.on(AveragedVelocityAndGradient)
def _(gather, w, stencil, p, dt, total, fastest):
    moved = _move(w, stencil, p, dt, total)
    dl = _averaged(w, p, scale(dt, total[3]), total[4])
    grown, fastest = _strain(w, w.places.x, p, dt, dl, fastest)
    return moved + grown, fastest


@settled.on(Trial)
def _(gather, w, stencil, p, dt, total, fastest):
    law = record(w.laws, index(w.points.material[p]))
    state = row(w.points.state, p, 0, initial_state(law, w.kin, dt))
    f = deformation_of(w.frame, w.kin, law, state, w.points, p)
    dl = spatial_increment(w.frame, w.kin, scale(dt, total), f)
    w.points.growth[p] = volume_ratio(w.kin, dl)
    return real(0, dt), fastest


@settled.on(Series)
def _(gather, w, stencil, p, dt, total, fastest):
    put_at(w.points.echo, p, 0, total)
    return real(0, dt), fastest


@shared
def grown_by(basis, kin, grid, before, after):
    """By how many cells the domain of a point reaches further than before."""
    further = extent(basis, kin, grid, after) - extent(basis, kin, grid, before)
    return max(further, real(0, further))


@shared
def _move(w, stencil, p, dt, total):
    """New velocity, position and carried corners; how far that is in cells."""
    law = record(w.laws, index(w.points.material[p]))
    old = vector_at(w.kin, w.points.v, p)
    v = constrained_velocity(law, old, updated_velocity(w.transfer, old, total[0], total[1]))
    x = vector_at(w.kin, w.places.x, p)
    step = scale(dt, constrained_velocity(law, v, displacing_velocity(w.transfer, v, total[0])))
    y = add_scaled(x, real(1, dt), step)
    y, v, moment, hits = reflected(w.grid, w.kin, y, v, total[2])
    add_to_optional(w.points.bounces, p, real(1, dt), hits)
    put_at(w.points.v, p, 0, v)
    put_optional(w.points.moment, p, moment)
    put_at(w.places.y, p, 0, y)
    moved = largest_component(w.kin, step) * w.grid.inv_h
    if not follows(w.frame):
        return moved
    if carried(w.basis, w.kin) > 0:
        old = place_at(w.basis, w.kin, w.places.x, p)
        new = add_row(old, 0, step)
        for corner in range(carried(w.basis, w.kin)):
            u = subtract(x, x)
            for j in range(carriers(w.basis, w.kin)):
                i, weight = carrier(w.basis, w.kin, w.grid, stencil, corner, j)
                u = add_scaled(u, weight, vector_at(w.kin, w.nodes.update, i))
            new = carry(w.basis, w.kin, new, old, corner, scale(dt, u))
        put_at(w.places.y, p, 0, new)
        moved += grown_by(w.basis, w.kin, w.grid, old, new)
    if not inside(w.grid, w.kin, y):
        return real(inf, dt)
    return moved


def deformation_at(array, kin, law, state, p):
    """F of a point: from the state of laws that keep it, else from an array of its own."""
    if array is None:
        return deformation(law, kin, state)
    return row(array, p, 0, zero_tensor(kin, array[p, 0]))


@by_type(deformation_at)
def _deformation_at(array, kin, law, state, p):
    if isinstance(array, types.NoneType):
        return lambda array, kin, law, state, p: deformation(law, kin, state)
    return lambda array, kin, law, state, p: row(array, p, 0, zero_tensor(kin, array[p, 0]))


def advance_deformation(array, kin, p, increment, f):
    """Store F after the increment, where there is an array for it."""
    if array is not None:
        put_at(array, p, 0, deform(kin, increment, f))


@by_type(advance_deformation)
def _advance_deformation(array, kin, p, increment, f):
    if isinstance(array, types.NoneType):
        return lambda array, kin, p, increment, f: None
    return lambda array, kin, p, increment, f: put_at(array, p, 0, deform(kin, increment, f))


@point_function()
def deformation_of(frame, kin, law, state, points, p):
    """F of a point where the frame needs it."""


@deformation_of.on(Updated)
def _(frame, kin, law, state, points, p):
    return ()


@deformation_of.on(Total)
def _(frame, kin, law, state, points, p):
    return deformation_at(points.deformation, kin, law, state, p)


@shared
def _strain(w, x, p, dt, dl, fastest):
    """The state of the law and the shape of the domain after `dl`; growth in cells, and rate."""
    law = record(w.laws, index(w.points.material[p]))
    old = row(w.points.state, p, 0, initial_state(law, w.kin, dt))
    f = deformation_of(w.frame, w.kin, law, old, w.points, p)
    increment = spatial_increment(w.frame, w.kin, dl, f)
    state = advance(law, w.kin, old, increment, dt)
    put_at(w.points.state, p, 0, state)
    advance_deformation(w.points.deformation, w.kin, p, increment, f)
    grown = real(0, dt)
    if follows(w.frame) and carried(w.basis, w.kin) == 0:
        before = place_at(w.basis, w.kin, x, p)
        after = deformed(w.basis, w.kin, before, increment)
        put_from(w.places.y, p, dimension(w.kin), after)
        grown = grown_by(w.basis, w.kin, w.grid, before, after)
    if not jacobian(law, w.kin, state) > 0:
        return real(inf, dt), fastest
    # The square root is only taken of the few points that are faster than all before them.
    now = deformation_of(w.frame, w.kin, law, state, w.points, p)
    squared = wave_speed_squared(law, w.kin, state) * thinning(w.frame, w.kin, now, dt)
    speed = largest_component(w.kin, vector_at(w.kin, w.points.v, p))
    slack = fastest - speed
    if slack < 0 or not squared <= slack * slack:  # so written, NaN is noticed too
        return grown, sqrt(squared) + speed
    return grown, fastest


@shared
def _averaged(w, p, dl, growth):
    """`dl` with the change of volume that the surroundings have on average (F-bar).

    The ratio of volumes of the increment is replaced by its average over the points nearby,
    weighted with their volumes (after Coombs et al. 2018, "Overcoming volumetric locking in
    material point methods", eq. 23; there over the points of a cell). In the total frame, `dl` is
    dt Fdot, and F + dl is scaled.
    """
    law = record(w.laws, index(w.points.material[p]))
    state = row(w.points.state, p, 0, initial_state(law, w.kin, growth))
    f = deformation_of(w.frame, w.kin, law, state, w.points, p)
    return scaled_increment(w.frame, w.kin, dl, f, growth / w.points.growth[p])


# --- scatter ----------------------------------------------------------------------------------


@point_function()
def restencil(scatter, w, stencil, p):
    """The stencil of the scatter: the gather's own, or that of the present position."""


@restencil.on(Nothing)
@restencil.on(Momentum)
@restencil.on(Force)
@restencil.on(Growth)
@restencil.on(Echo)
def _(scatter, w, stencil, p):
    return stencil


@restencil.on(MassMomentum)
@restencil.on(Everything)
def _(scatter, w, stencil, p):
    return moved_stencil(w.frame, w, stencil, p)


@point_function()
def moved_stencil(frame, w, stencil, p):
    """The stencil of the present position; in the total frame it never changes."""


@moved_stencil.on(Updated)
def _(frame, w, stencil, p):
    return locate(w.basis, w.kin, w.grid, place_at(w.basis, w.kin, w.places.y, p))


@moved_stencil.on(Total)
def _(frame, w, stencil, p):
    return stencil


@point_function()
def load(scatter, w, p, like):
    """What a point brings to the nodes."""


@load.on(Nothing)
def _(scatter, w, p, like):
    return ()


@load.on(Momentum)
def _(scatter, w, p, like):
    moment = optional_row(w.points.moment, p, zero_moment(w.transfer, w.kin, like))
    again = mapped_again_in(w.frame, w.basis, w.grid, moment)
    return w.points.mass[p], vector_at(w.kin, w.points.v, p), again


@load.on(MassMomentum)
def _(scatter, w, p, like):
    moment = optional_row(w.points.moment, p, zero_moment(w.transfer, w.kin, like))
    return w.points.mass[p], vector_at(w.kin, w.points.v, p), moment


@load.on(Force)
def _(scatter, w, p, like):
    return _force(w, p, like), optional_row(w.points.force, p, vector_at(w.kin, w.points.v, p))


@load.on(Everything)
def _(scatter, w, p, like):
    moment = optional_row(w.points.moment, p, zero_moment(w.transfer, w.kin, like))
    return (
        w.points.mass[p],
        vector_at(w.kin, w.points.v, p),
        moment,
        _force(w, p, like),
        optional_row(w.points.force, p, vector_at(w.kin, w.points.v, p)),
    )


@load.on(Growth)
def _(scatter, w, p, like):
    law = record(w.laws, index(w.points.material[p]))
    state = row(w.points.state, p, 0, initial_state(law, w.kin, like))
    volume = w.points.mass[p] * specific_volume(law) * jacobian(law, w.kin, state)
    return volume * w.points.growth[p], volume


@load.on(Echo)
def _(scatter, w, p, like):
    return w.points.mass[p], vector_at(w.kin, w.points.echo, p)


@shared
def _force(w, p, like):
    """Minus volume times stress, with the sign of the internal force."""
    law = record(w.laws, index(w.points.material[p]))
    state = row(w.points.state, p, 0, initial_state(law, w.kin, like))
    f = deformation_of(w.frame, w.kin, law, state, w.points, p)
    volume = w.points.mass[p] * specific_volume(law)
    return scale(-volume, force_stress(w.frame, w.kin, kirchhoff_stress(law, w.kin, state), f))


@point_function()
def mapped_again_in(frame, basis, grid, moment):
    """The part of the moment of velocity that MUSL maps again: all where weights never change."""


@mapped_again_in.on(Updated)
def _(frame, basis, grid, moment):
    return mapped_again(basis, grid, moment)


@mapped_again_in.on(Total)
def _(frame, basis, grid, moment):
    return moment


@point_function()
def scattered(scatter, w, stencil, k, burden):
    """Give the k-th node of the stencil its part."""


@scattered.on(Nothing)
def _(scatter, w, stencil, k, burden):
    return None


@shared
def _momentum(w, stencil, k, weight, mass, v, moment, old):
    return add_momentum(
        w.transfer, w.kin, w.basis, w.grid, stencil, k, weight, mass, v, moment, old
    )


@scattered.on(Momentum)
def _(scatter, w, stencil, k, burden):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    mass, v, moment = burden
    old = vector_at(w.kin, w.nodes.velocity, i)
    new = _momentum(w, stencil, k, weight, mass, v, moment, old)
    put_at(w.nodes.velocity, i, 0, new)


@scattered.on(Force)
def _(scatter, w, stencil, k, burden):
    i, weight, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    g = gradient_weight(w.transfer, w.basis, w.kin, w.grid, stencil, k, gradient)
    first = 1 + dimension(w.kin)
    stress, outer = burden
    old = row(w.nodes.sums, i, first, vector_at(w.kin, w.nodes.sums, i))
    old = add_optional(old, weight, outer)
    put_at(w.nodes.sums, i, first, add_force(w.frame, w.kin, old, stress, g))


@scattered.on(MassMomentum)
def _(scatter, w, stencil, k, burden):
    i, weight, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    mass, v, moment = burden
    part = weight * mass
    old = row(w.nodes.sums, i, 1, v)
    p = _momentum(w, stencil, k, weight, mass, v, moment, old)
    put_at(w.nodes.sums, i, 0, (w.nodes.sums[i, 0] + part,) + p)
    add_to_optional(w.nodes.normal, i, mass, gradient)


@scattered.on(Everything)
def _(scatter, w, stencil, k, burden):
    i, weight, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    g = gradient_weight(w.transfer, w.basis, w.kin, w.grid, stencil, k, gradient)
    mass, v, moment, force, outer = burden
    part = weight * mass
    old_p = row(w.nodes.sums, i, 1, v)
    old_f = add_optional(row(w.nodes.sums, i, 1 + len(v), v), weight, outer)
    p = _momentum(w, stencil, k, weight, mass, v, moment, old_p)
    f = add_force(w.frame, w.kin, old_f, force, g)
    put_at(w.nodes.sums, i, 0, (w.nodes.sums[i, 0] + part,) + p + f)
    add_to_optional(w.nodes.normal, i, mass, gradient)


@scattered.on(Growth)
def _(scatter, w, stencil, k, burden):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    w.nodes.growth[i, 0] = fma(weight, burden[0], w.nodes.growth[i, 0])
    w.nodes.growth[i, 1] = fma(weight, burden[1], w.nodes.growth[i, 1])


@scattered.on(Echo)
def _(scatter, w, stencil, k, burden):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    mass, u = burden
    old = row(w.nodes.series, i, len(u), u)
    put_at(w.nodes.series, i, len(u), add_scaled(old, weight * mass, u))


# --- nodes ------------------------------------------------------------------------------------


class ClearSums(NamedTuple):
    """Mass, momentum, force and normal of the nodes start from zero."""


class ClearVelocity(NamedTuple):
    """The velocity array starts from zero, to take momentum."""


class ClearGrowth(NamedTuple):
    """The volumes of F-bar start from zero."""


class AverageGrowth(NamedTuple):
    """Volume after over volume before the trial increment, at the nodes (F-bar)."""


class StartSeries(NamedTuple):
    """First term of the series of XPIC: the velocity v, and its part in the new velocity."""

    factor: float


class ExtendSeries(NamedTuple):
    """Next term of the series of XPIC, and its part in the new velocity."""

    factor: float


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
    clear_optional(nodes.normal, n)


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


@at_node.on(ClearGrowth)
def _(task, kin, nodes, n, dt):
    nodes.growth[n, 0] = 0
    nodes.growth[n, 1] = 0


@at_node.on(AverageGrowth)
def _(task, kin, nodes, n, dt):
    if nodes.growth[n, 1] > 0:
        nodes.growth[n, 0] /= nodes.growth[n, 1]


@at_node.on(StartSeries)
def _(task, kin, nodes, n, dt):
    d = dimension(kin)
    mass = nodes.sums[n, 0]
    per_mass = real(1, dt) / mass if mass > 0 else real(0, dt)
    for k in range(d):
        v = nodes.sums[n, 1 + k] * per_mass
        nodes.series[n, k] = v
        nodes.series[n, d + k] = 0
        nodes.update[n, d + k] = nodes.update[n, k] + task.factor * v


@at_node.on(ExtendSeries)
def _(task, kin, nodes, n, dt):
    d = dimension(kin)
    mass = nodes.sums[n, 0]
    per_mass = real(1, dt) / mass if mass > 0 else real(0, dt)
    for k in range(d):
        v = nodes.series[n, d + k] * per_mass
        nodes.series[n, k] = v
        nodes.series[n, d + k] = 0
        nodes.update[n, d + k] += task.factor * v
