"""Exceptions in kernels, which are raised in Python after the kernel.

Each call from Python has a `Failure`, whose address is the last argument of LLVM functions.
"""

import ctypes
import functools
import math
import pickle
import threading
from collections.abc import Callable
from typing import Any

from llvmlite import ir

from karamelo_py.compiler import llvm
from karamelo_py.compiler.code import machine


class Failure(ctypes.Structure):
    """The first exception in a kernel call. Kernels read only the first word."""

    _fields_ = (("failed", ctypes.c_int64), ("first", ctypes.py_object))

    def raise_first(self) -> None:
        if self.failed:
            error = self.first
            ctypes.pythonapi.Py_DecRef(ctypes.py_object(error))
            self.failed = 0
            raise error


_noting = threading.Lock()


def note(error: BaseException, at: int) -> None:
    failure = Failure.from_address(at)
    with _noting:
        if not failure.failed:
            failure.first = error
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(error))  # `failure` is temporary
            failure.failed = 1


def noting(function: Callable) -> Callable:
    """Record exceptions, including Ctrl-C, of a Python function called by kernels.

    The last argument of the function is the address of the `Failure`.
    """

    @functools.wraps(function)
    def call(*arguments: Any) -> Any:
        *values, at = arguments
        try:
            return function(*values)
        except BaseException as error:
            note(error, at)
            return 0

    return call


def never_raising(function: Callable) -> Callable:
    """Make a function return NaN instead of raising, as C functions do."""

    @functools.wraps(function)
    def call(*arguments: Any) -> Any:
        try:
            return function(*arguments)
        except BaseException:  # a C callback cannot raise
            return math.nan

    return call


@noting
def _note(text: int, size: int) -> None:
    kind, arguments = pickle.loads(ctypes.string_at(text, size))
    raise kind(*arguments)


machine.publish_python("karamelo_fail", ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3), _note)


def passing(function: ir.Function) -> ir.Function:
    function.passes_failure = True
    return function


def failure_at(builder: ir.IRBuilder) -> ir.Value:
    function = builder.function
    return function.args[-1] if hasattr(function, "passes_failure") else llvm.I64(0)


def passed_to(builder: ir.IRBuilder, called: Any) -> list:
    return [failure_at(builder)] if hasattr(called, "passes_failure") else []


def returning(function: ir.Function, kind: ir.Type) -> None:
    """Set the result type of a function that so far returns only after exceptions."""
    function.ftype = ir.FunctionType(kind, function.ftype.args)
    function.type, function.return_value.type = function.ftype.as_pointer(), kind
    for block in function.blocks:
        if isinstance(block.terminator, ir.instructions.Ret):
            block.terminator.opname = "ret"
            block.terminator.operands = [ir.Constant(kind, None)]


def _return(builder: ir.IRBuilder) -> None:
    gives = builder.function.function_type.return_type
    if isinstance(gives, ir.VoidType):
        builder.ret_void()
    else:
        builder.ret(ir.Constant(gives, None))


def fail(builder: ir.IRBuilder, kind: Callable, arguments: tuple) -> None:
    text = pickle.dumps((kind, arguments))
    constant = ir.Constant(ir.ArrayType(llvm.I8, len(text)), bytearray(text))
    constant_at = llvm.in_module(builder, constant, "exception")
    function = llvm.external(builder, "karamelo_fail", ir.VoidType(), [llvm.I64] * 3)
    at = builder.ptrtoint(constant_at, llvm.I64)
    builder.call(function, [at, llvm.I64(len(text)), failure_at(builder)])
    builder.function.raises = True
    _return(builder)


def go_on(builder: ir.IRBuilder, called: Any, regardless: bool) -> None:
    """Return at once if a called function recorded an exception, unless the caller checks."""
    if not hasattr(called, "raises"):
        return
    builder.function.raises = True
    if regardless:
        return
    flag = builder.inttoptr(failure_at(builder), llvm.I64.as_pointer())
    raised = builder.icmp_signed("!=", builder.load(flag), llvm.I64(0))
    with builder.if_then(raised, likely=False):
        _return(builder)
