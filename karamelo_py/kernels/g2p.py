"""Grid to points: gather from the nodes in a visit of the points, and update the points.

A task names the fields of points and nodes that it reads and writes, for `karamelo-py check` and
`bench`.
"""

from math import inf, sqrt
from typing import NamedTuple

from karamelo_py.compiler.compile import Weighted, all_lanes, fma, point_function, real, where
from karamelo_py.compiler.fields import (
    field,
    forget,
    increase,
    load,
    load_vector,
    store,
    store_from,
)
from karamelo_py.compiler.gpu import aligned_record
from karamelo_py.compiler.loops import many_threads
from karamelo_py.compiler.tuples import row
from karamelo_py.kernels import arrays, visit
from karamelo_py.kernels.loss import FrictionalHeat, in_company, reflect, warm, warm_by_friction
from karamelo_py.kernels.p2g import Force, VelocityBefore, WorkOfForces
from karamelo_py.kernels.visit import Work, node_of, straining_node
from karamelo_py.points import frames, laws, transfers
from karamelo_py.points.basis import carried, carrier, carry, deformed, extent
from karamelo_py.points.basis.cpdi import AtCorners
from karamelo_py.points.grid import Bounces, inside, reflected
from karamelo_py.points.kinematics import I, det, dot, large, outer, vector, zero, zero_vector
from karamelo_py.points.transfers.xpic import Reflected, Series, TermOfSeries


class Task(NamedTuple):
    """Base of tasks that also work in lanes and at domain corners."""

    in_lanes = True
    not_at_corners = ()


class Move(Task):
    """Gather v* and its change; update velocity and new position."""

    not_at_corners = ("moments",)
    says = "g2p, move"
    reads = ("x", "v")
    writes = ("x moved", "v", "moment", "bounces")


class Strain(Task):
    """Gather the gradient of the nodal velocity; update the state of the law."""

    not_at_corners = ("moments",)
    says = "stress"
    reads = ("x", "v", "state", "material", "deformation gradient", "volume ratio")
    writes = ("state", "deformation gradient")


class StrainOfLastStep(Strain):
    """`Strain` with the velocity that led here, at the new positions."""


class SecondStrain(Strain):
    """`Strain` for the second of two strain increments of a step."""

    says = "second half of the stress"


class StrainOfLoadStep(Strain):
    """`Strain` for large rotations in a step (:func:`~karamelo_py.points.kinematics.large`).

    Used by implicit schemes.
    """


class StrainInMove(Strain):
    """`Strain` in one visit after `Move`, without gathering again."""


class TrialStrain(Strain):
    """Gather the gradient; compute only the volume ratio that it would cause (F-bar)."""

    says = "trial volume"
    writes = ("volume ratio",)


class TrialStrainOfLastStep(TrialStrain):
    """`TrialStrain` for `StrainOfLastStep`."""


class SetMeanStress(Task):
    """Gather the averaged mean stress of F-bar."""

    says = "averaged mean stress"
    reads = ("x", "state", "material")
    writes = ("averaged stress", "pressure beside")


class SeriesTerm(NamedTuple):
    """Gather term `k` of the series of XPIC, from 0."""

    k: int

    in_lanes = True
    not_at_corners = ()
    says = "term of the series to the points"
    reads = ("x",)
    writes = ("term of series",)


@point_function()
def empty(task: arrays.Tag, w: Work, x: tuple) -> tuple:
    """Return the initial totals of a gather: zeros."""


@empty.on(Move)
def _empty_move(task, w, x):
    return x - x, x - x, transfers.zero_moment(w.transfer, w.kin, x[0])


def _is_known(task, w):
    """Return True for a gradient that the transfer may already have from v*."""
    return isinstance(task, StrainInMove) and not isinstance(w.averaging, visit.FBar)


@empty.on(Strain)
def _empty_strain(task, w, x):
    gradient = zero(w.kin, x[0])
    if _is_known(task, w):
        gradient = transfers.straining(w.transfer, w.kin, gradient)
    return gradient, visit.no_ratio(w, x[0])


empty.on(TrialStrain)(lambda task, w, x: zero(w.kin, x[0]))


empty.on(SetMeanStress)(lambda task, w, x: real(0, x[0]))


@empty.on(SeriesTerm)
def _empty_series_term(task, w, x):
    return x - x


visit.records_of.on(Move)(lambda task, nodes: nodes.update)


@visit.records_of.on(Strain)
def _records_of_strain(task, nodes):
    return nodes.velocity if type(task) in (Strain, StrainOfLastStep) else None


@point_function()
def gathered(task: arrays.Tag, w: Work, stencil: tuple, k: int, total: tuple) -> tuple:
    """Add the contribution of the k-th node of the stencil to `total`."""


@gathered.on(Move)
def _gathered_move(task, w, stencil, k, total):
    i, N, grad_N = straining_node(w, stencil, k)
    v_pic, dv_pic, moment, *corners = total
    v, dv = update_at(w.kin, w.nodes, i, v_pic)
    moment = transfers.add_moment(
        w.transfer, w.kin, w.basis, w.grid, stencil, k, N, grad_N, v, moment
    )
    corners = (*corners, v) if moves_corners(w.basis, w.kin) else ()
    return v_pic + N * v, dv_pic + N * dv, moment, *corners


