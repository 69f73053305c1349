"""Words of memory that threads share: written by one, seen by others; and how threads wait."""

import platform
import sys
from typing import Any

from llvmlite import ir
from numba import types

from karamelo_py.compiler import code
from karamelo_py.compiler.code import I64
from karamelo_py.compiler.compile import by_type
from karamelo_py.compiler.intrinsics import intrinsic


def word(builder: Any, place: Any) -> Any:
    """Code for the pointer to the word at an address."""
    return builder.inttoptr(place, I64.as_pointer())


@intrinsic
def read(place):
    """Read the word at an address; all is seen that was written before it was."""

    def codegen(builder, signature, values):
        return builder.load_atomic(word(builder, values[0]), "acquire", 8)

    return types.intp(types.intp), codegen


@intrinsic
def write(place, value):
    """Write a word; who sees it sees all that was written before."""

    def codegen(builder, signature, values):
        builder.store_atomic(values[1], word(builder, values[0]), "release", 8)
        return code.nothing()

    return types.none(types.intp, types.intp), codegen


@intrinsic
def add(place, value):
    """Add to a word, which others may do, too."""

    def codegen(builder, signature, values):
        builder.atomic_rmw("add", word(builder, values[0]), values[1], "acq_rel")
        return code.nothing()

    return types.none(types.intp, types.intp), codegen


@intrinsic
def replaced(place, old, new):
    """Put `new` in the place of `old`; false if the word was another one."""

    def codegen(builder, signature, values):
        found = builder.cmpxchg(word(builder, values[0]), *values[1:], "acq_rel", "acquire")
        return builder.extract_value(found, 1)

    return types.boolean(types.intp, types.intp, types.intp), codegen


@intrinsic
def pause(long):
    """Wait a moment; if `long`, sleep."""

    def codegen(builder, signature, values):
        def call(name, result, *numbers):
            function = code.external(builder, name, result, [code.I32] * len(numbers))
            builder.call(function, [code.I32(number) for number in numbers])

        with builder.if_else(values[0]) as (then, otherwise):
            with then:
                if sys.platform == "win32":
                    call("Sleep", ir.VoidType(), 0)
                else:
                    call("usleep", ir.IntType(32), 10)
            with otherwise:
                if platform.machine().lower() in ("x86_64", "amd64"):
                    call("llvm.x86.sse2.pause", ir.VoidType())
        return code.nothing()

    return types.none(types.boolean), codegen


def add_among(array, i, j, value):
    """Add a whole number to an item of an array, which other threads may do, too."""
    array[i, j] += value


@intrinsic
def _add_among(array, i, j, value):
    def codegen(builder, signature, values):
        at = code.item_pointer(builder, array, values[0], values[1:3])
        builder.atomic_rmw("add", at, values[3], "acq_rel")
        return code.nothing()

    return types.none(array, types.int64, types.int64, types.int64), codegen


by_type(add_among)(lambda *_: lambda array, i, j, value: _add_among(array, i, j, value))
