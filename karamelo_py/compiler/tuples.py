"""Algebra on flat tuples of any length: sums, multiples, products.

Comprehensions, which Numba does not know of tuples: kernels run them (`compiler/trace.py`). They
are of lists, which Python makes in two thirds of the time where all is interpreted.
"""

from karamelo_py.compiler.compile import Weighted, fma, shared, where


@shared
def add(a, b):
    """a + b, component by component."""
    return tuple([x + y for x, y in zip(a, b, strict=True)])


@shared
def subtract(a, b):
    """a - b, component by component."""
    return tuple([x - y for x, y in zip(a, b, strict=True)])


@shared
def scale(factor, a):
    """factor * a."""
    return tuple([factor * x for x in a])


@shared
def add_scaled(a, factor, b):
    """a + factor * b."""
    return tuple([fma(factor, y, x) for x, y in zip(a, b, strict=True)])


@shared
def multiply_each(a, b):
    """a b, component by component."""
    return tuple([x * y for x, y in zip(a, b, strict=True)])


@shared
def flat(nested):
    """The numbers of nested tuples, one after another."""
    numbers = ()
    for item in nested:
        numbers += flat(item) if isinstance(item, tuple) else (item,)
    return numbers


@shared
def nested_as(like, numbers):
    """Numbers one after another, in tuples nested as those of `like`, and of their classes."""
    made, begin = [], 0
    for item in like:
        inner = isinstance(item, tuple)
        end = begin + (count_in(item) if inner else 1)
        made.append(nested_as(item, numbers[begin:end]) if inner else numbers[begin])
        begin = end
    return type(like)(*made) if hasattr(like, "_fields") else tuple(made)


@shared
def count_in(nested):
    """How many numbers nested tuples have."""
    if type(nested) is tuple and not nested:
        return 0
    return sum([count_in(item) if isinstance(item, tuple) else 1 for item in nested])


@shared
def put_at(array, i, first, values):
    """array[i, first + k] = values[k]."""
    for k, value in enumerate(values):
        array[i, first + k] = value


@shared
def row(array, i, first, like):
    """(array[i, first], ..., array[i, first + len(like) - 1])."""
    if isinstance(i, Weighted):
        total = subtract(like, like)
        for one, weight in zip(i.rows, i.weights, strict=True):
            total = add_scaled(total, weight, row(array, one, first, like))
        return total
    return tuple([array[i, first + k] for k in range(len(like))])


@shared
def record(table, i):
    """A NamedTuple of arrays, seen at index `i`: the same NamedTuple of scalars.

    NamedTuples of arrays in it become NamedTuples of scalars, too.
    """
    return type(table)(*[record(c, i) if isinstance(c, tuple) else c[i] for c in table])


@shared
def add_optional(a, factor, b):
    """a + factor * b, where an empty `b` counts as zero."""
    return add_scaled(a, factor, b) if len(b) else a


@shared
def clear_first(array, i):
    """Set the first number of row `i` of an array that may be absent (None) to zero."""
    if array is not None:
        array[i, 0] = 0


@shared
def add_row(a, first, b):
    """`a` with b[k] added to a[first + k]."""

    def sum_at(k, x):
        for j in range(min(len(b), k + 1)):
            x = where(first == k - j, a[k] + b[j], x)
        return x

    return tuple([sum_at(k, x) for k, x in enumerate(a)])


@shared
def leading(values, like):
    """The first of the numbers in `values`, as `like` is."""
    return nested_as(like, flat(values)[: count_in(like)])


@shared
def following(values, like):
    """The numbers in `values` after those that are in `like`, perhaps none."""
    return flat(values)[count_in(like) :]


@shared
def plus(number, present):
    """number + present[0], or the number alone where `present` is empty."""
    return number + present[0] if len(present) else number


def only(present):
    """present[0], or 0 where `present` is empty."""
    return present[0] if len(present) else 0


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
