"""Heat that flows between points through the nodes.

A temperature is to a heat capacity what a velocity is to a mass: the nodes of heat are `Nodes` with
one component, and the loops over nodes and the fixes of velocities serve them, too. A step of
conduction comes before the momentum update, at the places of the points then:

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

Sources: Sulsky, Zhou & Schreyer 1995 for FLIP; Wallstedt & Guilkey 2007 for points that bring their
gradient along; Tao et al. 2016, "A generalized interpolation material point method for coupled
thermo-mechanical processes", for heat.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.compile import (
    fma,
    index,
    over_blocks,
    point_function,
    real,
    round_off,
    shared,
)
from karamelo_py.compiler.tuples import add_scaled, leading, put_at, record, row, scale, subtract
from karamelo_py.kernels.arrays import (
    CAPACITY,
    CONDUCTANCE,
    GRADIENT,
    HEAT_LIMIT,
    HEAT_REFERENCE,
    NEW_RATE,
    NOW,
    POST_HEAT_TO_GRID,
    POST_UPDATE_GRID_HEAT,
    SHARE,
    SUPPLY,
    SUPPLY_HEAT,
    TEMPERATURE,
    Hooks,
    Nodes,
    NoHooks,
)
from karamelo_py.kernels.hooks import ON_UPDATE, ON_VELOCITY, Warmth, node_hooks, point_hooks
from karamelo_py.kernels.stages import (
    AverageGrowth,
    ClearGrowth,
    ClearSums,
    Nothing,
    SumsToVelocity,
    Update,
    deformation_of,
    empty,
    gathered,
    load,
    restencil,
    scattered,
    settled,
)
from karamelo_py.kernels.step import clear_totals, conduct, read_reports, step_size, visit_here
from karamelo_py.kernels.sweep import sweep_nodes
from karamelo_py.points.basis import entry, reach
from karamelo_py.points.frames import drawn_back, thinning
from karamelo_py.points.heat import face
from karamelo_py.points.kinematics import Line, dimension, vector_at
from karamelo_py.points.laws import (
    conductivity,
    heat_capacity,
    initial_state,
    jacobian,
    specific_volume,
    temperature,
    with_temperature,
)


class Conducting(NamedTuple):
    """Heat flows through `nodes`, whose fields are those of velocities and of F-bar.

    sums: capacity, heat, heat flow; update: T* and T* - T; velocity: T; growth: T weighted with
    conductance, and conductance.
    """

    nodes: Nodes


class HeatContent(NamedTuple):
    """Scatter heat capacity and heat, as if the points' gradients reached to the nodes."""

    sums: np.ndarray  # (N, 3)
    levels: np.ndarray  # (N, 2)

    reads = ("x", "mass", "state", "material", "heat")
    writes = ("heat",)


class TemperatureGradient(NamedTuple):
    """Gather the gradient of the nodal temperature."""

    temperature: np.ndarray  # (N, 1)

    reads = ("x",)
    writes = ("heat",)


class HeatFlow(NamedTuple):
    """Scatter the heat flow and what fixes supply."""

    sums: np.ndarray  # (N, 3)

    reads = ("state", "material", "deformation", "heat")
    writes = ()


class Warming(NamedTuple):
    """Gather the change of the nodal temperature; settle the temperature of the point."""

    update: np.ndarray  # (N, 2)
    levels: np.ndarray  # (N, 2)

    reads = ("x", "state", "material", "heat")
    writes = ("state",)


@shared
def held(weight):
    """`weight`, and next to nothing where it is nothing.

    A point that stands on a node has no weight at the next, but a gradient: that node needs the
    temperature that the point has there, and what flows to it has to come back.
    """
    return max(weight, round_off(weight))


# --- from points to nodes ---------------------------------------------------------------------


@restencil.on(HeatContent)
@restencil.on(HeatFlow)
def _(scatter, w, stencil, p):
    return stencil


@load.on(HeatContent)
def _(scatter, w, p, like):
    law = record(w.laws, index(w.points.material[p]))
    state = row(w.points.state, p, 0, initial_state(law, w.kin, like))
    mass = w.points.mass[p]
    volume = mass * specific_volume(law) * jacobian(law, w.kin, state)
    T = temperature(law, w.kin, state)
    capacity = mass * heat_capacity(law, like)
    conductance = volume * conductivity(law, like)
    side = face(w.kin, volume, vector_at(w.kin, w.places.x, p))
    # Fixes may supply heat, and reset what share of the change the point takes.
    put_at(
        w.points.heat,
        p,
        0,
        (T, capacity, conductance, side, real(0, like), real(1, like)),
    )
    return capacity, conductance, T, _gradient(w, p)


@shared
def _gradient(w, p):
    return row(w.points.heat, p, GRADIENT, vector_at(w.kin, w.points.v, p))


@scattered.on(HeatContent)
def _(scatter, w, stencil, k, burden):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    capacity, conductance, T, gradient = burden
    weight = held(weight)
    arm = reach(w.basis, w.kin, w.grid, stencil, k)
    for axis in range(len(gradient)):
        T = fma(gradient[axis], arm[axis], T)
    part = weight * capacity
    scatter.sums[i, 0] += part
    scatter.sums[i, 1] = fma(part, T, scatter.sums[i, 1])
    part = weight * conductance
    scatter.levels[i, 0] = fma(part, T, scatter.levels[i, 0])
    scatter.levels[i, 1] += part


@load.on(HeatFlow)
def _(scatter, w, p, like):
    law = record(w.laws, index(w.points.material[p]))
    state = row(w.points.state, p, 0, initial_state(law, w.kin, like))
    f = deformation_of(w.frame, w.kin, law, state, w.points, p)
    against = drawn_back(w.frame, w.kin, _gradient(w, p), f)
    return scale(-w.points.heat[p, CONDUCTANCE], against), w.points.heat[p, SUPPLY]


