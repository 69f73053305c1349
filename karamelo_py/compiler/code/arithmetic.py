"""Operations on numbers: result types and code."""

import ctypes
import functools
import math
import operator
import sys
from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.code import exceptions, machine
from karamelo_py.compiler.llvm import Lanes, scalar_of


class Operation(NamedTuple):
    result: types.Type
    arguments: tuple[types.Type, ...]  # types that operands are cast to
    code: Callable  # ``code(builder, values)``


_NUMBER = (types.Number, types.Boolean, Lanes)
_TYPES = {
    **{getattr(np, name): getattr(types, name) for name in (
        "float32", "float64", "int8", "int16", "int32", "int64",
        "uint8", "uint16", "uint32", "uint64",
    )},
    np.bool_: types.boolean,
}  # fmt: skip


def common(*kinds: types.Type) -> types.Type:
    return functools.reduce(_wider, kinds)


def _wider(a: types.Type, b: types.Type) -> types.Type:
    if isinstance(a, Lanes) or isinstance(b, Lanes):
        return _wider_lanes(a, b)
    if types.uint64 in (a, b) and types.boolean in (a, b):
        return types.uint64
    if a == b and not isinstance(a, types.Boolean) and a.bitwidth >= 32 + 32 * _is_whole(a):
        return a
    if _is_whole(a) and _is_whole(b):
        unsigned = [not isinstance(k, types.Boolean) and not k.signed for k in (a, b)]
        if all(unsigned):
            return types.uint64
        long = any(one and k.bitwidth == 64 for one, k in zip(unsigned, (a, b), strict=True))
        return types.float64 if long else types.int64
    singles = all(_is_whole(k) is False and k.bitwidth == 32 for k in (a, b))
    return types.float32 if singles else types.float64


def _wider_lanes(a: types.Type, b: types.Type) -> Lanes:
    if isinstance(a, Lanes) and isinstance(b, Lanes):
        if a == b:
            return a
        if isinstance(a.scalar, types.Integer) and isinstance(b.scalar, types.Integer):
            return a if a.scalar.bitwidth >= b.scalar.bitwidth else b
        raise TypeError("lanes of several types")
    lanes, other = (a, b) if isinstance(a, Lanes) else (b, a)
    # Integer lanes would truncate a real operand; convert the lanes by `real(i, x)`.
    if isinstance(other, types.Float) and _is_whole(lanes):
        raise TypeError("whole lanes and a real number")
    return lanes


def _is_whole(kind: types.Type) -> bool:
    return isinstance(scalar_of(kind), types.Integer | types.Boolean)


def _unary(kind_of: Callable, write: Callable, result: types.Type | None = None) -> Callable:
    """Return an operation on a number that is cast to a type: ``write(builder, kind, value)``."""

    def operation(a: types.Type) -> Operation | None:
        kind = kind_of(a)
        return kind and Operation(
            result or kind, (kind,), lambda builder, values: write(builder, kind, *values)
        )

    return operation


def _binary(kind_of: Callable, write: Callable) -> Callable:
    def operation(a: types.Type, b: types.Type) -> Operation | None:
        kind = kind_of(a, b)
        return kind and Operation(
            kind, (kind, kind), lambda builder, values: write(builder, kind, *values)
        )

    return operation


def _sum(of_reals: str, of_whole: str) -> Callable:
    def write(builder: ir.IRBuilder, kind: types.Type, *values: ir.Value) -> ir.Value:
        return getattr(builder, of_whole if _is_whole(kind) else of_reals)(*values)

    return _binary(common, write)


def _bits(name: str) -> Callable:
    def kind_of(a: types.Type, b: types.Type) -> types.Type | None:
        if not (_is_whole(a) and _is_whole(b)):
            return None
        kind = types.boolean if a == b == types.boolean else common(a, b)
        return types.int64 if isinstance(kind, types.Float) else kind

    return _binary(kind_of, lambda builder, kind, *values: getattr(builder, name)(*values))


def _shift(write: Callable) -> Callable:
    return _binary(lambda a, b: common(a, a) if _is_whole(a) and _is_whole(b) else None, write)


def _shifted_right(builder: ir.IRBuilder, kind: types.Integer, *values: ir.Value) -> ir.Value:
    return (builder.ashr if kind.signed else builder.lshr)(*values)


