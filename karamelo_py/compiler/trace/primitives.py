"""Functions in kernels selected by type: of points, of numbers, and of numbers in lanes."""

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.code.arithmetic import common
from karamelo_py.compiler.llvm import I64, Lanes, LaneType, scalar_of
from karamelo_py.compiler.trace import choices
from karamelo_py.compiler.trace.functions import INSTEAD, PointFunction, forget, outdate_kernels
from karamelo_py.compiler.trace.session import session
from karamelo_py.compiler.trace.values import (
    OF_REALS,
    Untraceable,
    Value,
    implementations,
    in_kernels,
    intrinsic,
    mapped,
    now,
    rebuilt,
)


def implements(function: Callable, *numbers: type, by_type: bool = False) -> Callable:
    """Decorate the implementation of `function` in kernels for number types (default: all others).

    A number type is a NamedTuple with operators (`algebra`), or lanes; it is also found inside
    tuples. The implementation is traced, or an `intrinsic`. With `by_type` the implementation is a
    Python function that returns the implementation for argument types, or None for the previous
    one.
    """

    def register(made: Callable) -> Callable:
        implementations_of = session.choosers.setdefault(function, [])
        of_numbers = any(function in (implementations(one) or ()) for one in numbers)
        if of_numbers or (implementations_of and not numbers):
            outdate_kernels()
        for one in numbers:
            if "implements" not in vars(one):
                one.implements = {}
            one.implements[function] = made
        choices.register(made)
        if by_type:
            implementations_of.insert(0, made)
        elif not numbers:
            implementations_of.append(lambda *_: made)
        forget()
        return made

    return register


def shared(function: Callable) -> Callable:
    """Mark a helper that may have other implementations (`implements`)."""
    return implements(function)(function)


def point_function(
    *, tags: int = 1, otherwise: bool = False
) -> Callable[[Callable], PointFunction]:
    """Declare a pure function of one point, selected by the classes of its first `tags` arguments.

    ``name.on(Class, ...)`` adds implementations, also in plug-ins; derived classes inherit them.
    Implementations run as plain Python (``NUMBA_DISABLE_JIT=1``, tests) and in kernels, which
    select them at compile time. With ``otherwise`` the decorated function is the default.

    Implementations process one point, or several in lanes (:mod:`karamelo_py.compiler.lanes`).
    Functions that branch are listed in ``scalarised`` of a class, and called point by point.
    """

    def declare(stub: Callable) -> PointFunction:
        made = PointFunction(stub, tags, otherwise)

        def choose(*arguments: Any) -> Callable | None:
            classes = tuple(choices.tag_class(a) for a in arguments[:tags])
            apart = any(stub.__name__ in getattr(tag, "scalarised", ()) for tag in classes)
            if apart and lanes_of(arguments):
                return lambda *values: lane_by_lane(made, False, values)
            return made.find(classes)

        session.choosers[made] = [choose]
        return made

    return declare


def real(value: float, template: Any) -> Any:
    """Convert a literal to the number type of `template`."""
    return type(template)(value)


def lanes_of(numba_type: Any) -> int:
    """Count the lanes of a type or value, 0 for numbers."""
    if isinstance(numba_type, tuple | types.BaseTuple):
        return max(map(lanes_of, numba_type), default=0)
    return numba_type.width if isinstance(numba_type, LaneType) else 0


INSTEAD[lanes_of] = lambda thing: lanes_of(now().kind_of(thing))


def _of_width(width: int, scalar: types.Type) -> types.Type:
    return Lanes(scalar, width) if width else scalar


@implements(real)
@intrinsic
def _real(value, template):
    scalar = scalar_of(template) if isinstance(template, Lanes | types.Float) else types.float64
    made = _of_width(lanes_of((value, template)), scalar)
    return made(value, template), lambda builder, number, _: llvm.cast(builder, number, value, made)


@implements(int, Lanes)
@intrinsic
def _truncated(a):
    if not isinstance(a.scalar, types.Float):
        return None
    whole = Lanes(types.int32, a.width)  # every processor has 32-bit lanes, which suffice for cells
    return whole(a), lambda builder, number: llvm.cast(builder, number, a, whole)


def round_off(template: Any) -> Any:
    """Return the relative round-off in the type of `template`."""
    return type(template)(2.0**-23 if type(template).__name__ == "float32" else 2.0**-52)


@implements(round_off)
@intrinsic
def _round_off(template):
    scalar = types.float32 if scalar_of(template) == types.float32 else types.float64
    made = _of_width(lanes_of(template), scalar)

    def codegen(builder, _):
        error = llvm.constants(scalar)(2.0**-23 if scalar == types.float32 else 2.0**-52)
        return llvm.cast(builder, error, scalar, made)

    return made(template), codegen


def index(i: int) -> int:
    """Return `i` as a non-negative array index. Omitting the sign test takes 10 % off a sweep."""
    return i


implements(index)(lambda i: types.uint64(i))

implements(index, Lanes)(lambda i: i)


@shared
def fma(a: float, b: float, c: float) -> float:
    """Return a b + c, rounded once when compiled."""
    return a * b + c


@intrinsic
def _fused(a, b, c):
    kind = common(a, b, c)
    call = llvm.of_library("llvm.fma")
    return kind(kind, kind, kind), lambda builder, *values: call(builder, values)


@implements(fma, by_type=True)
def _fma(a, b, c):
    real = a == b == c and isinstance(a, types.Float)
    return _fused if real or lanes_of((a, b, c)) else None


