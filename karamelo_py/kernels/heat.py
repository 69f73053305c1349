"""Heat flow between points through the nodes.

A temperature is to a heat capacity what a velocity is to a mass: the nodes of heat are `Nodes` with
one component, and the loops over nodes and the fixes of velocities work on them, too. Their common
steps are in this module.

Sources: Sulsky, Zhou & Schreyer 1995 for FLIP; Wallstedt & Guilkey 2007 for points with gradients;
Tao et al. 2016, "A generalized interpolation material point method for coupled thermo-mechanical
processes", for heat.
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.compile import (
    accumulate,
    fma,
    of_present,
    point_function,
    real,
    round_off,
    where,
)
from karamelo_py.compiler.fields import Field, StepField, field, load, load_vector, store, vector
from karamelo_py.kernels import arrays, hook_loop
from karamelo_py.kernels.arrays import MASS, Buffers, Nodes, of_force
from karamelo_py.kernels.clock import step_size
from karamelo_py.kernels.g2p import empty, gathered, updated
from karamelo_py.kernels.nodes import NodalUpdate, SumsToVelocity, TakeMean
from karamelo_py.kernels.p2g import load_of, scattered
from karamelo_py.kernels.sweep import OldWeights, Visit
from karamelo_py.kernels.table import ByFixes, NodeTask, Sweep
from karamelo_py.kernels.totals import agree_on_heat
from karamelo_py.kernels.visit import NodalMean, deformed_state, law_and_state, node_of
from karamelo_py.points import laws
from karamelo_py.points.basis import reach
from karamelo_py.points.frames import inverse_stretch_squared, pulled_back
from karamelo_py.points.kinematics import Line


class Temperature(StepField):
    """Temperature of a point before the step."""


class Capacity(StepField):
    """Heat capacity of a point."""


class Conductance(StepField):
    """Conductivity times volume of a point."""


class Volume(StepField):
    """Volume of a point."""


class Supply(StepField):
    """Heat per time that fixes supply to a point."""

    columns = ("gamma",)


class TemperatureShare(StepField):
    """Fraction of the change of the nodal temperature that a point takes."""


class HeatGradient(Field):
    """Gradient of temperature at a point."""

    shape = vector


class HeatContent(NamedTuple):
    """Scatter heat capacity and heat, with the points' gradients up to the nodes."""

    in_lanes = True
    says = "heat to grid"
    reads = ("x", "mass", "state", "material", "heat gradient")

    fills = staticmethod(lambda kin: (("sums", 0, of_force(Line())), (NodalMean, 0, 2)))


class TemperatureGradient(NamedTuple):
    """Gather the gradient of the nodal temperature."""

    in_lanes = True
    says = "gradient of temperature"
    reads = ("x",)
    writes = ("heat gradient",)


class HeatFlow(NamedTuple):
    """Scatter the heat flow and the supply of fixes."""

    in_lanes = True
    says = "heat flow"
    reads = ("state", "material", "deformation gradient", "heat gradient", "conductance")

    fills = staticmethod(lambda kin: (("sums", of_force(Line()), of_force(Line()) + 1),))


class Warming(NamedTuple):
    """Gather the change of the nodal temperature; update the temperature of the point."""

    in_lanes = True
    says = "temperature"
    reads = (
        "x",
        "state",
        "material",
        "temperature",
        "capacity",
        "conductance",
        "temperature share",
    )
    writes = ("state",)


def at_least_round_off(weight):
    """Return `weight`, or a tiny number if it is 0.

    A point on a node has no weight at the next node, but a gradient: that node needs the
    temperature that the point has there, and the flow to it has to return.
    """
    return max(weight, round_off(weight))


