"""B-splines with three or four nodes per direction, modified at walls.

Walls inside the grid have separate classes (:class:`AtWalls`).
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import all_lanes, point_function, where
from karamelo_py.points.basis import BasisTraits, first_node, product, walled
from karamelo_py.points.grid import cells_along, in_cells
from karamelo_py.points.noise import CUBIC

NARROW = 5 / 36  # D / h^2 of the first of three rows of points per cell next to a wall
BELOW, ABOVE, BETWEEN = 1, 2, 3  # walls at faces of a cell


class AtWalls(NamedTuple):
    faces: np.ndarray  # (cells of all grids, d) int8: BELOW, ABOVE, BETWEEN, or 0

    in_lanes = True


@point_function(otherwise=True)
def walls_of_cell(basis, kin, grid, location, direction):
    """Return whether the lower and the upper face of the point's cell are walls, or ()."""
    return ()


def _walls_of_cell_at_walls(basis, kin, grid, location, direction):
    wall = basis.faces[product.cell_number(kin, grid, location), direction]
    return (wall == BELOW) | (wall == BETWEEN), wall >= ABOVE


def hats(grid, a, cell, first, count):
    t, number = a - cell, cell - first
    weights = [where(number == k, 1 - t, where(number == k - 1, t, 0)) for k in range(count)]
    slope = grid.inv_h
    gradients = [where(number == k, -slope, where(number == k - 1, slope, 0)) for k in range(count)]
    return product.Along(first, a - first, tuple(weights), tuple(gradients), ())


class QuadraticSpline(NamedTuple):
    """Quadratic B-splines, modified at the walls of the grid (Steffen, Kirby & Berzins 2008).

    Gradients are continuous: no cell-crossing error. A point has nine nodes in 2D (linear: four).
    Linear extrapolation beyond a wall, phi(-1) = 2 phi(0) - phi(1), makes functions linear near it.

    Example
    -------
    method(ulmpm, APIC, quadratic-spline)
    """

    in_lanes = True
    # courant_still, from the highest frequency of a free block: 1.8 to 2.6 in 1D, 1.58 to 2.5 in
    # 2D, 1.4 to 2.4 in 3D, over positions, spacings, walls and Poisson's ratios up to 0.49.
    traits = BasisTraits(
        cells=3,
        least_nodes=3,
        steady_moment=True,
        steep_edge=False,
        lone=(4.0, 6.0, 6.8),
        spread=1 / 4,
        courant_still=1.25,
    )


@product.along.on(QuadraticSpline)
def _along_quadratic_spline(basis, kin, grid, location, direction):
    a = in_cells(grid, direction, location[direction])
    last = cells_along(grid, direction)
    nearest = int(a + 0.5)
    bulk = (nearest >= 1) & (nearest < last)
    cell = min(int(a), last - 1)
    behind = nearest > cell
    walls = walls_of_cell(basis, kin, grid, location, direction)
    if len(walls):
        bulk = where(where(behind, walls[1], walls[0]), False, bulk)
    t = a - nearest
    left, right = 0.5 - t, 0.5 + t
    weights = (0.5 * left * left, 0.75 - t * t, 0.5 * right * right)
    gradients = (-left * grid.inv_h, -(t + t) * grid.inv_h, right * grid.inv_h)
    line = product.Along(nearest - 1, 1 + t, weights, gradients, ())
    if all_lanes(bulk):
        return line
    first = max(min(where(behind, cell - 1, cell), last - 2), 0)
    return where(bulk, line, hats(grid, a, cell, first, 3))


def in_bulk(basis, grid, line, direction):
    if isinstance(basis, AtWalls):
        return line.weights[0] * line.weights[2] > 0
    return (cells_along(grid, direction) > 1) & (line.r >= 0.5) & (line.r < 1.5)


@product.affine_along.on(QuadraticSpline)
def _affine_along_quadratic_spline(basis, grid, line, direction):
    # D = h^2 / 4. For a linear basis, N D^-1 (X - x) is the gradient.
    four = 4 * grid.inv_h
    affine = tuple([four * (k - line.r) * weight for k, weight in enumerate(line.weights)])
    return where(in_bulk(basis, grid, line, direction), affine, line.gradients)


@product.inverse_spread.on(QuadraticSpline)
def _inverse_spread_quadratic_spline(basis, grid):
    return (4 * grid.inv_h * grid.inv_h,)


@product.evenly.on(QuadraticSpline)
def _evenly_quadratic_spline(basis, grid, stencil):
    first, *rest = (in_bulk(basis, grid, line, d) for d, line in enumerate(stencil.lines))
    for bulk in rest:
        first = first & bulk
    return first


@product.retained.on(QuadraticSpline)
def _retained_spline(basis, stencil):
    """Return the retained fraction of velocity gradients, below 1 where D / h^2 < NARROW at a wall.

    As D goes to 0, the pressure of an isolated point accelerates a node of vanishing mass with the
    frequency c / sqrt(D), which is unstable for any step.
    """
    kept = []
    for line in stencil.lines:
        spread = sum([w * (k - line.r) * (k - line.r) for k, w in enumerate(line.weights)])
        ratio = where(spread < NARROW, spread / NARROW, 1)
        kept.append(ratio * ratio * ratio)
    return tuple(kept)


@first_node.on(QuadraticSpline)
def _first_node_quadratic_spline(basis, template):
    return 0.5


product.register(QuadraticSpline, 3)


class QuadraticSplineAtWalls(AtWalls):
    pass