def moves_corners(basis: arrays.Tag, kin: arrays.Tag) -> bool:
    """Return True for a gather at domain corners that move with their velocity."""
    return isinstance(basis, AtCorners) and carried(basis.basis, kin) > 0


def update_at(kin: arrays.Tag, nodes: arrays.Nodes, i: arrays.Index, like: arrays.Number) -> tuple:
    """Return v* and v* - v of a node: one record in 2D, two in 3D."""
    if many_threads() and not isinstance(i, Weighted):  # adjacent records
        both = aligned_record(nodes.update, i, 2 * arrays.of_change(kin))
        first, d = arrays.of_change(kin), kin.dimension
        return vector(kin, both[:d]), vector(kin, both[first : first + d])
    if kin.dimension == 2:
        both = row(nodes.update, i, 0, (*like, *like))
        return vector(kin, both[:2]), vector(kin, both[2:])
    v = arrays.vector_at(kin, nodes.update, i, 0, like)
    return v, arrays.vector_at(kin, nodes.update, i, arrays.of_change(kin), like)


def add_gradient(w, stencil, k, grad_v):
    """Add the contribution of the k-th node to the velocity gradient, if it is gathered."""
    if not len(grad_v):
        return grad_v
    i, _, grad_N = straining_node(w, stencil, k)
    if many_threads() and not isinstance(i, Weighted):
        d = w.kin.dimension
        v = vector(w.kin, aligned_record(w.nodes.velocity, i, arrays.of_change(w.kin))[:d])
    else:
        v = arrays.vector_at(w.kin, w.nodes.velocity, i, 0, zero_vector(w.kin, grad_N[0]))
    return grad_v + outer(v, grad_N)


@gathered.on(Strain)
def _gathered_strain(task, w, stencil, k, total):
    return (add_gradient(w, stencil, k, total[0]), visit.gathered_ratio(w, stencil, k, total[1]))


gathered.on(TrialStrain)(lambda task, w, stencil, k, total: add_gradient(w, stencil, k, total))


@gathered.on(SetMeanStress)
def _gathered_average_stress(task, w, stencil, k, total):
    i, weight, _ = node_of(w, stencil, k)
    return fma(weight, row(field(w.nodes.fields, visit.NodalStress), i, 0, (total,))[0], total)


@gathered.on(SeriesTerm)
def _gathered_series_term(task, w, stencil, k, total):
    i, weight, _ = node_of(w, stencil, k)
    return total + weight * arrays.vector_at(w.kin, field(w.nodes.fields, Series), i, 0, total)


@point_function()
def updated(task, w, stencil, p, dt, total, totals, fastest):
    """Store the update from `total`; return the move of the point in cells, and its rate.

    The rate, c + max |v_i - common_i|, bounds the stable step; the larger of it and `fastest`, the
    largest so far, is returned. A failed point (det F <= 0, NaN, outside the domain) returns a
    distance or a rate of NaN or infinity. `totals` are the totals of all tasks of the visit.
    """


@updated.on(Strain)
def _updated_strain(task, w, stencil, p, dt, total, totals, fastest):
    """Update the state of the law and the domain shape; return growth in cells, and rate."""
    gradient, ratio = total
    if not len(gradient):  # the point stores it
        gradient = totals[0][2]
    dl = increment(dt, gradient)
    if isinstance(task, StrainOfLastStep):
        dl = frames.of_places_before(w.frame, w.kin, dl)
    dl = visit.averaged(w, p, dl, ratio)
    law, old, f = visit.deformed_state(w, p)
    growth = frames.spatial_increment(w.frame, w.kin, dl, f)
    load_step = isinstance(task, StrainOfLoadStep) and laws.by_rates(law)
    strained = large(growth) if load_step else growth  # domains grow by the whole gradient
    beside = load(field(w.points.fields, visit.PressureBeside), p, (dt,))
    state = laws.advance_beside(law, w.kin, old, strained, dt, sum(beside))
    store(w.points.state, p, state)
    now = frames.strained(w.frame, w.kin, f, dl)
    store(field(w.points.fields, frames.DeformationGradient), p, now)
    j = laws.jacobian(law, w.kin, state)
    grown = real(0, j)
    if w.frame.moves and carried(w.basis, w.kin) == 0:
        x = w.places.y if isinstance(task, SecondStrain) else w.places.x
        before = visit.place_at(w.basis, w.kin, x, p)
        after = deformed(w.basis, w.kin, before, growth)
        store_from(w.places.y, p, w.kin.dimension, after)
        grown = grown + further_reach(w.basis, w.kin, w.grid, before, after)
    if not all_lanes(j > 0):
        return where(j > 0, grown, inf), fastest
    # The wave speed is computed only for the few points that may be faster than all before them.
    shorter = frames.inverse_stretch_squared(w.frame, w.kin, now, dt)
    most = laws.wave_speed_bound(law, w.kin, state) * shorter
    speed = (load_vector(w.kin, w.points.v, p) - w.common).largest()
    slack = fastest - speed
    if all_lanes((slack >= 0) & (most <= slack * slack)):  # in this form, NaN is noticed too
        return grown, fastest
    rate = sqrt(laws.wave_speed_squared(law, w.kin, state) * shorter) + speed
    return grown, where(fastest > rate, fastest, rate)


