"""Linear hat functions: two nodes a direction, 1 - |x - X_I| / h."""

from typing import NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.points.basis import mapped_again
from karamelo_py.points.basis.product import Along, along, register
from karamelo_py.points.grid import cells_along, in_cells


class Linear(NamedTuple):
    """Linear hat functions on the grid's nodes: the basis of the first MPM (Sulsky et al. 1994).

    The cheapest basis. Its gradient jumps at cell faces, so a stressed point that crosses one
    changes the nodal forces by the order of its stress (the cell-crossing error).

    Example
    -------
    method(ulmpm, FLIP, linear, 1)
    """

    steady_moment = False  # D of the affine transfers vanishes at the nodes
    steep_edge = True
    gradient_jumps = True
    in_lanes = True


@along.on(Linear)
def _along_linear(basis, kin, grid, place, direction):
    a = in_cells(grid, direction, place[direction])
    i = min(int(a), cells_along(grid, direction) - 1)  # the last face belongs to the last cell
    r = a - real(i, a)
    gradients = (-grid.inv_h, grid.inv_h)
    # D = r (1 - r) h^2 vanishes at the nodes, but N D^-1 (X - x) is the gradient everywhere
    # (Jiang, Schroeder & Teran 2017, "An angular momentum conserving affine-particle-in-cell
    # method", section 5.3).
    return Along(i, r, (1 - r, r), gradients, gradients)


@mapped_again.on(Linear)
def _mapped_again_linear(basis, grid, moment):
    # B D^-1 grows without bound where D vanishes: the velocity that deforms the points leaves it
    # out, and the points keep B, so that nothing is lost.
    return (grid.h - grid.h) * moment


register(Linear, 2)
