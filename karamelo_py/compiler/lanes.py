"""Several points at once: the lanes of a vector register as a number type of point functions.

A kernel that indexes arrays of points, (components, points), with a `Group` instead of a number
gets `Lanes`: one number for each of 4 or 8 points that lie one after another. Lanes add, multiply
and compare like numbers, node numbers made of them gather from arrays of nodes, (nodes,
components), and `accumulate` scatters to them, lane after lane in the order of the points. Point
functions need not know; powers and logarithms are taken one lane after another (`one_by_one`).
Results of a lane are those of the same operations on numbers, to the last bit.

The last group of a tile may have fewer points than lanes: what is loaded for the others is that of
the first point, and nothing is stored or given to nodes for them.

Only compiled kernels know lanes; interpreted ones take the points one by one.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any, NamedTuple

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, models, register_model

from karamelo_py.compiler.compile import (
    accumulate,
    by_type,
    choose,
    define,
    first_failing,
    first_lane,
    fma,
    in_all,
    index,
    is_one,
    largest,
    of_present,
    real,
    round_off,
)
from karamelo_py.compiler.tuples import row

_I32 = ir.IntType(32)


class Lanes(types.Type):
    """`width` numbers of a scalar type in a register."""

    def __init__(self, scalar: types.Type, width: int):
        self.scalar, self.width = scalar, width
        super().__init__(name=f"Lanes({scalar}, {width})")


class Group(types.Type):
    """The numbers of up to `width` points that lie one after another."""

    def __init__(self, width: int):
        self.width = width
        super().__init__(name=f"Group({width})")


def _element(scalar: types.Type) -> ir.Type:
    """How a number lies in a register."""
    if isinstance(scalar, types.Boolean):
        return ir.IntType(1)
    if isinstance(scalar, types.Integer):
        return ir.IntType(scalar.bitwidth)
    return {64: ir.DoubleType(), 32: ir.FloatType()}[scalar.bitwidth]


def _vector(lanes: Lanes) -> ir.VectorType:
    return ir.VectorType(_element(lanes.scalar), lanes.width)


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, lanes: Lanes):
        super().__init__(manager, lanes, _vector(lanes))


@register_model(Group)
class _GroupModel(models.StructModel):
    def __init__(self, manager: Any, group: Group):
        super().__init__(manager, group, [("first", types.int64), ("count", types.int64)])


def _constant(values: list[int], bits: ir.Type = _I32) -> ir.Constant:
    return ir.Constant(ir.VectorType(bits, len(values)), values)


def _splat(builder: Any, value: Any, lanes: Lanes) -> Any:
    """The same number in all lanes."""
    vector = _vector(lanes)
    if isinstance(lanes.scalar, types.Boolean) and value.type != ir.IntType(1):
        value = builder.trunc(value, ir.IntType(1))
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(_I32, 0))
    return builder.shuffle_vector(
        one, ir.Constant(vector, ir.Undefined), _constant([0] * lanes.width)
    )


def _lane(builder: Any, value: Any, k: int) -> Any:
    return builder.extract_element(value, ir.Constant(_I32, k))


def _pack(builder: Any, values: list, lanes: Lanes) -> Any:
    out = ir.Constant(_vector(lanes), ir.Undefined)
    for k, value in enumerate(values):
        out = builder.insert_element(out, value, ir.Constant(_I32, k))
    return out


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


def _both(builder: Any, sig: Any, arguments: Any, lanes: Lanes) -> list:
    out = []
    for kind, value in zip(sig.args, arguments, strict=True):
        if not isinstance(kind, Lanes):
            value = _splat(builder, value, lanes)
        elif kind != lanes:
            value = builder.sext(value, _vector(lanes))
        out.append(value)
    return out


def _binary(operation: Any, of_floats: str | None, of_ints: str | None) -> None:
    @infer_global(operation)
    class Template(AbstractTemplate):
        def generic(self, arguments, keywords):
            if len(arguments) != 2:
                return None
            lanes = _wider(*arguments)
            if lanes is None:
                return None
            if not (of_floats if isinstance(lanes.scalar, types.Float) else of_ints):
                return None
            return signature(
                lanes, *(a if isinstance(a, Lanes) else lanes.scalar for a in arguments)
            )

    def lower(context, builder, sig, arguments):
        lanes = sig.return_type
        of = of_floats if isinstance(lanes.scalar, types.Float) else of_ints
        return getattr(builder, of)(*_both(builder, sig, arguments, lanes))

    for a, b in ((Lanes, Lanes), (Lanes, types.Any), (types.Any, Lanes)):
        lower_builtin(operation, a, b)(lower)


for _operations, _floats, _ints in (
    ((operator.add, operator.iadd), "fadd", "add"),
    ((operator.sub, operator.isub), "fsub", "sub"),
    ((operator.mul, operator.imul), "fmul", "mul"),
    ((operator.truediv, operator.itruediv), "fdiv", None),
    ((operator.and_,), None, "and_"),
    ((operator.or_,), None, "or_"),
):
    for _operation in _operations:
        _binary(_operation, _floats, _ints)


def _comparison(operation: Any, sign: str) -> None:
    @infer_global(operation)
    class Template(AbstractTemplate):
        def generic(self, arguments, keywords):
            lanes = _wider(*arguments)
            if lanes is None:
                return None
            mask = Lanes(types.boolean, lanes.width)
            return signature(
                mask, *(a if isinstance(a, Lanes) else lanes.scalar for a in arguments)
            )

    def lower(context, builder, sig, arguments):
        lanes = _wider(*sig.args)
        a, b = _both(builder, sig, arguments, lanes)
        if isinstance(lanes.scalar, types.Float):
            compare = builder.fcmp_unordered if sign == "!=" else builder.fcmp_ordered
            return compare(sign, a, b)
        return builder.icmp_signed(sign, a, b)

    for a, b in ((Lanes, Lanes), (Lanes, types.Any), (types.Any, Lanes)):
        lower_builtin(operation, a, b)(lower)


for _operation, _sign in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="),
    (operator.eq, "=="), (operator.ne, "!="),
):  # fmt: skip
    _comparison(_operation, _sign)


@infer_global(operator.neg)
class _Negative(AbstractTemplate):
    def generic(self, arguments, keywords):
        if isinstance(arguments[0], Lanes):
            return signature(arguments[0], arguments[0])
        return None


@lower_builtin(operator.neg, Lanes)
def _negative(context, builder, sig, arguments):
    if isinstance(sig.args[0].scalar, types.Float):
        return builder.fneg(arguments[0])
    return builder.neg(arguments[0])


def _call_vector(name: str, lanes: Lanes) -> Callable:
    """Code that calls an LLVM intrinsic of vectors, such as sqrt."""

    def codegen(context, builder, sig, arguments):
        vector = _vector(lanes)
        values = [
            value if isinstance(kind, Lanes) else _splat(builder, value, lanes)
            for kind, value in zip(sig.args, arguments, strict=True)
        ]
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(vector, [vector] * len(values)),
            f"llvm.{name}.{_shape(lanes)}",
        )
        return builder.call(function, values)

    return codegen


def _operands(*arguments: Any) -> tuple[Lanes, list]:
    """The lanes among the arguments, and what the others are cast to."""
    lanes = next(a for a in arguments if isinstance(a, Lanes))
    return lanes, [a if isinstance(a, Lanes) else lanes.scalar for a in arguments]


@intrinsic
def _fma_lanes(typing_context, a, b, c):
    lanes, typed = _operands(a, b, c)
    return lanes(*typed), _call_vector("fma", lanes)


@intrinsic
def _sqrt_lanes(typing_context, a):
    return a(a), _call_vector("sqrt", a)


@intrinsic
def _abs_lanes(typing_context, a):
    return a(a), _call_vector("fabs", a)


@by_type(fma)
def _fma(a, b, c):
    if any(isinstance(x, Lanes) for x in (a, b, c)):
        return lambda a, b, c: _fma_lanes(a, b, c)
    return None


@by_type(math.sqrt)
def _sqrt(a):
    return (lambda a: _sqrt_lanes(a)) if isinstance(a, Lanes) else None


@by_type(abs)
def _abs(a):
    return (lambda a: _abs_lanes(a)) if isinstance(a, Lanes) else None


@intrinsic
def _select(typing_context, condition, a, b):
    lanes, typed = _operands(a, b) if isinstance(a, Lanes) or isinstance(b, Lanes) else (None, None)
    if lanes is None:
        lanes, typed = Lanes(a, condition.width), [a, a]

    def codegen(context, builder, sig, arguments):
        values = [
            value if isinstance(kind, Lanes) else _splat(builder, value, lanes)
            for kind, value in zip(sig.args[1:], arguments[1:], strict=True)
        ]
        return builder.select(arguments[0], *values)

    return lanes(condition, *typed), codegen


@by_type(choose)
def _choose(condition, a, b):
    if isinstance(condition, Lanes):
        return lambda condition, a, b: _select(condition, a, b)
    return None


def _extreme(function: Callable, sign: str) -> None:
    """Let min or max of two or more numbers know lanes."""

    @by_type(function)
    def chosen(*arguments):
        if not any(isinstance(a, Lanes) for a in arguments):
            return None
        names = [f"a{k}" for k in range(len(arguments))]
        lines = ["best = a0"]
        lines += [f"best = select({name} {sign} best, {name}, best)" for name in names[1:]]
        return define(", ".join(names), *lines, "return best", select=_select)


_extreme(max, ">")
_extreme(min, "<")


@intrinsic
def _all_of(typing_context, mask):
    def codegen(context, builder, sig, arguments):
        bits = builder.bitcast(arguments[0], ir.IntType(mask.width))
        return builder.icmp_signed("==", bits, ir.Constant(bits.type, -1))

    return types.boolean(mask), codegen


@by_type(in_all)
def _in_all(condition):
    return (lambda condition: _all_of(condition)) if isinstance(condition, Lanes) else None


# --- conversions ------------------------------------------------------------------------------


@intrinsic
def _truncated(typing_context, a):
    whole = Lanes(types.int64, a.width)

    def codegen(context, builder, sig, arguments):
        # By way of 32 bits: every processor has that, and cells are no more.
        narrow = ir.VectorType(_I32, a.width)
        return builder.sext(builder.fptosi(arguments[0], narrow), _vector(whole))

    return whole(a), codegen


@by_type(int)
def _int(a):
    if isinstance(a, Lanes) and isinstance(a.scalar, types.Float):
        return lambda a: _truncated(a)
    return None


@intrinsic
def _converted(typing_context, value, like):
    scalar = like.scalar if isinstance(like, Lanes) else like
    lanes = Lanes(scalar, value.width)

    def codegen(context, builder, sig, arguments):
        if isinstance(value.scalar, types.Integer):
            narrow = arguments[0]
            if value.scalar.bitwidth > 32:
                narrow = builder.trunc(narrow, ir.VectorType(_I32, value.width))
            return builder.sitofp(narrow, _vector(lanes))
        if value.scalar.bitwidth == scalar.bitwidth:
            return arguments[0]
        convert = builder.fpext if scalar.bitwidth == 64 else builder.fptrunc
        return convert(arguments[0], _vector(lanes))

    return lanes(value, like), codegen


@intrinsic
def _spread(typing_context, value, like):
    def codegen(context, builder, sig, arguments):
        number = context.cast(builder, arguments[0], value, like.scalar)
        return _splat(builder, number, like)

    return like(value, like), codegen


@by_type(real)
def _real(value, like):
    if isinstance(value, Lanes):
        return lambda value, like: _converted(value, like)
    if isinstance(like, Lanes):
        return lambda value, like: _spread(value, like)
    return None


@by_type(index)
def _index(i):
    return (lambda i: i) if isinstance(i, Lanes | Group) else None


@by_type(round_off)
def _round_off(like):
    if isinstance(like, Lanes):
        error = 2.0**-23 if like.scalar == types.float32 else 2.0**-52
        return lambda like: real(error, like)
    return None


# --- arrays of points -------------------------------------------------------------------------


class Fours(NamedTuple):
    """Four points at once."""

    width = 4


class Eights(NamedTuple):
    """Eight points at once."""

    width = 8


def lanes_for(bits: int) -> type:
    """How many points are visited at once, of numbers with so many bits; kept sorted for that."""
    return {64: Fours, 32: Eights}[bits]


@intrinsic
def group(typing_context, tag, first, count):
    """The `count` points from `first` on, as many as the tag says at most."""
    made = Group(tag.instance_class.width)

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
        return _splat(builder, arguments[1], lanes)

    return lanes(tag, value), codegen


def _masked(builder: Any, p: Any, width: int) -> Any:
    """Which lanes of a group have a point."""
    count = _splat(builder, builder.extract_value(p, 1), Lanes(types.int64, width))
    numbers = _constant(list(range(width)), ir.IntType(64))
    return builder.icmp_signed("<", numbers, count)


@intrinsic
def _present(typing_context, p):
    """Which lanes have a point."""
    mask = Lanes(types.boolean, p.width)

    def codegen(context, builder, sig, arguments):
        return _masked(builder, arguments[0], p.width)

    return mask(p), codegen


@by_type(of_present)
def _of_present(p, value):
    if isinstance(p, Group):
        return lambda p, value: _select(_present(p), value, real(0, value))
    return None


def _pointer(context, builder, kind, array, indices):
    made = context.make_array(kind)(context, builder, array)
    return cgutils.get_item_pointer2(
        context, builder, made.data, cgutils.unpack_tuple(builder, made.shape),
        cgutils.unpack_tuple(builder, made.strides), kind.layout, indices,
        wraparound=False, boundscheck=False,
    )  # fmt: skip


def _shape(lanes: Lanes) -> str:
    """What LLVM's intrinsics call a vector: v4f64."""
    kind = "f" if isinstance(lanes.scalar, types.Float) else "i"
    return f"v{lanes.width}{kind}{lanes.scalar.bitwidth}"


