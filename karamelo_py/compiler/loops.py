"""Kernels: loops that Python and other kernels call, traced as a whole and kept on disk.

A kernel is one function of LLVM for arguments of some types, with a name that nothing else has: the
hash of its text is in it. Python writes the arguments into memory (`argument_buffer`) and calls its
entry with their address; kernels that call it refer to its name, and do not contain it.
"""

import contextvars
import ctypes
import functools
import gc
import hashlib
import itertools
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

from llvmlite import ir
from numba import types

from karamelo_py.compiler import cache, choices, code, compile_lock, machine, trace
from karamelo_py.compiler.argument_buffer import Address, ArgumentBuffer, plan_for, reader
from karamelo_py.compiler.choices import Choice
from karamelo_py.compiler.compile import shared
from karamelo_py.compiler.failing import Failure, failure_at, noting
from karamelo_py.compiler.held import HeldTuple, hold, item_of
from karamelo_py.compiler.lowering import function_type, new_function
from karamelo_py.compiler.trace import alone, formula, one_at_a_time, write_into
from karamelo_py.compiler.values import (
    Untraceable,
    builtin,
    called_in_one,
    in_kernels,
    in_one_module,
    intrinsic,
)

_CALL = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3)  # free of the interpreter lock
NAME, ENTRY = "$kernel", ".entry"  # what functions of a module are called until it has a name


class Unit(NamedTuple):
    """Hold the machine code of a function for arguments of some types."""

    name: str  # that of its entry for Python has an ending more
    result: types.Type
    code: bytes  # an object file
    needs: tuple  # the units that it calls
    choices: frozenset[Choice]  # what point functions were asked for, also those of its needs
    raises: bool  # whether something in it raises exceptions


_loaded: dict[str, list[int]] = {}


def load(unit: Unit) -> list[int]:
    """Give the addresses of a unit's function and of its entry, in memory from then on."""
    with one_at_a_time:
        if unit.name not in _loaded:
            for needed in unit.needs:
                load(needed)
            found = machine.load(unit.code, unit.name, unit.name + ENTRY)
            machine.publish(unit.name, found[0])
            _loaded[unit.name] = found
        return _loaded[unit.name]


class Compilation:
    """Tell of compilation by this thread of Python, or that it waits for another process."""

    def __init__(self) -> None:
        self._listeners = contextvars.ContextVar[tuple]("listeners", default=())

    @contextmanager
    def told_to(self, listener: Any) -> Iterator[None]:
        """Call ``on_start(name)`` and ``on_end()`` of a listener meanwhile."""
        before = self._listeners.get()
        self._listeners.set((*before, listener))
        try:
            yield
        finally:
            self._listeners.set(before)

    @contextmanager
    def __call__(self, name: str = "") -> Iterator[None]:
        """Tell that a kernel is compiled meanwhile, or that another process does it."""
        listeners = self._listeners.get()
        for listener in listeners:
            listener.on_start(name)
        try:
            yield
        finally:
            for listener in listeners:
                listener.on_end()


compilation = Compilation()
compile_lock.waiting = compilation


