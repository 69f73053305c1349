"""Point functions that kernels run once and write down, and those that they refuse."""

import contextlib
import ctypes
import math
from typing import NamedTuple

import numpy as np
import pytest
from listening import listening
from numba import config, typeof, types

from karamelo_py.compiler import (
    CannotCompile,
    address_of,
    fma,
    hold,
    implements,
    kernel,
    point_function,
    real,
    shared,
    where,
)
from karamelo_py.compiler.trace.functions import forget
from karamelo_py.compiler.trace.held import held_type, text_with_types
from karamelo_py.compiler.trace.kernels import written
from karamelo_py.compiler.trace.lowering import Lowering
from karamelo_py.compiler.trace.values import in_one
from karamelo_py.language.faults import cause_of, place_in

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")


class Square(NamedTuple):
    factor: float


class Root(NamedTuple):
    factor: float


class Pair(NamedTuple):
    first: float
    second: float


class Arrays(NamedTuple):
    x: np.ndarray
    out: np.ndarray


@point_function()
def value_of(tag, x):
    """A number of x."""


@value_of.on(Square)
def _value_of_square(tag, x):
    return real(tag.factor, x) * x * x


@value_of.on(Root)
def _value_of_root(tag, x):
    if x > 0:  # only a run knows
        return tag.factor * math.sqrt(x)
    return 0.0


@shared
def pairs(numbers, *others):
    """Pairs of the items of two tuples, or nothing."""
    return tuple(Pair(a, b) for a, b in zip(numbers, others, strict=True)) if others else ()


@shared
def third_power(x):
    """x to the power of three, by way of pairs."""
    (pair,) = pairs((x * x,), x)
    return pair.first * pair.second


@shared
def extremes(a, b):
    """Functions of Python and of the library, of numbers."""
    least, most = min(a, b), max(abs(a), abs(b))
    whole = int(most) + 2 // 1
    return least, most, whole, math.sqrt(most), where(a > b, a, b), fma(a, b, real(1, a))


@shared
def put(arrays, k):
    """Twice the k-th number."""
    arrays.out[k] = 2 * arrays.x[k]
    return arrays.x.shape[0]


@shared
def nth(items, n):
    """One item of a tuple; which must be known when the kernel is compiled."""
    return items[n]


def adder(increment):
    """A function that knows `increment`."""

    @shared
    def add(x):
        return x + increment

    return add


two_more = adder(2)
KINDS = typeof(Root(2.0)), types.float64


def compiled_for(function, *arguments):
    """What a kernel gives, and the functions of this file that were compiled beside it."""
    made = kernel(function)
    with listening() as names:
        result = made(*arguments)
    return result, names[1:]


def test_what_has_no_branch_is_run_and_not_compiled():
    def caller(tag, x):
        return value_of(tag, x) + third_power(x)

    result, compiled = compiled_for(caller, Square(3.0), 2.0)
    assert result == 3 * 4 + 8
    assert compiled == []


def test_what_branches_is_walked_through():
    def caller(tag, x):
        return value_of(tag, x)

    result, compiled = compiled_for(caller, Root(3.0), 4.0)
    assert result == 6
    assert compiled == []
    assert compiled_for(caller, Root(3.0), -4.0)[0] == 0


def test_numbers_keep_their_precision():
    def caller(tag, x):
        return value_of(tag, x)

    made = kernel(caller)
    single = made(Square(0.1), np.float32(3))
    assert np.float32(single) == np.float32(np.float32(0.1) * np.float32(3)) * np.float32(3)
    (unit,) = made.units.values()
    assert unit.result.bitwidth == 32


@pytest.mark.parametrize(("a", "b"), [(1.5, -3.25), (-0.5, 0.25), (2.0, 2.0)])
def test_functions_of_numbers(a, b):
    def caller(a, b):
        return extremes(a, b)

    most = max(abs(a), abs(b))
    expected = (min(a, b), most, int(most) + 2, math.sqrt(most), max(a, b), a * b + 1)
    assert kernel(caller)(a, b) == expected
    assert extremes(a, b) == expected


