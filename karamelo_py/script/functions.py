"""Functions of the script language, for numbers."""

import math
import operator
import statistics
from typing import NamedTuple

from karamelo_py.script.operations import BINARY, UNARY, quietly

CONSTANTS = {"PI": math.pi, "PHI": (1 + math.sqrt(5)) / 2, "EGAMMA": 0.57721566490153286}
WORDS = frozenset({"NULL", "INF", "EDGE"})
# Functions whose names cannot be variables; Karamelo allows all other names.
RESERVED = frozenset({"exp", "sqrt", "cos", "sin", "tan", "atan2", "log", "if"})
# Probability of each tail of the normal distribution that inv_norm excludes.
TAIL = 1e-10


class Signature(NamedTuple):
    least: int
    most: int


def _inv_norm(a: float) -> float:
    if not TAIL <= a <= 1 - TAIL:
        raise ValueError("outside of the domain")
    return statistics.NormalDist().inv_cdf(a)


_OF_TWO = {
    "pow": math.pow,
    "mod": operator.mod,
    "remainder": math.remainder,
    **{name: BINARY[name] for name in ("min", "max", "atan2", "hypot")},
}
_OF_ONE = {
    **{name: do for name, do in UNARY.items() if name not in ("neg", "not")},
    "floor": math.floor,
    "ceil": math.ceil,
    "round": round,
    "trunc": math.trunc,
    "exp2": lambda a: math.pow(2.0, a),
    "inv_norm": _inv_norm,
    "tgamma": math.gamma,
    "degrees": math.degrees,
    "radians": math.radians,
}
_COMPUTED = UNARY | BINARY | _OF_TWO | _OF_ONE
_MANY = 1000
FUNCTIONS: dict[str, Signature] = {
    **dict.fromkeys(_OF_ONE, Signature(1, 1)),
    **dict.fromkeys(_OF_TWO, Signature(2, 2)),
    **dict.fromkeys(("min", "max"), Signature(2, _MANY)),
    "if": Signature(3, 3),
}


def compute(name: str, *numbers: float) -> float:
    """Compute a function; NaN propagates, errors are as in `math`."""
    if any(map(math.isnan, numbers)):
        return math.nan
    result = _COMPUTED[name](*numbers)
    if math.isinf(result) and not any(map(math.isinf, numbers)):
        raise OverflowError(name)
    return float(result)


def compute_quietly(name: str, *numbers: float) -> float:
    if name == "if":
        return numbers[1] if numbers[0] != 0 else numbers[2]
    return math.nan if any(map(math.isnan, numbers)) else quietly(name, *numbers)
