"""Records of nodes, (nodes, components), read and written in lanes."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types

from karamelo_py.compiler import code, machine
from karamelo_py.compiler.compile import (
    Weighted,
    accumulate,
    by_type,
    implements,
    lanes_of,
    prefetch_records,
    tag_class,
)
from karamelo_py.compiler.intrinsics import intrinsic
from karamelo_py.compiler.lanes.arrays import Beside, ask, at_lane
from karamelo_py.compiler.lanes.registers import (
    I32,
    I64,
    Lanes,
    element,
    lane,
    pack,
    shuffle,
    splat,
    vector_of,
)
from karamelo_py.compiler.tuples import row

# Bytes of a record that a field is given to at once: a register. Of wider vectors LLVM makes two,
# and where registers are narrow there are too few of them for that.
_AT_ONCE = 64 if "+avx512f" in machine.features() else 32

AHEAD = 16  # nodes by which records are asked of the memory ahead of their use


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


def _record(builder: Any, kind: Any, pointer: Any, components: int) -> Any:
    """Address of so many components of a record, as a vector."""
    vector = ir.VectorType(element(kind.dtype), components)
    return builder.bitcast(pointer, vector.as_pointer())


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


def _lanes_from(builder: Any, rows: list, lanes: Lanes, count: int) -> list:
    """Lanes of `count` components from the records of the points."""
    if count == 1:
        return [pack(builder, [lane(builder, row, 0) for row in rows], lanes)]
    parts = [_transposed(builder, rows[k : k + 4]) for k in range(0, lanes.width, 4)]
    if len(parts) == 1:
        return parts[0]
    return [shuffle(builder, *pair, list(range(8))) for pair in zip(*parts, strict=True)]


@intrinsic
def _gather_row(array, nodes, first, like):
    """Components of the records of nodes, as many as `like` has."""
    lanes = Lanes(array.dtype, nodes.width)
    made = types.UniTuple(lanes, len(like))

    def codegen(builder, sig, arguments):
        found = []
        for begin, count in _chunks(len(like)):
            column = builder.add(arguments[2], ir.Constant(arguments[2].type, begin))

            rows = []
            for k in range(lanes.width):
                given = builder, array, arguments[0], nodes, arguments[1], k, column
                at = _record(builder, array, at_lane(*given), count)
                rows.append(builder.load(at, align=array.dtype.bitwidth // 8))
            found += _lanes_from(builder, rows, lanes, count)
        return code.make_tuple(builder, made, found[: len(like)])

    return made(array, nodes, types.int64, like), codegen


@intrinsic
def _gather_weighted(array, nodes, first, weights, like):
    """The same of the weighted sum of the records of some nodes: each is read as it lies there."""
    lanes = weights[0]
    made = types.UniTuple(lanes, len(like))

    def codegen(builder, sig, arguments):
        size = array.dtype.bitwidth // 8
        spread = _kept_in_memory(builder, code.unpack(builder, arguments[3]))
        at = code.unpack(builder, arguments[1])
        found = []
        for begin, count in _chunks(len(like)):
            column = builder.add(arguments[2], ir.Constant(arguments[2].type, begin))
            record = Lanes(array.dtype, count)
            rows = []
            for j in range(lanes.width):
                total = ir.Constant(vector_of(record), None)
                for k, node in enumerate(at):
                    given = builder, array, arguments[0], nodes[k], node, j, column
                    pointer = _record(builder, array, at_lane(*given), count)
                    weight = splat(builder, builder.load(spread(k, j), align=size), record)
                    total = _fma(builder, weight, builder.load(pointer, align=size), total)
                rows.append(total)
            found += _lanes_from(builder, rows, lanes, count)
        return code.make_tuple(builder, made, found[: len(like)])

    return made(array, nodes, types.int64, weights, like), codegen


@intrinsic
def _prefetch_records(array, nodes):
    def codegen(builder, sig, arguments):
        strides = code.ArrayParts(builder, array, arguments[0]).strides
        stride = strides[0]
        ahead = builder.mul(stride, ir.Constant(stride.type, AHEAD))
        column = ir.Constant(I64, 0)
        for k in range(nodes.width):
            pointer = at_lane(builder, array, arguments[0], nodes, arguments[1], k, column)
            ask(builder, pointer, ahead)
        return code.nothing()

    return types.void(array, nodes), codegen


implements(prefetch_records, Lanes, Beside)(_prefetch_records)


def _fma(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c of vectors, with one rounding."""
    kind = a.type
    name = f"llvm.fma.v{kind.count}{kind.element.intrinsic_name}"
    function = code.external(builder, name, kind, [kind] * 3)
    return builder.call(function, [a, b, c])


