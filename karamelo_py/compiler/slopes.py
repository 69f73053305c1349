"""Dual numbers: a value and its derivatives, in forward mode.

Point functions of dual numbers return exact derivatives (Griewank & Walther 2008, "Evaluating
Derivatives", chapter 3); for the stress of a law this is the consistent tangent. Values are
identical to those computed without derivatives. Slopes that are the literal 0 make no code.
"""

import math
from collections import namedtuple
from collections.abc import Callable
from typing import Any

from karamelo_py.compiler.powers import exponential, logarithm, logarithm_near_one, power
from karamelo_py.compiler.trace.algebra import algebra
from karamelo_py.compiler.trace.primitives import fma, implements, real, round_off, where
from karamelo_py.compiler.trace.values import is_literal, rebuilt


@algebra
class Dual(namedtuple("Dual", "value slopes")):
    """A number and its derivatives; derivatives may be literal zeros."""

    __slots__ = ()
    __array_ufunc__ = None  # NumPy leaves operations to this class

    def constant(self, value: Any) -> "Dual":
        return Dual(value, (0,) * len(self.slopes))

    def chain(self, value: Any, slope: Any) -> "Dual":
        """Return a function of this number, given the function's value and derivative."""
        return Dual(value, tuple([times(slope, s) for s in self.slopes]))

    def __add__(self, other):
        if is_tensor(other):
            return NotImplemented
        return combined(self.value + value_of(other), 1, self, 1, other)

    __radd__ = __add__

    def __sub__(self, other):
        if is_tensor(other):
            return NotImplemented
        return combined(self.value - value_of(other), 1, self, -1, other)

    def __rsub__(self, other):
        return combined(other - self.value, 1, other, -1, self)

    def __neg__(self):
        return Dual(-self.value, tuple([times(-1, s) for s in self.slopes]))

    def __mul__(self, other):
        if is_tensor(other):
            return NotImplemented
        y = value_of(other)
        return combined(self.value * y, y, self, self.value, other)

    __rmul__ = __mul__

    def __truediv__(self, other):
        if is_tensor(other):
            return NotImplemented
        y = value_of(other)
        quotient, inverse = self.value / y, 1 / y
        return combined(quotient, inverse, self, -quotient * inverse, other)

    def __rtruediv__(self, other):
        quotient = other / self.value
        return self.chain(quotient, -quotient / self.value)

    def __pow__(self, other):
        if type(other) is int and 1 <= other <= 4:  # right also for a negative base
            square = self * self
            return (self, square, square * self, square * square)[other - 1]
        return _raised(self, other, self.value ** value_of(other))

    def __rpow__(self, other):
        return _raised(other, self, other**self.value)

    def __abs__(self):
        return _abs(self)

    def __lt__(self, other):
        return self.value < value_of(other)

    def __le__(self, other):
        return self.value <= value_of(other)

    def __gt__(self, other):
        return self.value > value_of(other)

    def __ge__(self, other):
        return self.value >= value_of(other)

    def __eq__(self, other):
        return self.value == value_of(other)

    def __ne__(self, other):
        return self.value != value_of(other)

    __hash__ = None


def is_tensor(thing: Any) -> bool:
    return isinstance(thing, tuple) and not isinstance(thing, Dual)


def value_of(x: Any) -> Any:
    if isinstance(x, Dual):
        return x.value
    if isinstance(x, tuple):
        return rebuilt(x, [value_of(item) for item in x])
    return x


def slopes_of(x: Any, n: int) -> tuple:
    return x.slopes if isinstance(x, Dual) else (0,) * n


def seeded(numbers: tuple) -> Any:
    """Make numbers the independent variables; tensors retain their class."""
    n = range(len(numbers))
    made = [
        Dual(x, tuple([1 if i == k else 0 for i in n])) for k, x in zip(n, numbers, strict=True)
    ]
    return rebuilt(numbers, made)