@load_of.on(HeatContent)
def _load_of_heat_content(quantity, w, p, like):
    law, state = law_and_state(w, p)
    mass = w.points.mass[p]
    volume = mass * laws.specific_volume(law) * laws.jacobian(law, w.kin, state)
    T = laws.temperature(law, w.kin, state)
    capacity = mass * laws.heat_capacity(law, like)
    conductance = volume * laws.conductivity(law, like)
    fields = w.points.fields
    field(fields, Temperature)[0, p] = T
    field(fields, Capacity)[0, p] = capacity
    field(fields, Conductance)[0, p] = conductance
    field(fields, Volume)[0, p] = volume
    # Fixes may supply heat, and reset the fraction of the change that the point takes.
    field(fields, Supply)[0, p] = real(0, like)
    field(fields, TemperatureShare)[0, p] = real(1, like)
    return of_present(p, capacity), of_present(p, conductance), T, _gradient(w, p)


def _gradient(w, p):
    like = load_vector(w.kin, w.points.v, p)
    return load(field(w.points.fields, HeatGradient), p, like)


@scattered.on(HeatContent)
def _scattered_heat_content(quantity, w, stencil, k, load):
    i, weight, _ = node_of(w, stencil, k)
    capacity, conductance, T, gradient = load
    weight = at_least_round_off(weight)
    arm = reach(w.basis, w.kin, w.grid, stencil, k)
    for axis in range(len(gradient)):
        T = fma(gradient[axis], arm[axis], T)
    part = weight * capacity
    accumulate(w.nodes.sums, i, MASS, (part, part * T))
    part = weight * conductance
    accumulate(field(w.nodes.fields, NodalMean), i, 0, (part * T, part))


@load_of.on(HeatFlow)
def _load_of_heat_flow(quantity, w, p, like):
    _, _, f = deformed_state(w, p)
    against = pulled_back(w.frame, w.kin, _gradient(w, p), f)
    fields = w.points.fields
    conductance = of_present(p, field(fields, Conductance)[0, p])
    return -conductance * against, of_present(p, field(fields, Supply)[0, p])


@scattered.on(HeatFlow)
def _scattered_heat_flow(quantity, w, stencil, k, load):
    i, weight, gradient = node_of(w, stencil, k)
    flow, supply = load
    total = at_least_round_off(weight) * supply
    for axis in range(len(flow)):
        total = fma(flow[axis], gradient[axis], total)
    accumulate(w.nodes.sums, i, of_force(Line()), (total,))


@empty.on(TemperatureGradient)
def _empty_temperature_gradient(task, w, x):
    return x - x


@gathered.on(TemperatureGradient)
def _gathered_temperature_gradient(task, w, stencil, k, total):
    i, _, gradient = node_of(w, stencil, k)
    # An axisymmetric gradient also has the hoop part after it; a scalar has none.
    return total + w.nodes.velocity[i, 0] * gradient.planar()


@updated.on(TemperatureGradient)
def _updated_temperature_gradient(task, w, stencil, p, dt, total, totals, fastest):
    store(field(w.points.fields, HeatGradient), p, total)
    return real(0, dt), fastest


@empty.on(Warming)
def _empty_warming(task, w, x):
    zero = x[0] - x[0]
    return zero, zero


@gathered.on(Warming)
def _gathered_warming(task, w, stencil, k, total):
    i, weight, _ = node_of(w, stencil, k)
    weight = at_least_round_off(weight)
    change, mean = total
    mean = fma(weight, field(w.nodes.fields, NodalMean)[i, 0], mean)
    return fma(weight, w.nodes.update[i, 1], change), mean


@updated.on(Warming)
def _updated_warming(task, w, stencil, p, dt, total, totals, fastest):
    law, state, f = deformed_state(w, p)
    fields = w.points.fields
    T = field(fields, Temperature)[0, p]
    capacity = field(fields, Capacity)[0, p]
    some = capacity > 0
    rate = field(fields, Conductance)[0, p] / where(some, capacity, real(1, capacity))
    hidden = real(4 * w.kin.dimension, dt) * (rate * w.grid.inv_h * w.grid.inv_h) * dt
    change = total[0] + min(hidden, real(1, hidden)) * (total[1] - T)
    T = where(some, fma(field(fields, TemperatureShare)[0, p], change, T), T)
    store(w.points.state, p, laws.with_temperature(law, w.kin, state, T))
    # Factor by which conduction has become faster than in the undeformed body.
    faster = laws.jacobian(law, w.kin, state) * inverse_stretch_squared(w.frame, w.kin, f, dt)
    return real(0, dt) * T, max(fastest, faster)


