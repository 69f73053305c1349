"""The operations of formulas: their numbers, and what they do in kernels and in NumPy."""

import math

import numpy as np

from karamelo_py.compiler.compile import implements
from karamelo_py.compiler.loops import noinline

# fmt: off
UNARY = (
    "neg", "not", "abs", "sign", "step", "sqrt", "cbrt", "exp", "log", "log10", "log2",
    "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh",
    "asinh", "acosh", "atanh", "erf", "erfc", "gamma", "lgamma", "expm1", "log1p",
    "floor", "ceil", "round", "trunc",
)
BINARY = (
    "+", "-", "*", "/", "^", "%", "<", "<=", ">", ">=", "==", "!=",
    "&&", "||", "min", "max", "atan2", "hypot",
)
# fmt: on

_FIRST_UNARY = 4
FIRST_BINARY = 64
SELECT = 128
OPERATIONS = (
    {name: _FIRST_UNARY + k for k, name in enumerate(UNARY)}
    | {name: FIRST_BINARY + k for k, name in enumerate(BINARY)}
    | {"if": SELECT}
)

(NEG, NOT, ABS, SIGN, STEP, SQRT, CBRT, EXP, LOG, LOG10, LOG2) = range(4, 15)
(SIN, COS, TAN, ASIN, ACOS, ATAN, SINH, COSH, TANH) = range(15, 24)
(ASINH, ACOSH, ATANH, ERF, ERFC, GAMMA, LGAMMA, EXPM1, LOG1P) = range(24, 33)
(FLOOR, CEIL, ROUND, TRUNC) = range(33, 37)
(ADD, SUB, MUL, DIV, POW, MOD, LT, LE, GT, GE, EQ, NE) = range(64, 76)
(AND, OR, MIN, MAX, ATAN2, HYPOT) = range(76, 82)


@noinline
def _whole(op, a):
    """A number without its fraction; by sums, which every processor has."""
    if not abs(a) < 2.0**52:
        return a  # whole, or no number
    far = math.copysign(2.0**52, a)
    near = (a + far) - far
    if near > a and (op == FLOOR or (op == TRUNC and a > 0.0)):
        near -= 1.0
    elif near < a and (op == CEIL or (op == TRUNC and a < 0.0)):
        near += 1.0
    return math.copysign(near, a)  # -0.0 too


@noinline
def function_of(op, a):
    """Any function of one number: one chain of choices, where a loop for each would be too much."""
    if op == NEG:
        return -a
    if op == NOT:
        return 1.0 if a == 0.0 else 0.0
    if op == ABS:
        return abs(a)
    if op == SIGN:
        return 1.0 if a > 0.0 else (-1.0 if a < 0.0 else a)
    if op == STEP:
        return 0.0 if a < 0.0 else (1.0 if a >= 0.0 else a)
    if op == SQRT:
        return math.sqrt(a)
    if op == EXP:
        return math.exp(a)
    if op == LOG:
        return math.log(a)
    if op == SIN:
        return math.sin(a)
    if op == COS:
        return math.cos(a)
    if FLOOR <= op <= TRUNC:
        return _whole(op, a)
    if op == CBRT:
        return math.copysign(math.pow(abs(a), 1.0 / 3.0), a)
    if op == LOG10:
        return math.log10(a)
    if op == LOG2:
        return math.log2(a)
    if op == TAN:
        return math.tan(a)
    if op == ASIN:
        return math.asin(a)
    if op == ACOS:
        return math.acos(a)
    if op == ATAN:
        return math.atan(a)
    if op == SINH:
        return math.sinh(a)
    if op == COSH:
        return math.cosh(a)
    if op == TANH:
        return math.tanh(a)
    if op == ASINH:
        return math.asinh(a)
    if op == ACOSH:
        return math.acosh(a)
    if op == ATANH:
        return math.atanh(a)
    if op == ERF:
        return math.erf(a)
    if op == ERFC:
        return math.erfc(a)
    if op == GAMMA:
        return math.gamma(a)
    if op == LGAMMA:
        return math.lgamma(a)
    if op == EXPM1:
        return math.expm1(a)
    return math.log1p(a)


@noinline
def operation_of(op, a, b):
    """Any operation on two numbers: comparisons and logical ones give 1.0 or 0.0."""
    if op == ADD:
        return a + b
    if op == SUB:
        return a - b
    if op == MUL:
        return a * b
    if op == DIV:
        return a / b
    if op == POW:
        return math.pow(a, b)
    if op == MIN:
        return b if b < a else a
    if op == MAX:
        return b if b > a else a
    if op == MOD:
        return a % b  # the sign of the divisor, as in Python
    if op == ATAN2:
        return math.atan2(a, b)
    if op == HYPOT:
        return math.hypot(a, b)
    if op == LT:
        result = a < b
    elif op == LE:
        result = a <= b
    elif op == GT:
        result = a > b
    elif op == GE:
        result = a >= b
    elif op == EQ:
        result = a == b
    elif op == NE:
        result = a != b
    elif op == AND:
        result = (a != 0.0) and (b != 0.0)
    else:
        result = (a != 0.0) or (b != 0.0)
    return 1.0 if result else 0.0


# ---- the same in NumPy, for runs without compilation --------------------------------------------


def _each(function, nan=math.nan):
    """`function` of the standard library for arrays, NaN where it refuses."""

    def safe(value):
        try:
            return function(value)
        except ValueError:
            return math.inf if value == 0.0 else nan
        except OverflowError:
            return math.inf

    return np.vectorize(safe, otypes=[float])


_NUMPY = {
    "neg": np.negative,
    "not": lambda a: (a == 0.0) * 1.0,
    "step": lambda a: np.where(np.isnan(a), a, (a >= 0.0) * 1.0),
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "asinh": np.arcsinh,
    "acosh": np.arccosh,
    "atanh": np.arctanh,
    "erf": _each(math.erf),
    "erfc": _each(math.erfc),
    "gamma": _each(math.gamma),
    "lgamma": _each(math.lgamma, nan=math.inf),
    "round": np.rint,
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "^": np.power,
    "%": np.mod,
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
    "==": np.equal,
    "!=": np.not_equal,
    "&&": lambda a, b: (a != 0.0) & (b != 0.0),
    "||": lambda a, b: (a != 0.0) | (b != 0.0),
    "min": lambda a, b: np.where(b < a, b, a),
    "max": lambda a, b: np.where(b > a, b, a),
    "atan2": np.arctan2,
    "if": lambda c, a, b: np.where(c != 0.0, a, b),
}
IN_NUMPY = {number: _NUMPY.get(name) or getattr(np, name) for name, number in OPERATIONS.items()}


def of_one(op, a):
    """The function `op` of one number; inf or NaN where there is no result."""
    with np.errstate(all="ignore"):
        return float(IN_NUMPY[op](a))


implements(of_one)(function_of)


def of_two(op, a, b):
    """The operation `op` on two numbers likewise."""
    with np.errstate(all="ignore"):
        return float(IN_NUMPY[op](np.float64(a), b))


implements(of_two)(operation_of)
