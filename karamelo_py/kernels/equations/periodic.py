"""Periodic directions: nodes a period apart are images of one node.

The grid has `GHOSTS` extra cells at both ends of a periodic direction. All images get the same sum,
bit for bit. Points return to the domain every `EVERY` steps (`karamelo_py.run.periodic`).
"""

from math import inf
from typing import NamedTuple

from karamelo_py.compiler import index
from karamelo_py.compiler.fields import FieldMappedAgain, StepField, SummedField, field
from karamelo_py.kernels.arrays import TIMESTEP
from karamelo_py.kernels.equations.fbar import NodalMean, NodalStress
from karamelo_py.kernels.equations.node_updates import node_task
from karamelo_py.kernels.totals import counts

GHOSTS = 6
EVERY = 10


class InUse(StepField):
    """1 at nodes that can be in a point's stencil."""


class Axis(NamedTuple):
    first: int  # number of the first node
    stride: int  # difference of node numbers
    count: int  # nodes along the axis
    period: int  # period in cells


class Seam(NamedTuple):
    axes: tuple  # tuple of `Axis`
    joined: tuple  # axes along which images coincide with nodes
    shear: tuple = ()  # a `sheared.Shear` in a sheared cell


def position_on(axis, n):
    """Return a node's index along an axis, with ghosts."""
    return (n - axis.first) // axis.stride % axis.count


@counts.on(Seam)
def _counts_seam(ranks, n):
    """Return True for exactly one of the images of a node."""
    counted = n >= 0
    for axis in ranks.axes:
        position = position_on(axis, int(n)) - GHOSTS
        counted = counted & (position >= 0) & (position < axis.period)
    return counted


@node_task
class Join(NamedTuple):
    """Gives all images of a node their sum."""

    axis: Axis

    says = "periodic sums"
    goes_through = ("sums", "in use")
    array = "sums"
    fields = SummedField

    def at_node(task, kin, nodes, n, dt):
        if _is_lowest(task.axis, nodes, n):
            _join(task.axis, nodes, getattr(nodes, task.array), n)
            for one in nodes.fields:
                if isinstance(one, task.fields):
                    _join(task.axis, nodes, one.array, n)


class JoinVelocity(Join):
    says = "periodic momentum"
    goes_through = ("velocity", "in use")
    array = "velocity"
    fields = FieldMappedAgain


@node_task
class JoinMean(NamedTuple):
    """Gives all images of a node the sum for an average, not yet divided by the weight (F-bar)."""

    axis: Axis

    of = NodalMean
    goes_through = ("nodal mean", "in use")

    def at_node(task, kin, nodes, n, dt):
        if _is_lowest(task.axis, nodes, n):
            _join(task.axis, nodes, field(nodes.fields, task.of), n)


class JoinMeanStress(JoinMean):
    of = NodalStress
    goes_through = ("nodal stress", "in use")


def _is_lowest(axis, nodes, n):
    """Return True for the first node in use among its images."""
    used = field(nodes.fields, InUse)
    step = axis.period * axis.stride
    position = position_on(axis, int(n))
    lowest = position >= 0
    for k in range(1, int(position // axis.period) + 1):
        if used[index(int(n - k * step)), 0] > 0:
            lowest = position < 0
    return lowest


def _join(axis, nodes, array, n):
    used = field(nodes.fields, InUse)
    step = axis.period * axis.stride
    position = position_on(axis, int(n))
    more = int((axis.count - 1 - position) // axis.period)
    for c in range(int(array.shape[1])):
        total = array[n, c]
        for k in range(1, more + 1):
            m = index(int(n + k * step))
            if used[m, 0] > 0:
                total += array[m, c]
        array[n, c] = total
        for k in range(1, more + 1):
            m = index(int(n + k * step))
            if used[m, 0] > 0:
                array[m, c] = total


def ask_to_sort(s):
    if (int(s.control.values[TIMESTEP]) + 1) % EVERY == 0:
        s.control.motion[0].drift = inf