@contextmanager
def _no_collections() -> Iterator[None]:
    """Python's collector of cycles would walk the many objects of a trace in vain."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def many_threads() -> bool:
    """Tell whether thousands of others may write to one number meanwhile: see `values.in_one`."""
    return False


@builtin(many_threads)
def _many_threads(lowering: Any) -> bool:
    return in_one_module()


def written(
    function: Callable,
    kinds: tuple,
    result: types.Type | None = None,
    entry: Callable | None = None,
) -> tuple[ir.Module, types.Type]:
    """Write a function down for arguments of these types; the module, and the type of its result.

    Attributes of the module are `needs`, the units that it calls, and `raises`, as in `Unit`.
    ``entry(module, main, kinds, result)`` writes what it is called by, if not by Python.
    """
    with one_at_a_time:
        found = formula(function, kinds)
        result = found.result if result is None else result
        module = ir.Module(NAME)
        module.needs = {}
        main = new_function(module, kinds, result, NAME)
        main.attributes.add("noinline")
        main.attributes.add("nounwind")
        lowering = write_into(ir.IRBuilder(main.append_basic_block("entry")))
        try:
            lowering.give_back(found.run, kinds, main.args, result)
        except Untraceable as why:
            raise trace.CannotCompile(str(why), function) from why
        (entry or _write_entry)(module, main, kinds, result)
        module.raises = hasattr(main, "raises")
        return module, result


def _compiled(function: Callable, kinds: tuple, result: types.Type | None) -> tuple[Unit, Any]:
    """Compile a function; the unit, and the Python functions that it was made of."""
    with compilation(function.__name__), _no_collections(), choices.parts_noted() as parts:
        module, result = written(function, kinds, result)
        text = str(module)
        readable = re.sub(r"[^\w.]", "_", function.__qualname__, flags=re.ASCII)
        name = f"{readable}.{hashlib.sha256(text.encode()).hexdigest()[:32]}"
        made = machine.compile_text(text.replace(NAME, name))
    unit = Unit(name, result, made, tuple(module.needs.values()), frozenset(), module.raises)
    try:
        found, codes = choices.contents(parts)
    except choices.Unknown as what:
        return unit, what
    return unit._replace(choices=found), codes


def items_at(builder: ir.IRBuilder, kinds: tuple, address: Any) -> list:
    """Write what reads arguments of these types from memory."""
    held = HeldTuple(kinds)
    place = builder.inttoptr(address, held.register_type())
    full = (k for k, kind in enumerate(kinds) if not code.is_empty(kind))
    return [item_of(builder, held, place, k) for k in full]


def _write_entry(module: ir.Module, main: ir.Function, kinds: tuple, result: types.Type) -> None:
    """Write what calls a function with arguments in memory, and puts there what it gives.

    It is called with the addresses of these, and of a `Failure`.
    """
    entry = ir.Function(module, ir.FunctionType(ir.VoidType(), [code.I64] * 3), NAME + ENTRY)
    builder = ir.IRBuilder(entry.append_basic_block("entry"))
    given = builder.call(main, [*items_at(builder, kinds, entry.args[0]), entry.args[2]])
    if not code.is_empty(result):
        room = builder.inttoptr(entry.args[1], code.memory_type(result).as_pointer())
        code.put(builder, result, given, room, 1)
    builder.ret_void()


class Kernel:
    """Call a function from Python and from other kernels, compiled for types and kept on disk.

    It takes its tuples by reference.
    """

    def __init__(self, function: Callable):
        functools.update_wrapper(self, function)
        self.function = function
        self.files = cache.KernelFiles(function, load)
        self.units: dict[tuple, Unit] = {}
        self._plans: dict[tuple, tuple] = {}
        self._changes = trace.changes
        builtin(self)(self.in_kernel)

    @property
    def made_of(self) -> tuple:
        """Name what code that calls it depends on (:mod:`karamelo_py.compiler.fingerprint`)."""
        return (self.function,)

    def unit(self, kinds: tuple, result: types.Type | None = None) -> Unit:
        """Give the machine code for arguments of these types."""
        with one_at_a_time:
            if self._changes != trace.changes:
                self._find_anew()
            if kinds not in self.units:
                self.units[kinds] = self.files.kernel(
                    kinds, result, lambda: _compiled(self.function, kinds, result)
                )
            return self.units[kinds]

    def _find_anew(self) -> None:
        """Forget what was compiled: implementations have changed."""
        with one_at_a_time:
            self._changes = trace.changes
            self.units, self._plans = {}, {}

    def __call__(self, *arguments: Any) -> Any:
        written = ArgumentBuffer(arguments)
        plan, entry, size, read = self._planned(written, arguments)
        _memory, address = written.in_memory(plan)
        result, failure = bytearray(size), Failure()
        at = ctypes.addressof(ctypes.c_char.from_buffer(result))
        try:
            entry(address, at, ctypes.addressof(failure))
        finally:  # also where Ctrl-C comes at the end of what has failed
            failure.raise_first()
        return read(result)

    def compile(self, *arguments: Any) -> None:
        """Have it compiled for arguments of these types, and all ready for a call with them."""
        self._planned(ArgumentBuffer(arguments), arguments)

    def _planned(self, written: ArgumentBuffer, arguments: tuple) -> tuple:
        """Say how arguments are passed, the entry, and the size and the reader of the result."""
        kinds = tuple(written.kinds)
        if self._changes != trace.changes:
            self._find_anew()
        plans = self._plans
        if kinds not in plans:
            plan = plan_for(arguments)
            unit = self.unit(plan.types)
            plans[kinds] = plan, _CALL(load(unit)[1]), *reader(unit.result)
        return plans[kinds]

    def in_kernel(self, lowering: Any, *arguments: Any) -> Any:
        """Write a call from another kernel."""
        held = [lowering.call(hold, (argument,)) for argument in arguments]
        kinds = tuple(types.unliteral(lowering.kind_of(one)) for one in held)
        if in_one_module():
            own = formula(self.function, kinds)
            return lowering.call_own(own.name, own.run, kinds, own.result, held)
        unit = self.unit(kinds)
        choices.note(unit.choices)
        choices.note([self.function.__code__])
        if lowering.builder is None:
            return lowering.wrapped(unit.result, None)
        module = lowering.builder.module
        module.needs[unit.name] = unit
        known = module.globals.get(unit.name)
        called = known or new_function(module, kinds, unit.result, unit.name)
        if unit.raises:
            called.raises = True
        return lowering.call_function(called, kinds, unit.result, held)


def kernel(function: Callable) -> Callable:
    """Make a kernel; interpreted, the function itself is one.

    No fast mathematics: where products and sums contract would depend on what a loop is inlined
    into. `fma` says where.
    """
    return function if choices.INTERPRETED else Kernel(function)


def noinline(function: Callable) -> Callable:
    """Mark a function that kernels call, too large to be written into each place that calls it."""
    if not choices.INTERPRETED:
        alone(function)
        shared(function)
    return function


# --- functions that kernels call by their address, and do not contain -----------------------------

# Interpreted; an `Address` keeps the function.
_interpreted: WeakValueDictionary[int, Callable] = WeakValueDictionary()
_numbers = itertools.count()  # of these
_addresses: dict[tuple[Callable, types.Type, int], int] = {}


def address_of(function: Callable, signature: types.Type) -> int:
    """Compile `function` (cached on disk) and return the address that kernels call it by.

    Whoever calls by address does not contain the function: it need not be compiled anew for
    another one, and the function is compiled once for all its callers.
    """
    key = function, signature, trace.changes
    if key not in _addresses:
        if choices.INTERPRETED:
            _addresses[key] = address_of_python(function, signature)
        else:
            _addresses[key] = load(Kernel(function).unit(signature.args, signature.return_type))[0]
    return _addresses[key]


def address_of_python(function: Callable, signature: types.Type) -> Address:
    """Give the address by which kernels call a function of Python, of whole numbers.

    What is raised in it is raised again behind the kernel. Keep the `Address`, rather than an int
    made of it, as long as kernels may call it.
    """
    if choices.INTERPRETED:
        callback: Any = functools.partial(function)  # a bound method would be gone at once
        address = Address(next(_numbers))
        _interpreted[int(address)] = callback
    else:
        count = len(signature.args) + 1  # the last one is for what it raises
        callback = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * count)(noting(function))
        address = Address(ctypes.cast(callback, ctypes.c_void_p).value or 0)
    address.callback = callback
    return address


def caller_of(signature: Any) -> Callable:
    """Make ``call(address, ...)``, which calls a function of this signature by its address."""
    result, parameters = signature.return_type, signature.args

    if choices.INTERPRETED:
        return lambda address, *arguments: _interpreted[address](*arguments)

    @intrinsic
    def by_address(address, *arguments):
        def codegen(builder, place, *values):
            kind = function_type(parameters, result, code.I64)
            pointer = builder.inttoptr(place, kind.as_pointer())
            return builder.call(pointer, [*values, failure_at(builder)])

        return result(types.int64, *parameters), codegen

    @in_kernels
    def call(lowering, address, *arguments):
        own = called_in_one(signature)
        if not own:
            return lowering.call(by_address, (address, *arguments))
        pairs = zip(arguments, parameters, strict=True)
        return lowering.seen(own)(*[lowering.cast(a, kind) for a, kind in pairs])

    return call
