"""Contiguous-particle GIMP: hat functions averaged over a box that deforms with the point."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler.compile import index, point_function, real, shared
from karamelo_py.compiler.tuples import scale
from karamelo_py.points.basis import (
    blank,
    carried,
    carrier,
    carriers,
    carry,
    deformed,
    mapped_again,
)
from karamelo_py.points.basis.product import along, register
from karamelo_py.points.basis.ugimp import blank_box, box, in_cell
from karamelo_py.points.frames import stretched_share
from karamelo_py.points.grid import cells_along
from karamelo_py.points.kinematics import (
    Axisymmetric,
    Line,
    PlaneStrain,
    Space,
    deform,
    diagonal,
    planar,
    stretch,
    volume_ratio,
)

# Half sizes that weights are made with, in cells.
LEAST = 1e-3
MOST = 1.0


class CPGIMPDet(NamedTuple):
    """Boxes that keep their shape: l <- l (det(I + dl))^(1/d), d the directions that can stretch.

    Turns leave them as they are; a stretch in one direction goes into all alike.

    Example
    -------
    method(ulmpm, FLIP, cpgimp, 0.99, det)
    """

    cells = 3
    nodes_per_cell = 1
    least_nodes = 4
    steady_moment = True
    steep_edge = True

    @staticmethod
    def shapes(kin: NamedTuple, solid: Any) -> np.ndarray:
        """Half sizes of the domains of a solid's points, (n, d)."""
        return solid.half_size


class CPGIMPDiagonal(NamedTuple):
    """Boxes with the half sizes l0 |F_ii|, for bodies that do not turn.

    A turn by 90 degrees makes the boxes vanish: the functions are then those of `linear`.

    Example
    -------
    method(ulmpm, FLIP, cpgimp, 0.99, diagonal)
    """

    cells = 3
    nodes_per_cell = 1
    least_nodes = 4
    steady_moment = False  # D of the affine transfers all but vanishes with the box
    steep_edge = True

    @staticmethod
    def shapes(kin: NamedTuple, solid: Any) -> np.ndarray:
        """Half sizes now and at the start, and F, of a solid's points, (n, 2 d + d d)."""
        return _sizes_and_deformation(solid)


class CPGIMPStretch(NamedTuple):
    """Boxes with the half sizes l0 U_ii, with the right stretch U = sqrt(F^T F).

    A turn leaves them as they are (Charlton, Coombs & Augarde 2017, "iGIMP: An implicit
    generalised interpolation material point method for large deformations").

    Example
    -------
    method(ulmpm, FLIP, cpgimp, 0.99, stretch)
    """

    cells = 3
    nodes_per_cell = 1
    least_nodes = 4
    steady_moment = True
    steep_edge = True

    @staticmethod
    def shapes(kin: NamedTuple, solid: Any) -> np.ndarray:
        """Half sizes now and at the start, and F, of a solid's points, (n, 2 d + d d)."""
        return _sizes_and_deformation(solid)


class CPGIMPCorners(NamedTuple):
    """Boxes as wide as their corners, moved by the grid, lie apart on average.

    With the displacements u of the 2^d corners c, on the side s_c = -1 or 1 of the point in
    direction i, l_i <- l_i + sum_c s_ci u_ci / 2^d (after Coombs et al. 2020, "On Lagrangian
    mechanics and the implicit material point method for large deformation elasto-plasticity").
    Corners beyond a wall go as the velocity in the last cell goes on.

    Example
    -------
    method(ulmpm, FLIP, cpgimp, 0.99, corners)
    """

    cells = 3
    nodes_per_cell = 1
    least_nodes = 4
    steady_moment = True
    steep_edge = True

    @staticmethod
    def shapes(kin: NamedTuple, solid: Any) -> np.ndarray:
        """Half sizes of the domains of a solid's points, (n, d)."""
        return solid.half_size


class CPGIMP(NamedTuple):
    """Contiguous-particle GIMP: a point stands for a box that deforms with it.

    As ugimp, but the box follows the deformation (Bardenhagen & Kober 2004), in one of four ways:
    ``det`` (its volume follows), ``diagonal`` (F_ii, for bodies that do not turn: a turn by 90
    degrees makes the box vanish), ``stretch`` (U_ii of the right stretch, the default) or
    ``corners`` (its corners go with the grid). Boxes stay boxes along the axes: for much shear,
    the cpdi methods have parallelograms and quadrilaterals.

    Weights count a half size between 0.001 and 1 cell: beyond one cell the points lie so far apart
    that the body falls to pieces numerically anyway. Under total Lagrangian methods, nothing
    deforms, and cpgimp is ugimp.

    Parameters
    ----------
    variant
        How the box follows.

    Example
    -------
    method(ulmpm, FLIP, cpgimp, 0.99, stretch)
    """

    cells = 3
    nodes_per_cell = 1
    least_nodes = 4
    steady_moment = True
    steep_edge = True

    variants = MappingProxyType(
        {
            "det": CPGIMPDet,
            "diagonal": CPGIMPDiagonal,
            "stretch": CPGIMPStretch,
            "corners": CPGIMPCorners,
        }
    )
    default_variant = "stretch"


