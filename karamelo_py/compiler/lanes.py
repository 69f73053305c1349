"""Lanes: a number type for point functions that holds the numbers of several points.

A kernel that indexes point arrays (components, points) with a `LaneGroup` gets `Lanes`: one number
for each of 4 or 8 consecutive points. Node numbers in lanes gather from node arrays (nodes,
components). Functions listed in ``scalarised`` of a class are called lane by lane. Each lane gives
the result of the scalar operation bit for bit; only sums at nodes differ, by round-off.

In the last group of a tile, lanes without a point load the first point and contribute nothing.
"""

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.code import machine
from karamelo_py.compiler.llvm import (
    I32,
    I64,
    Lanes,
    LaneType,
    lane,
    pack,
    scalar_of,
    shuffle,
    splat,
)
from karamelo_py.compiler.trace.primitives import (
    all_same,
    implements,
    in_lanes,
    index,
    lanes_of,
    real,
    select,
    shared,
)
from karamelo_py.compiler.trace.values import intrinsic

# LLVM would split wider vectors, and registers would not suffice.
REGISTER_BYTES = 64 if "+avx512f" in machine.features() else 32
AHEAD = 256  # bytes of point arrays to prefetch ahead


def _largest(builder: ir.IRBuilder, lanes: Lanes, vector: ir.Value) -> ir.Value:
    best = lane(builder, vector, 0)
    for k in range(1, lanes.width):
        value = lane(builder, vector, k)
        best = builder.select(builder.fcmp_ordered(">", value, best), value, best)
    return best


@in_lanes(scalar_of, _largest)
def largest(a: float) -> float:
    return a


def _first_false(builder: ir.IRBuilder, lanes: Lanes, mask: ir.Value) -> ir.Value:
    first = I64(0)
    for k in reversed(range(lanes.width)):
        first = builder.select(lane(builder, mask, k), first, I64(k))
    return first


@in_lanes(lambda lanes: types.int64, _first_false)
def first_false_lane(condition: bool) -> int:
    """Return the first lane where a condition is false; 0 for a number."""
    return 0


@in_lanes(scalar_of, lambda builder, lanes, vector: lane(builder, vector, 0))
def first_lane(number: int) -> int:
    return number


def _added(builder: ir.IRBuilder, lanes: Lanes, total: ir.Value, vector: ir.Value) -> ir.Value:
    for k in range(lanes.width):
        total = builder.fadd(total, lane(builder, vector, k))
    return total


@in_lanes(scalar_of, _added)
def added(total: float, value: float) -> float:
    """Add to `total` lane after lane, as for numbers."""
    return total + value


def beside(first: int, steps: int) -> int:
    """Return `first` + `steps` as an array index.

    For lanes, both parts are stored, so that neighbours are addressed relative to the first nodes.
    """
    return first + steps


implements(beside)(lambda first, steps: types.uint64(first + steps))


@shared
def of_present(p: int, value: float) -> float:
    """Return `value`, or 0 in lanes without a point."""
    return value


@in_lanes(lambda lanes: types.boolean, lambda builder, lanes, nodes: all_same(builder, nodes))
def is_one(number: int) -> bool:
    return True


@shared
def prefetch(array: Any, at: tuple) -> None:
    pass


class LaneGroup(LaneType):
    """Type of up to `width` consecutive points: first, and count."""

    def __init__(self, width: int):
        self.width = width
        super().__init__(name=f"LaneGroup({width})")

    def register_type(self) -> ir.Type:
        return ir.LiteralStructType([I64, I64])


class Beside(LaneType):
    """Type of nodes in lanes, plus a distance in nodes."""

    def __init__(self, nodes: Lanes):
        self.nodes, self.width = nodes, nodes.width
        super().__init__(name=f"Beside({nodes})")

    def register_type(self) -> ir.Type:
        return ir.LiteralStructType([llvm.register_type(self.nodes), I64])


class FourLanes(NamedTuple):
    width = 4


class EightLanes(NamedTuple):
    width = 8


def lanes_for(bits: int) -> type:
    return {64: FourLanes, 32: EightLanes}[bits]


@intrinsic
def group(tag, first, count):
    made = LaneGroup(tag.instance_class.width)

    def codegen(builder, _, *numbers):
        return llvm.make_struct(builder, made.register_type(), numbers)

    return made(tag, types.int64, types.int64), codegen


