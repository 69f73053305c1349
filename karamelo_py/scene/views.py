"""Views of nodes and points for hooks that are written in Python.

A view hands out arrays with a row for each node or point of the group. What a hook changes in them,
by assignment or in place, is written back when it returns; what cannot be changed is read-only.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from karamelo_py.compiler.fields import field, name_of
from karamelo_py.kernels import arrays
from karamelo_py.kernels.export import export_velocity_moment, impose_stress
from karamelo_py.kernels.heat import Supply, Temperature
from karamelo_py.kernels.hook_loop import corners_that_move
from karamelo_py.kernels.laws import elastic_law
from karamelo_py.kernels.p2g import Force
from karamelo_py.output.point_table import Part, PointTable, Rows
from karamelo_py.points.laws import can, with_stress
from karamelo_py.points.transfers import Moment
from karamelo_py.scene.view import Shown, View


class NodesView(View):
    """The nodes of a group that carry mass, at one stage of a step::

        nodes.force += nodes.mass[:, None] * self.gravity

    Attributes
    ----------
    index : (n,) int
        Node numbers.
    """

    _fields = ("dt", "kick", "time", "index")

    def __init__(self, simulation: Any, s: Any, group: Any, stage: int, before_update: bool):
        super().__init__()
        self._simulation = simulation
        self._foreign = getattr(s.control.ranks, "foreign", None)
        self._nodes = s.nodes
        self._grids = s.grids
        self._stage = stage
        self._on_velocity = stage == arrays.POST_VELOCITIES_TO_GRID or before_update
        self._d = s.kin.dimension
        self._kin = s.kin
        self._take_times(s.control)
        if group.all:
            spans = s.spans[1 : 1 + s.spans[0, 0]]
            members = np.concatenate([np.arange(a, b) for a, b in spans] or [np.empty(0, int)])
        else:
            members = group.nodes
        self.index = members[s.nodes.sums[members, arrays.MASS] > 0]

    def total(self, terms: Any) -> np.ndarray:
        """The sum of terms (n,) or (n, k) over all nodes of the group, those of all processes."""
        terms = np.asarray(terms, float)
        own = slice(None) if self._foreign is None else self._foreign[self.index] == 0
        return self._simulation.summed(terms[own])

    def _part(self, array: np.ndarray, first: int) -> tuple:
        """Return where in an array of the nodes a vector of those of the view lies."""
        return self.index, slice(first, first + self._d)

    @Shown
    def position(self) -> np.ndarray:
        """(n, 3) positions of the nodes; read only."""
        grids = self._grids
        g = np.searchsorted(grids.first, self.index, side="right") - 1
        local = self.index - grids.first[g]
        step_x, step_y = grids.step_x[g], grids.step_y[g]
        places = np.stack([local // step_x, local % step_x // step_y, local % step_y], axis=1)
        corners = np.stack([grids.x0[g], grids.y0[g], grids.z0[g]], axis=1)
        return corners + places * grids.spacing[g][:, None]

    @Shown
    def mass(self) -> np.ndarray:
        """(n,) nodal mass; read only."""
        return self._nodes.sums[self.index, arrays.MASS]

    @Shown
    def force(self) -> np.ndarray:
        """(n, d) internal plus external force; set it in ``post_particles_to_grid``."""
        return self._nodes.sums[self._at_force()]

    @force.writer
    def _write_force(self, value: np.ndarray) -> None:
        self._nodes.sums[self._at_force()] = value

    def _at_force(self) -> tuple:
        return self._part(self._nodes.sums, arrays.of_force(self._kin))

    @Shown
    def velocity(self) -> np.ndarray:
        """(n, d) velocity: v before the momentum update, or the one that deforms the points."""
        nodes = self._nodes
        if self._on_velocity:
            return nodes.velocity[self._part(nodes.velocity, 0)]
        if self._stage == arrays.POST_PARTICLES_TO_GRID:
            momentum = nodes.sums[self._part(nodes.sums, arrays.of_momentum(self._kin))]
            return momentum / nodes.sums[self.index, arrays.MASS][:, None]
        change = nodes.update[self._part(nodes.update, arrays.of_change(self._kin))]
        return nodes.update[self._part(nodes.update, 0)] - change

    @velocity.writer
    def _write_velocity(self, value: np.ndarray) -> None:
        nodes = self._nodes
        if self._on_velocity:
            nodes.velocity[self._part(nodes.velocity, 0)] = value
        elif self._stage in (arrays.POST_UPDATE_GRID_STATE, arrays.POST_UPDATE_GRID_HEAT):
            star = nodes.update[self._part(nodes.update, 0)]
            nodes.update[self._part(nodes.update, arrays.of_change(self._kin))] = star - value
        else:
            mass = nodes.sums[self.index, arrays.MASS][:, None]
            nodes.sums[self._part(nodes.sums, arrays.of_momentum(self._kin))] = mass * value

    @Shown
    def velocity_update(self) -> np.ndarray:
        """(n, d) v*, the velocity after the momentum update (``post_update_grid_state``)."""
        if self._on_velocity:
            return self._nodes.velocity[self._part(self._nodes.velocity, 0)]
        return self._nodes.update[self._part(self._nodes.update, 0)]

    @velocity_update.writer
    def _write_velocity_update(self, value: np.ndarray) -> None:
        nodes = self._nodes
        if self._on_velocity:
            nodes.velocity[self._part(nodes.velocity, 0)] = value
            return
        star = self._part(nodes.update, 0)
        change = self._part(nodes.update, arrays.of_change(self._kin))
        old = nodes.update[star] - nodes.update[change]
        nodes.update[star] = value
        nodes.update[change] = nodes.update[star] - old


class PointsView(View):
    """The points of a group, at one stage of a step, in the order of their ids."""

    _fields = ("dt", "kick", "time", "ids", "moved")
    ids: np.ndarray

    def __init__(self, simulation: Any, ids: np.ndarray, then: bool):
        super().__init__()
        self._simulation = simulation
        self._then = then
        self._take_times(simulation.control)
        self.ids = ids
        self.moved = False
        self._found: Rows | None = None
        self._declared: dict[type, tuple[np.ndarray, np.ndarray]] = {}

    def total(self, terms: Any) -> np.ndarray:
        """The sum of terms (n,) or (n, k) over all points of the group, rounded once.

        It is the same for any number of processes, which all have to ask for it.
        """
        return self._simulation.summed(np.asarray(terms, float))

    def column(self, name: str) -> np.ndarray:
        """(n,) a column of the dumps for these points."""
        return PointTable(self._simulation.hub, self._rows).particle(name)

    @property
    def _rows(self) -> Rows:
        """The points of the view, as they lie in the arrays of the scene."""
        if self._found is None:
            s, parts = self._simulation.setup, []
            place = np.full(self._simulation.count, -1)
            place[self.ids] = np.arange(len(self.ids))
            for block in s.blocks:
                of_block = place[block.points.id]
                rows = np.flatnonzero(of_block >= 0)
                parts.append(Part(block, rows, of_block[rows]))
            self._found = Rows(s, parts, self.ids, np.ones(len(self.ids), np.bool_))
        return self._found

    def __getitem__(self, kind: type) -> np.ndarray:
        """(n, components) of a field that a fix declares in its ``point_fields``."""
        if isinstance(kind, str):
            raise self._no_column(kind)
        if kind not in self._declared:
            array = np.array(self._rows.take(self._of(kind)))
            self._declared[kind] = array, array.copy()
        return self._declared[kind][0]

    def __setitem__(self, kind: type, value: np.ndarray) -> None:
        self[kind][...] = value

    def write_back(self) -> None:
        """Write what a hook has changed; called when it returns."""
        super().write_back()
        for kind, (array, before) in self._declared.items():
            if not np.array_equal(array, before, equal_nan=True):
                self._rows.put(self._of(kind), array)

    @staticmethod
    def _of(kind: type) -> Callable:
        def of(points: Any) -> np.ndarray:
            array = field(points.fields, kind)
            if array is None:
                raise ValueError(
                    f"points have no {name_of(kind)}: name it in the point_fields of the fix"
                )
            return array

        return of

    def _places(self, points: Any) -> np.ndarray:
        now = self._simulation.now
        return points.x[1 - now if self._then else now]

    def _place(self, points: Any) -> np.ndarray:
        return self._places(points)[: self._simulation.kin.dimension]

    @Shown
    def position(self) -> np.ndarray:
        """(n, d) positions; the corners of convected domains go with the points."""
        return self._rows.take(self._place)

    @position.writer
    def _write_position(self, value: np.ndarray) -> None:
        s, d = self._simulation.setup, self._simulation.kin.dimension
        before = self._rows.take(self._place)
        self._rows.put(self._place, value)
        step = self._rows.take(self._place) - before
        corners = corners_that_move(s)
        for block, rows, own in self._rows.parts if corners else ():
            behind = self._places(block.points)[d : d + d * corners]
            behind[:, rows] += np.tile(step[own].T, (corners, 1))
        self.moved = True

    @Shown
    def velocity(self) -> np.ndarray:
        """(n, d) velocities."""
        return self._rows.take(lambda points: points.v)

    @velocity.writer
    def _write_velocity(self, value: np.ndarray) -> None:
        self._rows.put(lambda points: points.v, value)

    def set_velocity_gradient(self, component: int, gradient: Callable) -> None:
        """Let points whose transfer keeps it (APIC, TPIC ...) know how their velocity changes.

        Parameters
        ----------
        component
            The component of velocity whose gradient this is.
        gradient
            ``gradient(moves, step)`` -> (n, d), its derivatives by the coordinates that the grid
            has (positions, or reference positions where `moves` is False); `step` is a length that
            is small beside a cell. It is not called where no point keeps such a thing.
        """
        simulation, slopes = self._simulation, None
        s, d = simulation.setup, simulation.kin.dimension
        here = slice(component * d, component * d + d)
        for block, rows, own in self._rows.parts:
            points, kept = block.points, field(block.points.fields, Moment)
            if kept is None:
                continue
            if slopes is None:
                slopes = np.nan_to_num(gradient(s.frame.moves, simulation.hub.domain.h / 16)).T
            given = np.zeros((d * d, len(rows)), kept.dtype)
            given[here] = slopes[:, own]
            if not s.transfer.keeps_gradient:
                # B = D grad v, as the nodes would show it
                places = points.x[simulation.now] if points.home is None else points.home
                where = np.ascontiguousarray(places[:, rows])
                shown, grid = given, points.grid[rows]
                given = np.zeros_like(shown)
                export_velocity_moment(s.basis, s.kin, s.grids, grid, where, shown, given)
            kept[here, rows] = given[here]

    @Shown
    def mass(self) -> np.ndarray:
        """(n,) masses; read only."""
        return self._rows.take(lambda points: points.mass)

    @Shown
    def force(self) -> np.ndarray:
        """(n, d) forces that fixes put on the points; add to it in ``initial_integrate``.

        Only for fixes with ``point_fields = (Force,)``. It is zero before the first of them.
        """
        return self._rows.take(self._of(Force))

    @force.writer
    def _write_force(self, value: np.ndarray) -> None:
        self._rows.put(self._of(Force), value)

    @Shown
    def temperature(self) -> np.ndarray:
        """(n,) temperatures, where heat flows; read only."""
        return self._rows.take(self._heat(Temperature))[:, 0]

    @Shown
    def heat_supply(self) -> np.ndarray:
        """(n,) heat per time that fixes bring; add to it in ``supply_heat``."""
        return self._rows.take(self._heat(Supply))[:, 0]

    @heat_supply.writer
    def _write_heat_supply(self, value: np.ndarray) -> None:
        self._rows.put(self._heat(Supply), value[:, None])

    @staticmethod
    def _heat(kind: type) -> Callable:
        def of(points: Any) -> np.ndarray:
            array = field(points.fields, kind)
            if array is None:
                raise ValueError("no heat flows: the method has to be thermo-mechanical")
            return array

        return of

    def set_stress(self, given: dict[str, np.ndarray]) -> None:
        """Set components of the Cauchy stress: ``{"11": (n,) values, ...}`` of rate-form laws."""
        s = self._simulation.setup
        names, like = s.kin.symmetric_names, s.nodes.sums[0, arrays.MASS]
        flags = np.array([name in given for name in names])
        values = np.stack(
            [np.broadcast_to(given.get(name, 0.0), len(self.ids)) for name in names], axis=1
        ).astype(s.nodes.sums.dtype)
        for block, rows, own in self._rows.parts:
            points = arrays.known_to_laws(block.points)
            if len(rows) and can(elastic_law(block.laws), with_stress):
                chosen = np.zeros(len(points.id), np.bool_)
                chosen[rows] = True
                stress = np.zeros((len(points.id), len(names)), values.dtype)
                stress[rows] = values[own]
                impose_stress(s.kin, like, points, block.laws, chosen, flags, stress)

    @Shown
    def reference_position(self) -> np.ndarray:
        """(n, d) positions before the first step; read only."""
        return self._simulation.x0[self.ids]


class PieceView(PointsView):
    """Points of a group that are at hand, in the order in which they are stored.

    For hooks that look at each point on its own (`Fix.point_by_point`). Positions are read-only.
    Before the steps (`in_steps` False) they are some of them: others come after them.
    """

    def __init__(self, simulation: Any, parts: list[tuple], then: bool, *, in_steps: bool):
        parts = parts or [(simulation.setup.blocks[0], np.empty(0, np.int64))]
        ids = [block.points.id[rows] for block, rows in parts]
        super().__init__(simulation, np.concatenate(ids), then)
        own = pairwise(np.cumsum([0, *map(len, ids)]).tolist())
        found = [Part(*part, slice(*places)) for part, places in zip(parts, own, strict=True)]
        present = np.ones(len(self.ids), np.bool_)
        self._found = Rows(simulation.setup, found, self.ids, present)
        self._in_steps = in_steps

    def total(self, terms: Any) -> np.ndarray:
        """The sum of terms (n,) or (n, k) over all points of the group, rounded once."""
        if self._in_steps:
            return super().total(terms)
        raise ValueError(
            "points.total(terms) is known in steps alone; before the first, points come in pieces "
            "where point_by_point is True"
        )

    @Shown
    def position(self) -> np.ndarray:
        """(n, d) positions; read only."""
        return self._rows.take(self._place)

    @Shown
    def reference_position(self) -> np.ndarray:
        """(n, d) positions before the first step; read only."""
        return self._simulation.x0_of(self.ids)
