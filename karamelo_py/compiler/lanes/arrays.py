"""Arrays of points and what is read at numbers in lanes."""

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model
from numba.np.arrayobj import populate_array

from karamelo_py.compiler.compile import (
    beside,
    by_type,
    is_one,
    lanes_of,
    of_present,
    prefetch,
    real,
)
from karamelo_py.compiler.lanes.numbers import select
from karamelo_py.compiler.lanes.registers import (
    I32,
    I64,
    Lanes,
    constant,
    known,
    lane,
    pack,
    shape,
    shuffle,
    splat,
    vector_of,
)

AHEAD = 256  # bytes by which arrays of points are asked of the memory ahead of their use


class LaneGroup(types.Type):
    """The numbers of up to `width` points that lie one after another."""

    def __init__(self, width: int):
        self.width = width
        super().__init__(name=f"LaneGroup({width})")


@register_model(LaneGroup)
class _GroupModel(models.StructModel):
    def __init__(self, manager: Any, group: LaneGroup):
        super().__init__(manager, group, [("first", types.int64), ("count", types.int64)])


class Beside(types.Type):
    """Nodes that are as many steps from those in lanes, the same in all lanes."""

    def __init__(self, nodes: Lanes):
        self.nodes, self.width = nodes, nodes.width
        super().__init__(name=f"Beside({nodes})")


@register_model(Beside)
class _BesideModel(models.StructModel):
    def __init__(self, manager: Any, beside: Beside):
        super().__init__(manager, beside, [("nodes", beside.nodes), ("steps", types.intp)])


class FourLanes(NamedTuple):
    """Four points at once."""

    width = 4


class EightLanes(NamedTuple):
    """Eight points at once."""

    width = 8


def lanes_for(bits: int) -> type:
    """How many points are visited at once, of numbers with so many bits; kept sorted for that."""
    return {64: FourLanes, 32: EightLanes}[bits]


@intrinsic
def group(typing_context, tag, first, count):
    """The `count` points from `first` on, as many as the tag says at most."""
    made = LaneGroup(tag.instance_class.width)

    def codegen(context, builder, sig, arguments):
        out = cgutils.create_struct_proxy(made)(context, builder)
        out.first, out.count = arguments[1], arguments[2]
        return out._getvalue()

    return made(tag, types.int64, types.int64), codegen


@intrinsic
def spread(typing_context, tag, value):
    """The same number in all lanes, as many as the tag says."""
    lanes = Lanes(value, tag.instance_class.width)

    def codegen(context, builder, sig, arguments):
        return splat(builder, arguments[1], lanes)

    return lanes(tag, value), codegen


def _masked(builder: Any, p: Any, width: int) -> Any:
    """Which lanes of a group have a point."""
    count = splat(builder, builder.extract_value(p, 1), Lanes(types.int64, width))
    numbers = constant(list(range(width)), ir.IntType(64))
    return builder.icmp_signed("<", numbers, count)


@intrinsic
def room_for(typing_context, points, numbers):
    """An array (components, points) for a while, for such numbers of so many points.

    It lies where a function keeps its variables, and is gone with it.
    """
    if not isinstance(points, types.IntegerLiteral):
        return None
    array = types.Array(numbers[0], 2, "C")
    shape = len(numbers), points.literal_value

    def codegen(context, builder, sig, arguments):
        number = context.get_data_type(array.dtype)
        memory = cgutils.alloca_once(builder, ir.ArrayType(number, shape[0] * shape[1]))
        memory.align = 64  # bytes that caches get at once
        size = array.dtype.bitwidth // 8
        made = context.make_array(array)(context, builder)
        populate_array(
            made, builder.bitcast(memory, number.as_pointer()),
            [ir.Constant(I64, n) for n in shape],
            [ir.Constant(I64, n) for n in (shape[1] * size, size)],
            ir.Constant(I64, size), None,
        )  # fmt: skip
        return made._getvalue()

    return array(points, numbers), codegen


@intrinsic
def _present(typing_context, p):
    """Which lanes have a point."""
    mask = Lanes(types.boolean, p.width)

    def codegen(context, builder, sig, arguments):
        return _masked(builder, arguments[0], p.width)

    return mask(p), codegen


@by_type(of_present)
def _of_present(p, value):
    if isinstance(p, LaneGroup):
        return lambda p, value: select(_present(p), value, real(0, value))
    return None


