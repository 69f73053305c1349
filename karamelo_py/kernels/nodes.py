"""Tasks at the nodes between two visits of the points."""

from typing import NamedTuple

from karamelo_py.compiler.compile import point_function, real, round_off
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.tuples import clear_first
from karamelo_py.kernels import arrays
from karamelo_py.kernels.arrays import Index, Nodes, Number, Tag
from karamelo_py.kernels.loss import EnergyLoss, FrictionalHeat
from karamelo_py.kernels.p2g import SquaredMass
from karamelo_py.kernels.visit import NodalMean, NodalStress
from karamelo_py.points.transfers.xpic import Series


class TakeMean(NamedTuple):
    """The weighted mean from its two sums, at the nodes."""

    goes_through = ("nodal mean", "nodal mean")


class TakeMeanStress(TakeMean):
    """The same of the mean stress."""

    goes_through = ("nodal stress", "nodal stress")


class StartSeries(NamedTuple):
    """First term of the series of XPIC: the velocity v; the new one as far as it is known."""

    goes_through = ("sums", "series", "update", "update")


class ExtendSeries(NamedTuple):
    """Next term of the series of XPIC, in the new velocity, too."""

    goes_through = ("sums", "series", "series", "update", "update")


class KeepLoss(NamedTuple):
    """Energy loss of a node: kinetic energy from points minus its own kinetic energy."""

    goes_through = ("sums", "energy loss", "energy loss")


class ClearFrictionalHeat(NamedTuple):
    """Heat of friction starts from zero."""

    goes_through = ("frictional heat",)


class NodalUpdate(NamedTuple):
    """v* = v + dt f / m from the sums."""

    says = "update v*"
    goes_through = ("sums", "update")


class MomentumToVelocity(NamedTuple):
    """The momentum in the velocity array over the mass: the re-mapped velocity of MUSL."""

    says = "re-mapped velocity"
    goes_through = ("sums", "velocity", "velocity")


class SumsToVelocity(NamedTuple):
    """Velocity from the momentum in the sums, before the update (USF)."""

    says = "nodal velocity"
    goes_through = ("sums", "velocity")


class UpdateToVelocity(NamedTuple):
    """The velocity whose gradient deforms the points is v*, limited at light nodes (USL).

    A point of mass m that gives a node the fraction N of it gets back the strain of f dt / (N m)
    from there: an oscillation that grows when (c dt / h)^2 > N, in d directions at once. Nodes
    lighter than `light` = d (c dt / h)^2 times the mean mass of the points that they see, weighted
    with what these give, count as such; the limit vanishes with the step.
    """

    light: float

    goes_through = ("sums", "update", "velocity")


@point_function()
def at_node(task: Tag, kin: Tag, nodes: Nodes, n: Index, dt: Number) -> None:
    """Do `task` at node `n`. Nodes without mass stay at rest."""


def per_mass(nodes: Nodes, n: Index, like: Number) -> Number:
    """Return one over the mass of a node, 0 where it has none."""
    mass = nodes.sums[n, arrays.MASS]
    return real(1, like) / mass if mass > 0 else real(0, like)


@at_node.on(KeepLoss)
def _at_node_keep_loss(task, kin, nodes, n, dt):
    """Store, per mass, the energy from points that the node does not have."""
    lost, mass = field(nodes.fields, EnergyLoss), nodes.sums[n, arrays.MASS]
    if mass > 0:
        one = real(1, mass)
        factor = one / mass
        kinetic = mass - mass
        for k in range(kin.dimension):
            v = nodes.sums[n, arrays.of_momentum(kin) + k] * factor
            kinetic += real(0.5, mass) * v * v
        # Of bodies that fly as one, the difference is round-off of either sign, and no heat.
        noise = real(8, mass) * round_off(mass) * kinetic
        lost[n, 1] = max(lost[n, 0] * factor - kinetic - noise, mass - mass)
        lost[n, 2] = mass


@at_node.on(ClearFrictionalHeat)
def _at_node_clear_frictional_heat(task, kin, nodes, n, dt):
    clear_first(field(nodes.fields, FrictionalHeat), n)


@at_node.on(NodalUpdate)
def _at_node_update(task, kin, nodes, n, dt):
    factor = per_mass(nodes, n, dt)
    for k in range(kin.dimension):
        dv = dt * nodes.sums[n, arrays.of_force(kin) + k] * factor
        nodes.update[n, k] = nodes.sums[n, arrays.of_momentum(kin) + k] * factor + dv
        nodes.update[n, arrays.of_change(kin) + k] = dv


@at_node.on(MomentumToVelocity)
def _at_node_momentum_to_velocity(task, kin, nodes, n, dt):
    factor = per_mass(nodes, n, dt)
    for k in range(kin.dimension):
        nodes.velocity[n, k] *= factor


@at_node.on(SumsToVelocity)
def _at_node_sums_to_velocity(task, kin, nodes, n, dt):
    factor = per_mass(nodes, n, dt)
    for k in range(kin.dimension):
        nodes.velocity[n, k] = nodes.sums[n, arrays.of_momentum(kin) + k] * factor


def unlimited(seen, n, mass, light):
    """Return the fraction of its velocity change that a node shows: 1 unless it is light."""
    if seen is None:
        return real(1, mass)
    square = mass * mass
    least = light * seen[n, 0]
    return square / least if square < least else real(1, mass)


@at_node.on(UpdateToVelocity)
def _at_node_update_to_velocity(task, kin, nodes, n, dt):
    # See UpdateToVelocity.light: the change of a light node's velocity enters the gradient by the
    # fraction of its mass. Points take the whole change: momentum is conserved.
    one = real(1, dt)
    share = unlimited(field(nodes.fields, SquaredMass), n, nodes.sums[n, arrays.MASS], task.light)
    for k in range(kin.dimension):
        dv = nodes.update[n, arrays.of_change(kin) + k]
        nodes.velocity[n, k] = nodes.update[n, k] - (one - share) * dv


@at_node.on(TakeMean)
def _at_node_take_mean(task, kin, nodes, n, dt):
    sums = field(nodes.fields, NodalStress if isinstance(task, TakeMeanStress) else NodalMean)
    if sums[n, 1] > 0:
        sums[n, 0] /= sums[n, 1]


@at_node.on(StartSeries)
def _at_node_start_series(task, kin, nodes, n, dt):
    d = kin.dimension
    series = field(nodes.fields, Series)
    factor = per_mass(nodes, n, dt)
    for k in range(d):
        v = nodes.sums[n, arrays.of_momentum(kin) + k] * factor
        series[n, k] = v
        nodes.update[n, arrays.of_change(kin) + k] = nodes.update[n, k]


@at_node.on(ExtendSeries)
def _at_node_extend_series(task, kin, nodes, n, dt):
    d = kin.dimension
    series = field(nodes.fields, Series)
    factor = per_mass(nodes, n, dt)
    for k in range(d):
        v = series[n, k] - series[n, d + k] * factor
        series[n, k] = v
        nodes.update[n, arrays.of_change(kin) + k] += v
