"""Sorting the points by tile."""

from __future__ import annotations

from karamelo_py.compile import kernel
from karamelo_py.points.basis.product import in_cells, pick
from karamelo_py.points.kinematics import dimension


@kernel
def order_points(kin, basis, size, shape, x, start, tile, order):
    """Stable counting sort of positions `x` (n, d) by tile.

    `tile` (n,) takes the tile of each point, `order` (n,) the points by tile, and ``start[t]``
    ends as the end of tile t, which is the start of tile t + 1.
    """
    start[:] = 0
    for p in range(len(x)):
        number = 0
        for k in range(dimension(kin)):
            last = pick(k, basis.nx, basis.ny, basis.nz) - 1
            # Clamped, since a hook may have put a point anywhere: the next sweep finds it.
            cell = min(max(int(in_cells(basis, k, x[p, k])), 0), last)
            number = number * shape[k] + cell // size
        tile[p] = number
        start[number + 1] += 1
    for t in range(start.size - 1):
        start[t + 1] += start[t]
    for p in range(len(x)):
        t = tile[p]
        order[start[t]] = p
        start[t] += 1
