"""Node records, rows of node arrays (nodes, components), for numbers and lanes."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types

from karamelo_py.compiler import fma, implements, intrinsic, llvm, shared, tag_class
from karamelo_py.compiler.fields import LINE
from karamelo_py.compiler.lanes import REGISTER_BYTES, Beside, ask, at_lane, lanes_of
from karamelo_py.compiler.llvm import I32, I64, Lanes, lane, pack, shuffle, splat
from karamelo_py.points.basis.weighted import Weighted

AHEAD = 16  # nodes to prefetch ahead


def put_at(array, i, first, values):
    for k, value in enumerate(values):
        array[i, first + k] = value


def clear_first(array, i):
    if array is not None:
        array[i, 0] = 0


@shared
def row(array, i, first, template):
    """Return (array[i, first], ..., array[i, first + len(template) - 1])."""
    if isinstance(i, Weighted):
        total = [a - a for a in template]
        for one, weight in zip(i.rows, i.weights, strict=True):
            record = row(array, one, first, template)
            total = [fma(weight, x, t) for x, t in zip(record, total, strict=True)]
        return tuple(total)
    return tuple([array[i, first + k] for k in range(len(template))])


@shared
def accumulate(array: Any, i: int | Weighted, first: int, values: tuple) -> None:
    """Add values[k] to array[i, first + k], lane after lane."""
    if isinstance(i, Weighted):
        for one, weight in zip(i.rows, i.weights, strict=True):
            accumulate(array, one, first, tuple([weight * value for value in values]))
    else:
        for k, value in enumerate(values):
            array[i, first + k] += value


def accumulate_affine(parts, nodes, weights):
    """Add affine fields times `weights` (() for 1) to the sums of nodes.

    A part is an array, its first component, the value at the first node, and increments
    ``slopes[d]`` from node to node along axis `d`, or () if it is constant. Nodes form a square or
    cube, with the last axis fastest.
    """
    weights = weights if len(weights) else (1,) * len(nodes)
    for array, first, value, slopes in parts:
        width = _width(nodes, slopes)
        for k, (node, weight) in enumerate(zip(nodes, weights, strict=True)):
            for c, number in enumerate(value):
                for d, slope in enumerate(reversed(slopes)):
                    number = number + (k // width**d % width) * slope[c]
                array[node, first + c] += weight * number


def move_record(target, source, first, template, keep):
    """Move components of a record of `source` to `target`, adding if `keep`."""
    array, i = target
    other, j = source
    for k in range(first, first + len(template)):
        array[i, k] = (array[i, k] if keep else 0) + other[j, k]
        other[j, k] = 0


@shared
def prefetch_records(array: Any, i: Any) -> None:
    """Prefetch the records `AHEAD` nodes after the nodes in lanes."""


def _width(nodes: Any, slopes: Any) -> int:
    return round(len(nodes) ** (1 / max(1, len(slopes))))


def _size(array: Any) -> int:
    return array.dtype.bitwidth // 8


_fma = llvm.of_library("llvm.fma")  # a b + c, rounded once


def _transposed(builder: ir.IRBuilder, rows: list) -> list:
    """Transpose four vectors of four or two numbers."""
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


def _record(builder: ir.IRBuilder, kind: Any, pointer: ir.Value, components: int) -> ir.Value:
    vector = ir.VectorType(llvm.register_type(kind.dtype), components)
    return builder.bitcast(pointer, vector.as_pointer())


def _chunks(count: int) -> list[tuple[int, int]]:
    """Split components into (first, length), with lengths of 4 (also for the last 3), 2 or 1."""
    out, first = [], 0
    while first < count:
        left = count - first
        out.append((first, 4 if left >= 3 else left))
        first += 4 if left >= 3 else left
    return out


def _lanes_from(builder: ir.IRBuilder, rows: list, lanes: Lanes, count: int) -> list:
    if count == 1:
        return [pack(builder, [lane(builder, row, 0) for row in rows], lanes)]
    parts = [_transposed(builder, rows[k : k + 4]) for k in range(0, lanes.width, 4)]
    if len(parts) == 1:
        return parts[0]
    return [shuffle(builder, *pair, list(range(8))) for pair in zip(*parts, strict=True)]


def _gathered(
    builder: ir.IRBuilder, lanes: Lanes, first: Any, template: Any, read: Callable
) -> list:
    components: list = []
    for begin, count in _chunks(len(template)):
        column = builder.add(first, I64(begin))
        rows = [read(k, column, count) for k in range(lanes.width)]
        components += _lanes_from(builder, rows, lanes, count)
    return components[: len(template)]


@intrinsic
def _gather_row(array, nodes, first, template):
    lanes = Lanes(array.dtype, nodes.width)
    made = types.UniTuple(lanes, len(template))

    def codegen(builder, table, at, first, _):
        def read(k, column, count):
            pointer = at_lane(builder, array, table, nodes, at, k, column)
            return builder.load(_record(builder, array, pointer, count), align=_size(array))

        return llvm.make_tuple(builder, made, _gathered(builder, lanes, first, template, read))

    return made(array, nodes, types.int64, template), codegen


@intrinsic
def _gather_weighted(array, nodes, first, weights, template):
    """Return weighted sums over records, made before records are transposed to lanes."""
    lanes = weights[0]
    made = types.UniTuple(lanes, len(template))

    def codegen(builder, *values):
        table, places, first, factors, _ = values
        size = _size(array)
        factor_at = _kept_in_memory(builder, llvm.unpack(builder, factors))
        at = llvm.unpack(builder, places)

        def read(j, column, count):
            record = Lanes(array.dtype, count)
            total = ir.Constant(llvm.register_type(record), None)
            for k, node in enumerate(at):
                pointer = at_lane(builder, array, table, nodes[k], node, j, column)
                pointer = _record(builder, array, pointer, count)
                weight = splat(builder, builder.load(factor_at(k, j), align=size), record)
                total = _fma(builder, [weight, builder.load(pointer, align=size), total])
            return total

        return llvm.make_tuple(builder, made, _gathered(builder, lanes, first, template, read))

    return made(array, nodes, types.int64, weights, template), codegen


@implements(prefetch_records, Lanes, Beside)
@intrinsic
def _prefetch_records(array, nodes):
    def codegen(builder, table, at):
        ahead = builder.mul(llvm.ArrayParts(builder, array, table).strides[0], I64(AHEAD))
        for k in range(nodes.width):
            ask(builder, at_lane(builder, array, table, nodes, at, k, I64(0)), ahead)

    return types.void(array, nodes), codegen


@implements(row, by_type=True)
def _row(array, i, first, template):
    if isinstance(i, Lanes | Beside):
        return _gather_row
    if tag_class(i) is Weighted and lanes_of(i):
        return lambda array, i, first, template: _gather_weighted(
            array, i.rows, first, i.weights, template
        )
    return None


@intrinsic
def _scatter(array, nodes, first, values):
    """Add to node records lane by lane; if all lanes have the same node, sum over lanes first."""
    lanes = Lanes(array.dtype, max(lanes_of(value) for value in values))
    at_once = types.Tuple([v if isinstance(v, Lanes) else lanes for v in values])

    def codegen(builder, table, at, first, numbers):
        size, parts = _size(array), llvm.unpack(builder, numbers)
        for begin in range(0, len(parts), 4):
            some = parts[begin : begin + 4]
            count = _chunks(len(some))[0][1]
            column = builder.add(first, I64(begin))
            rows = _records_of(builder, some, lanes, count)
            if not lanes_of(nodes):
                rows = [_added(builder, rows)]
            for k, number in enumerate(rows):
                pointer = at_lane(builder, array, table, nodes, at, k, column)
                here = _record(builder, array, pointer, count)
                total = builder.fadd(builder.load(here, align=size), number)
                builder.store(total, here, align=size)

    index_type = nodes if lanes_of(nodes) else types.int64
    return types.void(array, index_type, types.int64, at_once), codegen


@implements(move_record)
def _move_record(target, source, first, template, keep):
    _move(*target, *source, first, template, keep)


@intrinsic
def _move(*kinds):
    array, _, other, _, _, template, _ = kinds

    def codegen(builder, *values):
        here, i, source_table, j, first, _, keep = values
        size = _size(array)

        count = len(template)
        widest = LINE // (2 * size)  # parts of a record cross no cache line
        for begin in range(0, count, widest):
            column, some = builder.add(first, I64(begin)), min(widest, count - begin)
            tables = (array, here, i), (other, source_table, j)
            items = [llvm.item_pointer(builder, k, table, [n, column]) for k, table, n in tables]
            to, of = (_record(builder, array, item, some) for item in items)
            before = builder.load(to, align=size)
            zero = ir.Constant(before.type, None)
            kept = builder.select(keep, before, zero)
            builder.store(builder.fadd(kept, builder.load(of, align=size)), to, align=size)
            builder.store(zero, of, align=size)

    number = types.int64
    return types.void(array, number, other, number, number, template, types.boolean), codegen


def _records(builder: ir.IRBuilder, parts: list) -> list:
    if len(parts) == 4:
        return _transposed(builder, parts)
    if len(parts) == 2:
        return [shuffle(builder, *parts, [k, 4 + k]) for k in range(4)]
    return [shuffle(builder, parts[0], parts[0], [k]) for k in range(4)]


@implements(accumulate, by_type=True)
def _accumulate(array, i, first, values):
    if tag_class(i) is Weighted and lanes_of(i):
        return lambda array, i, first, values: _scatter_affine(
            ((array, first, values, ()),), i.rows, i.weights
        )
    if isinstance(array, types.Array) and (lanes_of(i) or lanes_of(values)):
        return _scatter
    return None


@implements(accumulate_affine)
def _accumulate_affine(parts, nodes, weights):
    if len(parts):
        _scatter_affine(parts, nodes, weights)


@intrinsic
def _scatter_affine(parts, nodes, weights):
    """Scatter with records made once per point, not per node, and weights from memory."""

    def codegen(builder, of_parts, places, factors):
        factor_at = _kept_in_memory(builder, llvm.unpack(builder, factors)) if weights else None
        at = llvm.unpack(builder, places)
        for part, values in zip(parts, llvm.unpack(builder, of_parts), strict=True):
            _scatter_part(builder, (part, nodes), llvm.unpack(builder, values), at, factor_at)

    return types.void(parts, nodes, weights), codegen


def _scatter_part(
    builder: ir.IRBuilder, kinds: tuple, values: list, places: list, factor_at: Callable | None
) -> None:
    (array, _, value, slopes), nodes = kinds
    table, first, numbers, growth = values
    lanes, width, size = value[0], _width(nodes, slopes), _size(array)
    components = llvm.unpack(builder, numbers)
    growths = [llvm.unpack(builder, slope) for slope in llvm.unpack(builder, growth)]
    widest = min(REGISTER_BYTES // size, 8)
    for begin in range(0, len(components), widest):
        some = slice(begin, begin + widest)
        left = len(components[some])
        count = widest if left > 4 else _chunks(left)[0][1]
        column = builder.add(first, I64(begin))
        one = Lanes(array.dtype, count)
        # by the node's position along the first axes
        at = {(): _records_of(builder, components[some], lanes, count)}
        grow = [_records_of(builder, slope[some], lanes, count) for slope in growths]
        if factor_at is None and not lanes_of(nodes[0]):
            at = {(): [_added(builder, at[()])]}
            grow = [[_added(builder, slope)] for slope in grow]

        def field_at(*steps, at=at, grow=grow):
            if steps not in at:
                *outer, last = steps
                at[steps] = field_at(*outer, last - 1) if last else field_at(*outer)
                if last:
                    pairs = zip(at[steps], grow[len(outer)], strict=True)
                    at[steps] = [builder.fadd(*pair) for pair in pairs]
            return at[steps]

        for k, node in enumerate(places):
            steps = tuple(k // width**d % width for d in reversed(range(len(grow))))
            total = pointer = None
            for j, record in enumerate(field_at(*steps)):
                if total is None or lanes_of(nodes[k]):
                    pointer = at_lane(builder, array, table, nodes[k], node, j, column)
                    pointer = _record(builder, array, pointer, count)
                    total = builder.load(pointer, align=size)
                if factor_at is None:
                    total = builder.fadd(total, record)
                else:
                    weight = splat(builder, builder.load(factor_at(k, j), align=size), one)
                    total = _fma(builder, [weight, record, total])
                if lanes_of(nodes[k]):
                    builder.store(total, pointer, align=size)
            if not lanes_of(nodes[k]):
                builder.store(total, pointer, align=size)


def _added(builder: ir.IRBuilder, rows: list) -> ir.Value:
    while len(rows) > 1:
        rows = [builder.fadd(*pair) for pair in zip(rows[::2], rows[1::2], strict=True)]
    return rows[0]


def _records_of(builder: ir.IRBuilder, parts: list, lanes: Lanes, count: int) -> list:
    parts = [*parts, *[ir.Constant(llvm.register_type(lanes), None)] * 8][:count]
    rows = []
    for k in range(0, lanes.width, 4):
        four = parts
        if lanes.width == 8:
            four = [shuffle(builder, v, v, list(range(k, k + 4))) for v in parts]
        low, high = _records(builder, four[:4]), four[4:]
        if high:
            pairs = zip(low, _records(builder, high), strict=True)
            low = [shuffle(builder, *pair, list(range(8))) for pair in pairs]
        rows += low
    return rows


def _kept_in_memory(builder: ir.IRBuilder, vectors: list) -> Callable:
    """Store vectors in memory opaque to LLVM; return a function: address by vector and lane.

    A broadcast from memory is part of the load, whereas one from a register takes a shuffle.
    """
    room = llvm.room(builder, ir.ArrayType(vectors[0].type, len(vectors)))
    room.align = 64
    for k, vector in enumerate(vectors):
        builder.store(vector, llvm.at(builder, room, 0, k))
    hidden = ir.FunctionType(ir.VoidType(), [room.type])
    builder.asm(hidden, "", "r,~{memory}", [room], side_effect=True)
    scalars = builder.bitcast(room, vectors[0].type.element.as_pointer())
    width = vectors[0].type.count
    return lambda k, j: builder.gep(scalars, [I32(k * width + j)])
