"""Sorting points by tile, and the reach of their domains."""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import at_hand, kernel, noinline
from karamelo_py.compiler.fields import pick_items, put_items
from karamelo_py.compiler.threads import by_team, by_threads, shared_out
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import Number
from karamelo_py.kernels.views import location_at
from karamelo_py.points.basis import extent
from karamelo_py.points.grid import Grid, cells_along, in_cells


class TileGrid(NamedTuple):
    size: np.ndarray  # (d,) in cells
    count: np.ndarray  # (g, d) tiles
    first: np.ndarray  # (g + 1,) first tile


class Neighbourhood(NamedTuple):
    top: np.ndarray  # (g, d) last node of each grid
    per_cell: int
    beyond: int  # nodes of the stencil beyond the cell
    least: int  # stencils of points at a wall include all nodes up to this one
    reach: float
    offset: float  # offset of the first node of a stencil (`points.basis.first_node`)


class SortKeys(NamedTuple):
    tiles: TileGrid
    around: Neighbourhood
    ids: np.ndarray  # (n,)


class SortedOrder(NamedTuple):
    """Order and boxes of n points, sorted by threads in parts."""

    width: int  # number of points in a group
    ends: np.ndarray  # (parts, T) ends of tiles; the last row is final
    share: np.ndarray  # (parts + 1,) first tile of each part, by number of points
    boxes: np.ndarray  # (2, T, d) first and last nodes in the stencils of each tile's points
    bins: np.ndarray  # (parts, 2, cells of a tile) scratch
    order: np.ndarray  # (n,) previous indices
    tile: np.ndarray  # (n,)
    room: np.ndarray  # (2, n) scratch


def cell_of(grid: Grid, direction: int, at: Number) -> int:
    """Return the cell of a point at `at` cells, clamped to the grid, as hooks may have moved it."""
    return min(max(int(at), 0), cells_along(grid, direction) - 1)


def _seen(grid, around, g, direction, at):
    """Return the first and last node in the stencil of a point at `at` cells in grid `g`."""
    first = cell_of(grid, direction, at - around.reach)
    last = cell_of(grid, direction, at + around.reach)
    top = around.top[g, direction]
    low = max(first * around.per_cell - around.beyond, 0)
    high = min((last + 1) * around.per_cell + around.beyond, top)
    return min(low, top - around.least), max(high, around.least)


