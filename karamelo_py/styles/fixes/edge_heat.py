"""Fixes that let heat flow through the edge of a region: by the area of its surface."""

import numpy as np

from karamelo_py.output.point_table import from_solids
from karamelo_py.points.laws import heat_capacity
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import PointsView
from karamelo_py.scene.placement import Filled
from karamelo_py.scene.region import Region
from karamelo_py.scene.solid import Solid
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.edges import Faces, OnEdge, whole_faces
from karamelo_py.styles.fixes.heat import HeatFix, check_coefficient


class EdgeHeat(OnEdge, HeatFix):
    """Base of fixes that let heat flow through the edge of a region."""

    published = ("s", "area")

    def __init__(self, hub: Hub, group: ParticleGroup, region: Region, *formulas: Expression):
        super().__init__(hub, group, *formulas)
        self.region = region

    def cut_faces(self, solid: Solid, ids: np.ndarray) -> Faces | None:
        """Find the faces by the surface of the region; those of meshes by the boxes of points."""
        filled = isinstance(solid.places, Filled)
        return whole_faces(solid, self.region, ids) if filled else None

    def flows(self, points: PointsView, faces: Faces, values: list[np.ndarray]) -> np.ndarray:
        """The heat per time (n,) that points get by the values of formulas at the faces (m,)."""
        raise NotImplementedError

    def supply_heat(self, points: PointsView) -> None:
        """Give the points their heat, and publish the sum and the area."""
        faces = self.faces_of(points.ids - 1)
        x, known = faces.middle, self.hub.values
        heat = self.flows(points, faces, [f.evaluate_points(known, x, x) for f in self.formulas])
        points.heat_supply = points.heat_supply + heat
        area = on_points(points, faces, faces.area)
        self.publish_all(points.total(heat), points.total(area))


def on_points(points: PointsView, faces: Faces, of_faces: np.ndarray) -> np.ndarray:
    """Sum numbers of faces (m,) at their points (n,)."""
    return np.bincount(faces.point, of_faces, len(points.ids))


class EdgeHeatFlux(EdgeHeat):
    """Let heat flow through the edge of a region: lasers, flames, sunshine.

    Parameters
    ----------
    q
        Heat per area and time, negative where it leaves the body: a number or a formula of x, y, z
        (the place of the edge before the first step), time and published values.

    Example
    -------
    fix(sun, edge_heat_flux, all, disk, 800)

    Notes
    -----
    Each point gets the heat through the part of the region's surface next to it. The area is that
    of the smooth surface before the first step (of a mesh, that of the faces of its points). For a
    part of an edge end the group there, or let q be 0 elsewhere. Where the region ends at the edge
    of the domain or along a plane of symmetry, let it reach beyond: that is no surface then.

    Publishes the heat per time as ID_s and the area as ID_area (in 2D per thickness, per radian
    where axisymmetric).

    See Also
    --------
    edge_convection, edge_pressure, heat_flux_particles, temperature_nodes
    """

    def __init__(self, hub: Hub, group: ParticleGroup, region: Region, q: Expression):
        super().__init__(hub, group, region, q)

    def flows(self, points: PointsView, faces: Faces, values: list[np.ndarray]) -> np.ndarray:
        return on_points(points, faces, faces.area * values[0])


class EdgeConvection(EdgeHeat):
    """Cool or heat the edge of a region by a fluid around it: q = h (T_inf - T).

    Parameters
    ----------
    h
        Heat transfer coefficient, heat per area, time and kelvin: a number or a formula of x, y, z
        (the place of the edge before the first step), time and published values.
    T_inf
        Temperature of the fluid; a number or a formula likewise.

    Example
    -------
    fix(air, edge_convection, all, disk, 25, 293)

    Notes
    -----
    The area is that of edge_heat_flux. T is the temperature of the points next to the surface after
    the step, so that no coefficient cools them below the fluid. Publishes the heat per time that
    all points get as ID_s, and the area as ID_area.

    See Also
    --------
    edge_heat_flux, convection_particles, temperature_nodes
    """

    def __init__(
        self, hub: Hub, group: ParticleGroup, region: Region, h: Expression, T_inf: Expression
    ):
        super().__init__(hub, group, region, h, T_inf)
        self._compare(T_inf)
        check_coefficient(h)

    def flows(self, points: PointsView, faces: Faces, values: list[np.ndarray]) -> np.ndarray:
        h, T_inf = values
        rate = on_points(points, faces, faces.area * h)
        warms = on_points(points, faces, faces.area * h * T_inf)
        capacity = points.mass * from_solids(self.hub, points.ids - 1, _heat_capacities)
        there = capacity > 0  # points of other materials have no temperature
        slower = 1 + rate * self.hub.values.get("dt") / np.where(there, capacity, 1.0)
        return np.where(there, (warms - rate * points.temperature) / slower, 0.0)


def _heat_capacities(solid: Solid, own: np.ndarray) -> np.ndarray:
    return np.full(len(own), float(heat_capacity(solid.material.law, 1.0)))
