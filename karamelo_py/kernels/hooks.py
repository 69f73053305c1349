"""Compiled hooks of fixes: functions of one component at a node or point, or of whole points.

A fix applies a formula to a group by a small function. The loops select members, evaluate the
formula for blocks of members and call the function by address, so only new functions are compiled.

Node function ``(node: OneNode) -> (v, v_star, force, total)``: `value` and `before` are the formula
at the step's time and one step earlier; `share` is 1 / number of members with mass; `kick` is half
of the last step plus half of this one. Totals are published; they include, per kick, the momentum
that points gain if v is changed before the update. Where several hooks hold a node, the last one
that sets v_star to its value applies and gets the totals of the other hooks. If the velocity that
strains points is mapped separately, hooks also set v of it; before the forces (usf, usavg), hooks
that hold set it to v_star.

Point function ``(pt: OnePoint) -> (v, x, total)``: `dt` is the time for which the point moves,
`kick` the time for which forces act.

Heat function ``(pt: WarmPoint) -> (share, supply, T)``: `value` and `other` are the first and
second formula, `face` the point's area, `supply` its heating power, `share` is the fraction of the
nodal temperature change that it takes. The total is the heat supplied; if the hook holds, `other`
is the target temperature. Node functions of heat get capacity, temperature before and after the
step, and heat flow, in the order of `OneNode`.

Functions of whole points (:func:`vector_hook`) get vectors, fields and the state of the law, and
are compiled into the loop.
"""

import sys
from collections import namedtuple
from collections.abc import Callable
from functools import update_wrapper
from typing import Any, NamedTuple

from numba import types

from karamelo_py.compiler import point_function
from karamelo_py.compiler.fields import field, load_vector, store, unknowns, vector
from karamelo_py.compiler.tuples import flat
from karamelo_py.kernels import arrays
from karamelo_py.kernels.arrays import Index, Tag
from karamelo_py.kernels.records import put_at
from karamelo_py.kernels.views import volume_of
from karamelo_py.points.bodies import face


class OneNode(NamedTuple):
    """Arguments of node functions, for one component."""

    mass: float
    v: float
    v_star: float
    force: float
    value: float
    before: float
    kick: float
    share: float


class OnePoint(NamedTuple):
    """Arguments of point functions, for one component."""

    mass: float
    v: float
    x_old: float
    x: float
    value: float
    before: float
    dt: float
    kick: float


class WarmPoint(NamedTuple):
    capacity: float
    T: float
    face: float
    supply: float
    value: float
    other: float
    dt: float


_F8 = types.float64
NODE_FUNCTION = types.UniTuple(_F8, 4)(*[_F8] * 8)
POINT_FUNCTION = types.UniTuple(_F8, 3)(*[_F8] * 8)
HEAT_FUNCTION = types.UniTuple(_F8, 3)(*[_F8] * 7)

FUNCTIONS = {"nodes": NODE_FUNCTION, "points": POINT_FUNCTION, "heated points": HEAT_FUNCTION}


NODE_STAGES = {
    "post_particles_to_grid": arrays.POST_PARTICLES_TO_GRID,
    "post_update_grid_state": arrays.POST_UPDATE_GRID_STATE,
    "post_velocities_to_grid": arrays.POST_VELOCITIES_TO_GRID,
}
POINT_STAGES = {
    "initial_integrate": arrays.INITIAL_INTEGRATE,
    "post_grid_to_point": arrays.POST_GRID_TO_POINT,
    "post_advance_particles": arrays.POST_ADVANCE_PARTICLES,
    "final_integrate": arrays.FINAL_INTEGRATE,
}
HEAT_STAGES = {
    "post_heat_to_grid": arrays.POST_HEAT_TO_GRID,
    "supply_heat": arrays.SUPPLY_HEAT,
    "post_update_grid_heat": arrays.POST_UPDATE_GRID_HEAT,
}
ROTATION_STAGES = {
    "post_update_grid_rotation": arrays.POST_UPDATE_GRID_ROTATION,
    "post_rotation_to_grid": arrays.POST_ROTATION_TO_GRID,
}
STAGES = NODE_STAGES | POINT_STAGES | HEAT_STAGES | ROTATION_STAGES