def pointer_to(context, builder, kind, array, indices, last=None):
    """Address of an item of an array; `last`, if it is known, is the stride of the last index."""
    made = context.make_array(kind)(context, builder, array)
    strides = cgutils.unpack_tuple(builder, made.strides)
    strides = strides if last is None else [*strides[:-1], last]
    return cgutils.get_item_pointer2(
        context, builder, made.data, cgutils.unpack_tuple(builder, made.shape), strides,
        kind.layout, indices, wraparound=False, boundscheck=False,
    )  # fmt: skip


def at_lane(context, builder, kind, array, of, at, k, *rest):
    """Address of an item of an array; its first index is that of lane `k` of nodes `at`."""
    steps = None
    if isinstance(of, Beside):
        of, at, steps = of.nodes, *(builder.extract_value(at, part) for part in (0, 1))
    first = context.cast(builder, lane(builder, at, k), of.scalar, types.intp)
    found = pointer_to(context, builder, kind, array, [first, *rest])
    if steps is None:
        return found
    # From there on: the place of the first node is found once for all that is beside it.
    strides = context.make_array(kind)(context, builder, array).strides
    bytes_on = builder.mul(steps, cgutils.unpack_tuple(builder, strides)[0])
    place = builder.gep(builder.bitcast(found, ir.IntType(8).as_pointer()), [bytes_on])
    return builder.bitcast(place, found.type)


def _load(context, builder, array, pointer, p, lanes):
    """What lies from `pointer` on, for the points there are; the first's for the other lanes."""
    vector = vector_of(lanes)
    size = lanes.scalar.bitwidth // 8
    at = builder.bitcast(pointer, vector.as_pointer())

    def partly():
        mask = _masked(builder, p, lanes.width)
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(vector, [vector.as_pointer(), I32, mask.type, vector]),
            f"llvm.masked.load.{shape(lanes)}.p0",
        )
        zero = ir.Constant(vector, None)
        loaded = builder.call(function, [at, ir.Constant(I32, size), mask, zero])
        return builder.select(mask, loaded, _first_everywhere(builder, loaded))

    full = _is_full(builder, p, lanes)
    return _either(builder, full, lambda: builder.load(at, align=size), partly)


def _either(builder: Any, condition: Any, first: Callable, second: Callable) -> Any:
    """The value of `first` where the condition holds, else that of `second`: one code is run."""
    found = []
    with builder.if_else(condition) as branches:
        for branch, code in zip(branches, (first, second), strict=True):
            with branch:
                found.append((code(), builder.block))
    chosen = builder.phi(found[0][0].type)
    for value, block in found:
        chosen.add_incoming(value, block)
    return chosen


def _first_everywhere(builder: Any, value: Any) -> Any:
    """The number of the first lane in all lanes."""
    return shuffle(builder, value, value, [0] * value.type.count)


def all_same(builder: Any, lanes: Lanes, value: Any) -> Any:
    """Whether all lanes have the same whole number."""
    same = builder.icmp_signed("==", value, _first_everywhere(builder, value))
    bits = builder.bitcast(same, ir.IntType(lanes.width))
    return builder.icmp_signed("==", bits, ir.Constant(bits.type, -1))


def _is_full(builder: Any, p: Any, lanes: Lanes) -> Any:
    """Whether all lanes of a group have a point, as nearly all groups do."""
    return builder.icmp_signed("==", builder.extract_value(p, 1), ir.Constant(I64, lanes.width))


def _store(context, builder, pointer, p, lanes, value):
    vector = vector_of(lanes)
    size = lanes.scalar.bitwidth // 8
    at = builder.bitcast(pointer, vector.as_pointer())
    with builder.if_else(_is_full(builder, p, lanes)) as (then, otherwise):
        with then:
            builder.store(value, at, align=size)
        with otherwise:
            mask = _masked(builder, p, lanes.width)
            function = cgutils.get_or_insert_function(
                builder.module,
                ir.FunctionType(ir.VoidType(), [vector, vector.as_pointer(), I32, mask.type]),
                f"llvm.masked.store.{shape(lanes)}.p0",
            )
            builder.call(function, [value, at, ir.Constant(I32, size), mask])


def _indices(at: Any, builder: Any, value: Any) -> tuple[list, list]:
    """Types and values of the indices of an item, one or a tuple of them."""
    if isinstance(at, types.BaseTuple):
        return list(at), cgutils.unpack_tuple(builder, value)
    return [at], [value]


