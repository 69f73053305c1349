"""Views of nodes and points for Python hooks.

Arrays have one row per node or point of the group. Changes, by assignment or in place, are written
back when the hook returns; arrays marked "read only" cannot be changed.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from karamelo_py.compiler.fields import Field, field, name_of
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels import arrays
from karamelo_py.kernels.equations.heat import Supply, Temperature
from karamelo_py.kernels.equations.internal_force import Force
from karamelo_py.kernels.equations.move import VelocityBefore
from karamelo_py.kernels.export import (
    export_velocity_moment,
    impose_lighting,
    impose_stress,
    impose_temperature,
)
from karamelo_py.kernels.hook_loop import corners_that_move
from karamelo_py.kernels.ranks import Linked
from karamelo_py.output.point_table import (
    AXES,
    VECTORS,
    Part,
    PointTable,
    Rows,
    declared_columns,
    places_before,
)
from karamelo_py.points.grid import node_position
from karamelo_py.points.laws import can, elastic_law, with_stress, with_temperature
from karamelo_py.points.transfers import Moment
from karamelo_py.script.errors import Mark, NoItem, ScriptError, blaming, meant


class Shown:
    def __init__(self, read: Callable, write: Callable | None = None, doc: str | None = None):
        self.read, self.write = read, write
        self.__doc__ = doc or read.__doc__

    def writer(self, write: Callable) -> Callable:
        self.write = write
        return write

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, view: "View | None", owner: type) -> Any:
        if view is None:
            return self
        return view._handed(self.name, lambda: self.read(view), written=self._writable(view))

    def _writable(self, view: "View") -> bool:
        return self.write is not None and self.name not in view._read_only

    def __set__(self, view: "View", value: ArrayLike) -> None:
        if not self._writable(view):
            raise AttributeError(f"{self.name} is read-only")
        now = self.__get__(view, type(view))
        value = np.asarray(value)
        if value.ndim and value.shape != now.shape:
            raise ValueError(f"{self.name} has the shape {now.shape}, not {value.shape}")
        now[...] = value


_VECTORS = VECTORS | {f"{of}{axis}": ("force", k) for of in "fb" for k, axis in enumerate("xyz")}


class View:
    _fields: tuple[str, ...] = ()
    _read_only: tuple[str, ...] = ()
    _shown: frozenset[str]

    def __init_subclass__(cls) -> None:
        attributes = (item for base in cls.__mro__ for item in vars(base).items())
        cls._shown = frozenset(name for name, value in attributes if isinstance(value, Shown))

    def __init__(self) -> None:
        # The array given to the hook, and a copy of it, by attribute or field class.
        self._handed_out: dict[str | type, tuple[np.ndarray, np.ndarray]] = {}

    def _take_times(self, control: arrays.Control) -> None:
        self.dt = float(control.values[arrays.DT])
        self.kick = float(control.step[0].kick)
        self.contact_dt = float(control.step[0].contact_dt)
        self.contact_kick = float(control.step[0].contact_kick)
        self.time = float(control.values[arrays.TIME])

    def write_back(self) -> None:
        for key, (now, before) in self._handed_out.items():
            if now is before or np.array_equal(now, before, equal_nan=True):
                continue
            if isinstance(key, str):
                getattr(type(self), key).write(self, now)
            else:
                self._put(key, now)

    def _handed(self, key: str | type, read: Callable, *, written: bool = True) -> np.ndarray:
        if key not in self._handed_out:
            array = np.array(read())
            array.flags.writeable = written
            self._handed_out[key] = array, array.copy() if written else array
        return self._handed_out[key][0]

    _get: Callable[[type], np.ndarray]  # returns the field (n, components) of a class
    _put: Callable[[type, np.ndarray], None]

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in self._fields or name.startswith("_") or name in self._shown):
            raise self._unknown(name)
        object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        raise self._unknown(name)

    def __getitem__(self, kind: type) -> np.ndarray:
        """Return a declared field, (n, components)."""
        if not isinstance(kind, type):
            raise self._no_column(kind)
        return self._handed(kind, lambda: self._get(kind))

    def __setitem__(self, kind: type, value: ArrayLike) -> None:
        self[kind][...] = value

    def _no_column(self, name: object) -> KeyError:
        kind = type(self).__name__
        attribute, *k = _VECTORS.get(str(name), (str(name),))
        if attribute in self._shown:
            column = f"[:, {k[0]}]" if k else ""
            return NoItem(f"{kind} has no ['{name}']: write .{attribute}{column}")
        names = ", ".join(sorted(self._shown))
        return NoItem(f"{kind} has no ['{name}']; its attributes are {names}")

    def _unknown(self, name: str) -> AttributeError:
        names = [*self._fields, *(n for n in dir(type(self)) if not n.startswith("_"))]
        hint = meant(name, names) or f"it has {', '.join(sorted(names))}"
        return AttributeError(f"{type(self).__name__} has no {name}; {hint}")


NO_HEAT = "no heat flows: the method has to be thermo-mechanical"


def _declared(kind: type, of: str, missing: str = "") -> Callable:
    def find(arrays: Any) -> np.ndarray:
        array = field(arrays.fields, kind)
        if array is None:
            undeclared = f"{of}s have no {name_of(kind)}: name it in the {of}_fields of the fix"
            raise ValueError(missing or undeclared)
        return array

    return find


class NodesView(View):
    """The nodes of a group that have mass, numbered `index` (n,), at one stage of a step.

    Example: ``nodes.force += nodes.mass[:, None] * self.gravity``.
    """

    _fields = ("dt", "kick", "contact_dt", "contact_kick", "time", "index")

    def __init__(self, simulation: Any, s: Any, group: Any, stage: int, before_update: bool):
        super().__init__()
        self._simulation = simulation
        ranks = s.control.ranks
        self._foreign = ranks.foreign if isinstance(ranks, Linked) else None
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

    def total(self, terms: ArrayLike) -> np.ndarray:
        """Sum terms (n,) or (n, k) over the nodes of the group in all processes."""
        terms = np.asarray(terms, float)
        local = slice(None) if self._foreign is None else self._foreign[self.index] == 0
        return self._simulation.points.summed(terms[local])

    def _vectors(self, name: str, first: int = 0) -> np.ndarray:
        return getattr(self._nodes, name)[:, first : first + self._d]

    def _declared(self, kind: type[Field]) -> np.ndarray:
        return _declared(kind, "node")(self._nodes)[:, : kind.shape(self._kin)]

    def _get(self, kind: type) -> np.ndarray:
        return self._declared(kind)[self.index]

    def _put(self, kind: type, value: np.ndarray) -> None:
        self._declared(kind)[self.index] = value

    @Shown
    def position(self) -> np.ndarray:
        """Positions (n, 3); read only."""
        g = np.searchsorted(self._grids.first, self.index, side="right") - 1
        return np.stack(node_position(record(self._grids, g), self.index), axis=1)

    @Shown
    def mass(self) -> np.ndarray:
        """Masses (n,); read only."""
        return self._nodes.sums[self.index, arrays.MASS]

    @Shown
    def force(self) -> np.ndarray:
        """Internal plus external force (n, d); may be changed in ``post_particles_to_grid``."""
        return self._vectors("sums", arrays.of_force(self._kin))[self.index]

    @force.writer
    def _write_force(self, value: np.ndarray) -> None:
        self._vectors("sums", arrays.of_force(self._kin))[self.index] = value

    @property
    def _momentum(self) -> np.ndarray:
        return self._vectors("sums", arrays.of_momentum(self._kin))

    @property
    def _change(self) -> np.ndarray:
        return self._vectors("update", arrays.of_change(self._kin))

    @Shown
    def velocity(self) -> np.ndarray:
        """Velocities (n, d) before the momentum update; in later stages, as used for gradients."""
        if self._on_velocity:
            return self._vectors("velocity")[self.index]
        if self._stage == arrays.POST_PARTICLES_TO_GRID:
            return self._momentum[self.index] / self.mass[:, None]
        return self._vectors("update")[self.index] - self._change[self.index]

    @velocity.writer
    def _write_velocity(self, value: np.ndarray) -> None:
        if self._on_velocity:
            self._vectors("velocity")[self.index] = value
        elif self._stage in (arrays.POST_UPDATE_GRID_STATE, arrays.POST_UPDATE_GRID_HEAT):
            self._change[self.index] = self._vectors("update")[self.index] - value
        else:
            self._momentum[self.index] = self.mass[:, None] * value

    @Shown
    def velocity_update(self) -> np.ndarray:
        """Velocities v* (n, d) after the momentum update (``post_update_grid_state``)."""
        return self._vectors("velocity" if self._on_velocity else "update")[self.index]

    @velocity_update.writer
    def _write_velocity_update(self, value: np.ndarray) -> None:
        if self._on_velocity:
            self._vectors("velocity")[self.index] = value
            return
        old = self._vectors("update")[self.index] - self._change[self.index]
        self._vectors("update")[self.index] = value
        self._change[self.index] = self._vectors("update")[self.index] - old


class PointsView(View):
    """The points of a group at one stage of a step, ordered by id.

    For hooks that treat each point separately (`Fix.point_by_point`), the view has the points of
    this process in storage order, as `pieces` (block, rows), and positions are read-only. Before
    the first step (`in_steps` False) a view has only some of the points.
    """

    _fields = ("dt", "kick", "contact_dt", "contact_kick", "time", "ids", "moved")
    ids: np.ndarray

    def __init__(
        self,
        simulation: Any,
        numbers: np.ndarray | None = None,
        *,
        then: bool = False,
        pieces: Sequence[tuple[arrays.Block, np.ndarray]] = (),
        in_steps: bool = True,
    ):
        super().__init__()
        self._simulation = simulation
        self._then = then
        self._take_times(simulation.control)
        self.moved = False
        self._in_steps = in_steps
        self._stored: Rows | None = None
        if numbers is None:
            numbers = self._take_local(pieces or [(simulation.setup.blocks[0], np.empty(0, int))])
        self._numbers = numbers
        self.ids = numbers + 1

    def _take_local(self, pieces: Sequence[tuple[arrays.Block, np.ndarray]]) -> np.ndarray:
        ids = [block.points.id[rows] for block, rows in pieces]
        numbers = np.concatenate(ids)
        spans = pairwise(np.cumsum([0, *map(len, ids)]).tolist())
        parts = [Part(*piece, slice(*span)) for piece, span in zip(pieces, spans, strict=True)]
        present = np.ones(len(numbers), np.bool_)
        self._stored = Rows(self._simulation.setup, parts, numbers, present)
        self._read_only = ("position",)
        return numbers

    def total(self, terms: ArrayLike) -> np.ndarray:
        """Sum terms (n,) or (n, k) over the group's points, exactly rounded; all ranks call it."""
        if not self._in_steps:
            raise ValueError(
                "points.total(terms) is known only in steps; before the first, points come in "
                "pieces if point_by_point is True"
            )
        return self._simulation.points.summed(np.asarray(terms, float))

    def column(self, name: str) -> np.ndarray:
        return PointTable(self._simulation.hub, self._rows).particle(name)

    @property
    def _rows(self) -> Rows:
        if self._stored is None:
            s, parts = self._simulation.setup, []
            order = np.full(self._simulation.count, -1)
            order[self._numbers] = np.arange(len(self.ids))
            for block in s.blocks:
                places = order[block.points.id]
                rows = np.flatnonzero(places >= 0)
                parts.append(Part(block, rows, places[rows]))
            self._stored = Rows(s, parts, self._numbers, np.ones(len(self.ids), np.bool_))
        return self._stored

    def _get(self, kind: type) -> np.ndarray:
        return self._rows.take(_declared(kind, "point"))

    def _put(self, kind: type, value: np.ndarray) -> None:
        self._rows.put(_declared(kind, "point"), value)

    def _places(self, points: arrays.Points) -> np.ndarray:
        now = self._simulation.now
        return points.x[1 - now if self._then else now]

    def _place(self, points: arrays.Points) -> np.ndarray:
        return self._places(points)[: self._simulation.kin.dimension]

    @Shown
    def position(self) -> np.ndarray:
        """Positions (n, d); corners of convected domains move with the points."""
        return self._rows.take(self._place)

    @position.writer
    def _write_position(self, value: np.ndarray) -> None:
        s, d = self._simulation.setup, self._simulation.kin.dimension
        before = self._rows.take(self._place)
        self._rows.put(self._place, value)
        step = self._rows.take(self._place) - before
        corners = corners_that_move(s)
        for block, rows, places in self._rows.parts if corners else ():
            of_corners = self._places(block.points)[d : d + d * corners]
            of_corners[:, rows] += np.tile(step[places].T, (corners, 1))
        self.moved = True

    def _write_velocity(self, value: np.ndarray) -> None:
        self._rows.put(lambda points: points.v, value)
        if self._rows.declared(VelocityBefore) is not None:
            self._rows.put(_declared(VelocityBefore, "point"), np.full_like(value, np.nan))

    velocity = Shown(
        lambda view: view._rows.take(lambda points: points.v), _write_velocity, "(n, d)."
    )
    mass = Shown(lambda view: view._rows.take(lambda points: points.mass), doc="(n,); read only.")
    force = Shown(
        lambda view: view._get(Force),
        lambda view, value: view._put(Force, value),
        """(n, d) forces of fixes; add to it in ``initial_integrate``.

        For fixes with ``point_fields = (Force,)``. Zero before the first of them.
        """,
    )
    temperature = Shown(
        lambda view: view._heat(Temperature), doc="(n,), with heat conduction; read only."
    )
    heat_supply = Shown(
        lambda view: view._heat(Supply),
        lambda view, value: view._put(Supply, value[:, None]),
        "(n,) heating power of fixes; add to it in ``supply_heat``.",
    )

    def _heat(self, kind: type) -> np.ndarray:
        return self._rows.take(_declared(kind, "point", NO_HEAT))[:, 0]

    def set_velocity_gradient(self, component: int, gradient: Callable) -> None:
        """Set the velocity gradient of points that store one (APIC, TPIC ...).

        ``gradient(moves, step)``, which is called only if it is needed, returns derivatives (n, d)
        of a velocity `component`, with respect to present positions if `moves`, otherwise to
        reference positions. `step`, for finite differences, is much smaller than a cell.
        """
        simulation, slopes = self._simulation, None
        s, d = simulation.setup, simulation.kin.dimension
        here = slice(component * d, component * d + d)
        for block, rows, places in self._rows.parts:
            points, kept = block.points, field(block.points.fields, Moment)
            if kept is None:
                continue
            if slopes is None:
                slopes = np.nan_to_num(gradient(s.frame.moves, simulation.hub.domain.h / 16)).T
            moment = np.zeros((d * d, len(rows)), kept.dtype)
            moment[here] = slopes[:, places]
            if not s.transfer.traits.keeps_gradient:  # these store B = D grad v
                x = points.x[simulation.now] if points.home is None else points.home
                x = np.ascontiguousarray(x[:, rows])
                gradients, grid = moment, points.grid[rows]
                moment = np.zeros_like(gradients)
                at = arrays.OnGrids(s.basis, s.kin, s.grids, grid, x)
                export_velocity_moment(at, gradients, moment)
            kept[here, rows] = moment[here]

    def set_stress(self, components: dict[str, np.ndarray]) -> None:
        """Set components of the Cauchy stress, ``{"11": (n,), ...}``, in laws in rate form."""
        s = self._simulation.setup
        names = s.kin.symmetric_names
        columns = [components.get(name, 0.0) for name in names]
        columns += [float(name in components) for name in names]
        values = np.stack([np.broadcast_to(column, len(self.ids)) for column in columns], axis=1)
        values = values.astype(s.nodes.sums.dtype)
        for block, rows, places in self._rows.parts:
            if len(rows) and can(elastic_law(block.laws), with_stress):
                stress = np.ascontiguousarray(values[places])
                impose_stress(arrays.matter_of(s.kin, block), np.asarray(rows), stress)

    def set_temperature(self, values: np.ndarray) -> None:
        self.impose(impose_temperature, values)

    def ignite(self, since: np.ndarray) -> None:
        """Ignite explosives at the times now - `since` (n,); negative values are in the future."""
        self.impose(impose_lighting, since)

    def impose(self, kernel: Callable, values: np.ndarray, law: type = tuple) -> None:
        """Call ``kernel(matter, rows, numbers)`` for points whose law is a `law`.

        `numbers` are the `values` (n,) of these points.
        """
        s = self._simulation.setup
        for block, rows, places in self._rows.parts:
            if not isinstance(block.laws, law):
                continue
            numbers = np.ascontiguousarray(values[places], s.nodes.sums.dtype)
            kernel(arrays.matter_of(s.kin, block), np.asarray(rows), numbers)

    def set_column(self, name: str, values: np.ndarray) -> None:
        """Set a dump column (n,): position, velocity, stress, T, or a declared field."""
        d, hub = self._simulation.kin.dimension, self._simulation.hub
        attribute, k = VECTORS.get(name, ("", 0))
        kind, column = declared_columns(hub, "point_fields").get(name, (None, 0))
        if attribute in ("position", "velocity") and k < d:
            lo, hi = hub.domain.lo[k], hub.domain.hi[k]
            if attribute == "position" and ((values < lo) | (values > hi)).any():
                raise ScriptError(
                    f"'{name}' is from {lo:g} to {hi:g}, the edges of the domain", name=name
                )
            getattr(self, attribute)[:, k] = values
        elif kind is not None:
            self[kind][:, column] = values
        elif name[0] == "s" and name[1:] in self._simulation.kin.symmetric_names:
            if not all(
                can(elastic_law(piece.block.laws), with_stress) for piece in self._rows.parts
            ):
                raise ScriptError(
                    f"'{name}' follows from the deformation of a material of this scene",
                    name=name,
                    expected="materials in rate form, such as linear or eos-strength",
                )
            self.set_stress({name[1:]: values})
        elif name == "T":
            if not all(can(piece.block.laws, with_temperature) for piece in self._rows.parts):
                raise ScriptError(
                    "a material of this scene has no temperature T",
                    expected="material(ID, linear, rho, E, nu, cp, kappa), or temperature(...) "
                    "with eos-strength",
                )
            self.set_temperature(values)
        else:
            raise ScriptError(
                f"'{name}' cannot be set: it follows from other columns",
                name=name,
                expected=f"{', '.join(AXES[:d])}, v{', v'.join(AXES[:d])}, stresses, T, "
                "or a column of a field of a part",
            )
        self.write_back()

    @Shown
    def reference_position(self) -> np.ndarray:
        """Positions (n, d) before the first step; read only."""
        return places_before(self._simulation.hub, self._numbers)


def set_columns(
    simulation: Any,
    columns: Mapping[str, ArrayLike],
    ids: np.ndarray | None = None,
    mark: Mark | None = None,
) -> None:
    """Set columns of points between steps, to numbers or arrays (n,).

    `ids` are counted from 0; by default all points are set. Raises ScriptError for columns that
    cannot be set, wrong shapes, and values that are not finite.
    """
    present = simulation.present
    ids = np.arange(len(present)) if ids is None else ids
    view = PointsView(simulation, ids[present[ids]])
    for name, values in columns.items():
        array = np.asarray(values, float)
        wanted = f"is a number, or one for each of {len(ids)} points"
        if array.shape not in ((), ids.shape):
            raise ScriptError(
                f"'{name}' {wanted}, not an array of the shape {array.shape}", mark=mark
            )
        if not np.isfinite(array).all():
            raise ScriptError(f"'{name}' has numbers that are not finite", mark=mark)
        with blaming(mark):
            view.set_column(name, np.broadcast_to(array, ids.shape)[present[ids]])
    if view.moved:
        simulation.tiles.unsort(simulation.control)
    simulation.changed()
