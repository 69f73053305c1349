"""What all domains share: from corners, their weights and gradients to nodes."""

from collections.abc import Callable
from math import inf, prod
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import Weighted, beside, define, index, real, shared, where
from karamelo_py.compiler.symbols import Symbol, call, cofactor, determinant, written
from karamelo_py.compiler.tuples import add_row, add_scaled, scale
from karamelo_py.points.basis import (
    affine_weight,
    carried,
    carrier,
    carry,
    entry,
    extent,
    first_node,
    locate,
    placed,
    reach,
    support,
)
from karamelo_py.points.basis.cpdi import LEAST, domain, upright
from karamelo_py.points.basis.product import digits, hoop, inverse_radius, node_number
from karamelo_py.points.grid import cells_along, in_cells
from karamelo_py.points.kinematics import Axisymmetric
from karamelo_py.points.kinematics.components import Components, Number, Vector, formula
from karamelo_py.points.kinematics.tags import TAGS


class Corner(NamedTuple):
    """Where a corner lies on the grid."""

    cell: tuple[int, ...]  # its cell, along each direction
    fractions: tuple[float, ...]  # how far into the cell, along each direction
    at: tuple[float, ...]  # both together, in cells from the corner of the grid


class CornerStencil(NamedTuple):
    """What the nodes that a point sees are made of. Nobody computes what nobody reads of it."""

    corners: tuple[Corner, ...]
    weights: tuple[float, ...]  # of the corners, and their gradients
    gradients: tuple[tuple[float, ...], ...]
    point: tuple[float, ...]  # where the point lies, in cells
    centre: tuple[float, ...]  # sum_I N_I X_I, in cells
    spread: tuple[float, ...]  # D of the affine transfers: xx yy (zz) xy (xz yz)
    inv_r: float  # 1 / r of an axisymmetric point


class AtCorners(NamedTuple):
    """In the place of a basis: the point sees the corners of its domain as it else sees nodes.

    A node number is then a :class:`~karamelo_py.compiler.compile.Weighted`. Serves what takes the
    weight or the gradient of a node once, as a factor.
    """

    basis: NamedTuple


# --- one corner -------------------------------------------------------------------------------


@shared
def along_cell(grid, direction, x):
    """The cell of a corner in one direction, how far the corner lies in it (0 to 1), and both.

    A corner beyond the grid counts as lying on its face: weights go on adding up to one.
    """
    cells = cells_along(grid, direction)
    a = in_cells(grid, direction, x)
    a = min(max(real(0, a), a), real(cells, a))  # so written, NaN becomes 0
    i = min(int(a), cells - 1)
    return i, a - real(i, a), a


@formula()
def _corner(kin, grid: Number, x: Vector):
    """Where a corner at `x` lies on the grid."""
    cells = kin.vector(lambda i: call(along_cell, grid, i, x[i]))
    return call(Corner, *([cell[n] for cell in cells] for n in range(3)))


@shared
def _side(far, fraction):
    return where(far > 0, fraction, real(1, fraction) - fraction)


@formula()
def _hat(kin, corner: Number, j: Number):
    """The linear function of the j-th node of a corner's cell."""
    sides = zip(digits("j", 2, kin.dimension), kin.directions, strict=True)
    return prod(call(_side, far, corner.fractions[i]) for far, i in sides)


@formula()
def _node(kin, grid: Number, corner: Number, j: Number):
    """The number of the j-th node of a corner's cell."""
    first = node_number(grid.first, kin.vector(lambda i: corner.cell[i]))
    return call(index, node_number(first, digits("j", 2, kin.dimension)))


@formula()
def _around(kin, grid: Number, corner: Number):
    """The nodes around a corner, and their weights."""
    first = node_number(grid.first, kin.vector(lambda i: corner.cell[i]))
    nodes = range(2**kin.dimension)
    rows = [call(beside, first, node_number(0, digits(str(j), 2, kin.dimension))) for j in nodes]
    return call(Weighted, rows, [call(_hat, Symbol("kin"), corner, j) for j in nodes])


@shared
def arm(grid, first, far, centre):
    """From the weighted centre to the node that is `far` from the `first` along a direction."""
    return (real(first + far, centre) - centre) * grid.h


@formula()
def _away(kin, grid: Number, corner: Number, centre: Vector, j: Number):
    """From the weighted centre to the j-th node of a corner's cell."""
    far = digits("j", 2, kin.dimension)
    return kin.vector(lambda i: call(arm, grid, corner.cell[i], far[i], centre[i]))


# --- all corners ------------------------------------------------------------------------------


def _spread_pairs(kin: Components) -> list[tuple[int, int]]:
    """Rows and columns of D in the layout of :class:`CornerStencil`."""
    return [pair for pair in kin.symmetric_pairs if max(pair) < kin.dimension]


@formula()
def _add_spread(kin, grid: Number, total: Vector, weight: Number, corner: Number, centre: Number):
    """total + the part of one corner in D, that is w [(x_c - x)(x_c - x)^T + h^2 r (1 - r)]."""
    away = kin.vector(lambda i: corner.at[i] - centre[i])
    r = corner.fractions

    def part(i, j):
        within = r[i] * (1 - r[i]) if i == j else 0
        return weight * (grid.h * grid.h) * (away[i] * away[j] + within)

    return [total[n] + part(i, j) for n, (i, j) in enumerate(_spread_pairs(kin))]


