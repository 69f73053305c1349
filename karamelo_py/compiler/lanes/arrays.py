"""Arrays of points and records of nodes, read and written in lanes."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from karamelo_py.compiler.compile import accumulate, by_type, is_one, lanes_of, of_present, real
from karamelo_py.compiler.lanes.numbers import (
    I32,
    Lanes,
    constant,
    element,
    known,
    lane,
    pack,
    select,
    shape,
    shuffle,
    splat,
    vector_of,
)
from karamelo_py.compiler.tuples import row


class Group(types.Type):
    """The numbers of up to `width` points that lie one after another."""

    def __init__(self, width: int):
        self.width = width
        super().__init__(name=f"Group({width})")


@register_model(Group)
class _GroupModel(models.StructModel):
    def __init__(self, manager: Any, group: Group):
        super().__init__(manager, group, [("first", types.int64), ("count", types.int64)])


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
        return splat(builder, arguments[1], lanes)

    return lanes(tag, value), codegen


def _masked(builder: Any, p: Any, width: int) -> Any:
    """Which lanes of a group have a point."""
    count = splat(builder, builder.extract_value(p, 1), Lanes(types.int64, width))
    numbers = constant(list(range(width)), ir.IntType(64))
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
        return lambda p, value: select(_present(p), value, real(0, value))
    return None


def _pointer(context, builder, kind, array, indices):
    made = context.make_array(kind)(context, builder, array)
    return cgutils.get_item_pointer2(
        context, builder, made.data, cgutils.unpack_tuple(builder, made.shape),
        cgutils.unpack_tuple(builder, made.strides), kind.layout, indices,
        wraparound=False, boundscheck=False,
    )  # fmt: skip


def _load(context, builder, array, pointer, p, lanes):
    """What lies from `pointer` on, for the points there are; the first's for the other lanes."""
    vector = vector_of(lanes)
    size = lanes.scalar.bitwidth // 8
    at = builder.bitcast(pointer, vector.as_pointer())
    mask = _masked(builder, p, lanes.width)
    function = cgutils.get_or_insert_function(
        builder.module,
        ir.FunctionType(vector, [vector.as_pointer(), I32, mask.type, vector]),
        f"llvm.masked.load.{shape(lanes)}.p0",
    )
    zero = ir.Constant(vector, None)
    loaded = builder.call(function, [at, ir.Constant(I32, size), mask, zero])
    first = builder.shuffle_vector(
        loaded, ir.Constant(vector, ir.Undefined), constant([0] * lanes.width)
    )
    return builder.select(mask, loaded, first)


def _store(context, builder, pointer, p, lanes, value):
    vector = vector_of(lanes)
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
                ir.FunctionType(ir.VoidType(), [vector, vector.as_pointer(), I32, mask.type]),
                f"llvm.masked.store.{shape(lanes)}.p0",
            )
            builder.call(function, [value, at, ir.Constant(I32, size), mask])


def _indices(at: Any, builder: Any, value: Any) -> tuple[list, list]:
    """Types and values of the indices of an item, one or a tuple of them."""
    if isinstance(at, types.BaseTuple):
        return list(at), cgutils.unpack_tuple(builder, value)
    return [at], [value]


def _points_at(context, builder, array, at, arguments):
    """Address of an item whose last index is a group: that of its first point; and the group."""
    kinds, values = _indices(at, builder, arguments[1])
    first = builder.extract_value(values[-1], 0)
    rest = [
        context.cast(builder, value, kind, types.intp)
        for kind, value in zip(kinds[:-1], values[:-1], strict=True)
    ]
    return _pointer(context, builder, array, arguments[0], [*rest, first]), values[-1]


@intrinsic
def _load_points(typing_context, array, at):
    lanes = Lanes(array.dtype, lanes_of(at))

    def codegen(context, builder, sig, arguments):
        pointer, p = _points_at(context, builder, array, at, arguments)
        return _load(context, builder, array, pointer, p, lanes)

    return lanes(array, at), codegen


@intrinsic
def _store_points(typing_context, array, at, value):
    lanes = Lanes(array.dtype, lanes_of(at))
    typed = value if isinstance(value, Lanes) else array.dtype

    def codegen(context, builder, sig, arguments):
        pointer, p = _points_at(context, builder, array, at, arguments)
        number = arguments[2]
        if not isinstance(value, Lanes):
            number = splat(builder, number, lanes)
        _store(context, builder, pointer, p, lanes, number)
        return context.get_dummy_value()

    return types.void(array, at, typed), codegen


@intrinsic
def _gather(typing_context, array, at):
    """Items of an array at numbers in lanes, the first index."""
    lanes = Lanes(array.dtype, lanes_of(at))

    def codegen(context, builder, sig, arguments):
        kinds, values = _indices(at, builder, arguments[1])
        rest = [
            context.cast(builder, value, kind, types.intp)
            for kind, value in zip(kinds[1:], values[1:], strict=True)
        ]
        found = []
        for k in range(lanes.width):
            first = context.cast(builder, lane(builder, values[0], k), kinds[0].scalar, types.intp)
            found.append(
                builder.load(_pointer(context, builder, array, arguments[0], [first, *rest]))
            )
        return pack(builder, found, lanes)

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


