"""Sheared periodic cells (Lees & Edwards 1972): images across y move along x.

The image of a point, one period above it, is `shift` further along x and `speed` faster. Images of
a node lie between nodes: the node gets fractions of the sums at these nodes, and these nodes get
the same fractions of its velocity. The two maps are transposes of each other, so momentum is
conserved to round-off.
"""

from math import floor
from typing import NamedTuple

from karamelo_py.compiler import index, real
from karamelo_py.compiler.fields import SummedField, field
from karamelo_py.kernels import arrays
from karamelo_py.kernels.arrays import MASS, TIME
from karamelo_py.kernels.equations.node_updates import node_task
from karamelo_py.kernels.equations.periodic import GHOSTS, Axis, InUse, position_on


class Shear(NamedTuple):
    along: Axis  # x
    across: Axis  # y
    speed: float  # velocity of the upper images
    h: float


class ShearedImages(NamedTuple):
    along: Axis
    across: Axis
    shift: float  # shift of the upper images, in cells
    speed: float


def images_of(s):
    shear = s.control.ranks.shear
    cells = shear.speed * s.control.values[TIME] / shear.h
    period = shear.along.period
    shift = cells - period * floor(cells / period)
    return ShearedImages(shear.along, shear.across, shift, shear.speed)


def _place(axis, n):
    return int(position_on(axis, int(n))) - GHOSTS


def _is_home(images, n):
    i, j = _place(images.along, n), _place(images.across, n)
    return (i >= 0) & (i < images.along.period) & (j >= 0) & (j < images.across.period)


def _pair(images, n, side):
    """Return two nodes `side` cells of shear above `n`, and the fraction of the second."""
    along, across = images.along, images.across
    i = _place(along, n)
    at = i + side * images.shift
    first = floor(at)
    rows = int(n) + side * across.period * across.stride
    a = index(rows + (first % along.period - i) * along.stride)
    b = index(rows + ((first + 1) % along.period - i) * along.stride)
    return a, b, at - first


def _fold(images, nodes, array, n, fast):
    """Add the images' parts to a node; column `fast` is the momentum along x."""
    used, across = field(nodes.fields, InUse), images.across
    j = _place(across, n)
    for side in (-1, 1):
        row = j + side * across.period
        if (row >= -GHOSTS) & (row <= across.period + GHOSTS):
            a, b, second = _pair(images, n, side)
            for m, weight in ((a, 1 - second), (b, second)):
                if used[m, 0] > 0:
                    weight = real(weight, array[n, 0])
                    for c in range(int(array.shape[1])):
                        array[n, c] += weight * array[m, c]
                    if fast >= 0:
                        speed = real(side * images.speed, array[n, 0])
                        array[n, fast] -= weight * speed * nodes.sums[m, MASS]


def _spread(images, nodes, array, n, first):
    """Set velocity times mass of an image, from column `first` (along x) on."""
    sums, j = nodes.sums, _place(images.across, n)
    side = 0
    if j >= images.across.period:
        side = -1
    if j < 0:
        side = 1
    a, b, second = _pair(images, n, side)
    second = real(second, array[n, 0])
    mass = sums[n, MASS]
    if (mass > 0) & (sums[a, MASS] > 0) & (sums[b, MASS] > 0):
        for c in range(first, int(array.shape[1])):
            value = (1 - second) * array[a, c] / sums[a, MASS]
            array[n, c] = mass * (value + second * array[b, c] / sums[b, MASS])
        array[n, first] -= mass * real(side * images.speed, mass)


@node_task
class FoldSums(NamedTuple):
    images: ShearedImages

    says = "sums across sheared edges"
    goes_through = ("sums", "in use")

    def at_node(task, kin, nodes, n, dt):
        if _is_home(task.images, n):
            _fold(task.images, nodes, nodes.sums, n, arrays.of_momentum(kin))
            for one in nodes.fields:
                if isinstance(one, SummedField):
                    _fold(task.images, nodes, one.array, n, -1)


@node_task
class SpreadSums(NamedTuple):
    images: ShearedImages

    goes_through = ("sums", "in use")

    def at_node(task, kin, nodes, n, dt):
        if not _is_home(task.images, n):
            _spread(task.images, nodes, nodes.sums, n, arrays.of_momentum(kin))


@node_task
class FoldVelocity(NamedTuple):
    images: ShearedImages

    says = "momentum across sheared edges"
    goes_through = ("velocity", "in use")

    def at_node(task, kin, nodes, n, dt):
        if _is_home(task.images, n):
            _fold(task.images, nodes, nodes.velocity, n, 0)


@node_task
class SpreadVelocity(NamedTuple):
    images: ShearedImages

    goes_through = ("velocity", "in use")

    def at_node(task, kin, nodes, n, dt):
        if not _is_home(task.images, n):
            _spread(task.images, nodes, nodes.velocity, n, 0)


def at_images(task):
    def make(s):
        return task(images_of(s))

    return make


OF_SUMS = FoldSums, SpreadSums
OF_VELOCITY = FoldVelocity, SpreadVelocity
