"""Tables of points: all of a scene, a piece of them by id, or some of a block."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.kernels.arrays import MASS, Block, Points, Setup, known_to_laws, some_of
from karamelo_py.kernels.averaging import FBar
from karamelo_py.kernels.export import (
    ENERGY,
    EXPORTED,
    JACOBIAN,
    STRAIN,
    export,
    export_state,
    export_velocity_moment,
)
from karamelo_py.kernels.heat import Conducting
from karamelo_py.language.scene import Scene
from karamelo_py.points.grid import ReflectingGrid
from karamelo_py.points.laws import columns_of
from karamelo_py.points.transfers import Moment

AXES = "xyz"
COMPONENTS = ("11", "22", "33", "12", "13", "23")


class Part(NamedTuple):
    """Points of a block, and their places in a table."""

    block: Block
    rows: np.ndarray | None  # ascending; None: all of the block
    places: Any  # indices or a slice

    def taken(self, array: np.ndarray) -> np.ndarray:
        """Return the numbers (..., k) of these points, from those of all of the block."""
        whole = self.rows is None or len(self.rows) == array.shape[-1]
        return array if whole else fields.some_points(array, self.rows)

    @property
    def points(self) -> Points:
        """The arrays of these points alone."""
        return self.block.points if self.rows is None else some_of(self.block, self.rows).points


class Rows(NamedTuple):
    """The points of a table, as they lie in the arrays of a scene."""

    s: Setup
    parts: list[Part]
    ids: np.ndarray
    present: np.ndarray
    comm: Any = None  # of the processes that have parts of them, or None

    def of_all(self, own: list[tuple]) -> Iterator[tuple]:
        """Yield places and numbers, from those of the parts that are at hand."""
        if self.comm is None:
            yield from own
        else:
            yield from (one for of_rank in self.comm.allgather(own) for one in of_rank)

    def take(self, of: Callable[[Points], np.ndarray]) -> np.ndarray:
        """Gather (n, ...) a field, which `of` takes from `Points`; zero for deleted points."""
        own = [(part.places, part.taken(of(part.block.points))) for part in self.parts]
        found = np.zeros((*own[0][1].shape[:-1], len(self.ids)), own[0][1].dtype)
        for places, array in self.of_all(own):
            found[..., places] = array
        return found.T

    def put(self, of: Callable[[Points], np.ndarray], values: np.ndarray) -> None:
        """Write a field (n, ...), which `of` takes from `Points`."""
        for block, rows, places in self.parts:
            of(block.points)[..., slice(None) if rows is None else rows] = values[places].T

    def declared(self, kind: type) -> np.ndarray | None:
        """Gather (n, components) a declared field, None where the scene does not have it.

        Where only some laws have it, the others show what it starts from.
        """
        arrays = [(part, fields.field(part.block.points.fields, kind)) for part in self.parts]
        if all(array is None for _, array in arrays):
            return None
        found = fields.at_points(kind, self.s.kin, len(self.ids), float).array
        own = [(part.places, part.taken(array)) for part, array in arrays if array is not None]
        for places, array in self.of_all(own):
            found[:, places] = array
        return found.T

    def computed(self, of: Callable[[Block], Callable | None], *columns: int) -> np.ndarray:
        """Compute (n, *columns) numbers of each point by a kernel.

        ``of(laws)`` is called as ``fill(kin, like, points, laws, rows)``. Points are left at 0
        where their laws do not have it, and ``of(laws)`` is None.
        """
        own, s = [], self.s
        for part in self.parts:
            points = known_to_laws(part.points)
            # Arrays without points are of another type, for which all would be compiled once more.
            if len(points.id) and (fill := of(part.block.laws)):
                rows = np.zeros((len(points.id), *columns))
                fill(s.kin, s.nodes.sums[0, MASS], points, part.block.laws, rows)
                own.append((part.places, rows))
        found = np.zeros((len(self.ids), *columns))
        for places, rows in self.of_all(own):
            found[places] = rows
        return found


class PointTable:
    """Some points of a scene, one after another: arrays, which are safe to keep, and columns.

    Deleted points (boundary delete) have zeros in the arrays of all points and of a piece;
    `particle` leaves them out.

    Attributes
    ----------
    ids : ndarray (n,)
        Their numbers, from 0.
    present : ndarray (n,)
        False for points that were deleted.
    """

    def __init__(self, hub: Scene, rows: Rows):
        self.hub = hub
        self._rows = rows
        self._cache: dict[str, Any] = {}

    def _cached(self, name: str, make: Callable[[Rows], Any]) -> Any:
        rows = self._rows
        if name not in self._cache:
            self._cache[name] = make(rows)
        return self._cache[name]

    @property
    def ids(self) -> np.ndarray:
        """(n,) numbers of the points, from 0."""
        return self._rows.ids

    @property
    def count(self) -> int:
        """Number of points."""
        return len(self._rows.ids)

    @property
    def present(self) -> np.ndarray:
        """(n,) False for points that were deleted."""
        return self._rows.present

    @property
    def position(self) -> np.ndarray:
        """(n, d) positions."""
        return self._cached("x", lambda rows: rows.take(partial(_place, rows.s)))

    @property
    def velocity(self) -> np.ndarray:
        """(n, d) velocities."""
        return self._cached("v", lambda rows: rows.take(lambda points: points.v))

    @property
    def mass(self) -> np.ndarray:
        """(n,) masses."""
        return self._cached("mass", lambda rows: rows.take(lambda points: points.mass))

    @property
    def reference_position(self) -> np.ndarray:
        """(n, d) positions before the first step."""
        return self._cached("x0", lambda rows: places_before(self.hub, rows.ids))

    @property
    def reference_volume(self) -> np.ndarray:
        """(n,) volumes before the first step."""
        return self._cached("V0", lambda rows: volumes_before(self.hub, rows.ids))

    @property
    def solid(self) -> np.ndarray:
        """(n,) number of the solid of each point, from 0."""
        firsts = [solid.first_id for solid in self.hub.solids.values()]
        return (np.searchsorted(firsts, self.ids, side="right") - 1).astype(np.int32)

    @property
    def velocity_moment(self) -> np.ndarray | None:
        """(n, d d) moment of velocity, sum N v (X - x), of transfers that keep it, or None."""
        rows = self._rows
        kept = rows.declared(Moment)
        if kept is None or not getattr(rows.s.transfer, "keeps_gradient", False):
            return kept
        parts = [part._replace(block=part.block._replace(points=part.points), rows=None)
                 for part in rows.parts]  # fmt: skip
        return rows._replace(parts=parts).take(partial(_velocity_moment, rows.s))

    def declared(self, kind: type) -> np.ndarray | None:
        """Return a declared field (n, components), None where the scene does not have it."""
        return self._rows.declared(kind)

    def columns_of_laws(self) -> set[str]:
        """Name what the laws of the materials declare."""
        laws = [material.law for material in self.hub.materials.values()]
        return {name for law in laws for name in columns_of(law)}

    def declared_columns(self) -> dict[str, tuple[type, int]]:
        """Map columns to the declared field of the points that shows each, and the component."""
        update = self.hub.update
        basis = getattr(update.method, "basis", None)
        owners = [*self.hub.fixes.values(), update.method, update.transfer, basis, update.scheme]
        owners += [getattr(update.method, "frame", None)]
        owners += [Conducting] if update.thermal else []
        owners += [ReflectingGrid] if update.boundary == "reflect" else []
        owners += [FBar] if update.anti_locking else []
        found: dict[str, tuple[type, int]] = {}
        for kind in fields.declared(owners, "point_fields"):
            for k, column in enumerate(fields.columns_of(kind)):
                found.setdefault(column, (kind, k))
        return found

    def particle(self, name: str) -> np.ndarray:
        """Return a column (n,) of the points that there are.

        What the scene does not have is zero, as in Karamelo. Deleted points are left out.
        """
        values, present = self._particle(name), self.present
        return values if present.all() else values[present]

    def _particle(self, name: str) -> np.ndarray:
        if name == "id":
            return self.ids + 1
        if name == "type":
            return self.solid + 1
        if name in AXES:
            return _column(self.position, AXES.index(name))
        if name[:1] in AXES and name[1:] == "0":
            return _column(self.reference_position, AXES.index(name[0]))
        if name in ("vx", "vy", "vz"):
            return _column(self.velocity, AXES.index(name[1]))
        if name == "mass":
            return self.mass.astype(float)
        if name == "volume":
            return self.reference_volume * self._exported[:, JACOBIAN]
        if name == "ienergy":
            return self._exported[:, ENERGY].copy()
        if name in self.columns_of_laws() or name == "epdot":
            shown = partial(_column_of_laws, name)
            return self._cached(name, lambda rows: rows.computed(shown)).copy()
        if name == "seq":
            return _von_mises(self._exported[:, :STRAIN])
        if name[:1] in "se" and name[1:] in COMPONENTS:
            first = 0 if name[0] == "s" else STRAIN
            return self._exported[:, first + COMPONENTS.index(name[1:])].copy()
        if name in (shown := self.declared_columns()):
            kind, k = shown[name]
            if (array := self._rows.declared(kind)) is not None:
                return _column(array, k)
        return np.zeros(self.count)

    @property
    def _exported(self) -> np.ndarray:
        # A kinematics fills its own components: in the plane the fourth is 12, as in space.
        return self._cached(
            "exported", lambda rows: rows.computed(lambda laws: export_state, EXPORTED)
        )


def _place(s: Setup, points: Points) -> np.ndarray:
    return points.x[s.control.clock[0].now][: s.kin.dimension]


def _velocity_moment(s: Setup, points: Points) -> np.ndarray:
    kept = fields.field(points.fields, Moment)
    where = points.x[s.control.clock[0].now] if points.home is None else points.home
    moment = np.zeros_like(kept)
    export_velocity_moment(s.basis, s.kin, s.grids, points.grid, where, kept, moment)
    return moment


def places_before(hub: Scene, ids: np.ndarray) -> np.ndarray:
    """Return (n, d) positions of points before the first step, without those of others."""
    found = np.empty((len(ids), hub.domain.dimension))
    for solid, rows, own in _of_solids(hub, ids):
        found[rows] = solid.x0_of(own)
    return found


def volumes_before(hub: Scene, ids: np.ndarray) -> np.ndarray:
    """Return (n,) volumes of points before the first step."""
    found = np.empty(len(ids))
    for solid, rows, own in _of_solids(hub, ids):
        found[rows] = solid.volume0[own]
    return found


def _of_solids(hub: Scene, ids: np.ndarray) -> Iterator[tuple[Any, np.ndarray, np.ndarray]]:
    """Yield solids with some of these points: rows of these, and their numbers there."""
    order = np.argsort(ids)
    for solid in hub.solids.values():
        ends = solid.first_id, solid.first_id + solid.count
        rows = order[slice(*np.searchsorted(ids, ends, sorter=order))]
        if len(rows):
            yield solid, rows, ids[rows] - solid.first_id


def _column_of_laws(name: str, laws: Any) -> Callable | None:
    """Return what exports a number of each point that its law declares; None of others."""
    what = columns_of(laws).get(name)
    return None if what is None else partial(export, what, False)


def _column(field: np.ndarray, k: int) -> np.ndarray:
    if k >= field.shape[1]:
        return np.zeros(len(field))
    return field[:, k].astype(float)


def _von_mises(s: np.ndarray) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = s.T
    normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    return np.sqrt(0.5 * normal + 3 * (xy**2 + xz**2 + yz**2))
