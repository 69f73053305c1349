"""Points to grid: what a visit of the points scatters to the nodes."""

from __future__ import annotations

from typing import Any, NamedTuple

from karamelo_py.compiler.compile import fma, point_function, shared
from karamelo_py.compiler.fields import field, load, load_vector, vector
from karamelo_py.compiler.tuples import (
    add_optional,
    add_scaled,
    add_to_optional,
    put_at,
    row,
    scale,
)
from karamelo_py.kernels.arrays import MASS, of_force, of_momentum
from karamelo_py.kernels.g2p import NodalMean, VolumeRatio
from karamelo_py.kernels.visit import deformation_of, for_tags, law_of, state_of
from karamelo_py.points.basis import entry, mapped_again
from karamelo_py.points.frames import Total, Updated, add_force, force_stress
from karamelo_py.points.kinematics import vector_at
from karamelo_py.points.laws import jacobian, kirchhoff_stress, specific_volume
from karamelo_py.points.transfers import Moment, add_momentum, gradient_weight, zero_moment
from karamelo_py.points.transfers.xpic import Series, TermOfSeries


class MassMomentum(NamedTuple):
    """Scatter mass and momentum."""

    says = "p2g mass and momentum"
    reads = ("x moved", "mass", "v", "moment")


class InternalForce(NamedTuple):
    """Scatter the internal force, and that of fixes on points."""

    says = "internal force"
    reads = ("mass", "state", "material", "deformation gradient", "force")


class MomentumAgain(NamedTuple):
    """Scatter momentum to the velocity array."""

    says = "momentum to grid"
    reads = ("mass", "v", "moment")


class Volumes(NamedTuple):
    """Scatter volume, after and before the trial increment (F-bar)."""

    says = "volumes to grid"
    reads = ("mass", "state", "material", "volume ratio")


class SeriesBack(NamedTuple):
    """Scatter the term of the series of XPIC, times mass."""

    says = "term of the series to the grid"
    reads = ("mass", "term of series")


class Force(NamedTuple):
    """Force that fixes put on a point."""

    array: Any

    shape = vector
    kept = False
    columns = ("bx", "by", "bz")


class Normal(NamedTuple):
    """Sum of m grad N at a node: it points out of a body, for contact between solids."""

    array: Any

    shape = vector
    kept = False


@point_function()
def load_of(quantity, w, p, like):
    """What a point brings to the nodes."""


@point_function()
def scattered(quantity, w, stencil, k, load):
    """Give the k-th node of the stencil its part."""


@shared
def _moment(w, p, like):
    return load(field(w.points.fields, Moment), p, zero_moment(w.transfer, w.kin, like))


@load_of.on(MassMomentum)
def _(quantity, w, p, like):
    return w.points.mass[p], load_vector(w.kin, w.points.v, p), _moment(w, p, like)


@scattered.on(MassMomentum)
def _(quantity, w, stencil, k, load):
    i, weight, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    mass, v, moment = load
    first = of_momentum(w.kin)
    old = row(w.nodes.sums, i, first, v)
    w.nodes.sums[i, MASS] += weight * mass
    new = add_momentum(w.transfer, w.kin, w.basis, w.grid, stencil, k, weight, mass, v, moment, old)
    put_at(w.nodes.sums, i, first, new)
    add_to_optional(field(w.nodes.fields, Normal), i, mass, gradient)


@load_of.on(InternalForce)
def _(quantity, w, p, like):
    law = law_of(w, p)
    state = state_of(w, law, p, like)
    f = deformation_of(w.frame, w.kin, law, state, w.points, p)
    volume = w.points.mass[p] * specific_volume(law)
    # Minus volume times stress, with the sign of the internal force.
    stress = scale(-volume, force_stress(w.frame, w.kin, kirchhoff_stress(law, w.kin, state), f))
    return stress, load(field(w.points.fields, Force), p, load_vector(w.kin, w.points.v, p))


@scattered.on(InternalForce)
def _(quantity, w, stencil, k, load):
    i, weight, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    g = gradient_weight(w.transfer, w.basis, w.kin, w.grid, stencil, k, gradient)
    first = of_force(w.kin)
    stress, outer = load
    old = row(w.nodes.sums, i, first, vector_at(w.kin, w.nodes.sums, i))
    old = add_optional(old, weight, outer)
    put_at(w.nodes.sums, i, first, add_force(w.frame, w.kin, old, stress, g))


@point_function()
def mapped_again_in(frame, basis, grid, moment):
    """The part of the moment of velocity that MUSL maps again: all where weights never change."""


@mapped_again_in.on(Updated)
def _(frame, basis, grid, moment):
    return mapped_again(basis, grid, moment)


@mapped_again_in.on(Total)
def _(frame, basis, grid, moment):
    return moment


@load_of.on(MomentumAgain)
def _(quantity, w, p, like):
    moment = mapped_again_in(w.frame, w.basis, w.grid, _moment(w, p, like))
    return w.points.mass[p], load_vector(w.kin, w.points.v, p), moment


@scattered.on(MomentumAgain)
def _(quantity, w, stencil, k, load):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    mass, v, moment = load
    old = vector_at(w.kin, w.nodes.velocity, i)
    new = add_momentum(w.transfer, w.kin, w.basis, w.grid, stencil, k, weight, mass, v, moment, old)
    put_at(w.nodes.velocity, i, 0, new)


@load_of.on(Volumes)
def _(quantity, w, p, like):
    law = law_of(w, p)
    state = state_of(w, law, p, like)
    volume = w.points.mass[p] * specific_volume(law) * jacobian(law, w.kin, state)
    return volume * field(w.points.fields, VolumeRatio)[0, p], volume


@scattered.on(Volumes)
def _(quantity, w, stencil, k, load):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    volumes = field(w.nodes.fields, NodalMean)
    volumes[i, 0] = fma(weight, load[0], volumes[i, 0])
    volumes[i, 1] = fma(weight, load[1], volumes[i, 1])


@load_of.on(SeriesBack)
def _(quantity, w, p, like):
    u = load(field(w.points.fields, TermOfSeries), p, load_vector(w.kin, w.points.v, p))
    return w.points.mass[p], u


@scattered.on(SeriesBack)
def _(quantity, w, stencil, k, load):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    mass, u = load
    series = field(w.nodes.fields, Series)
    old = row(series, i, len(u), u)
    put_at(series, i, len(u), add_scaled(old, weight * mass, u))


load_all = for_tags(load_of, "w, p, like")
scattered_all = for_tags(scattered, "w, stencil, k, loads", each="loads")
