"""The functions of the script language, for plain numbers.

The same functions for many points at once are in :mod:`karamelo_py.compiler.formula`.
"""

import math
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


def _sign(a: float) -> float:
    return float((a > 0) - (a < 0))


def _power(a: float, b: float) -> float:
    return math.pow(a, b)


def _modulo(a: float, b: float) -> float:
    return a % b


def _select(condition: float, a: float, b: float) -> float:
    return a if condition != 0 else b


def _cbrt(a: float) -> float:
    return math.copysign(abs(a) ** (1.0 / 3.0), a)


def _inv_norm(a: float) -> float:
    if not TAIL <= a <= 1 - TAIL:
        raise ValueError("outside of the domain")
    return statistics.NormalDist().inv_cdf(a)


def _truth(compare: Callable[[float, float], bool]) -> Callable[[float, float], float]:
    return lambda a, b: 1.0 if compare(a, b) else 0.0


_MANY = 1000

FUNCTIONS: dict[str, Signature] = {
    "abs": Signature(1, 1, abs),
    "min": Signature(2, _MANY, min),
    "max": Signature(2, _MANY, max),
    "pow": Signature(2, 2, _power),
    "mod": Signature(2, 2, _modulo),
    "remainder": Signature(2, 2, math.remainder),
    "atan2": Signature(2, 2, math.atan2),
    "hypot": Signature(2, 2, math.hypot),
    "if": Signature(3, 3, _select),
    "sign": Signature(1, 1, _sign),
    "step": Signature(1, 1, lambda a: 0.0 if a < 0 else 1.0),
    "floor": Signature(1, 1, lambda a: float(math.floor(a))),
    "ceil": Signature(1, 1, lambda a: float(math.ceil(a))),
    "round": Signature(1, 1, lambda a: float(round(a))),
    "trunc": Signature(1, 1, lambda a: float(math.trunc(a))),
    "sqrt": Signature(1, 1, math.sqrt),
    "cbrt": Signature(1, 1, _cbrt),
    "exp": Signature(1, 1, math.exp),
    "exp2": Signature(1, 1, lambda a: math.pow(2.0, a)),
    "expm1": Signature(1, 1, math.expm1),
    "log": Signature(1, 1, math.log),
    "log10": Signature(1, 1, math.log10),
    "log2": Signature(1, 1, math.log2),
    "log1p": Signature(1, 1, math.log1p),
    "sin": Signature(1, 1, math.sin),
    "cos": Signature(1, 1, math.cos),
    "tan": Signature(1, 1, math.tan),
    "asin": Signature(1, 1, math.asin),
    "acos": Signature(1, 1, math.acos),
    "atan": Signature(1, 1, math.atan),
    "sinh": Signature(1, 1, math.sinh),
    "cosh": Signature(1, 1, math.cosh),
    "tanh": Signature(1, 1, math.tanh),
    "asinh": Signature(1, 1, math.asinh),
    "acosh": Signature(1, 1, math.acosh),
    "atanh": Signature(1, 1, math.atanh),
    "erf": Signature(1, 1, math.erf),
    "erfc": Signature(1, 1, math.erfc),
    "inv_norm": Signature(1, 1, _inv_norm),
    "gamma": Signature(1, 1, math.gamma),
    "tgamma": Signature(1, 1, math.gamma),
    "lgamma": Signature(1, 1, math.lgamma),
    "degrees": Signature(1, 1, math.degrees),
    "radians": Signature(1, 1, math.radians),
}

OPERATORS: dict[str, Callable[..., float]] = {
    "neg": lambda a: -a,
    "not": lambda a: 1.0 if a == 0 else 0.0,
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "%": _modulo,
    "^": _power,
    "<": _truth(lambda a, b: a < b),
    "<=": _truth(lambda a, b: a <= b),
    ">": _truth(lambda a, b: a > b),
    ">=": _truth(lambda a, b: a >= b),
    "==": _truth(lambda a, b: a == b),
    "!=": _truth(lambda a, b: a != b),
    "&&": _truth(lambda a, b: a != 0 and b != 0),
    "||": _truth(lambda a, b: a != 0 or b != 0),
}


def compute(name: str, *numbers: float) -> float:
    """A function or operator of plain numbers; NaN in, NaN out.

    Raises
    ------
    ValueError, ZeroDivisionError, OverflowError
        As the functions of :mod:`math` do.
    """
    if any(math.isnan(number) for number in numbers):
        return math.nan
    result = (OPERATORS.get(name) or FUNCTIONS[name].compute)(*numbers)
    if math.isinf(result) and not any(math.isinf(number) for number in numbers):
        raise OverflowError(name)
    return float(result)


def compute_quietly(name: str, *numbers: float) -> float:
    """The same as floating-point hardware does it: inf or NaN where there is no result."""
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
        at_zero = {"log", "log2", "log10"}
        if name in at_zero and numbers[0] == 0:
            return -math.inf
        if name == "^" or name == "pow":
            return math.inf if numbers[0] == 0 else math.nan
        if name in ("gamma", "tgamma", "lgamma"):
            return math.inf if numbers[0] == 0 or name == "lgamma" else math.nan
        return math.nan
