"""Exceptions in kernels: noted where they are raised, and raised by Python behind the kernel."""

import ctypes
import functools
import pickle
from collections.abc import Callable
from typing import Any

from llvmlite import ir

from karamelo_py.compiler import code, machine

_failed = ctypes.c_int64(0)  # whether something was raised
_noted: list[BaseException] = []
_NOTE = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64)


def note(error: BaseException) -> None:
    """Have an exception raised behind the kernel that is at work."""
    _noted.append(error)
    _failed.value = 1


def noting(function: Callable) -> Callable:
    """Note what a function that kernels call raises, Ctrl-C too: Python drops it there."""

    @functools.wraps(function)
    def call(*arguments: Any) -> Any:
        try:
            return function(*arguments)
        except BaseException as error:
            note(error)
            return 0

    return call


@noting
def _note(text: int, size: int) -> None:
    kind, arguments = pickle.loads(ctypes.string_at(text, size))
    note(kind(*arguments))


machine.publish("karamelo_failed", ctypes.addressof(_failed))
machine.publish_python("karamelo_fail", _NOTE, _note)


def raise_noted() -> None:
    """Raise what a kernel has noted first, if it did."""
    if _failed.value:
        first = _noted[0]
        _noted.clear()
        _failed.value = 0
        raise first


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
    function = code.external(builder, "karamelo_fail", ir.VoidType(), [code.I64] * 2)
    builder.call(function, [builder.ptrtoint(place, code.I64), code.I64(len(text))])
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
    flag = builder.module.globals.get("karamelo_failed")
    if flag is None:
        flag = ir.GlobalVariable(builder.module, code.I64, "karamelo_failed")
    raised = builder.icmp_signed("!=", builder.load(flag), code.I64(0))
    with builder.if_then(raised, likely=False):
        _return(builder)
