"""Sums over the corners of a 2D domain at its 3 x 3 nodes, so that each node is loaded once.

In 3D, with 27 nodes and eight corners, such sums would cost more than they save.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

from karamelo_py.compiler import all_lanes, fma, shared
from karamelo_py.compiler.lanes import beside, first_lane, is_one
from karamelo_py.points.basis import affine_weight, entry, reach, support
from karamelo_py.points.basis.cpdi import CornerStencil, arm, solve
from karamelo_py.points.basis.product import digits, item, node_number, with_hoop
from karamelo_py.points.grid import cells_along
from karamelo_py.points.kinematics import vector

WIDTH = 3  # nodes per direction


class NodeBlock(NamedTuple):
    first: tuple[int, ...]  # number of the first node, per direction
    weights: tuple[float, ...]
    gradients: tuple[Any, ...]  # gradients of corners, without N / r
    holds: bool  # all corners are inside and walls remove no node
    seen: CornerStencil


class InBlock(NamedTuple):
    basis: NamedTuple


def block_of(kin, grid, stencil):
    if kin.dimension > 2:
        return ()
    first, ahead, holds = [], [], True
    for k, at in enumerate(stencil.point):
        low = at - 0.5
        number = int(low)
        of_corners = [corner.at[k] - number for corner in stencil.corners]
        inside = (low >= 0) & (number + 2 <= cells_along(grid, k))
        inside = inside & (min(*of_corners) >= 0) & (max(*of_corners) <= 2)
        holds = inside & holds
        first.append(number)
        ahead.append([(max(1 - a, 0), min(a, 2 - a), max(a - 1, 0)) for a in of_corners])
    hats = list(zip(*ahead, strict=True))
    weights = _spread_out(hats, stencil.weights)
    slopes = [_spread_out(hats, component) for component in zip(*stencil.gradients, strict=True)]
    return NodeBlock(tuple(first), weights, tuple(zip(*slopes, strict=True)), holds, stencil)


def is_whole(block):
    return len(block) > 0 and all_lanes(block.holds)


def is_one_block(block):
    if len(block) == 0:
        return False
    row, line = block.first
    return is_whole(block) & is_one(row) & is_one(line)


@shared
def of_one(block):
    return NodeBlock(tuple([first_lane(number) for number in block.first]), *block[1:])


def _spread_out(hats: Iterable, values: Iterable) -> tuple:
    totals: tuple = ()
    for (rows, line), value in zip(hats, values, strict=True):
        pairs = [(value * row, hat) for row in rows for hat in line]
        if len(totals):
            totals = tuple([fma(*pair, total) for pair, total in zip(pairs, totals, strict=True)])
        else:
            totals = tuple([factor * hat for factor, hat in pairs])
    return totals


@support.on(InBlock)
def _support_in_block(basis, kin):
    return WIDTH**kin.dimension


@entry.on(InBlock)
def _entry_in_block(basis, kin, grid, stencil, k):
    weight, slopes = item(stencil.weights, k), item(stencil.gradients, k)
    first = node_number(grid, grid.first, stencil.first)
    number = beside(first, node_number(grid, 0, digits(k, WIDTH, kin.dimension)))
    return number, weight, with_hoop(kin, weight, slopes, stencil.seen.inv_r)


@reach.on(InBlock)
def _reach_in_block(basis, kin, grid, stencil, k):
    lines = zip(stencil.first, digits(k, WIDTH, kin.dimension), stencil.seen.centre, strict=True)
    return vector(kin, [arm(grid, *line) for line in lines])


@affine_weight.on(InBlock)
def _affine_weight_in_block(basis, kin, grid, stencil, k):
    solved = solve(kin, stencil.seen.spread, _reach_in_block(basis, kin, grid, stencil, k))
    weight = item(stencil.weights, k)
    return vector(kin, [weight * a for a in solved])