@updated.on(TrialStrain)
def _updated_trial_strain(task, w, stencil, p, dt, total, totals, fastest):
    dl = increment(dt, total)
    if isinstance(task, TrialStrainOfLastStep):
        dl = frames.of_places_before(w.frame, w.kin, dl)
    _, _, f = visit.deformed_state(w, p)
    dl = frames.spatial_increment(w.frame, w.kin, dl, f)
    field(w.points.fields, visit.VolumeRatio)[0, p] = det(I + dl)
    return real(0, dt), fastest


def increment(dt, grad_v):
    """Return dl = dt grad v, as numbers: F + dl is a sum of two of them."""
    return grad_v._make(dt * grad_v)


@updated.on(SetMeanStress)
def _updated_average_stress(task, w, stencil, p, dt, total, totals, fastest):
    field(w.points.fields, visit.AveragedStress)[0, p] = total
    beside = field(w.points.fields, visit.PressureBeside)
    if beside is not None:
        law, state = visit.law_and_state(w, p)
        own = laws.cauchy_stress(law, w.kin, state).mean_of_stretching()
        beside[0, p] = own - total
    return real(0, dt), fastest


@updated.on(SeriesTerm)
def _updated_series_term(task, w, stencil, p, dt, total, totals, fastest):
    store(field(w.points.fields, TermOfSeries), p, total)
    reflect(field(w.points.fields, Reflected), w, stencil, p, total, task.k)
    return real(0, dt), fastest


def further_reach(basis, kin, grid, before, after):
    """Return by how many cells the domain of a point reaches further than before."""
    further = extent(basis, kin, grid, after) - extent(basis, kin, grid, before)
    return max(further, 0)


@updated.on(Move)
def _updated_move(task, w, stencil, p, dt, total, totals, fastest):
    """Update velocity, position and carried corners; return the move in cells."""
    law, state = visit.law_and_state(w, p)
    v_pic, dv, moment, *corners = total
    old = load_vector(w.kin, w.points.v, p)
    v = laws.constrained_velocity(law, old, transfers.updated_velocity(w.transfer, old, v_pic, dv))
    x = load_vector(w.kin, w.places.x, p)
    j = transfers.known_volume(w.transfer, law, w.kin, state)
    displacing = transfers.displacing_velocity(w.transfer, v, v_pic, j)
    step = vector(w.kin, dt * laws.constrained_velocity(law, v, displacing))
    y = x + step
    force = field(w.points.fields, Force)
    if force is not None and not laws.moves_as_told(w.laws):
        # With the mean nodal velocity in the step: stress and constraints act at the same time.
        work = w.kick * dot(load_vector(w.kin, force, p), v_pic - 0.5 * dv)
        increase(field(w.points.fields, WorkOfForces), p, (work,))
    warm_by_friction(field(w.nodes.fields, FrictionalHeat), w, stencil, p, v[0])
    warm(w, stencil, p, v_pic - dv)
    moment = in_company(w, stencil, p, moment)
    y, v, moment, hits = reflected(w.grid, w.kin, y, v, moment)
    increase(field(w.points.fields, Bounces), p, hits)
    store(field(w.points.fields, VelocityBefore), p, old)
    forget(field(w.points.fields, VelocityBefore), p, hits)  # on the other side of the edge
    store(w.points.v, p, v)
    store(field(w.points.fields, transfers.Moment), p, moment)
    store(w.places.y, p, y)
    moved = (y - x).largest() * w.grid.inv_h
    if not w.frame.moves:
        return moved, fastest
    if carried(w.basis, w.kin) > 0:
        before = visit.place_at(w.basis, w.kin, w.places.x, p)
        new = (*(x + step), *before[len(x) :])
        for corner in range(carried(w.basis, w.kin)):
            if len(corners):
                u = corners[corner]
            else:
                by = carrier(w.basis, w.kin, w.grid, stencil, corner)
                u = arrays.vector_at(w.kin, w.nodes.update, by, 0, x)
            new = carry(w.basis, w.kin, new, before, corner, dt * u)
        store(w.places.y, p, new)
        moved += further_reach(w.basis, w.kin, w.grid, before, new)
    return where(inside(w.grid, w.kin, y), moved, inf), fastest


empty_all = visit.for_tags(empty, "w, x")
gathered_all = visit.for_tags(gathered, "w, stencil, k, totals", each="totals")


def updated_all(tasks, w, stencil, p, dt, totals, fastest):
    """Update by the tasks in order: distances are summed, and the rate is passed on."""
    moved = real(0, fastest)
    for task, total in zip(tasks, totals, strict=True):
        further, fastest = updated(task, w, stencil, p, dt, total, totals, fastest)
        moved += further
    return moved, fastest
