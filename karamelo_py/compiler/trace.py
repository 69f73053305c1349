"""Point functions are run once, on values of the function that is compiled, and written down.

Numba makes code of a function in twenty passes, fifteen milliseconds for the smallest: half of a
first compilation. A point function is a formula for most classes of tags: without branches on
numbers, loops that end. So where a kernel calls one, it is run by Python itself, on a
:class:`Value` in the place of each number, and every operation that meets one is lowered at once,
into the function that calls. What each operation is, on numbers, lanes and arrays, is asked of
Numba; tuples are Python's own, so that what only takes them apart costs nothing. The bits are the
same. A function that asks what only a run can know (`if x > 0`) is compiled by Numba as a whole.

Functions run here see their globals through :class:`_Globals`: what other code chooses by type is
lowered for the types at hand, Python's functions are run in the same way.
"""

from __future__ import annotations

import builtins
import functools
import operator
import types as python
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core.imputils import lower_builtin
from numba.core.registry import cpu_target
from numba.core.typing.templates import (
    AbstractTemplate,
    fold_arguments,
    infer_global,
    signature,
)

from karamelo_py.compiler.fingerprint import note, parts_noted, tag_class
from karamelo_py.compiler.held import _Held, item_of


class Untraceable(Exception):
    """A function asks for what only a run can know."""


# --- values -------------------------------------------------------------------------------------


class Value:
    """A number, lanes or an array of the function that is compiled."""

    __slots__ = ("kind", "value")
    __array_ufunc__ = None  # NumPy's numbers leave operations to this

    def __init__(self, kind: types.Type, value: Any):
        self.kind, self.value = kind, value

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return _now().attribute(self, name)

    def __setitem__(self, place: Any, value: Any) -> None:
        emit(operator.setitem, self, place, value)

    def _unknown(self, *arguments: Any) -> Any:
        raise Untraceable

    __bool__ = __int__ = __index__ = __float__ = __iter__ = __len__ = _unknown
    __contains__ = __pow__ = __rpow__ = _unknown
    __hash__ = object.__hash__


_BINARY = ("add", "sub", "mul", "truediv", "floordiv", "mod")
_BITS = ("and_", "or_", "xor", "lshift", "rshift")


def _operators() -> None:
    for name in (*_BINARY, *_BITS):
        operation = getattr(operator, name)
        plain = name.rstrip("_")
        setattr(Value, f"__{plain}__", lambda a, b, do=operation: emit(do, a, b))
        setattr(Value, f"__r{plain}__", lambda a, b, do=operation: emit(do, b, a))
    for name in ("lt", "le", "gt", "ge", "eq", "ne", "getitem"):
        operation = getattr(operator, name)
        setattr(Value, f"__{name}__", lambda a, b, do=operation: emit(do, a, b))
    for name in ("neg", "pos", "invert"):
        operation = getattr(operator, name)
        setattr(Value, f"__{name}__", lambda a, do=operation: emit(do, a))
    Value.__abs__ = lambda a: emit(abs, a)


class HeldValue:
    """A held tuple: its items are read when they are asked for."""

    __slots__ = ("kind", "read", "value")

    def __init__(self, kind: _Held, value: Any):
        self.kind, self.value, self.read = kind, value, {}

    def __len__(self) -> int:
        return len(self.kind)

    def __getitem__(self, k: int) -> Any:
        if isinstance(k, Value):
            raise Untraceable
        if isinstance(k, slice):
            return tuple(self[i] for i in range(*k.indices(len(self))))
        k = range(len(self))[k]
        if k not in self.read:
            self.read[k] = _now().item(self, k)
        return self.read[k]

    def __iter__(self) -> Iterator:
        return (self[k] for k in range(len(self)))

    def __getattr__(self, name: str) -> Any:
        fields = getattr(self.kind, "fields", ())
        if name in fields:
            return self[fields.index(name)]
        return getattr(self.kind.instance_class, name)


def _class_of(thing: Any) -> type:
    return getattr(thing.kind, "instance_class", tuple) if type(thing) is HeldValue else type(thing)


def _is_instance(thing: Any, kind: type) -> bool:
    return issubclass(_class_of(thing), kind)


# --- the function that is compiled ----------------------------------------------------------------


