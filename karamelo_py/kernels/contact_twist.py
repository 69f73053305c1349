"""Friction of contact around an axis.

Friction between two nodes acts at their common radius of gyration, so the torques are opposite.
"""

from math import sqrt

from karamelo_py.compiler.fields import field
from karamelo_py.kernels import contact
from karamelo_py.kernels.arrays import MASS
from karamelo_py.kernels.equations.mass_momentum import ContactImpulse
from karamelo_py.kernels.equations.twist import AngularVelocity, SumsAround, UpdateAround
from karamelo_py.kernels.totals import CONTACT_LOSS, add_to, counts
from karamelo_py.points.kinematics.twist import Twisted

AROUND = 2


def _radius(nodes, n, m):
    inertia = field(nodes.fields, SumsAround)
    mass = nodes.sums[n, MASS] + nodes.sums[m, MASS]
    return sqrt((inertia[n, 0] + inertia[m, 0]) / mass)


def _yielding(fields, nodes, n, r):
    inertia = field(nodes.fields, SumsAround)[n, 0]
    return 0.0 if fields.prescribed[n, AROUND] != 0 else r * r / inertia


@contact.around_of.on(Twisted)
def _around_of_twisted(kin, fields, nodes, pair, again):
    n, m = pair.n, pair.m
    sums, r = field(nodes.fields, SumsAround), _radius(nodes, pair.n, pair.m)
    omega = field(nodes.fields, AngularVelocity if again else UpdateAround)
    before = r * (sums[n, 1] / sums[n, 0] - sums[m, 1] / sums[m, 0])
    yields = _yielding(fields, nodes, n, r) + _yielding(fields, nodes, m, r)
    return r * (omega[n, 0] - omega[m, 0]), yields, before


@contact.take_around.on(Twisted)
def _take_around_twisted(kin, bodies, control, sides, impulse):
    fields, _, nodes = bodies
    first, second = sides
    r = _radius(nodes, first.n, second.n)
    for side, sign in ((first, -1.0), (second, 1.0)):
        slot = fields.prescribed[side.n, AROUND]
        _change(bodies, side.n, side.i, sign * impulse, r)
        if not slot:
            field(nodes.fields, ContactImpulse)[side.n, AROUND] += sign * r * impulse
        if counts(control.ranks, side.n):
            torque = sign * r * impulse / control.step[0].kick
            add_to(control.totals, fields.torque[side.field] + 1, torque)
            if slot:
                add_to(control.totals, slot - 1, -torque)
                omega = field(nodes.fields, UpdateAround)[side.n, 0]
                add_to(control.totals, CONTACT_LOSS, -float(sign * r * impulse * omega))


@contact.work_around.on(Twisted)
def _work_around_twisted(kin, nodes, n):
    """Return the work, with the mean of the angular velocity before the step and w*."""
    sums, update = field(nodes.fields, SumsAround), field(nodes.fields, UpdateAround)
    impulse = field(nodes.fields, ContactImpulse)[n, AROUND]
    return float(0.5 * impulse * (sums[n, 1] / sums[n, 0] + update[n, 0]))


def _change(bodies, n, i, impulse, r):
    fields, _, nodes = bodies
    if fields.prescribed[n, AROUND] == 0:
        fields.change[i, AROUND] += impulse * r / field(nodes.fields, SumsAround)[n, 0]


@contact.stay_around.on(Twisted)
def _stay_around_twisted(kin, bodies, pair, sides, share):
    fields, _, nodes = bodies
    speed, yields, _ = contact.around_of(kin, fields, nodes, pair, True)
    if yields > 0:
        r = _radius(nodes, pair.n, pair.m)
        _change(bodies, pair.n, sides[0], -share * speed / yields, r)
        _change(bodies, pair.m, sides[1], share * speed / yields, r)


@contact.turn.on(Twisted)
def _turn_twisted(kin, nodes, n, change, again):
    if again:
        field(nodes.fields, AngularVelocity)[n, 0] += change
    else:
        for k in range(2):
            field(nodes.fields, UpdateAround)[n, k] += change
