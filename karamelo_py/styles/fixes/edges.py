"""Fixes that load the edge of a region, by faces of points."""

import itertools
from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, Literal, NamedTuple, TypeVar

import numpy as np

from karamelo_py.output.point_table import from_solids, places_before
from karamelo_py.scene.clipping import EDGE, surface
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, PointsView, per_direction
from karamelo_py.scene.region import Region
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.forces import PointForces
from karamelo_py.styles.fixes.formulas import vector

SIDES = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")
AT_ONCE = 4_000_000  # distances between faces and points that are computed at a time
PARTS = 4  # sub-boxes per direction of a box, to measure the surface


class Faces(NamedTuple):
    point: np.ndarray  # (m,) numbers of the points, or their rows in a view
    axis: np.ndarray  # (m,) normal to the face
    sign: np.ndarray  # (m,) outward direction along the axis, -1 or 1
    area: np.ndarray  # (m,) area, per radian in axisymmetry
    middle: np.ndarray  # (m, d) centre

    def some(self, which: np.ndarray) -> "Faces":
        return Faces(*(column[which] for column in self))


def faces_on(hub: Hub, region: Region, ids: np.ndarray) -> Faces:
    """Return the outer faces of the points `ids` inside a region.

    Points are boxes. A face is an outer one if the centre of the next box is outside the region.
    For boxes cut by a region, see `faces_cut`.
    """
    d = hub.domain.dimension
    if not len(ids):
        return Faces(ids, ids, ids, np.empty(0), np.empty((0, d)))
    x0 = places_before(hub, ids)
    half = from_solids(hub, ids, lambda solid, rows: solid.half_size[rows], d)
    faces = []
    inside = region.inside(x0)
    for axis in range(d):
        for sign in (-1, 1):
            out = np.zeros(d)
            out[axis] = sign
            rows = np.flatnonzero(inside & ~region.inside(x0 + 2 * half * out))
            middle = x0[rows] + half[rows] * out
            area = np.delete(2 * half[rows], axis, axis=1).prod(axis=1)
            area = area * hub.domain.depth(middle)
            ones = np.ones(len(rows), np.int64)
            faces.append(Faces(ids[rows], axis * ones, sign * ones, area, middle))
    return joined(faces)


class EdgePieces(NamedTuple):
    point: np.ndarray  # (m,) number of the point
    area: np.ndarray  # (m, d) area times outward normal
    length: np.ndarray  # (m,) area of a piece, counting both sides of an edge
    middle: np.ndarray


Columns = TypeVar("Columns", Faces, EdgePieces)


def joined(tables: Sequence[Columns]) -> Columns:
    return type(tables[0])(*map(np.concatenate, zip(*tables, strict=True)))


def surface_at(solid: Solid, region: Region, ids: np.ndarray) -> EdgePieces:
    """Return the surface at the points `ids` of a solid that fills `region`.

    The surface in a sub-box is assigned to the nearest point in this box or an adjacent one.
    """
    size, boxes, d = solid.h / solid.ppc, solid.places, solid.domain.dimension
    x0 = solid.x0_of(ids - solid.first_id)
    inside = region.inside(x0)
    ids, x0 = ids[inside], x0[inside]
    none = np.empty((0, d))
    pieces = [EdgePieces(np.empty(0, np.int64), none, np.empty(0), none)]
    if not len(ids):
        return pieces[0]
    corner = x0.min(axis=0) - 2.5 * size  # such that points of whole boxes are at box centres
    shape = tuple(((x0.max(axis=0) - corner) / size + 5).astype(np.int64))
    cells = np.ravel_multi_index(tuple(((x0 - corner) / size).astype(np.int64).T), shape)
    order = np.argsort(cells, kind="stable")
    cells = cells[order]
    for begin, end in boxes.chunks:
        x = boxes.candidates(begin, end)
        near = np.abs(region.depth(x, 2 * size)) < size * np.sqrt(d)
        near &= ((x > corner + size) & (x < corner + (np.array(shape) - 1) * size)).all(axis=1)
        x = in_parts(x[near], size)
        x = x[solid.domain.contains(x)]
        area, middle = surface(region, x, size / PARTS)
        at = ((x - corner) / size).astype(np.int64)
        nearest, taker = np.full(len(at), np.inf), np.full(len(at), -1)
        for step in itertools.product((-1, 0, 1), repeat=d):
            number = np.ravel_multi_index(tuple((at + step).T), shape, mode="clip")
            for k in (0, 1):  # a box may have two points, if one has absorbed a small neighbour
                row = np.minimum(np.searchsorted(cells, number) + k, len(cells) - 1)
                apart = np.linalg.norm(x0[order[row]] - middle, axis=1)
                nearer = (cells[row] == number) & (apart < nearest * (1 - 1e-9))
                nearest[nearer], taker[nearer] = apart[nearer], order[row[nearer]]
        kept = taker >= 0
        lengths = _lengths(region, x[kept], size / PARTS, area[kept])
        pieces.append(EdgePieces(ids[taker[kept]], area[kept], lengths, middle[kept]))
    return joined(pieces)