class _Lowering(NamedTuple):
    """Where code goes to: to a builder, or nowhere while only types are asked for."""

    typing: Any
    context: Any = None
    builder: Any = None

    def wrapped(self, kind: types.Type, value: Any) -> Any:
        """What point functions see of a value."""
        if isinstance(kind, types.Literal):
            return kind.literal_value
        if isinstance(kind, types.NoneType | types.Omitted):
            return None
        if isinstance(kind, _Held):
            return HeldValue(kind, value)
        if isinstance(kind, types.BaseTuple):
            inner = [
                self.wrapped(item, self.builder and self.builder.extract_value(value, k))
                for k, item in enumerate(kind)
            ]
            made = getattr(kind, "instance_class", None)
            return made(*inner) if made else tuple(inner)
        if isinstance(kind, types.Function | types.Dispatcher):
            function = kind.typing_key if isinstance(kind, types.Function) else kind.dispatcher
            return _seen(function)
        return Value(kind, value)

    def kind_of(self, thing: Any) -> types.Type:
        """The Numba type of what point functions see; whole numbers keep their value in it."""
        if type(thing) in (Value, HeldValue):
            return thing.kind
        if isinstance(thing, int):
            return types.literal(thing)
        if isinstance(thing, tuple):
            kinds = tuple(types.unliteral(self.kind_of(item)) for item in thing)
            made = type(thing) if hasattr(thing, "_fields") else None
            return types.BaseTuple.from_types(kinds, made)
        thing = getattr(thing, "seen", thing)
        return self.typing.resolve_value_type(thing)

    def lowered(self, thing: Any, wanted: types.Type) -> Any:
        """Code that gives what point functions see, in the type `wanted`."""
        kind = self.kind_of(thing)
        if type(thing) in (Value, HeldValue):
            return self.context.cast(self.builder, thing.value, kind, wanted)
        if isinstance(thing, tuple):
            items = [self.lowered(a, k) for a, k in zip(thing, wanted, strict=True)]
            return self.context.make_tuple(self.builder, wanted, items)
        number = isinstance(thing, bool | int | float | np.generic)
        if number and not isinstance(wanted, types.Literal):
            kind = types.unliteral(kind)
            made = self.context.get_constant_generic(self.builder, kind, thing)
            return self.context.cast(self.builder, made, kind, wanted)
        return self.context.get_dummy_value()

    def call(self, function: Callable, arguments: tuple) -> Any:
        kinds = tuple(map(self.kind_of, arguments))
        if hasattr(function, "py_func"):
            kinds = tuple(map(types.unliteral, kinds))
        typed, called = _resolved(self.typing, function, kinds)
        if self.builder is None:
            return self.wrapped(called.return_type, None)
        if called.pysig is not None:  # with *arguments in a tuple
            arguments = fold_arguments(called.pysig, arguments, {}, _as_is, _as_is, _as_is)
        values = [self.lowered(a, k) for a, k in zip(arguments, called.args, strict=True)]
        made = self.context.get_function(typed, called)
        return self.wrapped(called.return_type, made(self.builder, values))

    def attribute(self, thing: Value, name: str) -> Any:
        kind = self.typing.resolve_getattr(thing.kind, name)
        if kind is None:
            raise Untraceable
        if self.builder is None:
            return self.wrapped(kind, None)
        read = self.context.get_getattr(thing.kind, name)
        return self.wrapped(kind, read(self.context, self.builder, thing.kind, thing.value, name))

    def item(self, held: HeldValue, k: int) -> Any:
        value = self.builder and item_of(self.context, self.builder, held.kind, held.value, k)
        return self.wrapped(held.kind[k], value)


def _as_is(index: int, parameter: Any, argument: Any) -> Any:
    return argument


_lowerings: list[_Lowering] = []  # at work, innermost last


def _now() -> _Lowering:
    return _lowerings[-1]


@contextmanager
def _at_work(lowering: _Lowering) -> Iterator[None]:
    _lowerings.append(lowering)
    try:
        yield
    finally:
        _lowerings.pop()


def emit(function: Callable, *arguments: Any) -> Any:
    """What `function` gives for these arguments: code of Numba's, or of what was chosen by type."""
    return _now().call(function, arguments)


_resolutions: dict[tuple, tuple] = {}


def _resolved(typing: Any, function: Callable, kinds: tuple) -> tuple:
    """Numba's type of a function, and its signature for arguments of these types."""
    key = id(typing), function, kinds
    if key not in _resolutions:
        typed = typing.resolve_value_type(function)
        called = typing.resolve_function_type(typed, kinds, {})
        if called is None:
            raise Untraceable
        _resolutions[key] = typed, called
    return _resolutions[key]


_operators()


# --- functions as they are run here -----------------------------------------------------------


def _has_values(thing: Any) -> bool:
    if type(thing) in (Value, HeldValue):
        return True
    return isinstance(thing, tuple) and any(map(_has_values, thing))


class _Globals(dict):
    """The globals of a module, as functions that are run here see them."""

    def __init__(self, true: dict):
        super().__init__()
        self.true = true

    def __getitem__(self, name: str) -> Any:
        try:
            return _seen(self.true[name])
        except KeyError:
            return _seen(getattr(builtins, name))


_modules: dict[int, _Globals] = {}
_copies: dict[Any, Any] = {}
_choosers: dict[Callable, list[Callable]] = {}


class _Module:
    """A module, whose functions are seen like globals."""

    def __init__(self, module: python.ModuleType):
        self.module = module

    def __getattr__(self, name: str) -> Any:
        return _seen(getattr(self.module, name))


class _Emitted:
    """A function that compiled code has a version of its own of."""

    def __init__(self, function: Callable):
        self.seen = function

    def __call__(self, *arguments: Any) -> Any:
        return emit(self.seen, *arguments) if _has_values(arguments) else self.seen(*arguments)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.seen, name)


