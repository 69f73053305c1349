"""Volumes and gradients for pore pressures that are solved for, one per cell, with any basis.

A point at x belongs to cell c by the fraction phi_c(x), a hat function around the centre of the
cell; with a linear basis, and in the half of a cell next to a wall, it belongs to its cell alone.
Its volume rate is the sum of phi_c times the rate of the cell, computed with the hat functions of
the 2^d corners at the centre. So forces of the pressure do not jump where points cross cells, and
they are conjugate to volume rates. With hoops, N / r has the radius
of the centre, which gives the mean over a ring.
"""

from karamelo_py.compiler import real, where
from karamelo_py.compiler.fields import StepField, SummedField, field
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.basis.product import digits, places_of, with_each_replaced
from karamelo_py.points.grid import cells_along
from karamelo_py.points.kinematics import gradient, product
from karamelo_py.points.kinematics import total as sum_of

# Columns of `CellSums`: volume; its product with K / n; columns of the volume as a stress; its
# hoop components.
VOLUME, STIFF, AREA = 0, 1, 2


def _of_cells(kin):
    return AREA + kin.dimension**2 + (1 if kin.hoops else 0)


class CellSums(SummedField):
    """Sums over the points of a cell, at its first node."""

    shape = staticmethod(_of_cells)


class CellGrowth(StepField):
    """Relative growth of a cell's volume in a step, at its first node (splines)."""

    @staticmethod
    def needed(basis):
        return not isinstance(basis, Linear)


def are_solved(nodes):
    """Return True if pressures are solved for."""
    return field(nodes.fields, CellSums) is not None


def by_cells(w):
    """Return True if points get the rates of pressure of cells."""
    return isinstance(w.basis, Linear) or are_solved(w.nodes)


def _fractions(node, line, k, direction):
    """Return phi of the cells above and below the k-th node along a direction."""
    zero, one, half = [real(x, node.N) for x in (0, 1, 0.5)]
    last = min(len(line.weights) - 2, cells_along(node.w.grid, direction) - 1 - line.first)
    cell = min(int(line.r), last)
    far = line.r - real(cell, line.r) - half
    other = where(far < 0, cell - 1, cell + 1)
    part = where((other >= 0) & (other <= last), abs(far), zero)

    def phi(c):
        return where(cell == c, one - part, where(other == c, part, zero))

    return phi(k), phi(k - 1)


def _along(node):
    """List, per direction, phi of the cells above and below the node."""
    pairs = zip(node.stencil.lines, places_of(node.stencil, node.k), strict=True)
    return [_fractions(node, line, k, direction) for direction, (line, k) in enumerate(pairs)]


def cell_fraction(node):
    """Return phi of the cell whose first node this is."""
    return product([above for above, _ in _along(node)])


def cell_N(node):
    if isinstance(node.w.basis, Linear):
        return real(0.5**node.kin.dimension, node.N)
    half = real(0.5, node.N)
    return product([half * (above + below) for above, below in _along(node)])


def cell_grad(node):
    kin, w, half = node.kin, node.w, real(0.5, node.N)
    if isinstance(w.basis, Linear):
        slope = real(0.5 ** (kin.dimension - 1), node.N) * w.grid.inv_h
        way = digits(node.k, 2, kin.dimension)
        slopes = [slope if digit else -slope for digit in way]
        pairs = [(1 - digit, digit) for digit in way]
    else:
        pairs = _along(node)
        weights = [half * (above + below) for above, below in pairs]
        steps = [w.grid.inv_h * (below - above) for above, below in pairs]
        slopes = with_each_replaced(weights, steps)
    if kin.hoops:
        (above, below), *others = pairs
        n = real(node.stencil.lines[0].first + places_of(node.stencil, node.k)[0], node.N)
        parts = above / radius_of(w.grid, n), below / radius_of(w.grid, n - 1)
        around = half * sum_of(parts) * product([1, *[half * sum_of(pair) for pair in others]])
        slopes = (*slopes, *[around] * kin.hoops)
    return gradient(kin, slopes)


def radius_of(grid, cell):
    """Return the radius of the centre of the cells `cell` along x."""
    return max(grid.x0 + (cell + 0.5) * grid.h, 0.25 * grid.h)