@point_function(otherwise=True)
def at_heat_nodes(hooks, stage, target, s):
    """Let the fixes act on the nodes of heat."""


@at_heat_nodes.on(arrays.Hooks)
def _at_heat_nodes_hooks(hooks, stage, target, s):
    # For temperatures always FLIP, whatever the transfer of velocity.
    clock = s.control.clock[0]
    clock.set_low, clock.set_high = np.inf, -np.inf
    hook_loop.node_hooks(
        stage, target, Line(), s.grids, s.heat.nodes, s.ranges, hooks, s.control, step_size(s), 1.0
    )
    agree_on_heat(s.control.ranks, s.control)
    clock.coldest = min(clock.coldest, clock.set_low)
    clock.hottest = max(clock.hottest, clock.set_high)


def heated(s, block, then):
    """Return the argument of fixes that heat points."""
    points, kinds = block.points, (Capacity, Temperature, Volume, Supply, TemperatureShare)
    own = [field(points.fields, kind) for kind in kinds]
    return hook_loop.HeatedPoints(points.id, s.kin, *own, points.x[s.control.clock[0].now])


def heat_of(points):
    """Return supply and capacity of points."""
    return tuple([field(points.fields, kind) for kind in (Supply, Capacity)])


@point_function(otherwise=True)
def at_heated_points(hooks, s):
    """Let the fixes supply heat to points, or set their temperature."""


@at_heated_points.on(arrays.Hooks)
def _at_heated_points_hooks(hooks, s):
    clock = s.control.clock[0]
    clock.rise = clock.fall = 0.0
    hook_loop.point_hooks(arrays.SUPPLY_HEAT, 0, hooks, s, heated, heat_of)
    agree_on_heat(s.control.ranks, s.control)
    clock.hottest += step_size(s) * clock.rise
    clock.coldest += step_size(s) * clock.fall


def _of_heat(s):
    """Return the setup with the nodes of heat."""
    return arrays.with_items_of(s, s.heat)


def at_its_nodes(s):
    """Return the setup for tasks at nodes, which have one component."""
    return _of_heat(s)._replace(kin=Line())


def _take_factor(clock):
    # `Warming` reports as a rate the factor by which conduction has become faster.
    clock.heat_limit = clock.heat_reference / clock.new_rate


MAP = Visit((Warming(),), (HeatContent(),), OldWeights())  # one loop for both ways
FLOW = Visit((TemperatureGradient(),), (HeatFlow(),), OldWeights())

# Capacity, heat and temperature to the nodes.
SHOW = (
    Sweep(MAP, gathers=False, moves=False, at=_of_heat, reported=None),
    NodeTask(SumsToVelocity(), at_its_nodes, step_size),
)
# And the heat flow from present gradients.
FLOW_TO_NODES = (
    *SHOW,
    NodeTask(TakeMean(), at_its_nodes, step_size),
    ByFixes(at_heat_nodes, (arrays.POST_HEAT_TO_GRID, arrays.ON_VELOCITY)),
    ByFixes(at_heated_points),
    Sweep(FLOW, moves=False, at=_of_heat, reported=None),
)
# The fixes hold the new temperature of nodes.
HOLD = ByFixes(at_heat_nodes, (arrays.POST_UPDATE_GRID_HEAT, arrays.ON_UPDATE))
# Points take the change of the nodal temperature.
WARM = Sweep(MAP, scatters=False, moves=False, at=_of_heat, reported=_take_factor)


class Conducting(NamedTuple):
    """Heat flows through `nodes`, with the fields of velocities and of F-bar.

    sums: capacity, heat, heat flow; update: T* and T* - T; velocity: T; mean: T weighted with
    conductance.
    """

    nodes: Nodes
    buffers: Buffers

    point_fields = (
        Temperature,
        Capacity,
        Conductance,
        Volume,
        Supply,
        TemperatureShare,
        HeatGradient,
    )
    rows = (*FLOW_TO_NODES, NodeTask(NodalUpdate(), at_its_nodes, step_size), HOLD, WARM)