@intrinsic
def select(condition, a, b):
    lanes = common(a, b)
    lanes = lanes if isinstance(lanes, Lanes) else Lanes(a, condition.width)
    return lanes(condition, lanes, lanes), lambda builder, *values: builder.select(*values)


@shared
def where(condition: bool, a: float, b: float) -> float:
    """Return `a` if `condition` is true, else `b`; both are evaluated."""
    return a if condition else b


@implements(where, Lanes)
def _where(condition, a, b):
    if not isinstance(a, tuple):
        return select(condition, a, b)
    return rebuilt(a, [where(condition, x, y) for x, y in zip(a, b, strict=True)])


OF_REALS |= {fma, where}


def _all_bits(builder: ir.IRBuilder, mask: Any, sign: str, wanted: int) -> ir.Value:
    bits = builder.bitcast(mask, ir.IntType(mask.type.count))
    return builder.icmp_signed(sign, bits, ir.Constant(bits.type, wanted))


def in_lanes(result: Callable, code: Callable) -> Callable[[Callable], Callable]:
    """Decorate a helper of numbers with its code for lanes, the type of its first argument.

    The helper returns ``result(lanes)``, written by ``code(builder, lanes, *values)``.
    """

    def declare(function: Callable) -> Callable:
        @implements(function, Lanes)
        @intrinsic
        def of_lanes(*kinds):
            lanes = next(kind for kind in kinds if isinstance(kind, Lanes))
            return result(lanes)(*kinds), lambda builder, *values: code(builder, lanes, *values)

        return shared(function)

    return declare


def _truth(lanes: Lanes) -> types.Type:
    return types.boolean


@in_lanes(_truth, lambda builder, lanes, mask: _all_bits(builder, mask, "==", -1))
def all_lanes(condition: bool) -> bool:
    return condition


@in_lanes(_truth, lambda builder, lanes, mask: _all_bits(builder, mask, "!=", 0))
def any_lane(condition: bool) -> bool:
    return condition


def all_same(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
    first = llvm.shuffle(builder, value, value, [0] * value.type.count)
    return _all_bits(builder, builder.icmp_signed("==", value, first), "==", -1)


@implements(bool, Lanes)
@intrinsic
def _branch(value):
    raise Untraceable(
        "several points are computed at once, and a branch cannot separate them: use where, "
        "all_lanes or any_lane, or name the point function in scalarised"
    )


def _lanes_changed(thing: Any, change: Callable) -> Any:

    def changed(item: Any) -> Any:
        return change(item) if isinstance(item, Value) and isinstance(item._kind, Lanes) else item

    return mapped(changed, thing)


def _room(builder: ir.IRBuilder, lanes: Lanes) -> ir.Value:
    kind = ir.VectorType(llvm.memory_type(lanes.scalar), lanes.width)
    return llvm.room(builder, kind)


def _in_memory(builder: ir.IRBuilder, value: Value) -> Value:
    room, bits = _room(builder, value._kind), value._value
    wanted = room.type.pointee
    builder.store(bits if bits.type == wanted else builder.zext(bits, wanted), room)
    return Value(value._kind, room)


def _from_memory(builder: ir.IRBuilder, stored: Value) -> Value:
    bits, wanted = builder.load(stored._value), llvm.register_type(stored._kind)
    return Value(stored._kind, bits if bits.type == wanted else builder.trunc(bits, wanted))


def _lane_address(builder: ir.IRBuilder, stored: Value, k: ir.Value) -> ir.Value:
    scalar = llvm.memory_type(stored._kind.scalar)
    return builder.gep(builder.bitcast(stored._value, scalar.as_pointer()), [k])


@in_kernels
def lane_by_lane(lowering: Any, function: Callable, unrolled: bool, arguments: tuple) -> Any:
    builder = lowering.builder
    width = lanes_of(tuple(map(lowering.kind_of, arguments)))
    kinds: set[types.Type] = set()

    def kept(value: Value) -> Value:
        kinds.add(value._kind.scalar)
        return _in_memory(builder, value)

    stored = _lanes_changed(arguments, kept)
    single = types.float32 in kinds and types.float64 not in kinds

    def run(k: Any) -> Any:
        def of_lane(value: Value) -> Value:
            scalar = value._kind.scalar
            return Value(scalar, llvm.get(builder, scalar, _lane_address(builder, value, k)))

        def to_lane(thing: Any) -> Value:
            scalar = types.unliteral(lowering.kind_of(thing))
            if single and scalar == types.float64:  # a function of literals
                scalar = types.float32
            lanes = Lanes(scalar, width)
            made = Value(lanes, _room(builder, lanes))
            number = lowering.lowered(thing, scalar)
            llvm.put(builder, scalar, number, _lane_address(builder, made, k))
            return made

        read, lowering.read = lowering.read, dict(lowering.read)
        result = mapped(to_lane, function(*_lanes_changed(stored, of_lane)))
        lowering.read = read
        return result

    count = I64(width)
    if not unrolled:
        # LLVM must not know the count, so that the loop remains, with one copy of the function.
        count = builder.asm(ir.FunctionType(I64, [I64]), "", "=r,0", [count], False)
    with llvm.counted(builder, count) as k:
        result = run(k)
    return _lanes_changed(result, lambda value: _from_memory(builder, value))


for _function in (
    math.log, math.log1p, math.exp, math.expm1, math.pow, math.sin, math.cos, math.tan, math.atan2,
    operator.pow, operator.floordiv, operator.mod,
):  # fmt: skip
    implements(_function, Lanes)(lambda *values, do=_function: lane_by_lane(do, True, values))
