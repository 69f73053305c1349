"""Bases that are a product of one function a direction: hats, splines, uniform GIMP.

The one-dimensional part is the point function `along`; everything else is the same product for any
number of directions, unrolled from one definition.
"""

from collections.abc import Callable
from functools import cache
from math import prod
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import (
    beside,
    define,
    first_lane,
    is_one,
    point_function,
    real,
    shared,
    where,
)
from karamelo_py.compiler.symbols import Symbol, call, written
from karamelo_py.points.basis import affine_weight, entry, locate, reach, support
from karamelo_py.points.kinematics import Axisymmetric
from karamelo_py.points.kinematics.tags import TAGS


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
    """Whether the points in all lanes see the same nodes."""
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
def spacing(basis, like):
    """Distance of neighbouring nodes, in cells."""
    return real(1, like)


@point_function(otherwise=True)
def inverse_spread(basis, grid):
    """(D^-1,) of functions for which it is the same away from walls (`evenly`); else nothing."""
    return ()


@point_function(otherwise=True)
def evenly(basis, grid, stencil):
    """Whether D^-1 of a point is `inverse_spread`."""
    return True


@shared
def hoop(weight, gradient, inv_r):
    """N / r at an axisymmetric point; at r = 0 its limit, dN/dr (`inv_r` is 0 there)."""
    return where(inv_r > 0, weight * inv_r, gradient)


@shared
def inverse_radius(r):
    """1 / r, or 0 on the axis and so close to it that 1 / r would overflow."""
    least = real(1e-30, r)
    return where(r > least, real(1, r) / max(r, least), real(0, r))


@shared
def _arm(basis, grid, line, k):
    """X_I - x along one direction."""
    return (real(k, line.r) * spacing(basis, line.r) - line.r) * grid.h


@shared
def _radius(basis, grid, line):
    """The radius that the weights reproduce: the point's, but for domains cut at a wall."""
    r = line.r - line.r
    for k in range(len(line.weights)):
        node = real(line.first + k, r) * spacing(basis, r)
        r += line.weights[k] * (grid.x0 + node * grid.h)
    return r


def node_number(first: Any, numbers: Any) -> Symbol:
    """The number in `grid` of the node that is so many along each direction from node `first`."""
    grid = Symbol("grid")
    steps = (*(grid.step_x, grid.step_y)[: len(numbers) - 1], 1)
    return sum((n * step for n, step in zip(numbers, steps, strict=True)), first)


def digits(k: str, base: int, d: int) -> list[Symbol]:
    """The `d` digits of a number in this base, the highest first."""
    divided = [Symbol(f"({{}} // {base**i})", Symbol(k)) if i else Symbol(k) for i in range(d)]
    divided.reverse()
    return [divided[0], *(Symbol(f"({{}} % {base})", item) for item in divided[1:])]


@cache
def _written(kin: type, width: int) -> dict[Callable, Callable]:
    """The point functions of a product of `width` nodes a direction."""
    d, axisymmetric = kin.dimension, kin is Axisymmetric
    basis, grid, stencil = Symbol("basis"), Symbol("grid"), Symbol("stencil")
    lines = [call(along, basis, Symbol("kin"), grid, Symbol("place"), i) for i in range(d)]
    inv_r = call(inverse_radius, call(_radius, basis, grid, lines[0])) if axisymmetric else 0
    located = call(Stencil, lines, inv_r)

    lines = [stencil.lines[i] for i in range(d)]
    at = digits("k", width, d)
    weights = [line.weights[k] for line, k in zip(lines, at, strict=True)]
    weight = prod(weights)

    def with_one(of: list[Symbol]) -> list[Symbol]:
        """For each direction the product of the weights, with one of `of` in place of its own."""
        others = [values[k] for values, k in zip(of, at, strict=True)]
        return [prod([*weights[:i], others[i], *weights[i + 1 :]]) for i in range(d)]

    gradient = with_one([line.gradients for line in lines])
    affine = [call(affine_along, basis, grid, line, i) for i, line in enumerate(lines)]
    if axisymmetric:
        gradient.append(call(hoop, weight, gradient[0], stencil.inv_r))
    first = node_number(grid.first, [line.first for line in lines])
    node = call(beside, first, node_number(0, at))
    arms = [call(_arm, basis, grid, *pair) for pair in zip(lines, at, strict=True)]
    seen = "basis, kin, grid, stencil, k"
    return {
        locate: written("basis, kin, grid, place", located),
        support: define("basis, kin", f"return {width**d}"),
        entry: written(seen, (node, weight, gradient)),
        reach: written(seen, arms),
        affine_weight: written(seen, with_one(affine)),
    }


def register(basis: type, width: int) -> None:
    """Give `basis` (a class with `along`, `width` nodes a direction) every point function.

    And the attributes of its kind that it does not have itself.
    """
    cells = 1 if width == 2 else 3
    usual = {"cells": cells, "nodes_per_cell": 1, "least_nodes": width, "steady_moment": True}
    for name, value in usual.items():
        setattr(basis, name, getattr(basis, name, value))
    for kin in TAGS:
        for function, implementation in _written(kin, width).items():
            function.on(basis, kin)(implementation)
