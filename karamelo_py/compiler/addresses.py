"""Functions that kernels call by their address, and do not contain."""

import ctypes
from collections.abc import Callable
from typing import Any

from numba import config, types

from karamelo_py.compiler.failing import noting
from karamelo_py.compiler.loops import address_in_memory
from karamelo_py.compiler.lowering import function_type
from karamelo_py.compiler.values import intrinsic

_uncompiled: list[Callable] = []
_addresses: dict[Callable, int] = {}
_keep_alive: list = []


def address_of(function: Callable, signature: types.Type) -> int:
    """Compile `function` (cached on disk) and return the address that kernels call it by.

    Whoever calls by address does not contain the function: it need not be compiled anew for
    another one, and the function is compiled once for all its callers.
    """
    if function not in _addresses:
        if config.DISABLE_JIT:
            _addresses[function] = address_of_python(function, signature)
        else:
            kinds, result = signature.args, signature.return_type
            _addresses[function] = address_in_memory(function, kinds, result)
    return _addresses[function]


def address_of_python(function: Callable, signature: types.Type) -> int:
    """Give the address by which kernels call a function of Python, of whole numbers.

    What is raised in it is raised again behind the kernel.
    """
    if config.DISABLE_JIT:
        _uncompiled.append(function)
        return len(_uncompiled) - 1
    made = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * len(signature.args))(
        noting(function)
    )
    _keep_alive.append(made)
    return ctypes.cast(made, ctypes.c_void_p).value


def caller_of(signature: Any) -> Callable:
    """Make ``call(address, ...)``, which calls a function of this signature by its address."""
    result, parameters = signature.return_type, signature.args

    if config.DISABLE_JIT:
        return lambda address, *arguments: _uncompiled[address](*arguments)

    @intrinsic
    def call(address, *arguments):
        def codegen(builder, place, *values):
            kind = function_type(parameters, result)
            return builder.call(builder.inttoptr(place, kind.as_pointer()), values)

        return result(types.int64, *parameters), codegen

    return call
