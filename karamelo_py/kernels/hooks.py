"""Compiled hooks of fixes: a scalar function of one component at one node or point.

A fix that is "a formula acting on a group" (all built-in ones are) gives a tiny function; the loops
here choose the members, evaluate the formula over them block by block and apply the function. The
functions are called by address, so a new list of fixes compiles nothing but the functions it adds.

Node function ``(mass, v, v_star, force, value, before, dt, share) -> (v, v_star, force, total)``
    `value` and `before` are the formula at the time of the step and one step earlier, `share` is
    one over the number of members with mass; the totals are summed and published, with what
    a change of v before the update adds to the momentum of points over dt. Of the hooks that hold
    a node, the last to bring v_star to its value decides: it gets what the others had of that node.
    `dt` is the time that forces act for in the step, half of the last step and half of this one.
    Of the velocity that deforms, mapped apart from v_star, v is set; before the forces (usf, usavg)
    that is done with the hooks of the update, where those that hold make it their v_star.
Point function ``(mass, v, x_old, x, value, before, dt, kick) -> (v, x, total)``
    `dt` is the time that the point moves for, `kick` the time that forces act for.
Heat function ``(capacity, T, face, supply, value, other, dt) -> (share, supply, T)``
    acts on points where heat flows: `value` and `other` are the first and the second formula,
    `face` is the area that the point shows, `supply` the heat it gets per time, `share` how much it
    takes of the change of the nodes' temperature. The total is of what it supplies. Of a hook that
    holds, `other` is the temperature that points are brought to.
The node functions of heat see capacity, temperature before and after the step, and heat flow.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from karamelo_py.kernels import arrays

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
STAGES = NODE_STAGES | POINT_STAGES | HEAT_STAGES


class CompiledHook(NamedTuple):
    """A scalar function that the compiled loop applies to each component of each member."""

    function: Callable
    where: str  # nodes (of heat, too), points, or heated points
    publishes: bool  # its totals become ID_x, ID_y, ID_z
    uses_before: bool  # needs the formulas one step earlier as well
    uses_share: bool  # needs one over the number of members with mass
    holds: bool  # sets v_star, or bounds it: one of several decides; leads a temperature

    @property
    def on_nodes(self) -> bool:
        """True where it acts on nodes."""
        return self.where == "nodes"

    @property
    def signature(self) -> Any:
        """The Numba type of its function."""
        return FUNCTIONS[self.where]


# What a compiled hook acts on at each moment.
ACTS_ON = {
    **dict.fromkeys([*NODE_STAGES, "post_heat_to_grid", "post_update_grid_heat"], "nodes"),
    **dict.fromkeys(POINT_STAGES, "points"),
    "supply_heat": "heated points",
}


def node_hook(
    function: Callable,
    *,
    publishes: bool = True,
    uses_before: bool = False,
    shares: bool = False,
    holds: bool = False,
) -> CompiledHook:
    """Make a compiled hook on nodes, of a function as described at the head of this file."""
    return CompiledHook(function, "nodes", publishes, uses_before, shares, holds)


def point_hook(
    function: Callable, *, publishes: bool = True, uses_before: bool = False
) -> CompiledHook:
    """Make a compiled hook on points, of a function as described at the head of this file."""
    return CompiledHook(function, "points", publishes, uses_before, False, False)


def heat_hook(function: Callable, *, publishes: bool = True, holds: bool = False) -> CompiledHook:
    """Make a compiled hook for ``supply_heat``, of a function as described there."""
    return CompiledHook(function, "heated points", publishes, False, False, holds)
