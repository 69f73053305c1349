"""Rotation of axisymmetric bodies around their axis.

Points store the velocity v around the axis. Nodes have an angular velocity w, with inertia sum N m
r^2, angular momentum sum N m r v and torque -sum V r (s_31 dN/dr + s_32 dN/dz). Angular momentum is
conserved with any transfer, since r^2 w is mapped; torques sum to 0; and a point that moves retains
r v (Coriolis). Rigid rotation is exact, and w is regular at the axis. The centrifugal force of a
point is m v^2 / r.
"""

from typing import NamedTuple

from karamelo_py.compiler import real
from karamelo_py.compiler.fields import (
    Field,
    StepField,
    SummedField,
    field,
    increase,
    pair,
    store,
    triple,
)
from karamelo_py.compiler.lanes import of_present
from karamelo_py.kernels import arrays
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels.equations.internal_force import (
    Force,
    WorkOfForces,
    force_around,
    minus_V_stress,
)
from karamelo_py.kernels.equations.loss import OnePoint
from karamelo_py.kernels.equations.mass_momentum import for_second_mapping
from karamelo_py.kernels.equations.node_updates import WorkAtNodes, node_task
from karamelo_py.kernels.equations.strain import increment, increment_at, velocity_gradient
from karamelo_py.kernels.equations.transfer_loss import count_rotation
from karamelo_py.kernels.records import row
from karamelo_py.points import transfers
from karamelo_py.points.kinematics import Line, tensor, vector
from karamelo_py.points.kinematics.twist import Twisted, gradient_around, times_radius


class VelocityAround(Field):
    """Velocity around the axis, from x to z."""

    columns = ("vtheta",)


class AngleAround(Field):
    """Angle by which a point has rotated, in radians."""

    columns = ("twist",)


class MomentAround(Field):
    """Moment or gradient of the angular velocity, as in `transfers.Moment`."""

    shape = pair


class RadiusAfterMove(StepField):
    """Radius of a point after its last move."""


class SumsAround(SummedField):
    """Inertia, angular momentum and torque of a node, as `Nodes.sums` in 1D."""

    shape = triple


class MomentumAround(SummedField):
    """Nodal sum of N m v around the axis."""


class UpdateAround(StepField):
    """Updated angular velocity w* of a node, and its change."""

    shape = pair


class AngularVelocity(SummedField):
    """Nodal angular velocity that strains the points."""


class MassTimesRadius(SummedField):
    """Sum of N m r at a node: the torque of a unit acceleration around the axis."""


class TorqueOfLoads(StepField):
    """Torque of fixes on a node."""


LINE = Line()
INERTIA = eq.MASS._replace(array=SumsAround)
MOMENT = eq.NodeColumns(SumsAround, lambda kin: 1, lambda kin: 1, lambda kin: 2)
TORQUE = eq.NodeColumns(SumsAround, lambda kin: 2, lambda kin: 1, lambda kin: 3)


def rotation(pt, r):
    """Return inertia, angular velocity and its moment (or ()) of a point at radius r.

    Velocity and moment are stored in both components of a plane vector, as transfers map vectors.
    """
    omega = pt.of(VelocityAround)[0, pt.p] / r
    moment = pt.load(MomentAround, (r, r))
    if len(moment):
        affine = tensor(pt.kin.plane, (*moment, *moment))
        moment = transfers.with_affine_part(pt.w.transfer, pt.kin, affine)
    return OnePoint(eq.mass(pt) * r * r, vector(pt.kin, (omega, omega)), moment)


@eq.reads("mass", "x moved", "velocity around", "moment around")
def rotation_after(pt):
    r = pt.y[0]
    store(pt.of(RadiusAfterMove), pt.p, (r,))
    return rotation(pt, r)


@eq.reads()
def radius_after(pt):
    return pt.y[0]


@eq.reads("mass", "radius after move", "velocity around", "moment around")
def rotation_again(pt):
    made = rotation(pt, pt.of(RadiusAfterMove)[0, pt.p])
    return made._replace(moment=for_second_mapping(pt, made.moment))


def angular_momentum(pt, node):
    return (transfers.nodal_momentum(node.transfer, pt.around, node)[0],)


def momentum_around(pt, node):
    mass, omega, _ = pt.around
    return (node.N * (mass / pt.radius * omega[0]),)


class RotationToNodes(eq.ExtensiveQuantity):
    not_at_corners = ("moments",)
    says = "angular momentum to grid"
    takes = eq.of_point(around=rotation_after, radius=radius_after)
    gives = (
        eq.Sum(INERTIA, lambda pt, node: (node.N * pt.around.mass,)),
        eq.Sum(MOMENT, angular_momentum),
        eq.Sum(eq.whole(MomentumAround), momentum_around),
        eq.Sum(
            eq.whole(MassTimesRadius), lambda pt, node: (node.N * (pt.around.mass / pt.radius),)
        ),
    )


class RotationAgain(eq.ExtensiveQuantity):
    not_at_corners = ("moments",)
    says = "angular momentum to grid"
    takes = eq.of_point(around=rotation_again)
    gives = (eq.Sum(eq.whole(AngularVelocity), angular_momentum),)