@by_type(row)
def _row(array, i, first, like):
    if isinstance(i, Lanes | Beside):
        return _gather_row
    if tag_class(i) is Weighted and lanes_of(i):
        return lambda array, i, first, like: _gather_weighted(array, i.rows, first, i.weights, like)
    return None


@intrinsic
def _scatter(array, nodes, first, values):
    """Add to components of the records of nodes, lane after lane; summed before to one node."""
    width = max(lanes_of(value) for value in values)
    lanes = Lanes(array.dtype, width)

    def codegen(builder, sig, arguments):
        size = array.dtype.bitwidth // 8
        parts = code.unpack(builder, arguments[3])
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
            if not lanes_of(nodes):
                while len(rows) > 1:
                    rows = [builder.fadd(*pair) for pair in zip(rows[::2], rows[1::2], strict=True)]
            for k, number in enumerate(rows):
                given = builder, array, arguments[0]
                if lanes_of(nodes):
                    pointer = at_lane(*given, nodes, arguments[1], k, column)
                else:
                    pointer = code.item_pointer(*given, [arguments[1], column])
                at = _record(builder, array, pointer, count)
                total = builder.fadd(builder.load(at, align=size), number)
                builder.store(total, at, align=size)
        return code.nothing()

    at = nodes if lanes_of(nodes) else types.int64
    return types.void(array, at, types.int64, values), codegen


def move_record(array, i, other, j, first, like, keep):
    """Add components of the record of a node of another array, as many as `like` has.

    They are zero there then. If not `keep`, they take the place of what was here.
    """
    for k in range(first, first + len(like)):
        array[i, k] = (array[i, k] if keep else 0) + other[j, k]
        other[j, k] = 0


@intrinsic
def _move_record(array, i, other, j, first, like, keep):
    def codegen(builder, sig, arguments):
        size = array.dtype.bitwidth // 8
        to, of = (
            _record(
                builder,
                kind,
                code.item_pointer(builder, kind, arguments[k], [arguments[k + 1], arguments[4]]),
                len(like),
            )
            for k, kind in ((0, array), (2, other))
        )
        there = builder.load(to, align=size)
        zero = ir.Constant(there.type, None)
        kept = builder.select(arguments[6], there, zero)
        builder.store(builder.fadd(kept, builder.load(of, align=size)), to, align=size)
        builder.store(zero, of, align=size)
        return code.nothing()

    signature = types.void(array, types.int64, other, types.int64, types.int64, like, types.boolean)
    return signature, codegen


implements(move_record)(_move_record)


def _records(builder: Any, parts: list) -> list:
    """Four records from the lanes of their components: four, two, or one."""
    if len(parts) == 4:
        return _transposed(builder, parts)
    if len(parts) == 2:
        return [shuffle(builder, *parts, [k, 4 + k]) for k in range(4)]
    return [shuffle(builder, parts[0], parts[0], [k]) for k in range(4)]


@by_type(accumulate)
def _accumulate(array, i, first, values):
    if tag_class(i) is Weighted and lanes_of(i):
        return lambda array, i, first, values: _accumulate_affine(
            array, i.rows, first, i.weights, values, ()
        )
    if isinstance(array, types.Array) and (lanes_of(i) or lanes_of(values)):
        return _scatter
    return None


