"""Decorators that compile kernels, and point functions that are chosen by type."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numba

from karamelo_py.compiler import arithmetic
from karamelo_py.compiler.choices import (
    INTERPRETED,
    choosers,
    declare_point_function,
    note,
    of_numbers,
    tag_class,
)
from karamelo_py.compiler.trace import INSTEAD, Undefined, forget, run_for_kernel, traced
from karamelo_py.compiler.values import OF_REALS, at_work, intrinsic, now


def by_type(function: Callable) -> Callable:
    """Decorate the chooser of what `function` is in a kernel, from the types of its arguments."""
    return functools.partial(traced, function)


def implements(function: Callable, *numbers: type) -> Callable:
    """Decorate what `function` is in a kernel: for these types of numbers, or for all others.

    A type of numbers is a NamedTuple with operators (:func:`~.algebra.algebra`), or lanes. It
    is looked for in tuples, too. What is decorated is traced, or code written by hand.
    """

    def register(made: Callable) -> Callable:
        for one in numbers:
            if "implements" not in vars(one):
                one.implements = {}
            one.implements[function] = made
            of_numbers.setdefault(function, []).append(made)
        if function not in choosers or not numbers:
            traced(function, lambda *_: None if numbers else made, last=not numbers)
        return made

    return register


def shared(function: Callable) -> Callable:
    """Mark a helper of point functions: kernels may call it. It may ask what its arguments are."""
    return implements(function)(function)


def point_function(*, tags: int = 1, otherwise: bool = False) -> Callable[[Callable], Any]:
    """Declare a pure function of one point, selected by the classes of its first `tags` arguments.

    The decorated function gives name, parameters and docstring. Implementations are added with
    ``name.on(Class, ...)`` and serve both as plain Python (``NUMBA_DISABLE_JIT=1``, tests) and
    inside kernels, where the types are known at compile time and no branch is left. A plug-in adds
    its own in the same way. With ``otherwise`` what the decorated function does is for all others.

    Point functions serve one point or several at once (:mod:`karamelo_py.compiler.lanes`). Those
    that a class names in ``scalarised``, since they branch, are called for one point after another.
    """

    def declare(stub: Callable) -> Callable:
        table: dict[tuple[type, ...], Callable] = {}
        fallback = stub if otherwise else None

        def find(classes: tuple) -> Callable | None:
            return table.get(classes, fallback)

        def plain(*arguments: Any) -> Any:
            classes = tuple([a.__class__ for a in arguments[:tags]])
            chosen = table.get(classes, fallback)
            if chosen is None:
                raise Undefined(stub.__name__, classes)
            return chosen(*arguments)

        def watched(*arguments: Any) -> Any:
            return run_for_kernel(dispatch, arguments) if at_work() else plain(*arguments)

        dispatch = plain if INTERPRETED else watched
        for name in ("__name__", "__qualname__", "__module__", "__doc__"):
            setattr(dispatch, name, getattr(stub, name))

        def choose(*arguments: Any) -> Callable | None:
            classes = tuple(tag_class(a) for a in arguments[:tags])
            found = find(classes)
            apart = any(stub.__name__ in getattr(tag, "scalarised", ()) for tag in classes)
            return _in_each_lane(dispatch) if apart and lanes_of(arguments) else found

        by_type(dispatch)(choose)

        def on(*classes: type) -> Callable[[Callable], Callable]:
            def register(implementation: Callable) -> Callable:
                table[classes] = implementation
                forget()
                return implementation

            return register

        def defined(*classes: type) -> bool:
            note([(dispatch, classes)])
            return classes in table

        dispatch.tags, dispatch.find, dispatch.on, dispatch.defined = tags, find, on, defined
        declare_point_function(dispatch)
        return dispatch

    return declare


def lane_by_lane(function: Callable, unrolled: bool, arguments: tuple) -> Any:
    """Do a function of numbers for each lane among its arguments."""
    raise TypeError("only compiled kernels know lanes")


def _in_each_lane(function: Callable) -> Callable:
    return lambda *arguments: lane_by_lane(function, False, arguments)


def real(value: float, like: Any) -> Any:
    """Give `value` the number type of `like`.

    Literals take the type of what they meet; this is for what meets nothing yet.
    """
    return type(like)(value)


def lanes_of(numba_type: Any) -> int:
    """Count the lanes of a type, or of a value (:mod:`karamelo_py.compiler.lanes`).

    It is 0 for numbers; of tuples, those of what is in them.
    """
    if isinstance(numba_type, tuple | numba.types.BaseTuple):
        return max(map(lanes_of, numba_type), default=0)
    return getattr(numba_type, "width", 0)


INSTEAD[lanes_of] = lambda thing: lanes_of(now().kind_of(thing))


@by_type(real)
def _real(value, like):
    number = numba.float32 if like is numba.types.float32 else numba.float64
    return lambda value, like: number(value)


def round_off(like: Any) -> Any:
    """Give the relative error of one operation, in the number type of `like`."""
    return type(like)(2.0**-23 if type(like).__name__ == "float32" else 2.0**-52)


@by_type(round_off)
def _round_off(like):
    if like is numba.types.float32:
        return lambda like: numba.float32(2.0**-23)
    return lambda like: numba.float64(2.0**-52)


@shared
def fma(a: float, b: float, c: float) -> float:
    """Add a b to c with one rounding, where compiled: always so, whatever surrounds it."""
    return a * b + c


@intrinsic
def _fused(a, b, c):
    kind = arithmetic.common(a, b, c)
    call = arithmetic.of_library("llvm.fma")
    return kind(kind, kind, kind), lambda builder, *values: call(builder, values)


@by_type(fma)
def _fma(a, b, c):
    real = a == b == c and isinstance(a, numba.types.Float)
    return _fused if real or lanes_of((a, b, c)) else None


@shared
def where(condition: bool, a: float, b: float) -> float:
    """Choose `a` where `condition` holds, else `b`; both are computed, and nothing branches."""
    return a if condition else b


OF_REALS |= {fma, where}


@shared
def all_lanes(condition: bool) -> bool:
    """Tell whether a condition holds in all lanes; it itself where there are none."""
    return condition


@shared
def any_lane(condition: bool) -> bool:
    """Tell whether a condition holds in any lane; it itself where there are none."""
    return condition


@shared
def of_present(p: int, value: float) -> float:
    """Give `value`, and 0 in the lanes of a group of points that have no point."""
    return value


class Weighted(NamedTuple):
    """Rows of an array in the place of one: read, their weighted sum; given to, each its share."""

    rows: tuple[int, ...]
    weights: tuple[float, ...]


@shared
def prefetch(array: Any, at: tuple) -> None:
    """Have the memory bring what a loop over groups of points reads soon behind an item."""


@shared
def prefetch_records(array: Any, i: Any) -> None:
    """Have the memory bring the records some nodes behind those of number `i`, in lanes."""


@shared
def accumulate(array: Any, i: int | Weighted, first: int, values: tuple) -> None:
    """array[i, first + k] += values[k], lane after lane."""
    if isinstance(i, Weighted):
        for one, weight in zip(i.rows, i.weights, strict=True):
            accumulate(array, one, first, tuple([weight * value for value in values]))
    else:
        for k, value in enumerate(values):
            array[i, first + k] += value


@shared
def largest(a: float) -> float:
    """Find the largest of the lanes; a number itself."""
    return a


@shared
def added(total: float, value: float) -> float:
    """Add to `total` a value that may be in lanes: one after another, as numbers would be added."""
    return total + value


@shared
def first_false_lane(condition: bool) -> int:
    """Find the first lane in which a condition does not hold; 0 where there are none."""
    return 0


@shared
def is_one(number: int) -> bool:
    """Tell whether all lanes have the same number."""
    return True


@shared
def first_lane(number: int) -> int:
    """Give the number of the first lane; a number itself."""
    return number


def index(i: int) -> int:
    """Give `i` as an array index that is known not to be negative.

    Saves a test for indices counted from the end at every access (a tenth of a sweep).
    """
    return i


implements(index)(lambda i: numba.uint64(i))


def beside(first: int, steps: int) -> int:
    """Give `first` + `steps` as the number of a node: an array index, as `index` makes it.

    Of lanes it keeps the two apart: what is `steps` from the first node of each is found from the
    places of these.
    """
    return first + steps


implements(beside)(lambda first, steps: numba.uint64(first + steps))
