"""Fixes that load the edge of a region: the faces that points show there."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from karamelo_py.output.point_table import from_solids, places_before
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import PointsView
from karamelo_py.scene.region import Region
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.forces import PointForces
from karamelo_py.styles.fixes.formulas import per_direction, vector

SIDES = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")


class Faces(NamedTuple):
    """Faces of points that lie on the edge of a region, before the first step."""

    point: np.ndarray  # (m,) numbers of the points, or their rows in a view
    axis: np.ndarray  # (m,) that the face is across
    sign: np.ndarray  # (m,) -1 or 1: the way out
    area: np.ndarray  # (m,) per radian around an axis
    middle: np.ndarray  # (m, d)

    def some(self, which: np.ndarray) -> Faces:
        return Faces(*(column[which] for column in self))


def faces_on(hub: Hub, region: Region, ids: np.ndarray) -> Faces:
    """The faces behind which a region ends, of the points `ids` inside it.

    Points are boxes; a face counts where a box of the same size beyond it would have its centre
    outside.
    """
    d = hub.domain.dimension
    x0 = places_before(hub, ids)
    half = from_solids(hub, ids, lambda solid, own: solid.half_size[own], d)
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


class EdgeFix(PointForces):
    """Base of fixes that load the edge of a region.

    Parameters
    ----------
    region
        ID of a region: that of a solid, or one that ends where the solid does.
    """

    side: int | None = None  # of `SIDES`, or all of them

    def __init__(self, hub: Hub, group: ParticleGroup, region: Region):
        super().__init__(hub, group)
        self.region = region
        # The points that were seen last, and their faces, by their rows there.
        self._seen: tuple[np.ndarray, Faces] | None = None

    def defined(self) -> None:
        """Warn where there is nothing to load; refuse boxes of points that a region has cut."""
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

    def loads(self, faces: Faces) -> np.ndarray:
        """The force (m, d) on each face."""
        raise NotImplementedError

    def forces(self, points: PointsView) -> np.ndarray:
        faces = self._faces_of(points.ids - 1)
        force = np.zeros(points.position.shape)
        np.add.at(force, faces.point, self.loads(faces))
        return force

    def _faces_of(self, ids: np.ndarray) -> Faces:
        """The faces of the points in a view, by their rows there; what was found stays known."""
        before, faces = self._seen or (ids[:0], self._find(ids[:0]))
        if self._seen is None or not np.array_equal(before, ids):
            new = self._find(np.setdiff1d(ids, before, assume_unique=True))
            known = faces._replace(point=before[faces.point])
            found = Faces(*map(np.concatenate, zip(new, known, strict=True)))
            found = found.some(np.isin(found.point, ids))
            # The forces on a point are added up in this order, whenever its faces were found.
            found = found.some(np.lexsort((found.sign, found.axis)))
            order = np.argsort(ids)
            rows = order[np.searchsorted(ids, found.point, sorter=order)]
            self._seen = ids.copy(), found._replace(point=rows)
        return self._seen[1]

    def _find(self, ids: np.ndarray) -> Faces:
        found = faces_on(self.hub, self.region, ids)
        loaded = found.area > 0  # not the axis
        if self.side is not None:
            loaded &= 2 * found.axis + (found.sign > 0) == self.side
        return found.some(loaded)


class EdgeTraction(EdgeFix):
    """Load one side of a region with a force per area.

    Parameters
    ----------
    side
        The side that is loaded, by the direction in which it looks: xlo and xhi for left and right,
        ylo and yhi, zlo and zhi.
    traction
        tx, ty, tz, as many as the domain has dimensions: force per area, numbers or formulas of x,
        y, z (the place of the edge before the first step), time and published values. NULL leaves a
        component alone.

    Example
    -------
    fix(pull, edge_traction, all, disk, xhi, 1e6*min(time/0.01, 1), 0, 0)

    Notes
    -----
    The group's points are boxes that fill the region; those that show a face to the outside in the
    direction of `side` bear the traction on the area that this face has before the first step. The
    load keeps size and direction (a dead load), the sum over a plane side is exactly traction times
    area, and it acts half a box inside the edge. Around an axis, area and force belong to a radian.
    Publishes the sum as ID_x, ID_y, ID_z.

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
        side: Literal[SIDES],
        *traction: Expression | None,
    ):
        super().__init__(hub, group, region)
        self.side = SIDES.index(side)
        self.traction = per_direction(hub, "t", traction)

    def loads(self, faces: Faces) -> np.ndarray:
        x = faces.middle
        return faces.area[:, None] * vector(self.traction, self.hub, x, lambda: x)


class EdgePressure(EdgeFix):
    """Press on the whole edge of a region.

    Parameters
    ----------
    p
        Pressure: a number or a formula of x, y, z (the place of the edge before the first step),
        time and published values.

    Example
    -------
    fix(cell, edge_pressure, all, disk, 1e5)

    Notes
    -----
    Each face that a point of the group shows to the outside of the region gets the pressure times
    the area that it has before the first step, inwards. Points are boxes, so that a curved edge has
    steps: the forces along each axis are those on the projected area, as they are on the smooth
    edge. They keep size and direction. A part of an edge is that of a region of its own:
    ``region(top, block, 0, 1, 0.9, 1)`` has other sides as well, where the group may have to end.
    Around an axis, forces belong to a radian. Publishes the sum as ID_x, ID_y, ID_z.

    See Also
    --------
    edge_traction, neumann_bc_mech, initial_stress
    """

    def __init__(self, hub: Hub, group: ParticleGroup, region: Region, p: Expression):
        super().__init__(hub, group, region)
        self.p = p

    def loads(self, faces: Faces) -> np.ndarray:
        force = np.zeros(faces.middle.shape)
        p = self.p.evaluate_points(self.hub.values, faces.middle, faces.middle)
        force[np.arange(len(force)), faces.axis] = -faces.sign * faces.area * p
        return force
