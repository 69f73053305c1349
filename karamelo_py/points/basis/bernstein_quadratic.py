"""Basis Bernstein-quadratic: nodes every h/2."""

from typing import NamedTuple

from karamelo_py.language.rules import known_failure
from karamelo_py.points.basis import BasisTraits, mapped_again, without_moment
from karamelo_py.points.basis.product import Along, along, register, spacing
from karamelo_py.points.grid import cells_along, in_cells


class BernsteinQuadratic(NamedTuple):
    """Quadratic Bernstein polynomials (de Vaucorbeil, Nguyen & Hutchinson 2020).

    Nodes are h/2 apart, four times as many in 2D. Weights are not negative, but gradients jump at
    cell faces, as in a linear basis: use it with tlmpm, where no point crosses a face.

    Example
    -------
    method(tlmpm, FLIP, Bernstein-quadratic, 0.99)
    """

    in_lanes = True
    traits = BasisTraits(
        cells=1,
        least_nodes=3,
        nodes_per_cell=2,
        steady_moment=False,
        steep_edge=True,
        gradient_jumps=True,
    )


known_failure(
    BernsteinQuadratic,
    "points that cross cells",
    when=lambda basis, scene: scene.moves,
    reason="gradients of the basis Bernstein-quadratic jump at cell faces, and points that "
    "cross one get spurious forces as large as their stress",
    cure="method tlmpm, or quadratic-spline",
)


@along.on(BernsteinQuadratic)
def _along_bernstein_quadratic(basis, kin, grid, location, direction):
    a = in_cells(grid, direction, location[direction])
    i = min(int(a), cells_along(grid, direction) - 1)  # the last face belongs to the last cell
    s = a - i
    t = 1 - s
    twice = grid.inv_h + grid.inv_h
    weights = (t * t, (s + s) * t, s * s)
    gradients = (-twice * t, twice * (t - s), twice * s)
    # D = s (1 - s) h^2 / 2 vanishes at corners; N D^-1 (X - x) is the gradient.
    return Along(i + i, s, weights, gradients, gradients)


@spacing.on(BernsteinQuadratic)
def _spacing_bernstein_quadratic(basis):
    return 0.5


mapped_again.on(BernsteinQuadratic)(without_moment)
register(BernsteinQuadratic, 3)