@intrinsic
def spread(tag, value):
    lanes = Lanes(value, tag.instance_class.width)
    return lanes(tag, value), lambda builder, _, number: splat(builder, number, lanes)


def room_for(points, numbers):
    """Return an array (components, points) on the stack for such numbers."""
    return np.zeros((len(numbers), points), np.asarray(numbers[0]).dtype)


@implements(room_for)
@intrinsic
def _room_for(points, numbers):
    if not isinstance(points, types.IntegerLiteral):
        return None
    array = types.Array(numbers[0], 2, "C")
    shape = len(numbers), points.literal_value

    def codegen(builder, *_):
        number = llvm.memory_type(array.dtype)
        memory = llvm.room(builder, ir.ArrayType(number, shape[0] * shape[1]))
        memory.align = 64  # bytes of a cache line
        size = array.dtype.bitwidth // 8
        data = builder.bitcast(memory, number.as_pointer())
        strides = shape[1] * size, size
        return llvm.make_array(builder, array, data, [*map(I64, shape)], [*map(I64, strides)])

    return array(points, numbers), codegen


def _masked(builder: ir.IRBuilder, p: Any, width: int) -> ir.Value:
    numbers = Lanes(types.int64, width)
    count = splat(builder, builder.extract_value(p, 1), numbers)
    all_of_them = ir.Constant(llvm.register_type(numbers), list(range(width)))
    return builder.icmp_signed("<", all_of_them, count)


@intrinsic
def _present(p):
    mask = Lanes(types.boolean, p.width)
    return mask(p), lambda builder, value: _masked(builder, value, p.width)


@implements(of_present, LaneGroup)
def _of_present(p, value):
    return select(_present(p), value, real(0, value))


def _either(
    builder: ir.IRBuilder, condition: ir.Value, first: Callable, second: Callable
) -> ir.Value:
    results = []
    with builder.if_else(condition) as branches:
        for branch, write in zip(branches, (first, second), strict=True):
            with branch:
                results.append((write(), builder.block))
    if results[0][0] is None:
        return None
    chosen = builder.phi(results[0][0].type)
    for value, block in results:
        chosen.add_incoming(value, block)
    return chosen


def _all_or_masked(
    builder: ir.IRBuilder,
    pointer: ir.Value,
    p: Any,
    lanes: Lanes,
    whole: Callable,
    partly: Callable,
) -> ir.Value:
    """Access all lanes if all have a point, as in nearly all groups; otherwise with a mask.

    `partly` gets LLVM's name of the vectors, address, alignment and mask.
    """
    size = lanes.scalar.bitwidth // 8
    vector = llvm.register_type(lanes)
    at = builder.bitcast(pointer, vector.as_pointer())
    full = builder.icmp_signed("==", builder.extract_value(p, 1), I64(lanes.width))

    def masked() -> Any:
        name = f"{llvm.overloaded(vector)}.p0"
        return partly(name, at, I32(size), _masked(builder, p, lanes.width))

    return _either(builder, full, lambda: whole(at, size), masked)


