"""What fixes share that load the edge of a region: the faces that points show there."""

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

    point: np.ndarray  # (m,) rows of the group's points
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
    if not solids:
        none = np.zeros(0, np.int64)
        return Faces(none, none, none, np.zeros(0), np.zeros((0, hub.domain.dimension)))
    x0 = np.concatenate([solid.x0 for solid in solids])[ids]
    half = np.concatenate([solid.half_size for solid in solids])[ids]
    d = x0.shape[1]
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
            found.append(Faces(rows, axis * ones, sign * ones, area, middle))
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

    def __init__(self, hub: Hub, group: ParticleGroup, region: Region):
        super().__init__(hub, group)
        self.region = region
        self._known: tuple[np.ndarray, Faces] | None = None

    def defined(self) -> None:
        """Warn where there is nothing to load.

        Raises
        ------
        ScriptError
            If a region has cut the boxes of points.
        """
        for solid in self.hub.solids.values():
            own = self.group.ids - solid.first_id
            if getattr(solid, "cut", False) and ((own >= 0) & (own < solid.count)).any():
                raise ScriptError(
                    f"the points of solid '{solid.id}' are cut at its edge: no faces are whole",
                    hint="points=regular in its line",
                )
        if not self.hub.rehearsing and not self.region.unknown:
            faces = self.chosen(faces_on(self.hub, self.region, self.group.ids))
            if len(self.group.ids) and not len(faces.point):
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
        if self._known is None or not np.array_equal(self._known[0], points.ids):
            faces = faces_on(self.hub, self.region, points.ids)
            self._known = points.ids.copy(), self.chosen(faces)
        faces = self._known[1]
        force = np.zeros(points.position.shape)
        np.add.at(force, faces.point, self.loads(faces))
        points.force = points.force + force
        self.publish_components(force.sum(axis=0))
