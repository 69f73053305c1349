"""Lanes as a number type: arithmetic, comparisons, choices, conversions."""

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types

from karamelo_py.compiler import code
from karamelo_py.compiler.arithmetic import ON_LANES, Operation
from karamelo_py.compiler.compile import (
    all_lanes,
    any_lane,
    fma,
    implements,
    index,
    lanes_of,
    real,
    round_off,
    where,
)
from karamelo_py.compiler.intrinsics import intrinsic
from karamelo_py.compiler.lanes.registers import I32, Lanes, call_vector, splat, vector_of
from karamelo_py.compiler.lowering import Lowering

# --- arithmetic -------------------------------------------------------------------------------


def _wider(a: Any, b: Any) -> Lanes | None:
    """Of two operands, at least one with lanes: the lanes of the result."""
    if isinstance(a, Lanes) and isinstance(b, Lanes):
        if a == b:
            return a
        if isinstance(a.scalar, types.Integer) and isinstance(b.scalar, types.Integer):
            return a if a.scalar.bitwidth >= b.scalar.bitwidth else b
        return None
    lanes, other = (a, b) if isinstance(a, Lanes) else (b, a)
    if not isinstance(lanes, Lanes) or not isinstance(other, types.Number | types.Boolean):
        return None
    # Numbers of cells beside a real number would be cut off: `real(i, x)` makes lanes of reals.
    if not isinstance(lanes.scalar, types.Float) and isinstance(other, types.Float):
        return None
    return lanes


def _spread_both(builder: Any, kinds: tuple, values: list, lanes: Lanes) -> list:
    out = []
    for kind, value in zip(kinds, values, strict=True):
        if not isinstance(kind, Lanes):
            value = splat(builder, value, lanes)
        elif kind != lanes:
            value = builder.sext(value, vector_of(lanes))
        out.append(value)
    return out


def _operator(function: Any, result: Callable, made: Callable) -> None:
    """Let an operator know lanes: `result` says of which kind, `made` makes them."""

    def operation(*kinds: types.Type) -> Operation | None:
        kinds = tuple(map(types.unliteral, kinds))
        lanes = _wider(*kinds)
        gives = None if lanes is None else result(lanes)
        if gives is None:
            return None
        kinds = tuple(k if isinstance(k, Lanes) else lanes.scalar for k in kinds)
        return Operation(
            gives,
            kinds,
            lambda builder, v: made(builder, lanes, *_spread_both(builder, kinds, v, lanes)),
        )

    ON_LANES[function] = operation


def _binary(operation: Any, of_floats: str | None, of_ints: str | None) -> None:
    def name(lanes):
        return of_floats if isinstance(lanes.scalar, types.Float) else of_ints

    _operator(
        operation,
        lambda lanes: lanes if name(lanes) else None,
        lambda builder, lanes, a, b: getattr(builder, name(lanes))(a, b),
    )


for _operation, _floats, _ints in (
    (operator.add, "fadd", "add"), (operator.sub, "fsub", "sub"), (operator.mul, "fmul", "mul"),
    (operator.truediv, "fdiv", None), (operator.and_, None, "and_"), (operator.or_, None, "or_"),
):  # fmt: skip
    _binary(_operation, _floats, _ints)


def _comparison(operation: Any, sign: str) -> None:
    def compared(builder, lanes, a, b):
        if isinstance(lanes.scalar, types.Float):
            compare = builder.fcmp_unordered if sign == "!=" else builder.fcmp_ordered
            return compare(sign, a, b)
        return builder.icmp_signed(sign, a, b)

    _operator(operation, lambda lanes: Lanes(types.boolean, lanes.width), compared)


for _operation, _sign in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="),
    (operator.eq, "=="), (operator.ne, "!="),
):  # fmt: skip
    _comparison(_operation, _sign)


def _unary(function: Any, made: Callable) -> None:
    ON_LANES[function] = lambda lanes: Operation(
        lanes, (lanes,), lambda builder, values: made(builder, lanes.scalar, values[0])
    )


def _negated(builder: Any, scalar: types.Type, value: Any) -> Any:
    return builder.fneg(value) if isinstance(scalar, types.Float) else builder.neg(value)


_unary(operator.neg, _negated)
_unary(operator.not_, lambda builder, scalar, value: builder.not_(value))


