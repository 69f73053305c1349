"""Uniform GIMP: hat functions averaged over a domain around the point, of a constant size."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler.compile import real, shared
from karamelo_py.points.basis import blank
from karamelo_py.points.basis.product import along, register
from karamelo_py.points.grid import cells_along, in_cells
from karamelo_py.points.kinematics import Axisymmetric, Line, PlaneStrain, Space, dimension


class UGIMP(NamedTuple):
    """Uniform GIMP: a point stands for a box of constant size (Bardenhagen & Kober 2004).

    Weights are the averages of the hat functions over [x - l, x + l] in each direction, with l the
    half size that the point starts with: smooth, and only as wide as the point. Where the material
    stretches much, gaps open between the boxes; cpgimp lets them grow. A wall cuts the box, and
    the point then acts from the centre of what is left.

    Example
    -------
    method(ulmpm, FLIP, ugimp, 0.99)
    """

    cells = 3
    nodes_per_cell = 1
    least_nodes = 3
    steady_moment = True
    steep_edge = True

    @staticmethod
    def shapes(kin: NamedTuple, solid: Any) -> np.ndarray:
        """Half sizes of the domains of a solid's points, (n, d)."""
        return solid.half_size


def blank_box(basis: type) -> None:
    """The place of `basis` is a position and half sizes."""

    @blank.on(basis, Line)
    def _(basis, kin, x):
        return (x[0], x[0] - x[0])

    @blank.on(basis, PlaneStrain)
    @blank.on(basis, Axisymmetric)
    def _(basis, kin, x):
        zero = x[0] - x[0]
        return (x[0], x[1], zero, zero)

    @blank.on(basis, Space)
    def _(basis, kin, x):
        zero = x[0] - x[0]
        return (x[0], x[1], x[2], zero, zero, zero)


@shared
def box(grid, kin, place, direction, least, most):
    """Centre and both ends of a domain along one direction, in cells, before walls cut it."""
    a = in_cells(grid, direction, place[direction])
    half = place[dimension(kin) + direction] * grid.inv_h
    half = min(max(half, real(least, a)), real(most, a))
    return a, a - half, a + half


@shared
def in_cell(lo, hi, j):
    """How much of [lo, hi] lies in the cell between nodes j and j + 1, and its share of node j + 1.

    The integrals over the cell of 1 and of the hat function of node j + 1.
    """
    start = real(j, lo)
    p = max(lo - start, real(0, lo))
    q = min(hi - start, real(1, lo))
    length = max(q - p, real(0, lo))
    return length, length * (real(0.5, lo) * (p + q))


@along.on(UGIMP)
def _(basis, kin, grid, place, direction):
    a, lo, hi = box(grid, kin, place, direction, 1e-3, 0.5)
    last = cells_along(grid, direction)
    lo = max(lo, real(0, a))
    hi = min(hi, real(last, a))
    first = max(min(int(lo), last - 2), 0)
    lo -= real(first, a)
    hi -= real(first, a)
    p, u = in_cell(lo, hi, 0)
    q, v = in_cell(lo, hi, 1)
    k = real(1, a) / (p + q)
    weights = (k * (p - u), k * (u + (q - v)), k * v)
    k *= grid.inv_h
    gradients = (-k * p, k * (p - q), k * q)
    r = real(0.5, a) * (lo + hi)
    s, t = real(1, a) - r, real(2, a) - r
    spread = weights[0] * r * r + weights[1] * s * s + weights[2] * t * t
    k = grid.inv_h / spread
    affine = (-k * r * weights[0], k * s * weights[1], k * t * weights[2])
    return first, r, weights, gradients, affine


blank_box(UGIMP)
register(UGIMP, 3)
