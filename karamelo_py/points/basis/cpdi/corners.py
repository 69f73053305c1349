"""Stencils of domains: from corners, their weights and gradients to nodes."""

from math import inf
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import Weighted, beside, index, real, where
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
from karamelo_py.points.basis.product import (
    digits,
    hoop,
    inverse_radius,
    item,
    node_number,
    product,
)
from karamelo_py.points.grid import cells_along, in_cells
from karamelo_py.points.kinematics import TAGS, Axisymmetric, gradient, vector
from karamelo_py.points.kinematics.tensors import cofactor, determinant, total


class Corner(NamedTuple):
    """Position of a corner on the grid."""

    cell: tuple[int, ...]  # its cell, along each direction
    fractions: tuple[float, ...]  # how far into the cell, along each direction
    at: Any  # both together, in cells from the corner of the grid, a vector


class CornerStencil(NamedTuple):
    """Corners of a domain, from which its nodes follow. Fields that nobody reads cost nothing."""

    corners: tuple[Corner, ...]
    weights: tuple[float, ...]  # of the corners, and their gradients
    gradients: tuple[Any, ...]
    point: tuple[float, ...]  # where the point lies, in cells
    centre: Any  # sum_I N_I X_I, in cells, a vector
    spread: tuple[float, ...]  # D of the affine transfers: xx yy (zz) xy (xz yz)
    inv_r: float  # 1 / r of an axisymmetric point


class AtCorners(NamedTuple):
    """In the place of a basis: the point sees the corners of its domain as it else sees nodes.

    A node number is then a :class:`~karamelo_py.compiler.compile.Weighted`. Serves what takes the
    weight or the gradient of a node once, as a factor.
    """

    basis: NamedTuple


# --- one corner -------------------------------------------------------------------------------


def along_cell(grid, direction, x):
    """The cell of a corner in one direction, how far the corner lies in it (0 to 1), and both.

    A corner beyond the grid counts as lying on its face: weights go on adding up to one.
    """
    cells = cells_along(grid, direction)
    a = in_cells(grid, direction, x)
    a = min(max(real(0, a), a), real(cells, a))  # so written, NaN becomes 0
    i = min(int(a), cells - 1)
    return i, a - real(i, a), a


def corner_at(kin, grid, x):
    """Find where a corner at `x` lies on the grid."""
    cell, fractions, at = zip(*[along_cell(grid, i, x[i]) for i in range(len(x))], strict=True)
    return Corner(tuple(cell), tuple(fractions), vector(kin, at))


def hat(corner, j):
    """Linear function of the j-th node of a corner's cell."""
    sides = zip(digits(j, 2, len(corner.cell)), corner.fractions, strict=True)
    return product([where(far > 0, r, 1 - r) for far, r in sides])


def node_around(grid, corner, j):
    """Number of the j-th node of a corner's cell, and that of the first."""
    first = node_number(grid, grid.first, corner.cell)
    return first, node_number(grid, 0, digits(j, 2, len(corner.cell)))


def around(grid, corner):
    """The nodes around a corner, and their weights."""
    nodes = range(2 ** len(corner.cell))
    rows = tuple([beside(*node_around(grid, corner, j)) for j in nodes])
    return Weighted(rows, tuple([hat(corner, j) for j in nodes]))


def arm(grid, first, far, centre):
    """From the weighted centre to the node that is `far` from the `first` along a direction."""
    return (real(first + far, centre) - centre) * grid.h


# --- all corners ------------------------------------------------------------------------------


def pairs_of_spread(kin):
    """Rows and columns of D in the layout of :class:`CornerStencil`."""
    return [pair for pair in kin.Symmetric.places if max(*pair) < kin.dimension]


def spread_of(kin, grid, weight, corner, centre):
    """The part of one corner in D, that is w [(x_c - x)(x_c - x)^T + h^2 r (1 - r)]."""
    away, r = corner.at - centre, corner.fractions
    parts: list = []
    for i, j in pairs_of_spread(kin):
        part = away[i] * away[j]
        if i == j:
            part = part + r[i] * (1 - r[i])
        parts = [*parts, weight * (grid.h * grid.h) * part]
    return parts


def solve(kin, spread, a):
    """D^-1 a."""
    d = kin.dimension
    m = dict(zip(pairs_of_spread(kin), spread, strict=True))
    m = m | {(j, i): value for (i, j), value in m.items()}
    k = 1 / determinant(m, d)
    rows = [total([cofactor(m, d, i, j) * a[j] for j in range(d)]) for i in range(d)]
    return vector(kin, [k * row for row in rows])


def locate_corners(basis, kin, grid, place):
    """See `locate`."""
    x, weights, gradients = domain(basis, kin, place)
    corners = tuple([corner_at(kin, grid, corner) for corner in x])
    centre = weights[0] * corners[0].at
    for weight, corner in zip(weights[1:], corners[1:], strict=True):
        centre = centre + weight * corner.at
    pairs = zip(weights, corners, strict=True)
    parts = zip(*[spread_of(kin, grid, w, corner, centre) for w, corner in pairs], strict=True)
    spread = tuple([total(part) for part in parts])
    point = tuple([in_cells(grid, i, place[i]) for i in range(kin.dimension)])
    inv_r = inverse_radius(grid.x0 + centre[0] * grid.h)
    return CornerStencil(corners, weights, gradients, point, centre, spread, inv_r)


