"""Rigid bodies on a grid that all solids share: nodes under them take their velocity.

Rigid points give their mass and momentum to sums of their own (`RigidSums`), so that those of the
nodes are of the other solids alone, whatever the density of a rigid body. Where a node sees rigid
points its velocity is theirs; what that takes is the force that they put on the others.
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.compile import shared
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.loops import kernel
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import MASS, of_change, of_force, of_momentum
from karamelo_py.kernels.clock import kick
from karamelo_py.kernels.p2g import RigidSums
from karamelo_py.kernels.table import touch, touch_velocity
from karamelo_py.kernels.totals import WORK, add_to, carry, counts, publish
from karamelo_py.kernels.visit import place_at
from karamelo_py.points.basis import entry, locate, support
from karamelo_py.points.grid import node_position
from karamelo_py.points.laws.rigid import Rigid


class RigidBodies(NamedTuple):
    """Rigid solids among others on one grid."""

    node_fields = (RigidSums,)

    force: np.ndarray  # (n,) slot of the published force on the solid of each point, by id, or -1
    torque: np.ndarray  # (n,) the same of the torque
    slots: np.ndarray  # (r,) slots of forces and torques


@kernel
def _impose(kin, nodes, rigid, spans, dt, kept, control):
    """Nodes that see rigid points take their velocity; the force of that comes to stand in `rigid`.

    Its work on the others is that of one that prescribes velocities.

    As with a body of infinite mass, v* - v is nothing: points that keep their velocity take none
    from there. `kept` is the share that they keep.
    """
    d = kin.dimension
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            if not rigid[n, MASS] > 0:
                for k in range(d):
                    rigid[n, of_force(kin) + k] = 0
                continue
            mass = nodes.sums[n, MASS]
            for k in range(d):
                velocity = rigid[n, of_momentum(kin) + k] / rigid[n, MASS]
                impulse = 0.0
                if mass > 0:
                    before = nodes.sums[n, of_momentum(kin) + k] / mass
                    impulse = velocity - nodes.update[n, k] + kept * (before - velocity)
                rigid[n, of_force(kin) + k] = -mass * impulse / dt
                nodes.update[n, k] = velocity
                nodes.update[n, of_change(kin) + k] = 0
                if counts(control.ranks, n):
                    add_to(control.totals, WORK, float(mass * impulse * velocity))
    carry(control.totals[WORK])


@kernel
def _impose_on_strain(kin, nodes, rigid, spans):
    """The same of the velocity that deforms the points."""
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            if rigid[n, MASS] > 0:
                for k in range(kin.dimension):
                    nodes.velocity[n, k] = rigid[n, of_momentum(kin) + k] / rigid[n, MASS]


@kernel
def _sum_forces(basis, kin, grids, places, points, rigid, forces, torques, totals):
    """Add up the forces on rigid points, and their torques about the origin."""
    d = kin.dimension
    for p in range(points.mass.size):
        grid = record(grids, points.grid[p])
        stencil = locate(basis, kin, grid, place_at(basis, kin, places, p))
        first, turning = forces[points.id[p]], torques[points.id[p]]
        for node in range(support(basis, kin)):
            n, weight, _ = entry(basis, kin, grid, stencil, node)
            if not weight > 0:
                continue
            share = weight * points.mass[p] / rigid[n, MASS]
            x = node_position(grid, n)
            force = [share * rigid[n, of_force(kin) + i] if i < d else 0.0 for i in range(3)]
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                add_to(totals, first + i, force[i])
                add_to(totals, turning + i, x[j] * force[k] - x[k] * force[j])


@touch.on(RigidBodies)
def _touch_rigid_bodies(contact, s):
    rigid = field(s.nodes.fields, RigidSums)
    _impose(s.kin, s.nodes, rigid, s.spans, kick(s), s.control.clock[0].kept, s.control)
    _publish_forces(contact, s)


def put_forces(contact, s, nodes, forces):
    """Publish forces (n, d) that nodes put on rigid bodies, with their torques."""
    rigid, first = field(s.nodes.fields, RigidSums), of_force(s.kin)
    rigid[nodes, first : first + s.kin.dimension] = forces
    _publish_forces(contact, s)


@shared
def _publish_forces(contact, s):
    rigid = field(s.nodes.fields, RigidSums)
    for slot in contact.slots:
        s.control.totals[slot : slot + 3] = 0
    now = s.control.clock[0].now
    for points, laws, _ in s.blocks:
        if isinstance(laws, Rigid):
            _sum_forces(
                s.basis, s.kin, s.grids, points.x[now], points, rigid,
                contact.force, contact.torque, s.control.totals,
            )  # fmt: skip
    for slot in contact.slots:
        publish(s.control, slot, 3)


@touch_velocity.on(RigidBodies)
def _touch_velocity_rigid_bodies(contact, s, steps):
    _impose_on_strain(s.kin, s.nodes, field(s.nodes.fields, RigidSums), s.spans)
