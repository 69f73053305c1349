"""Base of fixes that load the edge of a region: the faces that points show there."""

from typing import NamedTuple

import numpy as np

from karamelo_py.kernels.p2g import Force
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, PointsView
from karamelo_py.scene.region import Region
from karamelo_py.script.errors import ScriptError

SIDES = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")


class Faces(NamedTuple):
    """Faces of points that lie on the edge of a region, before the first step."""

    point: np.ndarray  # (m,) numbers of the points, or their rows in a view
    axis: np.ndarray  # (m,) that the face is across
    sign: np.ndarray  # (m,) -1 or 1: the way out
    area: np.ndarray  # (m,) per radian around an axis
    middle: np.ndarray  # (m, d)


def faces_on(hub: Hub, region: Region, ids: np.ndarray) -> Faces:
    """The faces behind which a region ends, of the points `ids` inside it.

    Points are boxes; a face counts where a box of the same size beyond it would have its centre
    outside.
    """
    solids = list(hub.solids.values())
    d = hub.domain.dimension
    x0, half = np.empty((len(ids), d)), np.empty((len(ids), d))
    for solid in solids:
        rows = np.flatnonzero((ids >= solid.first_id) & (ids < solid.first_id + solid.count))
        own = ids[rows] - solid.first_id
        x0[rows], half[rows] = solid.x0_of(own), solid.half_size[own]
    found = []
    inside = region.inside(x0)
    for axis in range(d):
        for sign in (-1, 1):
            out = np.zeros(d)
            out[axis] = sign
            rows = np.flatnonzero(inside & ~region.inside(x0 + 2 * half * out))
            middle = x0[rows] + half[rows] * out
            area = np.delete(2 * half[rows], axis, axis=1).prod(axis=1)
            if hub.domain.axisymmetric:
                area = area * middle[:, 0]
            ones = np.ones(len(rows), np.int64)
            found.append(Faces(ids[rows], axis * ones, sign * ones, area, middle))
    return Faces(*(np.concatenate(columns) for columns in zip(*found, strict=True)))


class EdgeFix(Fix):
    """Base of fixes that load the edge of a region.

    Parameters
    ----------
    region
        ID of a region: that of a solid, or one that ends where the solid does.
    """

    published: tuple[str, ...] = ("x", "y", "z")
    point_fields = (Force,)
    point_by_point = True

    def __init__(self, hub: Hub, group: ParticleGroup, region: Region):
        super().__init__(hub, group)
        self.region = region
        # The points that were seen last, and their faces, by their rows there.
        self._seen: tuple[np.ndarray, Faces] | None = None

    def defined(self) -> None:
        """Warn where there is nothing to load.

        Raises
        ------
        ScriptError
            If a region has cut the boxes of points.
        """
        for solid in self.hub.solids.values():
            if getattr(solid, "cut", False) and self.group.touches(solid):
                raise ScriptError(
                    f"the points of solid '{solid.id}' are cut at its edge: no faces are whole",
                    hint="points=regular in its line",
                )
        if not self.hub.rehearsing and not self.region.unknown:
            pieces = self.group.pieces()
            if len(self.group) and not any(len(self._find(ids).point) for ids in pieces):
                self.hub.warn(
                    f"no point of the group lies at this edge of region '{self.region.id}'"
                )

    def chosen(self, faces: Faces) -> Faces:
        """Those of the faces that are loaded."""
        return faces

    def loads(self, faces: Faces) -> np.ndarray:
        """The force (m, d) on each face."""
        raise NotImplementedError

    def initial_integrate(self, points: PointsView) -> None:
        """Give the points their forces, and publish the sum."""
        faces = self._faces_of(points.ids)
        force = np.zeros(points.position.shape)
        np.add.at(force, faces.point, self.loads(faces))
        points.force = points.force + force
        self.publish_components(points.total(force))

    def _faces_of(self, ids: np.ndarray) -> Faces:
        """The faces of the points in a view, by their rows there; what was found stays known."""
        before, faces = self._seen or (ids[:0], self._find(ids[:0]))
        if self._seen is None or not np.array_equal(before, ids):
            new = self._find(np.setdiff1d(ids, before, assume_unique=True))
            known = faces._replace(point=before[faces.point])
            found = Faces(*map(np.concatenate, zip(new, known, strict=True)))
            found = _some(found, np.isin(found.point, ids))
            # The forces on a point are added up in this order, whenever its faces were found.
            found = _some(found, np.lexsort((found.sign, found.axis)))
            order = np.argsort(ids)
            rows = order[np.searchsorted(ids, found.point, sorter=order)]
            self._seen = ids.copy(), found._replace(point=rows)
        return self._seen[1]

    def _find(self, ids: np.ndarray) -> Faces:
        return self.chosen(faces_on(self.hub, self.region, ids))


def _some(faces: Faces, which: np.ndarray) -> Faces:
    return Faces(*(column[which] for column in faces))
