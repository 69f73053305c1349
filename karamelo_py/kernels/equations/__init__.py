"""Quantities that points scatter, and tasks that gather, one file each.

A quantity is a tag with equations as data (`takes`, `gives`). A task is a tag with functions
`empty`, `gathered` and `updated`. docs/house/kernels.md has examples.
"""

from collections import namedtuple
from collections.abc import Callable
from itertools import groupby
from types import MappingProxyType
from typing import Any, NamedTuple

from karamelo_py.compiler import point_function, real
from karamelo_py.compiler.fields import SummedField, field, scalar, vector
from karamelo_py.compiler.lanes import of_present
from karamelo_py.compiler.tuples import flat, nested_as
from karamelo_py.kernels import arrays
from karamelo_py.kernels.arrays import Nodes, Number, Tag, of_force
from karamelo_py.kernels.records import accumulate
from karamelo_py.kernels.views import NodeView, PointView, Work, node_of
from karamelo_py.points import laws
from karamelo_py.points.basis import reach
from karamelo_py.points.basis.product import spacing
from karamelo_py.points.transfers import Moment, zero_moment


class NodeColumns(NamedTuple):
    array: Any
    first: Callable  # first column, a function of the kinematics
    count: Callable
    end: Callable  # end of the columns with padding to registers, a function of the kinematics


def _zero(kin):
    return 0


class Unweighted(NamedTuple):
    """A contribution to the first node of a stencil, and its increments from node to node."""

    value: tuple
    growths: tuple


class Sum(NamedTuple):
    """Nodal sum over points; ``of(pt, node)`` is a point's contribution, a tuple.

    If the contribution is N_i (a + b (X_i - x)), ``affine(pt, w)`` returns a and the columns of b
    (none if b is 0); if it is affine without a weight, an `Unweighted`; otherwise (). In lanes,
    affine sums are arranged like records once per point instead of once per node.
    """

    into: NodeColumns
    of: Callable
    affine: Callable = lambda pt, w: ()


def whole(kind: Any, count: Callable | None = None) -> NodeColumns:
    count = count or kind.shape
    return NodeColumns(kind, _zero, count, count)


class RigidSums(SummedField):
    """Nodal sums of rigid points, as in `Nodes.sums`, and the force on them."""

    @staticmethod
    def shape(kin):
        return arrays.SUMS_WIDTH[kin.dimension]


MASS = NodeColumns("sums", _zero, scalar, arrays.of_momentum)
MOMENTUM = NodeColumns("sums", arrays.of_momentum, vector, of_force)
FORCE = NodeColumns("sums", of_force, vector, RigidSums.shape)
RIGID_MASS, RIGID_MOMENTUM = MASS._replace(array=RigidSums), MOMENTUM._replace(array=RigidSums)
VELOCITY = NodeColumns("velocity", _zero, vector, lambda kin: arrays.VELOCITY_WIDTH[kin.dimension])


def of_point(**functions: Callable) -> MappingProxyType:
    return MappingProxyType(functions)


class NodalQuantity(NamedTuple):
    """Base of quantities that support lanes. See `kernels.stencils` for `not_at_corners`."""

    in_lanes = True
    not_at_corners = ()
    records = ""  # node array to prefetch
    adds = False  # adds to present nodal values
    masked = True  # whether loads are set to 0 in gaps of lanes
    also_reads = ()  # point fields besides `takes`
    takes = of_point()
    gives = ()

    @classmethod
    def __init_subclass__(cls):
        _register(cls)


class Task(NamedTuple):
    """Base of tasks that support lanes, with ``empty``, ``gathered`` and ``updated``."""

    in_lanes = True
    not_at_corners = ()
    records = ""

    @classmethod
    def __init_subclass__(cls):
        for name, function in (("empty", empty), ("gathered", gathered), ("updated", updated)):
            if name in vars(cls):
                function.on(cls)(vars(cls)[name])


class Report(NamedTuple):
    """Result of a task for a point; NaN or infinite if the point failed."""

    moved: Number  # distance in cells
    rate: Number  # largest rate so far, of this and earlier points


@point_function()
def empty(task: Tag, w: Work, x: tuple) -> tuple:
    """Return the initial totals of a gather."""


@point_function()
def gathered(task: Tag, node: NodeView, total: tuple) -> tuple:
    """Return `total` with the contribution of a node added."""


@point_function()
def updated(task: Tag, pt: PointView, total: tuple, totals: tuple, fastest: Number) -> Report:
    """Store the update from `total`; report the larger of the point's rate and `fastest`."""


@point_function()
def load_of(quantity: Tag, pt: PointView) -> tuple:
    """Return the unweighted load of a point."""


@point_function()
def scattered(quantity: Tag, load: tuple, node: NodeView) -> None:
    pass


