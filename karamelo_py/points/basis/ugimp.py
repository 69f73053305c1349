"""Uniform GIMP: hat functions averaged over a domain around the point, of a constant size."""

from collections.abc import Callable
from typing import NamedTuple

from karamelo_py.compiler.compile import real, shared
from karamelo_py.compiler.symbols import Symbol, call, written
from karamelo_py.points.basis.product import Along, along, register
from karamelo_py.points.basis.wide import wide
from karamelo_py.points.grid import cells_along, in_cells
from karamelo_py.points.kinematics import dimension


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


def averaged_hats(cells: int) -> Callable:
    """Make ``f(grid, first, lo, hi)``: hats from node `first` on, averaged over [lo, hi].

    The domain lies within so many `cells` from that node; lengths are in cells, counted from it.
    """
    lo, hi, inv_h = Symbol("lo"), Symbol("hi"), Symbol("grid").inv_h
    parts = [call(in_cell, lo, hi, j) for j in range(cells)]
    k = 1 / sum(part[0] for part in parts)
    slope = k * inv_h
    weights, gradients = [], []
    before = (0, 0)
    for part in (*parts, (0, 0)):
        # What is in the cell before the node, of its hat; and of the cell behind it.
        behind = part[0] - part[1]
        weights.append(k * (before[1] + behind))
        gradients.append(slope * (before[0] - part[0]))
        before = part
    r = 0.5 * (lo + hi)
    arms = [j - r if j else -r for j in range(cells + 1)]
    spread = sum(w * arm * arm for w, arm in zip(weights, arms, strict=True))
    k = inv_h / spread
    affine = [k * arm * w for w, arm in zip(weights, arms, strict=True)]
    line = call(Along, Symbol("first"), r, weights, gradients, affine)
    return shared(written("grid, first, lo, hi", line, "lo"))


_averaged = averaged_hats(2)


@along.on(UGIMP)
def _along_ugimp(basis, kin, grid, place, direction):
    a, lo, hi = box(grid, kin, place, direction, 1e-3, 0.5)
    last = cells_along(grid, direction)
    lo = max(lo, real(0, a))
    hi = min(hi, real(last, a))
    first = max(min(int(lo), last - 2), 0)
    start = real(first, a)
    return _averaged(grid, first, lo - start, hi - start)


register(UGIMP, 3)
wide(UGIMP)
