"""The regular grid under a basis: origin, cells and node numbers."""

from typing import Any, NamedTuple

from karamelo_py.compiler import point_function, real, where
from karamelo_py.compiler.fields import Field, vector

Length = Any  # a number for one grid, an array over all grids
Count = Any


class Grid(NamedTuple):
    """One grid of a scene; lengths are in scene units."""

    x0: Length  # lower corner
    y0: Length
    z0: Length
    h: Length
    inv_h: Length
    spacing: Length
    nx: Count  # number of cells along x
    ny: Count
    nz: Count
    lx: Length  # length in cells, may be fractional
    ly: Length
    lz: Length
    slack: Length  # tolerance in cells within which points outside count as inside
    step_x: Count  # stride of node numbers
    step_y: Count
    first: Count  # number of the first node
    first_cell: Count


def renumbered(grid, first, step_x, step_y):
    return grid._replace(first=first, step_x=step_x, step_y=step_y)


def pick(direction, a, b, c):
    return a if direction == 0 else (b if direction == 1 else c)


def in_cells(grid, direction, x):
    return (x - pick(direction, grid.x0, grid.y0, grid.z0)) * grid.inv_h


def cells_along(grid, direction):
    return pick(direction, grid.nx, grid.ny, grid.nz)


def inside(grid, kin, x):
    within = x[0] == x[0]
    for k in range(kin.dimension):
        a = in_cells(grid, k, x[k])
        end = pick(k, grid.lx, grid.ly, grid.lz)
        # The result is False for NaN.
        within = (a >= -grid.slack) & (a <= end + grid.slack) & within
    return within


def node_places(grid, n):
    """Return the indices of node `n` in its grid."""
    local = n - grid.first
    return local // grid.step_x, local % grid.step_x // grid.step_y, local % grid.step_y


def node_position(grid, n):
    i, j, k = node_places(grid, n)
    return grid.x0 + i * grid.spacing, grid.y0 + j * grid.spacing, grid.z0 + k * grid.spacing


class Bounces(Field):
    """Reflections of a point at the domain's edges, per direction."""

    shape = vector


class ReflectingGrid(Grid):
    __slots__ = ()
    point_fields = (Bounces,)


@point_function(otherwise=True)
def reflected(grid, kin, y, v, moment):
    """Return position, velocity, moment after reflection; per direction, 1 if reflected, else 0."""
    return y, v, moment, ()


@reflected.on(ReflectingGrid)
def _reflected_reflecting_grid(grid, kin, y, v, moment):
    signs = tuple([turn(grid, k, y[k], v[k]) for k in range(len(y))])
    mirrored = y._make([mirror(grid, k, a) for k, a in enumerate(y)])
    hits = tuple([abs(beyond(grid, k, a)) for k, a in enumerate(y)])
    v = v._make([sign * a for sign, a in zip(signs, v, strict=True)])
    return mirrored, v, turned(moment, signs), hits


def beyond(grid, direction, y):
    a = in_cells(grid, direction, y)
    end = pick(direction, grid.lx, grid.ly, grid.lz)
    return where(a < 0, real(-1, y), where(a > end, real(1, y), real(0, y)))


def turn(grid, direction, y, v):
    return where(beyond(grid, direction, y) * v > 0, real(-1, y), real(1, y))


def mirror(grid, direction, y):
    side = beyond(grid, direction, y)
    lower = pick(direction, grid.x0, grid.y0, grid.z0)
    upper = lower + pick(direction, grid.lx, grid.ly, grid.lz) * grid.h
    edge = where(side > 0, real(upper, y), real(lower, y))
    return where(abs(side) > 0, edge + (edge - y), y)


@point_function(otherwise=True)
def turned(moment, signs):
    """Return the mirrored moment: R L R with R = diag(signs), or () without a moment."""
    if not len(moment):
        return moment
    pairs = zip(moment, moment.places, strict=True)
    return moment._make([signs[i] * m * signs[j] for m, (i, j) in pairs])