@point_function()
def affine_part(quantity, w, stencil, load):
    """Return (array, first component, weighted?, value at the first node, increments), or ()."""


def _register(kind: Any) -> None:
    groups = [(array, (*sums,)) for array, sums in groupby(kind.gives, lambda one: one.into.array)]
    made, takes = namedtuple("Load", kind.takes), tuple(kind.takes.values())  # type: ignore[misc]
    for take in takes:
        if not hasattr(take, "reads"):
            says = f"put @eq.reads(...) before {take.__name__}, with the fields of points it reads"
            raise TypeError(f'{kind.__name__}: {says}, as in @eq.reads("v")')
    names = [name for take in takes for name in take.reads]
    kind.reads = tuple(dict.fromkeys((*kind.also_reads, *names)))

    @load_of.on(kind)
    def load_of_point(quantity, pt):
        load = tuple([take(pt) for take in takes])
        if kind.masked:
            load = nested_as(load, [of_present(pt.p, number) for number in flat(load)])
        return made(*load)

    @scattered.on(kind)
    def scatter(quantity, load, node):
        for array, sums in groups:
            target = node_array(node.w.nodes, array)
            values = () if target is None else flat([one.of(load, node) for one in sums])
            if len(values):
                accumulate(target, node.i, sums[0].into.first(node.w.kin), values)

    @affine_part.on(kind)
    def affine(quantity, w, stencil, load):
        present = [
            (array, sums) for array, sums in groups if node_array(w.nodes, array) is not None
        ]
        if len(present) != 1:
            return ()
        array, sums = present[0]
        parts = [one.affine(load, w) for one in sums]
        if not all(len(term) for term in parts):
            return ()
        weighted = not isinstance(parts[0], Unweighted)
        at_first = [_at_first(w, stencil, *term) if weighted else term for term in parts]
        return array, sums[0].into.first(w.kin), weighted, *_joined(at_first)


class ExtensiveQuantity(NodalQuantity):
    """Base of quantities whose sums all contain a factor, such as `mass`, that is 0 in gaps."""

    masked = False


def node_array(nodes: Nodes, array: Any) -> Any:
    return getattr(nodes, array) if isinstance(array, str) else field(nodes.fields, array)


def _at_first(w, stencil, value, slopes):
    value = value if isinstance(value, tuple) else (value,)
    if not len(slopes):
        return value, ()
    arm = reach(w.basis, w.kin, w.grid, stencil, 0)
    for slope, way in zip(slopes, arm, strict=True):
        value = value + way * slope
    step = w.grid.h * spacing(w.basis)
    return value, tuple([step * slope for slope in slopes])


def _joined(parts):
    values = flat([value for value, _ in parts])
    growing = [growths for _, growths in parts if len(growths)]
    if not growing:
        return values, ()
    none = [tuple([a - a for a in value]) for value, _ in parts]
    growths = [
        growth or (zeros,) * len(growing[0]) for zeros, (_, growth) in zip(none, parts, strict=True)
    ]
    return values, tuple([flat(ways) for ways in zip(*growths, strict=True)])


def reads(*names: str) -> Callable:
    def declare(function: Any) -> Any:
        function.reads = names
        return function

    return declare


def is_apart(w):
    """Return True for rigid points with separate sums."""
    return laws.is_rigid(w.laws) and field(w.nodes.fields, RigidSums) is not None


@reads("mass")
def mass(pt):
    """Return the mass added to the common sums, 0 for rigid points with separate sums."""
    m = of_present(pt.p, pt.w.points.mass[pt.p])
    return m - m if is_apart(pt.w) else m


@reads("v")
def v(pt):
    return pt.v


@reads("moment")
def moment(pt):
    """Return the tensor stored with the velocity, or ()."""
    return pt.load(Moment, zero_moment(pt.w.transfer, pt.w.kin, pt.dt))


def empty_all(tasks, w, x):
    return tuple([empty(task, w, x) for task in tasks])


def gathered_all(tasks, w, stencil, k, totals):
    node = node_of(w, stencil, k)
    return tuple([gathered(task, node, totals[n]) for n, task in enumerate(tasks)])


def updated_all(tasks, pt, totals, fastest):
    moved = real(0, fastest)
    for task, total in zip(tasks, totals, strict=True):
        further, fastest = updated(task, pt, total, totals, fastest)
        moved += further
    return moved, fastest


def load_all(quantities, pt):
    """Return the load of each quantity; equal loads are computed once."""
    kinds = [type(quantity).takes for quantity in quantities]
    firsts = [kinds.index(takes) for takes in kinds]
    loads = [load_of(quantities[k], pt) if k == firsts[k] else () for k in range(len(kinds))]
    return tuple([loads[first] for first in firsts])


def scattered_all(quantities, loads, node):
    for quantity, load in zip(quantities, loads, strict=True):
        scattered(quantity, load, node)
