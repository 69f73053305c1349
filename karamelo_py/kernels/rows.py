"""Rows of the tables of schemes, and what only some scenes have."""

from collections.abc import Callable
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import point_function, real, shared
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.loops import kernel
from karamelo_py.compiler.tuples import clear_first
from karamelo_py.kernels import arrays, p2g, table
from karamelo_py.kernels.arrays import Number, Setup, Tag
from karamelo_py.kernels.averaging import FBar
from karamelo_py.kernels.clock import step_size
from karamelo_py.kernels.g2p import Move, SeriesTerm, SetMeanStress
from karamelo_py.kernels.hook_loop import add_work
from karamelo_py.kernels.loss import EnergyLoss, FrictionalHeat
from karamelo_py.kernels.nodes import (
    ClearFrictionalHeat,
    ExtendSeries,
    KeepLoss,
    MomentumToVelocity,
    NodalUpdate,
    StartSeries,
    SumsToVelocity,
    TakeMean,
    TakeMeanStress,
    UpdateToVelocity,
)
from karamelo_py.kernels.sweep import OldWeights, Visit, sweep, sweep_nodes
from karamelo_py.points.kinematics import Axisymmetric, dimension
from karamelo_py.points.transfers.xpic import XPIC


class Insulated(NamedTuple):
    """No heat flows between points."""


@point_function(otherwise=True)
def conduct(heat: Tag, s: Setup, mode: Tag, hooks: Tag) -> None:
    """Let heat flow between points for the length of a step; by default none does."""


@point_function(otherwise=True)
def touch(contact: Tag, s: Setup) -> None:
    """Let solids with velocity fields of their own act on each other; by default there are none."""


@point_function(otherwise=True)
def touch_velocity(contact: Tag, s: Setup, steps: int) -> None:
    """See that the velocity that deforms the points agrees with contact, where it is not v*.

    `steps` is 1 when v* of this step is known, and 0 before: what touched in the last step counts.
    """


@kernel
def _clear_radial(kin, nodes, grids):
    for g in range(grids.first.size):
        if abs(grids.x0[g]) > grids.slack[g] * grids.h[g]:
            continue
        for n in range(grids.first[g], grids.first[g] + grids.step_x[g]):
            if nodes.sums[n, arrays.MASS] > 0:
                nodes.sums[n, arrays.of_momentum(kin)] = 0
                nodes.sums[n, arrays.of_force(kin)] = 0
                nodes.update[n, 0] = 0
                nodes.update[n, arrays.of_change(kin)] = 0
                nodes.velocity[n, 0] = 0
                clear_first(field(nodes.fields, p2g.Normal), n)


@point_function(otherwise=True)
def hold_axis(kin: Tag, s: Setup) -> None:
    """Let no node on an axis of symmetry leave it; by default there is none."""


@hold_axis.on(Axisymmetric)
def _hold_axis_axisymmetric(kin, s):
    # v_r = 0 at r = 0: N / r of a node there grows without bound where a point comes near. And a
    # body that touches another on the axis has a normal along it.
    _clear_radial(kin, s.nodes, s.grids)


@point_function(otherwise=True)
def sum_series(transfer: Tag, s: Setup, mode: Tag) -> None:
    """Put the new velocity of XPIC in the place of the change of velocity; others need nothing."""


@sum_series.on(XPIC)
def _sum_series_xpic(transfer, s, mode):
    # (I - (I - S S+)^m) v_p = S sum_k (I - S+ S)^k S+ v, the sum from 0 to m - 1
    dt = step_size(s)
    sweep_nodes(mode, StartSeries(), s.kin, s.nodes, s.ranges, dt)
    for k in range(transfer.order - 1):
        visit = Visit((SeriesTerm(k),), (p2g.SeriesBack(),), OldWeights())
        sweep(s, mode, visit, dt, True, True, False)
        sweep_nodes(mode, ExtendSeries(), s.kin, s.nodes, s.ranges, dt)
    hold_axis(s.kin, s)


@point_function(otherwise=True)
def average_volumes(averaging: Tag, s: Setup, mode: Tag, dt: Number, trial: Tag) -> None:
    """Average the change of volume of the strain to come at the nodes; by default it is not.

    `trial` is the task that finds it.
    """


@average_volumes.on(FBar)
def _average_volumes_f_bar(averaging, s, mode, dt, trial):
    visit = Visit((trial,), (p2g.Volumes(),), OldWeights())
    sweep(s, mode, visit, dt, True, True, False)
    sweep_nodes(mode, TakeMean(), s.kin, s.nodes, s.ranges, dt)


@point_function(otherwise=True)
def average_stress(averaging: Tag, s: Setup, mode: Tag) -> None:
    """Put the averaged mean stress in the place of the points' own; by default each has its own."""