def accumulate_affine(array, nodes, first, weights, value, slopes):
    """Give nodes their weights times an affine field: components from the `first` on.

    `value` is that of the first node; the field grows by ``slopes[d]`` to the next in direction `d`
    (of nodes in a square or a cube, the last direction running fastest), or is the same everywhere
    where there are none.
    """
    width = round(len(nodes) ** (1 / max(1, len(slopes))))
    for k, (node, weight) in enumerate(zip(nodes, weights, strict=True)):
        for c, number in enumerate(value):
            for d, slope in enumerate(reversed(slopes)):
                number = number + (k // width**d % width) * slope[c]
            array[node, first + c] += weight * number


@intrinsic
def _accumulate_affine(array, nodes, first, weights, value, slopes):
    """The records of the points, each with one vector; the weights are read one by one.

    So the records are made once a point, not at each node.
    """
    lanes = weights[0]

    def codegen(builder, sig, arguments):
        size = array.dtype.bitwidth // 8
        spread = _kept_in_memory(builder, code.unpack(builder, arguments[3]))
        values = code.unpack(builder, arguments[4])
        growths = [code.unpack(builder, slope) for slope in code.unpack(builder, arguments[5])]
        width = round(len(nodes) ** (1 / max(1, len(growths))))
        widest = min(_AT_ONCE // size, 8)
        for begin in range(0, len(values), widest):
            some = slice(begin, begin + widest)
            left = len(values[some])
            count = widest if left > 4 else _chunks(left)[0][1]
            column = builder.add(arguments[2], ir.Constant(arguments[2].type, begin))
            vector = ir.VectorType(element(array.dtype), count)
            one = Lanes(array.dtype, count)
            # By the place of the node in the first directions.
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

            for k, node in enumerate(code.unpack(builder, arguments[1])):
                place = tuple(k // width**d % width for d in reversed(range(len(grow))))
                total = pointer = None
                for j, record in enumerate(field_at(*place)):
                    if total is None or lanes_of(nodes[k]):
                        given = builder, array, arguments[0]
                        if lanes_of(nodes[k]):
                            pointer = at_lane(*given, nodes[k], node, j, column)
                        else:
                            pointer = code.item_pointer(*given, [node, column])
                        pointer = builder.bitcast(pointer, vector.as_pointer())
                        total = builder.load(pointer, align=size)
                    weight = splat(builder, builder.load(spread(k, j), align=size), one)
                    total = _fma(builder, weight, record, total)
                    if lanes_of(nodes[k]):
                        builder.store(total, pointer, align=size)
                if not lanes_of(nodes[k]):
                    builder.store(total, pointer, align=size)
        return code.nothing()

    made = types.void(array, nodes, types.int64, weights, value, slopes)
    return made, codegen


implements(accumulate_affine)(_accumulate_affine)


def _records_of(builder: Any, parts: list, lanes: Lanes, count: int) -> list:
    """A record of `count` components for each lane."""
    zero = ir.Constant(vector_of(lanes), None)
    parts = [*parts, *[zero] * 8][:count]
    rows = []
    for k in range(0, lanes.width, 4):
        four = [shuffle(builder, v, v, list(range(k, k + 4))) for v in parts]
        low, high = _records(builder, four[:4]), four[4:]
        if high:
            pairs = zip(low, _records(builder, high), strict=True)
            low = [shuffle(builder, *pair, list(range(8))) for pair in pairs]
        rows += low
    return rows


def _kept_in_memory(builder: Any, vectors: list) -> Callable:
    """Store vectors in memory that LLVM does not see through; return the address of a lane.

    A number from memory gets into all lanes as it is loaded; out of a register that takes as long
    as a shuffle.
    """
    kind = ir.ArrayType(vectors[0].type, len(vectors))
    room = code.room(builder, kind)
    room.align = 64
    for k, vector in enumerate(vectors):
        builder.store(vector, code.at(builder, room, 0, k))
    hidden = ir.FunctionType(ir.VoidType(), [room.type])
    builder.asm(hidden, "", "r,~{memory}", [room], side_effect=True)
    scalars = builder.bitcast(room, vectors[0].type.element.as_pointer())
    width = vectors[0].type.count
    return lambda k, j: builder.gep(scalars, [ir.Constant(I32, k * width + j)])