@formula()
def solve(kin, spread: Vector, a: Vector):
    """D^-1 a."""
    d = kin.dimension
    m = {pair: spread[n] for n, pair in enumerate(_spread_pairs(kin))}
    m |= {(j, i): value for (i, j), value in m.items()}
    k = 1 / determinant(m, d)
    return kin.vector(lambda i: k * sum(cofactor(m, d, i, j) * a[j] for j in range(d)))


def _seen(tag: type, c: Any) -> tuple[Symbol, Symbol, list[Symbol]]:
    """The c-th corner of a stencil, its weight, and its gradient."""
    stencil = Symbol("stencil")
    weight, gradient = stencil.weights[c], [stencil.gradients[c][i] for i in range(tag.dimension)]
    if tag is Axisymmetric:
        gradient.append(call(hoop, weight, gradient[0], stencil.inv_r))
    return stencil.corners[c], weight, gradient


def _domain_functions(tag: type, corners: int) -> dict[Callable, Callable]:
    """The point functions of domains of so many corners."""
    basis, kin, grid, place, stencil = map(Symbol, ("basis", "kin", "grid", "place", "stencil"))
    described = call(domain, basis, kin, place)
    x, weights, gradients = (described[i] for i in range(3))
    at = [call(_corner, kin, grid, x[c]) for c in range(corners)]
    centre = call(scale, weights[0], at[0].at)
    for c in range(1, corners):
        centre = call(add_scaled, centre, weights[c], at[c].at)
    spread = (0,) * len(_spread_pairs(Components(tag)))
    for c in range(corners):
        spread = call(_add_spread, kin, grid, spread, weights[c], at[c], centre)
    inv_r = call(inverse_radius, grid.x0 + centre[0] * grid.h)
    point = [call(in_cells, grid, i, place[i]) for i in range(tag.dimension)]
    located = call(CornerStencil, at, weights, gradients, point, centre, spread, inv_r)

    d = tag.dimension
    c, j = (Symbol(f"({{}} {operation} {2**d})", Symbol("k")) for operation in ("//", "%"))
    corner, weight, gradient = _seen(tag, c)
    hat = call(_hat, kin, corner, j)
    weight, gradient = weight * hat, [hat * g for g in gradient]
    away = call(_away, kin, grid, corner, stencil.centre, j)
    solved = call(solve, kin, stencil.spread, away)
    seen = "basis, kin, grid, stencil, k"
    return {
        locate: written("basis, kin, grid, place", located, "place[0]"),
        support: define("basis, kin", f"return {corners * 2**d}"),
        entry: written(seen, (call(_node, kin, grid, corner, j), weight, gradient)),
        reach: written(seen, away),
        affine_weight: written(seen, [weight * solved[i] for i in range(d)]),
    }


# --- registration -----------------------------------------------------------------------------


def tags_of(d: int) -> list[type]:
    """The kinematics of so many dimensions."""
    return [tag for tag in TAGS if tag.dimension == d]


def register(basis: type, d: int, corners: int) -> None:
    """Give `basis`, a class with :func:`domain`, what an engine asks of a basis.

    Arms of the affine transfers begin at the weighted centre x = sum_I N_I X_I. Where that is not
    the point (corners beyond the grid; quadrilaterals and hexahedra that are no parallelograms),
    linear momentum stays exact, and angular momentum is that about these centres: what the points
    themselves show wanders by a thousandth of what it does with FLIP (a spinning square, Q4).
    """

    @first_node.on(basis)
    def _first_node_basis(basis, like):
        return real(0.5, like)

    for kin in tags_of(d):
        for function, implementation in _domain_functions(kin, corners).items():
            function.on(basis, kin)(implementation)


def register_carried(basis: type) -> None:
    """Let the corners of `basis`, which defines `upright`, be kept and go with the grid."""
    d, corners = basis.dimension, basis.element.corners
    register(basis, d, corners)
    carried.on(basis)(define("basis, kin", f"return {corners}"))
    placed.on(basis)(define("basis, kin", f"return {corners}"))

    @carrier.on(basis)
    def _carrier_basis(basis, kin, grid, stencil, corner):
        return _around(kin, grid, stencil.corners[corner])

    carry.on(basis)(
        define(
            "basis, kin, place, old, corner, displacement",
            f"return add_row(place, {d} + {d} * corner, displacement)",
            add_row=add_row,
        )
    )
    # How far a corner is from the point in any direction; NaN if any is.
    basis_, kin, place, grid = map(Symbol, ("basis", "kin", "place", "grid"))
    far = abs(place[d] - place[0])
    for k in range(d + 1, d + d * corners):
        far = call(max, abs(place[k] - place[k % d]), far)
    far = call(max, far * grid.inv_h, LEAST[d])
    reached = call(where, call(upright, basis_, kin, place), far, inf)
    extent.on(basis)(written("basis, kin, grid, place", reached, "place[0]"))


for _tag in (tag for tag in TAGS if tag.dimension > 1):
    support.on(AtCorners, _tag)(
        define(
            "basis, kin",
            f"return support(basis.basis, kin) // {2**_tag.dimension}",
            support=support,
        )
    )
    _corner_seen, *_shares = _seen(_tag, Symbol("k"))
    entry.on(AtCorners, _tag)(
        written(
            "basis, kin, grid, stencil, k",
            (call(_around, Symbol("kin"), Symbol("grid"), _corner_seen), *_shares),
        )
    )
