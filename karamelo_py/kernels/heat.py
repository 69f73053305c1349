"""Heat flow through the nodes, and the fixes that act on it.

Capacity and temperature are treated like mass and velocity: nodes for heat are `Nodes` with one
component and use the same loops (:mod:`karamelo_py.kernels.equations.heat`).
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import point_function
from karamelo_py.compiler.fields import field
from karamelo_py.kernels import arrays, hook_loop
from karamelo_py.kernels.arrays import Buffers, Nodes
from karamelo_py.kernels.clock import step_size
from karamelo_py.kernels.equations import heat as of_heat
from karamelo_py.kernels.equations.fbar import TakeMean
from karamelo_py.kernels.equations.node_updates import NodalUpdate, SumsToVelocity
from karamelo_py.kernels.sweep import OldWeights, Visit
from karamelo_py.kernels.table import AtNodes, AtPoints, NodeTask, Processor, Sweep, take
from karamelo_py.kernels.totals import agree_on_heat
from karamelo_py.points.kinematics import Line


@point_function(otherwise=True)
def at_heat_nodes(hooks, stage, target, s):
    pass


@at_heat_nodes.on(arrays.Hooks)
def _at_heat_nodes_hooks(hooks, stage, target, s):
    # temperatures are always mapped as in FLIP
    heat = s.control.heat[0]
    heat.set_low, heat.set_high = np.inf, -np.inf
    here = at_its_nodes(s)
    members = hook_loop.hooked_nodes(here, target, 1.0)
    hook_loop.node_hooks(stage, members, hooks, here, step_size(s))
    agree_on_heat(s.control.ranks, s.control)
    heat.coldest = min(heat.coldest, heat.set_low)
    heat.hottest = max(heat.hottest, heat.set_high)


def heated(s, block, then):
    points = block.points
    fields = [field(points.fields, kind) for kind in of_heat.HEATED]
    return hook_loop.HeatedPoints(points.id, s.kin, *fields, points.x[s.control.motion[0].now])


def heat_of(points):
    return tuple([field(points.fields, kind) for kind in (of_heat.Supply, of_heat.Capacity)])


@point_function(otherwise=True)
def at_heated_points(hooks, s):
    pass


@at_heated_points.on(arrays.Hooks)
def _at_heated_points_hooks(hooks, s):
    heat = s.control.heat[0]
    heat.rise = heat.fall = 0.0
    hook_loop.point_hooks(arrays.SUPPLY_HEAT, 0, hooks, s, (heated, heat_of))
    agree_on_heat(s.control.ranks, s.control)
    heat.hottest += step_size(s) * heat.rise
    heat.coldest += step_size(s) * heat.fall


def _of_heat(s):
    return arrays.with_items(s, nodes=s.heat.nodes, buffers=s.heat.buffers)


def at_its_nodes(s):
    return _of_heat(s)._replace(kin=Line())


def _take_factor(control):
    # `Warming` reports how much faster conduction has become
    heat = control.heat[0]
    heat.heat_limit = heat.heat_reference / control.motion[0].new_rate


class AtHeatNodes(AtNodes):
    __slots__ = ()


class AtHeatedPoints(AtPoints):
    __slots__ = ()


@take.on(AtHeatNodes, Processor)
def _at_heat_nodes(row, s, step):
    at_heat_nodes(step.hooks, row.stage, row.target, s)


@take.on(AtHeatedPoints, Processor)
def _at_heated_points(row, s, step):
    at_heated_points(step.hooks, s)


# Heat is gathered and scattered in one loop.
MAP = Visit((of_heat.Warming(),), (of_heat.HeatContent(),), OldWeights())
FLOW = Visit((of_heat.TemperatureGradient(),), (of_heat.HeatFlow(),), OldWeights())

# Capacity, heat and temperature at nodes.
SHOW = (
    Sweep(MAP, gathers=False, moves=False, at=_of_heat, reported=None),
    NodeTask(SumsToVelocity(), at_its_nodes, step_size),
)
# The heat flow with present gradients, after the rows of `SHOW`.
FLOW_TO_NODES = (
    *SHOW,
    NodeTask(TakeMean(), at_its_nodes, step_size),
    AtHeatNodes(arrays.POST_HEAT_TO_GRID, arrays.ON_VELOCITY, at_its_nodes),
    AtHeatedPoints(arrays.SUPPLY_HEAT, 0),
    Sweep(FLOW, moves=False, at=_of_heat, reported=None),
)
# Fixes prescribe the new nodal temperature.
HOLD = AtHeatNodes(arrays.POST_UPDATE_GRID_HEAT, arrays.ON_UPDATE, at_its_nodes)
WARM = Sweep(MAP, scatters=False, moves=False, at=_of_heat, reported=_take_factor)


class Conducting(NamedTuple):
    """Heat flows through `nodes`, with the fields of velocity and F-bar.

    sums: capacity, heat, heat flow; update: T*, T* - T; velocity: T; mean: T weighted by
    conductance.
    """

    nodes: Nodes
    buffers: Buffers

    point_fields = of_heat.FIELDS
    rows = (*FLOW_TO_NODES, NodeTask(NodalUpdate(), at_its_nodes, step_size), HOLD, WARM)
