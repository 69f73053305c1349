"""Lanes as a number type: choices, conversions, questions, and what is done lane after lane."""

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types

from karamelo_py.compiler import code
from karamelo_py.compiler.arithmetic import common
from karamelo_py.compiler.code import I64, Lanes, lane, scalar_of, splat
from karamelo_py.compiler.compile import (
    added,
    all_lanes,
    any_lane,
    first_false_lane,
    first_lane,
    implements,
    index,
    lane_by_lane,
    lanes_of,
    largest,
    real,
    round_off,
    where,
)
from karamelo_py.compiler.values import (
    Untraceable,
    Value,
    builtin,
    intrinsic,
    mapped,
    rebuilt,
)

# --- choices ----------------------------------------------------------------------------------


@intrinsic
def select(condition, a, b):
    """Choose lane by lane."""
    lanes = common(a, b)
    lanes = lanes if isinstance(lanes, Lanes) else Lanes(a, condition.width)
    return lanes(condition, lanes, lanes), lambda builder, *values: builder.select(*values)


@implements(where, Lanes)
def _where(condition, a, b):
    if not isinstance(a, tuple):
        return select(condition, a, b)
    return rebuilt(a, [where(condition, x, y) for x, y in zip(a, b, strict=True)])


def _all_bits(builder: Any, mask: Any, sign: str, wanted: int) -> Any:
    bits = builder.bitcast(mask, ir.IntType(mask.type.count))
    return builder.icmp_signed(sign, bits, ir.Constant(bits.type, wanted))


@implements(all_lanes, Lanes)
@intrinsic
def _all(mask):
    return types.boolean(mask), lambda builder, given: _all_bits(builder, given, "==", -1)


@implements(any_lane, Lanes)
@intrinsic
def _any(mask):
    return types.boolean(mask), lambda builder, given: _all_bits(builder, given, "!=", 0)


def all_same(builder: Any, value: Any) -> Any:
    """Check that all lanes have the same whole number."""
    first = code.shuffle(builder, value, value, [0] * value.type.count)
    return _all_bits(builder, builder.icmp_signed("==", value, first), "==", -1)


@implements(bool, Lanes)
@intrinsic
def _branch(value):
    raise Untraceable(
        "several points are computed at once, which a branch cannot tell apart: take where, "
        "all_lanes or any_lane, or name the point function in scalarised"
    )


# --- conversions ------------------------------------------------------------------------------


@implements(int, Lanes)
@intrinsic
def _truncated(a):
    if not isinstance(a.scalar, types.Float):
        return None
    whole = Lanes(types.int32, a.width)  # every processor has that, and cells are no more
    return whole(a), lambda builder, given: code.cast(builder, given, a, whole)


@implements(real, Lanes)
@intrinsic
def _real(value, like):
    made = Lanes(scalar_of(like), (value if isinstance(value, Lanes) else like).width)
    return made(value, like), lambda builder, given, _: code.cast(builder, given, value, made)


@implements(index, Lanes)
def _index(i):
    return i


@implements(round_off, Lanes)
@intrinsic
def _round_off(like):
    error = 2.0**-23 if like.scalar == types.float32 else 2.0**-52

    def codegen(builder, _):
        return splat(builder, code.constant(builder, like.scalar, error), like)

    return like(like), codegen


# --- lane after lane --------------------------------------------------------------------------


@implements(largest, Lanes)
@intrinsic
def _largest_lane(a):
    def codegen(builder, given):
        best = lane(builder, given, 0)
        for k in range(1, a.width):
            value = lane(builder, given, k)
            best = builder.select(builder.fcmp_ordered(">", value, best), value, best)
        return best

    return a.scalar(a), codegen


@implements(first_false_lane, Lanes)
@intrinsic
def _first_false(mask):
    def codegen(builder, given):
        found = I64(0)
        for k in reversed(range(mask.width)):
            found = builder.select(lane(builder, given, k), found, I64(k))
        return found

    return types.int64(mask), codegen


@implements(first_lane, Lanes)
@intrinsic
def _first(a):
    return a.scalar(a), lambda builder, given: lane(builder, given, 0)


@implements(added, Lanes)
@intrinsic
def _added_lanes(total, a):
    def codegen(builder, so_far, given):
        for k in range(a.width):
            so_far = builder.fadd(so_far, lane(builder, given, k))
        return so_far

    return total(total, a), codegen


def _lanes_changed(thing: Any, change: Callable) -> Any:
    """Give tuples, or a number, with something else for each number in lanes in them."""

    def changed(item: Any) -> Any:
        lanes = isinstance(item, Value) and isinstance(item._kind, Lanes)
        return change(item) if lanes else item

    return mapped(changed, thing)


def _room(builder: Any, lanes: Lanes) -> Any:
    """Give memory for lanes; truth takes bytes there."""
    kind = ir.VectorType(code.memory_type(lanes.scalar), lanes.width)
    return builder and code.room(builder, kind)


def _in_memory(builder: Any, value: Value) -> Value:
    """Store lanes, to be read one by one."""
    room, bits = _room(builder, value._kind), value._value
    if builder:
        wanted = room.type.pointee
        builder.store(bits if bits.type == wanted else builder.zext(bits, wanted), room)
    return Value(value._kind, room)


def _from_memory(builder: Any, stored: Value) -> Value:
    bits, wanted = builder.load(stored._value), code.register_type(stored._kind)
    return Value(stored._kind, bits if bits.type == wanted else builder.trunc(bits, wanted))


def _place(builder: Any, stored: Value, k: Any) -> Any:
    """Give where one lane in memory is."""
    scalar = code.memory_type(stored._kind.scalar)
    return builder.gep(builder.bitcast(stored._value, scalar.as_pointer()), [k])


@builtin(lane_by_lane)
def _lane_by_lane(lowering: Any, function: Callable, unrolled: bool, arguments: tuple) -> Any:
    builder = lowering.builder
    width = lanes_of(tuple(map(lowering.kind_of, arguments)))
    stored = _lanes_changed(arguments, lambda value: _in_memory(builder, value))

    def run(k: Any) -> Any:
        def of_lane(value: Value) -> Value:
            scalar = value._kind.scalar
            place = builder and _place(builder, value, k)
            return Value(scalar, builder and code.get(builder, scalar, place))

        def to_lane(thing: Any) -> Value:
            scalar = types.unliteral(lowering.kind_of(thing))
            lanes = Lanes(scalar, width)
            made = Value(lanes, _room(builder, lanes))
            if builder:
                number = lowering.lowered(thing, scalar)
                code.put(builder, scalar, number, _place(builder, made, k))
            return made

        read, lowering.read = lowering.read, dict(lowering.read)
        found = mapped(to_lane, function(*_lanes_changed(stored, of_lane)))
        lowering.read = read
        return found

    if builder is None:
        return run(None)
    count = I64(width)
    if not unrolled:
        # The loop is to stay one, with one copy of the function: LLVM must not know its count.
        count = builder.asm(ir.FunctionType(I64, [I64]), "", "=r,0", [count], False)
    with code.counted(builder, count) as k:
        found = run(k)
    return _lanes_changed(found, lambda value: _from_memory(builder, value))


def _each_lane(function: Callable) -> None:
    """Let a function of numbers know lanes: it is called for one after another."""
    implements(function, Lanes)(lambda *arguments: lane_by_lane(function, True, arguments))


for _function in (
    math.log, math.log1p, math.exp, math.expm1, math.pow, math.sin, math.cos, math.tan, math.atan2,
    operator.pow, operator.floordiv, operator.mod,
):  # fmt: skip
    _each_lane(_function)