def _load(context, builder, array, pointer, p, lanes):
    """What lies from `pointer` on, for the points there are; the first's for the other lanes."""
    vector = _vector(lanes)
    size = lanes.scalar.bitwidth // 8
    at = builder.bitcast(pointer, vector.as_pointer())
    mask = _masked(builder, p, lanes.width)
    function = cgutils.get_or_insert_function(
        builder.module,
        ir.FunctionType(vector, [vector.as_pointer(), _I32, mask.type, vector]),
        f"llvm.masked.load.{_shape(lanes)}.p0",
    )
    zero = ir.Constant(vector, None)
    loaded = builder.call(function, [at, ir.Constant(_I32, size), mask, zero])
    first = builder.shuffle_vector(
        loaded, ir.Constant(vector, ir.Undefined), _constant([0] * lanes.width)
    )
    return builder.select(mask, loaded, first)


def _store(context, builder, pointer, p, lanes, value):
    vector = _vector(lanes)
    size = lanes.scalar.bitwidth // 8
    at = builder.bitcast(pointer, vector.as_pointer())
    full = builder.icmp_signed(
        "==", builder.extract_value(p, 1), ir.Constant(ir.IntType(64), lanes.width)
    )
    with builder.if_else(full) as (then, otherwise):
        with then:
            builder.store(value, at, align=size)
        with otherwise:
            mask = _masked(builder, p, lanes.width)
            function = cgutils.get_or_insert_function(
                builder.module,
                ir.FunctionType(ir.VoidType(), [vector, vector.as_pointer(), _I32, mask.type]),
                f"llvm.masked.store.{_shape(lanes)}.p0",
            )
            builder.call(function, [value, at, ir.Constant(_I32, size), mask])


