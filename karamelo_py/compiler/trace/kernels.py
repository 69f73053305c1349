"""Kernels: loops called by Python and other kernels, traced as a whole and cached on disk.

A kernel is one LLVM function for argument types, named by the hash of its text. Python calls an
entry of it with the address of the arguments.
"""

import contextvars
import ctypes
import functools
import gc
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from llvmlite import ir
from numba import types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.code import machine
from karamelo_py.compiler.code.arguments import Address, ArgumentBuffer, plan_for, reader
from karamelo_py.compiler.code.builder import Builder
from karamelo_py.compiler.code.exceptions import Failure, failure_at, noting
from karamelo_py.compiler.disk import cache, lock
from karamelo_py.compiler.trace import choices
from karamelo_py.compiler.trace.functions import call_own, chosen, not_inlined, write_into
from karamelo_py.compiler.trace.held import HeldTuple, hold, item_of, text_with_types
from karamelo_py.compiler.trace.lowering import function_type, new_function
from karamelo_py.compiler.trace.primitives import shared
from karamelo_py.compiler.trace.session import one_at_a_time, session
from karamelo_py.compiler.trace.values import (
    builtin,
    called_in_one,
    in_kernels,
    in_one_module,
    intrinsic,
)

_CALL = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3)  # releases the interpreter lock
NAME, ENTRY = "$kernel", ".entry"  # placeholders until a module has a name


class Unit(NamedTuple):
    name: str  # name of the function; the entry for Python has ENTRY added
    result: types.Type
    code: bytes  # object file; empty if the file is to be read from disk
    needs: tuple  # units that this one calls
    modules: frozenset[str]  # modules outside `ROOMS` with sources of this unit and its `needs`
    raises: bool  # whether the kernel can raise exceptions


def load(unit: Unit) -> list[int]:
    with one_at_a_time:
        loaded = session.loaded
        if unit.name not in loaded:
            for needed in unit.needs:
                load(needed)
            content = unit.code or cache.code_of(unit.name)
            addresses = machine.load(content, unit.name, unit.name + ENTRY)
            machine.publish(unit.name, addresses[0])
            loaded[unit.name] = addresses
        return loaded[unit.name]


class Compilation:
    """Reports when this Python thread compiles, or waits for another process that compiles."""

    def __init__(self) -> None:
        self._listeners = contextvars.ContextVar[tuple]("listeners", default=())

    @contextmanager
    def told_to(self, listener: Any) -> Iterator[None]:
        """Call ``on_start(name)`` and ``on_end()`` of a listener."""
        before = self._listeners.set((*self._listeners.get(), listener))
        try:
            yield
        finally:
            self._listeners.reset(before)

    @contextmanager
    def __call__(self, name: str = "") -> Iterator[None]:
        listeners = self._listeners.get()
        for listener in listeners:
            listener.on_start(name)
        try:
            yield
        finally:
            for listener in listeners:
                listener.on_end()


compilation = Compilation()
lock.waiting = compilation


