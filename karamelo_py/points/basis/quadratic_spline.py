"""Quadratic B-splines: three nodes a direction, smooth gradients."""

from typing import NamedTuple

from karamelo_py.compiler.compile import choose, in_all, real, shared
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
    nearest = int(a + real(0.5, a))
    bulk = (nearest >= 1) & (nearest < last)
    t = a - real(nearest, a)
    half = real(0.5, a)
    left, right = half - t, half + t
    weights = (half * left * left, real(0.75, a) - t * t, half * right * right)
    gradients = (-left * grid.inv_h, -(t + t) * grid.inv_h, right * grid.inv_h)
    line = product.Along(nearest - 1, real(1, a) + t, weights, gradients, ())
    if in_all(bulk):
        return line
    return choose(bulk, line, _at_wall(grid, a, last))


@shared
def _at_wall(grid, a, last):
    """The hat functions of the cell at a wall, with a third node of no weight."""
    cell = min(int(a), last - 1)
    first = max(min(cell, last - 2), 0)
    t = a - real(cell, a)
    zero, one = real(0, a), real(1, a)
    second = first < cell  # the cell is that between the last two of the three nodes
    weights = (choose(second, zero, one - t), choose(second, one - t, t), choose(second, t, zero))
    gradients = (
        choose(second, zero, -grid.inv_h),
        choose(second, -grid.inv_h, grid.inv_h),
        choose(second, grid.inv_h, zero),
    )
    return product.Along(first, a - real(first, a), weights, gradients, ())


@shared
def _in_bulk(grid, line, direction):
    """Whether these are the splines, and not the functions at a wall."""
    return (cells_along(grid, direction) > 1) & (line.r >= 0.5) & (line.r < 1.5)


@product.affine_along.on(QuadraticSpline)
def _affine_along_quadratic_spline(basis, grid, line, direction):
    # D = h^2 / 4. For hat functions, N D^-1 (X - x) is the gradient.
    four, r = real(4, line.r) * grid.inv_h, line.r
    affine = tuple([four * (real(k, r) - r) * weight for k, weight in enumerate(line.weights)])
    return choose(_in_bulk(grid, line, direction), affine, line.gradients)


@product.inverse_spread.on(QuadraticSpline)
def _inverse_spread_quadratic_spline(basis, grid):
    return (4 * grid.inv_h * grid.inv_h,)


@product.evenly.on(QuadraticSpline)
def _evenly_quadratic_spline(basis, grid, stencil):
    first, *rest = (_in_bulk(grid, line, d) for d, line in enumerate(stencil.lines))
    for bulk in rest:
        first = first & bulk
    return first


@first_node.on(QuadraticSpline)
def _first_node_quadratic_spline(basis, like):
    return real(0.5, like)


product.register(QuadraticSpline, 3)
