"""Nodal accelerations with the error of the lumped mass removed.

The lumped mass matrix m_I averages what the transfer maps to a node: a wave of wave number k loses
the fraction kappa (k h)^2 of its acceleration, with kappa = D / h^2. Adjacent nodes along the axes
return it in pairs, which conserves momentum to round-off::

    a_I + kappa / m_I sum_J min(m_I, m_J) (a_I - a_J)
"""

from typing import Any, NamedTuple

from karamelo_py.compiler import index, real
from karamelo_py.compiler.fields import StepField, field, vector
from karamelo_py.kernels import arrays
from karamelo_py.kernels.arrays import MASS
from karamelo_py.kernels.equations import RigidSums
from karamelo_py.kernels.equations.node_updates import node_task, per_mass
from karamelo_py.points.grid import Grid


class Acceleration(StepField):
    """Change of a node's velocity by the forces of a step; 0 where the velocity is prescribed."""

    shape = vector


class Held(StepField):
    """1 where a fix prescribes the velocity of a node, else 0, per direction."""

    shape = vector


@node_task
class StoreAcceleration(NamedTuple):
    goes_through = ("sums", "held", "acceleration")

    def at_node(task, kin, nodes, n, dt):
        fixed, rigid = field(nodes.fields, Held), field(nodes.fields, RigidSums)
        factor = dt * per_mass(nodes, n, dt)
        if rigid is not None:
            factor = real(0, dt) if rigid[n, MASS] > 0 else factor
        for k in range(kin.dimension):
            change = factor * nodes.sums[n, arrays.of_force(kin) + k]
            field(nodes.fields, Acceleration)[n, k] = real(0, dt) if fixed[n, k] > 0 else change


@node_task
class CorrectAcceleration(NamedTuple):
    """Corrects v* and its change by the adjacent nodes along the axes."""

    spread: Any  # kappa
    grids: Grid

    says = "accelerations corrected by the next nodes"
    goes_through = ("sums", "sums", "acceleration", "acceleration", "update", "update")

    def at_node(task, kin, nodes, n, dt):
        if nodes.sums[n, MASS] > 0:
            factor = task.spread / nodes.sums[n, MASS]
            for axis in range(kin.dimension):
                for way in (-1, 1):
                    m = _beside(task, nodes, n, axis, way)
                    _give_back(kin, nodes, n, m, factor)


def _give_back(kin, nodes, n, m, factor):
    """Correct node `n` by node `m`, if that has mass; `m` is `n` at an edge of the grid."""
    mass = min(nodes.sums[n, MASS], nodes.sums[m, MASS])
    if mass > 0:
        change = field(nodes.fields, Acceleration)
        for k in range(kin.dimension):
            more = factor * mass * (change[n, k] - change[m, k])
            nodes.update[n, k] += more
            nodes.update[n, arrays.of_change(kin) + k] += more


def _beside(task, nodes, n, axis, way):
    grids, g = task.grids, 0
    while g + 1 < grids.first.size and int(n) >= grids.first[g + 1]:
        g += 1
    end = grids.first[g + 1] if g + 1 < grids.first.size else nodes.sums.shape[0]
    local = int(n) - grids.first[g]
    step_x, step_y = grids.step_x[g], grids.step_y[g]
    if axis == 0:
        position, count, step = local // step_x, (end - grids.first[g]) // step_x, step_x
    elif axis == 1:
        position, count, step = local % step_x // step_y, step_x // step_y, step_y
    else:
        position, count, step = local % step_y, step_y, 1
    inside = 0 <= position + way < count
    m = int(n) + way * step if inside else int(n)
    return index(m)


def correct_acceleration(s: arrays.Setup) -> CorrectAcceleration:
    return CorrectAcceleration(real(s.basis.traits.spread, s.nodes.sums[0, MASS]), s.grids)


correct_acceleration.goes_through = CorrectAcceleration.goes_through  # type: ignore[attr-defined]