def _sizes_and_deformation(solid: Any) -> np.ndarray:
    half = solid.half_size
    n, d = half.shape
    return np.concatenate([half, half, np.tile(np.eye(d).ravel(), (n, 1))], axis=1)


# --- weights ----------------------------------------------------------------------------------


@shared
def _along(kin, grid, place, direction):
    a, lo, hi = box(grid, kin, place, direction, LEAST, MOST)
    last = cells_along(grid, direction)
    first = max(min(min(int(a), last - 1) - 1, last - 3), 0)
    start = real(first, a)
    lo = max(lo, real(0, a)) - start
    hi = min(hi, real(last, a)) - start
    p, u = in_cell(lo, hi, 0)
    q, v = in_cell(lo, hi, 1)
    s, w = in_cell(lo, hi, 2)
    k = real(1, a) / (p + q + s)
    weights = (k * (p - u), k * (u + (q - v)), k * (v + (s - w)), k * w)
    k *= grid.inv_h
    gradients = (-k * p, k * (p - q), k * (q - s), k * s)
    r = real(0.5, a) * (lo + hi)
    arms = (-r, real(1, a) - r, real(2, a) - r, real(3, a) - r)
    spread = (
        weights[0] * arms[0] * arms[0]
        + weights[1] * arms[1] * arms[1]
        + weights[2] * arms[2] * arms[2]
        + weights[3] * arms[3] * arms[3]
    )
    k = grid.inv_h / spread
    affine = (
        k * arms[0] * weights[0],
        k * arms[1] * weights[1],
        k * arms[2] * weights[2],
        k * arms[3] * weights[3],
    )
    return first, r, weights, gradients, affine


@along.on(CPGIMPDet)
@along.on(CPGIMPDiagonal)
@along.on(CPGIMPStretch)
def _(basis, kin, grid, place, direction):
    return _along(kin, grid, place, direction)


@along.on(CPGIMPCorners)
def _(basis, kin, grid, place, direction):
    line = _along(kin, grid, place, direction)
    _, lo, hi = box(grid, kin, place, direction, LEAST, MOST)
    top = cells_along(grid, direction) - 1 - line[0]
    ends = (_end(lo, line[0], top), _end(hi, line[0], top))
    return line[0], line[1], line[2], line[3], line[4], ends


@shared
def _end(at, first, top):
    """The cell from node `first` on in which an end of a box lies, and how far into it.

    Of an end beyond a wall: the cell at the wall, the `top`-th at most.
    """
    b = at - real(first, at)
    i = min(max(int(b), 0), min(top, 2))
    return i, b - real(i, at)


@mapped_again.on(CPGIMPDiagonal)
def _(basis, grid, moment):
    # As with linear functions, which these become where the box vanishes.
    return scale(grid.h - grid.h, moment)


# --- boxes ------------------------------------------------------------------------------------


@point_function()
def _parts(kin, place):
    """(position, half sizes, half sizes at the start, F) of a place that holds them all."""


@_parts.on(Line)
def _(kin, place):
    return place[:1], place[1:2], place[2:3], place[3:4]


@_parts.on(PlaneStrain)
def _(kin, place):
    return place[:2], place[2:4], place[4:6], place[6:10]


@_parts.on(Space)
def _(kin, place):
    return place[:3], place[3:6], place[6:9], place[9:18]


@point_function()
def _stretched(kin, half, factors):
    """Half sizes times the amount of a factor for each direction."""


@_stretched.on(Line)
def _(kin, half, factors):
    return (half[0] * abs(factors[0]),)


@_stretched.on(PlaneStrain)
def _(kin, half, factors):
    return (half[0] * abs(factors[0]), half[1] * abs(factors[1]))


@_stretched.on(Space)
def _(kin, half, factors):
    return (half[0] * abs(factors[0]), half[1] * abs(factors[1]), half[2] * abs(factors[2]))


@point_function()
def _scaled_box(kin, place, factor):
    """The place with all half sizes times `factor`."""


@_scaled_box.on(Line)
def _(kin, place, factor):
    return (place[0], factor * place[1])


@_scaled_box.on(PlaneStrain)
def _(kin, place, factor):
    return (place[0], place[1], factor * place[2], factor * place[3])


@_scaled_box.on(Space)
def _(kin, place, factor):
    return place[:3] + (factor * place[3], factor * place[4], factor * place[5])


@deformed.on(CPGIMPDet)
def _(basis, kin, place, dl):
    factor = volume_ratio(kin, dl) ** stretched_share(kin, dl[0])
    return _scaled_box(planar(kin), place, factor)


