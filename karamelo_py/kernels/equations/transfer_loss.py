"""Kinetic energy that points lose in the transfer of velocity.

When the velocity of a point of mass m changes from v to v', the change dv = sum_i N_i dv_i of nodal
velocities does the work m dv . (v + v') / 2. The transfer takes the rest of the change of
m v^2 / 2. If points store a velocity field v + a(X), dv_i also does work on the mean of a before
and after the step, m sum_i N_i dv_i . (a_i + a'_i) / 2.

Summed over points, the work is sum_i m_i dv_i . (v_i + w_i) / 2, with the nodal velocities v_i
before the step and w_i mapped again from the points after it. FLIP 1 loses nothing. The energy of
the fields a(X) does not count as kinetic energy of points.

Usl strains by v*, not by w: forces at nodes do the work f dt . (v* - w) that no point gets. Usf and
usl count the work of contact with (v_i + v*) / 2, which is too much by half of that.
"""

from karamelo_py.compiler import real
from karamelo_py.compiler.fields import Field, increase
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels.arrays import MASS, of_momentum, vector_at
from karamelo_py.kernels.equations.loss import OnePoint
from karamelo_py.kernels.equations.mass_momentum import ContactImpulse, for_second_mapping
from karamelo_py.points import laws
from karamelo_py.points.kinematics import dot
from karamelo_py.points.laws.eos import taken_heat
from karamelo_py.points.laws.pore_water import Saturated
from karamelo_py.points.transfers import NodalMass, nodal_momentum


class TransferLoss(Field):
    """Kinetic energy that a point has lost in the transfer of velocity since the start."""

    family = "transfer loss"
    work_with_update = strains_by_update = False

    @staticmethod
    def needed(law):
        # Gases take this energy up as heat (`equations.loss`); the loss of water is not known.
        return not (laws.can(law, taken_heat) or isinstance(law, Saturated))


class LossByUpdate(TransferLoss):
    """Energy lost in the transfer, in a scheme that does not map velocities again."""

    work_with_update = True


class LossOfStrain(LossByUpdate):
    """Energy lost in the transfer, in a scheme that strains by v*."""

    strains_by_update = True


def count_loss(pt, v, dv, moment):
    """Add the energy lost by a point from its old velocity to `v`, with the new `moment`."""
    lost = pt.of(TransferLoss)
    if lost is None or laws.is_rigid(pt.w.laws):
        return
    kind, old = _kind(pt), pt.v
    moments = _again(kind, pt, (eq.moment(pt), moment))
    if pt.w.transfer.traits.series:
        dv = _change(pt, dv)
    gone = 0.5 * dot(dv - (v - old), old + v)
    for node in pt.nodes if len(moment) else ():
        _, change = node.v_star(v)
        for one in moments:
            gone += 0.5 * dot(change, _velocity(pt, node, v - v, one))
    for node in pt.nodes if kind.work_with_update else ():
        gone += _not_taken(kind, node, v, _velocity(pt, node, v, moment))
    increase(lost, pt.p, (pt.w.points.mass[pt.p] * gone,))


def count_rotation(pt, before, after, change, around):
    """Add the energy lost in the velocity around an axis.

    Points `before` and `after` the step have the inertia, angular velocity (twice) and moment;
    ``around(node)`` returns w, w* and its change at a node.
    """
    lost = pt.of(TransferLoss)
    if lost is None:
        return
    kind, zero = _kind(pt), after.v - after.v
    old, new = before.v[0], after.v[0]
    gone = 0.5 * (change - (new - old)) * (old + new)
    moments = _again(kind, pt, (before.moment, after.moment))
    for node in pt.nodes if len(after.moment) else ():
        for one in moments:
            gone += 0.5 * around(node)[2] * _velocity(pt, node, zero, one)[0]
    for node in pt.nodes if kind.strains_by_update else ():
        omega, _, more = around(node)
        gone += more * (node.N * omega - _velocity(pt, node, after.v, after.moment)[0])
    increase(lost, pt.p, (after.mass * gone,))


def _kind(pt):
    (kind,) = [type(one) for one in pt.w.points.fields if isinstance(one, TransferLoss)]
    return kind


def _again(kind, pt, moments):
    """Return the moments that the second mapping of velocities uses, if a scheme has one."""
    if kind.work_with_update:
        return moments
    return tuple([for_second_mapping(pt, one) for one in moments])


def _velocity(pt, node, v, moment):
    """Return N_i times the velocity that a point gives to a node."""
    return nodal_momentum(pt.w.transfer, OnePoint(1.0, v, moment), node)


def _change(pt, v):
    """Return sum_i N_i dv_i for a dv_i that a series has replaced."""
    dv = v - v
    for node in pt.nodes:
        star, _ = node.v_star(v)
        momentum = vector_at(node.kin, node.w.nodes.sums, node.i, of_momentum(node.kin), v)
        dv = dv + node.N * (star - momentum / node.w.nodes.sums[node.i, MASS])
    return dv


def _not_taken(kind, node, v, again):
    """Return the work at a node that no point gets; `again`: N_i times the re-mapped velocity."""
    impulse, (star, dv) = node.of(ContactImpulse), node.v_star(v)
    work = v[0] - v[0]
    if impulse is not None:
        mass = node.of(NodalMass)[node.i, 0]
        impulse = vector_at(node.kin, impulse, node.i, 0, v)
        by_contact = impulse / max(mass, real(1e-36, mass))
        work += 0.5 * dot(by_contact, node.N * star - again)
        dv = dv - by_contact
    if kind.strains_by_update:
        work += dot(dv, node.N * node.v - again)
    return work