def _indices(context, builder, kinds, values):
    """LLVM indices of an item whose last index is a group: that of its first point."""
    out = []
    for kind, value in zip(kinds, values, strict=True):
        if isinstance(kind, Group):
            out.append(builder.extract_value(value, 0))
        else:
            out.append(context.cast(builder, value, kind, types.intp))
    return out


@intrinsic
def _load_points(typing_context, array, at):
    kinds = list(at) if isinstance(at, types.BaseTuple) else [at]
    lanes = Lanes(array.dtype, kinds[-1].width)

    def codegen(context, builder, sig, arguments):
        values = [arguments[1]]
        if isinstance(at, types.BaseTuple):
            values = cgutils.unpack_tuple(builder, arguments[1])
        indices = _indices(context, builder, kinds, values)
        pointer = _pointer(context, builder, array, arguments[0], indices)
        return _load(context, builder, array, pointer, values[-1], lanes)

    return lanes(array, at), codegen


@intrinsic
def _store_points(typing_context, array, at, value):
    kinds = list(at) if isinstance(at, types.BaseTuple) else [at]
    lanes = Lanes(array.dtype, kinds[-1].width)
    typed = value if isinstance(value, Lanes) else array.dtype

    def codegen(context, builder, sig, arguments):
        values = [arguments[1]]
        if isinstance(at, types.BaseTuple):
            values = cgutils.unpack_tuple(builder, arguments[1])
        indices = _indices(context, builder, kinds, values)
        pointer = _pointer(context, builder, array, arguments[0], indices)
        number = arguments[2]
        if not isinstance(value, Lanes):
            number = _splat(builder, number, lanes)
        _store(context, builder, pointer, values[-1], lanes, number)
        return context.get_dummy_value()

    return types.void(array, at, typed), codegen


