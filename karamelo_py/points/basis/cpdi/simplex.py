"""CPDI on triangles (T3) and tetrahedra (Tet4) whose corners go with the velocity of the grid."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler.compile import real
from karamelo_py.points.basis.cpdi import domain
from karamelo_py.points.basis.cpdi.corners import register_carried, upright
from karamelo_py.points.basis.cpdi.initial import element_corners, turned
from karamelo_py.points.kinematics import Axisymmetric, PlaneStrain, Space


class T3(NamedTuple):
    """Triangles of a mesh: three corners, each with a third of the weight.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, T3)
    """

    dimension = 2
    cells = 3
    nodes_per_cell = 1
    least_nodes = 2
    steady_moment = True
    steep_edge = False
    element = "triangle"  # of a mesh

    @staticmethod
    def shapes(kin: Any, solid: Any) -> np.ndarray:
        """Corners (n, 6), counter-clockwise."""
        places = element_corners(solid)
        x1, y1, x2, y2, x3, y3 = places.T
        area = (x2 - x1) * (y3 - y1) - (x3 - x1) * (y2 - y1)
        return turned(places, area < 0, [0, 2, 1], 2)


class Tet4(NamedTuple):
    """Tetrahedra of a mesh: four corners, each with a quarter of the weight.

    The choice of Sinaie et al. 2017 for the cantilever.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, Tet4)
    """

    dimension = 3
    cells = 3
    nodes_per_cell = 1
    least_nodes = 2
    steady_moment = True
    steep_edge = False
    element = "tetra"  # of a mesh

    @staticmethod
    def shapes(kin: Any, solid: Any) -> np.ndarray:
        """Corners (n, 12) of tetrahedra with a positive volume."""
        places = element_corners(solid)
        x = places.reshape(-1, 4, 3)
        volume = np.linalg.det(x[:, 1:] - x[:, :1])
        return turned(places, volume < 0, [0, 2, 1, 3], 3)


@domain.on(T3, PlaneStrain)
@domain.on(T3, Axisymmetric)
def _(basis, kin, place):
    x1, y1, x2, y2, x3, y3 = place[2:]
    ax, ay, bx, by = x2 - x1, y2 - y1, x3 - x1, y3 - y1
    k = real(1, x1) / (ax * by - bx * ay)
    g2, g3 = (k * by, -(k * bx)), (-(k * ay), k * ax)
    w = real(1 / 3, x1)
    return (
        ((x1, y1), (x2, y2), (x3, y3)),
        (w, w, w),
        ((-g2[0] - g3[0], -g2[1] - g3[1]), g2, g3),
    )


@upright.on(T3)
def _(basis, kin, place):
    x1, y1, x2, y2, x3, y3 = place[2:]
    return (x2 - x1) * (y3 - y1) - (x3 - x1) * (y2 - y1) > 0


@domain.on(Tet4, Space)
def _(basis, kin, place):
    x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4 = place[3:]
    ax, ay, az = x2 - x1, y2 - y1, z2 - z1
    bx, by, bz = x3 - x1, y3 - y1, z3 - z1
    cx, cy, cz = x4 - x1, y4 - y1, z4 - z1
    px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    k = real(1, x1) / (ax * px + ay * py + az * pz)
    p = (k * px, k * py, k * pz)
    q = (k * (cy * az - cz * ay), k * (cz * ax - cx * az), k * (cx * ay - cy * ax))
    r = (k * (ay * bz - az * by), k * (az * bx - ax * bz), k * (ax * by - ay * bx))
    w = real(0.25, x1)
    return (
        ((x1, y1, z1), (x2, y2, z2), (x3, y3, z3), (x4, y4, z4)),
        (w, w, w, w),
        ((-p[0] - q[0] - r[0], -p[1] - q[1] - r[1], -p[2] - q[2] - r[2]), p, q, r),
    )


@upright.on(Tet4)
def _(basis, kin, place):
    x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4 = place[3:]
    bx, by, bz = x3 - x1, y3 - y1, z3 - z1
    cx, cy, cz = x4 - x1, y4 - y1, z4 - z1
    px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    return (x2 - x1) * px + (y2 - y1) * py + (z2 - z1) * pz > 0


register_carried(T3, 2, 3)
register_carried(Tet4, 3, 4)
