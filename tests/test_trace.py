"""Point functions that kernels run once and write down, and those that Numba compiles."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from numba import config
from numba.core import event
from numba.core.caching import NullCache

from karamelo_py.compiler import fingerprint
from karamelo_py.compiler.compile import (
    choose,
    fma,
    kernel,
    point_function,
    real,
    shared,
)
from karamelo_py.compiler.held import hold

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
def _(tag, x):
    return real(tag.factor, x) * x * x


@value_of.on(Root)
def _(tag, x):
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
    return least, most, whole, math.sqrt(most), choose(a > b, a, b), fma(a, b, real(1, a))


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


class Compiled(event.Listener):
    """The names of the functions that Numba compiles."""

    def __init__(self):
        self.names = []

    def on_start(self, event):
        self.names.append(event.data["dispatcher"].py_func.__name__)

    def on_end(self, event):
        """Nothing more."""


def compiled_for(function, *arguments):
    """What a kernel gives, and the functions of this file that were compiled beside it."""
    listener = Compiled()
    made = kernel(function)
    made._cache = NullCache()
    with event.install_listener("numba:compile", listener):
        result = made(*arguments)
    return result, listener.names[1:]


def test_what_has_no_branch_is_run_and_not_compiled():
    def caller(tag, x):
        return value_of(tag, x) + third_power(x)

    result, compiled = compiled_for(caller, Square(3.0), 2.0)
    assert result == 3 * 4 + 8
    assert compiled == []


def test_what_branches_is_compiled():
    def caller(tag, x):
        return value_of(tag, x)

    result, compiled = compiled_for(caller, Root(3.0), 4.0)
    assert result == 6
    assert "_" in compiled
    assert compiled_for(caller, Root(3.0), -4.0)[0] == 0


def test_numbers_keep_their_precision():
    def caller(tag, x):
        return value_of(tag, x)

    made = kernel(caller)
    single = made(Square(0.1), np.float32(3))
    assert np.float32(single) == np.float32(np.float32(0.1) * np.float32(3)) * np.float32(3)
    (signature,) = made.signatures
    assert made.overloads[signature].signature.return_type.bitwidth == 32


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


def test_what_was_run_is_followed(tmp_path, monkeypatch):
    """The key of a kernel on disk knows the functions that it was made of."""
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))

    def caller(tag, x):
        return value_of(tag, third_power(x))

    made = kernel(caller)
    made(Square(1.0), 2.0)
    (compiled,) = made.overloads.values()
    choices, codes = fingerprint.contents(compiled.library)
    assert fingerprint.Choice(f"{__name__}:value_of", (f"{__name__}:Square",)) in choices
    assert {third_power.__code__, pairs.__code__} <= codes


def test_a_mistake_is_told_by_numba():
    def caller(x):
        return nth(x, 0)

    with pytest.raises(Exception, match="nth"):
        kernel(caller)(1.0)
