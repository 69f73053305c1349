"""Algebra on flat tuples of any length: sums, multiples, products.

Tuples have no length-generic arithmetic in Numba, so each operation is written out for the length
it meets (`spell` builds the text once per length); in plain Python they are comprehensions.
"""

from __future__ import annotations

from collections.abc import Callable

from numba import types
from numba.extending import overload

from karamelo_py.compile import define, fma


def spell(parameters: str, term: str, length: int) -> Callable:
    """The function ``(term with k = 0, ..., term with k = length - 1)`` of `parameters`."""
    items = "".join(term.replace("[k]", f"[{k}]") + ", " for k in range(length))
    return define(parameters, f"return ({items})", fma=fma)


def add(a, b):
    """a + b, component by component."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


@overload(add)
def _add(a, b):
    return spell("a, b", "a[k] + b[k]", len(a))


def subtract(a, b):
    """a - b, component by component."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


@overload(subtract)
def _subtract(a, b):
    return spell("a, b", "a[k] - b[k]", len(a))


def scale(factor, a):
    """factor * a."""
    return tuple(factor * x for x in a)


@overload(scale)
def _scale(factor, a):
    return spell("factor, a", "factor * a[k]", len(a))


def add_scaled(a, factor, b):
    """a + factor * b."""
    return tuple(fma(factor, y, x) for x, y in zip(a, b, strict=True))


@overload(add_scaled)
def _add_scaled(a, factor, b):
    return spell("a, factor, b", "fma(factor, b[k], a[k])", len(a))


def put_at(array, i, first, values):
    """array[i, first + k] = values[k]."""
    for k, value in enumerate(values):
        array[i, first + k] = value


@overload(put_at)
def _put_at(array, i, first, values):
    lines = [f"array[i, first + {k}] = values[{k}]" for k in range(len(values))]
    return define("array, i, first, values", *lines)


def row(array, i, first, like):
    """(array[i, first], ..., array[i, first + len(like) - 1])."""
    return tuple(array[i, first + k] for k in range(len(like)))


@overload(row)
def _row(array, i, first, like):
    items = "".join(f"array[i, first + {k}], " for k in range(len(like)))
    return define("array, i, first, like", f"return ({items})")


def record(table, i):
    """A NamedTuple of arrays, seen at index `i`: the same NamedTuple of scalars.

    NamedTuples of arrays in it become NamedTuples of scalars, too.
    """
    return type(table)(*(record(c, i) if isinstance(c, tuple) else c[i] for c in table))


@overload(record)
def _record(table, i):
    terms = [
        f"record(table[{k}], i)" if isinstance(column, types.BaseNamedTuple) else f"table[{k}][i]"
        for k, column in enumerate(table)
    ]
    made = f"return make({', '.join(terms)})"
    return define("table, i", made, make=table.instance_class, record=record)


def moment_at(array, i, like):
    """Row `i` of an array that may be absent (None) because the transfer keeps no moment."""
    return () if array is None else row(array, i, 0, like)


@overload(moment_at)
def _moment_at(array, i, like):
    if isinstance(array, types.NoneType):
        return lambda array, i, like: ()
    return lambda array, i, like: row(array, i, 0, like)


def put_moment(array, i, values):
    """Store into row `i` of an array that may be absent (None)."""
    if array is not None:
        put_at(array, i, 0, values)


@overload(put_moment)
def _put_moment(array, i, values):
    if isinstance(array, types.NoneType):
        return lambda array, i, values: None
    return lambda array, i, values: put_at(array, i, 0, values)
