"""Traced values: numbers, lanes, arrays and held tuples, on which every operation becomes code."""

import contextvars
import functools
import math
import operator
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numba import types

from karamelo_py.compiler.llvm import Lanes, scalar_of
from karamelo_py.compiler.trace.choices import tag_class
from karamelo_py.compiler.trace.session import session


class Untraceable(BaseException):
    """A function cannot be compiled. Traced functions must not catch this exception."""


def words(kind: types.Type) -> str:
    if isinstance(kind, types.BaseTuple):
        tag = tag_class(kind)
        return tag.__name__ if tag else "a tuple"
    if isinstance(kind, Lanes):
        return f"numbers in lanes ({kind})"
    return next((name for one, name in _WORDS if isinstance(kind, one)), str(kind))


_WORDS = (
    (types.Boolean | types.BooleanLiteral, "a truth value"),
    (types.Integer, "a whole number"),
    (types.Float, "a number"),
    (types.Array, "an array"),
    (types.NoneType, "None"),
    (types.UnicodeType | types.StringLiteral, "a text"),
)


def _only_at_run_time(use: str) -> Callable:
    """Return a method for a `use` that needs the value at compile time."""

    def ask(*arguments: Any) -> Any:
        raise Untraceable(f"{use} is only known when the kernel runs")

    return ask


# Active lowerings of each Python thread, innermost last.
_lowerings: contextvars.ContextVar[tuple] = contextvars.ContextVar("lowerings", default=())
at_work = _lowerings.get  # every call of a point function asks


def now() -> Any:
    return _lowerings.get()[-1]


@contextmanager
def writing(lowering: Any) -> Iterator[None]:
    """Within this context, operations become code of `lowering`."""
    before = _lowerings.set((*_lowerings.get(), lowering))
    try:
        yield
    finally:
        _lowerings.reset(before)


def is_begun(key: tuple) -> bool:
    return any(key in lowering.begun for lowering in _lowerings.get())


def _real_kind(thing: Any) -> Any:
    kind = scalar_of(thing._kind) if isinstance(thing, Value) else None
    return kind if isinstance(kind, types.Float) else None


def alike(arguments: tuple) -> tuple:
    """Convert literals and integers to the widest real type of the arguments."""
    kinds = [kind for kind in map(_real_kind, arguments) if kind is not None]
    if not kinds:
        return arguments
    kind = max(kinds, key=lambda k: k.bitwidth)
    model = next(a for a in arguments if _real_kind(a) is kind)
    return tuple([_in_type_of(model, kind, a) for a in arguments])


def _in_type_of(model: Any, kind: Any, thing: Any) -> Any:
    if type(thing) in (int, float):
        with np.errstate(over="ignore"):
            return thing if kind.bitwidth == 64 else np.float32(thing)
    if isinstance(thing, Value):
        scalar = scalar_of(thing._kind)
        if isinstance(scalar, types.Integer) and not isinstance(scalar, types.Boolean):
            return now().in_type_of(thing, model)
    return thing


# Replacements of functions called by address, for modules that contain all functions they call.
_replacements: contextvars.ContextVar[tuple | None] = contextvars.ContextVar("called", default=None)


@contextmanager
def in_one(called: dict[Any, Callable]) -> Iterator[None]:
    """Within this context, write modules for GPUs, which contain all functions they call.

    `called` maps each signature called by address to the inlined function.
    """
    before = _replacements.set(tuple(called.items()))
    try:
        yield
    finally:
        _replacements.reset(before)


all_called_in_one = _replacements.get  # None if modules may call other modules


def in_one_module() -> bool:
    return _replacements.get() is not None


def called_in_one(signature: Any) -> Callable | None:
    return dict(_replacements.get() or ()).get(signature)


def emit(function: Callable, *arguments: Any) -> Any:
    return now().call(function, arguments)


def builtin(function: Callable) -> Callable[[Callable], Callable]:
    """Decorate the code of `function`: ``made(lowering, *arguments)``, traced."""

    def register(made: Callable) -> Callable:
        session.builtins[function] = made
        return made

    return register


def in_kernels(made: Callable) -> Callable:
    return builtin(made)(made)


class Intrinsic:
    """A function of values, defined by its signature for types and its code.

    ``definition(*types)`` returns ``result(*arguments)`` and ``codegen(builder, *values)``, or None
    if it is not defined for these types. Integer types with known values are tried last.
    """

    def __init__(self, definition: Callable):
        self.definition = definition
        functools.update_wrapper(self, definition)

    def __call__(self, *arguments: Any) -> Any:
        raise NotImplementedError(f"only kernels can call {self.__qualname__}")


intrinsic = Intrinsic


class Value:
    """A number, lanes or an array of the traced function."""

    __slots__ = ("_kind", "_value")
    __array_ufunc__ = None  # NumPy leaves operations to this

    def __init__(self, kind: types.Type, value: Any):
        self._kind, self._value = kind, value

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return now().attribute(self, name)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in Value.__slots__:
            object.__setattr__(self, name, value)
        else:
            now().set_attribute(self, name, value)

    def __getitem__(self, index: Any) -> Any:
        return emit(operator.getitem, self, index)

    def __setitem__(self, index: Any, value: Any) -> None:
        emit(operator.setitem, self, index, value)

    __bool__ = _only_at_run_time("a condition in an expression within an expression")
    __int__ = __index__ = __float__ = _only_at_run_time("a number that has to be written")
    __iter__ = __len__ = __contains__ = _only_at_run_time("an iteration, length or membership")
    __hash__ = _only_at_run_time("a key")
    __str__ = __repr__ = __format__ = _only_at_run_time("a number in a text")


