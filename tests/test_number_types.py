"""A type of numbers of one's own goes through laws as they are: interpreted, and in kernels."""

import math
from collections import namedtuple

import numpy as np
import pytest
from numba import config

from karamelo_py.compiler import algebra, fma, implements, kernel, on_numbers, real, shared, where
from karamelo_py.compiler.powers import logarithm, logarithm_near_one
from karamelo_py.points.kinematics import PlaneStrain, Space
from karamelo_py.points.laws import advance, initial_state, kirchhoff_stress
from karamelo_py.points.laws.linear import LinearElastic
from karamelo_py.points.laws.neo_hookean import NeoHookean


@algebra
class Interval(namedtuple("Interval", "low high")):
    """All numbers between two."""

    __slots__ = ()
    __array_ufunc__ = None

    def __new__(cls, low, high=None):
        return super().__new__(cls, low, low if high is None else high)

    def __add__(self, other):
        if is_tensor(other):
            return NotImplemented
        low, high = ends(other)
        return Interval(self.low + low, self.high + high)

    __radd__ = __add__

    def __neg__(self):
        return Interval(-self.high, -self.low)

    def __sub__(self, other):
        return self + -other

    def __rsub__(self, other):
        return -self + other

    def __mul__(self, other):
        if is_tensor(other):
            return NotImplemented
        products = [a * b for a in self for b in ends(other)]
        return Interval(min(*products), max(*products))

    __rmul__ = __mul__

    def __rtruediv__(self, other):
        return other * Interval(1 / self.high, 1 / self.low)

    def __truediv__(self, other):
        low, high = ends(other)
        return self * Interval(1 / high, 1 / low)


def is_tensor(thing):
    """Whether it is a tuple, but no number."""
    return isinstance(thing, tuple) and not isinstance(thing, Interval)


def ends(number):
    """The ends of an interval; a number twice."""
    return tuple(number) if isinstance(number, Interval) else (number, number)


@implements(logarithm, Interval)
@implements(logarithm_near_one, Interval)
@implements(math.log, Interval)
def _log(x):
    return Interval(logarithm(x.low), logarithm(x.high))


@implements(math.sqrt, Interval)
def _sqrt(x):
    return Interval(math.sqrt(x.low), math.sqrt(x.high))


@implements(abs, Interval)
def _abs(x):
    least = where(x.low > 0, x.low, where(x.high < 0, -x.high, 0 * x.low))
    return Interval(least, max(-x.low, x.high))


@implements(fma, Interval)
def _fma(a, b, c):
    return a * b + c


@implements(real, Interval)
def _real(value, like):
    return value


@shared
def stress(law, kin, low, high):
    """Kirchhoff stress after an increment of which one component lies between two numbers."""
    n = len(kin.tensor_names)
    dl = kin.Tensor._make([Interval(low, high), *[0.01 * k for k in range(1, n)]])
    state = advance(law, kin, initial_state(law, kin, low), dl, 1.0)
    numbers = [ends(one) for one in kirchhoff_stress(law, kin, state)]
    return tuple([a for a, _ in numbers]), tuple([b for _, b in numbers])


LAWS = [LinearElastic(0.001, 300.0, 200.0), NeoHookean(0.001, 300.0, 200.0)]


@pytest.mark.parametrize("kin", [PlaneStrain(), Space()], ids=["plane", "space"])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_intervals_go_through_a_law(law, kin):
    low, high = on_numbers(stress)(law, kin, 0.02, 0.05)
    assert all(a <= b for a, b in zip(low, high, strict=True))
    assert any(a < b for a, b in zip(low, high, strict=True))
    for between in np.linspace(0.02, 0.05, 7):
        ((found, _),) = {on_numbers(stress)(law, kin, float(between), float(between))}
        assert np.all(np.array(low) <= np.array(found) + 1e-12)
        assert np.all(np.array(found) <= np.array(high) + 1e-12)


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize("kin", [PlaneStrain(), Space()], ids=["plane", "space"])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_kernels_know_them(law, kin):
    @kernel
    def bounds(law, kin, low, high):
        return stress(law, kin, low, high)

    expected = on_numbers(stress)(law, kin, 0.02, 0.05)
    assert np.allclose(bounds(law, kin, 0.02, 0.05), expected, rtol=1e-13, atol=1e-13)