class CompiledHook(NamedTuple):
    """A function that the compiled loop applies to its members."""

    function: Callable
    where: str  # "nodes" (also of heat), "points", "heated points", `WHOLE_POINTS`, `WHOLE_NODES`
    publishes: bool  # publishes totals as ID_x, ID_y, ID_z
    uses_before: bool  # uses the formulas one step earlier
    uses_share: bool  # uses 1 / number of members with mass
    holds: bool  # sets or bounds v_star, or prescribes a temperature
    tag: Callable | None = None  # makes the tag of a whole-point function
    reads: tuple = ()
    writes: tuple = ()
    internal: bool = False  # True: neither for plug-ins nor on GPUs

    @property
    def on_nodes(self) -> bool:
        return self.where in ("nodes", WHOLE_NODES)

    @property
    def signature(self) -> Any:
        return FUNCTIONS[self.where]


WHOLE_POINTS, WHOLE_NODES = "whole points", "whole nodes"
# Hooks on whole points may act at any stage of points.
ACTS_ON = {
    **dict.fromkeys([*NODE_STAGES, "post_heat_to_grid", "post_update_grid_heat"], "nodes"),
    **dict.fromkeys(ROTATION_STAGES, "nodes"),
    **dict.fromkeys(POINT_STAGES, "points"),
    "supply_heat": "heated points",
}


def of_numbers(view: type, function: Callable) -> Callable:
    """Convert a function of a `view` to a function of plain numbers, callable by address."""
    if not hasattr(function, "__name__"):  # an error is raised with the fix
        return function

    def of_its_numbers(*numbers):
        return function(view(*numbers))

    return update_wrapper(of_its_numbers, function)


def node_hook(
    function: Callable,
    *,
    publishes: bool = True,
    uses_before: bool = False,
    shares: bool = False,
    holds: bool = False,
) -> CompiledHook:
    """Make a hook from a node function (see the module)."""
    seen = of_numbers(OneNode, function)
    return CompiledHook(seen, "nodes", publishes, uses_before, shares, holds)


def point_hook(
    function: Callable, *, publishes: bool = True, uses_before: bool = False
) -> CompiledHook:
    """Make a hook from a point function (see the module)."""
    seen = of_numbers(OnePoint, function)
    return CompiledHook(seen, "points", publishes, uses_before, False, False)


def heat_hook(function: Callable, *, publishes: bool = True, holds: bool = False) -> CompiledHook:
    """Make a hook for ``supply_heat`` from a heat function (see the module)."""
    seen = of_numbers(WarmPoint, function)
    return CompiledHook(seen, "heated points", publishes, False, False, holds)


class Member(NamedTuple):
    p: Index
    law: Tag
    state: tuple
    values: tuple  # values of the formulas
    dt: float


@point_function()
def results(tag, members, one):
    """Return the results of a function of whole members, a tuple."""


@point_function()
def written(tag, members, p, values):
    """Write the results; return the values to publish."""


WORDS = {
    "mass": lambda members, law, state, p: members.points.mass[p],
    "velocity": lambda members, law, state, p: load_vector(members.kin, members.points.v, p),
    "position": lambda members, law, state, p: load_vector(members.kin, members.x, p),
    "volume": lambda members, law, state, p: volume_of(members.kin, members.points, law, state, p),
    "face": lambda members, law, state, p: face(
        members.kin,
        volume_of(members.kin, members.points, law, state, p),
        load_vector(members.kin, members.x, p),
    ),
}


def _node_velocity(members, law, state, n):
    nodes, kin = members.nodes, members.kin
    if members.before_update:
        first, mass = arrays.of_momentum(kin), nodes.sums[n, arrays.MASS]
        return kin.Vector._make([nodes.sums[n, first + c] / mass for c in range(kin.dimension)])
    change = arrays.of_change(kin)
    numbers = [nodes.update[n, c] - nodes.update[n, change + c] for c in range(kin.dimension)]
    return kin.Vector._make(numbers)


def _at_node(members, array, n, first):
    return members.kin.Vector._make([array[n, first + c] for c in range(members.kin.dimension)])


NODE_WORDS = {
    "mass": lambda members, law, state, n: members.nodes.sums[n, arrays.MASS],
    "velocity": _node_velocity,
    "velocity_update": lambda members, law, state, n: _at_node(members, members.nodes.update, n, 0),
    "force": lambda members, law, state, n: _at_node(
        members, members.nodes.sums, n, arrays.of_force(members.kin)
    ),
}
# Nodal arrays that hooks on whole nodes can change, in addition to fields, by stage.
NODE_WRITES = {"post_particles_to_grid": "force", "post_update_grid_state": "velocity_update"}