def _transposed(builder: Any, rows: list) -> list:
    """Four vectors of four numbers, or of two, transposed: lanes from records."""
    if rows[0].type.count == 2:
        ab = shuffle(builder, rows[0], rows[1], [0, 2, 1, 3])
        cd = shuffle(builder, rows[2], rows[3], [0, 2, 1, 3])
        return [shuffle(builder, ab, cd, order) for order in ([0, 1, 4, 5], [2, 3, 6, 7])]
    low = [shuffle(builder, rows[k], rows[k + 1], [0, 4, 2, 6]) for k in (0, 2)]
    high = [shuffle(builder, rows[k], rows[k + 1], [1, 5, 3, 7]) for k in (0, 2)]
    return [
        shuffle(builder, *pair, order)
        for order in ([0, 1, 4, 5], [2, 3, 6, 7])
        for pair in (low, high)
    ]


def _record(context: Any, builder: Any, kind: Any, array: Any, node: Any, column: Any) -> Callable:
    """A function from a number of components to the address of a record's part."""
    pointer = _pointer(context, builder, kind, array, [node, column])

    def of(components: int) -> Any:
        vector = ir.VectorType(element(kind.dtype), components)
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
        return [pack(builder, [lane(builder, row, 0) for row in rows], lanes)]
    parts = [_transposed(builder, rows[k : k + 4]) for k in range(0, nodes.width, 4)]
    if len(parts) == 1:
        return parts[0]
    return [shuffle(builder, *pair, list(range(8))) for pair in zip(*parts, strict=True)]


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
                node = lane(builder, arguments[1], k)
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
            part if isinstance(kind, Lanes) else splat(builder, part, lanes)
            for kind, part in zip(values, parts, strict=True)
        ]
        zero = ir.Constant(vector_of(lanes), None)
        for begin, count in _chunks(len(parts)):
            column = builder.add(arguments[2], ir.Constant(arguments[2].type, begin))
            chosen = [*parts[begin : begin + count], *[zero] * 4][:count]
            rows = []
            for k in range(0, width, 4):
                four = chosen
                if width == 8:
                    four = [shuffle(builder, v, v, list(range(k, k + 4))) for v in chosen]
                rows += _records(builder, four)
            if not isinstance(nodes, Lanes):
                while len(rows) > 1:
                    rows = [builder.fadd(*pair) for pair in zip(rows[::2], rows[1::2], strict=True)]
            for k, number in enumerate(rows):
                node = arguments[1]
                if isinstance(nodes, Lanes):
                    node = lane(builder, node, k)
                at = _record(context, builder, array, arguments[0], node, column)(count)
                total = builder.fadd(builder.load(at, align=size), number)
                builder.store(total, at, align=size)
        return context.get_dummy_value()

    at = nodes if isinstance(nodes, Lanes) else types.int64
    return types.void(array, at, types.int64, values), codegen


def move_record(array, i, other, j, first, like, keep):
    """Add components of the record of a node of another array, as many as `like` has.

    They are zero there then. If not `keep`, they take the place of what was here.
    """
    for k in range(first, first + len(like)):
        array[i, k] = (array[i, k] if keep else 0) + other[j, k]
        other[j, k] = 0


@intrinsic
def _move_record(typing_context, array, i, other, j, first, like, keep):
    def codegen(context, builder, sig, arguments):
        size = array.dtype.bitwidth // 8
        to, of = (
            _record(context, builder, kind, arguments[k], arguments[k + 1], arguments[4])(len(like))
            for k, kind in ((0, array), (2, other))
        )
        there = builder.load(to, align=size)
        zero = ir.Constant(there.type, None)
        kept = builder.select(arguments[6], there, zero)
        builder.store(builder.fadd(kept, builder.load(of, align=size)), to, align=size)
        builder.store(zero, of, align=size)
        return context.get_dummy_value()

    signature = types.void(array, types.int64, other, types.int64, types.int64, like, types.boolean)
    return signature, codegen


by_type(move_record)(
    lambda *arguments: (
        lambda array, i, other, j, first, like, keep: _move_record(
            array, i, other, j, first, like, keep
        )
    )
)


def _records(builder: Any, parts: list) -> list:
    """Four records from the lanes of their components: four, two, or one."""
    if len(parts) == 4:
        return _transposed(builder, parts)
    if len(parts) == 2:
        return [shuffle(builder, *parts, [k, 4 + k]) for k in range(4)]
    return [shuffle(builder, parts[0], parts[0], [k]) for k in range(4)]


@by_type(accumulate)
def _accumulate(array, i, first, values):
    if isinstance(array, types.Array) and (isinstance(i, Lanes) or lanes_of(values)):
        return lambda array, i, first, values: _scatter(array, i, first, values)
    return None


@intrinsic
def _is_one(typing_context, nodes):
    def codegen(context, builder, sig, arguments):
        first = shuffle(builder, arguments[0], arguments[0], [0] * nodes.width)
        same = builder.icmp_signed("==", arguments[0], first)
        bits = builder.bitcast(same, ir.IntType(nodes.width))
        return builder.icmp_signed("==", bits, ir.Constant(bits.type, -1))

    return types.boolean(nodes), codegen


known(is_one, _is_one)