@intrinsic
def _gather(typing_context, array, at):
    """Items of an array at numbers in lanes, the first index."""
    kinds = list(at) if isinstance(at, types.BaseTuple) else [at]
    lanes = Lanes(array.dtype, kinds[0].width)

    def codegen(context, builder, sig, arguments):
        values = [arguments[1]]
        if isinstance(at, types.BaseTuple):
            values = cgutils.unpack_tuple(builder, arguments[1])
        rest = [
            context.cast(builder, v, k, types.intp)
            for k, v in zip(kinds[1:], values[1:], strict=True)
        ]
        found = []
        for k in range(lanes.width):
            first = (
                builder.sext(_lane(builder, values[0], k), ir.IntType(64))
                if kinds[0].scalar.bitwidth < 64
                else _lane(builder, values[0], k)
            )
            pointer = _pointer(context, builder, array, arguments[0], [first, *rest])
            found.append(builder.load(pointer))
        return _pack(builder, found, lanes)

    return lanes(array, at), codegen


def _last(at: Any) -> Any:
    return tuple(at)[-1] if isinstance(at, types.BaseTuple) and len(at) else at


def _head(at: Any) -> Any:
    return next(iter(at)) if isinstance(at, types.BaseTuple) and len(at) else at


@by_type(operator.getitem)
def _get(array, at):
    if isinstance(array, types.Array) and isinstance(_last(at), Group):
        return lambda array, at: _load_points(array, at)
    if isinstance(array, types.Array) and isinstance(_head(at), Lanes):
        return lambda array, at: _gather(array, at)
    return None


