"""Functions that kernels call by their address, and do not contain."""

import ctypes
import inspect
from collections.abc import Callable

import numba
from llvmlite import ir
from numba import config
from numba.core.ccallback import CFunc
from numba.extending import intrinsic

from karamelo_py.compiler.cache import KernelCache
from karamelo_py.compiler.compile import define, shared

_uncompiled: list[Callable] = []
_addresses: dict[Callable, int] = {}
_keep_alive: list = []


def address_of(function: Callable, signature: numba.types.Type) -> int:
    """Compile `function` (cached on disk) and return the address that kernels call it by.

    Whoever calls by address does not contain the function: it need not be compiled anew for
    another one, and the function is compiled once for all its callers.
    """
    if function not in _addresses:
        if config.DISABLE_JIT:
            _uncompiled.append(function)
            _addresses[function] = len(_uncompiled) - 1
        else:
            options = {"error_model": "numpy"}
            entry = _entry_of(function)
            compiled = CFunc(entry, (signature.args, signature.return_type), {}, options)
            compiled._cache = KernelCache(entry, options)
            compiled.compile()
            _keep_alive.append(compiled)
            _addresses[function] = compiled.address
    return _addresses[function]


def _entry_of(function: Callable) -> Callable:
    """A function of the same name that calls it, so that it is traced."""
    names = ", ".join(inspect.signature(function).parameters)
    entry = define(names, f"return inner({names})", inner=shared(function))
    entry.__module__, entry.__qualname__ = function.__module__, function.__qualname__
    return entry


def address_of_python(function: Callable, signature: numba.types.Type) -> int:
    """The address by which kernels call a function of Python, of whole numbers.

    Nothing may be raised in it.
    """
    if config.DISABLE_JIT:
        _uncompiled.append(function)
        return len(_uncompiled) - 1
    made = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * len(signature.args))(function)
    _keep_alive.append(made)
    return ctypes.cast(made, ctypes.c_void_p).value


def caller_of(signature: numba.types.Type) -> Callable:
    """Make ``call(address, ...)``, which calls a function of this signature by its address."""
    result, parameters = signature.return_type, signature.args

    if config.DISABLE_JIT:
        return lambda address, *arguments: _uncompiled[address](*arguments)

    def codegen(context, builder, _, arguments):
        kind = ir.FunctionType(
            context.get_value_type(result), [context.get_value_type(p) for p in parameters]
        )
        pointer = builder.inttoptr(arguments[0], kind.as_pointer())
        return builder.call(pointer, arguments[1:])

    names = ", ".join(f"a{k}" for k in range(len(parameters)))
    call = define(
        f"typing_context, address, {names}",
        "return typed, codegen",
        typed=result(numba.types.int64, *parameters),
        codegen=codegen,
    )
    return intrinsic(call)