def seen_at_corner(kin, stencil, c):
    """The c-th corner of a stencil, its weight, and its gradient."""
    weight, slopes = item(stencil.weights, c), item(stencil.gradients, c)
    if isinstance(kin, Axisymmetric):
        slopes = (*slopes, hoop(weight, slopes[0], stencil.inv_r))
    return item(stencil.corners, c), weight, gradient(kin, slopes)


def entry_of_corners(basis, kin, grid, stencil, k):
    """See `entry`."""
    nodes = 2**kin.dimension
    corner, weight, slopes = seen_at_corner(kin, stencil, k // nodes)
    share = hat(corner, k % nodes)
    first, far = node_around(grid, corner, k % nodes)
    return index(first + far), weight * share, gradient(kin, [share * g for g in slopes])


def reach_of_corners(basis, kin, grid, stencil, k):
    """See `reach`."""
    nodes, d = 2**kin.dimension, kin.dimension
    cell, far = item(stencil.corners, k // nodes).cell, digits(k % nodes, 2, d)
    return vector(kin, [arm(grid, cell[i], far[i], stencil.centre[i]) for i in range(d)])


def affine_weight_of_corners(basis, kin, grid, stencil, k):
    """See `affine_weight`."""
    nodes = 2**kin.dimension
    weight = item(stencil.weights, k // nodes)
    weight = weight * hat(item(stencil.corners, k // nodes), k % nodes)
    solved = solve(kin, stencil.spread, reach_of_corners(basis, kin, grid, stencil, k))
    return vector(kin, [weight * a for a in solved])


# --- registration -----------------------------------------------------------------------------


def tags_of(d: int) -> list[type]:
    """The kinematics of so many dimensions."""
    return [tag for tag in TAGS if tag.dimension == d]


def support_of_corners(basis, kin):
    """See `support`."""
    return basis.domain_corners * 2**kin.dimension


def half_cell(basis, like):
    """See `first_node`."""
    return 0.5


def register(basis: type, d: int, corners: int) -> None:
    """Give `basis`, a class with :func:`domain`, what an engine asks of a basis.

    Arms of the affine transfers begin at the weighted centre x = sum_I N_I X_I. Where that is not
    the point (corners beyond the grid; quadrilaterals and hexahedra that are no parallelograms),
    linear momentum stays exact, and angular momentum is that about these centres: what the points
    themselves show wanders by a thousandth of what it does with FLIP (a spinning square, Q4).
    """
    basis.domain_corners = corners
    first_node.on(basis)(half_cell)
    for kin in tags_of(d):
        locate.on(basis, kin)(locate_corners)
        support.on(basis, kin)(support_of_corners)
        entry.on(basis, kin)(entry_of_corners)
        reach.on(basis, kin)(reach_of_corners)
        affine_weight.on(basis, kin)(affine_weight_of_corners)


def all_corners(basis, kin):
    """See `carried` and `placed`."""
    return basis.domain_corners


def carrier_of_corner(basis, kin, grid, stencil, corner):
    """See `carrier`."""
    return around(grid, stencil.corners[corner])


def carry_corner(basis, kin, place, old, corner, displacement):
    """See `carry`."""
    first = kin.dimension * (1 + corner)
    last = first + kin.dimension
    moves = zip(place[first:last], displacement, strict=True)
    return (*place[:first], *[a + u for a, u in moves], *place[last:])


def extent_of_corners(basis, kin, grid, place):
    """See `extent`; NaN if any corner is."""
    d = kin.dimension
    far = abs(place[d] - place[0])
    for k in range(d + 1, d + d * basis.domain_corners):
        far = max(abs(place[k] - place[k % d]), far)
    return where(upright(basis, kin, place), max(far * grid.inv_h, LEAST[d]), inf)


def register_carried(basis: type) -> None:
    """Let the corners of `basis`, which defines `upright`, be kept and go with the grid."""
    register(basis, basis.dimension, basis.element.corners)
    carried.on(basis)(all_corners)
    placed.on(basis)(all_corners)
    carrier.on(basis)(carrier_of_corner)
    carry.on(basis)(carry_corner)
    extent.on(basis)(extent_of_corners)


def support_at_corners(basis, kin):
    """See `support`."""
    return support(basis.basis, kin) // 2**kin.dimension


def entry_at_corners(basis, kin, grid, stencil, k):
    """See `entry`."""
    corner, weight, slopes = seen_at_corner(kin, stencil, k)
    return around(grid, corner), weight, slopes


for _tag in (tag for tag in TAGS if tag.dimension > 1):
    support.on(AtCorners, _tag)(support_at_corners)
    entry.on(AtCorners, _tag)(entry_at_corners)
