"""Records of arrays, nested tuples as flat sequences, and arrays that may be absent.

Comprehensions make lists, which Python interprets in two thirds of the time.
"""


def flat(nested):
    """The numbers of nested tuples in order."""
    numbers = ()
    for item in nested:
        numbers += flat(item) if isinstance(item, tuple) else (item,)
    return numbers


def nested_as(like, numbers):
    """Numbers in order, nested like `like`, in the same classes."""
    made, begin = [], 0
    for item in like:
        inner = isinstance(item, tuple)
        end = begin + (count_in(item) if inner else 1)
        made.append(nested_as(item, numbers[begin:end]) if inner else numbers[begin])
        begin = end
    return type(like)(*made) if hasattr(like, "_fields") else tuple(made)


def count_in(nested):
    """Count the numbers in nested tuples."""
    if type(nested) is tuple and not nested:
        return 0
    return sum([count_in(item) if isinstance(item, tuple) else 1 for item in nested])


def record(table, i):
    """Row `i` of a NamedTuple of arrays: the same NamedTuple of scalars.

    Nested NamedTuples become NamedTuples of scalars, too.
    """
    return type(table)(*[record(c, i) if isinstance(c, tuple) else c[i] for c in table])
