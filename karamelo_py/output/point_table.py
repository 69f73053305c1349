"""Tables of points."""

from collections.abc import Callable, Iterator, Set
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.kernels import export
from karamelo_py.kernels.arrays import (
    TIMESTEP,
    Block,
    Matter,
    OnGrids,
    Points,
    Setup,
    known_to_laws,
    some_of,
)
from karamelo_py.kernels.equations.move import VelocityBefore
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.twist import rotating
from karamelo_py.language.scene import Scene
from karamelo_py.points.grid import ReflectingGrid
from karamelo_py.points.laws import columns_of
from karamelo_py.points.transfers import Moment

AXES = "xyz"
COMPONENTS = ("11", "22", "33", "12", "13", "23")
VECTORS = {
    f"{before}{axis}{after}": (vector, k)
    for before, after, vector in (
        ("", "", "position"), ("", "0", "reference_position"), ("v", "", "velocity")
    )
    for k, axis in enumerate(AXES)
}  # fmt: skip


class Part(NamedTuple):
    block: Block
    rows: np.ndarray | None  # ascending rows of the points; None: all points of the block
    places: np.ndarray | slice

    def taken(self, array: np.ndarray) -> np.ndarray:
        whole = self.rows is None or len(self.rows) == array.shape[-1]
        return array if whole else fields.some_points(array, self.rows)

    @property
    def points(self) -> Points:
        return self.block.points if self.rows is None else some_of(self.block, self.rows).points


class Rows(NamedTuple):
    s: Setup
    parts: list[Part]
    ids: np.ndarray
    present: np.ndarray
    comm: Any = None  # communicator of the processes that hold parts of the table

    def of_all(self, local: list[tuple]) -> Iterator[tuple]:
        if self.comm is None:
            yield from local
        else:
            yield from (one for of_rank in self.comm.allgather(local) for one in of_rank)

    def take(self, of: Callable[[Points], np.ndarray]) -> np.ndarray:
        """Return a field, with zeros for deleted points."""
        local = [(piece.places, piece.taken(of(piece.block.points))) for piece in self.parts]
        field = np.zeros((*local[0][1].shape[:-1], len(self.ids)), local[0][1].dtype)
        return self._filled(field, local)

    def _filled(self, field: np.ndarray, local: list[tuple]) -> np.ndarray:
        for places, array in self.of_all(local):
            field[..., places] = array
        return field.T

    def put(self, of: Callable[[Points], np.ndarray], values: np.ndarray) -> None:
        for block, rows, places in self.parts:
            of(block.points)[..., slice(None) if rows is None else rows] = values[places].T

    def declared(self, kind: type) -> np.ndarray | None:
        """Return a declared field (n, components), or None if no block stores it.

        Where a law lacks the field, points get its initial values.
        """
        arrays = [(piece, fields.field(piece.block.points.fields, kind)) for piece in self.parts]
        if all(array is None for _, array in arrays):
            return None
        field = fields.at_points(kind, self.s.kin, len(self.ids), float).array
        local = [(piece.places, piece.taken(array)) for piece, array in arrays if array is not None]
        return self._filled(field, local)

    def computed(self, of: Callable[[Block], Callable | None], *columns: int) -> np.ndarray:
        """Return values (n, *columns) of ``of(laws)(matter, rows)``, 0 if ``of(laws)`` is None."""
        local, s = [], self.s
        for piece in self.parts:
            points = known_to_laws(piece.points)
            # Skip empty arrays: their type differs, so the function would be compiled again.
            if len(points.id) and (fill := of(piece.block.laws)):
                rows = np.zeros((len(points.id), *columns))
                fill(Matter(s.kin, points, piece.block.laws), rows)
                local.append((piece.places, rows.T))
        return self._filled(np.zeros((*columns, len(self.ids))), local)


