"""Nodal sums over the boxes of all tiles, in one order for any number of threads."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from karamelo_py.compiler import at_hand, index
from karamelo_py.compiler.threads import by_threads
from karamelo_py.kernels import arrays
from karamelo_py.kernels.arrays import Buffers, Nodes, Tag
from karamelo_py.kernels.equations import node_array
from karamelo_py.kernels.records import move_record, put_at


def adds(quantity: NamedTuple) -> bool:
    return type(quantity).adds  # type: ignore[attr-defined]


def columns_of(quantities: tuple, kin: NamedTuple) -> list[tuple[Any, int, int]]:
    ends: dict[tuple[Any, int], int] = {}  # first column, by array and end
    for one in [one for quantity in quantities for one in type(quantity).gives]:
        array, first = one.into.array, one.into.first(kin)
        ends[array, one.into.end(kin)] = ends.pop((array, first), first)
    return [(array, first, end) for (array, end), first in ends.items()]


def columns_in_turn(quantities: tuple, kin: Tag, present: list) -> list[tuple[Any, int, bool]]:
    """List the columns of quantities in present arrays; quantities that add come last."""
    turns = sorted(quantities, key=adds)
    sums = [(one.into, adds(quantity)) for quantity in turns for one in type(quantity).gives]
    return [
        (into.array, into.first(kin) + k, add)
        for into, add in sums
        if into.array in present
        for k in range(into.count(kin))
    ]


def arrays_given(quantities: tuple, kin: Tag) -> int:
    """Return the arrays that quantities add to, as bits: 1 sums, 2 velocities, 4 fields."""
    names = {name for name, _, _ in columns_of(quantities, kin)}
    fields = any(not isinstance(name, str) for name in names)
    return ("sums" in names) + 2 * ("velocity" in names) + 4 * fields


def _columns(quantities: tuple, kin: NamedTuple) -> Iterator[tuple]:
    for kind in (False, True):
        chosen = tuple(q for q in quantities if adds(q) == kind)
        yield from ((*columns, kind) for columns in columns_of(chosen, kin))


def _take_record(quantities, kin, into, out_of, keep):
    (nodes, n), (buffers, m) = into, out_of
    for name, first, end, add in _columns(quantities, kin):
        array = node_array(nodes, name)
        if array is not None:
            template = (0,) * (end - first)
            move_record((array, n), (node_array(buffers, name), m), first, template, add or keep)


def _clear_record(quantities, kin, nodes, n):
    for name, first, end, add in _columns(quantities, kin):
        array = node_array(nodes, name)
        if array is not None and not add:
            put_at(array, n, first, (0,) * (end - first))


@by_threads
def sum_shares(quantities: tuple, kin: Tag, nodes: Nodes, buffers: Buffers, share: int) -> None:
    nodes, buffers = at_hand(nodes), at_hand(buffers)
    first, parts = buffers.first, buffers.parts
    for row in range(first[share], first[share + 1]):
        action, count = parts[row, 9], parts[row, 4]
        for i in range(parts[row, 2]):
            for j in range(parts[row, 3]):
                n = parts[row, 0] + i * parts[row, 5] + j * parts[row, 6]
                m = parts[row, 1] + i * parts[row, 7] + j * parts[row, 8]
                if action == arrays.CLEAR:
                    for k in range(count):
                        _clear_record(quantities, kin, nodes, index(n + k))
                else:
                    for k in range(count):
                        into, out_of = (nodes, index(n + k)), (buffers.nodes, index(m + k))
                        _take_record(quantities, kin, into, out_of, action == arrays.ADD)