def of_splines(basis: type, of: type, functions: tuple) -> None:
    of.traits = basis.traits

    @walled.on(basis)
    def _walled_splines(basis, faces):
        return of(faces)

    walls_of_cell.on(of)(_walls_of_cell_at_walls)
    for function in functions:
        function.on(of)(function.find((basis,)))
    product.register(of, basis.line_nodes)


of_splines(
    QuadraticSpline,
    QuadraticSplineAtWalls,
    (
        product.along,
        product.affine_along,
        product.inverse_spread,
        product.evenly,
        product.retained,
        first_node,
    ),
)


class CubicSpline(NamedTuple):
    """Cubic B-splines, modified at the walls of the grid (Steffen, Kirby & Berzins 2008).

    The smoothest and most costly spline, with 16 nodes in 2D and 64 in 3D. Linear extrapolation
    beyond a wall, phi(-1) = 2 phi(0) - phi(1), gives the boundary functions.

    Example
    -------
    method(ulmpm, FLIP, cubic-spline, 0.99)
    """

    in_lanes = True
    # courant_total: the shortest waves nearly average out; a vibrating block is stable up to 2.1 to
    # 2.4 h/c in 1D (tests/test_stability.py), 1.8 to 2.4 in 2D, 1.4 to 2.3 in 3D (Poisson's ratio
    # 0.45 and 0). courant_still, as for quadratic splines: 1.9 to 2.7, 1.84 to 2.6, 1.46 to 2.7.
    # courant_strained_first: when strains lacked (dt grad v)^2, a ball of 3 cells radius gained 46
    # % in 200/c with usf and the longer step, 1 % with 0.9 h/c. The ball has not been measured
    # again since.
    traits = BasisTraits(
        cells=3,
        least_nodes=4,
        steady_moment=True,
        steep_edge=False,
        lone=(3.0, 3.14, 3.3),
        spread=1 / 3,
        corrected_fraction=0.95,
        courant_total=1.25,
        courant_still=1.4,
        courant_strained_first=1.0,
        allows_drift=True,
        drift_limits=CUBIC,
    )


@product.along.on(CubicSpline)
def _along_cubic_spline(basis, kin, grid, location, direction):
    a = in_cells(grid, direction, location[direction])
    last = cells_along(grid, direction)
    cell = int(a)
    t = a - cell
    s = 1 - t
    tt, ss = t * t, s * s
    weights = (
        1 / 6 * (ss * s),
        2 / 3 + tt * (0.5 * t - 1),
        2 / 3 + ss * (0.5 * s - 1),
        1 / 6 * (tt * t),
    )
    h, k, twice = 0.5 * grid.inv_h, 1.5 * grid.inv_h, grid.inv_h + grid.inv_h
    gradients = (-h * ss, t * (k * t - twice), -s * (k * s - twice), h * tt)
    # D = h^2 / 3 of cubic splines
    three = 3 * grid.inv_h
    r = 1 + t
    affine = (
        -three * r * weights[0],
        -three * t * weights[1],
        three * s * weights[2],
        three * (1 + s) * weights[3],
    )
    line = product.Along(cell - 1, r, weights, gradients, affine)
    cell = min(cell, last - 1)
    bulk = (cell >= 1) & (cell < last - 1)
    below, above = cell == 0, cell == last - 1
    walls = walls_of_cell(basis, kin, grid, location, direction)
    if len(walls):
        below, above = below | walls[0], above | walls[1]
        bulk = where(below | above, False, bulk)
    if all_lanes(bulk):
        return line
    other = at_wall(grid, direction, a, cell, (below, above), inside=len(walls) > 0)
    return where(bulk, line, other)


def at_wall(grid, direction, a, cell, walls, *, inside):
    """Return the line of a cell at a wall; without walls `inside`, a single cell has two."""
    last, (below, above) = cells_along(grid, direction), walls
    first = max(min(cell - 1, last - 3), 0)
    between = hats(grid, a, cell, first, 4)  # line between two walls
    between = between._replace(affine=between.gradients)
    if last == 1:
        return between
    t = a - cell
    n, g, c = next_to_wall(grid, where(below, t, 1 - t))
    n = where(below, n, (n[2], n[1], n[0]))
    g = where(below, g, (-g[2], -g[1], -g[0]))
    c = where(below, c, (-c[2], -c[1], -c[0]))
    behind = where(below, cell, cell - 1) > first  # where the last three of the four nodes are used
    n, g, c = [
        tuple([where(behind, *pair) for pair in zip((0, *of), (*of, 0), strict=True)])
        for of in (n, g, c)
    ]
    line = product.Along(first, a - first, n, g, c)
    return where(below & above, between, line) if inside else line


def next_to_wall(grid, t):
    """Return N, dN/dx and N D^-1 (X - x) of three nodes from a wall `t` cells away.

    The ghost node changes D to h^2 t (1 - t + t^2/3); t cancels out of N D^-1 (X - x).
    """
    tt = t * t
    weights = (1 - t + 1 / 6 * tt * t, t * (1 - 1 / 3 * tt), 1 / 6 * tt * t)
    slopes = ((0.5 * tt - 1) * grid.inv_h, (1 - tt) * grid.inv_h, 0.5 * tt * grid.inv_h)
    k = grid.inv_h / (1 - t + 1 / 3 * tt)
    affine = (-k * weights[0], k * (1 - 1 / 3 * tt) * (1 - t), k * (1 / 6) * tt * (2 - t))
    return weights, slopes, affine


product.retained.on(CubicSpline)(_retained_spline)
product.register(CubicSpline, 4)
product.warn_of_many_nodes(CubicSpline)


class CubicSplineAtWalls(AtWalls):
    pass


of_splines(CubicSpline, CubicSplineAtWalls, (product.along,))
