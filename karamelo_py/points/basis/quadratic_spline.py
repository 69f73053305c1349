"""Quadratic B-splines: three nodes a direction, smooth gradients."""

from typing import NamedTuple

from karamelo_py.compiler.compile import all_lanes, where
from karamelo_py.points.basis import first_node, product
from karamelo_py.points.grid import cells_along, in_cells


class QuadraticSpline(NamedTuple):
    """Quadratic B-splines, modified at the walls of the grid (Steffen, Kirby & Berzins 2008).

    Gradients are continuous: no cell-crossing error, and in 2D a bit more than twice as many nodes
    as linear functions have. At a wall, the node beyond it is taken to go on linearly from the two
    inside: phi(-1) = 2 phi(0) - phi(1). Within half a cell of a wall that leaves the linear hats.

    Example
    -------
    method(ulmpm, APIC, quadratic-spline)
    """

    steep_edge = False
    in_lanes = True
    lone = (4.0, 6.0)
    # Of the stable step while points are where they were. By the highest frequency of a free block:
    # up to 1.8 to 2.6 h/c in 1D, 1.58 to 2.5 in the plane, 1.4 to 2.4 in space, over places,
    # distances, walls and Poisson's ratios up to 0.49.
    courant_still = 1.25


@product.along.on(QuadraticSpline)
def _along_quadratic_spline(basis, kin, grid, place, direction):
    a = in_cells(grid, direction, place[direction])
    last = cells_along(grid, direction)
    nearest = int(a + 0.5)
    bulk = (nearest >= 1) & (nearest < last)
    t = a - nearest
    left, right = 0.5 - t, 0.5 + t
    weights = (0.5 * left * left, 0.75 - t * t, 0.5 * right * right)
    gradients = (-left * grid.inv_h, -(t + t) * grid.inv_h, right * grid.inv_h)
    line = product.Along(nearest - 1, 1 + t, weights, gradients, ())
    if all_lanes(bulk):
        return line
    return where(bulk, line, at_wall(grid, a, last))


def at_wall(grid, a, last):
    """The hat functions of the cell at a wall, with a third node of no weight."""
    cell = min(int(a), last - 1)
    first = max(min(cell, last - 2), 0)
    t = a - cell
    second = first < cell  # the cell is that between the last two of the three nodes
    weights = (where(second, 0, 1 - t), where(second, 1 - t, t), where(second, t, 0))
    gradients = (
        where(second, 0, -grid.inv_h),
        where(second, -grid.inv_h, grid.inv_h),
        where(second, grid.inv_h, 0),
    )
    return product.Along(first, a - first, weights, gradients, ())


def in_bulk(grid, line, direction):
    """Check that these are the splines, and not the functions at a wall."""
    return (cells_along(grid, direction) > 1) & (line.r >= 0.5) & (line.r < 1.5)


@product.affine_along.on(QuadraticSpline)
def _affine_along_quadratic_spline(basis, grid, line, direction):
    # D = h^2 / 4. For hat functions, N D^-1 (X - x) is the gradient.
    four = 4 * grid.inv_h
    affine = tuple([four * (k - line.r) * weight for k, weight in enumerate(line.weights)])
    return where(in_bulk(grid, line, direction), affine, line.gradients)


@product.inverse_spread.on(QuadraticSpline)
def _inverse_spread_quadratic_spline(basis, grid):
    return (4 * grid.inv_h * grid.inv_h,)


@product.evenly.on(QuadraticSpline)
def _evenly_quadratic_spline(basis, grid, stencil):
    first, *rest = (in_bulk(grid, line, d) for d, line in enumerate(stencil.lines))
    for bulk in rest:
        first = first & bulk
    return first


@first_node.on(QuadraticSpline)
def _first_node_quadratic_spline(basis, like):
    return 0.5


product.register(QuadraticSpline, 3)