def _operands(*arguments: Any) -> tuple[Lanes, list]:
    """The lanes among the arguments, and what the others are cast to."""
    lanes = next(a for a in arguments if isinstance(a, Lanes))
    return lanes, [a if isinstance(a, Lanes) else lanes.scalar for a in arguments]


@intrinsic
def _fma_lanes(a, b, c):
    lanes, typed = _operands(a, b, c)
    return lanes(*typed), call_vector("fma", lanes)


@intrinsic
def _sqrt_lanes(a):
    return a(a), call_vector("sqrt", a)


@intrinsic
def _abs_lanes(a):
    return a(a), call_vector("fabs", a)


implements(fma, Lanes)(_fma_lanes)
implements(math.sqrt, Lanes)(_sqrt_lanes)
implements(abs, Lanes)(_abs_lanes)


@intrinsic
def select(condition, a, b):
    lanes, typed = _operands(a, b) if isinstance(a, Lanes) or isinstance(b, Lanes) else (None, None)
    if lanes is None:
        lanes, typed = Lanes(a, condition.width), [a, a]

    def codegen(builder, sig, arguments):
        values = [
            value if isinstance(kind, Lanes) else splat(builder, value, lanes)
            for kind, value in zip(sig.args[1:], arguments[1:], strict=True)
        ]
        return builder.select(arguments[0], *values)

    return lanes(condition, *typed), codegen


@implements(where, Lanes)
def _where(condition, a, b):
    if lanes_of(condition) == 0:  # the same for all
        return a if condition else b
    if not isinstance(a, tuple):
        return select(condition, a, b)
    items = [where(condition, x, y) for x, y in zip(a, b, strict=True)]
    return type(a)(*items) if hasattr(a, "_fields") else tuple(items)


@implements(max, Lanes)
def _max(*numbers):
    best = numbers[0]
    for one in numbers[1:]:
        best = select(one > best, one, best)
    return best


@implements(min, Lanes)
def _min(*numbers):
    best = numbers[0]
    for one in numbers[1:]:
        best = select(one < best, one, best)
    return best


def _truth(function: Callable, sign: str, bits_of: int) -> None:
    """Let a question about all lanes be one about the bits of a mask."""

    @intrinsic
    def asked(mask):
        def codegen(builder, sig, arguments):
            bits = builder.bitcast(arguments[0], ir.IntType(mask.width))
            return builder.icmp_signed(sign, bits, ir.Constant(bits.type, bits_of))

        return types.boolean(mask), codegen

    implements(function, Lanes)(asked)


_truth(all_lanes, "==", -1)
_truth(any_lane, "!=", 0)


# --- conversions ------------------------------------------------------------------------------


@intrinsic
def _truncated(a):
    if not isinstance(a.scalar, types.Float):
        return None
    whole = Lanes(types.int32, a.width)  # every processor has that, and cells are no more

    def codegen(builder, sig, arguments):
        return builder.fptosi(arguments[0], vector_of(whole))

    return whole(a), codegen


implements(int, Lanes)(_truncated)


@intrinsic
def _converted(value, like):
    scalar = like.scalar if isinstance(like, Lanes) else like
    lanes = Lanes(scalar, value.width)

    def codegen(builder, sig, arguments):
        if isinstance(value.scalar, types.Integer):
            narrow = arguments[0]
            if value.scalar.bitwidth > 32:
                narrow = builder.trunc(narrow, ir.VectorType(I32, value.width))
            return builder.sitofp(narrow, vector_of(lanes))
        if value.scalar.bitwidth == scalar.bitwidth:
            return arguments[0]
        convert = builder.fpext if scalar.bitwidth == 64 else builder.fptrunc
        return convert(arguments[0], vector_of(lanes))

    return lanes(value, like), codegen


Lowering.converted = _converted
Lowering.spread = staticmethod(splat)


@intrinsic
def _spread(value, like):
    def codegen(builder, sig, arguments):
        number = code.cast(builder, arguments[0], value, like.scalar)
        return splat(builder, number, like)

    return like(value, like), codegen


@implements(real, Lanes)
def _real(value, like):
    return _converted(value, like) if lanes_of(value) else _spread(value, like)


@implements(index, Lanes)
def _index(i):
    return i


@intrinsic
def _round_off(like):
    error = 2.0**-23 if like.scalar == types.float32 else 2.0**-52

    def codegen(builder, sig, arguments):
        return splat(builder, code.constant(builder, like.scalar, error), like)

    return like(like), codegen


implements(round_off, Lanes)(_round_off)
