"""A step of conduction.

It comes before the momentum update, at the places of the points then:

- heat and heat capacity go from the points to the nodes, which so have a temperature T. Points
  bring their gradient along: else the mean of the points beside a wall would be taken for the
  temperature of the wall;
- points take the gradient of T, and give their heat flow -kappa V grad T, and what fixes supply, to
  the nodes, which so have a temperature T* after the step;
- points take the change T* - T (FLIP). What the nodes do not show of the points' temperatures
  conduction would never level: of that, as much goes in a step as conduction levels of a wave of
  the grid, z = 4 d kappa dt / (rho cp h^2). The mean at the nodes that it goes to is weighted with
  conductance, for heat to be kept. Fields that the basis can hold are not smeared by that, and
  without conduction nothing is.
"""

import numpy as np

from karamelo_py.compiler.compile import over_blocks, point_function, shared
from karamelo_py.compiler.fields import field
from karamelo_py.kernels import arrays
from karamelo_py.kernels.clock import step_size
from karamelo_py.kernels.heat import (
    Capacity,
    Conducting,
    HeatContent,
    HeatFlow,
    Supply,
    Temperature,
    TemperatureGradient,
    TemperatureShare,
    Volume,
    Warming,
)
from karamelo_py.kernels.hook_loop import (
    Warmth,
    clear_totals,
    node_hooks,
    point_hooks,
    publish_totals,
)
from karamelo_py.kernels.nodes import NodalUpdate, SumsToVelocity, TakeMean
from karamelo_py.kernels.reports import read_reports
from karamelo_py.kernels.rows import conduct
from karamelo_py.kernels.sweep import OldWeights, Visit, sweep, sweep_nodes
from karamelo_py.kernels.totals import agree_on_heat
from karamelo_py.points.kinematics import Line


@point_function(otherwise=True)
def at_heat_nodes(hooks, stage, target, s):
    """Let the fixes act on the nodes of heat."""


@at_heat_nodes.on(arrays.Hooks)
def _at_heat_nodes_hooks(hooks, stage, target, s):
    # Temperatures are always kept: FLIP, whatever the transfer of velocity.
    clock = s.control.clock[0]
    clock.set_low, clock.set_high = np.inf, -np.inf
    node_hooks(
        stage, target, Line(), s.grids, s.heat.nodes, s.ranges, hooks, s.control, step_size(s), 1.0
    )
    agree_on_heat(s.control.ranks, s.control)
    clock.coldest = min(clock.coldest, clock.set_low)
    clock.hottest = max(clock.hottest, clock.set_high)


@over_blocks
def _supply_blocks(block, s, hooks):
    points = block.points
    fields = points.fields
    warmth = Warmth(
        points.id,
        s.kin,
        field(fields, Capacity),
        field(fields, Temperature),
        field(fields, Volume),
        field(fields, Supply),
        field(fields, TemperatureShare),
        points.x[s.control.clock[0].now],
    )
    point_hooks(arrays.SUPPLY_HEAT, warmth, hooks, s.control, step_size(s))


@point_function(otherwise=True)
def at_heated_points(hooks, s):
    """Let the fixes supply heat to points, or set their temperature."""


@at_heated_points.on(arrays.Hooks)
def _at_heated_points_hooks(hooks, s):
    clock = s.control.clock[0]
    clock.rise = clock.fall = 0.0
    clear_totals(arrays.SUPPLY_HEAT, hooks, s.control)
    _supply_blocks(s, hooks)
    publish_totals(arrays.SUPPLY_HEAT, hooks, s.control)
    agree_on_heat(s.control.ranks, s.control)
    clock.hottest += step_size(s) * clock.rise
    clock.coldest += step_size(s) * clock.fall


@shared
def visit_for_heat(heat, s, mode, visit, gathers, scatters):
    """Visit the points for heat: the nodes are those of heat."""
    here = arrays.with_nodes(s, heat.nodes, heat.buffers)
    sweep(here, mode, visit, step_size(s), gathers, scatters, False)


@shared
def map_heat(heat, s, mode, gathers, scatters):
    """Heat capacity and heat of the nodes from the points now, or temperature from the nodes."""
    # One loop for both.
    visit = Visit((Warming(),), (HeatContent(),), OldWeights())
    visit_for_heat(heat, s, mode, visit, gathers, scatters)


@point_function(otherwise=True)
def show_heat(heat, s, mode):
    """See that the nodes show the temperature before the first step."""


@show_heat.on(Conducting)
def _show_heat_conducting(heat, s, mode):
    map_heat(heat, s, mode, False, True)
    sweep_nodes(mode, SumsToVelocity(), Line(), heat.nodes, s.ranges, step_size(s))


@conduct.on(Conducting)
def _conduct_conducting(heat, s, mode, hooks):
    dt = step_size(s)
    nodes = heat.nodes
    kin = Line()
    map_heat(heat, s, mode, False, True)
    sweep_nodes(mode, SumsToVelocity(), kin, nodes, s.ranges, dt)
    sweep_nodes(mode, TakeMean(), kin, nodes, s.ranges, dt)
    at_heat_nodes(hooks, arrays.POST_HEAT_TO_GRID, arrays.ON_VELOCITY, s)
    at_heated_points(hooks, s)
    flow = Visit((TemperatureGradient(),), (HeatFlow(),), OldWeights())
    visit_for_heat(heat, s, mode, flow, True, True)
    sweep_nodes(mode, NodalUpdate(), kin, nodes, s.ranges, dt)
    at_heat_nodes(hooks, arrays.POST_UPDATE_GRID_HEAT, arrays.ON_UPDATE, s)
    map_heat(heat, s, mode, True, False)
    # What `Warming` reports as a rate is by what factor conduction has become faster.
    read_reports(s)
    clock = s.control.clock[0]
    clock.heat_limit = clock.heat_reference / clock.new_rate
