"""The edge of a grid that reflects points (boundary reflect); other grids let them go."""

from collections.abc import Callable

from karamelo_py.compiler.compile import point_function, real, shared, where
from karamelo_py.compiler.fields import Field, vector
from karamelo_py.compiler.tuples import multiply_each
from karamelo_py.points.grid import Grid, in_cells, pick


class Bounces(Field):
    """How often the edge of the domain has reflected a point, in each direction."""

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
    signs = turns(grid, y, v)
    return mirrored(grid, y), multiply_each(signs, v), turned(signs, moment), hits(grid, y)


@shared
def beyond(grid, direction, y):
    """-1 below the lower edge, 1 above the upper one, else 0."""
    a = in_cells(grid, direction, y)
    end = pick(direction, grid.lx, grid.ly, grid.lz)
    return where(a < 0, real(-1, y), where(a > end, real(1, y), real(0, y)))


@shared
def turn(grid, direction, y, v):
    """-1 where a point beyond the edge goes further out, else 1."""
    return where(beyond(grid, direction, y) * v > 0, real(-1, y), real(1, y))


@shared
def hit(grid, direction, y):
    """1 beyond the edge, else 0."""
    return abs(beyond(grid, direction, y))


@shared
def mirror(grid, direction, y):
    """`y` put back as far inside the edge as it is beyond."""
    side = beyond(grid, direction, y)
    lower = pick(direction, grid.x0, grid.y0, grid.z0)
    upper = lower + pick(direction, grid.lx, grid.ly, grid.lz) * grid.h
    edge = where(side > 0, real(upper, y), real(lower, y))
    return where(abs(side) > 0, edge + (edge - y), y)


def in_every_direction(function: Callable) -> Callable:
    """Make ``f(grid, y, ...)``, the tuple of function(grid, k, y[k], ...) over the directions k."""

    @shared
    def of_all(grid, *vectors):
        count = len(vectors[0])
        return tuple(function(grid, k, *(vector[k] for vector in vectors)) for k in range(count))

    return of_all


mirrored = in_every_direction(mirror)
hits = in_every_direction(hit)
turns = in_every_direction(turn)


@shared
def turned(signs, moment):
    """R L R of a square tensor L (or none), R = diag(signs): velocities and places turn round."""
    d = len(signs)
    return tuple(signs[n // d] * m * signs[n % d] for n, m in enumerate(moment))