def test_arrays_are_read_and_written_also_held():
    def caller(arrays):
        return put(arrays, 1) + put(hold(arrays), 2)

    arrays = Arrays(np.arange(3.0), np.zeros(3))
    assert kernel(caller)(arrays) == 6
    assert arrays.out.tolist() == [0, 2, 4]


def test_what_is_known_when_it_is_compiled():
    def caller(x):
        return nth((x, 2 * x), 1), two_more(x)

    assert kernel(caller)(1.5) == (3.0, 3.5)


def test_loops_of_kernels_call_what_is_written_down():
    def caller(arrays):
        put(arrays, 0)
        for k in range(2):
            put(arrays, k)

    arrays = Arrays(np.arange(3.0), np.zeros(3))
    kernel(caller)(arrays)
    assert arrays.out.tolist() == [0, 2, 0]


def test_a_mistake_is_told():
    def caller(x):
        return nth(x, 0)

    with pytest.raises(Exception, match="nth"):
        kernel(caller)(1.0)


@shared
def told(x):
    """A text with a number in it, behind a branch."""
    if x > 0:
        return len(f"{x}")
    return -x


def test_a_function_that_cannot_be_compiled_is_named():
    def caller(x):
        return told(x)

    with pytest.raises(CannotCompile) as raised:
        kernel(caller)(1.0)
    assert cause_of(raised.value) == (
        "it cannot be compiled: kernels do not support text with numbers in it (in told), "
        "in 'return len(f\"{x}\")'"
    )
    assert place_in(told, raised.value) == f" (test_trace.py:{told.__code__.co_firstlineno + 4})"


@shared
def without_end(x):
    """A function that calls itself."""
    return without_end(x)


@shared
def misspelt(x):
    """A name that nothing has."""
    return sqroot(x)  # noqa: F821


@pytest.mark.parametrize(
    ("function", "reason"),
    [
        (without_end, r"it calls itself \(in without_end\)"),
        (misspelt, "NameError: name 'sqroot' is not defined"),
    ],
)
def test_the_reason_is_told(function, reason):
    def caller(x):
        return function(x)

    with pytest.raises(CannotCompile, match=reason):
        kernel(caller)(1.0)


@shared
def caught(x):
    """What asks for what only a run can know, and catches what comes of it."""
    try:
        return 1.0 if x > 0 else 2.0
    except Exception:
        return -1.0


@shared
def kinds_of(x, y):
    """What Python knows of numbers, and kernels do not."""
    return 1.0 if isinstance(x, float) or type(x) is type(y) else 2.0


@shared
def looked_up(n):
    """A number among others."""
    return 1.0 if n in {1, 2} else 2.0


class Weight(NamedTuple):
    """A tag with a method, and an operator, of its own."""

    factor: float

    def times(self, x):
        return self.factor * math.sqrt(x * x) if x > 0 else x


class Sum(NamedTuple):
    number: float

    def __add__(self, other):
        return Sum(self.number + other.number)


@shared
def weighed(weight, x):
    """By a method."""
    return weight.times(x)


@shared
def together(a, b):
    """By an operator of their own."""
    return a + b


@shared
def imported(x):
    """What no key of a kernel knows."""
    from math import tau

    return tau * x


def test_a_number_is_looked_for_among_others():
    def caller(n):
        return looked_up(n)

    assert [kernel(caller)(n) for n in (1, 2, 3, -1)] == [1.0, 1.0, 2.0, 2.0]


@pytest.mark.parametrize(
    ("function", "arguments", "reason"),
    [
        (caught, (1.0,), "do not support `try` or `with`"),
        (kinds_of, (1.0, 2), "ask for the type of a number"),
        (imported, (1.0,), "do not support `import` within a function"),
    ],
)
def test_what_nothing_follows_is_refused(function, arguments, reason):
    def caller(*arguments):
        return function(*arguments)

    with pytest.raises(CannotCompile, match=reason):
        kernel(caller)(*arguments)


def through(function):
    """A function that calls another."""
    return lambda *arguments: function(*arguments)


def test_methods_of_tuples():
    """Also where functions call them that lie in the closures of others."""

    def heavier(weight, x):
        return weight.times(x) + weighed(weight, x)

    assert kernel(through(through(heavier)))(Weight(2.0), 3.0) == 12.0
    assert kernel(lambda a, b: together(a, b))(Sum(1.0), Sum(2.0)) == Sum(3.0)