@scattered.on(HeatFlow)
def _(scatter, w, stencil, k, burden):
    i, weight, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    flow, supply = burden
    total = fma(held(weight), supply, scatter.sums[i, 2])
    for axis in range(len(flow)):
        total = fma(flow[axis], gradient[axis], total)
    scatter.sums[i, 2] = total


# --- from nodes to points ---------------------------------------------------------------------


@empty.on(TemperatureGradient)
def _(gather, w, x):
    return subtract(x, x)


@gathered.on(TemperatureGradient)
def _(gather, w, stencil, k, total):
    i, _, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    # An axisymmetric gradient has the part around the axis behind; a scalar has none there.
    return add_scaled(total, gather.temperature[i, 0], leading(gradient, total))


@settled.on(TemperatureGradient)
def _(gather, w, stencil, p, dt, total, fastest):
    put_at(w.points.heat, p, GRADIENT, total)
    return real(0, dt), fastest


@empty.on(Warming)
def _(gather, w, x):
    zero = x[0] - x[0]
    return zero, zero


@gathered.on(Warming)
def _(gather, w, stencil, k, total):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    return add_scaled(total, held(weight), (gather.update[i, 1], gather.levels[i, 0]))


@settled.on(Warming)
def _(gather, w, stencil, p, dt, total, fastest):
    law = record(w.laws, index(w.points.material[p]))
    state = row(w.points.state, p, 0, initial_state(law, w.kin, dt))
    T = w.points.heat[p, TEMPERATURE]
    capacity = w.points.heat[p, CAPACITY]
    if capacity > 0:
        rate = w.points.heat[p, CONDUCTANCE] / capacity * w.grid.inv_h * w.grid.inv_h
        hidden = min(real(4 * dimension(w.kin), dt) * rate * dt, real(1, dt))
        change = total[0] + hidden * (total[1] - T)
        T = fma(w.points.heat[p, SHARE], change, T)
    put_at(w.points.state, p, 0, with_temperature(law, w.kin, state, T))
    # By what factor conduction has become faster than in the undeformed body.
    f = deformation_of(w.frame, w.kin, law, state, w.points, p)
    faster = jacobian(law, w.kin, state) * thinning(w.frame, w.kin, f, dt)
    return real(0, dt) * T, max(fastest, faster)


# --- a step of conduction ---------------------------------------------------------------------


@point_function()
def at_heat_nodes(hooks, stage, target, s):
    """Let the fixes act on the nodes of heat."""


@at_heat_nodes.on(NoHooks)
def _(hooks, stage, target, s):
    return None


@at_heat_nodes.on(Hooks)
def _(hooks, stage, target, s):
    # Temperatures are always kept: FLIP, whatever the transfer of velocity.
    node_hooks(
        stage, target, Line(), s.grids, s.heat.nodes, s.spans, hooks, s.control, step_size(s), 1.0
    )


def _supply(block, s, hooks):
    warmth = Warmth(block.points.heat, block.points.mass, block.x[s.control.whole[NOW]])
    point_hooks(SUPPLY_HEAT, warmth, s.kin, block.id, hooks, s.control, step_size(s))


_supply_blocks = over_blocks(_supply)


@point_function()
def at_heated_points(hooks, s):
    """Let the fixes supply heat to points, or set their temperature."""


@at_heated_points.on(NoHooks)
def _(hooks, s):
    return None


@at_heated_points.on(Hooks)
def _(hooks, s):
    clear_totals(SUPPLY_HEAT, hooks, s.control)
    _supply_blocks(s, hooks)


@shared
def map_heat(nodes, s, mode):
    """Heat capacity and heat of the nodes, from the points now."""
    dt = step_size(s)
    sweep_nodes(mode, ClearSums(), Line(), nodes, s.spans, dt)
    sweep_nodes(mode, ClearGrowth(), Line(), nodes, s.spans, dt)
    visit_here(s, mode, Nothing(), HeatContent(nodes.sums, nodes.growth), dt)


@point_function()
def show_heat(heat, s, mode):
    """See that the nodes show the temperature before the first step."""


@show_heat.otherwise
def _(heat, s, mode):
    return None


@show_heat.on(Conducting)
def _(heat, s, mode):
    map_heat(heat.nodes, s, mode)
    sweep_nodes(mode, SumsToVelocity(), Line(), heat.nodes, s.spans, step_size(s))


@conduct.on(Conducting)
def _(heat, s, mode, hooks):
    dt = step_size(s)
    nodes = heat.nodes
    kin = Line()
    map_heat(nodes, s, mode)
    sweep_nodes(mode, SumsToVelocity(), kin, nodes, s.spans, dt)
    sweep_nodes(mode, AverageGrowth(), kin, nodes, s.spans, dt)
    at_heat_nodes(hooks, POST_HEAT_TO_GRID, ON_VELOCITY, s)
    at_heated_points(hooks, s)
    visit_here(s, mode, TemperatureGradient(nodes.velocity), HeatFlow(nodes.sums), dt)
    sweep_nodes(mode, Update(), kin, nodes, s.spans, dt)
    at_heat_nodes(hooks, POST_UPDATE_GRID_HEAT, ON_UPDATE, s)
    visit_here(s, mode, Warming(nodes.update, nodes.growth), Nothing(), dt)
    # What `Warming` reports as a rate is by what factor conduction has become faster.
    read_reports(s)
    s.control.real[HEAT_LIMIT] = s.control.real[HEAT_REFERENCE] / s.control.real[NEW_RATE]
