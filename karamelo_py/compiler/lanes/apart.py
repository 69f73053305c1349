"""Functions of numbers in lanes: done for one lane after another."""

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types

from karamelo_py.compiler import code
from karamelo_py.compiler.compile import (
    added,
    first_false_lane,
    first_lane,
    implements,
    in_each_lane,
    lanes_of,
    largest,
)
from karamelo_py.compiler.intrinsics import builtin, intrinsic
from karamelo_py.compiler.lanes.registers import I64, Lanes, lane, vector_of
from karamelo_py.compiler.values import Untraceable, Value


def _changed(thing: Any, change: Callable) -> Any:
    """Give a tuple, or number, with something else for each number in lanes in it."""
    if isinstance(thing, tuple):
        items = [_changed(item, change) for item in thing]
        return type(thing)(*items) if hasattr(thing, "_fields") else tuple(items)
    lanes = isinstance(thing, Value) and isinstance(thing._kind, Lanes)
    return change(thing) if lanes else thing


def _room(builder: Any, lanes: Lanes) -> Any:
    """Give memory for lanes; truth takes bytes there."""
    kind = ir.VectorType(code.memory_type(lanes.scalar), lanes.width)
    return builder and code.room(builder, kind)


def _of_lane(lowering: Any, lanes: Lanes, room: Any, k: Any) -> Value:
    """Read one lane in memory."""
    builder = lowering.builder
    if builder is None:
        return Value(lanes.scalar, None)
    place = builder.bitcast(room, code.memory_type(lanes.scalar).as_pointer())
    return Value(lanes.scalar, code.get(builder, lanes.scalar, builder.gep(place, [k])))


def _all_lanes(lowering: Any, function: Callable, unrolled: bool, arguments: tuple) -> Any:
    """Do a function of numbers for one lane after another."""
    builder = lowering.builder
    width = lanes_of(tuple(map(lowering.kind_of, arguments)))
    rooms: dict[int, Any] = {}

    def keep(value: Value) -> Value:
        rooms[id(value)] = room = _room(builder, value._kind)
        if builder:
            bits = value._value
            builder.store(
                bits if bits.type == room.type.pointee else builder.zext(bits, room.type.pointee),
                room,
            )
        return value

    given = [_changed(argument, keep) for argument in arguments]
    made: list[tuple[Lanes, Any]] = []

    def run(k: Any) -> Any:
        read, lowering.read = lowering.read, dict(lowering.read)
        found = function(
            *(_changed(a, lambda v: _of_lane(lowering, v._kind, rooms[id(v)], k)) for a in given)
        )
        found = _in_lanes(found, k)
        lowering.read = read
        return found

    def _in_lanes(thing: Any, k: Any) -> Any:
        if isinstance(thing, tuple):
            items = [_in_lanes(item, k) for item in thing]
            return type(thing)(*items) if hasattr(thing, "_fields") else tuple(items)
        scalar = types.unliteral(lowering.kind_of(thing))
        lanes = Lanes(scalar, width)
        room = _room(builder, lanes)
        made.append((lanes, room))
        if builder:
            place = builder.bitcast(room, code.memory_type(scalar).as_pointer())
            code.put(builder, scalar, lowering.lowered(thing, scalar), builder.gep(place, [k]))
        return Value(lanes, room)

    if builder is None:
        return run(None)
    count = ir.Constant(I64, width)
    if not unrolled:
        # The loop is to stay one, with one copy of the function: LLVM must not know its count.
        count = builder.asm(ir.FunctionType(I64, [I64]), "", "=r,0", [count], False)
    with code.counted(builder, count) as k:
        found = run(k)

    def loaded(value: Value) -> Value:
        bits = builder.load(value._value)
        wanted = vector_of(value._kind)
        return Value(value._kind, bits if bits.type == wanted else builder.trunc(bits, wanted))

    return _changed(found, loaded)


def _lane_by_lane(function: Callable, unrolled: bool, arguments: tuple) -> Any:
    """What a function of numbers gives for one lane after another."""
    raise NotImplementedError


builtin(_lane_by_lane)(_all_lanes)


@implements(in_each_lane)
def _in_each_lane(function, arguments):
    return _lane_by_lane(function, False, arguments)


@intrinsic
def _largest_lane(a):
    def codegen(builder, sig, arguments):
        largest = lane(builder, arguments[0], 0)
        for k in range(1, a.width):
            value = lane(builder, arguments[0], k)
            larger = builder.fcmp_ordered(">", value, largest)
            largest = builder.select(larger, value, largest)
        return largest

    return a.scalar(a), codegen


@intrinsic
def _first_false(mask):
    def codegen(builder, sig, arguments):
        found = ir.Constant(ir.IntType(64), 0)
        for k in reversed(range(mask.width)):
            holds = lane(builder, arguments[0], k)
            found = builder.select(holds, found, ir.Constant(ir.IntType(64), k))
        return found

    return types.int64(mask), codegen


@intrinsic
def _first(a):
    def codegen(builder, sig, arguments):
        return lane(builder, arguments[0], 0)

    return a.scalar(a), codegen


@intrinsic
def _added_lanes(total, a):
    def codegen(builder, sig, arguments):
        sum_so_far, values = arguments
        for k in range(a.width):
            sum_so_far = builder.fadd(sum_so_far, lane(builder, values, k))
        return sum_so_far

    return total(total, a), codegen


implements(largest, Lanes)(_largest_lane)
implements(added, Lanes)(_added_lanes)
implements(first_false_lane, Lanes)(_first_false)
implements(first_lane, Lanes)(_first)


def _each_lane(function: Callable) -> None:
    """Let a function of numbers know lanes: it is called for one after another."""
    implements(function, Lanes)(lambda *arguments: _lane_by_lane(function, True, arguments))


for _function in (
    math.log, math.log1p, math.exp, math.expm1, math.pow, math.sin, math.cos, math.tan, math.atan2,
    operator.pow, operator.floordiv, operator.mod,
):  # fmt: skip
    _each_lane(_function)


@intrinsic
def _branch(value):
    raise Untraceable(
        "several points are computed at once, which a branch cannot tell apart: take where, "
        "all_lanes or any_lane, or name the point function in scalarised"
    )


implements(bool, Lanes)(_branch)
