"""Views of nodes and points for hooks that are written in Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from karamelo_py.kernels.arrays import (
    DT,
    POST_PARTICLES_TO_GRID,
    POST_UPDATE_GRID_HEAT,
    POST_UPDATE_GRID_STATE,
    POST_VELOCITIES_TO_GRID,
    SUPPLY,
    TEMPERATURE,
    TIME,
)
from karamelo_py.kernels.step import corners_that_move
from karamelo_py.script.errors import nearest


class _View:
    """A view whose fields are the only attributes, and take only what fits."""

    _fields: tuple[str, ...] = ()

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self._fields and not name.startswith("_"):
            if not isinstance(getattr(type(self), name, None), property):
                raise self._unknown(name)
            now, value = getattr(self, name).shape, np.asarray(value)
            if value.ndim and value.shape != now:
                raise ValueError(f"{name} has the shape {now}, not {value.shape}")
        object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        raise self._unknown(name)

    def _unknown(self, name: str) -> AttributeError:
        names = [*self._fields, *(n for n in dir(type(self)) if not n.startswith("_"))]
        close = nearest(name, names)
        return AttributeError(
            f"{type(self).__name__} has no {name}; "
            + (f"did you mean {close}?" if close else f"it has {', '.join(sorted(names))}")
        )


class NodesView(_View):
    """The nodes of a group that carry mass, at one stage of a step.

    Reading a field gives an array with a row for each node; assigning it writes it back::

        nodes.force += nodes.mass[:, None] * self.gravity

    Attributes
    ----------
    index : (n,) int
        Node numbers.
    """

    _fields = ("dt", "time", "index")

    def __init__(self, s: Any, group: Any, stage: int, before_update: bool):
        self._nodes = s.nodes
        self._grids = s.grids
        self._stage = stage
        self._before_update = before_update
        self._d = s.nodes.velocity.shape[1]
        self.dt = float(s.control.values[DT])
        self.time = float(s.control.values[TIME])
        if group.all:
            spans = s.spans[1 : 1 + s.spans[0, 0]]
            members = np.concatenate([np.arange(a, b) for a, b in spans] or [np.empty(0, int)])
        else:
            members = group.nodes
        self.index = members[s.nodes.sums[members, 0] > 0]

    @property
    def position(self) -> np.ndarray:
        """(n, 3) positions of the nodes."""
        grids = self._grids
        g = np.searchsorted(grids.first, self.index, side="right") - 1
        local = self.index - grids.first[g]
        step_x, step_y = grids.step_x[g], grids.step_y[g]
        places = np.stack([local // step_x, local % step_x // step_y, local % step_y], axis=1)
        corners = np.stack([grids.x0[g], grids.y0[g], grids.z0[g]], axis=1)
        return corners + places * grids.spacing[g][:, None]

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
        elif self._stage in (POST_UPDATE_GRID_STATE, POST_UPDATE_GRID_HEAT):
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


class PointsView(_View):
    """The points of a group, at one stage of a step, in the order of their ids.

    Reading a field gives an array with a row for each point; assigning it writes it back.
    """

    _fields = ("dt", "time", "ids", "moved")

    def __init__(self, simulation: Any, group: Any, then: bool):
        self._simulation = simulation
        self._then = then
        control = simulation.setup.control
        self.dt = float(control.values[DT])
        self.time = float(control.values[TIME])
        self.ids = simulation.members(group)
        self.moved = False

    def _gather(self, field: Callable) -> np.ndarray:
        return self._simulation.by_id(field)[self.ids]

    def _scatter(self, field: Callable, value: np.ndarray) -> None:
        full = self._simulation.by_id(field)
        full[self.ids] = value
        for block in self._simulation.setup.blocks:
            field(block)[...] = full[block.id]

    def _places(self, block: Any) -> np.ndarray:
        now = self._simulation.now
        return block.x[1 - now if self._then else now]

    def _place(self, block: Any) -> np.ndarray:
        return self._places(block)[:, : self._simulation.setup.kin.dimension]

    @property
    def position(self) -> np.ndarray:
        """(n, d) positions; the corners of convected domains go with the points."""
        return self._gather(self._place)

    @position.setter
    def position(self, value: np.ndarray) -> None:
        s = self._simulation.setup
        before = self._simulation.by_id(self._place)
        self._scatter(self._place, value)
        step = self._simulation.by_id(self._place) - before
        d, corners = s.kin.dimension, corners_that_move(s)
        for block in s.blocks:
            if corners:
                behind = self._places(block)[:, d : d + d * corners]
                behind += np.tile(step[block.id], corners)
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

    @property
    def force(self) -> np.ndarray:
        """(n, d) forces that fixes put on the points; add to it in ``initial_integrate``.

        Only for fixes with ``puts_force_on_points = True``. It is zero before the first of them.
        """
        return self._gather(self._force)

    @force.setter
    def force(self, value: np.ndarray) -> None:
        self._scatter(self._force, value)

    @staticmethod
    def _force(block: Any) -> np.ndarray:
        if block.points.force is None:
            raise ValueError("points have no force: the fix needs puts_force_on_points = True")
        return block.points.force

    @property
    def temperature(self) -> np.ndarray:
        """(n,) temperatures, where heat flows; read only."""
        return self._gather(lambda block: self._heat(block)[:, TEMPERATURE])

    @property
    def heat_supply(self) -> np.ndarray:
        """(n,) heat per time that fixes bring; add to it in ``supply_heat``."""
        return self._gather(lambda block: self._heat(block)[:, SUPPLY])

    @heat_supply.setter
    def heat_supply(self, value: np.ndarray) -> None:
        self._scatter(lambda block: self._heat(block)[:, SUPPLY], value)

    @staticmethod
    def _heat(block: Any) -> np.ndarray:
        if block.points.heat is None:
            raise ValueError("no heat flows: the method has to be thermo-mechanical")
        return block.points.heat

    def set_stress(self, given: dict[str, np.ndarray]) -> None:
        """Set components of the Cauchy stress: ``{"11": (n,) values, ...}`` of rate-form laws."""
        self._simulation.set_stress(self.ids, given)

    @property
    def reference_position(self) -> np.ndarray:
        """(n, d) positions before the first step; read only."""
        return self._simulation.x0[self.ids]
