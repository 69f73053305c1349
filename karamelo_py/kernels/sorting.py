"""Sorting the points by tile, and how far their domains reach."""

from karamelo_py.compiler.compile import real, shared
from karamelo_py.compiler.held import at_hand
from karamelo_py.compiler.loops import loop
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.visit import place_at
from karamelo_py.points.basis import extent, first_node
from karamelo_py.points.grid import cells_along, in_cells
from karamelo_py.points.kinematics import dimension


@shared
def cell_of(grid, direction, at):
    """The cell of a point that lies so many cells from the corner of the grid.

    Clamped, since a hook may have put a point anywhere: the next sweep finds it.
    """
    return min(max(int(at), 0), cells_along(grid, direction) - 1)


@loop
def order_points(kin, grids, size, tiles, first, x, of, start, tile, order):
    """Stable counting sort of places `x` (w, n) by tile.

    Tiles have `size` (d,) cells; grid g has ``tiles[g]`` of them (g, 3), numbered from
    ``first[g]``. `of` (n,) is the grid of each point. `tile` (n,) takes the tile of each point,
    `order` (n,) the points by tile, and ``start[t]`` ends as the end of tile t, which is the start
    of tile t + 1.
    """
    grids = at_hand(grids)
    start[:] = 0
    for p in range(x.shape[1]):
        g = of[p]
        grid = record(grids, g)
        number = 0
        for k in range(dimension(kin)):
            number = number * tiles[g, k] + cell_of(grid, k, in_cells(grid, k, x[k, p])) // size[k]
        number += first[g]
        tile[p] = number
        start[number + 1] += 1
    for t in range(start.size - 1):
        start[t + 1] += start[t]
    for p in range(x.shape[1]):
        t = tile[p]
        order[start[t]] = p
        start[t] += 1


@loop
def order_in_tiles(kin, grids, basis, size, points, x, ranges, width, boxes, bins, cell, order):
    """Sort the points of each tile by the first node that they see, then by id.

    Groups of `width` points then mostly see the same nodes: cells whose points fill groups come
    first. The order follows from where the points are, not from where they were. `boxes` (2, T, d)
    takes between what places the points lie, in cells. `bins` (2, cells of a tile)
    and `cell` (2, n) are scratch; `order` (n,) is by tile.
    """
    grids, points = at_hand(grids), at_hand(points)
    d = dimension(kin)
    for t in range(len(ranges)):
        begin, end = ranges[t, 0], ranges[t, 1]
        bins[0, :] = 0
        bins[1, :] = -1
        for q in range(begin, end):
            p = order[q]
            grid = record(grids, points.grid[p])
            number = 0
            for k in range(d):
                at = in_cells(grid, k, x[k, p])
                first = max(int(at + first_node(basis, grid.h)), 0)
                number = number * size[k] + first % size[k]
                at = at if at > 0 else real(0, at)  # so written, NaN is 0 too
                boxes[0, t, k] = at if q == begin else min(boxes[0, t, k], at)
                boxes[1, t, k] = at if q == begin else max(boxes[1, t, k], at)
            cell[0, q] = number
            cell[1, q] = p
            bins[0, number] += 1
        # Twice: whole groups, then the others. From here on, where a cell begins and where it ends.
        place = begin
        for rest in (False, True):
            for c in range(bins.shape[1]):
                here = bins[0, c]
                if bins[1, c] < 0 and (here % width != 0) == rest:
                    bins[:, c] = place
                    place += here
        for q in range(begin, end):
            c, p = cell[0, q], cell[1, q]
            at = bins[1, c]
            bins[1, c] += 1
            # Nearly all were in this order before.
            while at > bins[0, c] and points.id[order[at - 1]] > points.id[p]:
                order[at] = order[at - 1]
                at -= 1
            order[at] = p


@loop
def widest(kin, basis, grids, x, of):
    """How far from its point a corner of a domain is at most, in cells."""
    grids = at_hand(grids)
    far = 0.0
    for p in range(x.shape[1]):
        far = max(far, extent(basis, kin, record(grids, of[p]), place_at(basis, kin, x, p)))
    return far