@by_threads
def find_tiles(at, tiles, ends, tile, k):
    """Fill `tile` (n,) for a part of the points, and counts `ends` (parts, T)."""
    (_, kin, grids, of, x), tiles = at_hand(at), at_hand(tiles)
    parts = ends.shape[0]
    for t in range(ends.shape[1]):
        ends[k, t] = 0
    for p in range(of.size * k // parts, of.size * (k + 1) // parts):
        g = of[p]
        grid = record(grids, g)
        number = 0
        for i in range(kin.dimension):
            cell = cell_of(grid, i, in_cells(grid, i, x[i, p]))
            number = number * tiles.count[g, i] + cell // tiles.size[i]
        number += tiles.first[g]
        tile[p] = number
        ends[k, number] += 1


@noinline
def _begin_tiles(sorting):
    """Find where each part's points begin in each tile; divide tiles by number of points."""
    ends, share, points = sorting.ends, sorting.share, sorting.order.size
    parts = ends.shape[0]
    position = shares = 0
    for t in range(ends.shape[1]):
        begin = position
        for k in range(parts):
            count = ends[k, t]
            ends[k, t] = position
            position += count
        while shares < parts and 2 * points * shares <= (begin + position) * parts:
            share[shares] = t
            shares += 1
    share[shares:] = ends.shape[1]


@shared_out
def _order_parts(sorting, k):
    """Place the k-th part of the points (counting sort); advances `ends` to the ends of tiles."""
    ends, tile, order = sorting.ends, sorting.tile, sorting.order
    parts = ends.shape[0]
    for p in range(tile.size * k // parts, tile.size * (k + 1) // parts):
        t = tile[p]
        order[ends[k, t]] = p
        ends[k, t] += 1


@shared_out
def _order_in_all_tiles(at, by, sorting, k):
    """Sort the points of a tile by first node, then id; cells that fill whole groups come first."""
    (_, kin, grids, of, x), sorting = at_hand(at), at_hand(sorting)
    tiles, around, ids = at_hand(by)
    boxes, bins, cell, order = sorting.boxes, sorting.bins, sorting.room, sorting.order
    ends, cells = sorting.ends[sorting.ends.shape[0] - 1], bins.shape[2]
    d = kin.dimension
    for t in range(sorting.share[k], sorting.share[k + 1]):
        begin, end = ends[t - 1] if t > 0 else 0, ends[t]
        if begin == end:
            continue
        for c in range(cells):
            bins[k, 0, c] = 0
            bins[k, 1, c] = -1
        for q in range(begin, end):
            p = order[q]
            grid = record(grids, of[p])
            number = 0
            for i in range(d):
                position = in_cells(grid, i, x[i, p])
                first = max(int(position + around.offset), 0)
                number = number * tiles.size[i] + first % tiles.size[i]
                low, high = _seen(grid, around, of[p], i, position)
                boxes[0, t, i] = low if q == begin else min(boxes[0, t, i], low)
                boxes[1, t, i] = high if q == begin else max(boxes[1, t, i], high)
            cell[0, q] = number
            cell[1, q] = p
            bins[k, 0, number] += 1
        # Cells of whole groups come first, then the rest; bins become begin and end.
        position = begin
        for rest in (False, True):
            for c in range(cells):
                here = bins[k, 0, c]
                if bins[k, 1, c] < 0 and (rest or here % sorting.width == 0):
                    bins[k, 0, c] = bins[k, 1, c] = position
                    position += here
        for q in range(begin, end):
            c, p = cell[0, q], cell[1, q]
            last = bins[k, 1, c]
            bins[k, 1, c] += 1
            # Insertion sort, as nearly all points are in order.
            while last > bins[k, 0, c] and ids[order[last - 1]] > ids[p]:
                order[last] = order[last - 1]
                last -= 1
            order[last] = p


@by_threads
def find_rows(at, around, tiling, parts, k):
    (_, _, grids, _, x), around, tiling = at_hand(at), at_hand(around), at_hand(tiling)
    rows, box = tiling.rows, tiling.box
    count = tiling.count[0]
    for t in range(count * k // parts, count * (k + 1) // parts):
        g = tiling.grid[t]
        grid = record(grids, g)
        along, across = box[t, 5] - box[t, 2] + 1, box[t, 4] - box[t, 1] + 1
        for r in range(rows.shape[1]):
            rows[t, r, 0] = along
            rows[t, r, 1] = -1
        for p in range(tiling.range[t, 0], tiling.range[t, 1]):
            ends = [_seen(grid, around, g, i, in_cells(grid, i, x[i, p])) for i in range(3)]
            first, last = ends[2][0] - box[t, 2], ends[2][1] - box[t, 2]
            for i in range(ends[0][0] - box[t, 0], ends[0][1] - box[t, 0] + 1):
                for j in range(ends[1][0] - box[t, 1], ends[1][1] - box[t, 1] + 1):
                    r = i * across + j
                    rows[t, r, 0] = min(rows[t, r, 0], first)
                    rows[t, r, 1] = max(rows[t, r, 1], last)


@shared_out
def _pick_all_rows(rows, order, room, parts, k):
    begin, end = order.size * k // parts, order.size * (k + 1) // parts
    for r in range(rows.shape[0]):
        if rows[r, 1] == 4:
            pick_items(rows[r, 0], np.int32(0), order, room, r, begin, end)
        else:
            pick_items(rows[r, 0], np.int64(0), order, room, r, begin, end)


@shared_out
def _put_all_rows(rows, room, parts, k):
    begin, end = room.shape[1] * k // parts, room.shape[1] * (k + 1) // parts
    for r in range(rows.shape[0]):
        if rows[r, 1] == 4:
            put_items(rows[r, 0], np.int32(0), room, r, begin, end)
        else:
            put_items(rows[r, 0], np.int64(0), room, r, begin, end)


@noinline
def _permute(mode, rows, order, room, parts):
    """Permute rows by `order`, a few at a time to save memory."""
    first = 0
    while first < rows.shape[0]:
        last = min(first + room.shape[0], rows.shape[0])
        some = rows[first:last]
        _pick_all_rows(mode, parts, some, order, room, parts)
        _put_all_rows(mode, parts, some, room, parts)
        first = last


def _sort(mode, at, by, sorting, rows):
    parts = sorting.ends.shape[0]
    find_tiles(mode, parts, at, by.tiles, sorting.ends, sorting.tile)
    _begin_tiles(sorting)
    _order_parts(mode, parts, sorting)
    _order_in_all_tiles(mode, parts, at, by, sorting)
    _permute(mode, rows, sorting.order, sorting.room, parts)
    return 0


_sort_by_team = by_team(_sort)


@kernel
def sort_points(mode, at, by, sorting, rows):
    """Sort points by tile, then by first node; `rows` are the addresses of all arrays of points."""
    _sort_by_team(mode, at, by, sorting, rows)


@kernel
def widest(at):
    """Return the largest distance of a domain corner from its point, in cells."""
    basis, kin, grids, of, x = at_hand(at)
    far = 0.0
    for p in range(x.shape[1]):
        far = max(far, extent(basis, kin, record(grids, of[p]), location_at(basis, kin, x, p)))
    return far