def in_parts(x: np.ndarray, size: float) -> np.ndarray:
    d = x.shape[1]
    places = (np.array(list(itertools.product(range(PARTS), repeat=d))) + 0.5) / PARTS - 0.5
    return (x[:, None, :] + size * places).reshape(-1, d)


def _lengths(region: Region, x: np.ndarray, size: float, area: np.ndarray) -> np.ndarray:
    lengths, d = np.linalg.norm(area, axis=1), x.shape[1]
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=d)))
    depth = region.depth((x[:, None, :] + size * corners).reshape(-1, d), 2 * size)
    depth = depth.reshape(-1, len(corners))
    slopes = depth @ corners / 2 ** (d - 2)
    mean = depth.mean(axis=1, keepdims=True)
    edge = np.abs(depth - mean - slopes @ corners.T).max(axis=1) > EDGE * size
    if edge.any():
        parts = in_parts(x[edge], size)
        of_parts = np.linalg.norm(surface(region, parts, size / PARTS)[0], axis=1)
        lengths[edge] = of_parts.reshape(-1, PARTS**d).sum(axis=1)
    return lengths


def faces_cut(solid: Solid, region: Region, ids: np.ndarray) -> Faces:
    """Return the faces of cut boxes: the surface, projected along each axis.

    Opposite projections within a sub-box cancel, except for their difference.
    """
    d, least = solid.domain.dimension, 1e-9 * (solid.h / solid.ppc) ** (solid.domain.dimension - 1)
    pieces = surface_at(solid, region, ids)
    none = np.empty(0, np.int64)
    faces = [Faces(none, none, none, np.empty(0), np.empty((0, d)))]
    for axis in range(d):
        some = np.flatnonzero(np.abs(pieces.area[:, axis]) > least)
        of_axis, centre = pieces.area[some, axis], pieces.middle[some]
        depth = solid.domain.depth(centre)
        signs, axes = np.sign(of_axis).astype(np.int64), np.full(len(some), axis)
        faces.append(Faces(pieces.point[some], axes, signs, np.abs(of_axis) * depth, centre))
    return joined(faces)


def whole_faces(solid: Solid, region: Region, ids: np.ndarray) -> Faces:
    pieces = surface_at(solid, region, ids)
    none = np.zeros(len(pieces.point), np.int64)
    area = pieces.length * solid.domain.depth(pieces.middle)
    return Faces(pieces.point, none, none, area, pieces.middle)


