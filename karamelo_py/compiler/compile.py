"""How the package compiles: kernels, and point functions that are chosen by type."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
from numba import config
from numba.extending import intrinsic

from karamelo_py.compiler.choices import (
    SPELLED,
    declare_point_function,
    note,
    tag_class,
)
from karamelo_py.compiler.trace import Undefined, forget, roll, run_for_kernel, traced
from karamelo_py.compiler.values import OF_REALS, at_work


def by_type(function: Callable) -> Callable:
    """Decorate the chooser of what `function` is in a kernel, from the types of its arguments."""

    def choose(chooser: Callable) -> Callable:
        traced(function, chooser)
        return chooser

    return choose


def of_numbers(function: Callable) -> Callable:
    """The same for a chooser that knows nothing of lanes: they have choosers of their own."""

    def choose(chooser: Callable) -> Callable:
        @functools.wraps(chooser)
        def guarded(*arguments: Any) -> Callable | None:
            return None if lanes_of(arguments) else chooser(*arguments)

        by_type(function)(guarded)
        return chooser

    return choose


def shared(function: Callable | None = None, *, unless: Callable | None = None) -> Callable:
    """Mark a helper of point functions: kernels may call it. It may ask what its arguments are.

    For types of which ``unless(*types)`` holds, it is something else (:func:`by_type`).
    """
    if function is None:
        return lambda f: shared(f, unless=unless)

    def choose(*arguments: Any) -> Callable | None:
        return None if unless is not None and unless(*arguments) else function

    by_type(function)(choose)
    return function


def looping(function: Callable) -> Callable:
    """Mark a helper with a loop that is left to the compiler to unroll."""
    roll(function)
    return shared(function)


def one_by_one(function: Callable, count: int) -> Callable:
    """A function of `count` arguments, some in lanes, that does `function` for each lane."""
    names = "".join(f"a{k}, " for k in range(count))
    return define(names, f"return call(function, ({names}))", function=function, call=in_each_lane)


def in_each_lane(function: Callable, arguments: tuple) -> Any:
    """What a function of numbers gives for each lane among its arguments."""
    raise TypeError("only compiled kernels know lanes")


def point_function(*, tags: int = 1, otherwise: bool = False) -> Callable[[Callable], Callable]:
    """Declare a pure function of one point, selected by the classes of its first `tags` arguments.

    The decorated function gives name, parameters and docstring. Implementations are added with
    ``name.on(Class, ...)`` and serve both as plain Python (``NUMBA_DISABLE_JIT=1``, tests) and
    inside kernels, where the types are known at compile time and no branch is left. A plug-in adds
    its own in the same way. With ``otherwise`` what the decorated function does is for all others.

    Point functions serve one point or several at once (:mod:`karamelo_py.compiler.lanes`). Those
    that a class names in ``one_by_one``, since they branch, are called for one point after another.
    """

    def declare(stub: Callable) -> Callable:
        table: dict[tuple[type, ...], Callable] = {}
        fallback = stub if otherwise else None
        memo: dict[Any, Callable] = {}  # what was found before, for speed where interpreted

        def find(classes: tuple) -> Callable | None:
            return table.get(classes, fallback)

        def select(classes: tuple) -> Callable:
            chosen = find(classes)
            if chosen is None:
                raise Undefined(stub.__name__, classes)
            memo[classes if tags > 1 else classes[0]] = chosen
            return chosen

        if tags == 1:

            def plain(*arguments: Any) -> Any:
                kind = arguments[0].__class__
                return (memo.get(kind) or select((kind,)))(*arguments)
        else:

            def plain(*arguments: Any) -> Any:
                classes = tuple([a.__class__ for a in arguments[:tags]])
                return (memo.get(classes) or select(classes))(*arguments)

        def watched(*arguments: Any) -> Any:
            return run_for_kernel(dispatch, arguments) if at_work() else plain(*arguments)

        dispatch = plain if config.DISABLE_JIT else watched
        dispatch.__name__ = stub.__name__
        dispatch.__qualname__ = stub.__qualname__
        dispatch.__module__ = stub.__module__
        dispatch.__doc__ = stub.__doc__

        def choose(*arguments: Any) -> Callable | None:
            classes = tuple(tag_class(a) for a in arguments[:tags])
            found = find(classes)
            apart = any(stub.__name__ in getattr(tag, "one_by_one", ()) for tag in classes)
            if apart and lanes_of(arguments):
                return one_by_one(dispatch, len(arguments))
            return found

        by_type(dispatch)(choose)

        def on(*classes: type) -> Callable[[Callable], Callable]:
            def register(implementation: Callable) -> Callable:
                table[classes] = implementation
                memo.clear()
                forget()
                return implementation

            return register

        dispatch.tags = tags
        dispatch.find = find
        declare_point_function(dispatch)
        dispatch.on = on

        def defined(*classes: type) -> bool:
            note([(dispatch, classes)])
            return classes in table

        dispatch.defined = defined
        return dispatch

    return declare


def real(value: float, like: Any) -> Any:
    """`value` in the number type of `like`.

    In a kernel, a bare Python number next to a single-precision one makes the result double;
    every literal in a point function therefore passes through here (it costs nothing at run time).
    """
    return type(like)(value)


def lanes_of(numba_type: Any) -> int:
    """How many lanes a Numba type has (:mod:`karamelo_py.compiler.lanes`); 0 for numbers.

    Of tuples, those of what is in them.
    """
    if isinstance(numba_type, tuple | numba.types.BaseTuple):
        return max(map(lanes_of, numba_type), default=0)
    return getattr(numba_type, "width", 0)


@of_numbers(real)
def _real(value, like):
    if like is numba.types.float32:
        return lambda value, like: numba.float32(value)
    return lambda value, like: numba.float64(value)


def round_off(like: Any) -> Any:
    """The relative error of one operation, in the number type of `like`."""
    return type(like)(_ROUND_OFF.get(type(like).__name__, 2.0**-52))


_ROUND_OFF = {"float32": 2.0**-23}


@of_numbers(round_off)
def _round_off(like):
    if like is numba.types.float32:
        return lambda like: numba.float32(2.0**-23)
    return lambda like: numba.float64(2.0**-52)


def fma(a: float, b: float, c: float) -> float:
    """a b + c with one rounding, where compiled: always so, whatever surrounds it."""
    return a * b + c


@intrinsic
def _fused(typing_context, a, b, c):
    def codegen(context, builder, signature, arguments):
        return builder.fma(*arguments)

    return a(a, b, c), codegen


@of_numbers(fma)
def _fma(a, b, c):
    if a == b == c and isinstance(a, numba.types.Float):
        return lambda a, b, c: _fused(a, b, c)
    return lambda a, b, c: a * b + c


def choose(condition: bool, a: float, b: float) -> float:
    """`a` where `condition` holds, else `b`; both are computed, and nothing is branched over."""
    return a if condition else b


@by_type(choose)
def _choose(condition, a, b):
    return None if lanes_of(condition) else _one_of


def _one_of(condition: bool, a: float, b: float) -> float:
    return a if condition else b


OF_REALS |= {fma, choose}


def in_all(condition: bool) -> bool:
    """Whether a condition holds in all lanes; it itself where there are none."""
    return condition


of_numbers(in_all)(lambda condition: lambda condition: condition)


def in_any(condition: bool) -> bool:
    """Whether a condition holds in any lane; it itself where there are none."""
    return condition


of_numbers(in_any)(lambda condition: lambda condition: condition)


def of_present(p: int, value: float) -> float:
    """`value`, and 0 in the lanes of a group of points that have no point."""
    return value


of_numbers(of_present)(lambda p, value: lambda p, value: value)


class Weighted(NamedTuple):
    """Rows of an array in the place of one: read, their weighted sum; given to, each its share."""

    rows: tuple[int, ...]
    weights: tuple[float, ...]


def prefetch(array: Any, at: tuple) -> None:
    """Have the memory bring what a loop over groups of points reads soon behind an item."""


of_numbers(prefetch)(lambda array, at: lambda array, at: None)


def prefetch_records(array: Any, i: Any) -> None:
    """Have the memory bring the records some nodes behind those of number `i`, in lanes."""


of_numbers(prefetch_records)(lambda array, i: lambda array, i: None)


@shared(unless=lambda *kinds: lanes_of(kinds))
def accumulate(array: Any, i: int | Weighted, first: int, values: tuple) -> None:
    """array[i, first + k] += values[k], lane after lane."""
    if isinstance(i, Weighted):
        for one, weight in zip(i.rows, i.weights, strict=True):
            accumulate(array, one, first, tuple([weight * value for value in values]))
    else:
        for k, value in enumerate(values):
            array[i, first + k] += value


def largest(a: float) -> float:
    """The largest of the lanes; a number itself."""
    return a


of_numbers(largest)(lambda a: lambda a: a)


def added(total: float, value: float) -> float:
    """`total` + `value`, which may be in lanes: one after another, as numbers would be added."""
    return total + value


of_numbers(added)(lambda total, value: lambda total, value: total + value)


def first_failing(condition: bool) -> int:
    """The first lane in which a condition does not hold; 0 where there are none."""
    return 0


of_numbers(first_failing)(lambda condition: lambda condition: 0)


def is_one(number: int) -> bool:
    """Whether all lanes have the same number."""
    return True


of_numbers(is_one)(lambda number: lambda number: True)


def first_lane(number: int) -> int:
    """The number of the first lane; a number itself."""
    return number


of_numbers(first_lane)(lambda number: lambda number: number)


def index(i: int) -> int:
    """`i` as an array index that is known not to be negative.

    Saves Numba's test for indices counted from the end at every access (a tenth of a sweep).
    """
    return i


of_numbers(index)(lambda i: lambda i: numba.uint64(i))


def beside(first: int, steps: int) -> int:
    """`first` + `steps` as the number of a node: an array index, as `index` makes it.

    Of lanes it keeps the two apart: what is `steps` from the first node of each is found from the
    places of these.
    """
    return first + steps


of_numbers(beside)(lambda first, steps: lambda first, steps: numba.uint64(first + steps))


def over_blocks(per_block: Callable) -> Callable:
    """Make of ``f(block, setup, ...)`` an ``f(setup, ...)`` that does so for each of setup.blocks.

    The blocks have different types (one for each constitutive law), which a loop in a kernel cannot
    run over: the calls are written out once per number of blocks.
    """

    shared(per_block)

    @shared
    def loop(setup: Any, *arguments: Any) -> None:
        for block in setup.blocks:
            per_block(block, setup, *arguments)

    return loop


def define(parameters: str, *lines: str, **names: Any) -> Callable:
    """The function with these `parameters` and body `lines`, which may use `names`."""
    body = "\n    ".join(lines or ("pass",))
    text = f"def spelled({parameters}):\n    {body}"
    exec(compile(text, SPELLED, "exec"), names)
    made = names["spelled"]
    made.text = text  # for who walks through it
    return made
