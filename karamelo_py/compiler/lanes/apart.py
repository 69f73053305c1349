"""Functions of numbers in lanes: done for one lane after another."""

import math
import operator
from collections.abc import Callable, Iterator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from karamelo_py.compiler.compile import (
    added,
    by_type,
    define,
    first_failing,
    first_lane,
    in_each_lane,
    lanes_of,
    largest,
)
from karamelo_py.compiler.lanes.registers import I64, Lanes, element, known, lane, vector_of
from karamelo_py.compiler.values import Untraceable


def _of_leaves(kind: Any, change: Callable) -> Any:
    """The type of a tuple, or number, with another type for each number in it."""
    if not isinstance(kind, types.BaseTuple):
        return change(kind)
    items = [_of_leaves(item, change) for item in kind]
    return types.BaseTuple.from_types(items, getattr(kind, "instance_class", None))


def _one_of(kind: Any) -> Any:
    """The type of what one lane has."""
    return _of_leaves(kind, lambda k: k.scalar if isinstance(k, Lanes) else k)


def _apart(builder: Any, kind: Any, value: Any) -> Iterator[tuple[Any, Any]]:
    """What is in a tuple that is no tuple itself: type and value of one after another."""
    if not isinstance(kind, types.BaseTuple):
        yield kind, value
        return
    for k, item in enumerate(kind):
        yield from _apart(builder, item, builder.extract_value(value, k))


def _joined(context: Any, builder: Any, kind: Any, values: Iterator) -> Any:
    """The tuple of this type that has these values."""
    if not isinstance(kind, types.BaseTuple):
        return next(values)
    items = [_joined(context, builder, item, values) for item in kind]
    return context.make_tuple(builder, kind, items)


def _room(builder: Any, lanes: Lanes) -> tuple[Any, Any]:
    """Memory for lanes, as one vector and as numbers; truth takes bytes there."""
    bits = ir.IntType(8) if isinstance(lanes.scalar, types.Boolean) else element(lanes.scalar)
    room = cgutils.alloca_once(builder, ir.VectorType(bits, lanes.width))
    return room, builder.bitcast(room, bits.as_pointer())


@intrinsic(prefer_literal=True)
def _lane_by_lane(typing_context, function, unrolled, arguments):
    """What a function of numbers gives for one lane after another."""
    width = lanes_of(arguments)
    inner = function.get_call_type(typing_context, tuple(map(_one_of, arguments)), {})
    result = _of_leaves(inner.return_type, lambda kind: Lanes(kind, width))

    def codegen(context, builder, sig, values):
        called = context.get_function(function, inner)
        context.add_linking_libs(getattr(called, "libs", ()))
        given = []
        for kind, value in _apart(builder, arguments, values[2]):
            if isinstance(kind, Lanes):
                room, place = _room(builder, kind)
                if isinstance(kind.scalar, types.Boolean):
                    value = builder.zext(value, room.type.pointee)
                builder.store(value, room)
                value = place
            given.append((kind, value))
        count = ir.Constant(I64, width)
        if not unrolled.literal_value:
            # The loop is to stay one, with one copy of the function: LLVM must not know its count.
            count = builder.asm(ir.FunctionType(I64, [I64]), "", "=r,0", [count], False)
        empty = context.get_constant_undef(result)
        kinds = [kind for kind, _ in _apart(builder, result, empty)]
        rooms = [_room(builder, kind) for kind in kinds]
        with cgutils.for_range(builder, count) as loop:
            numbers = []
            for kind, value in given:
                if isinstance(kind, Lanes):
                    value = builder.load(builder.gep(value, [loop.index]))
                    if isinstance(kind.scalar, types.Boolean):
                        value = builder.trunc(value, ir.IntType(1))
                numbers.append(value)
            numbers = iter(numbers)
            of_lane = [_joined(context, builder, kind, numbers) for kind in inner.args]
            found = called(builder, of_lane)
            pairs = zip(_apart(builder, inner.return_type, found), rooms, strict=True)
            for (kind, number), (_, place) in pairs:
                if isinstance(kind, types.Boolean):
                    number = builder.zext(number, ir.IntType(8))
                builder.store(number, builder.gep(place, [loop.index]))
        vectors = (
            builder.trunc(builder.load(room), vector_of(kind))
            if isinstance(kind.scalar, types.Boolean)
            else builder.load(room)
            for kind, (room, _) in zip(kinds, rooms, strict=True)
        )
        return _joined(context, builder, result, vectors)

    return result(function, unrolled, arguments), codegen


@by_type(in_each_lane)
def _in_each_lane(function, arguments):
    return lambda function, arguments: _lane_by_lane(function, False, arguments)


@intrinsic
def _largest_lane(typing_context, a):
    def codegen(context, builder, sig, arguments):
        largest = lane(builder, arguments[0], 0)
        for k in range(1, a.width):
            value = lane(builder, arguments[0], k)
            larger = builder.fcmp_ordered(">", value, largest)
            largest = builder.select(larger, value, largest)
        return largest

    return a.scalar(a), codegen


@intrinsic
def _first_false(typing_context, mask):
    def codegen(context, builder, sig, arguments):
        found = ir.Constant(ir.IntType(64), 0)
        for k in reversed(range(mask.width)):
            holds = lane(builder, arguments[0], k)
            found = builder.select(holds, found, ir.Constant(ir.IntType(64), k))
        return found

    return types.int64(mask), codegen


@intrinsic
def _first(typing_context, a):
    def codegen(context, builder, sig, arguments):
        return lane(builder, arguments[0], 0)

    return a.scalar(a), codegen


@intrinsic
def _added_lanes(typing_context, total, a):
    def codegen(context, builder, sig, arguments):
        sum_so_far, values = arguments
        for k in range(a.width):
            sum_so_far = builder.fadd(sum_so_far, lane(builder, values, k))
        return sum_so_far

    return total(total, a), codegen


known(largest, _largest_lane)
known(added, _added_lanes)
known(first_failing, _first_false)
known(first_lane, _first)


def _each_lane(function: Callable) -> None:
    """Let a function of numbers know lanes: it is called for one after another."""

    @by_type(function)
    def chosen(*arguments):
        if not lanes_of(arguments):
            return None
        names = ", ".join(f"a{k}" for k in range(len(arguments)))
        call = f"return call(function, True, ({names},))"
        return define(names, call, function=function, call=_lane_by_lane)


for _function in (
    math.log, math.log1p, math.exp, math.expm1, math.pow, math.sin, math.cos, math.tan, math.atan2,
    operator.pow, operator.floordiv, operator.mod,
):  # fmt: skip
    _each_lane(_function)


@by_type(bool)
def _branch(value):
    if lanes_of(value):
        raise Untraceable(
            "several points are computed at once, which a branch cannot tell apart: take choose, "
            "in_all or in_any, or name the point function in one_by_one"
        )
