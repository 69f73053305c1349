"""Arrays of points and what is read at numbers in lanes."""

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

from llvmlite import ir
from numba import types

from karamelo_py.compiler import code
from karamelo_py.compiler.compile import (
    beside,
    by_type,
    implements,
    index,
    is_one,
    lanes_of,
    of_present,
    prefetch,
    real,
)
from karamelo_py.compiler.intrinsics import intrinsic
from karamelo_py.compiler.lanes.numbers import select
from karamelo_py.compiler.lanes.registers import (
    I32,
    I64,
    Lanes,
    constant,
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

    def register_type(self) -> ir.Type:
        """LLVM's type: the first, and how many."""
        return ir.LiteralStructType([I64, I64])


class Beside(types.Type):
    """Nodes that are as many steps from those in lanes, the same in all lanes."""

    def __init__(self, nodes: Lanes):
        self.nodes, self.width = nodes, nodes.width
        super().__init__(name=f"Beside({nodes})")

    def register_type(self) -> ir.Type:
        """LLVM's type: the nodes, and the steps."""
        return ir.LiteralStructType([vector_of(self.nodes), I64])


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
def group(tag, first, count):
    """The `count` points from `first` on, as many as the tag says at most."""
    made = LaneGroup(tag.instance_class.width)

    def codegen(builder, sig, arguments):
        return code.make_struct(builder, made.register_type(), arguments[1:])

    return made(tag, types.int64, types.int64), codegen


@intrinsic
def spread(tag, value):
    """The same number in all lanes, as many as the tag says."""
    lanes = Lanes(value, tag.instance_class.width)

    def codegen(builder, sig, arguments):
        return splat(builder, arguments[1], lanes)

    return lanes(tag, value), codegen


def _masked(builder: Any, p: Any, width: int) -> Any:
    """Which lanes of a group have a point."""
    count = splat(builder, builder.extract_value(p, 1), Lanes(types.int64, width))
    numbers = constant(list(range(width)), ir.IntType(64))
    return builder.icmp_signed("<", numbers, count)


@intrinsic
def room_for(points, numbers):
    """An array (components, points) for a while, for such numbers of so many points.

    It lies where a function keeps its variables, and is gone with it.
    """
    if not isinstance(points, types.IntegerLiteral):
        return None
    array = types.Array(numbers[0], 2, "C")
    shape = len(numbers), points.literal_value

    def codegen(builder, sig, arguments):
        number = code.memory_type(array.dtype)
        memory = code.room(builder, ir.ArrayType(number, shape[0] * shape[1]))
        memory.align = 64  # bytes that caches get at once
        size = array.dtype.bitwidth // 8
        data = builder.bitcast(memory, number.as_pointer())
        strides = shape[1] * size, size
        return code.make_array(builder, array, data, [*map(I64, shape)], [*map(I64, strides)])

    return array(points, numbers), codegen


@intrinsic
def _present(p):
    """Which lanes have a point."""
    mask = Lanes(types.boolean, p.width)

    def codegen(builder, sig, arguments):
        return _masked(builder, arguments[0], p.width)

    return mask(p), codegen


@implements(of_present, LaneGroup)
def _of_present(p, value):
    return select(_present(p), value, real(0, value))


def at_lane(builder, kind, array, of, at, k, *rest):
    """Address of an item of an array; its first index is that of lane `k` of nodes `at`."""
    steps = None
    if isinstance(of, Beside):
        of, at, steps = of.nodes, *(builder.extract_value(at, part) for part in (0, 1))
    first = code.cast(builder, lane(builder, at, k), of.scalar, types.intp)
    found = code.item_pointer(builder, kind, array, [first, *rest])
    if steps is None:
        return found
    # From there on: the place of the first node is found once for all that is beside it.
    stride = code.ArrayParts(builder, kind, array).strides[0]
    return code.byte_pointer(builder, found, builder.mul(steps, stride))


def _load(builder, array, pointer, p, lanes):
    """What lies from `pointer` on, for the points there are; the first's for the other lanes."""
    vector = vector_of(lanes)
    size = lanes.scalar.bitwidth // 8
    at = builder.bitcast(pointer, vector.as_pointer())

    def partly():
        mask = _masked(builder, p, lanes.width)
        function = code.external(
            builder, f"llvm.masked.load.{shape(lanes)}.p0", vector,
            [vector.as_pointer(), I32, mask.type, vector],
        )  # fmt: skip
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


def _store(builder, pointer, p, lanes, value):
    vector = vector_of(lanes)
    size = lanes.scalar.bitwidth // 8
    at = builder.bitcast(pointer, vector.as_pointer())
    with builder.if_else(_is_full(builder, p, lanes)) as (then, otherwise):
        with then:
            builder.store(value, at, align=size)
        with otherwise:
            mask = _masked(builder, p, lanes.width)
            function = code.external(
                builder, f"llvm.masked.store.{shape(lanes)}.p0", ir.VoidType(),
                [vector, vector.as_pointer(), I32, mask.type],
            )  # fmt: skip
            builder.call(function, [value, at, ir.Constant(I32, size), mask])


def _indices(at: Any, builder: Any, value: Any) -> tuple[list, list]:
    """Types and values of the indices of an item, one or a tuple of them."""
    if isinstance(at, types.BaseTuple):
        return list(at), code.unpack(builder, value)
    return [at], [value]


def _points_at(builder, array, at, arguments):
    """Address of an item whose last index is a group: that of its first point; and the group."""
    kinds, values = _indices(at, builder, arguments[1])
    first = builder.extract_value(values[-1], 0)
    rest = [
        code.cast(builder, value, kind, types.intp)
        for kind, value in zip(kinds[:-1], values[:-1], strict=True)
    ]
    # Points lie one after another in each row, however far the rows are apart.
    size = ir.Constant(I64, array.dtype.bitwidth // 8)
    found = code.item_pointer(builder, array, arguments[0], [*rest, first], size)
    return found, values[-1]


@intrinsic
def _load_points(array, at):
    lanes = Lanes(array.dtype, lanes_of(at))

    def codegen(builder, sig, arguments):
        pointer, p = _points_at(builder, array, at, arguments)
        return _load(builder, array, pointer, p, lanes)

    return lanes(array, at), codegen


def ask(builder, pointer, ahead):
    """Have the memory bring what lies so many bytes behind an address."""
    byte = ir.IntType(8).as_pointer()
    at = builder.gep(builder.bitcast(pointer, byte), [ahead])
    function = code.external(builder, "llvm.prefetch.p0", ir.VoidType(), [byte, I32, I32, I32])
    read, near, data = 0, 3, 1
    builder.call(function, [at, *(ir.Constant(I32, k) for k in (read, near, data))])


@intrinsic
def _prefetch(array, at):
    def codegen(builder, sig, arguments):
        pointer, _ = _points_at(builder, array, at, arguments)
        ask(builder, pointer, ir.Constant(I32, AHEAD))
        return code.nothing()

    return types.void(array, at), codegen


implements(prefetch, LaneGroup)(_prefetch)


@intrinsic
def _store_points(array, at, value):
    lanes = Lanes(array.dtype, lanes_of(at))
    typed = value if isinstance(value, Lanes) else array.dtype

    def codegen(builder, sig, arguments):
        pointer, p = _points_at(builder, array, at, arguments)
        number = arguments[2]
        if not isinstance(value, Lanes):
            number = splat(builder, number, lanes)
        _store(builder, pointer, p, lanes, number)
        return code.nothing()

    return types.void(array, at, typed), codegen


@intrinsic
def _gather(array, at):
    """Items of an array at numbers in lanes, the first index."""
    lanes = Lanes(array.dtype, lanes_of(at))

    def codegen(builder, sig, arguments):
        kinds, values = _indices(at, builder, arguments[1])
        rest = [
            code.cast(builder, value, kind, types.intp)
            for kind, value in zip(kinds[1:], values[1:], strict=True)
        ]

        def of(k):
            return builder.load(
                at_lane(builder, array, arguments[0], kinds[0], values[0], k, *rest)
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
        return _load_points
    if isinstance(array, types.Array) and isinstance(_head(at), Lanes | Beside):
        return _gather
    return None


@by_type(operator.setitem)
def _set(array, at, value):
    if isinstance(array, types.Array) and isinstance(_last(at), LaneGroup):
        return _store_points
    return None


# --- numbers of nodes -----------------------------------------------------------------------------


@intrinsic
def _is_one(nodes):
    def codegen(builder, sig, arguments):
        return all_same(builder, nodes, arguments[0])

    return types.boolean(nodes), codegen


implements(is_one, Lanes)(_is_one)


@intrinsic
def _beside(first, steps):
    made = Beside(first)

    def codegen(builder, sig, arguments):
        return code.make_struct(builder, made.register_type(), arguments)

    return made(first, types.intp), codegen


implements(beside, Lanes)(_beside)
implements(index, Beside)(lambda i: i)
