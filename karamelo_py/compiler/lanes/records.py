"""Node records (nodes, components), read and written in lanes."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types

from karamelo_py.compiler import arithmetic, code, machine
from karamelo_py.compiler.choices import tag_class
from karamelo_py.compiler.code import I32, I64, Lanes, lane, pack, shuffle, splat
from karamelo_py.compiler.compile import (
    Weighted,
    accumulate,
    implements,
    lanes_of,
    prefetch_records,
)
from karamelo_py.compiler.lanes.arrays import Beside, ask, at_lane
from karamelo_py.compiler.tuples import row
from karamelo_py.compiler.values import intrinsic

# Bytes of a record written at once: a register. LLVM splits wider vectors in two, and narrow
# registers are too few for that.
_AT_ONCE = 64 if "+avx512f" in machine.features() else 32

AHEAD = 16  # nodes whose records are prefetched ahead


def _transposed(builder: Any, rows: list) -> list:
    """Transpose four vectors of four numbers, or of two: lanes from records."""
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


def _record(builder: Any, kind: Any, pointer: Any, components: int) -> Any:
    """Address of some components of a record, as a vector."""
    vector = ir.VectorType(code.register_type(kind.dtype), components)
    return builder.bitcast(pointer, vector.as_pointer())


def _chunks(count: int) -> list[tuple[int, int]]:
    """Split components into register-wide chunks: (first, number), with 4, 2 or 1; 3 count as 4.

    Records are padded accordingly.
    """
    out, first = [], 0
    while first < count:
        left = count - first
        out.append((first, 4 if left >= 3 else left))
        first += 4 if left >= 3 else left
    return out


def _lanes_from(builder: Any, rows: list, lanes: Lanes, count: int) -> list:
    """Lanes of `count` components from the records of the points."""
    if count == 1:
        return [pack(builder, [lane(builder, row, 0) for row in rows], lanes)]
    parts = [_transposed(builder, rows[k : k + 4]) for k in range(0, lanes.width, 4)]
    if len(parts) == 1:
        return parts[0]
    return [shuffle(builder, *pair, list(range(8))) for pair in zip(*parts, strict=True)]


def _gathered(builder: Any, lanes: Lanes, first: Any, like: Any, read: Callable) -> list:
    """Components of records in lanes: ``read(lane, column, count)`` returns some of one point."""
    found: list = []
    for begin, count in _chunks(len(like)):
        column = builder.add(first, I64(begin))
        rows = [read(k, column, count) for k in range(lanes.width)]
        found += _lanes_from(builder, rows, lanes, count)
    return found[: len(like)]


@intrinsic
def _gather_row(array, nodes, first, like):
    """Components of node records, as many as `like` has."""
    lanes = Lanes(array.dtype, nodes.width)
    made = types.UniTuple(lanes, len(like))

    def codegen(builder, table, at, first, _):
        def read(k, column, count):
            pointer = at_lane(builder, array, table, nodes, at, k, column)
            return builder.load(_record(builder, array, pointer, count), align=_size(array))

        return code.make_tuple(builder, made, _gathered(builder, lanes, first, like, read))

    return made(array, nodes, types.int64, like), codegen


@intrinsic
def _gather_weighted(array, nodes, first, weights, like):
    """The same for the weighted sum of some node records, each read where it is."""
    lanes = weights[0]
    made = types.UniTuple(lanes, len(like))

    def codegen(builder, table, places, first, shares, _):
        size = _size(array)
        spread = _kept_in_memory(builder, code.unpack(builder, shares))
        at = code.unpack(builder, places)

        def read(j, column, count):
            record = Lanes(array.dtype, count)
            total = ir.Constant(code.register_type(record), None)
            for k, node in enumerate(at):
                pointer = at_lane(builder, array, table, nodes[k], node, j, column)
                pointer = _record(builder, array, pointer, count)
                weight = splat(builder, builder.load(spread(k, j), align=size), record)
                total = _fma(builder, [weight, builder.load(pointer, align=size), total])
            return total

        return code.make_tuple(builder, made, _gathered(builder, lanes, first, like, read))

    return made(array, nodes, types.int64, weights, like), codegen


def _size(array: types.Array) -> int:
    return array.dtype.bitwidth // 8


_fma = arithmetic.of_library("llvm.fma")  # a b + c of vectors, rounded once


@implements(prefetch_records, Lanes, Beside)
@intrinsic
def _prefetch_records(array, nodes):
    def codegen(builder, table, at):
        ahead = builder.mul(code.ArrayParts(builder, array, table).strides[0], I64(AHEAD))
        for k in range(nodes.width):
            ask(builder, at_lane(builder, array, table, nodes, at, k, I64(0)), ahead)

    return types.void(array, nodes), codegen


@implements(row, by_type=True)
def _row(array, i, first, like):
    if isinstance(i, Lanes | Beside):
        return _gather_row
    if tag_class(i) is Weighted and lanes_of(i):
        return lambda array, i, first, like: _gather_weighted(array, i.rows, first, i.weights, like)
    return None


@intrinsic
def _scatter(array, nodes, first, values):
    """Add to components of node records, lane by lane; first summed if all go to one node."""
    lanes = Lanes(array.dtype, max(lanes_of(value) for value in values))
    at_once = types.Tuple([v if isinstance(v, Lanes) else lanes for v in values])

    def codegen(builder, table, at, first, numbers):
        size, parts = _size(array), code.unpack(builder, numbers)
        for begin in range(0, len(parts), 4):
            some = parts[begin : begin + 4]
            count = _chunks(len(some))[0][1]
            column = builder.add(first, I64(begin))
            rows = _records_of(builder, some, lanes, count)
            if not lanes_of(nodes):
                while len(rows) > 1:
                    rows = [builder.fadd(*pair) for pair in zip(rows[::2], rows[1::2], strict=True)]
            for k, number in enumerate(rows):
                pointer = at_lane(builder, array, table, nodes, at, k, column)
                here = _record(builder, array, pointer, count)
                total = builder.fadd(builder.load(here, align=size), number)
                builder.store(total, here, align=size)

    place = nodes if lanes_of(nodes) else types.int64
    return types.void(array, place, types.int64, at_once), codegen


def move_record(array, i, other, j, first, like, keep):
    """Add components of a node record of another array, as many as `like` has, and zero them there.

    If not `keep`, they replace the old content.
    """
    for k in range(first, first + len(like)):
        array[i, k] = (array[i, k] if keep else 0) + other[j, k]
        other[j, k] = 0


@implements(move_record)
@intrinsic
def _move_record(array, i, other, j, first, like, keep):
    def codegen(builder, here, i, there, j, first, _, keep):
        size = _size(array)

        def place(kind, table, node):
            pointer = code.item_pointer(builder, kind, table, [node, first])
            return _record(builder, kind, pointer, len(like))

        to, of = place(array, here, i), place(other, there, j)
        before = builder.load(to, align=size)
        zero = ir.Constant(before.type, None)
        kept = builder.select(keep, before, zero)
        builder.store(builder.fadd(kept, builder.load(of, align=size)), to, align=size)
        builder.store(zero, of, align=size)

    number = types.int64
    return types.void(array, number, other, number, number, like, types.boolean), codegen


def _records(builder: Any, parts: list) -> list:
    """Four records from the lanes of their components: four, two, or one."""
    if len(parts) == 4:
        return _transposed(builder, parts)
    if len(parts) == 2:
        return [shuffle(builder, *parts, [k, 4 + k]) for k in range(4)]
    return [shuffle(builder, parts[0], parts[0], [k]) for k in range(4)]


@implements(accumulate, by_type=True)
def _accumulate(array, i, first, values):
    if tag_class(i) is Weighted and lanes_of(i):
        return lambda array, i, first, values: _accumulate_affine(
            array, i.rows, first, i.weights, values, ()
        )
    if isinstance(array, types.Array) and (lanes_of(i) or lanes_of(values)):
        return _scatter
    return None


def accumulate_affine(array, nodes, first, weights, value, slopes):
    """Add an affine field times the weights to nodes: components from `first` on.

    `value` is the field at the first node. It grows by ``slopes[d]`` to the next node in direction
    `d` (nodes form a square or cube, last direction fastest); without slopes it is constant.
    """
    width = round(len(nodes) ** (1 / max(1, len(slopes))))
    for k, (node, weight) in enumerate(zip(nodes, weights, strict=True)):
        for c, number in enumerate(value):
            for d, slope in enumerate(reversed(slopes)):
                number = number + (k // width**d % width) * slope[c]
            array[node, first + c] += weight * number


@implements(accumulate_affine)
@intrinsic
def _accumulate_affine(array, nodes, first, weights, value, slopes):
    """The records of the points as vectors, with weights read one by one.

    So records are made once per point, not per node.
    """
    lanes = weights[0]

    def codegen(builder, table, places, first, shares, numbers, growth):
        size = _size(array)
        spread = _kept_in_memory(builder, code.unpack(builder, shares))
        values = code.unpack(builder, numbers)
        growths = [code.unpack(builder, slope) for slope in code.unpack(builder, growth)]
        width = round(len(nodes) ** (1 / max(1, len(growths))))
        widest = min(_AT_ONCE // size, 8)
        for begin in range(0, len(values), widest):
            some = slice(begin, begin + widest)
            left = len(values[some])
            count = widest if left > 4 else _chunks(left)[0][1]
            column = builder.add(first, I64(begin))
            one = Lanes(array.dtype, count)
            # By the position of the node in the first directions.
            at = {(): _records_of(builder, values[some], lanes, count)}
            grow = [_records_of(builder, slope[some], lanes, count) for slope in growths]

            def field_at(*place, at=at, grow=grow):
                if place not in at:
                    *outer, last = place
                    at[place] = field_at(*outer, last - 1) if last else field_at(*outer)
                    if last:
                        pairs = zip(at[place], grow[len(outer)], strict=True)
                        at[place] = [builder.fadd(*pair) for pair in pairs]
                return at[place]

            for k, node in enumerate(code.unpack(builder, places)):
                place = tuple(k // width**d % width for d in reversed(range(len(grow))))
                total = pointer = None
                for j, record in enumerate(field_at(*place)):
                    if total is None or lanes_of(nodes[k]):
                        pointer = at_lane(builder, array, table, nodes[k], node, j, column)
                        pointer = _record(builder, array, pointer, count)
                        total = builder.load(pointer, align=size)
                    weight = splat(builder, builder.load(spread(k, j), align=size), one)
                    total = _fma(builder, [weight, record, total])
                    if lanes_of(nodes[k]):
                        builder.store(total, pointer, align=size)
                if not lanes_of(nodes[k]):
                    builder.store(total, pointer, align=size)

    return types.void(array, nodes, types.int64, weights, value, slopes), codegen


def _records_of(builder: Any, parts: list, lanes: Lanes, count: int) -> list:
    """Make a record of `count` components for each lane."""
    parts = [*parts, *[ir.Constant(code.register_type(lanes), None)] * 8][:count]
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


def _kept_in_memory(builder: Any, vectors: list) -> Callable:
    """Store vectors in memory that is opaque to LLVM; return the address of a lane.

    Broadcasting from memory is part of the load; from a register it costs a shuffle.
    """
    room = code.room(builder, ir.ArrayType(vectors[0].type, len(vectors)))
    room.align = 64
    for k, vector in enumerate(vectors):
        builder.store(vector, code.at(builder, room, 0, k))
    hidden = ir.FunctionType(ir.VoidType(), [room.type])
    builder.asm(hidden, "", "r,~{memory}", [room], side_effect=True)
    scalars = builder.bitcast(room, vectors[0].type.element.as_pointer())
    width = vectors[0].type.count
    return lambda k, j: builder.gep(scalars, [I32(k * width + j)])
