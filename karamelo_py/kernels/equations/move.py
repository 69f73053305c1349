"""Points move with the nodal velocity v_pic = sum_i N_i v*_i."""

from math import inf, nan

from karamelo_py.compiler import real, where
from karamelo_py.compiler.fields import Field, field, forget, increase, store, vector
from karamelo_py.kernels import arrays
from karamelo_py.kernels.equations import Report, Task
from karamelo_py.kernels.equations.internal_force import Force, WorkOfForces
from karamelo_py.kernels.equations.loss import retained_moment, warm, warm_by_friction
from karamelo_py.kernels.equations.strain import further_reach
from karamelo_py.kernels.equations.transfer_loss import count_loss
from karamelo_py.kernels.views import location_at
from karamelo_py.points import kinematics, laws, transfers
from karamelo_py.points.basis import carried, carrier, carry
from karamelo_py.points.basis.cpdi import AtCorners
from karamelo_py.points.basis.product import retained
from karamelo_py.points.grid import Bounces, inside, reflected
from karamelo_py.points.kinematics import dot


class VelocityBefore(Field):
    """Velocity before the last step; NaN if there is none, and after a reflection."""

    shape = vector
    start = nan


class Move(Task):
    """Gathers v* and its change; updates velocity, position and corners; reports the move."""

    not_at_corners = ("moments",)
    records = "update"
    says = "g2p, move"
    reads = ("x", "v")
    writes = ("x moved", "v", "moment", "bounces")

    def empty(task, w, x):
        return x - x, x - x, transfers.zero_moment(w.transfer, w.kin, x[0])

    def gathered(task, node, total):
        v_pic, dv_pic, moment, *corners = total
        v, dv = node.v_star(v_pic)
        moment = transfers.add_moment(node.transfer, node, v, moment)
        corners = (*corners, v) if moves_corners(node.w.basis, node.kin) else ()
        return v_pic + node.N * v, dv_pic + node.N * dv, moment, *corners

    def updated(task, pt, total, totals, fastest):
        w, old, (law, state), (v_pic, dv, moment, *corners) = pt.w, pt.v, pt.law_and_state, total
        x, new = pt.x, transfers.updated_velocity(w.transfer, old, v_pic, dv)
        v = laws.constrained_velocity(law, old, new)
        j = transfers.known_volume(w.transfer, law, w.kin, state)
        displacing = transfers.displacing_velocity(w.transfer, v, v_pic, j)
        step = kinematics.vector(w.kin, pt.dt * laws.constrained_velocity(law, v, displacing))
        y = x + step
        force = pt.load(Force, old)
        if len(force) and not laws.is_rigid(w.laws):
            # Work uses the mean nodal velocity in the step, including stress and constraints.
            work = w.kick * dot(force, v_pic - 0.5 * dv)
            increase(pt.of(WorkOfForces), pt.p, (work,))
        warm_by_friction(pt)
        warm(pt, v_pic - dv)
        moment = towards_walls(pt, retained_moment(pt, moment))
        count_loss(pt, v, dv, moment)
        y, v, moment, hits = reflected(w.grid, w.kin, y, v, moment)
        increase(pt.of(Bounces), pt.p, hits)
        store(pt.of(VelocityBefore), pt.p, old)
        forget(pt.of(VelocityBefore), pt.p, hits)  # reflected points have no velocity before
        store(w.points.v, pt.p, v)
        store(pt.of(transfers.Moment), pt.p, moment)
        store(w.locations.y, pt.p, y)
        moved = (y - x).largest() * w.grid.inv_h
        if not w.frame.moves:
            return Report(moved, fastest)
        if carried(w.basis, w.kin) > 0:
            before = location_at(w.basis, w.kin, w.locations.x, pt.p)
            new = _corners_carried(pt, (*(x + step), *before[len(x) :]), corners)
            store(w.locations.y, pt.p, new)
            moved += further_reach(w.basis, w.kin, w.grid, before, new)
        return Report(where(inside(w.grid, w.kin, y), moved, inf), fastest)


def towards_walls(pt, moment):
    """Return the part of the moment that a point retains at a wall, where D may vanish.

    The limit is for isolated points. Some transfers retain more if other points are near.
    """
    kept = retained(pt.w.basis, pt.stencil) if len(moment) else ()
    if kept and pt.w.transfer.traits.by_neighbours:
        mass = field(pt.w.nodes.fields, transfers.NodalMass)
        mass_of_point = pt.w.points.mass[pt.p]
        mass_fraction, least = mass_of_point - mass_of_point, real(1e-36, mass_of_point)
        for node in pt.nodes:
            mass_fraction += node.N * node.N * mass_of_point / max(mass[node.i, 0], least)
        kept = tuple([1 - mass_fraction * (1 - one) for one in kept])
    return transfers.narrowed(pt.w.transfer, moment, kept) if kept else moment


def moves_corners(basis: arrays.Tag, kin: arrays.Tag) -> bool:
    return isinstance(basis, AtCorners) and carried(basis.basis, kin) > 0


def _corners_carried(pt, new, corners):
    """Return the location `new` with corners moved by `corners`, their velocities (d,).

    If `corners` is empty, velocities are interpolated from the nodes.
    """
    w = pt.w
    for corner in range(carried(w.basis, w.kin)):
        if len(corners):
            u = corners[corner]
        else:
            by = carrier(w.basis, w.kin, w.grid, pt.stencil, corner)
            u = arrays.vector_at(w.kin, w.nodes.update, by, 0, pt.x)
        new = carry(w.basis, w.kin, new, corner, pt.dt * u)
    return new
