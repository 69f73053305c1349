"""Operations of kernels on numbers of every type give what Python gives."""

import ctypes
import math
import operator
from itertools import product

import numpy as np
import pytest
from numba import config

from karamelo_py.compiler import kernel
from karamelo_py.compiler.code.exceptions import Failure, noting

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")

TYPES = [np.bool_, np.int32, np.int64, np.uint32, np.uint64, np.float32, np.float64]
FLAGS = np.array([True, False, True])
COMPARISONS = (operator.eq, operator.ne, operator.lt, operator.le, operator.gt, operator.ge)


@kernel
def _compared(a, b, out):
    out[0] = a[0] == b[0]
    out[1] = a[0] != b[0]
    out[2] = a[0] < b[0]
    out[3] = a[0] <= b[0]
    out[4] = a[0] > b[0]
    out[5] = a[0] >= b[0]


@kernel
def _powers(x, k):
    return x**2, x**3, x**4, x**5, x**-2, k**3, math.pow(k, 3), math.pow(k, x)


@kernel
def _flag(k, out):
    out[0] = FLAGS[k]


@kernel
def _same(number):
    return number


def values(kind):
    """Some numbers of a type, negative where it has these."""
    signed = issubclass(kind, (np.signedinteger, np.floating))
    return [np.array([x]).astype(kind) for x in ((-2, 0, 1, 3) if signed else (0, 1, 3))]


@pytest.mark.parametrize("first, second", list(product(TYPES, TYPES)))
def test_comparisons(first, second):
    """Truth values count as 0 and 1, and negative numbers are below all without a sign."""
    out = np.zeros(6, np.bool_)
    for a, b in product(values(first), values(second)):
        _compared(a, b, out)
        assert out.tolist() == [holds(a.item(), b.item()) for holds in COMPARISONS]


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_powers(kind):
    """Those of known exponents are products; `math.pow` gives a real number."""
    x = 1.5
    expected = [x**2, x**3, x**4, x**5, x**-2, 27, 27.0, 3**x]
    found = _powers(kind(x), 3)
    assert found == pytest.approx(expected, rel=1e-6)
    assert [type(number) for number in found[-3:]] == [int, float, float]


def test_truth_values_that_are_part_of_the_code():
    out = np.zeros(1, np.bool_)
    found = []
    for k in range(3):
        _flag(k, out)
        found.append(bool(out[0]))
    assert found == FLAGS.tolist()


@pytest.mark.parametrize("number", [np.uint8(200), np.uint32(2**31), np.uint64(2**63), True, -3])
def test_numbers_come_back_as_they_went(number):
    assert _same(number) == number


def test_what_kernels_call_raises_behind_them():
    """Python drops what is raised in a function that machine code calls, Ctrl-C too."""

    def interrupted(number):
        raise KeyboardInterrupt

    failure = Failure()
    assert noting(interrupted)(1, ctypes.addressof(failure)) == 0
    with pytest.raises(KeyboardInterrupt):
        failure.raise_first()
    failure.raise_first()  # nothing more