def is_zero(slope: Any) -> bool:
    return is_literal(slope) and slope == 0


def times(factor: Any, slope: Any) -> Any:
    """Multiply a slope; factors 1 and -1 write no code."""
    if is_zero(slope):
        return 0
    if is_literal(factor) and abs(factor) == 1:
        return slope if factor == 1 else -slope
    if is_literal(slope) and slope == 1:
        return factor
    return factor * slope


def combined(value: Any, a: Any, x: Any, b: Any, y: Any) -> Dual:
    """Return the number with this `value` and the slopes a x' + b y'."""
    n = len(x.slopes) if isinstance(x, Dual) else len(y.slopes)
    slopes = []
    for s, t in zip(slopes_of(x, n), slopes_of(y, n), strict=True):
        if is_zero(s) or is_zero(t):
            slopes.append(times(a, s) if is_zero(t) else times(b, t))
        else:
            slopes.append(times(a, s) + times(b, t))
    return Dual(value, tuple(slopes))


def size_of(*things: Any) -> int:
    for x in things:
        if isinstance(x, Dual):
            return len(x.slopes)
    return 0


@implements(math.sqrt, Dual)
def _sqrt(x):
    root = math.sqrt(x.value)
    some = root > 0
    # At 0 the slope is infinite; 0 is correct for norms.
    return x.chain(root, where(some, 0.5 / where(some, root, 1), 0))


def elementary(function: Callable, slope: Callable, *others: Callable) -> Callable:
    """Define the derivative of a function, and of equivalent `others`: ``slope(x, f)`` at f(x)."""

    def of_dual(x: Dual) -> Dual:
        value = function(x.value)
        return x.chain(value, slope(x.value, value))

    for one in (function, *others):
        implements(one, Dual)(of_dual)
    return of_dual


def _inverse(x):
    return where(x > 0, 1 / where(x > 0, x, 1), 0)


elementary(logarithm, lambda x, f: 1 / x, math.log)
elementary(logarithm_near_one, lambda x, f: 1 / x)
elementary(exponential, lambda x, f: f, math.exp)
elementary(math.sin, lambda x, f: math.cos(x))
elementary(math.cos, lambda x, f: -math.sin(x))
elementary(math.tan, lambda x, f: 1 + f * f)
elementary(math.atan, lambda x, f: 1 / (1 + x * x))
elementary(math.tanh, lambda x, f: 1 - f * f)
elementary(math.asin, lambda x, f: _inverse(math.sqrt(1 - x * x)))
elementary(math.acos, lambda x, f: -_inverse(math.sqrt(1 - x * x)))
elementary(math.sinh, lambda x, f: math.cosh(x))
elementary(math.cosh, lambda x, f: math.sinh(x))
elementary(math.asinh, lambda x, f: 1 / math.sqrt(1 + x * x))
elementary(math.acosh, lambda x, f: _inverse(math.sqrt(x * x - 1)))
elementary(math.atanh, lambda x, f: 1 / (1 - x * x))
elementary(math.log1p, lambda x, f: 1 / (1 + x))
elementary(math.expm1, lambda x, f: 1 + f)
elementary(math.log2, lambda x, f: 1 / (x * math.log(2)))
elementary(math.log10, lambda x, f: 1 / (x * math.log(10)))
elementary(math.exp2, lambda x, f: f * math.log(2))
elementary(math.cbrt, lambda x, f: where(x == 0, 0, f / where(x == 0, 1, 3 * x)))
elementary(math.erf, lambda x, f: 2 / math.sqrt(math.pi) * math.exp(-x * x))
elementary(math.erfc, lambda x, f: -2 / math.sqrt(math.pi) * math.exp(-x * x))
elementary(math.degrees, lambda x, f: 180 / math.pi)
elementary(math.radians, lambda x, f: math.pi / 180)
_abs = elementary(abs, lambda x, f: where(x < 0, -1, 1), math.fabs)


