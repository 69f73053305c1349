"""Bases that are a product of one function a direction: hats, splines, uniform GIMP.

The one-dimensional part is the point function `along`; the stencil of a point is the number of its
first node and, for each direction, what `along` returned.
"""

from __future__ import annotations

from karamelo_py.compiler.compile import index, point_function, real, shared
from karamelo_py.points.basis import affine_weight, entry, locate, reach, support
from karamelo_py.points.kinematics import Axisymmetric, Line, PlaneStrain, Space


@point_function()
def along(basis, kin, grid, place, direction):
    """The nodes that a point sees in one direction.

    Returns
    -------
    first : int
        Number of the first node in this direction.
    r : float
        Distance of the point from that node, in cells.
    weights, gradients : tuple
        N and dN/dx of the nodes.
    affine : tuple
        N D^-1 (X_I - x) of the nodes, for the affine transfers; D is the mean of (X_I - x)^2 under
        the weights.
    """


@point_function()
def spacing(basis, like):
    """Distance of neighbouring nodes, in cells."""


@spacing.otherwise
def _(basis, like):
    return real(1, like)


@shared
def _arm(basis, grid, line, k):
    """X_I - x along one direction."""
    return (real(k, line[1]) * spacing(basis, line[1]) - line[1]) * grid.h


@shared
def hoop(weight, gradient, inv_r):
    """N / r at an axisymmetric point; at r = 0 its limit, dN/dr (`inv_r` is 0 there)."""
    return weight * inv_r if inv_r > 0 else gradient


@shared
def inverse_radius(r):
    """1 / r, or 0 on the axis and so close to it that 1 / r would overflow."""
    return real(1, r) / r if r > real(1e-30, r) else real(0, r)


def register(basis: type, width: int) -> None:
    """Give `basis` (a class with `along`, `width` nodes a direction) every point function."""

    @locate.on(basis, Line)
    def _(basis, kin, grid, place):
        a = along(basis, kin, grid, place, 0)
        return grid.first + a[0], (a,)

    @locate.on(basis, PlaneStrain)
    def _(basis, kin, grid, place):
        a = along(basis, kin, grid, place, 0)
        b = along(basis, kin, grid, place, 1)
        return grid.first + a[0] * grid.step_x + b[0], (a, b)

    @locate.on(basis, Axisymmetric)
    def _(basis, kin, grid, place):
        a = along(basis, kin, grid, place, 0)
        b = along(basis, kin, grid, place, 1)
        # The radius that the weights reproduce: that of the point, but for domains cut at a wall.
        r = place[0] - place[0]
        for k in range(width):
            node = real(a[0] + k, r) * spacing(basis, r)
            r += a[2][k] * (grid.x0 + node * grid.h)
        return grid.first + a[0] * grid.step_x + b[0], (a, b), inverse_radius(r)

    @locate.on(basis, Space)
    def _(basis, kin, grid, place):
        a = along(basis, kin, grid, place, 0)
        b = along(basis, kin, grid, place, 1)
        c = along(basis, kin, grid, place, 2)
        return grid.first + a[0] * grid.step_x + b[0] * grid.step_y + c[0], (a, b, c)

    @support.on(basis, Line)
    def _(basis, kin):
        return width

    @support.on(basis, PlaneStrain)
    @support.on(basis, Axisymmetric)
    def _(basis, kin):
        return width * width

    @support.on(basis, Space)
    def _(basis, kin):
        return width * width * width

    @entry.on(basis, Line)
    def _(basis, kin, grid, stencil, k):
        a = stencil[1][0]
        return index(stencil[0] + k), a[2][k], (a[3][k],)

    @entry.on(basis, PlaneStrain)
    def _(basis, kin, grid, stencil, k):
        a, b = stencil[1]
        i = k // width
        j = k % width
        wa, wb = a[2][i], b[2][j]
        node = stencil[0] + i * grid.step_x + j
        return index(node), wa * wb, (a[3][i] * wb, wa * b[3][j])

    @entry.on(basis, Axisymmetric)
    def _(basis, kin, grid, stencil, k):
        a, b = stencil[1]
        i = k // width
        j = k % width
        wa, wb = a[2][i], b[2][j]
        node = stencil[0] + i * grid.step_x + j
        weight, slope = wa * wb, a[3][i] * wb
        return index(node), weight, (slope, wa * b[3][j], hoop(weight, slope, stencil[2]))

    @entry.on(basis, Space)
    def _(basis, kin, grid, stencil, k):
        a, b, c = stencil[1]
        i = k // (width * width)
        j = (k // width) % width
        m = k % width
        wa, wb, wc = a[2][i], b[2][j], c[2][m]
        node = stencil[0] + i * grid.step_x + j * grid.step_y + m
        wab = wa * wb
        return index(node), wab * wc, (a[3][i] * wb * wc, wa * b[3][j] * wc, wab * c[3][m])

    @reach.on(basis, Line)
    def _(basis, kin, grid, stencil, k):
        return (_arm(basis, grid, stencil[1][0], k),)

    @reach.on(basis, PlaneStrain)
    @reach.on(basis, Axisymmetric)
    def _(basis, kin, grid, stencil, k):
        a, b = stencil[1]
        return _arm(basis, grid, a, k // width), _arm(basis, grid, b, k % width)

    @reach.on(basis, Space)
    def _(basis, kin, grid, stencil, k):
        a, b, c = stencil[1]
        return (
            _arm(basis, grid, a, k // (width * width)),
            _arm(basis, grid, b, (k // width) % width),
            _arm(basis, grid, c, k % width),
        )

    @affine_weight.on(basis, Line)
    def _(basis, kin, grid, stencil, k):
        return (stencil[1][0][4][k],)

    @affine_weight.on(basis, PlaneStrain)
    @affine_weight.on(basis, Axisymmetric)
    def _(basis, kin, grid, stencil, k):
        a, b = stencil[1]
        i = k // width
        j = k % width
        return a[4][i] * b[2][j], a[2][i] * b[4][j]

    @affine_weight.on(basis, Space)
    def _(basis, kin, grid, stencil, k):
        a, b, c = stencil[1]
        i = k // (width * width)
        j = (k // width) % width
        m = k % width
        wa, wb, wc = a[2][i], b[2][j], c[2][m]
        return (
            a[4][i] * wb * wc,
            wa * b[4][j] * wc,
            wa * wb * c[4][m],
        )