def _points_at(context, builder, array, at, arguments):
    """Address of an item whose last index is a group: that of its first point; and the group."""
    kinds, values = _indices(at, builder, arguments[1])
    first = builder.extract_value(values[-1], 0)
    rest = [
        context.cast(builder, value, kind, types.intp)
        for kind, value in zip(kinds[:-1], values[:-1], strict=True)
    ]
    # Points lie one after another in each row, however far the rows are apart.
    size = ir.Constant(I64, array.dtype.bitwidth // 8)
    found = pointer_to(context, builder, array, arguments[0], [*rest, first], size)
    return found, values[-1]


@intrinsic
def _load_points(typing_context, array, at):
    lanes = Lanes(array.dtype, lanes_of(at))

    def codegen(context, builder, sig, arguments):
        pointer, p = _points_at(context, builder, array, at, arguments)
        return _load(context, builder, array, pointer, p, lanes)

    return lanes(array, at), codegen


def ask(builder, pointer, ahead):
    """Have the memory bring what lies so many bytes behind an address."""
    byte = ir.IntType(8).as_pointer()
    at = builder.gep(builder.bitcast(pointer, byte), [ahead])
    kind = ir.FunctionType(ir.VoidType(), [byte, I32, I32, I32])
    function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
    read, near, data = 0, 3, 1
    builder.call(function, [at, *(ir.Constant(I32, k) for k in (read, near, data))])


@intrinsic
def _prefetch(typing_context, array, at):
    def codegen(context, builder, sig, arguments):
        pointer, _ = _points_at(context, builder, array, at, arguments)
        ask(builder, pointer, ir.Constant(I32, AHEAD))
        return context.get_dummy_value()

    return types.void(array, at), codegen


@by_type(prefetch)
def _prefetch_by_type(array, at):
    return (lambda array, at: _prefetch(array, at)) if isinstance(_last(at), LaneGroup) else None


@intrinsic
def _store_points(typing_context, array, at, value):
    lanes = Lanes(array.dtype, lanes_of(at))
    typed = value if isinstance(value, Lanes) else array.dtype

    def codegen(context, builder, sig, arguments):
        pointer, p = _points_at(context, builder, array, at, arguments)
        number = arguments[2]
        if not isinstance(value, Lanes):
            number = splat(builder, number, lanes)
        _store(context, builder, pointer, p, lanes, number)
        return context.get_dummy_value()

    return types.void(array, at, typed), codegen


@intrinsic
def _gather(typing_context, array, at):
    """Items of an array at numbers in lanes, the first index."""
    lanes = Lanes(array.dtype, lanes_of(at))

    def codegen(context, builder, sig, arguments):
        kinds, values = _indices(at, builder, arguments[1])
        rest = [
            context.cast(builder, value, kind, types.intp)
            for kind, value in zip(kinds[1:], values[1:], strict=True)
        ]

        def of(k):
            return builder.load(
                at_lane(context, builder, array, arguments[0], kinds[0], values[0], k, *rest)
            )

        def apart():
            return pack(builder, [of(k) for k in range(lanes.width)], lanes)

        if array.ndim > 1:
            return apart()
        # Of parameters: mostly all points of a group are of one material.
        one = all_same(builder, kinds[0], values[0])
        return _either(builder, one, lambda: splat(builder, of(0), lanes), apart)

    return lanes(array, at), codegen


def _last(at: Any) -> Any:
    return tuple(at)[-1] if isinstance(at, types.BaseTuple) and len(at) else at


def _head(at: Any) -> Any:
    return next(iter(at)) if isinstance(at, types.BaseTuple) and len(at) else at


@by_type(operator.getitem)
def _get(array, at):
    if isinstance(array, types.Array) and isinstance(_last(at), LaneGroup):
        return lambda array, at: _load_points(array, at)
    if isinstance(array, types.Array) and isinstance(_head(at), Lanes | Beside):
        return lambda array, at: _gather(array, at)
    return None


@by_type(operator.setitem)
def _set(array, at, value):
    if isinstance(array, types.Array) and isinstance(_last(at), LaneGroup):
        return lambda array, at, value: _store_points(array, at, value)
    return None


# --- numbers of nodes -----------------------------------------------------------------------------


@intrinsic
def _is_one(typing_context, nodes):
    def codegen(context, builder, sig, arguments):
        return all_same(builder, nodes, arguments[0])

    return types.boolean(nodes), codegen


known(is_one, _is_one)


@intrinsic
def _beside(typing_context, first, steps):
    made = Beside(first)

    def codegen(context, builder, sig, arguments):
        out = cgutils.create_struct_proxy(made)(context, builder)
        out.nodes, out.steps = arguments
        return out._getvalue()

    return made(first, types.intp), codegen


known(beside, _beside)