def faces_of_sheet(hub: Hub, sheet: np.ndarray, ids: np.ndarray, d: int) -> Faces:
    """Return pieces of the simplices (m, d, d), each with the nearest point."""
    none = np.zeros(0, np.int64)
    if not len(ids) or not len(sheet):
        return Faces(ids[:0], none, none, np.empty(0), np.empty((0, d)))
    x0 = places_before(hub, ids)
    size_of_part = from_solids(hub, ids, lambda solid, rows: solid.half_size[rows], d).min()
    edges = sheet[:, 1:] - sheet[:, :1]
    size = np.sqrt(np.maximum(np.linalg.det(edges @ edges.swapaxes(1, 2)), 0)) / max(d - 1, 1)
    longest = np.linalg.norm(edges, axis=2).max(axis=1) if d > 1 else np.zeros(len(sheet))
    counts, tables = np.ceil(longest / size_of_part - 1e-9).clip(1).astype(np.int64), []
    for count in np.unique(counts):
        parts, some = _parts_of_simplex(d, int(count)), counts == count
        middles = sheet[some, 0][:, None] + parts @ edges[some]
        tables.append((middles.reshape(-1, d), np.repeat(size[some] / len(parts), len(parts))))
    middle, size = (np.concatenate(column) for column in zip(*tables, strict=True))
    none = np.zeros(len(middle), np.int64)
    rows = [
        np.argmin(np.linalg.norm(batch[:, None] - x0, axis=2), axis=1)
        for batch in np.array_split(middle, len(middle) * len(ids) // AT_ONCE + 1)
    ]
    return Faces(ids[np.concatenate(rows)], none, none, size * hub.domain.depth(middle), middle)


def _parts_of_simplex(d: int, count: int) -> np.ndarray:
    """Return centres (n, d - 1) of `count`^(d - 1) equal pieces, as fractions of the edges."""
    if d < 3:
        return ((np.arange(count) + 0.5) / count)[:, None] if d == 2 else np.zeros((1, 0))
    i, j = np.divmod(np.arange(count * count), count)
    upright, turned = i + j < count, i + j < count - 1
    corners = np.stack([i, j], axis=1)
    return np.concatenate([corners[upright] + 1 / 3, corners[turned] + 2 / 3]) / count


class OnEdge(Fix):
    """Base of fixes on the edge of a region, through the faces of points there.

    Parameters
    ----------
    region
        ID of a solid's region, or of a region with the same edge as the solid.
    """

    group: ParticleGroup
    region: Region
    side: int | None = None  # index in `SIDES`; None: all sides
    _seen: tuple[np.ndarray, Faces] | None = None

    def defined(self) -> None:
        if not self.hub.rehearsing and not self.region.unknown:
            pieces = self.group.pieces()
            if len(self.group) and not any(len(self._find(ids).point) for ids in pieces):
                self.hub.warn(
                    f"no point of the group lies at this edge of region '{self.region.id}'",
                    hint="the region that the solid fills: its points lie inside, at the edge",
                )

    def faces_at(self, ids: np.ndarray) -> Faces:
        before, faces = self._seen or (ids[:0], self._find(ids[:0]))
        if self._seen is None or not np.array_equal(before, ids):
            new = self._find(np.setdiff1d(ids, before, assume_unique=True))
            cached = faces._replace(point=before[faces.point])
            faces = joined([new, cached])
            faces = faces.some(np.isin(faces.point, ids))
            # Sorting gives sums over the faces of a point a fixed order.
            faces = faces.some(np.lexsort((faces.sign, faces.axis)))
            order = np.argsort(ids)
            rows = order[np.searchsorted(ids, faces.point, sorter=order)]
            self._seen = ids.copy(), faces._replace(point=rows)
        return self._seen[1]

    def cut_faces(self, solid: Solid, ids: np.ndarray) -> Faces | None:
        """Return faces on the surface, or None if faces follow from the points' boxes."""
        return faces_cut(solid, self.region, ids) if solid.cut else None

    @cached_property
    def _cut(self) -> dict[str, tuple[Solid, Faces]]:
        members = np.concatenate([*self.group.pieces(), np.empty(0, np.int64)])
        by_solid = {}
        for solid in self.hub.solids.values():
            faces = self.cut_faces(solid, members[_of(solid, members)])
            if faces is not None:
                by_solid[solid.id] = solid, faces
        return by_solid

    @cached_property
    def _of_sheet(self) -> Faces:
        members = np.concatenate([*self.group.pieces(), np.empty(0, np.int64)])
        return faces_of_sheet(self.hub, self.region.sheet, members, self.hub.domain.dimension)

    def _find(self, ids: np.ndarray) -> Faces:
        if self.region.sheet is not None:
            return self._of_sheet.some(np.isin(self._of_sheet.point, ids))
        whole, tables = np.ones(len(ids), np.bool_), []
        for solid, faces in self._cut.values():
            whole &= ~_of(solid, ids)
            tables.append(faces.some(np.isin(faces.point, ids)))
        tables.append(faces_on(self.hub, self.region, ids[whole]))
        faces = joined(tables)
        loaded = faces.area > 0  # faces on the axis have no area
        if self.side is not None:
            loaded &= 2 * faces.axis + (faces.sign > 0) == self.side
        return faces.some(loaded)


class EdgeFix(OnEdge, PointForces):
    def __init__(self, hub: Hub, group: ParticleGroup, region: Region):
        super().__init__(hub, group)
        self.region = region

    def points_within(self) -> np.ndarray:
        return np.unique(np.concatenate([self._find(ids).point for ids in self.group.pieces()]))

    def loads(self, faces: Faces) -> np.ndarray:
        raise NotImplementedError

    def forces(self, points: PointsView) -> np.ndarray:
        faces = self.faces_at(points.ids - 1)
        loads = self.loads(faces)
        force = np.zeros((len(points.ids), loads.shape[1]))
        np.add.at(force, faces.point, loads)
        return force


def _of(solid: Solid, ids: np.ndarray) -> np.ndarray:
    return (ids >= solid.first_id) & (ids < solid.first_id + solid.count)


class EdgeTraction(EdgeFix):
    """Apply a traction (force per unit area) to one side of a region.

    Parameters
    ----------
    side
        The loaded side, named by its outward direction; or ``all`` faces of a set in a mesh file.
    traction
        tx, ty, tz, one per dimension: functions of x, y, z (initial position of the edge), time and
        published values. NULL leaves a component unchanged. With axisymmetric(true, twist=true), tz
        acts around the axis.

    Example
    -------
    fix(pull, edge_traction, all, disk, xhi, 1e6*min(time/0.01, 1), 0, 0)

    Notes
    -----
    Publishes the total force as ID_x, ID_y, ID_z; with twist, ID_z is the torque about the axis.

    Points are boxes that fill the region. Each point with an outer face in the direction of `side`
    gets the traction times the initial area of this face, as a dead load (magnitude and direction
    do not follow the deformation). The force acts at the point, half a box inside the edge. On a
    plane side, the total force is exactly traction times area. Faces of a hole are loaded too: for
    a plate with a hole, use the region without the hole. Axisymmetric: per radian.

    A set of faces in a mesh file loads the nearest points of the group: ``region(top, mesh,
    deck.inp, TOP)`` and ``fix(lid, edge_traction, all, top, all, 0, -1e3)``.

    See Also
    --------
    edge_pressure, neumann_bc_mech, force_particles
    """

    syntax = "group, region, side, tx[, ty[, tz]]"

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        region: Region,
        side: Annotated[str, Literal[*SIDES, "all"]],
        *traction: Expression | None,
    ):
        super().__init__(hub, group, region)
        if (side == "all") != (region.sheet is not None):
            kind = "is not a set of faces" if side == "all" else "is a set of faces"
            raise ScriptError(
                f"region '{region.id}' {kind}",
                argument="side",
                expected=", ".join(SIDES) if side == "all" else "all",
            )
        self.side = None if side == "all" else SIDES.index(side)
        self.components = per_direction(hub, "t", traction, around=True)

    def loads(self, faces: Faces) -> np.ndarray:
        x = faces.middle
        return faces.area[:, None] * vector(self.components, self.hub, x, lambda: x)

    def forces(self, points: PointsView) -> np.ndarray:
        force = super().forces(points)
        if force.shape[1] > points.position.shape[1]:
            # The tractions act at the faces, half a box outside the points.
            faces = self.faces_at(points.ids - 1)
            torque = np.zeros(len(force))
            np.add.at(torque, faces.point, faces.middle[:, 0] * self.loads(faces)[:, 2])
            force[:, 2] = torque / points.reference_position[:, 0]
        return force


