"""Fixes for heat flow through the edge of a region."""

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
    published = ("s", "area")

    def __init__(self, hub: Hub, group: ParticleGroup, region: Region, *formulas: Expression):
        super().__init__(hub, group, *formulas)
        self.region = region

    def cut_faces(self, solid: Solid, ids: np.ndarray) -> Faces | None:
        """Return faces on the surface, or None for meshes, which use the faces of points' boxes."""
        filled = isinstance(solid.places, Filled)
        return whole_faces(solid, self.region, ids) if filled else None

    def flows(self, points: PointsView, faces: Faces, values: list[np.ndarray]) -> np.ndarray:
        """Return the heating power (n,) of the points for `values` at the faces (m,)."""
        raise NotImplementedError

    def supply_heat(self, points: PointsView) -> None:
        faces = self.faces_at(points.ids - 1)
        x, published = faces.middle, self.hub.values
        heat = self.flows(
            points, faces, [f.evaluate_points(published, x, x) for f in self.formulas]
        )
        points.heat_supply = points.heat_supply + heat
        area = on_points(points, faces, faces.area)
        self.publish_all(points.total(heat), points.total(area))


def on_points(points: PointsView, faces: Faces, of_faces: np.ndarray) -> np.ndarray:
    return np.bincount(faces.point, of_faces, len(points.ids))


class EdgeHeatFlux(EdgeHeat):
    """Apply a heat flux to the edge of a region: lasers, flames, sunshine.

    Parameters
    ----------
    q
        Heat per unit area and unit time, negative if it leaves the body, a function of x, y, z
        (initial position of the edge), time and published values.

    Example
    -------
    fix(sun, edge_heat_flux, all, disk, 800)

    Notes
    -----
    Each point gets the heat that flows through the adjacent surface of the region. Areas are
    measured on the smooth surface at the start (for a mesh, on the faces of points). To load part
    of an edge, restrict the group, or set q to 0 elsewhere. Planes at the edge of the domain and
    symmetry planes are not loaded.

    Publishes the heating power as ID_s and the area as ID_area (in 2D per unit thickness, in
    axisymmetry per radian).

    See Also
    --------
    edge_convection, edge_pressure, heat_flux_particles, temperature_nodes
    """

    def __init__(self, hub: Hub, group: ParticleGroup, region: Region, q: Expression):
        super().__init__(hub, group, region, q)

    def flows(self, points: PointsView, faces: Faces, values: list[np.ndarray]) -> np.ndarray:
        return on_points(points, faces, faces.area * values[0])


class EdgeConvection(EdgeHeat):
    """Apply convection to the edge of a region: q = h (T_inf - T).

    Parameters
    ----------
    h
        Heat transfer coefficient, heat per unit area, time and kelvin, a function of x, y, z
        (initial position of the edge), time and published values.
    T_inf
        Temperature of the surrounding fluid, a function of the same quantities.

    Example
    -------
    fix(air, edge_convection, all, disk, 25, 293)

    Notes
    -----
    Areas are as in edge_heat_flux. T is the temperature at the surface at the end of the step, so
    that points are not cooled below the temperature of the fluid, however large h is. Publishes the
    heating power of all points as ID_s, and the area as ID_area.

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
        conducts = capacity > 0  # points of other materials without a temperature are excluded
        slower = 1 + rate * self.hub.values.get("dt") / np.where(conducts, capacity, 1.0)
        return np.where(conducts, (warms - rate * points.temperature) / slower, 0.0)


def _heat_capacities(solid: Solid, rows: np.ndarray) -> np.ndarray:
    return np.full(len(rows), float(heat_capacity(solid.material.law, 1.0)))