@shared
def spelled(x, unit="mm"):
    """A text of what is known."""
    return x * len(f"{unit!r:>5} {x is None}")


def test_a_text_of_what_is_known():
    assert kernel(lambda x: spelled(x))(2.0) == 2.0 * len("'mm'  ") + 2.0 * len("False")


class Clock:
    """Let Ctrl-C come at a moment; a signature, of which Python code makes hashes, too."""

    left = 0

    def __hash__(self):
        self.tick()
        return 1

    def tick(self):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


def test_an_interrupt_leaves_nothing_behind(monkeypatch):
    """Ctrl-C at any operation of a function, and whenever formulas are looked for or kept."""

    def caller(tag, x):
        return value_of(tag, x) + third_power(x)

    clock, call = Clock(), Lowering.call
    monkeypatch.setattr(Lowering, "call", lambda *given: clock.tick() or call(*given))
    with in_one({clock: caller}):
        texts = {str(written(caller, KINDS)[0])}
        for moment in range(1, -clock.left):
            forget()
            clock.left = moment
            with contextlib.suppress(KeyboardInterrupt):
                written(caller, KINDS)
            clock.left = 0
            texts.add(str(written(caller, KINDS)[0]))
    assert len(texts) == 1


def test_an_address_is_that_of_a_signature():
    def doubled(x):
        return x + x

    kinds = types.float64, types.float32
    addresses = [address_of(doubled, kind(kind)) for kind in kinds]
    for address, number in zip(addresses, (ctypes.c_double, ctypes.c_float), strict=True):
        assert ctypes.CFUNCTYPE(number, number)(address)(0.1) == 2 * number(0.1).value


def test_constants_are_what_the_compiler_makes_of_them():
    """A formula of numbers that are known has the bits of one of numbers that a run knows."""

    def formula(x):
        return real(0.1, x) * 3 * x + x / math.sqrt(real(3, x)) + fma(0.1, 10.0, -1.0)

    run = shared(formula)
    known, found = kernel(lambda: run(1.7)), kernel(lambda x: run(x))
    assert known() == found(1.7)


def test_another_implementation_is_seen():
    @point_function(otherwise=True)
    def late(tag, x):
        """What comes later."""
        return x

    def caller(tag, x):
        return late(tag, x)

    assert compiled_for(caller, Square(1.0), 2.0)[0] == 2
    late.on(Square)(lambda tag, x: 3 * x)
    assert compiled_for(caller, Square(1.0), 2.0)[0] == 6

    def plain(x):
        return x

    for found in (2, 6):
        assert compiled_for(lambda x: plain(x), 2.0)[0] == found
        implements(plain)(lambda x: 3 * x)


def test_tags_without_numbers():
    def caller(x):
        return sized(Empty(), x)

    assert kernel(caller)(2.0) == 6


class Empty(NamedTuple):
    """A tag without numbers."""


@point_function()
def size_of(tag):
    """How many."""


@size_of.on(Empty)
def _size_of_empty(tag):
    return 3


@shared
def sized(tag, x):
    """As many x."""
    return sum([x] * size_of(tag))


class Half(NamedTuple):
    x: np.ndarray


class Many(NamedTuple):
    halves: tuple
    out: np.ndarray


@kernel
def _sum_halves(many):
    for k, half in enumerate(many.halves):
        for other in many.halves:
            many.out[0] += (1 + k) * half.x[0] + other.x[0]


def test_a_loop_over_many_alike_tuples_remains_a_loop():
    lengths = []
    for count in (3, 40):
        many = hold(Many(tuple(Half(np.array([float(k)])) for k in range(count)), np.zeros(1)))
        _sum_halves(many)
        x = np.arange(count)
        assert many.out[0] == count * ((1 + x) * x).sum() + count * x.sum()
        kinds = (held_type(typeof(many)),)
        text = text_with_types(written(_sum_halves.function, kinds)[0])
        lengths.append(len(text.split("define")[1].splitlines()))
    assert lengths[0] == lengths[1]