_BINARY = ("add", "sub", "mul", "truediv", "floordiv", "mod", "pow")
_BITS = ("and_", "or_", "xor", "lshift", "rshift")


def _operated(operation: Callable, a: Any, b: Any) -> Any:
    if isinstance(a if isinstance(b, Value) else b, tuple):
        return NotImplemented
    if operation is operator.pow and type(b) is int and 1 < b <= 4 and _real_kind(a):
        square = a * a
        return square if b == 2 else square * (a if b == 3 else square)
    return emit(operation, *alike((a, b)))


def _in_place(operation: Callable) -> Callable:
    def apply(a: Value, b: Any) -> Any:
        if isinstance(a._kind, types.Array):  # the array would be changed in place
            raise Untraceable("an array cannot be changed as a whole: change its items")
        return _operated(operation, a, b)

    return apply


def _operators() -> None:
    for name in (*_BINARY, *_BITS):
        operation = getattr(operator, name)
        plain = name.rstrip("_")
        setattr(Value, f"__{plain}__", lambda a, b, do=operation: _operated(do, a, b))
        setattr(Value, f"__r{plain}__", lambda a, b, do=operation: _operated(do, b, a))
        setattr(Value, f"__i{plain}__", _in_place(operation))
    for name in ("lt", "le", "gt", "ge", "eq", "ne"):
        operation = getattr(operator, name)
        setattr(Value, f"__{name}__", lambda a, b, do=operation: _operated(do, a, b))
    for name in ("neg", "pos", "invert"):
        operation = getattr(operator, name)
        setattr(Value, f"__{name}__", lambda a, do=operation: emit(do, a))
    Value.__abs__ = lambda a: emit(abs, a)


_operators()


def rebuilt(model: tuple, items: Iterable) -> tuple:
    return type(model)(*items) if hasattr(model, "_fields") else tuple(items)


def mapped(change: Callable, thing: Any) -> Any:
    if isinstance(thing, tuple):
        return rebuilt(thing, [mapped(change, item) for item in thing])
    return change(thing)


class HeldValue:
    """A held tuple; items are read on access, once per branch."""

    __slots__ = ("_kind", "_value")

    def __init__(self, kind: types.BaseTuple, value: Any):
        self._kind, self._value = kind, value

    def __len__(self) -> int:
        return len(self._kind)

    def __getitem__(self, k: int) -> Any:
        if isinstance(k, Value):
            raise Untraceable("the number of an item of a tuple is only known when the kernel runs")
        if isinstance(k, slice):
            return tuple(self[i] for i in range(*k.indices(len(self))))
        return now().item(self, range(len(self))[k])

    def __iter__(self) -> Iterator:
        return (self[k] for k in range(len(self)))

    def __getattr__(self, name: str) -> Any:
        if name in self._kind.fields:
            return self[self._kind.fields.index(name)]
        attribute = getattr(self._kind.instance_class, name)
        if callable(attribute) or isinstance(attribute, property):
            raise Untraceable(f"'{name}' is a method of a tuple with arrays")
        return now().seen(attribute) if isinstance(attribute, tuple) else attribute

    __eq__ = __ne__ = __hash__ = __contains__ = _only_at_run_time("a tuple with arrays")
    __add__ = __radd__ = __eq__


def implementations(kind: type) -> dict[Callable, Callable] | None:
    return kind.implements if hasattr(kind, "implements") else None


def implemented(function: Callable, arguments: tuple) -> Callable | None:
    for a in arguments:
        if isinstance(a, tuple):
            table = implementations(type(a))
            made = implemented(function, a) if table is None else table.get(function)
            if made is not None:
                return made
    return None


def is_literal(thing: Any) -> bool:
    return type(thing) in (int, float)


class Emitted:
    """A function that has another version in kernels."""

    def __init__(self, function: Callable):
        self.seen = function

    def __call__(self, *arguments: Any) -> Any:
        if self.seen in OF_WHOLE and all(isinstance(a, int) for a in arguments):
            return self.seen(*arguments)
        made = implemented(self.seen, arguments)
        if made is not None:
            return now().seen(made)(*arguments)
        if self.seen in OF_REALS:
            if self.seen not in session.choosers and all(map(is_literal, arguments)):
                return self.seen(*arguments)
            arguments = alike(arguments)
        return emit(self.seen, *arguments)

    def defined(self, *classes: type) -> bool:
        return self.seen.defined(*classes)

    def find(self, classes: tuple) -> Callable:
        return now().seen(self.seen.find(classes))


OF_WHOLE = {min, max, abs, int, bool}
# Functions whose literals take the type of other operands; more are added by name.
OF_REALS = {min, max, *(f for n, f in vars(math).items() if callable(f) and n[0] != "_")}

LONG = 8  # iterations up to which a known range is unrolled, even if the loop could remain a loop
