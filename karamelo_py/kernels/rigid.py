"""Rigid bodies on a grid that all solids share: nodes under them take their velocity.

Rigid points give their mass and momentum to sums of their own (`RigidSums`), so that those of the
nodes are of the other solids alone, whatever the density of a rigid body. Where a node sees rigid
points its velocity is theirs; what that takes is the force that they put on the others.
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.compile import over_blocks, point_function
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.loops import kernel
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import MASS, of_change, of_force, of_momentum
from karamelo_py.kernels.clock import kick
from karamelo_py.kernels.p2g import RigidSums
from karamelo_py.kernels.table import touch, touch_velocity
from karamelo_py.kernels.totals import add_to, publish
from karamelo_py.kernels.visit import place_at
from karamelo_py.points.basis import entry, locate, support
from karamelo_py.points.grid import node_position
from karamelo_py.points.kinematics import dimension
from karamelo_py.points.laws.rigid import Rigid


class RigidBodies(NamedTuple):
    """Rigid solids among others on one grid."""

    node_fields = (RigidSums,)

    force: np.ndarray  # (n,) slot of the published force on the solid of each point, by id, or -1
    torque: np.ndarray  # (n,) the same of the torque
    slots: np.ndarray  # (r,) slots of forces and torques


@kernel
def _lead(kin, nodes, led, spans, dt, kept):
    """Nodes that see rigid points take their velocity; the force of that comes to stand in `led`.

    As with a body of infinite mass, v* - v is nothing: points that keep their velocity take none
    from there. `kept` is the share that they keep.
    """
    d = dimension(kin)
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            if not led[n, MASS] > 0:
                for k in range(d):
                    led[n, of_force(kin) + k] = 0
                continue
            mass = nodes.sums[n, MASS]
            for k in range(d):
                velocity = led[n, of_momentum(kin) + k] / led[n, MASS]
                impulse = 0.0
                if mass > 0:
                    before = nodes.sums[n, of_momentum(kin) + k] / mass
                    impulse = velocity - nodes.update[n, k] + kept * (before - velocity)
                led[n, of_force(kin) + k] = -mass * impulse / dt
                nodes.update[n, k] = velocity
                nodes.update[n, of_change(kin) + k] = 0


@kernel
def _lead_velocity(kin, nodes, led, spans):
    """The same of the velocity that deforms the points."""
    for s in range(1, 1 + spans[0, 0]):
        for n in range(spans[s, 0], spans[s, 1]):
            if led[n, MASS] > 0:
                for k in range(dimension(kin)):
                    nodes.velocity[n, k] = led[n, of_momentum(kin) + k] / led[n, MASS]


@point_function(otherwise=True)
def sum_forces(laws, contact, s, points, led):
    """Add up the forces on rigid points, and their torques about the origin."""


@kernel
def _sum_forces(basis, kin, grids, places, points, led, force, torque, totals):
    d = dimension(kin)
    for p in range(points.mass.size):
        grid = record(grids, points.grid[p])
        stencil = locate(basis, kin, grid, place_at(basis, kin, places, p))
        first, turning = force[points.id[p]], torque[points.id[p]]
        for k in range(support(basis, kin)):
            n, weight, _ = entry(basis, kin, grid, stencil, k)
            if not weight > 0:
                continue
            share = weight * points.mass[p] / led[n, MASS]
            x = node_position(grid, n)
            fx = share * led[n, of_force(kin)]
            fy = share * led[n, of_force(kin) + 1] if d > 1 else 0.0
            fz = share * led[n, of_force(kin) + 2] if d > 2 else 0.0
            add_to(totals, first, fx)
            add_to(totals, first + 1, fy)
            add_to(totals, first + 2, fz)
            add_to(totals, turning, x[1] * fz - x[2] * fy)
            add_to(totals, turning + 1, x[2] * fx - x[0] * fz)
            add_to(totals, turning + 2, x[0] * fy - x[1] * fx)


@sum_forces.on(Rigid)
def _sum_forces_rigid(laws, contact, s, points, led):
    places = points.x[s.control.clock[0].now]
    _sum_forces(
        s.basis, s.kin, s.grids, places, points, led, contact.force, contact.torque,
        s.control.totals,
    )  # fmt: skip


@over_blocks
def _sum_forces_of_blocks(block, s, led):
    sum_forces(block.laws, s.contact, s, block.points, led)


@kernel
def _clear(slots, totals):
    for slot in slots:
        totals[slot : slot + 3] = 0


@kernel
def _publish(slots, control):
    for slot in slots:
        publish(control, slot, 3)


@touch.on(RigidBodies)
def _touch_rigid_bodies(contact, s):
    led = field(s.nodes.fields, RigidSums)
    _lead(s.kin, s.nodes, led, s.spans, kick(s), s.control.clock[0].kept)
    _clear(contact.slots, s.control.totals)
    _sum_forces_of_blocks(s, led)
    _publish(contact.slots, s.control)


@touch_velocity.on(RigidBodies)
def _touch_velocity_rigid_bodies(contact, s, steps):
    _lead_velocity(s.kin, s.nodes, field(s.nodes.fields, RigidSums), s.spans)