@average_stress.on(FBar)
def _average_stress_f_bar(averaging, s, mode):
    dt = step_size(s)
    sweep_nodes(mode, TakeMeanStress(), s.kin, s.nodes, s.ranges, dt)
    visit = Visit((SetMeanStress(),), (p2g.AveragedForce(),), OldWeights())
    sweep(s, mode, visit, dt, True, True, False)


@shared
def sum_loss(s: Setup, mode: Tag) -> None:
    """At the nodes, what they do not keep of kinetic energy, where it becomes heat."""
    if field(s.nodes.fields, FrictionalHeat) is not None:
        sweep_nodes(mode, ClearFrictionalHeat(), s.kin, s.nodes, s.ranges, step_size(s))
    if field(s.nodes.fields, EnergyLoss) is not None:
        sweep_nodes(mode, KeepLoss(), s.kin, s.nodes, s.ranges, step_size(s))


@shared
def light_node(s):
    """Nodal mass below which USL limits the gradient: d (c dt / h)^2 of a point that the node sees.

    Less than one: a share below m / m_p would be less than what comes back to the node through the
    points' velocities, and the strain of the node would run ahead of its stress.
    """
    clock = s.control.clock[0]
    courant = clock.rate * s.control.values[arrays.DT] / clock.spacing
    masses = min(dimension(s.kin) * courant * courant, 1.0)
    return UpdateToVelocity(real(masses, s.nodes.sums[0, arrays.MASS]))


light_node.goes_through = UpdateToVelocity.goes_through  # type: ignore[attr-defined]


def _call(do: Any, says: Callable[[Any], str | None]) -> table.SceneTask:
    """A row that does something; `says` tells what in a scene."""
    do.says = says
    return table.SceneTask(do)


HEAT = _call(
    lambda s, mode, hooks: conduct(s.heat, s, mode, hooks),
    lambda s: (
        None
        if isinstance(s.heat, Insulated)
        else "heat to the nodes, its flow, temperature of the points"
    ),
)
LOSS = _call(
    lambda s, mode, hooks: sum_loss(s, mode),
    lambda s: (
        None
        if field(s.nodes.fields, EnergyLoss) is None
        else "kinetic energy that the nodes do not keep, as heat to the points"
    ),
)
AVERAGED = _call(
    lambda s, mode, hooks: average_stress(s.averaging, s, mode),
    lambda s: (
        "force of the averaged mean stress in one visit of the points"
        if isinstance(s.averaging, FBar)
        else None
    ),
)
CONTACT = _call(
    lambda s, mode, hooks: touch(s.contact, s),
    lambda s: "contact of v*" if touch.defined(type(s.contact)) else None,
)
WORK_OF_LOADS = _call(lambda s, mode, hooks: add_work(hooks, s), lambda s: None)
CONTACT_BEFORE = _call(lambda s, mode, hooks: touch_velocity(s.contact, s, 0), lambda s: None)
CONTACT_AFTER = _call(lambda s, mode, hooks: touch_velocity(s.contact, s, 1), lambda s: None)
AXIS = _call(
    lambda s, mode, hooks: hold_axis(s.kin, s),
    lambda s: "v_r = 0 on the axis" if hold_axis.defined(type(s.kin)) else None,
)
SERIES = _call(
    lambda s, mode, hooks: sum_series(s.transfer, s, mode),
    lambda s: "series of XPIC" if isinstance(s.transfer, XPIC) else None,
)

SUMS = table.Scatter((p2g.MassMomentum(), p2g.InternalForce()))
MASS_AND_MOMENTUM = table.Scatter((p2g.MassMomentum(),))
# For schemes that strain first.
VELOCITY_BEFORE = (MASS_AND_MOMENTUM, AXIS, table.NodeTask(SumsToVelocity()))
FORCE = table.Scatter((p2g.InternalForce(),), OldWeights())
# v* = v + dt f / m, with what the fixes add and prescribe; and heat flows.
ACCELERATE = (
    LOSS,
    AVERAGED,
    HEAT,
    table.AtNodes(arrays.POST_PARTICLES_TO_GRID, arrays.ON_SUMS),
    AXIS,
    table.NodeTask(NodalUpdate()),
    table.AtNodes(arrays.POST_UPDATE_GRID_STATE, arrays.ON_UPDATE),
    CONTACT,
    WORK_OF_LOADS,
)
MOVE = (
    table.Gather(Move()),
    table.AtPoints(arrays.POST_GRID_TO_POINT, 1),
    table.AtPoints(arrays.POST_ADVANCE_PARTICLES, 1),
    table.Check(),
)
# The velocity of the moved points, at the nodes once more.
MOMENTUM_AGAIN = (
    table.Scatter((p2g.MomentumAgain(),), OldWeights()),
    table.NodeTask(MomentumToVelocity()),
    AXIS,
)