class PointTable:
    """Arrays and columns of points, ordered by id: copies, with 0 for deleted points."""

    def __init__(self, hub: Scene, rows: Rows):
        self.hub = hub
        self._rows = rows
        self._cache: dict[str, np.ndarray] = {}

    def _cached(self, name: str, make: Callable[[Rows], np.ndarray]) -> np.ndarray:
        rows = self._rows  # clears the cache after a step
        if name not in self._cache:
            self._cache[name] = make(rows)
        return self._cache[name]

    @property
    def numbers(self) -> np.ndarray:
        """Numbers (n,) of the points, from 0."""
        return self._rows.ids

    @property
    def ids(self) -> np.ndarray:
        """Ids (n,) of the points, from 1, as in dumps."""
        return self.numbers + 1

    @property
    def count(self) -> int:
        return len(self._rows.ids)

    @property
    def present(self) -> np.ndarray:
        """Mask (n,) that is False for deleted points."""
        return self._rows.present

    @property
    def position(self) -> np.ndarray:
        """Positions (n, d) of the points."""
        return self._cached("x", lambda rows: rows.take(partial(_place, rows.s)))

    @property
    def velocity(self) -> np.ndarray:
        """Velocities (n, d) of the points."""
        return self._cached("v", lambda rows: rows.take(partial(shown_velocity, rows.s)))

    @property
    def mass(self) -> np.ndarray:
        return self._cached("mass", lambda rows: rows.take(lambda points: points.mass))

    @property
    def reference_position(self) -> np.ndarray:
        """Positions (n, d) of the points before the first step."""
        return self._cached("x0", lambda rows: places_before(self.hub, rows.ids))

    @property
    def reference_volume(self) -> np.ndarray:
        """Volumes (n,) of the points before the first step."""
        return self._cached("V0", lambda rows: volumes_before(self.hub, rows.ids))

    @property
    def solid(self) -> np.ndarray:
        """Numbers (n,) of the points' solids, from 0."""
        firsts = [solid.first_id for solid in self.hub.solids.values()]
        return (np.searchsorted(firsts, self.numbers, side="right") - 1).astype(np.int32)

    @property
    def velocity_moment(self) -> np.ndarray | None:
        """Sums of N v (X - x), (n, d d), if the transfer stores them; otherwise None.

        The vectors X - x are in the present state: in the total frame, F times reference vectors.
        """
        rows = self._rows
        have = [
            piece
            for piece in rows.parts
            if fields.field(piece.block.points.fields, Moment) is not None
        ]
        if not have:
            return None
        local = [(piece.places, _velocity_moment(rows.s, piece)) for piece in have]
        return rows._filled(np.zeros((Moment.shape(rows.s.kin), len(rows.ids))), local)

    def declared(self, kind: type) -> np.ndarray | None:
        return self._rows.declared(kind)

    def columns_of_laws(self) -> set[str]:
        laws = [material.law for material in self.hub.materials.values()]
        return {name for law in laws for name in columns_of(law)}

    def particle(self, name: str) -> np.ndarray:
        """Return a column (n,) of existing points, 0 if the scene lacks it (as in Karamelo)."""
        values, present = self._particle(name), self.present
        return values if present.all() else values[present]

    def _particle(self, name: str) -> np.ndarray:
        if (show := COLUMNS.get(name)) is not None:
            return show(self)
        if name in self.columns_of_laws() or name == "epdot":
            shown = partial(_column_of_laws, name)
            return self._cached(name, lambda rows: rows.computed(shown)).copy()
        if name in (of_fields := declared_columns(self.hub, "point_fields")):
            kind, k = of_fields[name]
            if (array := self._rows.declared(kind)) is not None:
                return _column(kind.shown(array, self), k)
        elif name in named_sets(self.hub):
            return members(self.hub, name, self.numbers)
        return np.zeros(self.count)

    @property
    def _exported(self) -> np.ndarray:
        # Component 12 of 2D is also the fourth component.
        return self._cached(
            "exported",
            lambda rows: rows.computed(lambda laws: export.export_state, export.EXPORTED),
        )


def owners_of_fields(hub: Scene, contact: object = None) -> list:
    update, method = hub.update, hub.update.method
    heat = Conducting if update.thermal else None
    grids = ReflectingGrid if update.boundary == "reflect" else None
    of_method = [None] * 4
    if method is not None:
        of_method = [method.frame, method.averaging(hub), method.basis, method]
    frame, averaging, *others = of_method
    owners = [frame, update.transfer, averaging, contact, heat, grids]
    materials = [solid.material for solid in hub.solids.values()]
    if hub.domain is not None:
        owners += rotating(hub.domain.kin, update.transfer)
    owners += [hub.domain, *hub.fixes.values(), *hub.computes.values()]
    owners += [update, update.scheme, *others]
    return [*owners, *(part for one in materials for part in (one.law, one.fluid))]


def declared_columns(hub: Scene, attribute: str) -> dict[str, tuple[type[fields.Field], int]]:
    columns: dict[str, tuple[type[fields.Field], int]] = {}
    for kind in fields.declared(owners_of_fields(hub), attribute):
        for k, column in enumerate(kind.columns):
            columns.setdefault(column, (kind, k))
    return columns


def named_sets(hub: Scene) -> list[str]:
    """Return the names of groups and solids, which serve as columns."""
    groups = [name for name, group in hub.groups.items() if group.kind == "particles"]
    return [*groups, *hub.solids]


def members(hub: Scene, name: str, numbers: np.ndarray) -> np.ndarray:
    """Return 1 for each point in `numbers` (n,) that is in the group or solid, else 0."""
    if name in hub.groups:
        return hub.groups[name].has(numbers).astype(float)
    solid = hub.solids[name]
    return ((numbers >= solid.first_id) & (numbers < solid.first_id + solid.count)).astype(float)


