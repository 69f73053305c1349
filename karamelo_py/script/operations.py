"""The operations of formulas, for kernels and Python."""

import functools
import math
import operator
from collections.abc import Callable

from karamelo_py.compiler import INTERPRETED, implements, noinline


@noinline
def _whole(a, down, up):
    """Round by additions: not every processor has an instruction that rounds."""
    if not abs(a) < 2.0**52:
        return a  # NaN, or an integer already
    far = math.copysign(2.0**52, a)
    near = (a + far) - far
    if near > a and down:
        near -= 1.0
    elif near < a and up:
        near += 1.0
    return math.copysign(near, a)  # preserves -0.0


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


def _power(a, b):
    """Return a to the power b, by products if b is small: pow costs ten multiplications."""
    if b == 2.0:
        return a * a
    return a * (a * a) if b == 3.0 else math.pow(a, b)


def _truth(compare: Callable) -> Callable:

    def truth(a, b):
        return 1.0 if compare(a, b) else 0.0

    return truth


UNARY = {
    "neg": operator.neg,
    "not": _not,
    "abs": abs,
    "sign": _sign,
    "step": _step,
    "cbrt": lambda a: math.copysign(math.pow(abs(a), 1.0 / 3.0), a),
    "floor": lambda a: _whole(a, True, False),
    "ceil": lambda a: _whole(a, False, True),
    "round": lambda a: _whole(a, False, False),
    "trunc": lambda a: _whole(a, a > 0.0, a < 0.0),
    **{name: getattr(math, name) for name in (
        "sqrt", "exp", "log", "log10", "log2", "sin", "cos", "tan", "asin", "acos", "atan", "sinh",
        "cosh", "tanh", "asinh", "acosh", "atanh", "erf", "erfc", "gamma", "lgamma", "expm1",
        "log1p",
    )},
}  # fmt: skip
BINARY = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "^": _power,
    "%": operator.mod,  # the remainder has the sign of the divisor, as in Python
    **{sign: _truth(compare) for sign, compare in {
        "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
        "==": operator.eq, "!=": operator.ne,
    }.items()},
    "&&": _and,
    "||": _or,
    "min": _min,
    "max": _max,
    "atan2": math.atan2,
    "hypot": math.hypot,
}  # fmt: skip

FIRST_UNARY, FIRST_BINARY, SELECT = 4, 64, 128
OPERATIONS = (
    {name: FIRST_UNARY + k for k, name in enumerate(UNARY)}
    | {name: FIRST_BINARY + k for k, name in enumerate(BINARY)}
    | {"if": SELECT}
)

# Arguments of functions at poles, where Python raises an exception.
_POLES = {
    "log": (0, -math.inf), "log2": (0, -math.inf), "log10": (0, -math.inf),
    "log1p": (-1, -math.inf), "^": (0, math.inf), "gamma": (0, math.inf),
}  # fmt: skip


def quietly(name: str, *numbers: float) -> float:
    """Apply an operation as hardware does: results are inf or NaN instead of exceptions."""
    a, *rest = numbers = tuple(map(float, numbers))
    try:
        return float((UNARY.get(name) or BINARY[name])(*numbers))
    except ZeroDivisionError:
        return a * math.copysign(math.inf, rest[0]) if name == "/" else math.nan
    except OverflowError:
        odd = name == "sinh" or (name == "^" and rest[0] % 2 == 1)
        return math.copysign(math.inf, a) if odd else math.inf
    except ValueError:
        if name == "lgamma":
            return math.inf
        if name == "atanh" and abs(a) == 1:
            return a * math.inf
        pole, value = _POLES.get(name, (math.nan, math.nan))
        return value if a == pole else math.nan


def numbered(*names: str) -> tuple[tuple[int, Callable], ...]:
    every = UNARY | BINARY
    return tuple(
        (OPERATIONS[name], functools.partial(quietly, name) if INTERPRETED else every[name])
        for name in names
    )


_NUMBERED_UNARY, _NUMBERED_BINARY = numbered(*UNARY), numbered(*BINARY)
_NAMES = {number: name for name, number in OPERATIONS.items()}


def of_one(op, a):
    return quietly(_NAMES[int(op)], a)


@implements(of_one)
@noinline
def _function_of(op, a):
    for number, do in _NUMBERED_UNARY:
        if op == number:
            return do(a)
    return a


def of_two(op, a, b):
    return quietly(_NAMES[int(op)], a, b)


@implements(of_two)
@noinline
def _operation_of(op, a, b):
    for number, do in _NUMBERED_BINARY:
        if op == number:
            return do(a, b)
    return a
