"""Fixes and computes: what acts on a run and what measures it (LAMMPS's and Karamelo's Modify).

A fix overrides the hooks it needs, by the names of Karamelo:

=============================  =================================================================
``initial_integrate``          before anything else in the step; gets :class:`PointsView`
``post_particles_to_grid``     mass, momentum and force are on the nodes; :class:`NodesView`
``post_update_grid_state``     v* is known; :class:`NodesView`
``post_grid_to_point``         the points have their new velocity and place; :class:`PointsView`
``post_advance_particles``     the same moment, after all ``post_grid_to_point``
``post_velocities_to_grid``    the velocity that will deform the points; :class:`NodesView`
``final_integrate``            the end of the step; :class:`PointsView`
=============================  =================================================================

A hook is either a method, called with a view of the group (Python comes back at that stage of each
step), or the result of :func:`node_hook` or :func:`point_hook`, which is compiled into the loop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from karamelo_py.group import ParticleGroup
from karamelo_py.state.arrays import (
    FINAL_INTEGRATE,
    INITIAL_INTEGRATE,
    POST_ADVANCE_PARTICLES,
    POST_GRID_TO_POINT,
    POST_PARTICLES_TO_GRID,
    POST_UPDATE_GRID_STATE,
    POST_VELOCITIES_TO_GRID,
)

if TYPE_CHECKING:
    from karamelo_py.hub import Hub

NODE_STAGES = {
    "post_particles_to_grid": POST_PARTICLES_TO_GRID,
    "post_update_grid_state": POST_UPDATE_GRID_STATE,
    "post_velocities_to_grid": POST_VELOCITIES_TO_GRID,
}
POINT_STAGES = {
    "initial_integrate": INITIAL_INTEGRATE,
    "post_grid_to_point": POST_GRID_TO_POINT,
    "post_advance_particles": POST_ADVANCE_PARTICLES,
    "final_integrate": FINAL_INTEGRATE,
}
STAGES = NODE_STAGES | POINT_STAGES


class CompiledHook(NamedTuple):
    """A scalar function that the compiled loop applies to each component of each member."""

    function: Callable
    on_nodes: bool
    publishes: bool  # its totals become ID_x, ID_y, ID_z
    uses_before: bool  # needs the formulas one step earlier as well
    uses_share: bool  # needs one over the number of members with mass


def node_hook(
    function: Callable, *, publishes: bool = True, uses_before: bool = False, shares: bool = False
) -> CompiledHook:
    """A compiled hook on nodes: `function` as described in :mod:`karamelo_py.kernels.hooks`."""
    return CompiledHook(function, True, publishes, uses_before, shares)


def point_hook(
    function: Callable, *, publishes: bool = False, uses_before: bool = False
) -> CompiledHook:
    """A compiled hook on points: `function` as described in :mod:`karamelo_py.kernels.hooks`."""
    return CompiledHook(function, False, publishes, uses_before, False)


class Fix:
    """Base of all fixes: acts on its `group` during a run.

    Attributes
    ----------
    group
        The node or particle group it acts on.
    formulas
        One formula (or None) for each component, for compiled hooks.
    first_step_only
        Whether it acts in the first step after its definition and is idle thereafter.
    id
        Its ID in the script; values published as ``ID_x``, ``ID_y``, ``ID_z``, ``ID_s`` and ``ID``.
    """

    group: Any = None
    formulas: tuple = ()
    first_step_only = False
    id: str = ""

    def __init__(self, hub: Hub):
        self.hub = hub

    def publish(self, name: str, value: float) -> None:
        """Publish `value` as ID_`name` (x, y, z or s), or as the plain ID when `name` is empty."""
        self.hub.values.set(f"{self.id}_{name}" if name else self.id, float(value))

    def publish_components(self, vector: np.ndarray) -> None:
        """Publish up to three components as ID_x, ID_y, ID_z."""
        for name, value in zip("xyz", vector, strict=False):
            self.publish(name, value)

    def refresh(self) -> None:
        """Bring published values up to date; called before the log or a dump is written."""

    def hooks(self) -> dict[str, Any]:
        """The hooks this fix overrides: name to method or :class:`CompiledHook`."""
        return {name: getattr(self, name) for name in STAGES if hasattr(self, name)}


class Compute:
    """Base of all computes: measures its `group` of points when the log is written."""

    id: str = ""

    def __init__(self, hub: Hub, group: ParticleGroup):
        self.hub = hub
        self.group = group

    publish = Fix.publish
    publish_components = Fix.publish_components

    def refresh(self) -> None:
        """Measure and publish; override this."""


class NodesView:
    """The nodes of a group that carry mass, at one stage of a step.

    Reading a field gives an array with a row for each node; assigning it writes it back::

        nodes.force += nodes.mass[:, None] * self.gravity

    Attributes
    ----------
    index : (n,) int
        Node numbers.
    """

    def __init__(self, s: Any, group: Any, stage: int, before_update: bool):
        self._nodes = s.nodes
        self._basis = s.basis
        self._shape = s.shape
        self._stage = stage
        self._before_update = before_update
        self._d = s.nodes.velocity.shape[1]
        self.dt = float(s.control.values[2])
        self.time = float(s.control.values[0])
        if group.all:
            spans = s.spans[1 : 1 + s.spans[0, 0]]
            members = np.concatenate([np.arange(a, b) for a, b in spans] or [np.empty(0, int)])
        else:
            members = group.nodes
        self.index = members[s.nodes.sums[members, 0] > 0]

    @property
    def position(self) -> np.ndarray:
        """(n, 3) positions of the nodes."""
        places = np.stack(np.unravel_index(self.index, self._shape), axis=1)
        used = np.arange(3) < self._d
        return np.where(
            used,
            np.array([self._basis.x0, self._basis.y0, self._basis.z0]) + places * self._basis.h,
            0.0,
        )

    @property
    def mass(self) -> np.ndarray:
        """(n,) nodal mass; read only."""
        return self._nodes.sums[self.index, 0]

    @property
    def force(self) -> np.ndarray:
        """(n, d) internal plus external force; set it in ``post_particles_to_grid``."""
        return self._nodes.sums[self.index, 1 + self._d :]

    @force.setter
    def force(self, value: np.ndarray) -> None:
        self._nodes.sums[self.index, 1 + self._d :] = value

    @property
    def velocity(self) -> np.ndarray:
        """(n, d) velocity: v before the momentum update, or the one that deforms the points."""
        if self._stage == POST_VELOCITIES_TO_GRID or self._before_update:
            return self._nodes.velocity[self.index]
        if self._stage == POST_PARTICLES_TO_GRID:
            return self._nodes.sums[self.index, 1 : 1 + self._d] / self.mass[:, None]
        update = self._nodes.update[self.index]
        return update[:, : self._d] - update[:, self._d :]

    @velocity.setter
    def velocity(self, value: np.ndarray) -> None:
        if self._stage == POST_VELOCITIES_TO_GRID or self._before_update:
            self._nodes.velocity[self.index] = value
        elif self._stage == POST_UPDATE_GRID_STATE:
            star = self._nodes.update[self.index, : self._d]
            self._nodes.update[self.index, self._d :] = star - value
        else:
            self._nodes.sums[self.index, 1 : 1 + self._d] = self.mass[:, None] * value

    @property
    def velocity_update(self) -> np.ndarray:
        """(n, d) v*, the velocity after the momentum update (``post_update_grid_state``)."""
        if self._before_update:
            return self.velocity
        return self._nodes.update[self.index, : self._d]

    @velocity_update.setter
    def velocity_update(self, value: np.ndarray) -> None:
        if self._before_update:
            self.velocity = value
            return
        old = self.velocity
        self._nodes.update[self.index, : self._d] = value
        self._nodes.update[self.index, self._d :] = self._nodes.update[self.index, : self._d] - old


class PointsView:
    """The points of a group, at one stage of a step, in the order of their ids.

    Reading a field gives an array with a row for each point; assigning it writes it back.
    """

    def __init__(self, simulation: Any, group: Any, then: bool):
        self._simulation = simulation
        self._then = then
        control = simulation.setup.control
        self.dt = float(control.values[2])
        self.time = float(control.values[0])
        self.ids = simulation.members(group)
        self.moved = False

    def _gather(self, field: Callable) -> np.ndarray:
        return self._simulation.by_id(field)[self.ids]

    def _scatter(self, field: Callable, value: np.ndarray) -> None:
        full = self._simulation.by_id(field)
        full[self.ids] = value
        for block in self._simulation.setup.blocks:
            field(block)[...] = full[block.id]

    def _place(self, block: Any) -> np.ndarray:
        now = self._simulation.now
        return block.x[1 - now if self._then else now]

    @property
    def position(self) -> np.ndarray:
        """(n, d) positions."""
        return self._gather(self._place)

    @position.setter
    def position(self, value: np.ndarray) -> None:
        self._scatter(self._place, value)
        self.moved = True

    @property
    def velocity(self) -> np.ndarray:
        """(n, d) velocities."""
        return self._gather(lambda block: block.points.v)

    @velocity.setter
    def velocity(self, value: np.ndarray) -> None:
        self._scatter(lambda block: block.points.v, value)

    @property
    def mass(self) -> np.ndarray:
        """(n,) masses; read only."""
        return self._gather(lambda block: block.points.mass)

    def set_stress(self, given: dict[str, np.ndarray]) -> None:
        """Set components of the Cauchy stress: ``{"11": (n,) values, ...}`` of rate-form laws."""
        self._simulation.set_stress(self.ids, given)

    @property
    def reference_position(self) -> np.ndarray:
        """(n, d) positions before the first step; read only."""
        return self._simulation.x0[self.ids]