class _Dispatched(_Emitted):
    """A point function: what the classes of its tags choose."""

    def __call__(self, *arguments: Any) -> Any:
        if not _has_values(arguments):
            return self.seen(*arguments)
        found = _formula(self.seen, _now().typing, tuple(map(_now().kind_of, arguments)))
        return found.run(*arguments) if found else emit(self.seen, *arguments)


_OF_NUMBERS = {min, max, abs, int, float, bool}


def _seen(thing: Any) -> Any:
    """What takes the place of a global in functions that are run here."""
    if thing is type:
        return _class_of
    if thing is isinstance:
        return _is_instance
    if isinstance(thing, python.ModuleType):
        return _Module(thing)
    if not isinstance(thing, Hashable) or not callable(thing) or isinstance(thing, _Emitted):
        return thing
    of_numbers = thing in _OF_NUMBERS or isinstance(thing, types.Number)
    if isinstance(thing, type):
        of_numbers |= issubclass(thing, np.generic)
    native = isinstance(thing, type) or getattr(thing, "__module__", "") == "builtins"
    if native and not of_numbers:
        return thing
    if thing not in _copies:
        if thing in _choosers:
            _copies[thing] = _Dispatched(thing)
        elif (
            of_numbers
            or hasattr(thing, "py_func")
            or cpu_target.typing_context._lookup_global(thing)
        ):
            _copies[thing] = _Emitted(thing)
        elif isinstance(thing, python.FunctionType):
            _copies[thing] = _copied(thing)
        else:
            return thing
    return _noted(_copies[thing])


def _known_to_numba(thing: Any) -> bool:
    return hasattr(thing, "py_func") or cpu_target.typing_context._lookup_global(thing) is not None


def _noted(made: Any) -> Any:
    if isinstance(made, python.FunctionType):
        note([made.__code__])
    return made


@functools.cache
def _copied(function: Callable) -> Callable:
    """The same function with other globals."""
    true = function.__globals__
    seen = _modules.setdefault(id(true), _Globals(true))
    cells = tuple(python.CellType(_seen(c.cell_contents)) for c in function.__closure__ or ())
    made = python.FunctionType(
        function.__code__, seen, function.__name__, function.__defaults__, cells
    )
    made.__kwdefaults__ = function.__kwdefaults__
    return made


# --- what kernels call ----------------------------------------------------------------------------


class _Formula(NamedTuple):
    """What is run for arguments of some types, the type of its result, what it consists of."""

    run: Callable
    result: types.Type
    parts: frozenset


_formulas: dict[tuple, _Formula | None] = {}


def _formula(dispatch: Callable, typing: Any, kinds: tuple) -> _Formula | None:
    """What to run for arguments of these types; None if it is Numba's to compile."""
    key = id(typing), dispatch, kinds
    if key not in _formulas:
        _formulas[key] = None  # of one that calls itself
        lowering = _Lowering(typing)
        try:
            with _at_work(lowering), parts_noted() as parts:
                run = _noted(_copied(_chosen(dispatch, kinds)))
                result = run(*(lowering.wrapped(kind, None) for kind in kinds))
                result = types.unliteral(lowering.kind_of(result))
            if hasattr(dispatch, "tags"):
                parts.add((dispatch, tuple(map(tag_class, kinds[: dispatch.tags]))))
            _formulas[key] = _Formula(run, result, frozenset(parts))
        except Exception:  # Numba tells what is wrong, if it is
            pass
    found = _formulas[key]
    if found is not None:
        note(found.parts)
    return found


def _chosen(dispatch: Callable, kinds: tuple) -> Callable:
    for chooser in _choosers[dispatch]:
        found = chooser(*kinds)
        if found is not None:
            return found
    raise Untraceable


def traced(dispatch: Callable, chooser: Callable) -> None:
    """Let kernels run what `chooser` makes of `dispatch` for types; None if it must not be run."""
    if dispatch in _choosers:
        _choosers[dispatch].append(chooser)
        return
    _choosers[dispatch] = [chooser]

    class Template(AbstractTemplate):
        key = dispatch

        def generic(self, arguments: tuple, keywords: dict) -> Any:
            found = None if keywords else _formula(dispatch, self.context, arguments)
            return found and signature(found.result, *arguments)

        def get_impl_key(self, called: Any) -> Any:
            return _choosers[dispatch][0]

    infer_global(dispatch, types.Function(Template))

    @lower_builtin(chooser, types.VarArg(types.Any))
    def lower(context: Any, builder: Any, called: Any, values: list) -> Any:
        lowering = _Lowering(context.typing_context, context, builder)
        found = _formula(dispatch, context.typing_context, called.args)
        with _at_work(lowering):
            arguments = [lowering.wrapped(k, v) for k, v in zip(called.args, values, strict=True)]
            return lowering.lowered(found.run(*arguments), called.return_type)