@by_type(operator.setitem)
def _set(array, at, value):
    if isinstance(array, types.Array) and isinstance(_last(at), Group):
        return lambda array, at, value: _store_points(array, at, value)
    return None


# --- records of nodes ---------------------------------------------------------------------------


def _shuffle(builder: Any, a: Any, b: Any, order: list[int]) -> Any:
    return builder.shuffle_vector(a, b, _constant(order))


def _transposed(builder: Any, rows: list) -> list:
    """Four vectors of four numbers, or of two, transposed: lanes from records."""
    if rows[0].type.count == 2:
        ab = _shuffle(builder, rows[0], rows[1], [0, 2, 1, 3])
        cd = _shuffle(builder, rows[2], rows[3], [0, 2, 1, 3])
        return [_shuffle(builder, ab, cd, order) for order in ([0, 1, 4, 5], [2, 3, 6, 7])]
    low = [_shuffle(builder, rows[k], rows[k + 1], [0, 4, 2, 6]) for k in (0, 2)]
    high = [_shuffle(builder, rows[k], rows[k + 1], [1, 5, 3, 7]) for k in (0, 2)]
    return [
        _shuffle(builder, *pair, order)
        for order in ([0, 1, 4, 5], [2, 3, 6, 7])
        for pair in (low, high)
    ]


def _record(context: Any, builder: Any, kind: Any, array: Any, node: Any, column: Any) -> Callable:
    """A function from a number of components to the address of a record's part."""
    pointer = _pointer(context, builder, kind, array, [node, column])

    def of(components: int) -> Any:
        vector = ir.VectorType(_element(kind.dtype), components)
        return builder.bitcast(pointer, vector.as_pointer())

    return of


def _chunks(count: int) -> list[tuple[int, int]]:
    """Components in chunks as wide as registers: (first, number), 4, 2 or 1; 3 are 4.

    Records are as wide as that: what lies behind their last component belongs to them.
    """
    out, first = [], 0
    while first < count:
        left = count - first
        out.append((first, 4 if left >= 3 else left))
        first += 4 if left >= 3 else left
    return out


