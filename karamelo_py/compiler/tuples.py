"""Algebra on flat tuples of any length: sums, multiples, products.

Tuples have no length-generic arithmetic in Numba, so each operation is written out for the length
it meets (`spell` builds the text once per length); in plain Python they are comprehensions.
"""

from __future__ import annotations

from collections.abc import Callable

from numba import types

from karamelo_py.compiler.compile import by_type, define, fma, lanes_of, shared


def spell(parameters: str, term: str, length: int) -> Callable:
    """The function ``(term with k = 0, ..., term with k = length - 1)`` of `parameters`."""
    items = "".join(term.replace("[k]", f"[{k}]") + ", " for k in range(length))
    return define(parameters, f"return ({items})", fma=fma)


@shared
def add(a, b):
    """a + b, component by component."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


@shared
def subtract(a, b):
    """a - b, component by component."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


@shared
def scale(factor, a):
    """factor * a."""
    return tuple(factor * x for x in a)


@shared
def add_scaled(a, factor, b):
    """a + factor * b."""
    return tuple(fma(factor, y, x) for x, y in zip(a, b, strict=True))


@shared
def multiply_each(a, b):
    """a b, component by component."""
    return tuple(x * y for x, y in zip(a, b, strict=True))


@shared
def put_at(array, i, first, values):
    """array[i, first + k] = values[k]."""
    for k, value in enumerate(values):
        array[i, first + k] = value


@shared(unless=lambda array, i, first, like: lanes_of(i))
def row(array, i, first, like):
    """(array[i, first], ..., array[i, first + len(like) - 1])."""
    return tuple(array[i, first + k] for k in range(len(like)))


@shared
def record(table, i):
    """A NamedTuple of arrays, seen at index `i`: the same NamedTuple of scalars.

    NamedTuples of arrays in it become NamedTuples of scalars, too.
    """
    return type(table)(*(record(c, i) if isinstance(c, tuple) else c[i] for c in table))


@shared
def add_optional(a, factor, b):
    """a + factor * b, where an empty `b` counts as zero."""
    return add_scaled(a, factor, b) if len(b) else a


def clear_optional(array, i):
    """Set row `i` of an array that may be absent (None) to zero."""
    if array is not None:
        array[i, :] = 0


@by_type(clear_optional)
def _clear_optional(array, i):
    if isinstance(array, types.NoneType):
        return lambda array, i: None

    def clear(array, i):
        for k in range(array.shape[1]):
            array[i, k] = 0

    return clear


def clear_first(array, i):
    """Set the first number of row `i` of an array that may be absent (None) to zero."""
    if array is not None:
        array[i, 0] = 0


@by_type(clear_first)
def _clear_first(array, i):
    if isinstance(array, types.NoneType):
        return lambda array, i: None

    def clear(array, i):
        array[i, 0] = 0

    return clear


def add_row(a, first, b):
    """`a` with b[k] added to a[first + k]."""
    return tuple(x + (b[k - first] if first <= k < first + len(b) else 0) for k, x in enumerate(a))


@by_type(add_row)
def _add_row(a, first, b):
    items = []
    for k in range(len(a)):
        term = f"a[{k}]"
        for j in range(min(len(b), k + 1)):
            term = f"(a[{k}] + b[{j}] if first == {k - j} else {term})"
        items.append(term)
    return define("a, first, b", f"return ({''.join(item + ', ' for item in items)})")


@shared
def leading(values, like):
    """The first len(like) of `values`."""
    return values[: len(like)]


@shared
def following(values, like):
    """What comes after the first len(like) of `values`, perhaps nothing."""
    return values[len(like) :]


@shared
def plus(number, present):
    """number + present[0], or the number alone where `present` is empty."""
    return number + present[0] if len(present) else number


@shared
def increased(present, change):
    """(present[0] + change,), or nothing where `present` is empty."""
    return (present[0] + change,) if len(present) else ()


@shared
def added(present, change):
    """(present[0] + change[0],), or `present` where one of both is empty."""
    return (present[0] + change[0],) if len(present) and len(change) else present


@shared
def either(first, second):
    """`first`, or `second` where `first` is empty."""
    return first if len(first) else second