def _comparison(sign: str) -> Callable:
    def operation(a: types.Type, b: types.Type) -> Operation:
        kind = common(a, b)
        if not _is_whole(kind) and _is_whole(a) and _is_whole(b):
            return Operation(types.boolean, (a, b), _mixed(sign, a.signed))
        return Operation(_truth_of(kind), (kind, kind), _compared(sign, kind))

    return operation


def _truth_of(kind: types.Type) -> types.Type:
    return Lanes(types.boolean, kind.width) if isinstance(kind, Lanes) else types.boolean


def _compared(sign: str, kind: types.Type) -> Callable:
    def compared(builder: ir.IRBuilder, values: list) -> ir.Value:
        if not _is_whole(kind):
            compare = builder.fcmp_unordered if sign == "!=" else builder.fcmp_ordered
        else:
            unsigned = isinstance(kind, types.Integer) and not kind.signed
            compare = builder.icmp_unsigned if unsigned else builder.icmp_signed
        return compare(sign, *values)

    return compared


def _mixed(sign: str, first_signed: bool) -> Callable:

    def compared(builder: ir.IRBuilder, values: list) -> ir.Value:
        values = [v if v.type.width == 64 else builder.sext(v, llvm.I64) for v in values]
        negative = builder.icmp_signed("<", values[not first_signed], llvm.I64(0))
        below = builder.icmp_signed(
            sign, *((llvm.I64(-1), llvm.I64(0))[:: 1 if first_signed else -1])
        )
        return builder.select(negative, below, builder.icmp_unsigned(sign, *values))

    return compared


def _whole_division(remainder: bool) -> Callable:
    """Return Python's floor division or remainder; 0 if an integer is divided by 0."""

    def write(builder: ir.IRBuilder, kind: types.Type, *values: ir.Value) -> ir.Value:
        of = _whole_parts if _is_whole(kind) else _real_parts
        return of(builder, kind, *values)[remainder]

    return _binary(common, write)


def _whole_parts(builder: ir.IRBuilder, kind: types.Integer, x: ir.Value, y: ir.Value) -> tuple:
    zero, one = x.type(0), x.type(1)
    safe = isinstance(y, ir.Constant) and y.constant not in (0, -1)
    bad = None
    if not safe:
        bad = builder.icmp_signed("==", y, zero)
        if kind.signed:  # overflow: the smallest number divided by -1
            least = builder.icmp_signed("==", x, x.type(kind.minval))
            bad = builder.or_(bad, builder.and_(least, builder.icmp_signed("==", y, x.type(-1))))
        y = builder.select(bad, one, y)
    if kind.signed:
        quotient, rest = builder.sdiv(x, y), builder.srem(x, y)
        other = builder.icmp_signed("<", builder.xor(y, rest), zero)
        other = builder.and_(builder.icmp_signed("!=", rest, zero), other)
        quotient = builder.select(other, builder.sub(quotient, one), quotient)
        rest = builder.select(other, builder.add(rest, y), rest)
    else:
        quotient, rest = builder.udiv(x, y), builder.urem(x, y)
    if safe:
        return quotient, rest
    return tuple(builder.select(bad, zero, result) for result in (quotient, rest))


def _real_parts(builder: ir.IRBuilder, kind: types.Float, x: ir.Value, y: ir.Value) -> tuple:
    """Divide like Python (Objects/floatobject.c); division by 0 like NumPy."""
    real = x.type
    zero, one = real(0.0), real(1.0)
    rest = builder.frem(x, y)
    quotient = builder.fdiv(builder.fsub(x, rest), y)
    below = builder.fcmp_ordered("<", y, zero)
    other = builder.xor(below, builder.fcmp_ordered("<", rest, zero))
    left = builder.fcmp_unordered("!=", rest, zero)
    turn = builder.and_(left, other)
    quotient = builder.select(turn, builder.fsub(quotient, one), quotient)
    sign = builder.select(below, real(-0.0), zero)
    rest = builder.select(left, builder.select(turn, builder.fadd(rest, y), rest), sign)
    floor = llvm.call(builder, "llvm.floor", real, [quotient])
    high = builder.fcmp_ordered(">", builder.fsub(quotient, floor), real(0.5))
    floor = builder.select(high, builder.fadd(floor, one), floor)
    square = builder.fmul(quotient, quotient)
    none = builder.fdiv(builder.fmul(square, x), y)
    floor = builder.select(builder.fcmp_ordered("!=", quotient, zero), floor, none)
    by_zero = builder.fcmp_ordered("==", y, zero)
    return (
        builder.select(by_zero, builder.fdiv(x, y), floor),
        builder.select(by_zero, builder.frem(x, y), rest),
    )