def absent(columns: dict[str, Callable | None], present: Set[str] = frozenset()) -> list[str]:
    return [name for name, show in columns.items() if show is None and name not in present]


def _place(s: Setup, points: Points) -> np.ndarray:
    return points.x[s.control.motion[0].now][: s.kin.dimension]


def shown_velocity(s: Setup, points: Points) -> np.ndarray:
    """Return the velocities (d, n) of points for output.

    If points store accelerations, velocities and positions have the same time.

    Otherwise velocities are half a step earlier than positions.
    """
    before = fields.field(points.fields, VelocityBefore)
    if before is None:
        return points.v
    ahead = 1.0 if s.control.values[TIMESTEP] == 1 else 0.5
    return np.where(np.isnan(before), points.v, points.v + ahead * (points.v - before))


def _velocity_moment(s: Setup, piece: Part) -> np.ndarray:
    points = piece.points
    kept = fields.field(points.fields, Moment)
    moment = kept[: Moment.shape(s.kin)].copy()
    if s.transfer.traits.keeps_gradient:
        where = points.x[s.control.motion[0].now] if points.home is None else points.home
        at = OnGrids(s.basis, s.kin, s.grids, points.grid, where)
        export.export_velocity_moment(at, kept, moment)
    if not s.frame.moves:
        export.move_moments(s.frame, s.kin, points, piece.block.laws, moment)
    return moment


def places_before(hub: Scene, ids: np.ndarray) -> np.ndarray:
    return from_solids(hub, ids, lambda solid, numbers: solid.x0_of(numbers), hub.domain.dimension)


def volumes_before(hub: Scene, ids: np.ndarray) -> np.ndarray:
    return from_solids(hub, ids, lambda solid, numbers: solid.volume0[numbers])


def from_solids(hub: Scene, ids: np.ndarray, of: Callable, *columns: int) -> np.ndarray:
    gathered, order = np.empty((len(ids), *columns)), np.argsort(ids)
    for solid in hub.solids.values():
        ends = solid.first_id, solid.first_id + solid.count
        rows = order[slice(*np.searchsorted(ids, ends, sorter=order))]
        if len(rows):
            gathered[rows] = of(solid, ids[rows] - solid.first_id)
    return gathered


def _column_of_laws(name: str, laws: NamedTuple) -> Callable | None:
    number = columns_of(laws).get(name)
    return None if number is None else partial(export.export, number, False)


def _column(field: np.ndarray, k: int) -> np.ndarray:
    return np.zeros(len(field)) if k >= field.shape[1] else field[:, k].astype(float)


def _von_mises(s: np.ndarray) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = s.T
    normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    return np.sqrt(0.5 * normal + 3 * (xy**2 + xz**2 + yz**2))


def _of_vector(attribute: str, axis: int, table: PointTable) -> np.ndarray:
    return _column(getattr(table, attribute), axis)


def _volume(table: PointTable) -> np.ndarray:
    return table.reference_volume * table._exported[:, export.JACOBIAN]


def _exported(k: int, table: PointTable) -> np.ndarray:
    return table._exported[:, k].copy()


def _total_stress(k: int, table: PointTable) -> np.ndarray:
    """Return the total stress (n,) of soil and water; saturation weights p (Bishop 1959)."""
    load = table._particle("saturation") * table._particle("pore_pressure") if k < 3 else 0.0
    return table._exported[:, k] - load


# None: the column exists only with certain materials or fields; otherwise it is 0, as in Karamelo.
COLUMNS: dict[str, Callable[[PointTable], np.ndarray] | None] = {
    "id": lambda table: table.ids,
    "type": lambda table: table.solid + 1,
    **{name: partial(_of_vector, *where) for name, where in VECTORS.items()},
    **{f"s{name}": partial(_exported, k) for k, name in enumerate(COMPONENTS)},
    **{f"t{name}": partial(_total_stress, k) for k, name in enumerate(COMPONENTS)},
    **{f"e{name}": partial(_exported, export.STRAIN + k) for k, name in enumerate(COMPONENTS)},
    "seq": lambda table: _von_mises(table._exported[:, : export.STRAIN]),
    "p": lambda table: -table._exported[:, :3].sum(axis=1) / 3,
    "rho": lambda table: table.mass / _volume(table),
    "volume": _volume,
    "mass": lambda table: table.mass.astype(float),
    **dict.fromkeys(("damage", "damage_init", "bx", "by", "bz", "ep", "epdot", "T")),
    "ienergy": partial(_exported, export.ENERGY),
    "gamma": None,
}