def _points_at(
    builder: ir.IRBuilder, array: types.Array, value: ir.Value, at: Any, index: ir.Value
) -> tuple:
    """Return address of an item whose last index is a group, and the group."""
    kinds, values = _indices(builder, at, index)
    first = builder.extract_value(values[-1], 0)
    # Points in a row are contiguous; rows may be any distance apart.
    size = I64(array.dtype.bitwidth // 8)
    indices = [*_as_places(builder, kinds[:-1], values[:-1]), first]
    return llvm.item_pointer(builder, array, value, indices, size), values[-1]


def _indices(builder: ir.IRBuilder, at: Any, value: ir.Value) -> tuple[list, list]:
    if isinstance(at, types.BaseTuple):
        return list(at), llvm.unpack(builder, value)
    return [at], [value]


def _as_places(builder: ir.IRBuilder, kinds: list, values: list) -> list:
    return [llvm.cast(builder, v, k, types.intp) for k, v in zip(kinds, values, strict=True)]


@intrinsic
def _load_points(array, at):
    lanes = Lanes(array.dtype, lanes_of(at))
    vector = llvm.register_type(lanes)

    def codegen(builder, value, index):
        pointer, p = _points_at(builder, array, value, at, index)

        def partly(name, here, align, mask):
            """Give lanes without a point the number of the first point."""
            kinds = [here.type, I32, mask.type, vector]
            load = llvm.external(builder, f"llvm.masked.load.{name}", vector, kinds)
            loaded = builder.call(load, [here, align, mask, ir.Constant(vector, None)])
            first = shuffle(builder, loaded, loaded, [0] * lanes.width)
            return builder.select(mask, loaded, first)

        def whole(here, size):
            return builder.load(here, align=size)

        return _all_or_masked(builder, pointer, p, lanes, whole, partly)

    return lanes(array, at), codegen


@intrinsic
def _store_points(array, at, value):
    lanes = Lanes(array.dtype, lanes_of(at))

    def codegen(builder, table, index, number):
        pointer, p = _points_at(builder, array, table, at, index)

        def partly(name, here, align, mask):
            kinds = [number.type, here.type, I32, mask.type]
            store = llvm.external(builder, f"llvm.masked.store.{name}", ir.VoidType(), kinds)
            builder.call(store, [number, here, align, mask])

        def whole(here, size):
            builder.store(number, here, align=size)

        _all_or_masked(builder, pointer, p, lanes, whole, partly)

    return types.void(array, at, value if isinstance(value, Lanes) else lanes), codegen


def ask(builder: ir.IRBuilder, pointer: ir.Value, ahead: ir.Value) -> None:
    at = builder.gep(builder.bitcast(pointer, llvm.NOTHING), [ahead])
    kinds = [llvm.NOTHING, I32, I32, I32]
    function = llvm.external(builder, "llvm.prefetch.p0", ir.VoidType(), kinds)
    read, near, data = I32(0), I32(3), I32(1)
    builder.call(function, [at, read, near, data])


@implements(prefetch, LaneGroup)
@intrinsic
def _prefetch(array, at):
    def codegen(builder, value, index):
        pointer, _ = _points_at(builder, array, value, at, index)
        ask(builder, pointer, I32(AHEAD))

    return types.void(array, at), codegen


def at_lane(builder, kind, array, of, at, k, *rest):
    """Return the address of an item at lane `k` of nodes `at`, or at number `at`."""
    if not lanes_of(of):
        return llvm.item_pointer(builder, kind, array, [at, *rest])
    steps = None
    if isinstance(of, Beside):
        of, at, steps = of.nodes, *(builder.extract_value(at, k) for k in (0, 1))
    first = llvm.cast(builder, lane(builder, at, k), of.scalar, types.intp)
    pointer = llvm.item_pointer(builder, kind, array, [first, *rest])
    if steps is None:
        return pointer
    # Addresses are relative to the first node, so that neighbours need a single address.
    stride = llvm.ArrayParts(builder, kind, array).strides[0]
    return llvm.byte_pointer(builder, pointer, builder.mul(steps, stride))


@intrinsic
def _gather(array, at):
    lanes = Lanes(array.dtype, lanes_of(at))

    def codegen(builder, value, index):
        kinds, values = _indices(builder, at, index)
        rest = _as_places(builder, kinds[1:], values[1:])

        def of(k):
            return builder.load(at_lane(builder, array, value, kinds[0], values[0], k, *rest))

        def apart():
            return pack(builder, [of(k) for k in range(lanes.width)], lanes)

        if array.ndim > 1:
            return apart()
        # Most groups have a single material, so parameters of the law are loaded as plain numbers.
        one = all_same(builder, values[0])
        return _either(builder, one, lambda: splat(builder, of(0), lanes), apart)

    return lanes(array, at), codegen


def _index_at(at: Any, k: int) -> Any:
    return tuple(at)[k] if isinstance(at, types.BaseTuple) and len(at) else at


@implements(operator.getitem, by_type=True)
def _get(array, at):
    if isinstance(array, types.Array) and isinstance(_index_at(at, -1), LaneGroup):
        return _load_points
    if isinstance(array, types.Array) and isinstance(_index_at(at, 0), Lanes | Beside):
        return _gather
    return None


@implements(operator.setitem, by_type=True)
def _set(array, at, value):
    if isinstance(array, types.Array) and isinstance(_index_at(at, -1), LaneGroup):
        return _store_points
    return None


@implements(beside, Lanes)
@intrinsic
def _beside(first, steps):
    made = Beside(first)

    def codegen(builder, *values):
        return llvm.make_struct(builder, made.register_type(), values)

    return made(first, types.intp), codegen


implements(index, Beside)(lambda i: i)
