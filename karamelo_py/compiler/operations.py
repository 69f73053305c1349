"""The operations of formulas: their numbers, and what they do in kernels and in NumPy."""

import math
import operator
from collections.abc import Callable

import numpy as np

from karamelo_py.compiler.compile import implements
from karamelo_py.compiler.loops import noinline


@noinline
def _whole(a, down, up):
    """A number rounded to a whole one; by sums, which every processor has."""
    if not abs(a) < 2.0**52:
        return a  # whole, or no number
    far = math.copysign(2.0**52, a)
    near = (a + far) - far
    if near > a and down:
        near -= 1.0
    elif near < a and up:
        near += 1.0
    return math.copysign(near, a)  # -0.0 too


def _not(a):
    return 1.0 if a == 0.0 else 0.0


def _sign(a):
    return 1.0 if a > 0.0 else (-1.0 if a < 0.0 else a)


def _step(a):
    return 0.0 if a < 0.0 else (1.0 if a >= 0.0 else a)


def _and(a, b):
    return 1.0 if (a != 0.0) and (b != 0.0) else 0.0


def _or(a, b):
    return 1.0 if (a != 0.0) or (b != 0.0) else 0.0


def _min(a, b):
    return b if b < a else a


def _max(a, b):
    return b if b > a else a


def _truth(compare: Callable) -> Callable:
    """A comparison that gives 1.0 or 0.0."""

    def truth(a, b):
        return 1.0 if compare(a, b) else 0.0

    return truth


def _each(function: Callable, nan: float = math.nan) -> Callable:
    """`function` of the standard library for arrays, NaN where it refuses."""

    def safe(value):
        try:
            return function(value)
        except ValueError:
            return math.inf if value == 0.0 else nan
        except OverflowError:
            return math.inf

    return np.vectorize(safe, otypes=[float])


# What they do to a number in kernels, and to arrays of them in NumPy.
UNARY = {
    "neg": (operator.neg, np.negative),
    "not": (_not, lambda a: (a == 0.0) * 1.0),
    "abs": (abs, np.abs),
    "sign": (_sign, np.sign),
    "step": (_step, lambda a: np.where(np.isnan(a), a, (a >= 0.0) * 1.0)),
    "sqrt": (math.sqrt, np.sqrt),
    "cbrt": (lambda a: math.copysign(math.pow(abs(a), 1.0 / 3.0), a), np.cbrt),
    "exp": (math.exp, np.exp),
    "log": (math.log, np.log),
    "log10": (math.log10, np.log10),
    "log2": (math.log2, np.log2),
    "sin": (math.sin, np.sin),
    "cos": (math.cos, np.cos),
    "tan": (math.tan, np.tan),
    "asin": (math.asin, np.arcsin),
    "acos": (math.acos, np.arccos),
    "atan": (math.atan, np.arctan),
    "sinh": (math.sinh, np.sinh),
    "cosh": (math.cosh, np.cosh),
    "tanh": (math.tanh, np.tanh),
    "asinh": (math.asinh, np.arcsinh),
    "acosh": (math.acosh, np.arccosh),
    "atanh": (math.atanh, np.arctanh),
    "erf": (math.erf, _each(math.erf)),
    "erfc": (math.erfc, _each(math.erfc)),
    "gamma": (math.gamma, _each(math.gamma)),
    "lgamma": (math.lgamma, _each(math.lgamma, nan=math.inf)),
    "expm1": (math.expm1, np.expm1),
    "log1p": (math.log1p, np.log1p),
    "floor": (lambda a: _whole(a, True, False), np.floor),
    "ceil": (lambda a: _whole(a, False, True), np.ceil),
    "round": (lambda a: _whole(a, False, False), np.rint),
    "trunc": (lambda a: _whole(a, a > 0.0, a < 0.0), np.trunc),
}
BINARY = {
    "+": (operator.add, np.add),
    "-": (operator.sub, np.subtract),
    "*": (operator.mul, np.multiply),
    "/": (operator.truediv, np.divide),
    "^": (math.pow, np.power),
    "%": (operator.mod, np.mod),  # the sign of the divisor, as in Python
    "<": (_truth(operator.lt), np.less),
    "<=": (_truth(operator.le), np.less_equal),
    ">": (_truth(operator.gt), np.greater),
    ">=": (_truth(operator.ge), np.greater_equal),
    "==": (_truth(operator.eq), np.equal),
    "!=": (_truth(operator.ne), np.not_equal),
    "&&": (_and, lambda a, b: (a != 0.0) & (b != 0.0)),
    "||": (_or, lambda a, b: (a != 0.0) | (b != 0.0)),
    "min": (_min, lambda a, b: np.where(b < a, b, a)),
    "max": (_max, lambda a, b: np.where(b > a, b, a)),
    "atan2": (math.atan2, np.arctan2),
    "hypot": (math.hypot, np.hypot),
}

FIRST_UNARY, FIRST_BINARY, SELECT = 4, 64, 128
OPERATIONS = (
    {name: FIRST_UNARY + k for k, name in enumerate(UNARY)}
    | {name: FIRST_BINARY + k for k, name in enumerate(BINARY)}
    | {"if": SELECT}
)
IN_NUMPY = {OPERATIONS[name]: function for name, (_, function) in (UNARY | BINARY).items()}


def in_kernels(*names: str) -> tuple[tuple[int, Callable], ...]:
    """The numbers of some operations, and what they are in kernels."""
    return tuple((OPERATIONS[name], (UNARY | BINARY)[name][0]) for name in names)


_UNARY_IN_KERNELS = in_kernels(*UNARY)
_BINARY_IN_KERNELS = in_kernels(*BINARY)


def of_one(op, a):
    """The function `op` of one number; inf or NaN where there is no result."""
    with np.errstate(all="ignore"):
        return float(IN_NUMPY[op](a))


@implements(of_one)
@noinline
def function_of(op, a):
    """Any function of one number: one chain of choices, where a loop for each would be too much."""
    for number, do in _UNARY_IN_KERNELS:
        if op == number:
            return do(a)
    return a


def of_two(op, a, b):
    """The operation `op` on two numbers likewise."""
    with np.errstate(all="ignore"):
        return float(IN_NUMPY[op](np.float64(a), b))


@implements(of_two)
@noinline
def operation_of(op, a, b):
    """Any operation on two numbers: comparisons and logical ones give 1.0 or 0.0."""
    for number, do in _BINARY_IN_KERNELS:
        if op == number:
            return do(a, b)
    return a
