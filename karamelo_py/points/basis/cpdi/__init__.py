"""Convected particle domain interpolation: the nodes around the corners x_c of a point's domain.

Each basis function is interpolated between the corners (Sadeghirad, Brannon & Burghardt 2011;
Sadeghirad, Brannon & Guilkey 2013):

     N_I = sum_c w_c N_I^lin(x_c),    grad N_I = sum_c g_c N_I^lin(x_c)

w_c and g_c are domain means of corner c's function and gradient. Domains tile the body at any
stretch, without numerical fracture. A family derives from `ConvectedDomain` and defines
:func:`domain`, or, if the grid moves its corners, from `CarriedDomain` and defines `upright` too.
"""

from math import inf
from typing import Any, NamedTuple

from karamelo_py.compiler import index, point_function, real, where
from karamelo_py.compiler.lanes import beside
from karamelo_py.compiler.tuples import flat, nested_as
from karamelo_py.language.rules import known_failure
from karamelo_py.points import basis as bases
from karamelo_py.points.basis import BasisTraits
from karamelo_py.points.basis.product import digits, inverse_radius, item, node_number, with_hoop
from karamelo_py.points.basis.weighted import Weighted
from karamelo_py.points.grid import cells_along, in_cells
from karamelo_py.points.kinematics import cofactor, determinant, gradient, product, total, vector


class Element(NamedTuple):
    kind: str
    corners: int
    edges: tuple[tuple[int, int], ...]  # pairs of corners with positive determinant
    mirrored: tuple[int, ...]  # corners if the determinant is negative
    box: tuple[tuple[int, ...], ...] = ()  # corners of the box of side 2 around 0, if a box


class ConvectedDomain(NamedTuple):
    """Base of CPDI bases with 2^d corners; subclasses define `dimension` and `shape`.

    Affine transfers use distances of nodes from the centre sum_I N_I X_I. The centre differs from
    the point if corners are beyond the grid, or if the domain is not a parallelogram or
    parallelepiped. Angular momentum is conserved about the centres; about the points it varies by
    0.1 % of its variation with FLIP (a spinning square, Q4).
    """

    traits = BasisTraits(cells=3, least_nodes=2, steady_moment=True, steep_edge=False)
    line_nodes = 2  # nodes per corner and direction
    in_lanes = True
    element = None


class CarriedDomain(ConvectedDomain):
    """Base of domains whose corners move with the grid; subclasses define `element`."""

    __slots__ = ()
    traits = ConvectedDomain.traits._replace(shape=("corners",))


BENT, SMALL = 0.2, 0.15  # strain, and fraction of the stable step, for a warning


def _torn_by_bending(basis, scene):
    return (
        scene.moves and scene.elastic and scene.kept > 0.9
        and scene.bending > BENT and scene.fraction > SMALL
    )  # fmt: skip


known_failure(
    ConvectedDomain,
    "domains in large bending",
    when=_torn_by_bending,
    reason="bending strains will be about {scene.bending:.1g} (from speed and weight); "
    "CPDI domains with {scene.transfer_name} at {scene.fraction:.2g} of the stable step then gain "
    "energy, fold or separate, sooner on fine grids (a soft cantilever with 16 cells of height: "
    "1.6 times the energy)",
    cure="dt_factor(0.1) (energy of such a beam within 0.1 % with R4), or method tlmpm",
)

# Smallest extent of a domain in cells, by dimension.
LEAST = (0.0, 0.0, 0.5, 0.0)
# In the order of meshes: around the square; around the lower, then the upper face of the cube.
SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1))
CUBE = tuple((*corner, z) for z in (-1, 1) for corner in SQUARE)


@point_function()
def domain(basis, kin, location):
    """Return corners x_c, weights w_c and gradients g_c."""


@point_function()
def upright(basis, kin, location):
    """Return True if the Jacobian is positive at every corner, so the domain is not folded."""


class Corner(NamedTuple):
    cell: tuple[int, ...]  # cell of a corner, per direction
    fractions: tuple[float, ...]
    at: Any  # cell + fractions, a vector


class CornerStencil(NamedTuple):
    corners: tuple[Corner, ...]
    weights: tuple[float, ...]  # weights of corners
    gradients: tuple[Any, ...]
    point: tuple[float, ...]  # position in cells
    centre: Any  # sum_I N_I X_I in cells, a vector
    spread: tuple[float, ...]  # D of affine transfers: xx yy (zz) xy (xz yz)
    inv_r: float


class AtCorners(NamedTuple):
    """Basis whose nodes are the corners, for sums that are linear in weight or gradient.

    Node numbers are then `Weighted`.
    """

    basis: NamedTuple


def along_cell(grid, direction, x):
    """Return a corner's cell along an axis, the position in it (0 to 1), and their sum.

    Corners beyond the grid are moved to its face, so that weights sum to one.
    """
    cells = cells_along(grid, direction)
    a = in_cells(grid, direction, x)
    a = min(max(real(0, a), a), real(cells, a))  # in this order, NaN becomes 0
    i = min(int(a), cells - 1)
    return i, a - i, a


def corner_at(kin, grid, x):
    cell, fractions, at = zip(*[along_cell(grid, i, x[i]) for i in range(len(x))], strict=True)
    return Corner(tuple(cell), tuple(fractions), vector(kin, at))


def hat(corner, j):
    sides = zip(digits(j, 2, len(corner.cell)), corner.fractions, strict=True)
    return product([where(far > 0, r, 1 - r) for far, r in sides])


def node_around(grid, corner, j):
    first = node_number(grid, grid.first, corner.cell)
    return first, node_number(grid, 0, digits(j, 2, len(corner.cell)))


