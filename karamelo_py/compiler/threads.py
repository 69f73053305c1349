"""Loops that threads share out: one for all kernels, which calls what is done by its address.

Numba compiles a loop over threads in five functions, and takes the tuples that it works with apart
and puts them together again in each. Here the arguments stay where they are; what is done with them
is a function of where that is, and a number.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from numba import prange, types
from numba.extending import intrinsic

from karamelo_py.compiler import inlining
from karamelo_py.compiler.compile import by_type, define, kernel, left
from karamelo_py.compiler.held import HeldTuple, address, at_address, held_type, hold


class Serial(NamedTuple):
    """One thread."""


class Threaded(NamedTuple):
    """All threads that Numba was given."""


_TASK = types.none(types.intp, types.intp)  # where its arguments are, and a number


@intrinsic
def _address_of(typing_context, function):
    """Where the code of a function of this signature is."""
    dispatcher = function.dispatcher
    dispatcher.compile(_TASK.args)

    def codegen(context, builder, signature, arguments):
        compiled = dispatcher.overloads[_TASK.args]
        context.active_code_library.add_linking_library(compiled.library)
        function = context.declare_function(builder.module, compiled.fndesc)
        return builder.ptrtoint(function, context.get_value_type(types.intp))

    return types.intp(function), codegen


@intrinsic
def _call(typing_context, task, arguments, number):
    """Call the function at an address."""

    def codegen(context, builder, signature, values):
        convention = context.call_conv
        kind = convention.get_function_type(_TASK.return_type, _TASK.args)
        function = builder.inttoptr(values[0], kind.as_pointer())
        convention.call_function(builder, function, _TASK.return_type, _TASK.args, values[1:])
        return context.get_dummy_value()

    return types.none(types.intp, types.intp, types.intp), codegen


def _in_parallel(count, task, arguments):
    for number in prange(count):
        _call(task, arguments, number)


inlining.claim(_in_parallel.__qualname__, "kept")
_in_parallel = kernel(_in_parallel, parallel=True, no_cpython_wrapper=True)


def shared_out(function: Callable, parameters: str) -> Callable:
    """Make ``f(mode, count, ...)``: ``function(..., k)`` for each k below `count`.

    `parameters` are the names of what stands before k.
    """

    def loop(mode, count, *arguments):
        for k in range(count):
            function(*arguments, k)

    @by_type(loop)
    def _(mode, count, *arguments):
        names = f"mode, count, {parameters}"
        if mode.instance_class is not Threaded:
            lines = "for k in range(count):", f"    function({parameters}, k)"
            return define(names, *lines, function=function)
        held = HeldTuple(tuple(held_type(argument) for argument in arguments))
        items = ", ".join(f"a[{k}]" for k in range(len(held)))
        task = define(
            "arguments, k", "a = at(arguments)", f"function({items}, k)",
            at=at_address(held), function=function,
        )  # fmt: skip
        task.__qualname__ = f"{function.__qualname__}.task"
        return define(
            names,
            f"in_parallel(count, address_of(body), address(hold(({parameters}))))",
            in_parallel=_in_parallel, address_of=_address_of, body=left(task),
            address=address, hold=hold,
        )  # fmt: skip

    return loop
