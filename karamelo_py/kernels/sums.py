"""Sums at the nodes of the records in the tiles' buffers.

A quantity says in ``fills(kin)`` which columns of the nodes' arrays take it: (array, first column,
end), the array a name in `Nodes` or the class of a field, which a scene may not have. With
``adds = True`` it adds to what is there.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import index, shared
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.held import at_hand
from karamelo_py.compiler.lanes.records import move_record
from karamelo_py.compiler.loops import noinline
from karamelo_py.compiler.tuples import put_at
from karamelo_py.kernels.arrays import ADD, CLEAR, Buffers, Nodes, Tag


def adds(quantity: NamedTuple) -> bool:
    """Return True if a quantity adds to the values at the nodes."""
    return getattr(type(quantity), "adds", False)


def columns_of(quantities: tuple, kin: NamedTuple) -> list[tuple[Any, int, int]]:
    """The columns that take all the quantities; those that follow each other are one entry."""
    found: dict[tuple[Any, int], int] = {}  # the first column of each array that ends there
    for quantity in quantities:
        for array, first, end in quantity.fills(kin):
            found[array, end] = found.pop((array, first), first)
    return [(array, first, end) for (array, end), first in found.items()]


@shared
def given(quantities: tuple, kin: Tag) -> int:
    """Add up the kinds of arrays that take the quantities: 1 the sums, 2 velocities, 4 fields."""
    names = {name for name, _, _ in columns_of(quantities, kin)}
    fields = any(not isinstance(name, str) for name in names)
    return ("sums" in names) + 2 * ("velocity" in names) + 4 * fields


def _array(nodes: Nodes, name: Any) -> Any:
    return getattr(nodes, name) if isinstance(name, str) else field(nodes.fields, name)


def _columns(quantities: tuple, kin: NamedTuple) -> Iterator[tuple]:
    for kind in (False, True):
        chosen = tuple(q for q in quantities if adds(q) == kind)
        yield from ((*columns, kind) for columns in columns_of(chosen, kin))


@shared
def _take_record(quantities, kin, nodes, n, buffers, m, keep):
    """Add what record `m` of the buffers has to node `n`, or put it there; it is zero then."""
    for name, first, end, add in _columns(quantities, kin):
        array = _array(nodes, name)
        if array is not None:
            like = (0,) * (end - first)
            move_record(array, n, _array(buffers, name), m, first, like, add or keep)


@shared
def _clear_record(quantities, kin, nodes, n):
    """Clear the columns of node `n` that take the quantities, but those that they add to."""
    for name, first, end, add in _columns(quantities, kin):
        array = _array(nodes, name)
        if array is not None and not add:
            put_at(array, n, first, (0,) * (end - first))


@noinline
def sum_share(quantities: tuple, kin: Tag, nodes: Nodes, buffers: Buffers, share: int) -> None:
    """Sum the quantities at the nodes of a share, tile after tile, box after box."""
    nodes, buffers = at_hand(nodes), at_hand(buffers)
    first, parts = buffers.first, buffers.parts
    for part in range(first[share], first[share + 1]):
        what, count = parts[part, 9], parts[part, 4]
        for i in range(parts[part, 2]):
            for j in range(parts[part, 3]):
                n = parts[part, 0] + i * parts[part, 5] + j * parts[part, 6]
                m = parts[part, 1] + i * parts[part, 7] + j * parts[part, 8]
                if what == CLEAR:
                    for k in range(count):
                        _clear_record(quantities, kin, nodes, index(n + k))
                else:
                    for k in range(count):
                        _take_record(
                            quantities, kin, nodes, index(n + k), buffers.nodes, index(m + k),
                            what == ADD,
                        )  # fmt: skip
