"""The regular grid under a basis: where it begins, its cells, how its nodes are numbered.

A :class:`Grid` is a row of a table: a scene may have several grids, each with nodes of its own.
"""

from typing import NamedTuple

from karamelo_py.compiler.compile import shared
from karamelo_py.points.kinematics import dimension


class Grid(NamedTuple):
    """One regular grid. Lengths are in the units of the scene, counts in cells."""

    x0: float  # lower corner
    y0: float
    z0: float
    h: float  # cell size
    inv_h: float  # 1 / h
    spacing: float  # distance of nodes
    nx: int  # cells per direction
    ny: int
    nz: int
    lx: float  # size in cells, not always whole
    ly: float
    lz: float
    slack: float  # how far beyond it a point still counts as on it, in cells
    step_x: int  # from a node's number to that of its neighbour
    step_y: int
    first: int  # number of its first node


@shared
def renumbered(grid, first, step_x, step_y):
    """The grid with other numbers of its nodes."""
    numbers = {"first": first, "step_x": step_x, "step_y": step_y}
    items = zip(grid._fields, grid, strict=True)
    return type(grid)(*(numbers.get(name, item) for name, item in items))


@shared
def pick(direction, a, b, c):
    """The one of three that belongs to a direction; no branch is left where that is a literal."""
    return a if direction == 0 else (b if direction == 1 else c)


@shared
def in_cells(grid, direction, x):
    """Distance from the lower corner of the grid, in cells."""
    return (x - pick(direction, grid.x0, grid.y0, grid.z0)) * grid.inv_h


@shared
def cells_along(grid, direction):
    """Number of cells along a direction."""
    return pick(direction, grid.nx, grid.ny, grid.nz)


@shared
def inside(grid, kin, x):
    """Check that the position `x` lies on the grid."""
    within = x[0] == x[0]
    for k in range(dimension(kin)):
        a = in_cells(grid, k, x[k])
        end = pick(k, grid.lx, grid.ly, grid.lz)
        # So written, NaN lies outside.
        within = (a >= -grid.slack) & (a <= end + grid.slack) & within
    return within


@shared
def node_position(grid, n):
    """(x, y, z) of node `n` of the grid."""
    local = n - grid.first
    x = grid.x0 + (local // grid.step_x) * grid.spacing
    y = grid.y0 + (local % grid.step_x // grid.step_y) * grid.spacing
    return x, y, grid.z0 + (local % grid.step_y) * grid.spacing
