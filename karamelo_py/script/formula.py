"""Formulas as stack programs over blocks of points.

The evaluator loops over a block of points for each operation. Instructions flagged `UNIFORM`
compute one value for a block, and `SPREAD` expands it. Rows after the stack store common
subexpressions.
"""

from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import kernel, noinline
from karamelo_py.compiler.programs import BLOCK, MAX_DEPTH, STACK
from karamelo_py.script.operations import FIRST_BINARY, SELECT, numbered, of_one, of_two

# Flag of an instruction that is carried out once for the whole block.
UNIFORM = 1 << 16

# Instructions that push a constant, a published value, or a row of `points` (x y z x0 y0 z0).
CONSTANT, GLOBAL, POINT = 0, 1, 2
# Instruction that expands the number `operand` places below the top of the stack to a row.
SPREAD = 3
# Instructions that pop the top of the stack into the stored row `operand`, and push this row.
KEEP, KEPT = 150, 151


class Program(NamedTuple):
    code: np.ndarray  # (n, 2) int64: operation and operand of each instruction
    constants: np.ndarray


@noinline
def _copy(n, a, b):
    a[:n] = b[:n]


@noinline
def _fill(n, a, value):
    a[:n] = value


def _select(n, a, b, c):
    for i in range(n):
        a[i] = b[i] if a[i] != 0.0 else c[i]


# Functions with a loop each; for all others, one loop selects the function per number.
_UNARY_LOOPS = numbered("neg", "sqrt", "sin", "cos", "exp", "log", "abs")
_BINARY_LOOPS = numbered("+", "-", "*", "/", "min", "max")
((_POWER, _power),) = numbered("^")


@noinline
def _unary(op, n, a):
    for number, do in _UNARY_LOOPS:
        if op == number:
            for i in range(n):
                a[i] = do(a[i])
            return
    for i in range(n):
        a[i] = of_one(op, a[i])


@noinline
def _binary(op, n, a, b):
    for number, do in _BINARY_LOOPS:
        if op == number:
            for i in range(n):
                a[i] = do(a[i], b[i])
            return
    if op == _POWER:
        _powers(n, a, b)
        return
    for i in range(n):
        a[i] = of_two(op, a[i], b[i])


def _powers(n, a, b):
    """Raise `n` numbers of `a` to `b` as `_power` does, without branches if exponents are equal."""
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
            a[i] = _power(a[i], b[i])


@kernel
def evaluate(program, globals_, points, count, out, stack):
    """Evaluate a program at `count` points; rows of `points` (6, BLOCK) are x, y, z, x0, y0, z0.

    `out` (BLOCK,) gets the results; `stack` (ROWS, BLOCK) is scratch.
    """
    code, constants = program
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
            _copy(n, stack[top], points[operand])
        elif op == SPREAD:
            _fill(n, stack[top - operand], stack[top - operand, 0])
        elif op < FIRST_BINARY:
            _unary(op, n, stack[top])
        elif op < SELECT:
            top -= 1
            _binary(op, n, stack[top], stack[top + 1])
        elif op == KEEP:
            _copy(n, stack[MAX_DEPTH + operand], stack[top])
            top -= 1
        elif op == KEPT:
            top += 1
            _copy(n, stack[top], stack[MAX_DEPTH + operand])
        else:
            top -= 2
            _select(n, stack[top], stack[top + 1], stack[top + 2])
    if uniform:
        _fill(count, out, stack[0, 0])
    else:
        _copy(count, out, stack[0])


def evaluate_in_table(code, constants, globals_, scratch, begin, end, first, last, count, result):
    """Evaluate the instructions code[begin:end] with constants[first:last].

    The first rows of `scratch` are points, the last rows the stack; row `result` gets results.
    """
    program = Program(code[begin:end], constants[first:last])
    evaluate(program, globals_, scratch[:6], count, scratch[result], scratch[STACK:])


@kernel
def evaluate_all(program, globals_, x, x0, out, scratch):
    """Evaluate a program at present and initial positions (n, 3).

    `out` (n,) gets the results; `scratch` is (6 + ROWS, BLOCK).
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