@eq.reads("mass", "state", "material", "deformation gradient", "radius after move")
def torque(pt):
    """Return -V r times components 31 and 32 of the frame's stress."""
    stress, r = minus_V_stress(pt), pt.of(RadiusAfterMove)[0, pt.p]
    return r * stress.at()[2, 0], r * stress.at()[2, 1]


@eq.reads("force", "radius after move")
def torque_of_force(pt):
    """Return r times the force of fixes around the axis, or ()."""
    force = pt.of(Force)
    return () if force is None else (pt.of(RadiusAfterMove)[0, pt.p] * force[2, pt.p],)


def torque_at(pt, node):
    at_node = pt.torque[0] * node.strain_N[0] + pt.torque[1] * node.strain_N[1]
    return (at_node + node.N * pt.push[0] if len(pt.push) else at_node,)


class Torque(eq.ExtensiveQuantity):
    not_at_corners = ("moments",)
    says = "torque"
    takes = eq.of_point(torque=torque, push=torque_of_force)
    gives = (eq.Sum(TORQUE, torque_at),)


@force_around.on(Twisted)
def _force_around_twisted(kin, pt):
    v, r = pt.of(VelocityAround)[0, pt.p], pt.of(RadiusAfterMove)[0, pt.p]
    force = of_present(pt.p, pt.w.points.mass[pt.p] * v * v / r)
    return vector(kin, (force, force - force))


@node_task
class PushOutwards(NamedTuple):
    """Adds the change of centrifugal force due to the new w*, and sums the work of torques."""

    says = "centrifugal force"
    goes_through = ("sums", "sums", "momentum around", "update around")

    def at_node(task, kin, nodes, n, dt):
        momentum = field(nodes.fields, MomentumAround)[n, 0]
        omega, change = (field(nodes.fields, UpdateAround)[n, k] for k in range(2))
        nodes.sums[n, arrays.of_force(kin)] += momentum * (change + change)
        load = field(nodes.fields, TorqueOfLoads)
        if load is not None:
            field(nodes.fields, WorkAtNodes)[n, 0] += dt * load[n, 0] * (omega - 0.5 * change)
            load[n, 0] = 0


@velocity_gradient.on(Twisted)
def _velocity_gradient_twisted(kin, node):
    (omega,) = row(node.of(AngularVelocity), node.i, 0, (node.N,))
    return gradient_around(node.v, omega, node.strain_N)


@increment_at.on(Twisted)
def _increment_at_twisted(kin, pt, gradient):
    _, _, f = pt.law_state_F
    return times_radius(increment(pt.dt, gradient), pt.of(RadiusAfterMove)[0, pt.p], f)


def rotation_at(node):
    """Return w, w* and its change at a node."""
    zero = node.N - node.N
    (omega,) = row(node.of(AngularVelocity), node.i, 0, (zero,))
    return omega, *row(node.of(UpdateAround), node.i, 0, (zero, zero))


class Rotate(eq.Task):
    """Gathers w* and its change; updates the velocity around the axis and the angle."""

    not_at_corners = ("moments",)
    says = "rotation"
    reads = ("x moved", "radius after move", "velocity around", "angle around", "moment around")
    writes = ("velocity around", "angle around", "moment around")

    def empty(task, w, x):
        zero = x[0] - x[0]
        return zero, zero, transfers.zero_moment(w.transfer, w.kin, zero)

    def gathered(task, node, total):
        at_nodes, change, moment = total
        omega, more = row(node.of(UpdateAround), node.i, 0, (at_nodes, change))
        both = vector(node.kin, (omega, omega))
        moment = transfers.add_moment(node.transfer, node, both, moment)
        return at_nodes + node.N * omega, change + node.N * more, moment

    def updated(task, pt, total, totals, fastest):
        (at_nodes, change, moment), r = total, pt.of(RadiusAfterMove)[0, pt.p]
        before = rotation(pt, r)
        new = transfers.updated_velocity(pt.w.transfer, before.v[0], at_nodes, change)
        affine = transfers.affine_part(pt.w.transfer, moment)
        moment = transfers.with_affine_part(pt.w.transfer, pt.kin, affine)
        after = before._replace(v=vector(pt.kin, (new, new)), moment=moment)
        count_rotation(pt, before, after, change, rotation_at)
        store(pt.of(VelocityAround), pt.p, (r * r * new / pt.y[0],))
        store(pt.of(RadiusAfterMove), pt.p, (pt.y[0],))
        store(pt.of(AngleAround), pt.p, (pt.of(AngleAround)[0, pt.p] + pt.dt * at_nodes,))
        if len(moment):
            store(pt.of(MomentAround), pt.p, affine[:2])
        for push in torque_of_force(pt):
            work = pt.w.kick * push * (at_nodes - 0.5 * change)
            increase(pt.of(WorkOfForces), pt.p, (work,))
        return eq.Report(real(0, pt.dt), fastest)
