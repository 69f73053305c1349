"""Exceptions in kernels: noted where they are raised, and raised by Python behind the kernel.

Each call of a kernel by Python has a `Failure` of its own. The functions of LLVM that it consists
of hand on its address as their last argument, to other threads too (`told`).
"""

import ctypes
import functools
import math
import pickle
import threading
from collections.abc import Callable
from typing import Any

from llvmlite import ir

from karamelo_py.compiler import code, machine


class Failure(ctypes.Structure):
    """Hold the first exception of one call of a kernel; kernels read the first word alone."""

    _fields_ = (("failed", ctypes.c_int64), ("first", ctypes.py_object))

    def raise_first(self) -> None:
        """Raise what was noted first, if anything was."""
        if self.failed:
            error = self.first
            ctypes.pythonapi.Py_DecRef(ctypes.py_object(error))
            self.failed = 0
            raise error


_noting = threading.Lock()


def note(error: BaseException, at: int) -> None:
    """Have an exception raised behind the kernel whose `Failure` lies at an address."""
    failure = Failure.from_address(at)
    with _noting:
        if not failure.failed:
            failure.first = error
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(error))  # `failure` here does not stay
            failure.failed = 1


def noting(function: Callable) -> Callable:
    """Note what a function that kernels call raises, Ctrl-C too: Python drops it there.

    Behind its arguments it is given the address of the `Failure`.
    """

    @functools.wraps(function)
    def call(*arguments: Any) -> Any:
        *given, at = arguments
        try:
            return function(*given)
        except BaseException as error:
            note(error, at)
            return 0

    return call


def never_raising(function: Callable) -> Callable:
    """Let a function of numbers that a kernel calls like one of C give NaN where it would raise."""

    @functools.wraps(function)
    def call(*arguments: Any) -> Any:
        try:
            return function(*arguments)
        except BaseException:  # Python would drop it, and say so
            return math.nan

    return call


@noting
def _note(text: int, size: int) -> None:
    kind, arguments = pickle.loads(ctypes.string_at(text, size))
    raise kind(*arguments)


machine.publish_python("karamelo_fail", ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3), _note)


def told(function: ir.Function) -> ir.Function:
    """Mark a function whose last argument is the address of the `Failure`."""
    function.told = True
    return function


def failure_at(builder: ir.IRBuilder) -> Any:
    """Give the address of the `Failure` in the function that is written; 0 where there is none."""
    own = builder.function
    return own.args[-1] if hasattr(own, "told") else code.I64(0)


def passed_to(builder: ir.IRBuilder, called: Any) -> list:
    """List what a function is given behind its arguments."""
    return [failure_at(builder)] if hasattr(called, "told") else []


def _return(builder: ir.IRBuilder) -> None:
    gives = builder.function.function_type.return_type
    if isinstance(gives, ir.VoidType):
        builder.ret_void()
    else:
        builder.ret(ir.Constant(gives, None))


def fail(builder: ir.IRBuilder, kind: Callable, arguments: tuple) -> None:
    """Write what notes an exception and returns."""
    text = pickle.dumps((kind, arguments))
    constant = ir.Constant(ir.ArrayType(code.I8, len(text)), bytearray(text))
    place = code.in_module(builder, constant, "exception")
    function = code.external(builder, "karamelo_fail", ir.VoidType(), [code.I64] * 3)
    at = builder.ptrtoint(place, code.I64)
    builder.call(function, [at, code.I64(len(text)), failure_at(builder)])
    builder.function.raises = True
    _return(builder)


def go_on(builder: ir.IRBuilder, called: Any, regardless: bool) -> None:
    """Write what returns at once where a function that was called has noted an exception.

    If `regardless`, it returns as ever, and lets its own caller look.
    """
    if not getattr(called, "raises", False):
        return
    builder.function.raises = True
    if regardless:
        return
    flag = builder.inttoptr(failure_at(builder), code.I64.as_pointer())
    raised = builder.icmp_signed("!=", builder.load(flag), code.I64(0))
    with builder.if_then(raised, likely=False):
        _return(builder)
