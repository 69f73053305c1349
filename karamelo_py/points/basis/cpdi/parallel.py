"""CPDI proper: parallelograms (R4) and parallelepipeds (R8) that deform with the point."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler.compile import define, point_function, real
from karamelo_py.points.basis import blank, deformed, extent
from karamelo_py.points.basis.cpdi import domain
from karamelo_py.points.basis.cpdi.corners import KINEMATICS, register
from karamelo_py.points.basis.cpdi.initial import half_edges
from karamelo_py.points.kinematics import Axisymmetric, PlaneStrain, Space


class R4(NamedTuple):
    """Parallelograms: x and two half edges r, which turn and stretch with the point.

    Neighbouring domains may overlap or part a little where the strain is not uniform
    (Sadeghirad, Brannon & Burghardt 2011).

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, R4)
    """

    dimension = 2
    cells = 3
    nodes_per_cell = 1
    least_nodes = 2
    steady_moment = True
    steep_edge = False
    element = None  # of a mesh

    @staticmethod
    def shapes(kin: Any, solid: Any) -> np.ndarray:
        """The half edges (n, 4) of the boxes around the points of a region."""
        return half_edges(solid)


class R8(NamedTuple):
    """Parallelepipeds: x and three half edges r, which turn and stretch with the point.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, R8)
    """

    dimension = 3
    cells = 3
    nodes_per_cell = 1
    least_nodes = 2
    steady_moment = True
    steep_edge = False
    element = None  # of a mesh

    @staticmethod
    def shapes(kin: Any, solid: Any) -> np.ndarray:
        """The half edges (n, 9) of the boxes around the points of a region."""
        return half_edges(solid)


@domain.on(R4, PlaneStrain)
@domain.on(R4, Axisymmetric)
def _(basis, kin, place):
    x, y, ax, ay, bx, by = place
    # Reciprocal vectors A, B (A . a = 1, A . b = 0 ...): N_c has the mean gradient (+-A +-B) / 4.
    w = real(0.25, x)
    k = w / (ax * by - ay * bx)
    px, py = k * (ay + by), k * (ax + bx)
    qx, qy = k * (by - ay), k * (bx - ax)
    sx, sy = ax + bx, ay + by
    tx, ty = ax - bx, ay - by
    return (
        ((x - sx, y - sy), (x + tx, y + ty), (x + sx, y + sy), (x - tx, y - ty)),
        (w, w, w, w),
        ((-qx, qy), (px, -py), (qx, -qy), (-px, py)),
    )


@domain.on(R8, Space)
def _(basis, kin, place):
    x, y, z, ax, ay, az, bx, by, bz, cx, cy, cz = place
    w = real(0.125, x)
    # Reciprocal vectors, times w: b x c / det and so on.
    px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    k = w / (ax * px + ay * py + az * pz)
    p = (k * px, k * py, k * pz)
    q = (k * (cy * az - cz * ay), k * (cz * ax - cx * az), k * (cx * ay - cy * ax))
    r = (k * (ay * bz - az * by), k * (az * bx - ax * bz), k * (ax * by - ay * bx))
    s = (ax + bx, ay + by, az + bz)
    t = (ax - bx, ay - by, az - bz)
    u = (p[0] + q[0], p[1] + q[1], p[2] + q[2])
    v = (p[0] - q[0], p[1] - q[1], p[2] - q[2])
    return (
        (
            (x - s[0] - cx, y - s[1] - cy, z - s[2] - cz),
            (x + t[0] - cx, y + t[1] - cy, z + t[2] - cz),
            (x + s[0] - cx, y + s[1] - cy, z + s[2] - cz),
            (x - t[0] - cx, y - t[1] - cy, z - t[2] - cz),
            (x - s[0] + cx, y - s[1] + cy, z - s[2] + cz),
            (x + t[0] + cx, y + t[1] + cy, z + t[2] + cz),
            (x + s[0] + cx, y + s[1] + cy, z + s[2] + cz),
            (x - t[0] + cx, y - t[1] + cy, z - t[2] + cz),
        ),
        (w, w, w, w, w, w, w, w),
        (
            (-u[0] - r[0], -u[1] - r[1], -u[2] - r[2]),
            (v[0] - r[0], v[1] - r[1], v[2] - r[2]),
            (u[0] - r[0], u[1] - r[1], u[2] - r[2]),
            (-v[0] - r[0], -v[1] - r[1], -v[2] - r[2]),
            (r[0] - u[0], r[1] - u[1], r[2] - u[2]),
            (v[0] + r[0], v[1] + r[1], v[2] + r[2]),
            (u[0] + r[0], u[1] + r[1], u[2] + r[2]),
            (r[0] - v[0], r[1] - v[1], r[2] - v[2]),
        ),
    )


# --- the domain turns and stretches: r <- (I + dl) r ------------------------------------------


@point_function()
def deformed_edges(kin, place, dl):
    """`place` with edges after the increment dl."""


@deformed_edges.on(PlaneStrain)
@deformed_edges.on(Axisymmetric)
def _(kin, place, dl):
    x, y, ax, ay, bx, by = place
    return (
        x,
        y,
        ax + (dl[0] * ax + dl[1] * ay),
        ay + (dl[2] * ax + dl[3] * ay),
        bx + (dl[0] * bx + dl[1] * by),
        by + (dl[2] * bx + dl[3] * by),
    )


@deformed_edges.on(Space)
def _(kin, place, dl):
    x, y, z, ax, ay, az, bx, by, bz, cx, cy, cz = place
    return (
        x,
        y,
        z,
        ax + (dl[0] * ax + dl[1] * ay + dl[2] * az),
        ay + (dl[3] * ax + dl[4] * ay + dl[5] * az),
        az + (dl[6] * ax + dl[7] * ay + dl[8] * az),
        bx + (dl[0] * bx + dl[1] * by + dl[2] * bz),
        by + (dl[3] * bx + dl[4] * by + dl[5] * bz),
        bz + (dl[6] * bx + dl[7] * by + dl[8] * bz),
        cx + (dl[0] * cx + dl[1] * cy + dl[2] * cz),
        cy + (dl[3] * cx + dl[4] * cy + dl[5] * cz),
        cz + (dl[6] * cx + dl[7] * cy + dl[8] * cz),
    )


for _basis in (R4, R8):

    @deformed.on(_basis)
    def _(basis, kin, place, dl):
        return deformed_edges(kin, place, dl)


@extent.on(R4)
def _(basis, kin, grid, place):
    _, _, ax, ay, bx, by = place
    far = abs(ax) + abs(bx)
    # So written, NaN in any component comes through.
    return (far + max(abs(ay) + abs(by) - far, real(0, far))) * grid.inv_h


@extent.on(R8)
def _(basis, kin, grid, place):
    _, _, _, ax, ay, az, bx, by, bz, cx, cy, cz = place
    far = abs(ax) + abs(bx) + abs(cx)
    far += max(abs(ay) + abs(by) + abs(cy) - far, real(0, far))
    return (far + max(abs(az) + abs(bz) + abs(cz) - far, real(0, far))) * grid.inv_h


for _basis in (R4, R8):
    register(_basis, _basis.dimension, 2**_basis.dimension)
    _d = _basis.dimension
    _own = "".join(f"x[{k}], " for k in range(_d))
    _blank = define(
        "basis, kin, x", "zero = real(0, x[0])", f"return ({_own}{'zero, ' * _d**2})", real=real
    )
    for _kin in KINEMATICS[_d]:
        blank.on(_basis, _kin)(_blank)
