"""The edge of a grid that reflects points (boundary reflect); other grids let them go."""

from karamelo_py.compiler.compile import point_function, real, where
from karamelo_py.compiler.fields import Field, vector
from karamelo_py.points.grid import Grid, in_cells, pick


class Bounces(Field):
    """Count of a point's reflections at the edge of the domain, in each direction."""

    shape = vector


class ReflectingGrid(Grid):
    """A grid that puts points back which have come beyond its edge."""

    __slots__ = ()
    point_fields = (Bounces,)


@point_function(otherwise=True)
def reflected(grid, kin, y, v, moment):
    """Place, velocity and its moment after the edge, and 1 for each direction it was met in."""
    return y, v, moment, ()


@reflected.on(ReflectingGrid)
def _reflected_reflecting_grid(grid, kin, y, v, moment):
    signs = [turn(grid, k, y[k], v[k]) for k in range(len(y))]
    mirrored = y._make([mirror(grid, k, a) for k, a in enumerate(y)])
    hits = tuple([abs(beyond(grid, k, a)) for k, a in enumerate(y)])
    v = v._make([sign * a for sign, a in zip(signs, v, strict=True)])
    return mirrored, v, turned(signs, moment), hits


def beyond(grid, direction, y):
    """-1 below the lower edge, 1 above the upper one, else 0."""
    a = in_cells(grid, direction, y)
    end = pick(direction, grid.lx, grid.ly, grid.lz)
    return where(a < 0, real(-1, y), where(a > end, real(1, y), real(0, y)))


def turn(grid, direction, y, v):
    """-1 where a point beyond the edge goes further out, else 1."""
    return where(beyond(grid, direction, y) * v > 0, real(-1, y), real(1, y))


def mirror(grid, direction, y):
    """`y` put back as far inside the edge as it is beyond."""
    side = beyond(grid, direction, y)
    lower = pick(direction, grid.x0, grid.y0, grid.z0)
    upper = lower + pick(direction, grid.lx, grid.ly, grid.lz) * grid.h
    edge = where(side > 0, real(upper, y), real(lower, y))
    return where(abs(side) > 0, edge + (edge - y), y)


def turned(signs, moment):
    """R L R of a tensor L (or none), R = diag(signs): velocities and places turn round."""
    if not len(moment):
        return moment
    pairs = zip(moment, moment.places, strict=True)
    return moment._make([signs[i] * m * signs[j] for m, (i, j) in pairs])