@implements(math.atan2, Dual)
def _atan2(y, x):
    a, b = value_of(y), value_of(x)
    square = a * a + b * b
    over = where(square > 0, square, 1)
    return combined(math.atan2(a, b), b / over, y, -a / over, x)


@implements(math.hypot, Dual)
def _hypot(x, y):
    a, b = value_of(x), value_of(y)
    made = math.hypot(a, b)
    over = where(made > 0, made, 1)  # the slope is 0 at 0, as for norms
    return combined(made, a / over, x, b / over, y)


@implements(math.copysign, Dual)
def _copysign(x, y):
    a, b = value_of(x), value_of(y)
    made = math.copysign(a, b)
    if not isinstance(x, Dual):
        return y.constant(made)
    return x.chain(made, math.copysign(1.0, a) * math.copysign(1.0, b))


@implements(math.fmod, Dual)
def _fmod(x, y):
    a, b = value_of(x), value_of(y)
    rest = math.fmod(a, b)
    return combined(rest, 1, x, (rest - a) / b, y)


@implements(math.pow, Dual)
def _pow(x, y):
    return _raised(x, y, math.pow(value_of(x), value_of(y)))


# Functions with slope 0, or without a real result.
for _one in (math.floor, math.ceil, math.trunc, math.isnan, math.isinf, math.isfinite):
    implements(_one, Dual)(lambda x, do=_one: do(x.value))


class NoSlope(TypeError):
    pass


def _refused(*functions: Callable) -> None:
    for one in functions:

        def refuse(*_, name=one.__name__):
            raise NoSlope(f"math.{name}")

        implements(one, Dual)(refuse)


_refused(math.gamma, math.lgamma, math.frexp, math.ldexp)


@implements(power, Dual)
@implements(pow, Dual)
def _power(x, y):
    return _raised(x, y, power(value_of(x), value_of(y)))


def _raised(x, y, made):
    """Add slopes to the power `made`: 0 for base 0, except for exponent 1."""
    base, exponent = value_of(x), value_of(y)
    above = base > 0
    some = base != 0  # a negative base needs an integer exponent
    over = where(some, base, 1)
    alone = where(exponent == 1, 1, 0) if not is_literal(exponent) else int(exponent == 1)
    return combined(
        made,
        where(some, exponent * made / over, alone) if isinstance(x, Dual) else 0,
        x,
        where(above, made * logarithm(where(above, base, 1)), 0) if isinstance(y, Dual) else 0,
        y,
    )


@implements(real, Dual)
def _real(value, template):
    return real(value, template.value)


@implements(round_off, Dual)
def _round_off(template):
    return round_off(template.value)


@implements(fma, Dual)
def _fma(a, b, c):
    x, y = value_of(a), value_of(b)
    n = size_of(a, b, c)
    product = combined(0, y, a, x, b) if size_of(a, b) else Dual(0, (0,) * n)
    return combined(fma(x, y, value_of(c)), 1, product, 1, c)


@implements(where, Dual)
def _where(condition, a, b):
    if is_tensor(a):
        return rebuilt(a, [where(condition, x, y) for x, y in zip(a, b, strict=True)])
    n = size_of(a, b)
    if n == 0:
        return where(condition, a, b)
    pairs = zip(slopes_of(a, n), slopes_of(b, n), strict=True)
    slopes = [0 if is_zero(s) and is_zero(t) else where(condition, s, t) for s, t in pairs]
    return Dual(where(condition, value_of(a), value_of(b)), tuple(slopes))


@implements(max, Dual)
def _max(*numbers):
    best = numbers[0]
    for x in numbers[1:]:
        best = where(value_of(x) > value_of(best), x, best)
    return best


@implements(min, Dual)
def _min(*numbers):
    best = numbers[0]
    for x in numbers[1:]:
        best = where(value_of(x) < value_of(best), x, best)
    return best
