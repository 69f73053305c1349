"""Formulas as stack programs, and the one compiled evaluator that runs them over blocks of points.

A formula costs no compilation of its own. The evaluator goes through the program once per block and
does each operation for all points of the block in a simple loop. What is the same at all points
(time, constants, and whatever is made of them alone) is computed once per block: such instructions
carry the mark `UNIFORM`, and a `SPREAD` makes a row of the result where points come in. What a
formula needs more than once is computed once and kept in a row behind the stack.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import config, types

from karamelo_py.compiler.compile import by_type, caller_of, entered, loop, subkernel

BLOCK = 128
MAX_DEPTH = 32
MAX_KEPT = 32
ROWS = MAX_DEPTH + MAX_KEPT  # of the scratch that a program works in: the stack, then what is kept
# Added to an operation that is done once for the whole block.
UNIFORM = 1 << 16

# What is pushed on the stack: a constant, a published value, a row of `points` (x y z x0 y0 z0).
CONSTANT, GLOBAL, POINT = 0, 1, 2
# Make a row of the number that lies `operand` below the top.
SPREAD = 3
# Take the top off into the row `operand` of what is kept; push that row.
KEEP, KEPT = 150, 151

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

(_NEG, _NOT, _ABS, _SIGN, _STEP, _SQRT, _CBRT, _EXP, _LOG, _LOG10, _LOG2) = range(4, 15)
(_SIN, _COS, _TAN, _ASIN, _ACOS, _ATAN, _SINH, _COSH, _TANH) = range(15, 24)
(_ASINH, _ACOSH, _ATANH, _ERF, _ERFC, _GAMMA, _LGAMMA, _EXPM1, _LOG1P) = range(24, 33)
(_FLOOR, _CEIL, _ROUND, _TRUNC) = range(33, 37)
(_ADD, _SUB, _MUL, _DIV, _POW, _MOD, _LT, _LE, _GT, _GE, _EQ, _NE) = range(64, 76)
(_AND, _OR, _MIN, _MAX, _ATAN2, _HYPOT) = range(76, 82)


class Program(NamedTuple):
    """A formula, ready to be evaluated.

    Attributes
    ----------
    code : ndarray (n, 2) int64
        Operation and operand of each instruction.
    constants : ndarray (m,) float64
        The numbers that CONSTANT instructions push.
    """

    code: np.ndarray
    constants: np.ndarray


@subkernel
def _whole(op, a):
    """A number without its fraction; by sums, which every target of Numba knows."""
    if not abs(a) < 2.0**52:
        return a  # whole, or no number
    far = math.copysign(2.0**52, a)
    near = (a + far) - far
    if near > a and (op == _FLOOR or (op == _TRUNC and a > 0.0)):
        near -= 1.0
    elif near < a and (op == _CEIL or (op == _TRUNC and a < 0.0)):
        near += 1.0
    return math.copysign(near, a)  # -0.0 too


@subkernel
def _function(op, a):
    """Any function of one number: one chain of choices, where a loop for each would be too much."""
    if op == _NEG:
        return -a
    if op == _NOT:
        return 1.0 if a == 0.0 else 0.0
    if op == _ABS:
        return abs(a)
    if op == _SIGN:
        return 1.0 if a > 0.0 else (-1.0 if a < 0.0 else a)
    if op == _STEP:
        return 0.0 if a < 0.0 else (1.0 if a >= 0.0 else a)
    if op == _SQRT:
        return math.sqrt(a)
    if op == _EXP:
        return math.exp(a)
    if op == _LOG:
        return math.log(a)
    if op == _SIN:
        return math.sin(a)
    if op == _COS:
        return math.cos(a)
    if _FLOOR <= op <= _TRUNC:
        return _whole(op, a)
    if op == _CBRT:
        return math.copysign(math.pow(abs(a), 1.0 / 3.0), a)
    if op == _LOG10:
        return math.log10(a)
    if op == _LOG2:
        return math.log2(a)
    if op == _TAN:
        return math.tan(a)
    if op == _ASIN:
        return math.asin(a)
    if op == _ACOS:
        return math.acos(a)
    if op == _ATAN:
        return math.atan(a)
    if op == _SINH:
        return math.sinh(a)
    if op == _COSH:
        return math.cosh(a)
    if op == _TANH:
        return math.tanh(a)
    if op == _ASINH:
        return math.asinh(a)
    if op == _ACOSH:
        return math.acosh(a)
    if op == _ATANH:
        return math.atanh(a)
    if op == _ERF:
        return math.erf(a)
    if op == _ERFC:
        return math.erfc(a)
    if op == _GAMMA:
        return math.gamma(a)
    if op == _LGAMMA:
        return math.lgamma(a)
    if op == _EXPM1:
        return math.expm1(a)
    return math.log1p(a)


@subkernel
def _pair(op, a, b):
    """Any operation on two numbers: comparisons and logical ones give 1.0 or 0.0."""
    if op == _ADD:
        return a + b
    if op == _SUB:
        return a - b
    if op == _MUL:
        return a * b
    if op == _DIV:
        return a / b
    if op == _POW:
        return math.pow(a, b)
    if op == _MIN:
        return b if b < a else a
    if op == _MAX:
        return b if b > a else a
    if op == _MOD:
        return a % b  # the sign of the divisor, as in Python
    if op == _ATAN2:
        return math.atan2(a, b)
    if op == _HYPOT:
        return math.hypot(a, b)
    if op == _LT:
        result = a < b
    elif op == _LE:
        result = a <= b
    elif op == _GT:
        result = a > b
    elif op == _GE:
        result = a >= b
    elif op == _EQ:
        result = a == b
    elif op == _NE:
        result = a != b
    elif op == _AND:
        result = (a != 0.0) and (b != 0.0)
    else:
        result = (a != 0.0) or (b != 0.0)
    return 1.0 if result else 0.0


@subkernel
def _unary(op, n, a):
    """Replace the first `n` numbers of `a` by a function of them."""
    if op == _NEG:
        for i in range(n):
            a[i] = -a[i]
    elif op == _SQRT:
        for i in range(n):
            a[i] = math.sqrt(a[i])
    elif op == _SIN:
        for i in range(n):
            a[i] = math.sin(a[i])
    elif op == _COS:
        for i in range(n):
            a[i] = math.cos(a[i])
    elif op == _EXP:
        for i in range(n):
            a[i] = math.exp(a[i])
    elif op == _LOG:
        for i in range(n):
            a[i] = math.log(a[i])
    elif op == _ABS:
        for i in range(n):
            a[i] = abs(a[i])
    else:
        for i in range(n):
            a[i] = _function(op, a[i])


@subkernel
def _binary(op, n, a, b):
    """Replace the first `n` numbers of `a` by what `op` makes of them and those of `b`."""
    if op == _ADD:
        for i in range(n):
            a[i] += b[i]
    elif op == _SUB:
        for i in range(n):
            a[i] -= b[i]
    elif op == _MUL:
        for i in range(n):
            a[i] *= b[i]
    elif op == _DIV:
        for i in range(n):
            a[i] /= b[i]
    elif op == _POW:
        # Small whole powers are the common case, and pow costs ten multiplications.
        power = b[0]
        same = True
        for i in range(n):
            same = same and b[i] == power
        if same and power == 2.0:
            for i in range(n):
                a[i] *= a[i]
        elif same and power == 3.0:
            for i in range(n):
                a[i] *= a[i] * a[i]
        else:
            for i in range(n):
                a[i] = math.pow(a[i], b[i])
    elif op == _MIN:
        for i in range(n):
            a[i] = b[i] if b[i] < a[i] else a[i]
    elif op == _MAX:
        for i in range(n):
            a[i] = b[i] if b[i] > a[i] else a[i]
    else:
        for i in range(n):
            a[i] = _pair(op, a[i], b[i])


@entered
def _evaluate_compiled(program, globals_, points, count, out, stack):
    """Evaluate `program` at `count` points.

    Parameters
    ----------
    program : Program
    globals_ : ndarray (n,) float64
        Published values, see :class:`karamelo_py.script.values.Values`.
    points : ndarray (6, BLOCK) float64
        Rows x, y, z, x0, y0, z0.
    count : int
        Number of points, at most BLOCK.
    out : ndarray (BLOCK,) float64
        Gets the `count` results.
    stack : ndarray (ROWS, BLOCK) float64
        Scratch.
    """
    code = program.code
    constants = program.constants
    top = -1
    uniform = False
    for k in range(code.shape[0]):
        op = code[k, 0]
        operand = code[k, 1]
        n = count
        uniform = op >= UNIFORM
        if uniform:
            op -= UNIFORM
            n = 1
        if op == CONSTANT:
            top += 1
            stack[top, 0] = constants[operand]
        elif op == GLOBAL:
            top += 1
            stack[top, 0] = globals_[operand]
        elif op == POINT:
            top += 1
            for i in range(n):
                stack[top, i] = points[operand, i]
        elif op == SPREAD:
            value = stack[top - operand, 0]
            for i in range(n):
                stack[top - operand, i] = value
        elif op < FIRST_BINARY:
            _unary(op, n, stack[top])
        elif op < SELECT:
            top -= 1
            _binary(op, n, stack[top], stack[top + 1])
        elif op == KEEP:
            for i in range(n):
                stack[MAX_DEPTH + operand, i] = stack[top, i]
            top -= 1
        elif op == KEPT:
            top += 1
            for i in range(n):
                stack[top, i] = stack[MAX_DEPTH + operand, i]
        else:
            top -= 2
            for i in range(n):
                stack[top, i] = stack[top + 1, i] if stack[top, i] != 0.0 else stack[top + 2, i]
    if uniform:
        value = stack[0, 0]
        for i in range(count):
            out[i] = value
    else:
        for i in range(count):
            out[i] = stack[0, i]


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
_BY_NUMBER = {number: _NUMPY.get(name) or getattr(np, name) for name, number in OPERATIONS.items()}


def _evaluate_numpy(program, globals_, points, count, out, stack):
    values: list = []
    kept: dict = {}
    with np.errstate(all="ignore"):
        for op, operand in program.code:
            op = int(op) % UNIFORM
            if op == CONSTANT:
                values.append(np.full(count, program.constants[operand]))
            elif op == GLOBAL:
                values.append(np.full(count, globals_[operand]))
            elif op == POINT:
                values.append(np.array(points[operand, :count]))
            elif op == KEEP:
                kept[operand] = values.pop()
            elif op == KEPT:
                values.append(kept[operand])
            elif op != SPREAD:
                takes = 1 if op < FIRST_BINARY else 2 if op < SELECT else 3
                values[-takes:] = [np.asarray(_BY_NUMBER[op](*values[-takes:]), dtype=float)]
    out[:count] = values[0]


def of_one(op, a):
    """The function `op` of one number; inf or NaN where there is no result."""
    with np.errstate(all="ignore"):
        return float(_BY_NUMBER[op](a))


@by_type(of_one)
def _of_one(op, a):
    return lambda op, a: _function(op, a)


def of_two(op, a, b):
    """The operation `op` on two numbers likewise."""
    with np.errstate(all="ignore"):
        return float(_BY_NUMBER[op](np.float64(a), b))


@by_type(of_two)
def _of_two(op, a, b):
    return lambda op, a, b: _pair(op, a, b)


evaluate = _evaluate_numpy if config.DISABLE_JIT else _evaluate_compiled


# How kernels of hooks call the evaluator: by address, so that none of them has to contain it, and
# with whole tables, since every slice in a kernel is dear to compile.
_TABLE = types.float64[:, ::1]
_ROW = types.float64[::1]
EVALUATE = types.void(
    types.int64[:, ::1], _ROW, _ROW, _TABLE, *[types.int64] * 6
)  # fmt: skip
call_evaluate = caller_of(EVALUATE)
STACK = 8  # rows of the scratch table: x y z x0 y0 z0, two results, stack


def evaluate_in_table(code, constants, globals_, scratch, begin, end, first, last, count, result):
    """`evaluate` the program code[begin:end] with constants[first:last].

    The points are the first rows of `scratch`, the stack its last ones; row `result` takes the
    results.
    """
    program = Program(code[begin:end], constants[first:last])
    evaluate(program, globals_, scratch[:6], count, scratch[result], scratch[STACK:])


@loop
def evaluate_all(program, globals_, x, x0, out, scratch):
    """Evaluate `program` at any number of positions.

    Parameters
    ----------
    program : Program
    globals_ : ndarray (n,) float64
        Published values.
    x, x0 : ndarray (n, 3) float64
        Positions now and in the beginning.
    out : ndarray (n,) float64
        Gets the results.
    scratch : ndarray (6 + ROWS, BLOCK) float64
    """
    points = scratch[:6]
    stack = scratch[6:]
    for start in range(0, out.size, BLOCK):
        count = min(BLOCK, out.size - start)
        for i in range(count):
            for axis in range(3):
                points[axis, i] = x[start + i, axis]
                points[3 + axis, i] = x0[start + i, axis]
        evaluate(program, globals_, points, count, out[start : start + count], stack)
