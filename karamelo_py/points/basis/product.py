"""Bases that are a product of one function a direction: splines, hats.

The one-dimensional part is the point function `along`; the stencil of a point is the number of its
first node and, for each direction, what `along` returned.
"""

from __future__ import annotations

from karamelo_py.compile import index, point_function, real, shared
from karamelo_py.points.basis import affine_weight, entry, inside, locate, reach, support
from karamelo_py.points.kinematics import Line, PlaneStrain, Space


@point_function()
def along(basis, direction, x):
    """First node, distance to it in cells, and the weights and gradients of a direction's nodes."""


@point_function()
def affine_along(basis, line, k):
    """N_I D^-1 (X_I - x) along one direction, of the k-th node in what `along` returned."""


@shared
def pick(direction, a, b, c):
    """The one of three that belongs to a direction; no branch is left where that is a literal."""
    return a if direction == 0 else (b if direction == 1 else c)


@shared
def in_cells(basis, direction, x):
    """Distance from the lower corner of the grid, in cells."""
    return (x - pick(direction, basis.x0, basis.y0, basis.z0)) * basis.inv_h


@shared
def _within(basis, direction, x):
    a = in_cells(basis, direction, x)
    end = pick(direction, basis.lx, basis.ly, basis.lz)
    return a >= -basis.slack and a <= end + basis.slack


def register(basis: type) -> None:
    """Give `basis` (a class with ``width`` nodes a direction and `along`) every point function."""
    width = basis.width

    @inside.on(basis, Line)
    def _(basis, kin, x):
        return _within(basis, 0, x[0])

    @inside.on(basis, PlaneStrain)
    def _(basis, kin, x):
        return _within(basis, 0, x[0]) and _within(basis, 1, x[1])

    @inside.on(basis, Space)
    def _(basis, kin, x):
        return _within(basis, 0, x[0]) and _within(basis, 1, x[1]) and _within(basis, 2, x[2])

    @locate.on(basis, Line)
    def _(basis, kin, x):
        a = along(basis, 0, x[0])
        return a[0], (a,)

    @locate.on(basis, PlaneStrain)
    def _(basis, kin, x):
        a = along(basis, 0, x[0])
        b = along(basis, 1, x[1])
        return a[0] * basis.step_x + b[0], (a, b)

    @locate.on(basis, Space)
    def _(basis, kin, x):
        a = along(basis, 0, x[0])
        b = along(basis, 1, x[1])
        c = along(basis, 2, x[2])
        return a[0] * basis.step_x + b[0] * basis.step_y + c[0], (a, b, c)

    @support.on(basis, Line)
    def _(basis, kin):
        return width

    @support.on(basis, PlaneStrain)
    def _(basis, kin):
        return width * width

    @support.on(basis, Space)
    def _(basis, kin):
        return width * width * width

    @entry.on(basis, Line)
    def _(basis, kin, stencil, k):
        a = stencil[1][0]
        return index(stencil[0] + k), a[2][k], (a[3][k],)

    @entry.on(basis, PlaneStrain)
    def _(basis, kin, stencil, k):
        a, b = stencil[1]
        i = k // width
        j = k % width
        wa, wb = a[2][i], b[2][j]
        node = stencil[0] + i * basis.step_x + j
        return index(node), wa * wb, (a[3][i] * wb, wa * b[3][j])

    @entry.on(basis, Space)
    def _(basis, kin, stencil, k):
        a, b, c = stencil[1]
        i = k // (width * width)
        j = (k // width) % width
        m = k % width
        wa, wb, wc = a[2][i], b[2][j], c[2][m]
        node = stencil[0] + i * basis.step_x + j * basis.step_y + m
        wab = wa * wb
        return index(node), wab * wc, (a[3][i] * wb * wc, wa * b[3][j] * wc, wab * c[3][m])

    @reach.on(basis, Line)
    def _(basis, kin, stencil, k):
        a = stencil[1][0]
        return ((real(k, a[1]) - a[1]) * basis.h,)

    @reach.on(basis, PlaneStrain)
    def _(basis, kin, stencil, k):
        a, b = stencil[1]
        return (
            (real(k // width, a[1]) - a[1]) * basis.h,
            (real(k % width, b[1]) - b[1]) * basis.h,
        )

    @reach.on(basis, Space)
    def _(basis, kin, stencil, k):
        a, b, c = stencil[1]
        return (
            (real(k // (width * width), a[1]) - a[1]) * basis.h,
            (real((k // width) % width, b[1]) - b[1]) * basis.h,
            (real(k % width, c[1]) - c[1]) * basis.h,
        )

    @affine_weight.on(basis, Line)
    def _(basis, kin, stencil, k):
        return (affine_along(basis, stencil[1][0], k),)

    @affine_weight.on(basis, PlaneStrain)
    def _(basis, kin, stencil, k):
        a, b = stencil[1]
        i = k // width
        j = k % width
        return affine_along(basis, a, i) * b[2][j], a[2][i] * affine_along(basis, b, j)

    @affine_weight.on(basis, Space)
    def _(basis, kin, stencil, k):
        a, b, c = stencil[1]
        i = k // (width * width)
        j = (k // width) % width
        m = k % width
        wa, wb, wc = a[2][i], b[2][j], c[2][m]
        return (
            affine_along(basis, a, i) * wb * wc,
            wa * affine_along(basis, b, j) * wc,
            wa * wb * affine_along(basis, c, m),
        )
