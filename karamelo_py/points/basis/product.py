"""Bases that are products of one function per direction: hats, splines, uniform GIMP."""

from typing import Any, NamedTuple

from karamelo_py.compiler import point_function, real, where
from karamelo_py.compiler.lanes import beside, first_lane, is_one
from karamelo_py.language.rules import suggestion
from karamelo_py.points.basis import affine_weight, entry, locate, reach, support
from karamelo_py.points.grid import cells_along, in_cells
from karamelo_py.points.kinematics import gradient, product, vector


class Along(NamedTuple):
    first: int  # number of the first node
    r: float  # distance from the first node, in cells
    weights: tuple[float, ...]
    gradients: tuple[float, ...]
    affine: tuple[float, ...]  # N D^-1 (X_I - x), D = sum N (X_I - x)^2
    ends: tuple[tuple[int, float], ...] = ()  # box ends: cell from `first`, position in cell


class Stencil(NamedTuple):
    lines: tuple[Along, ...]
    inv_r: float  # 1 / r around an axis or centre


def sees_same_nodes(stencil):
    first, *rest = (is_one(line.first) for line in stencil.lines)
    for same in rest:
        first = first & same
    return first


def with_one_node(stencil):
    lines = tuple(type(line)(first_lane(line.first), *line[1:]) for line in stencil.lines)
    return Stencil(lines, stencil.inv_r)


@point_function()
def along(basis, kin, grid, location, direction):
    pass


@point_function(otherwise=True)
def affine_along(basis, grid, line, direction):
    """Return N D^-1 (X_I - x) of the nodes of a line, if `along` of the basis does not give it."""
    return line.affine


@point_function(otherwise=True)
def spacing(basis):
    return 1


@point_function(otherwise=True)
def inverse_spread(basis, grid):
    """Return (D^-1,) if D is constant away from walls (`evenly`), else ()."""
    return ()


@point_function(otherwise=True)
def retained(basis, stencil):
    """Return the fraction of a stored velocity gradient to retain, per direction, or ()."""
    return ()


@point_function(otherwise=True)
def evenly(basis, grid, stencil):
    """Return True if a point's D^-1 is `inverse_spread`."""
    return True


def with_hoop(kin, weight, slopes, inv_r):
    """Return a weight's gradient, then N / r (dN/dr at r = 0) per hoop direction."""
    if kin.hoops:
        slopes = (*slopes, *[where(inv_r > 0, weight * inv_r, slopes[0])] * kin.hoops)
    return gradient(kin, slopes)


def inverse_radius(r):
    return where(r > 1e-30, 1 / max(r, 1e-30), 0)


def radius(basis, grid, line):
    """Return sum N r, the radius of a point unless a wall cuts its domain."""
    r = line.r - line.r
    for k in range(len(line.weights)):
        node = real(line.first + k, r) * spacing(basis)
        r += line.weights[k] * (grid.x0 + node * grid.h)
    return r


def node_number(grid, first, steps):
    *others, last = steps
    for step, far in zip(others, (grid.step_x, grid.step_y), strict=False):
        first = first + step * far
    return first + last


def cell_number(kin, grid, location):
    number = 0
    for k in range(kin.dimension):
        count = cells_along(grid, k)
        number = number * count + max(min(int(in_cells(grid, k, location[k])), count - 1), 0)
    return number + grid.first_cell


def digits(k, base, d):
    lower: list = []
    for _ in range(d - 1):
        lower = [k % base, *lower]
        k = k // base
    return [k, *lower]


def item(values, k):
    return values[k]


def with_each_replaced(weights, others):
    pairs = enumerate(others)
    return [product([*weights[:i], other, *weights[i + 1 :]]) for i, other in pairs]


def places_of(stencil, k):
    return digits(k, len(stencil.lines[0].weights), len(stencil.lines))


def weights_of(stencil, at):
    return [item(line.weights, n) for line, n in zip(stencil.lines, at, strict=True)]


def _locate_product(basis, kin, grid, location):
    lines = tuple([along(basis, kin, grid, location, i) for i in range(kin.dimension)])
    return Stencil(lines, inverse_radius(radius(basis, grid, lines[0])) if kin.hoops else 0)


def _support_product(basis, kin):
    return basis.line_nodes**kin.dimension


def _entry_product(basis, kin, grid, stencil, k):
    at = places_of(stencil, k)
    weights = weights_of(stencil, at)
    lines = zip(stencil.lines, at, strict=True)
    slopes = with_each_replaced(weights, [item(line.gradients, n) for line, n in lines])
    weight = product(weights)
    first = node_number(grid, grid.first, [line.first for line in stencil.lines])
    number = beside(first, node_number(grid, 0, at))
    return number, weight, with_hoop(kin, weight, slopes, stencil.inv_r)


def _reach_product(basis, kin, grid, stencil, k):
    pairs = zip(stencil.lines, places_of(stencil, k), strict=True)
    steps = [real(n, line.r) * spacing(basis) - line.r for line, n in pairs]
    return vector(kin, [step * grid.h for step in steps])


def _affine_weight_product(basis, kin, grid, stencil, k):
    at = places_of(stencil, k)
    lines = enumerate(zip(stencil.lines, at, strict=True))
    affine = [item(affine_along(basis, grid, line, i), n) for i, (line, n) in lines]
    return vector(kin, with_each_replaced(weights_of(stencil, at), affine))


def register(basis: type, width: int) -> None:
    """Define all point functions of `basis`, which has `along` and `width` nodes per direction."""
    basis.line_nodes = width
    locate.on(basis)(_locate_product)
    support.on(basis)(_support_product)
    entry.on(basis)(_entry_product)
    reach.on(basis)(_reach_product)
    affine_weight.on(basis)(_affine_weight_product)


def warn_of_many_nodes(basis: type) -> None:
    suggestion(
        basis,
        when=_seen,
        cost="{scene.basis_name} uses {nodes} nodes per point; in a total Lagrangian method no "
        "point crosses cells, and a linear basis, with {scene.corners} nodes, has the same order",
        instead="linear in method(...); karamelo-py sweep shows the errors of both",
    )


def _seen(basis: Any, scene: Any) -> dict[str, int] | None:
    return None if scene.moves else {"nodes": (basis.traits.cells + 1) ** scene.d}
