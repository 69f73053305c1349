"""Bases that are a product of one function a direction: hats, splines, uniform GIMP.

The one-dimensional part is the point function `along`; everything else is the same product for any
number of directions.
"""

from typing import NamedTuple

from karamelo_py.compiler.compile import (
    beside,
    first_lane,
    is_one,
    point_function,
    real,
    shared,
    where,
)
from karamelo_py.points.basis import affine_weight, entry, locate, reach, support
from karamelo_py.points.kinematics import TAGS, Axisymmetric, gradient, vector


class Along(NamedTuple):
    """The nodes that a point sees in one direction."""

    first: int  # number of the first of them in this direction
    r: float  # distance of the point from it, in cells
    weights: tuple[float, ...]  # N of each
    gradients: tuple[float, ...]  # dN/dx of each
    affine: tuple[float, ...]  # N D^-1 (X_I - x) of each, D the mean of (X_I - x)^2 under N


class Stencil(NamedTuple):
    """The nodes that a point sees, however these are numbered."""

    lines: tuple[Along, ...]  # along each direction
    inv_r: float  # 1 / r of an axisymmetric point


@shared
def sees_same_nodes(stencil):
    """Check that the points in all lanes see the same nodes."""
    first, *rest = (is_one(line.first) for line in stencil.lines)
    for same in rest:
        first = first & same
    return first


@shared
def with_one_node(stencil):
    """The stencil of points that see the same nodes: their numbers have no lanes."""
    lines = tuple(type(line)(first_lane(line.first), *line[1:]) for line in stencil.lines)
    return Stencil(lines, stencil.inv_r)


@point_function()
def along(basis, kin, grid, place, direction):
    """The nodes that a point sees in one direction: an :class:`Along`, perhaps with more."""


@point_function(otherwise=True)
def affine_along(basis, grid, line, direction):
    """N D^-1 (X_I - x) of each node of a line, where `along` leaves it to those who need it."""
    return line.affine


@point_function(otherwise=True)
def spacing(basis):
    """Distance of neighbouring nodes, in cells."""
    return 1


@point_function(otherwise=True)
def inverse_spread(basis, grid):
    """(D^-1,) of functions for which it is the same away from walls (`evenly`); else nothing."""
    return ()


@point_function(otherwise=True)
def evenly(basis, grid, stencil):
    """Check that D^-1 of a point is `inverse_spread`."""
    return True


def hoop(weight, gradient, inv_r):
    """N / r at an axisymmetric point; at r = 0 its limit, dN/dr (`inv_r` is 0 there)."""
    return where(inv_r > 0, weight * inv_r, gradient)


def inverse_radius(r):
    """1 / r, or 0 on the axis and so close to it that 1 / r would overflow."""
    return where(r > 1e-30, 1 / max(r, 1e-30), 0)


def radius(basis, grid, line):
    """Radius that the weights reproduce: the point's, but for domains cut at a wall."""
    r = line.r - line.r
    for k in range(len(line.weights)):
        node = real(line.first + k, r) * spacing(basis)
        r += line.weights[k] * (grid.x0 + node * grid.h)
    return r


# --- numbers of nodes -------------------------------------------------------------------------


def node_number(grid, first, steps):
    """Number of the node that is so many steps along each direction from node `first`."""
    *others, last = steps
    for step, far in zip(others, (grid.step_x, grid.step_y), strict=False):
        first = first + step * far
    return first + last


def digits(k, base, d):
    """Split a number into `d` digits in a base, the highest first."""
    divided = [k // base**i if i else k for i in reversed(range(d))]
    return [divided[0], *[n % base for n in divided[1:]]]


def item(values, k):
    """Take values[k], where only a run may know k."""
    return values[k]


def product(factors):
    """Multiply factors, from the first on."""
    made = factors[0]
    for factor in factors[1:]:
        made = made * factor
    return made


# --- the product ------------------------------------------------------------------------------


def each_for_its_own(weights, others):
    """Multiply weights; for each direction with one of `others` in the place of its own."""
    pairs = enumerate(others)
    return [product([*weights[:i], other, *weights[i + 1 :]]) for i, other in pairs]


def places_of(stencil, k):
    """Find which node of each line the k-th node of a stencil is."""
    return digits(k, len(stencil.lines[0].weights), len(stencil.lines))


def weights_of(stencil, at):
    """Find the weights along each direction."""
    return [item(line.weights, n) for line, n in zip(stencil.lines, at, strict=True)]


def locate_product(basis, kin, grid, place):
    """See `locate`."""
    lines = tuple([along(basis, kin, grid, place, i) for i in range(kin.dimension)])
    axis = isinstance(kin, Axisymmetric)
    return Stencil(lines, inverse_radius(radius(basis, grid, lines[0])) if axis else 0)


def support_of_product(basis, kin):
    """See `support`."""
    return basis.line_nodes**kin.dimension


def entry_of_product(basis, kin, grid, stencil, k):
    """See `entry`."""
    at = places_of(stencil, k)
    weights = weights_of(stencil, at)
    lines = zip(stencil.lines, at, strict=True)
    slopes = each_for_its_own(weights, [item(line.gradients, n) for line, n in lines])
    weight = product(weights)
    if isinstance(kin, Axisymmetric):
        slopes = [*slopes, hoop(weight, slopes[0], stencil.inv_r)]
    first = node_number(grid, grid.first, [line.first for line in stencil.lines])
    return beside(first, node_number(grid, 0, at)), weight, gradient(kin, slopes)


def reach_of_product(basis, kin, grid, stencil, k):
    """See `reach`."""
    pairs = zip(stencil.lines, places_of(stencil, k), strict=True)
    steps = [real(n, line.r) * spacing(basis) - line.r for line, n in pairs]
    return vector(kin, [step * grid.h for step in steps])


def affine_weight_of_product(basis, kin, grid, stencil, k):
    """See `affine_weight`."""
    at = places_of(stencil, k)
    lines = enumerate(zip(stencil.lines, at, strict=True))
    affine = [item(affine_along(basis, grid, line, i), n) for i, (line, n) in lines]
    return vector(kin, each_for_its_own(weights_of(stencil, at), affine))


def register(basis: type, width: int) -> None:
    """Give `basis` (a class with `along`, `width` nodes a direction) every point function.

    And the attributes of its kind that it does not have itself.
    """
    cells = 1 if width == 2 else 3
    usual = {"cells": cells, "nodes_per_cell": 1, "least_nodes": width, "steady_moment": True}
    for name, value in usual.items():
        setattr(basis, name, getattr(basis, name, value))
    basis.line_nodes = width
    for kin in TAGS:
        locate.on(basis, kin)(locate_product)
        support.on(basis, kin)(support_of_product)
        entry.on(basis, kin)(entry_of_product)
        reach.on(basis, kin)(reach_of_product)
        affine_weight.on(basis, kin)(affine_weight_of_product)