def _gathered(builder: Any, of: Callable, nodes: Lanes, lanes: Lanes, count: int) -> list:
    """Lanes of `count` components from the records of different nodes."""
    size = lanes.scalar.bitwidth // 8
    rows = [builder.load(of(k)(count), align=size) for k in range(nodes.width)]
    if count == 1:
        return [_pack(builder, [_lane(builder, row, 0) for row in rows], lanes)]
    parts = [_transposed(builder, rows[k : k + 4]) for k in range(0, nodes.width, 4)]
    if len(parts) == 1:
        return parts[0]
    return [_shuffle(builder, *pair, list(range(8))) for pair in zip(*parts, strict=True)]


@intrinsic
def _gather_row(typing_context, array, nodes, first, like):
    """Components of the records of nodes, as many as `like` has."""
    lanes = Lanes(array.dtype, nodes.width)
    made = types.UniTuple(lanes, len(like))

    def codegen(context, builder, sig, arguments):
        found = []
        for begin, count in _chunks(len(like)):
            column = builder.add(arguments[2], ir.Constant(arguments[2].type, begin))

            def of(k, column=column):
                node = _lane(builder, arguments[1], k)
                return _record(context, builder, array, arguments[0], node, column)

            found += _gathered(builder, of, nodes, lanes, count)
        return context.make_tuple(builder, made, found[: len(like)])

    return made(array, nodes, types.int64, like), codegen


@by_type(row)
def _row(array, i, first, like):
    if isinstance(i, Lanes):
        return lambda array, i, first, like: _gather_row(array, i, first, like)
    return None


@intrinsic
def _scatter(typing_context, array, nodes, first, values):
    """Add to components of the records of nodes, lane after lane; summed before to one node."""
    width = max(has_lanes(value) for value in values)
    lanes = Lanes(array.dtype, width)

    def codegen(context, builder, sig, arguments):
        size = array.dtype.bitwidth // 8
        parts = cgutils.unpack_tuple(builder, arguments[3])
        parts = [
            part if isinstance(kind, Lanes) else _splat(builder, part, lanes)
            for kind, part in zip(values, parts, strict=True)
        ]
        zero = ir.Constant(_vector(lanes), None)
        for begin, count in _chunks(len(parts)):
            column = builder.add(arguments[2], ir.Constant(arguments[2].type, begin))
            chosen = [*parts[begin : begin + count], *[zero] * 4][:count]
            rows = []
            for k in range(0, width, 4):
                four = chosen
                if width == 8:
                    four = [_shuffle(builder, v, v, list(range(k, k + 4))) for v in chosen]
                rows += _records(builder, four)
            if not isinstance(nodes, Lanes):
                while len(rows) > 1:
                    rows = [builder.fadd(*pair) for pair in zip(rows[::2], rows[1::2], strict=True)]
            for k, number in enumerate(rows):
                node = arguments[1]
                if isinstance(nodes, Lanes):
                    node = _lane(builder, node, k)
                at = _record(context, builder, array, arguments[0], node, column)(count)
                total = builder.fadd(builder.load(at, align=size), number)
                builder.store(total, at, align=size)
        return context.get_dummy_value()

    at = nodes if isinstance(nodes, Lanes) else types.int64
    return types.void(array, at, types.int64, values), codegen


def _records(builder: Any, parts: list) -> list:
    """Four records from the lanes of their components: four, two, or one."""
    if len(parts) == 4:
        return _transposed(builder, parts)
    if len(parts) == 2:
        return [_shuffle(builder, *parts, [k, 4 + k]) for k in range(4)]
    return [_shuffle(builder, parts[0], parts[0], [k]) for k in range(4)]


@by_type(accumulate)
def _accumulate(array, i, first, values):
    if isinstance(array, types.Array) and (isinstance(i, Lanes) or has_lanes(values)):
        return lambda array, i, first, values: _scatter(array, i, first, values)
    return None


@intrinsic
def _is_one(typing_context, nodes):
    def codegen(context, builder, sig, arguments):
        first = _shuffle(builder, arguments[0], arguments[0], [0] * nodes.width)
        same = builder.icmp_signed("==", arguments[0], first)
        bits = builder.bitcast(same, ir.IntType(nodes.width))
        return builder.icmp_signed("==", bits, ir.Constant(bits.type, -1))

    return types.boolean(nodes), codegen


@by_type(is_one)
def _choose_is_one(number):
    return (lambda number: _is_one(number)) if isinstance(number, Lanes) else None