@contextmanager
def _no_collections() -> Iterator[None]:
    """Disable garbage collection, which would traverse a trace without freeing anything."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def written(
    function: Callable,
    kinds: tuple,
    result: types.Type | None = None,
    entry: Callable | None = None,
) -> tuple[ir.Module, types.Type]:
    """Compile a function for argument types; return module and result type.

    The module has `needs` and `raises`, as in `Unit`. ``entry(module, main, kinds, result)`` writes
    an entry that replaces the one for Python.
    """
    with one_at_a_time:
        run = chosen(function, kinds)
        module = ir.Module(NAME)
        module.needs = {}
        main = new_function(module, kinds, result, NAME)
        main.attributes.add("noinline")
        main.attributes.add("nounwind")
        lowering = write_into(Builder(main.append_basic_block("entry")))
        result = lowering.give_back(run, kinds, main.args, result)
        (entry or _write_entry)(module, main, kinds, result)
        module.raises = hasattr(main, "raises")
        return module, result


def _compiled(function: Callable, kinds: tuple, result: types.Type | None) -> Unit:
    with compilation(function.__name__), _no_collections(), choices.modules_noted() as modules:
        choices.note(choices.modules_of(function))
        module, result = written(function, kinds, result)
        text = text_with_types(module)
        readable = re.sub(r"[^\w.]", "_", function.__qualname__, flags=re.ASCII)
        name = f"{readable}.{cache.short_hash(text, machine.describe())}"
        made = cache.machine_code(name, lambda: machine.compile_text(text.replace(NAME, name)))
    needs = tuple(module.needs.values())
    return Unit(name, result, made, needs, frozenset(modules), module.raises)


def items_at(builder: ir.IRBuilder, kinds: tuple, address: Any) -> list:
    types_of_items = HeldTuple(kinds)
    pointer = builder.inttoptr(address, types_of_items.register_type())
    full = (k for k, kind in enumerate(kinds) if not llvm.is_empty(kind))
    return [item_of(builder, types_of_items, pointer, k) for k in full]


def _write_entry(module: ir.Module, main: ir.Function, kinds: tuple, result: types.Type) -> None:
    entry = ir.Function(module, ir.FunctionType(ir.VoidType(), [llvm.I64] * 3), NAME + ENTRY)
    builder = Builder(entry.append_basic_block("entry"))
    value = builder.call(main, [*items_at(builder, kinds, entry.args[0]), entry.args[2]])
    if not llvm.is_empty(result):
        pointer = builder.inttoptr(entry.args[1], llvm.memory_type(result).as_pointer())
        llvm.put(builder, result, value, pointer, 1)
    builder.ret_void()


class Kernel:
    """A function called from Python and kernels, compiled by types and cached on disk.

    Tuples with arrays are passed by reference.
    """

    def __init__(self, function: Callable):
        functools.update_wrapper(self, function)
        self.function = function
        self.files = cache.KernelFiles(function, load)
        self.units: dict[tuple, Unit] = {}
        self._plans: dict[tuple, tuple] = {}
        self._changes = session.changes
        builtin(self)(self.in_kernel)

    def unit(self, kinds: tuple, result: types.Type | None = None) -> Unit:
        with one_at_a_time:
            self._find_changes()
            if kinds not in self.units:
                self.units[kinds] = self.files.kernel(
                    kinds, result, lambda: _compiled(self.function, kinds, result)
                )
            return self.units[kinds]

    def _find_changes(self) -> None:
        if self._changes != session.changes:
            with one_at_a_time:
                self._changes = session.changes
                self.units, self._plans = {}, {}

    def __call__(self, *arguments: Any) -> Any:
        written = ArgumentBuffer(arguments)
        plan, entry, size, read = self._planned(written, arguments)
        _memory, address = written.in_memory(plan)
        result, failure = bytearray(size), Failure()
        at = ctypes.addressof(ctypes.c_char.from_buffer(result))
        try:
            entry(address, at, ctypes.addressof(failure))
        finally:  # Ctrl-C may arrive at the end of a failed call
            failure.raise_first()
        return read(result)

    def compile(self, *arguments: Any) -> None:
        """Prepare a call with these arguments."""
        self._planned(ArgumentBuffer(arguments), arguments)

    def _planned(self, written: ArgumentBuffer, arguments: tuple) -> tuple:
        kinds = tuple(written.kinds)
        self._find_changes()
        plans = self._plans
        if kinds not in plans:
            plan = plan_for(arguments)
            unit = self.unit(plan.types)
            plans[kinds] = plan, _CALL(load(unit)[1]), *reader(unit.result)
        return plans[kinds]

    def in_kernel(self, lowering: Any, *arguments: Any) -> Any:
        values = [lowering.call(hold, (argument,)) for argument in arguments]
        kinds = tuple(types.unliteral(lowering.kind_of(one)) for one in values)
        if in_one_module():
            return call_own(lowering, self.function, kinds, values)
        unit = self.unit(kinds)
        choices.note(unit.modules)
        module = lowering.builder.module
        module.needs[unit.name] = unit
        declared = module.globals.get(unit.name)
        called = declared or new_function(module, kinds, unit.result, unit.name)
        if unit.raises:
            called.raises = True
        return lowering.call_function(called, kinds, unit.result, values)


def kernel(function: Callable) -> Callable:
    """Make a kernel, or return the function if interpreted."""
    return function if choices.INTERPRETED else Kernel(function)


def noinline(function: Callable) -> Callable:
    """Mark a function too large to be inlined in kernels."""
    if not choices.INTERPRETED:
        not_inlined.add(function)
        shared(function)
    return function


def address_of(function: Callable, signature: types.Type) -> int:
    """Compile `function` (cached on disk) and return its address for kernels.

    Callers contain only this address: for another function, they need not be compiled again.
    """
    key = function, signature, session.changes
    addresses = session.addresses
    if key not in addresses:
        if choices.INTERPRETED:
            addresses[key] = address_of_python(function, signature)
        else:
            addresses[key] = load(Kernel(function).unit(signature.args, signature.return_type))[0]
    return addresses[key]


def address_of_python(function: Callable, signature: types.Type) -> Address:
    """Return the address by which kernels call a Python function of integers.

    Exceptions of the function are raised after the kernel. Keep the `Address` itself, not an int
    made from it, while kernels may call the function.
    """
    if choices.INTERPRETED:
        callback: Any = functools.partial(function)  # a bound method would be freed at once
        address = Address(next(session.numbers))
        session.interpreted[int(address)] = callback
    else:
        count = len(signature.args) + 1  # the last argument is for exceptions
        callback = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * count)(noting(function))
        address = Address(ctypes.cast(callback, ctypes.c_void_p).value or 0)
    address.callback = callback
    return address


def caller_of(signature: Any) -> Callable:
    """Make ``call(address, ...)`` for functions of this signature."""
    result, parameters = signature.return_type, signature.args

    if choices.INTERPRETED:
        return lambda address, *arguments: session.interpreted[address](*arguments)

    @intrinsic
    def by_address(address, *arguments):
        def codegen(builder, address_value, *values):
            kind = function_type(parameters, result, llvm.I64)
            pointer = builder.inttoptr(address_value, kind.as_pointer())
            return builder.call(pointer, [*values, failure_at(builder)])

        return result(types.int64, *parameters), codegen

    @in_kernels
    def call(lowering, address, *arguments):
        replacement = called_in_one(signature)
        if not replacement:
            return lowering.call(by_address, (address, *arguments))
        pairs = zip(arguments, parameters, strict=True)
        return lowering.seen(replacement)(*[lowering.cast(a, kind) for a, kind in pairs])

    return call