def _field_reader(item: Any, number: Callable) -> Callable:
    shape = item.shape
    as_vector, as_unknown = shape is vector, shape is unknowns

    def of_field(members, law, state, n):
        numbers = tuple([number(members, k, n) for k in range(shape(members.kin))])
        if as_vector:
            return members.kin.Vector._make(numbers)
        if as_unknown:
            return members.kin.Unknown._make(numbers)
        return numbers[0] if len(numbers) == 1 else numbers

    return of_field


def _node_reader(item: Any) -> Callable:
    if not isinstance(item, type):
        return NODE_WORDS.get(item, NODE_WORDS["mass"])
    return _field_reader(item, lambda members, k, n: field(members.nodes.fields, item)[n, k])


def _write_update(members, n, new):
    change = arrays.of_change(members.kin)
    for c in range(members.kin.dimension):
        members.nodes.update[n, change + c] += new[c] - members.nodes.update[n, c]
        members.nodes.update[n, c] = new[c]


def _node_writer(item: Any) -> Callable:
    if isinstance(item, type):
        return lambda members, n, new: put_at(field(members.nodes.fields, item), n, 0, flat((new,)))
    if item == "force":
        return lambda members, n, new: put_at(
            members.nodes.sums, n, arrays.of_force(members.kin), new
        )
    return _write_update


def _reader(item: Any) -> Callable:
    if isinstance(item, type):
        return _field_reader(item, lambda members, k, p: field(members.points.fields, item)[k, p])
    return WORDS.get(item) or (lambda members, law, state, p: item(law, members.kin, state))


def _writer(item: Any) -> Callable:
    if isinstance(item, type):
        return lambda members, p, new: store(field(members.points.fields, item), p, (new,))
    return lambda members, p, new: store(members.points.v, p, (new,))


def vector_hook(
    function: Callable,
    *,
    reads: tuple,
    writes: tuple,
    publishes: bool = False,
    nodes: bool = False,
    shares: bool = False,
) -> CompiledHook:
    """Make a hook for vectors, declared fields and the state of the law of points.

    With `nodes`, it is for vectors (`NODE_WORDS`) and declared fields of nodes. With `shares`, the
    values are followed by 1 / number of members with mass.

    Parameters
    ----------
    function
        ``function(*read, values, dt)`` gets the quantities in `reads`, the values of the fix's
        `formulas`, and the time of the move. The function returns the new values of `writes` and,
        with `publishes`, a number or vector to sum and publish; several results form a tuple.
    reads
        Words of `WORDS`, classes of declared fields (a number, vector or tuple of numbers), or
        functions (law, kin, state) such as ``laws.cauchy_stress``.
    writes
        ``"velocity"`` or classes of declared fields.
    """
    where = WHOLE_NODES if nodes else WHOLE_POINTS
    if not getattr(function, "__name__", "").isidentifier():  # an error is raised with the fix
        return CompiledHook(function, where, publishes, False, shares, False, None, reads, writes)
    # Cached kernels import it from the module of the function.
    name = f"{function.__name__}_at_{'nodes' if nodes else 'points'}"
    module = sys.modules[function.__module__]
    while hasattr(module, name):  # the function already has another hook
        name += "_"
    made = namedtuple(name, ("row", "values"), module=function.__module__)
    setattr(module, name, made)
    reader, writer = (_node_reader, _node_writer) if nodes else (_reader, _writer)
    readers, writers = tuple(map(reader, reads)), tuple(map(writer, writes))
    made.of_nodes, made.of_time, made.shares = nodes, False, shares  # type: ignore[attr-defined]
    alone = len(writes) + publishes == 1

    def results_of(tag, members, one):
        items = [read(members, one.law, one.state, one.p) for read in readers]
        values = function(*items, one.values, one.dt)
        return (values,) if alone else values

    def written_of(tag, members, p, values):
        for k, write in enumerate(writers):
            write(members, p, values[k])
        return flat(values[len(writers) :])

    results.on(made)(results_of)
    written.on(made)(written_of)
    return CompiledHook(function, where, publishes, False, shares, False, made, reads, writes)
