"""Tasks at nodes between two passes over the points."""

from typing import Any, NamedTuple

from karamelo_py.compiler import point_function, real
from karamelo_py.compiler.fields import Field, SummedField, field
from karamelo_py.kernels import arrays
from karamelo_py.kernels.arrays import Index, Nodes, Number, Tag


@point_function()
def at_node(task: Tag, kin: Tag, nodes: Nodes, n: Index, dt: Number) -> None:
    """Carry out `task` at node `n`; nodes without mass remain at rest."""


def node_task(tag: Any) -> Any:
    at_node.on(tag)(vars(tag)["at_node"])
    if "says" not in vars(tag):
        tag.says = ""
    return tag


def per_mass(nodes: Nodes, n: Index, template: Number) -> Number:
    """Return 1 / mass of a node, or 0 without mass."""
    mass = nodes.sums[n, arrays.MASS]
    return real(1, template) / mass if mass > 0 else real(0, template)


def unlimited(seen, n, mass, light):
    """Return the fraction of a node's velocity change that enters gradients, below 1 if light."""
    if seen is None:
        return real(1, mass)
    square = mass * mass
    least = light * seen[n, 0]
    return square / least if square < least else real(1, mass)


class WorkAtNodes(Field):
    """Work at a node since the last energy check: of loads on pore water, and of torques."""


class SquaredMass(SummedField):
    """Nodal sum of N m^2; divided by the sum of N m, it is the mean mass of points (USL)."""

    @staticmethod
    def needed(basis):
        return basis.traits.steep_edge


@node_task
class NodalUpdate(NamedTuple):
    """Sets v* = v + dt f / m."""

    says = "update v*"
    goes_through = ("sums", "update")

    def at_node(task, kin, nodes, n, dt):
        factor = per_mass(nodes, n, dt)
        for k in range(kin.dimension):
            dv = dt * nodes.sums[n, arrays.of_force(kin) + k] * factor
            nodes.update[n, k] = nodes.sums[n, arrays.of_momentum(kin) + k] * factor + dv
            nodes.update[n, arrays.of_change(kin) + k] = dv


@node_task
class MomentumToVelocity(NamedTuple):
    """Divides the re-mapped momentum by the mass (MUSL)."""

    says = "re-mapped velocity"
    goes_through = ("sums", "velocity", "velocity")

    def at_node(task, kin, nodes, n, dt):
        factor = per_mass(nodes, n, dt)
        for k in range(kin.dimension):
            nodes.velocity[n, k] *= factor


@node_task
class SumsToVelocity(NamedTuple):
    says = "nodal velocity"
    goes_through = ("sums", "velocity")

    def at_node(task, kin, nodes, n, dt):
        factor = per_mass(nodes, n, dt)
        for k in range(kin.dimension):
            nodes.velocity[n, k] = nodes.sums[n, arrays.of_momentum(kin) + k] * factor


@node_task
class UpdateToVelocity(NamedTuple):
    """Limits the velocity v* that strains points, at light nodes (USL).

    A point of mass m that gives the fraction N to a node gets a strain from the velocity change f
    dt / (N m) of this node. The strain oscillates and grows if (c dt / h)^2 > N, in d directions at
    once. The limit applies to nodal masses below `light` = d (c dt / h)^2 times the mean mass of
    the points, and vanishes with the step.
    """

    light: float

    goes_through = ("sums", "update", "velocity")

    def at_node(task, kin, nodes, n, dt):
        # Points take the whole change, so momentum is conserved; only the gradient is limited.
        one = real(1, dt)
        share = unlimited(
            field(nodes.fields, SquaredMass), n, nodes.sums[n, arrays.MASS], task.light
        )
        for k in range(kin.dimension):
            dv = nodes.update[n, arrays.of_change(kin) + k]
            nodes.velocity[n, k] = nodes.update[n, k] - (one - share) * dv
