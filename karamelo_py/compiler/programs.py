"""Calls of the formula evaluator (`karamelo_py.script.formula`) by address, from kernels.

Kernels pass whole tables, as slices are slow to compile.
"""

from numba import types

from karamelo_py.compiler.trace.kernels import caller_of

BLOCK = 128  # points at a time
MAX_DEPTH = 32
MAX_KEPT = 32
ROWS = MAX_DEPTH + MAX_KEPT  # rows of the stack, and then of stored results
STACK = 8  # rows of the scratch table: x y z x0 y0 z0, two results, stack
_TABLE = types.float64[:, ::1]
_ROW = types.float64[::1]
EVALUATE = types.void(types.int64[:, ::1], _ROW, _ROW, _TABLE, *[types.int64] * 6)
call_evaluate = caller_of(EVALUATE)
