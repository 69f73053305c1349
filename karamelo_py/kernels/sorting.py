"""Sorting the points by tile, and finding the nodes in use.

Points may drift from their tile between two sorts; the size of a tile leaves room for that, so
that tiles of one colour stay apart (see `karamelo_py.lowering.tile_size`).
"""

from __future__ import annotations

from karamelo_py.compile import kernel
from karamelo_py.points.basis.product import in_cells, pick
from karamelo_py.points.kinematics import dimension


@kernel
def order_points(kin, basis, size, shape, x, start, order):
    """Stable counting sort: order[0] takes the tile of each point, order[1] the points by tile."""
    start[:] = 0
    for p in range(len(x)):
        number = 0
        for k in range(dimension(kin)):
            last = pick(k, basis.nx, basis.ny, basis.nz) - 1
            cell = min(int(in_cells(basis, k, x[p, k])), last)
            number = number * shape[k] + cell // size
        order[0, p] = number
        start[number + 1] += 1
    for t in range(start.size - 1):
        start[t + 1] += start[t]
    for p in range(len(x)):
        t = order[0, p]
        order[1, start[t]] = p
        start[t] += 1
    # start[t] is now the end of tile t, which is the start of tile t + 1


@kernel
def list_tiles(kin, shape, start, used, tiling):
    """Occupied tiles by colour (the parity of their place), with the range of their points."""
    d = dimension(kin)
    k = 0
    for c in range(2**d):
        tiling.colour[c] = k
        for t in range(used.size):
            begin = start[t - 1] if t > 0 else 0
            if start[t] == begin:
                continue
            rest = t
            colour = 0
            for axis in range(d - 1, -1, -1):
                colour = colour * 2 + (rest % shape[axis]) % 2
                rest //= shape[axis]
            if colour == c:
                tiling.range[k, 0] = begin
                tiling.range[k, 1] = start[t]
                used[t] = 1
                k += 1
    tiling.colour[2**d] = k


@kernel
def reorder(array, order, spare):
    """array[:] = array[order], row by row through `spare`."""
    width = array.shape[1]
    for p in range(order.size):
        for k in range(width):
            spare[p, k] = array[order[p], k]
    for p in range(order.size):
        for k in range(width):
            array[p, k] = spare[p, k]


@kernel
def reorder_scalars(mass, material, ids, order, spare):
    """The same for the fields with one number a point; `order` is used up."""
    for p in range(order.size):
        spare[p, 0] = mass[order[p]]
    for p in range(order.size):
        mass[p] = spare[p, 0]
    for p in range(order.size):
        spare[p, 0] = material[order[p]]
    for p in range(order.size):
        material[p] = int(spare[p, 0])
    for p in range(order.size):
        order[p] = ids[order[p]]
    for p in range(order.size):
        ids[p] = order[p]


@kernel
def find_nodes(kin, size, shape, nodes, used, spans):
    """List the spans of nodes that the points of used tiles can reach before the next sort.

    A tile of nodes is in use when it or a neighbour holds points.
    """
    d = dimension(kin)
    nx, ny, nz = shape
    wy = 1 if d > 1 else 0
    wz = 1 if d > 2 else 0
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if used[(i * ny + j) * nz + k] != 1:
                    continue
                for a in range(max(i - 1, 0), min(i + 2, nx)):
                    for b in range(max(j - wy, 0), min(j + wy + 1, ny)):
                        for c in range(max(k - wz, 0), min(k + wz + 1, nz)):
                            t = (a * ny + b) * nz + c
                            if used[t] == 0:
                                used[t] = 2
    count = 0
    row_tiles = shape[d - 1]
    # Nodes across the rows, in one direction less: a line of tiles covers a patch of rows.
    across_1 = nodes[0] if d > 1 else 1
    across_2 = nodes[1] if d > 2 else 1
    size_1 = size if d > 1 else 1
    size_2 = size if d > 2 else 1
    lines_2 = shape[1] if d > 2 else 1
    for line in range(used.size // row_tiles):
        first_1 = (line // lines_2) * size_1
        first_2 = (line % lines_2) * size_2
        t = 0
        while t < row_tiles:
            if used[line * row_tiles + t] == 0:
                t += 1
                continue
            begin = t * size
            while t < row_tiles and used[line * row_tiles + t] != 0:
                t += 1
            end = min(t * size, nodes[d - 1])
            for i in range(first_1, min(first_1 + size_1, across_1)):
                for j in range(first_2, min(first_2 + size_2, across_2)):
                    count += 1
                    row = (i * across_2 + j) * nodes[d - 1]
                    spans[count, 0] = row + begin
                    spans[count, 1] = row + end
    spans[0, 0] = count
