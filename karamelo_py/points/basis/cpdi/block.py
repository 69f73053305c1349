"""The nodes around a domain in the plane, each once: three by three.

Corners of one domain mostly lie in two neighbouring cells along each direction, and most of the
nodes of these are seen from several corners. What points give to nodes is summed over the corners
before it gets there. In space that takes more than it saves: 27 nodes, eight corners.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import (
    beside,
    define,
    first_lane,
    fma,
    in_all,
    is_one,
    real,
    shared,
)
from karamelo_py.compiler.symbols import Symbol, call, written
from karamelo_py.points.basis import affine_weight, entry, reach, support
from karamelo_py.points.basis.cpdi.corners import CornerStencil, arm, solve
from karamelo_py.points.basis.product import digits, hoop, node_number
from karamelo_py.points.grid import cells_along
from karamelo_py.points.kinematics import Axisymmetric, dimension
from karamelo_py.points.kinematics.tags import TAGS

WIDTH = 3  # nodes along each direction


class NodeBlock(NamedTuple):
    """The nodes next to a point, and what it sees of them. Nobody computes what nobody reads."""

    first: tuple[int, ...]  # number of the first of them, along each direction
    weights: tuple[float, ...]
    gradients: tuple[tuple[float, ...], ...]  # from those of the corners, without N / r
    holds: bool  # whether the corners lie between them, and no node is missing at a wall
    seen: CornerStencil


class InBlock(NamedTuple):
    """In the place of a basis: the point sees a :class:`NodeBlock`."""

    basis: NamedTuple


@shared
def _hats(a):
    """The linear functions of three nodes, `a` cells from the first."""
    one, none = real(1, a), real(0, a)
    return max(one - a, none), min(a, real(2, a) - a), max(a - one, none)


@shared
def block_of(kin, grid, stencil):
    """The block of a point; () in space."""
    if dimension(kin) > 2:
        return ()
    first, ahead, holds = [], [], True
    for k, at in enumerate(stencil.point):
        low = at - real(0.5, at)
        number = int(low)
        of_corners = [corner.at[k] - real(number, at) for corner in stencil.corners]
        inside = (low >= 0) & (number + 2 <= cells_along(grid, k))
        inside = inside & (min(*of_corners) >= 0) & (max(*of_corners) <= 2)
        holds = inside & holds
        first.append(number)
        ahead.append([_hats(a) for a in of_corners])
    hats = list(zip(*ahead, strict=True))
    weights = _spread_out(hats, stencil.weights)
    slopes = [_spread_out(hats, component) for component in zip(*stencil.gradients, strict=True)]
    return NodeBlock(tuple(first), weights, tuple(zip(*slopes, strict=True)), holds, stencil)


@shared
def is_whole(block):
    """Whether all that the points in all lanes see lies in their blocks."""
    return len(block) > 0 and in_all(block.holds)


@shared
def is_one_block(block):
    """Whether, besides, they see the same block."""
    if len(block) == 0:
        return False
    row, line = block.first
    return is_whole(block) & is_one(row) & is_one(line)


@shared
def of_one(block):
    """The block of points that see the same nodes: their numbers have no lanes."""
    return NodeBlock(tuple([first_lane(number) for number in block.first]), *block[1:])


def _spread_out(hats: Iterable, values: Iterable) -> tuple:
    """Values of the corners at the nodes, by products of the functions along both directions."""
    totals: tuple = ()
    for (rows, line), value in zip(hats, values, strict=True):
        pairs = [(value * row, hat) for row in rows for hat in line]
        if len(totals):
            totals = tuple([fma(*pair, total) for pair, total in zip(pairs, totals, strict=True)])
        else:
            totals = tuple([part * hat for part, hat in pairs])
    return totals


def _register(tag: type) -> None:
    d = tag.dimension
    kin, grid, stencil, k = map(Symbol, ("kin", "grid", "stencil", "k"))
    at = digits("k", WIDTH, d)
    first = node_number(grid.first, [stencil.first[i] for i in range(d)])
    weight = stencil.weights[k]
    gradient: list[Any] = [stencil.gradients[k][i] for i in range(d)]
    if tag is Axisymmetric:
        gradient.append(call(hoop, weight, gradient[0], stencil.seen.inv_r))
    centre = stencil.seen.centre
    arms = [call(arm, grid, stencil.first[i], at[i], centre[i]) for i in range(d)]
    solved = call(solve, kin, stencil.seen.spread, arms)
    seen = "basis, kin, grid, stencil, k"
    number = call(beside, first, node_number(0, at))
    support.on(InBlock, tag)(define("basis, kin", f"return {WIDTH**d}"))
    entry.on(InBlock, tag)(written(seen, (number, weight, gradient)))
    reach.on(InBlock, tag)(written(seen, arms))
    affine_weight.on(InBlock, tag)(written(seen, [weight * solved[i] for i in range(d)]))


for _tag in TAGS:
    if _tag.dimension == 2:
        _register(_tag)