def _power(a: types.Type, b: types.Type) -> Operation | None:
    if isinstance(b, types.IntegerLiteral) and abs(b.literal_value) <= 0x10000:
        kind, exponent = common(a, a), b.literal_value
        if exponent < 0 and _is_whole(kind):
            return None
        return Operation(kind, (kind, types.int64), _product(kind, exponent))
    kind = common(types.unliteral(a), types.unliteral(b))
    if _is_whole(kind):
        return None
    return Operation(kind, (kind, kind), llvm.of_library("llvm.pow"))


def _product(kind: types.Type, exponent: int) -> Callable:
    def power(builder: ir.IRBuilder, values: list) -> ir.Value:
        multiply = builder.mul if _is_whole(kind) else builder.fmul
        factor, left, made = values[0], abs(exponent), None
        while left:
            if left & 1:
                made = factor if made is None else multiply(made, factor)
            left >>= 1
            factor = multiply(factor, factor) if left else factor
        made = values[0].type(1) if made is None else made
        return builder.fdiv(made.type(1.0), made) if exponent < 0 else made

    return power


def _alone(a: types.Type) -> types.Type:
    return common(a, a)


def _negative(builder: ir.IRBuilder, kind: types.Type, value: ir.Value) -> ir.Value:
    return builder.neg(value) if _is_whole(kind) else builder.fneg(value)


def _inverted(a: types.Type) -> types.Type | None:
    if not _is_whole(a):
        return None
    return a if isinstance(a, types.Boolean) else common(a, a)


def _not(builder: ir.IRBuilder, kind: types.Type, value: ir.Value) -> ir.Value:
    return builder.not_(value)


def _sized(a: types.Type) -> types.Type | None:
    if isinstance(a, Lanes) and _is_whole(a):
        return None
    return common(a, a) if isinstance(a, types.Boolean) else a


def _size(builder: ir.IRBuilder, kind: types.Type, value: ir.Value) -> ir.Value:
    if not _is_whole(kind):
        return llvm.call(builder, "llvm.fabs", value.type, [value])
    below = builder.icmp_signed("<", value, value.type(0))
    return builder.select(below, builder.neg(value), value) if kind.signed else value


def _extreme(sign: str) -> Callable:
    """Return Python's min or max, the first of equal numbers."""

    def operation(*kinds: types.Type) -> Operation | None:
        if len(kinds) < 2:
            return None
        kind = common(*kinds)
        better = _compared(sign, kind)

        def extreme(builder: ir.IRBuilder, values: list) -> ir.Value:
            best = values[0]
            for value in values[1:]:
                best = builder.select(better(builder, [value, best]), value, best)
            return best

        return Operation(kind, (kind,) * len(kinds), extreme)

    return operation


def _as_it_is(builder: ir.IRBuilder, kind: types.Type, value: ir.Value) -> ir.Value:
    return value


def _to(kind: types.Type) -> Callable:
    return _unary(lambda a: kind, _as_it_is)


def _real_of(kind: types.Type) -> types.Type | None:
    if isinstance(kind, Lanes):
        return None if _is_whole(kind) else kind
    return kind if isinstance(kind, types.Float) else types.float64


def _of_reals(name: str, count: int = 1) -> Callable:
    def operation(*kinds: types.Type) -> Operation | None:
        if len(kinds) != count:
            return None
        kind = _real_of(common(*kinds))
        return kind and Operation(kind, (kind,) * count, llvm.of_library(name))

    return operation


def _rounding(name: str) -> Callable:
    def rounded(builder: ir.IRBuilder, kind: types.Type, value: ir.Value) -> ir.Value:
        return builder.fptosi(llvm.call(builder, name, value.type, [value]), llvm.I64)

    return _unary(_real_of, rounded, types.int64)


def _is_no_number(builder: ir.IRBuilder, kind: types.Type, x: ir.Value) -> ir.Value:
    return builder.fcmp_unordered("uno", x, x)


def _is_infinite(builder: ir.IRBuilder, kind: types.Type, x: ir.Value) -> ir.Value:
    return builder.fcmp_ordered("==", _size(builder, kind, x), x.type(math.inf))