def around(grid, corner):
    nodes = range(2 ** len(corner.cell))
    rows = tuple([beside(*node_around(grid, corner, j)) for j in nodes])
    return Weighted(rows, tuple([hat(corner, j) for j in nodes]))


def arm(grid, first, far, centre):
    return (real(first + far, centre) - centre) * grid.h


def pairs_of_spread(kin):
    return [pair for pair in kin.Symmetric.places if max(*pair) < kin.dimension]


def spread_of(kin, grid, weight, corner, centre):
    """Return a corner's part of D, w [(x_c - x)(x_c - x)^T + h^2 r (1 - r)]."""
    away, r = corner.at - centre, corner.fractions
    parts: list = []
    for i, j in pairs_of_spread(kin):
        term = away[i] * away[j]
        if i == j:
            term = term + r[i] * (1 - r[i])
        parts = [*parts, weight * (grid.h * grid.h) * term]
    return parts


def solve(kin, spread, a):
    d = kin.dimension
    m = dict(zip(pairs_of_spread(kin), spread, strict=True))
    m = m | {(j, i): value for (i, j), value in m.items()}
    k = 1 / determinant(m, d)
    rows = [total([cofactor(m, d, i, j) * a[j] for j in range(d)]) for i in range(d)]
    return vector(kin, [k * row for row in rows])


@bases.locate.on(ConvectedDomain)
def _locate_corners(basis, kin, grid, location):
    x, weights, gradients = domain(basis, kin, location)
    corners = tuple([corner_at(kin, grid, corner) for corner in x])
    centre = weights[0] * corners[0].at
    for weight, corner in zip(weights[1:], corners[1:], strict=True):
        centre = centre + weight * corner.at
    pairs = zip(weights, corners, strict=True)
    parts = zip(*[spread_of(kin, grid, w, corner, centre) for w, corner in pairs], strict=True)
    spread = tuple([total(term) for term in parts])
    point = tuple([in_cells(grid, i, location[i]) for i in range(kin.dimension)])
    inv_r = inverse_radius(grid.x0 + centre[0] * grid.h)
    return CornerStencil(corners, weights, gradients, point, centre, spread, inv_r)


def seen_at_corner(kin, stencil, c):
    weight, slopes = item(stencil.weights, c), item(stencil.gradients, c)
    return item(stencil.corners, c), weight, with_hoop(kin, weight, slopes, stencil.inv_r)


def of_corner(stencil, c):
    parts = list(zip(stencil.corners, stencil.weights, stencil.gradients, strict=True))
    numbers = flat(parts[0])
    for k, term in enumerate(parts):
        numbers = tuple([where(c == k, a, b) for a, b in zip(flat(term), numbers, strict=True)])
    corner, weight, slopes = nested_as(parts[0], numbers)
    return stencil._replace(corners=(corner,), weights=(weight,), gradients=(slopes,))


@bases.entry.on(ConvectedDomain)
def _entry_corners(basis, kin, grid, stencil, k):
    nodes = 2**kin.dimension
    corner, weight, slopes = seen_at_corner(kin, stencil, k // nodes)
    hat_weight = hat(corner, k % nodes)
    first, far = node_around(grid, corner, k % nodes)
    return index(first + far), weight * hat_weight, gradient(kin, [hat_weight * g for g in slopes])


@bases.reach.on(ConvectedDomain)
def _reach_corners(basis, kin, grid, stencil, k):
    nodes, d = 2**kin.dimension, kin.dimension
    cell, far = item(stencil.corners, k // nodes).cell, digits(k % nodes, 2, d)
    return vector(kin, [arm(grid, cell[i], far[i], stencil.centre[i]) for i in range(d)])


@bases.affine_weight.on(ConvectedDomain)
def _affine_weight_corners(basis, kin, grid, stencil, k):
    nodes = 2**kin.dimension
    weight = item(stencil.weights, k // nodes)
    weight = weight * hat(item(stencil.corners, k // nodes), k % nodes)
    solved = solve(kin, stencil.spread, _reach_corners(basis, kin, grid, stencil, k))
    return vector(kin, [weight * a for a in solved])


@bases.support.on(ConvectedDomain)
def _support_corners(basis, kin):
    return 2**kin.dimension * 2**kin.dimension


@bases.first_node.on(ConvectedDomain)
def _first_node_convected_domain(basis, template):
    return 0.5


@bases.support.on(CarriedDomain)
def _support_carried(basis, kin):
    return basis.element.corners * 2**kin.dimension


@bases.carried.on(CarriedDomain)
@bases.placed.on(CarriedDomain)
def _carried_corners(basis, kin):
    return basis.element.corners


@bases.carrier.on(CarriedDomain)
def _carrier_corners(basis, kin, grid, stencil, corner):
    return around(grid, stencil.corners[corner])


@bases.carry.on(CarriedDomain)
def _carry_corners(basis, kin, location, corner, displacement):
    first = kin.dimension * (1 + corner)
    last = first + kin.dimension
    moves = zip(location[first:last], displacement, strict=True)
    return (*location[:first], *[a + u for a, u in moves], *location[last:])


@bases.extent.on(CarriedDomain)
def _extent_corners(basis, kin, grid, location):
    d = kin.dimension  # NaN if a corner is NaN
    far = abs(location[d] - location[0])
    for k in range(d + 1, d + d * basis.element.corners):
        far = max(abs(location[k] - location[k % d]), far)
    return where(upright(basis, kin, location), max(far * grid.inv_h, LEAST[d]), inf)


@bases.support.on(AtCorners)
def _support_at_corners(basis, kin):
    return bases.support(basis.basis, kin) // 2**kin.dimension


@bases.entry.on(AtCorners)
def _entry_at_corners(basis, kin, grid, stencil, k):
    corner, weight, slopes = seen_at_corner(kin, stencil, k)
    return around(grid, corner), weight, slopes
