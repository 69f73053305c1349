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
from collections.abc import Callable, Iterator
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
    in_any,
    in_each_lane,
    index,
    is_one,
    lanes_of,
    largest,
    of_present,
    real,
    round_off,
)
from karamelo_py.compiler.tuples import row

_I32, _I64 = ir.IntType(32), ir.IntType(64)


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


def _unary(operation: Any, code: Callable) -> None:
    @infer_global(operation)
    class Template(AbstractTemplate):
        def generic(self, arguments, keywords):
            lanes = arguments[0]
            return signature(lanes, lanes) if isinstance(lanes, Lanes) else None

    @lower_builtin(operation, Lanes)
    def lower(context, builder, sig, arguments):
        return code(builder, sig.args[0].scalar, arguments[0])


def _negated(builder: Any, scalar: types.Type, value: Any) -> Any:
    return builder.fneg(value) if isinstance(scalar, types.Float) else builder.neg(value)


_unary(operator.neg, _negated)
_unary(operator.not_, lambda builder, scalar, value: builder.not_(value))


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
    if not isinstance(condition, Lanes):
        return None
    if not isinstance(a, types.BaseTuple):
        return lambda condition, a, b: _select(condition, a, b)
    items = "".join(f"choose(condition, a[{k}], b[{k}]), " for k in range(len(a)))
    return _spelled("condition, a, b", items, a, choose=choose)


def _spelled(parameters: str, items: str, like: Any, **names: Any) -> Callable:
    """A function that returns a tuple of these items, a NamedTuple where `like` is one."""
    if isinstance(like, types.BaseNamedTuple):
        return define(parameters, f"return make({items})", make=like.instance_class, **names)
    return define(parameters, f"return ({items})", **names)


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


def _truth(function: Callable, sign: str, bits_of: int) -> None:
    """Let a question about all lanes be one about the bits of a mask."""

    @intrinsic
    def asked(typing_context, mask):
        def codegen(context, builder, sig, arguments):
            bits = builder.bitcast(arguments[0], ir.IntType(mask.width))
            return builder.icmp_signed(sign, bits, ir.Constant(bits.type, bits_of))

        return types.boolean(mask), codegen

    @by_type(function)
    def chosen(condition):
        return (lambda condition: asked(condition)) if isinstance(condition, Lanes) else None


_truth(in_all, "==", -1)
_truth(in_any, "!=", 0)


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
    width = max(lanes_of(value) for value in values)
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
    if isinstance(array, types.Array) and (isinstance(i, Lanes) or lanes_of(values)):
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


@intrinsic
def _extract(typing_context, value, k):
    def codegen(context, builder, sig, arguments):
        return builder.extract_element(arguments[0], builder.trunc(arguments[1], _I32))

    return value.scalar(value, types.int64), codegen


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
    bits = ir.IntType(8) if isinstance(lanes.scalar, types.Boolean) else _element(lanes.scalar)
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
        count = ir.Constant(_I64, width)
        if not unrolled.literal_value:
            # The loop is to stay one, with one copy of the function: LLVM must not know its count.
            count = builder.asm(ir.FunctionType(_I64, [_I64]), "", "=r,0", [count], False)
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
            builder.trunc(builder.load(room), _vector(kind))
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
        if not lanes_of(arguments):
            return None
        names = ", ".join(f"a{k}" for k in range(len(arguments)))
        call = f"return call(function, True, ({names},))"
        return define(names, call, function=function, call=_lane_by_lane)


for _function in (math.log, math.exp, math.pow, operator.pow):
    _each_lane(_function)