class EdgePressure(EdgeFix):
    """Apply a pressure to the whole edge of a region.

    Parameters
    ----------
    p
        Pressure, a function of x, y, z (initial position of the edge), time and published values.

    Example
    -------
    fix(cell, edge_pressure, all, disk, 1e5)

    Notes
    -----
    Publishes the total force as ID_x, ID_y, ID_z.

    The pressure acts inwards on the initial area of each outer face of the points' boxes, with
    constant magnitude and direction. Points approximate a curved edge by steps, but the force along
    each axis (pressure times projected area) is correct. With points=cut, each point gets the force
    on the smooth edge. In axisymmetry, forces are per radian.

    To load part of an edge, define a separate region, such as ``region(top, block, 0, 1, 0.9, 1)``,
    and a group without points at its other sides.

    See Also
    --------
    edge_traction, neumann_bc_mech, initial_stress
    """

    def __init__(self, hub: Hub, group: ParticleGroup, region: Region, p: Expression):
        super().__init__(hub, group, region)
        if region.sheet is not None:
            raise ScriptError(
                f"region '{region.id}' is a set of faces, whose outer side is unknown",
                argument="region",
                expected="the region of the solid",
                hint="fix edge_traction, ..., all, tx, ty loads a set of faces",
            )
        self.pressure = p

    def loads(self, faces: Faces) -> np.ndarray:
        force = np.zeros(faces.middle.shape)
        p = self.pressure.evaluate_points(self.hub.values, faces.middle, faces.middle)
        force[np.arange(len(force)), faces.axis] = -faces.sign * faces.area * p
        return force