def _is_finite(builder: ir.IRBuilder, kind: types.Type, x: ir.Value) -> ir.Value:
    rest = builder.fsub(x, x)
    return builder.fcmp_ordered("ord", rest, rest)


def _frexp(a: types.Type) -> Operation:
    kind = _real_of(a)
    result = types.Tuple((kind, types.int32))

    def parts(builder: ir.IRBuilder, values: list) -> ir.Value:
        room = llvm.room(builder, llvm.I32)
        fraction = llvm.call(builder, "frexp", values[0].type, [*values, room])
        return llvm.make_tuple(builder, result, [fraction, builder.load(room)])

    return Operation(result, (kind,), parts)


def _ldexp(a: types.Type, b: types.Type) -> Operation:
    kind = _real_of(a)
    return Operation(kind, (kind, types.int32), llvm.of_library("ldexp"))


def _scaled(factor: float) -> Callable:
    return _unary(_real_of, lambda builder, kind, x: builder.fmul(x, x.type(factor)))


def _numpy_extreme(sign: str) -> Callable:
    """Return NumPy's minimum or maximum, NaN if an operand is."""

    def operation(a: types.Type, b: types.Type) -> Operation:
        kind = common(a, b)
        if _is_whole(kind):
            return _extreme(sign)(a, b)

        def extreme(builder: ir.IRBuilder, values: list) -> ir.Value:
            first, second = values
            chosen = builder.fcmp_unordered(sign, first, second)
            ordered = builder.fcmp_ordered("ord", second, second)
            return builder.select(builder.and_(chosen, ordered), first, second)

        return Operation(kind, (kind, kind), extreme)

    return operation


def _gamma_of_python(x: float) -> float:
    try:
        return math.gamma(x)
    except OverflowError:
        return math.inf
    except ValueError:
        return math.copysign(math.inf, x) if x == 0 else math.nan


_OF_DOUBLE = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)
machine.publish_python("karamelo_gamma", _OF_DOUBLE, exceptions.never_raising(_gamma_of_python))
_TOLD = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_int64)
machine.publish_python("karamelo_told_gamma", _TOLD, exceptions.noting(_gamma_of_python))


def _gamma(builder: ir.IRBuilder, kind: types.Type, x: ir.Value) -> ir.Value:
    """Call Python's gamma, as results differ in their last bits between C libraries."""
    double = llvm.cast(builder, x, kind, types.float64)
    failure = exceptions.passed_to(builder, builder.function)
    name = "karamelo_told_gamma" if failure else "karamelo_gamma"  # Ctrl-C may interrupt gamma
    result = llvm.call(builder, name, double.type, [double, *failure])
    return llvm.cast(builder, result, types.float64, kind)


_HYPOT = "_hypot" if sys.platform == "win32" else "hypot"
_IN_LLVM = ("exp", "exp2", "log", "log10", "sin", "cos", "sqrt", "fabs")
_IN_C = (
    "log2", "log1p", "expm1", "erf", "erfc", "tan", "asin", "acos", "atan", "asinh", "acosh",
    "atanh", "sinh", "cosh", "tanh", "lgamma", "cbrt",
)  # fmt: skip

for _name, (_real, _ending) in product(
    _IN_C, ((ctypes.c_double, ""), (ctypes.c_float, "f"))
):  # functions that this C library lacks
    if not machine.is_known(_name + _ending):
        _kind, _plain = ctypes.CFUNCTYPE(_real, _real), getattr(math, _name)
        machine.publish_python(_name + _ending, _kind, exceptions.never_raising(_plain))

