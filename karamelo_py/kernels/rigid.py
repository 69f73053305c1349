"""Rigid bodies on a common grid: nodes near them take their velocity.

Rigid points scatter to separate sums (`RigidSums`), so the usual nodal sums belong to other solids,
for any density of the rigid solid. The force of the rigid solid acts on these solids.
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import kernel, noinline
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import MASS, of_change, of_force, of_momentum
from karamelo_py.kernels.clock import kick
from karamelo_py.kernels.equations import RigidSums
from karamelo_py.kernels.table import EachPoint, Once, each_node, each_node_apart
from karamelo_py.kernels.totals import WORK, add_to, carry, counts, publish
from karamelo_py.kernels.views import location_at
from karamelo_py.points.basis import entry, locate, support
from karamelo_py.points.grid import node_position
from karamelo_py.points.laws.rigid import Rigid


def _at_nodes(s):
    return s.kin, s.nodes, field(s.nodes.fields, RigidSums)


@noinline
def _impose(at, dt, control, n):
    """Set the velocity of a node with rigid points, and store the force of the solid in `rigid`.

    Work is as for a prescribed velocity. The change v* - v includes this force, otherwise points
    would not get the velocity of the rigid solid with FLIP.
    """
    kin, nodes, rigid = at
    d = kin.dimension
    if not rigid[n, MASS] > 0:
        for k in range(d):
            rigid[n, of_force(kin) + k] = 0
        return
    mass = nodes.sums[n, MASS]
    for k in range(d):
        velocity = rigid[n, of_momentum(kin) + k] / rigid[n, MASS]
        impulse = change = 0.0
        if mass > 0:
            impulse = velocity - nodes.update[n, k]
            # from the momentum of points, as a fix may have held the node
            change = velocity - nodes.sums[n, of_momentum(kin) + k] / mass
        rigid[n, of_force(kin) + k] = -mass * impulse / dt
        nodes.update[n, k] = velocity
        nodes.update[n, of_change(kin) + k] = change
        if counts(control.ranks, n):
            add_to(control.totals, WORK, float(mass * impulse * velocity))


def _impose_on_strain(at, n):
    kin, nodes, rigid = at
    if rigid[n, MASS] > 0:
        for k in range(kin.dimension):
            nodes.velocity[n, k] = rigid[n, of_momentum(kin) + k] / rigid[n, MASS]


def _is_loaded(kin, rigid, n):
    loaded = False
    for k in range(kin.dimension):
        loaded = loaded or rigid[n, of_force(kin) + k] != 0
    return loaded


def _add_forces(s, block, p):
    basis, kin, points, totals, d = s.basis, s.kin, block.points, s.control.totals, s.kin.dimension
    rigid, forces, torques = field(s.nodes.fields, RigidSums), s.contact.force, s.contact.torque
    grid = record(s.grids, points.grid[p])
    stencil = locate(
        basis, kin, grid, location_at(basis, kin, points.x[s.control.motion[0].now], p)
    )
    force = torque = (0.0, 0.0, 0.0)
    for node in range(support(basis, kin)):
        n, weight, _ = entry(basis, kin, grid, stencil, node)
        if weight > 0 and _is_loaded(kin, rigid, n):
            mass_fraction = weight * points.mass[p] / rigid[n, MASS]
            x = node_position(grid, n)
            here = [mass_fraction * rigid[n, of_force(kin) + i] if i < d else 0.0 for i in range(3)]
            force = tuple([a + b for a, b in zip(force, here, strict=True)])
            turning = [x[i - 2] * here[i - 1] - x[i - 1] * here[i - 2] for i in range(3)]
            torque = tuple([a + b for a, b in zip(torque, turning, strict=True)])
    for i in range(3):
        add_to(totals, forces[points.id[p]] + i, force[i])
        add_to(totals, torques[points.id[p]] + i, torque[i])


@noinline
def _is_tile_loaded(s, tiling, t):
    """Return True if a rigid solid acts on a node in reach of a tile's points."""
    grid, d = record(s.grids, tiling.grid[t]), s.kin.dimension
    rigid = field(s.nodes.fields, RigidSums)
    ends = [(tiling.box[t, c], tiling.box[t, d + c] + 1) if c < d else (0, 1) for c in range(3)]
    for i in range(ends[0][0], ends[0][1]):
        for j in range(ends[1][0], ends[1][1]):
            for k in range(ends[2][0], ends[2][1]):
                if _is_loaded(s.kin, rigid, grid.first + i * grid.step_x + j * grid.step_y + k):
                    return True
    return False


@kernel
def _add_forces_by_tile(s, block):
    for t in range(block.tiling.count[0]):
        if _is_tile_loaded(s, block.tiling, t):
            for p in range(block.tiling.range[t, 0], block.tiling.range[t, 1]):
                _add_forces(s, block, p)


@kernel
def _begin_sums(s):
    carry(s.control.totals[WORK])
    for slot in s.contact.slots:
        s.control.totals[slot : slot + 3] = 0


@kernel
def _publish_sums(s):
    for slot in s.contact.slots:
        publish(s.control, slot, 3)


PUBLISH = (
    Once(_begin_sums),
    EachPoint(_add_forces, Rigid, _add_forces_by_tile),
    Once(_publish_sums),
)


class RigidBodies(NamedTuple):
    node_fields = (RigidSums,)
    rows = (each_node(lambda s, n: _impose(_at_nodes(s), kick(s), s.control, n)), *PUBLISH)
    rows_before = rows_after = (each_node_apart(lambda s, n: _impose_on_strain(_at_nodes(s), n)),)
    rows_work = ()

    force: np.ndarray  # (n,) slot of the force on each point's solid, or -1
    torque: np.ndarray  # (n,) slot of the torque, or -1
    slots: np.ndarray  # (r,) of forces and torques
