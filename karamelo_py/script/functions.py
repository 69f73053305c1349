"""The functions of the script language, for plain numbers.

The same functions for many points at once are in :mod:`karamelo_py.compiler.formula`.
"""

import math
import operator
import statistics
from collections.abc import Callable
from typing import NamedTuple

# Pi, the golden ratio, and Euler's constant.
CONSTANTS = {"PI": math.pi, "PHI": (1 + math.sqrt(5)) / 2, "EGAMMA": 0.57721566490153286}
# Words that look like names but mean something to particular commands only.
WORDS = frozenset({"NULL", "INF", "EDGE"})
# Functions whose names no variable may have; other names of functions were free in Karamelo.
RESERVED = frozenset({"exp", "sqrt", "cos", "sin", "tan", "atan2", "log", "if"})
# The tails of the normal distribution that inv_norm leaves out, on each side.
TAIL = 1e-10


class Signature(NamedTuple):
    """The number of operands of a function, and the code that computes it."""

    least: int
    most: int
    compute: Callable[..., float]


def _inv_norm(a: float) -> float:
    if not TAIL <= a <= 1 - TAIL:
        raise ValueError("outside of the domain")
    return statistics.NormalDist().inv_cdf(a)


_OF_ONE = """sqrt exp expm1 log log10 log2 log1p sin cos tan asin acos atan sinh cosh tanh asinh
    acosh atanh erf erfc gamma lgamma degrees radians"""
_MANY = 1000

FUNCTIONS: dict[str, Signature] = {
    "abs": Signature(1, 1, abs),
    "min": Signature(2, _MANY, min),
    "max": Signature(2, _MANY, max),
    "pow": Signature(2, 2, math.pow),
    "mod": Signature(2, 2, operator.mod),
    "remainder": Signature(2, 2, math.remainder),
    "atan2": Signature(2, 2, math.atan2),
    "hypot": Signature(2, 2, math.hypot),
    "if": Signature(3, 3, lambda condition, a, b: a if condition != 0 else b),
    "sign": Signature(1, 1, lambda a: (a > 0) - (a < 0)),
    "step": Signature(1, 1, lambda a: 0.0 if a < 0 else 1.0),
    "floor": Signature(1, 1, math.floor),
    "ceil": Signature(1, 1, math.ceil),
    "round": Signature(1, 1, round),
    "trunc": Signature(1, 1, math.trunc),
    "cbrt": Signature(1, 1, lambda a: math.copysign(abs(a) ** (1.0 / 3.0), a)),
    "exp2": Signature(1, 1, lambda a: math.pow(2.0, a)),
    "inv_norm": Signature(1, 1, _inv_norm),
    "tgamma": Signature(1, 1, math.gamma),
    **{name: Signature(1, 1, getattr(math, name)) for name in _OF_ONE.split()},
}

OPERATORS: dict[str, Callable[..., float]] = {
    "neg": operator.neg,
    "not": operator.not_,
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "%": operator.mod,
    "^": math.pow,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "&&": lambda a, b: a != 0 and b != 0,
    "||": lambda a, b: a != 0 or b != 0,
}


def compute(name: str, *numbers: float) -> float:
    """Compute a function or operator of plain numbers; NaN in, NaN out, errors as in `math`."""
    if any(math.isnan(number) for number in numbers):
        return math.nan
    result = (OPERATORS.get(name) or FUNCTIONS[name].compute)(*numbers)
    if math.isinf(result) and not any(math.isinf(number) for number in numbers):
        raise OverflowError(name)
    return float(result)


def compute_quietly(name: str, *numbers: float) -> float:
    """Compute the same as floating-point hardware does: inf or NaN where there is no result."""
    if name == "if":
        return numbers[1] if numbers[0] != 0 else numbers[2]
    try:
        return compute(name, *numbers)
    except ZeroDivisionError:
        if name == "/" and numbers[0] != 0:
            return math.copysign(math.inf, numbers[0]) * math.copysign(1.0, numbers[1])
        return math.nan
    except OverflowError:
        odd = name in ("sinh", "expm1", "*", "+", "-", "/")
        if odd and name in OPERATORS:
            return OPERATORS[name](*numbers)
        return math.copysign(math.inf, numbers[0]) if odd else math.inf
    except ValueError:
        zero = numbers[0] == 0
        if name in ("log", "log2", "log10") and zero:
            return -math.inf
        infinite = name == "lgamma" or (zero and name in ("^", "pow", "gamma", "tgamma"))
        return math.inf if infinite else math.nan
