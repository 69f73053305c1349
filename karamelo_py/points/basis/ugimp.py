"""Uniform GIMP: hat functions averaged over a domain around the point, of a constant size."""

from typing import NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.points.basis.product import Along, along, register
from karamelo_py.points.basis.wide import wide
from karamelo_py.points.grid import cells_along, in_cells
from karamelo_py.points.kinematics.tensors import total


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

    steep_edge = True
    in_lanes = True
    shape = ("half_size",)


def box(grid, kin, place, direction, least, most):
    """Centre and both ends of a domain along one direction, in cells, before walls cut it."""
    a = in_cells(grid, direction, place[direction])
    half = place[kin.dimension + direction] * grid.inv_h
    half = min(max(half, least), most)
    return a, a - half, a + half


def in_cell(lo, hi, j):
    """Integrate over the part of [lo, hi] in the cell between nodes j and j + 1.

    The integrals over the cell of 1 and of the hat function of node j + 1.
    """
    p = max(lo - j, 0)
    q = min(hi - j, 1)
    length = max(q - p, 0)
    return length, length * (0.5 * (p + q))


def averaged_hats(cells, grid, first, lo, hi):
    """Hats from node `first` on, averaged over [lo, hi].

    The domain lies within so many `cells` from that node; lengths are in cells, counted from it.
    """
    lengths, ahead = zip(*[in_cell(lo, hi, j) for j in range(cells)], strict=True)
    behind = [length - share for length, share in zip(lengths, ahead, strict=True)]
    between = [a + b for a, b in zip(ahead[:-1], behind[1:], strict=True)]
    falls = [lengths[j] - lengths[j + 1] for j in range(cells - 1)]
    k = 1 / total(lengths)
    slope = k * grid.inv_h
    weights = tuple([k * w for w in (behind[0], *between, ahead[-1])])
    gradients = tuple([slope * g for g in (-lengths[0], *falls, lengths[-1])])
    r = 0.5 * (lo + hi)
    arms = [j - r if j else -r for j in range(cells + 1)]
    pairs = list(zip(weights, arms, strict=True))
    k = grid.inv_h / total([w * arm * arm for w, arm in pairs])
    return Along(first, r, weights, gradients, tuple([k * arm * w for w, arm in pairs]))


@along.on(UGIMP)
def _along_ugimp(basis, kin, grid, place, direction):
    a, lo, hi = box(grid, kin, place, direction, 1e-3, 0.5)
    last = cells_along(grid, direction)
    lo = max(lo, 0)
    hi = min(hi, real(last, a))
    first = max(min(int(lo), last - 2), 0)
    start = real(first, a)
    return averaged_hats(2, grid, first, lo - start, hi - start)


register(UGIMP, 3)
wide(UGIMP)
