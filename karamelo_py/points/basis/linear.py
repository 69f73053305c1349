"""Linear hat functions: two nodes a direction, 1 - |x - X_I| / h."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compile import real
from karamelo_py.points.basis import mapped_again
from karamelo_py.points.basis.product import affine_along, along, in_cells, pick, register
from karamelo_py.tensors import scale


class Linear(NamedTuple):
    """Linear hat functions on the grid's nodes: the basis of the first MPM (Sulsky et al. 1994).

    The cheapest basis. Its gradient jumps at cell faces, so a stressed point that crosses one
    changes the nodal forces by the order of its stress (the cell-crossing error).

    Example
    -------
    method(ulmpm, FLIP, linear, 1)
    """

    x0: float  # lower corner of the grid
    y0: float
    z0: float
    h: float  # cell size
    inv_h: float  # 1 / h
    nx: int  # cells per direction
    ny: int
    nz: int
    lx: float  # size of the domain in cells, not always whole
    ly: float
    lz: float
    slack: float  # how far beyond the domain a point still counts as in it, in cells
    step_x: int  # from a node's number to that of its neighbour
    step_y: int

    width = 2
    steady_moment = False  # D of the affine transfers vanishes at the nodes


@along.on(Linear)
def _(basis, direction, x):
    a = in_cells(basis, direction, x)
    last = pick(direction, basis.nx, basis.ny, basis.nz) - 1
    i = min(int(a), last)  # the last face belongs to the last cell
    r = a - real(i, x)
    return i, r, (real(1, x) - r, r), (-basis.inv_h, basis.inv_h)


@affine_along.on(Linear)
def _(basis, line, k):
    # D = r (1 - r) h^2 vanishes at the nodes, but N D^-1 (X - x) is the gradient everywhere
    # (Jiang, Schroeder & Teran 2017, "An angular momentum conserving affine-particle-in-cell
    # method", section 5.3).
    return line[3][k]


@mapped_again.on(Linear)
def _(basis, moment):
    # B D^-1 grows without bound where D vanishes: the velocity that deforms the points leaves it
    # out, and the points keep B, so that nothing is lost.
    return scale(real(0, basis.h), moment)


register(Linear)
