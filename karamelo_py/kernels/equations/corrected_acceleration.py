"""Nodal accelerations with the error of the lumped mass removed.

Mass lumping averages what the transfer maps to a node: a wave of wave number k loses the fraction
kappa (k h)^2 of its acceleration, where kappa = D / h^2. Differences between adjacent nodes restore
it in pairs, which conserves linear momentum to round-off::

    a_I + kappa / m_I sum_J min(m_I, m_J) (a_I - a_J)
"""

from typing import Any, NamedTuple

from karamelo_py.compiler import index, real, where
from karamelo_py.compiler.fields import StepField, field
from karamelo_py.kernels import arrays
from karamelo_py.kernels.arrays import MASS, vector_at
from karamelo_py.kernels.equations import RigidSums
from karamelo_py.kernels.equations.node_updates import NodalUpdate, at_node, node_task
from karamelo_py.points.grid import Grid
from karamelo_py.points.kinematics import zero_vector


class Acceleration(StepField):
    """Velocity change of a node by forces, 0 where the velocity is prescribed; and the mass."""

    @staticmethod
    def shape(kin):
        return kin.dimension + 1


class Sides(StepField):
    """Bits of a node: HELD << k if a fix sets velocity k, LOWER << k or UPPER << k at an edge."""


HELD, LOWER, UPPER = 1, 8, 64


@node_task
class UpdateToCorrect(NamedTuple):
    """`NodalUpdate` that stores the velocity change for adjacent nodes."""

    says = NodalUpdate.says
    goes_through = (*NodalUpdate.goes_through, "sides", "acceleration")

    def at_node(task, kin, nodes, n, dt):
        at_node(NodalUpdate(), kin, nodes, n, dt)
        stored, rigid = field(nodes.fields, Acceleration), field(nodes.fields, RigidSums)
        sides = int(field(nodes.fields, Sides)[n, 0])
        for k in range(kin.dimension):
            change = nodes.update[n, arrays.of_change(kin) + k]
            stored[n, k] = change if sides & (HELD << k) == 0 else real(0, dt)
        stored[n, kin.dimension] = nodes.sums[n, MASS]
        if rigid is not None and rigid[n, MASS] > 0:
            for k in range(kin.dimension):
                stored[n, k] = real(0, dt)


@node_task
class CorrectAcceleration(NamedTuple):
    """Adds the differences from adjacent nodes to v* and its change."""

    spread: Any  # kappa
    grids: Grid

    says = "accelerations corrected by the next nodes"
    goes_through = ("acceleration", "acceleration", "sides", "update", "update")

    def at_node(task, kin, nodes, n, dt):
        stored, d = field(nodes.fields, Acceleration), kin.dimension
        mass = stored[n, d]
        if mass > 0:
            sides, strides = int(field(nodes.fields, Sides)[n, 0]), _strides(task.grids, kin, n)
            change = vector_at(kin, stored, n, 0, zero_vector(kin, dt))
            more = zero_vector(kin, dt)
            for axis in range(d):
                for side, step in ((LOWER, -strides[axis]), (UPPER, strides[axis])):
                    m = index(int(n) + where(sides & (side << axis) == 0, step, 0))
                    other = vector_at(kin, stored, m, 0, change)
                    more += min(mass, stored[m, d]) * (change - other)
            factor = task.spread / mass
            for k in range(d):
                nodes.update[n, k] += factor * more[k]
                nodes.update[n, arrays.of_change(kin) + k] += factor * more[k]


def _strides(grids, kin, n):
    """Return the strides of node numbers along the axes."""
    g = 0
    while g + 1 < grids.first.size and int(n) >= grids.first[g + 1]:
        g += 1
    of_all = grids.step_x[g], grids.step_y[g], 1
    return (*of_all[: kin.dimension - 1], 1)


def correct_acceleration(s: arrays.Setup) -> CorrectAcceleration:
    return CorrectAcceleration(real(s.basis.traits.spread, s.nodes.sums[0, MASS]), s.grids)