# F in the plane is enough for boxes: axisymmetric points need no part around the axis, and what
# `dl` holds of it comes last, where the functions of plane tensors do not look.


@deformed.on(CPGIMPDiagonal)
def _(basis, kin, place, dl):
    x, _, start, f = _parts(planar(kin), place)
    f = deform(planar(kin), dl, f)
    return x + _stretched(planar(kin), start, diagonal(planar(kin), f)) + start + f


@deformed.on(CPGIMPStretch)
def _(basis, kin, place, dl):
    x, _, start, f = _parts(planar(kin), place)
    f = deform(planar(kin), dl, f)
    return x + _stretched(planar(kin), start, stretch(planar(kin), f)) + start + f


# --- corners ----------------------------------------------------------------------------------
# Bit k of a corner's number says on which side of the point it lies in direction k.


@point_function()
def _corners(kin):
    """Corners of a box, and nodes of a cell."""


@_corners.on(Line)
def _(kin):
    return 2


@_corners.on(PlaneStrain)
def _(kin):
    return 4


@_corners.on(Space)
def _(kin):
    return 8


@carried.on(CPGIMPCorners)
def _(basis, kin):
    return _corners(planar(kin))


@carriers.on(CPGIMPCorners)
def _(basis, kin):
    return _corners(planar(kin))


@shared
def _side(line, corner, j):
    """Node along one direction, and weight, of bit `j` for the end of a box that bit `corner` is.

    `line` is what `along` returned.
    """
    i, b = line[5][1] if corner else line[5][0]
    return (i + 1, b) if j else (i, real(1, b) - b)


@point_function()
def _carrier(kin, grid, stencil, corner, j):
    """Node number and weight of the j-th node that carries a corner."""


@_carrier.on(Line)
def _(kin, grid, stencil, corner, j):
    i, weight = _side(stencil[1][0], corner & 1, j & 1)
    return index(stencil[0] + i), weight


@_carrier.on(PlaneStrain)
def _(kin, grid, stencil, corner, j):
    i, a = _side(stencil[1][0], corner & 1, j & 1)
    k, b = _side(stencil[1][1], corner & 2, j & 2)
    return index(stencil[0] + i * grid.step_x + k), a * b


@_carrier.on(Space)
def _(kin, grid, stencil, corner, j):
    i, a = _side(stencil[1][0], corner & 1, j & 1)
    k, b = _side(stencil[1][1], corner & 2, j & 2)
    m, c = _side(stencil[1][2], corner & 4, j & 4)
    return index(stencil[0] + i * grid.step_x + k * grid.step_y + m), a * b * c


@carrier.on(CPGIMPCorners)
def _(basis, kin, grid, stencil, corner, j):
    return _carrier(planar(kin), grid, stencil, corner, j)


@shared
def _outward(corner, u):
    """`u`, counted away from the point."""
    return u if corner else -u


@point_function()
def _carry(kin, place, corner, u):
    """The place with the part of a corner's displacement `u` in the half sizes."""


@_carry.on(Line)
def _(kin, place, corner, u):
    return (place[0], place[1] + real(0.5, u[0]) * _outward(corner & 1, u[0]))


@_carry.on(PlaneStrain)
def _(kin, place, corner, u):
    share = real(0.25, u[0])
    return (
        place[0],
        place[1],
        place[2] + share * _outward(corner & 1, u[0]),
        place[3] + share * _outward(corner & 2, u[1]),
    )


@_carry.on(Space)
def _(kin, place, corner, u):
    share = real(0.125, u[0])
    return place[:3] + (
        place[3] + share * _outward(corner & 1, u[0]),
        place[4] + share * _outward(corner & 2, u[1]),
        place[5] + share * _outward(corner & 4, u[2]),
    )


@carry.on(CPGIMPCorners)
def _(basis, kin, place, old, corner, displacement):
    return _carry(planar(kin), place, corner, displacement)


def _blank_with_deformation(basis: type) -> None:
    """The place of `basis` is a position, half sizes now and at the start, and F."""

    @blank.on(basis, Line)
    def _(basis, kin, x):
        o = x[0] - x[0]
        return (x[0], o, o, o)

    @blank.on(basis, PlaneStrain)
    @blank.on(basis, Axisymmetric)
    def _(basis, kin, x):
        o = x[0] - x[0]
        return (x[0], x[1], o, o, o, o, o, o, o, o)

    @blank.on(basis, Space)
    def _(basis, kin, x):
        o = x[0] - x[0]
        return (x[0], x[1], x[2], o, o, o, o, o, o, o, o, o, o, o, o, o, o, o)


for _basis in (CPGIMPDet, CPGIMPCorners):
    blank_box(_basis)
    register(_basis, 4)
for _basis in (CPGIMPDiagonal, CPGIMPStretch):
    _blank_with_deformation(_basis)
    register(_basis, 4)