OPERATIONS: dict[Any, Callable] = {
    operator.add: _sum("fadd", "add"),
    operator.sub: _sum("fsub", "sub"),
    operator.mul: _sum("fmul", "mul"),
    operator.truediv: _binary(
        lambda a, b: _real_of(common(a, b)), lambda builder, kind, *values: builder.fdiv(*values)
    ),
    operator.floordiv: _whole_division(False),
    operator.mod: _whole_division(True),
    operator.pow: _power,
    operator.and_: _bits("and_"),
    operator.or_: _bits("or_"),
    operator.xor: _bits("xor"),
    operator.lshift: _shift(lambda builder, kind, *values: builder.shl(*values)),
    operator.rshift: _shift(_shifted_right),
    operator.neg: _unary(_alone, _negative),
    operator.pos: _unary(_alone, _as_it_is),
    operator.invert: _unary(_inverted, _not),
    operator.not_: _unary(_truth_of, _not),
    operator.lt: _comparison("<"),
    operator.le: _comparison("<="),
    operator.gt: _comparison(">"),
    operator.ge: _comparison(">="),
    operator.eq: _comparison("=="),
    operator.ne: _comparison("!="),
    abs: _unary(_sized, _size),
    bool: _to(types.boolean),
    float: _unary(_real_of, _as_it_is),
    int: _unary(lambda a: a if isinstance(a, types.Integer) else types.int64, _as_it_is),
    max: _extreme(">"),
    min: _extreme("<"),
    round: lambda *kinds: _rounding("llvm.rint")(*kinds) if len(kinds) == 1 else None,
    math.floor: _rounding("llvm.floor"),
    math.ceil: _rounding("llvm.ceil"),
    math.trunc: _rounding("llvm.trunc"),
    math.isnan: _unary(_real_of, _is_no_number, types.boolean),
    math.isinf: _unary(_real_of, _is_infinite, types.boolean),
    math.isfinite: _unary(_real_of, _is_finite, types.boolean),
    math.pow: lambda a, b: _power(_real_of(types.unliteral(a)), b),
    math.copysign: _of_reals("llvm.copysign", 2),
    math.atan2: _of_reals("atan2", 2),
    math.hypot: _of_reals(_HYPOT, 2),
    math.fmod: _of_reals("fmod", 2),
    math.gamma: _unary(_real_of, _gamma),
    math.frexp: _frexp,
    math.ldexp: _ldexp,
    math.degrees: _scaled(180 / math.pi),
    math.radians: _scaled(math.pi / 180),
    **{getattr(math, name): _of_reals(f"llvm.{name}") for name in _IN_LLVM},
    **{getattr(math, name): _of_reals(name) for name in _IN_C},
    **{number: _to(kind) for number, kind in _TYPES.items()},
    **{kind: _to(kind) for kind in _TYPES.values()},
}


# NumPy's names of functions, and its functions that convert to reals.
_IN_NUMPY = {
    "absolute": abs, "add": operator.add, "subtract": operator.sub, "multiply": operator.mul,
    "true_divide": operator.truediv, "negative": operator.neg, "power": operator.pow,
    "arcsin": math.asin, "arccos": math.acos, "arctan": math.atan, "arctan2": math.atan2,
    "arcsinh": math.asinh, "arccosh": math.acosh, "arctanh": math.atanh,
}  # fmt: skip
_ALIKE = (
    "sqrt", "exp", "exp2", "log", "log2", "log10", "log1p", "expm1", "sin", "cos", "tan", "sinh",
    "cosh", "tanh", "cbrt", "fabs", "hypot", "fmod", "copysign", "isnan", "isinf", "isfinite",
    "degrees", "radians",
)  # fmt: skip
OPERATIONS |= {getattr(np, name): OPERATIONS[function] for name, function in _IN_NUMPY.items()}
OPERATIONS |= {getattr(np, name): OPERATIONS[getattr(math, name)] for name in _ALIKE}
OPERATIONS |= {
    getattr(np, name): _of_reals(f"llvm.{name}") for name in ("floor", "ceil", "trunc", "rint")
}
OPERATIONS |= {np.minimum: _numpy_extreme("<"), np.maximum: _numpy_extreme(">")}

IN_LANES = {
    operator.add, operator.sub, operator.mul, operator.truediv, operator.and_, operator.or_,
    operator.neg, operator.not_, operator.lt, operator.le, operator.gt, operator.ge, operator.eq,
    operator.ne, abs, max, min, math.sqrt,
}  # fmt: skip


_POWERS = {operator.pow, math.pow, np.power}  # for known exponents, powers are products


def operation(function: Callable, kinds: tuple[types.Type, ...]) -> Operation | None:
    made, plain = OPERATIONS.get(function), tuple(map(types.unliteral, kinds))
    if made is None or not all(isinstance(kind, _NUMBER) for kind in plain):
        return None
    if function not in IN_LANES and any(isinstance(kind, Lanes) for kind in plain):
        return None
    try:
        return made(*(kinds if function in _POWERS else plain))
    except TypeError:  # the number of arguments is wrong, or lanes are inconsistent
        return None