@by_type(first_lane)
def _first_lane(number):
    return (lambda number: _extract(number, 0)) if isinstance(number, Lanes) else None


# --- one lane after another -------------------------------------------------------------------


def has_lanes(numba_type: Any) -> int:
    """How many lanes a number, or the numbers in a tuple, have; 0 for none."""
    if isinstance(numba_type, Lanes):
        return numba_type.width
    if isinstance(numba_type, types.BaseTuple):
        return max((has_lanes(item) for item in numba_type), default=0)
    return 0


@intrinsic
def _extract(typing_context, value, k):
    def codegen(context, builder, sig, arguments):
        return builder.extract_element(arguments[0], builder.trunc(arguments[1], _I32))

    return value.scalar(value, types.int64), codegen


def _part(value, k):
    """The number of the k-th lane; of tuples, of what is in them."""


@by_type(_part)
def _choose_part(value, k):
    if isinstance(value, Lanes):
        return lambda value, k: _extract(value, k)
    if not has_lanes(value):
        return lambda value, k: value
    items = "".join(f"part(value[{i}], k), " for i in range(len(value)))
    if isinstance(value, types.BaseNamedTuple):
        return define("value, k", f"return make({items})", part=_part, make=value.instance_class)
    return define("value, k", f"return ({items})", part=_part)


@intrinsic
def _packed(typing_context, numbers):
    lanes = Lanes(
        types.boolean if isinstance(numbers.dtype, types.Boolean) else numbers.dtype, len(numbers)
    )

    def codegen(context, builder, sig, arguments):
        values = cgutils.unpack_tuple(builder, arguments[0])
        if isinstance(lanes.scalar, types.Boolean):
            values = [
                v if v.type == ir.IntType(1) else builder.trunc(v, ir.IntType(1)) for v in values
            ]
        return _pack(builder, values, lanes)

    return lanes(numbers), codegen


def _joined(results):
    """The results of all lanes as one result with lanes."""


@by_type(_joined)
def _choose_joined(results):
    first = next(iter(results))
    if not isinstance(first, types.BaseTuple):
        return lambda results: _packed(results)
    width = len(results)
    items = "".join(
        f"joined(({''.join(f'results[{k}][{i}], ' for k in range(width))})), "
        for i in range(len(first))
    )
    if isinstance(first, types.BaseNamedTuple):
        return define("results", f"return make({items})", joined=_joined, make=first.instance_class)
    return define("results", f"return ({items})", joined=_joined)


def one_by_one(function: Callable, arguments: tuple) -> Callable | None:
    """A function that does `function` for each lane among its arguments, or None for none."""
    width = max((has_lanes(a) for a in arguments), default=0)
    if not width:
        return None
    names = [f"a{k}" for k in range(len(arguments))]
    calls = "".join(
        f"f({', '.join(f'part({name}, {lane})' for name in names)}), " for lane in range(width)
    )
    return define(
        ", ".join(names), f"return joined(({calls}))", f=function, part=_part, joined=_joined
    )


@intrinsic
def _largest_lane(typing_context, a):
    def codegen(context, builder, sig, arguments):
        largest = _lane(builder, arguments[0], 0)
        for k in range(1, a.width):
            value = _lane(builder, arguments[0], k)
            larger = builder.fcmp_ordered(">", value, largest)
            largest = builder.select(larger, value, largest)
        return largest

    return a.scalar(a), codegen


@by_type(largest)
def _largest(a):
    return (lambda a: _largest_lane(a)) if isinstance(a, Lanes) else None


@intrinsic
def _first_false(typing_context, mask):
    def codegen(context, builder, sig, arguments):
        found = ir.Constant(ir.IntType(64), 0)
        for k in reversed(range(mask.width)):
            holds = _lane(builder, arguments[0], k)
            found = builder.select(holds, found, ir.Constant(ir.IntType(64), k))
        return found

    return types.int64(mask), codegen


@by_type(first_failing)
def _first_failing(condition):
    return (lambda condition: _first_false(condition)) if isinstance(condition, Lanes) else None


def _each_lane(function: Callable) -> None:
    """Let a function of numbers know lanes: it is called for one after another."""

    @by_type(function)
    def chosen(*arguments):
        return one_by_one(function, arguments)


for _function in (math.log, math.exp, math.pow, operator.pow):
    _each_lane(_function)
