"""Point functions are run once, on values of the function that is compiled, and written down.

Numba makes code of a function in twenty passes, fifteen milliseconds for the smallest: half of a
first compilation. A point function is a formula for most classes of tags: without branches on
numbers, loops that end. So where a kernel calls one, it is run by Python itself, on a
:class:`Value` in the place of each number, and every operation that meets one is lowered at once,
into the function that calls. What each operation is, on numbers, lanes and arrays, is asked of
Numba; tuples are Python's own, so that what only takes them apart costs nothing. The bits are the
same. A function that asks what only a run can know (`if x > 0`) is compiled by Numba as a whole.

Functions run here see their globals through :class:`_Globals`: what other code chooses by type is
lowered for the types at hand, Python's functions are run in the same way. Only what the key of a
kernel on disk follows may be run (:mod:`karamelo_py.compiler.fingerprint`): functions that come by
another way than a global name or a closure, as methods do, are Numba's to compile, or to refuse.
"""

from __future__ import annotations

import builtins
import dis
import functools
import inspect
import operator
import os
import types as python
from collections import namedtuple
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import contextmanager
from traceback import walk_tb
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core.errors import TypingError
from numba.core.imputils import impl_ret_borrowed, lower_builtin
from numba.core.registry import cpu_target
from numba.core.typing.templates import (
    AbstractTemplate,
    fold_arguments,
    infer_global,
    signature,
)

from karamelo_py.compiler.fingerprint import note, parts_noted, tag_class
from karamelo_py.compiler.held import _Held, item_of


class Untraceable(BaseException):
    """A function asks for what only a run can know; no function may catch that."""


# --- values -------------------------------------------------------------------------------------


def _unknown(*arguments: Any) -> Any:
    raise Untraceable


class Value:
    """A number, lanes or an array of the function that is compiled."""

    __slots__ = ("_kind", "_value")
    __array_ufunc__ = None  # NumPy's numbers leave operations to this

    def __init__(self, kind: types.Type, value: Any):
        self._kind, self._value = kind, value

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return _now().attribute(self, name)

    def __setitem__(self, place: Any, value: Any) -> None:
        emit(operator.setitem, self, place, value)

    __bool__ = __int__ = __index__ = __float__ = __iter__ = __len__ = __contains__ = _unknown
    __pow__ = __rpow__ = __hash__ = __str__ = __repr__ = __format__ = _unknown


_BINARY = ("add", "sub", "mul", "truediv", "floordiv", "mod")
_BITS = ("and_", "or_", "xor", "lshift", "rshift")


def _in_place(operation: Callable) -> Callable:
    def apply(a: Value, b: Any) -> Any:
        if isinstance(a._kind, types.Array):  # it would change
            raise Untraceable
        return emit(operation, a, b)

    return apply


def _operators() -> None:
    for name in (*_BINARY, *_BITS):
        operation = getattr(operator, name)
        plain = name.rstrip("_")
        setattr(Value, f"__{plain}__", lambda a, b, do=operation: emit(do, a, b))
        setattr(Value, f"__r{plain}__", lambda a, b, do=operation: emit(do, b, a))
        setattr(Value, f"__i{plain}__", _in_place(operation))
    for name in ("lt", "le", "gt", "ge", "eq", "ne", "getitem"):
        operation = getattr(operator, name)
        setattr(Value, f"__{name}__", lambda a, b, do=operation: emit(do, a, b))
    for name in ("neg", "pos", "invert"):
        operation = getattr(operator, name)
        setattr(Value, f"__{name}__", lambda a, do=operation: emit(do, a))
    Value.__abs__ = lambda a: emit(abs, a)


class HeldValue:
    """A held tuple: its items are read when they are asked for."""

    __slots__ = ("_kind", "_read", "_value")

    def __init__(self, kind: _Held, value: Any):
        self._kind, self._value, self._read = kind, value, {}

    def __len__(self) -> int:
        return len(self._kind)

    def __getitem__(self, k: int) -> Any:
        if isinstance(k, Value):
            raise Untraceable
        if isinstance(k, slice):
            return tuple(self[i] for i in range(*k.indices(len(self))))
        k = range(len(self))[k]
        if k not in self._read:
            self._read[k] = _now().item(self, k)
        return self._read[k]

    def __iter__(self) -> Iterator:
        return (self[k] for k in range(len(self)))

    def __getattr__(self, name: str) -> Any:
        fields = getattr(self._kind, "fields", ())
        if name in fields:
            return self[fields.index(name)]
        found = getattr(self._kind.instance_class, name)
        if callable(found) or isinstance(found, property):
            raise Untraceable
        return found

    __eq__ = __ne__ = __hash__ = __contains__ = __add__ = __radd__ = _unknown


def _class_of(thing: Any) -> type:
    if isinstance(thing, Value):
        raise Untraceable
    kind = getattr(thing, "_kind", None)
    return type(thing) if kind is None else getattr(kind, "instance_class", tuple)


def _is_instance(thing: Any, kind: Any) -> bool:
    kinds = tuple(getattr(k, "seen", k) for k in (kind if isinstance(kind, tuple) else (kind,)))
    if not isinstance(thing, Value):
        return issubclass(_class_of(thing), kinds)
    if not all(issubclass(k, tuple) for k in kinds):
        raise Untraceable
    return False


# --- the function that is compiled ----------------------------------------------------------------

MOST_OPERATIONS = 10_000  # of one formula; beyond, a loop is better left to the compiler
LONGEST = 1000  # range that is gone through


class _Lowering:
    """Where code goes to: to a builder, or nowhere while only types are asked for.

    Attributes
    ----------
    classes
        Of the tuples that were met.
    """

    def __init__(self, typing: Any, context: Any = None, builder: Any = None):
        self.typing, self.context, self.builder = typing, context, builder
        self.classes: set[type] = set()
        self.operations = 0

    def wrapped(self, kind: types.Type, value: Any) -> Any:
        """What point functions see of a value."""
        if isinstance(kind, types.Literal):
            return kind.literal_value
        if isinstance(kind, types.NoneType):
            return None
        if isinstance(kind, types.BaseTuple) and hasattr(kind, "instance_class"):
            self.classes.add(kind.instance_class)
        if isinstance(kind, _Held):
            return HeldValue(kind, value)
        if isinstance(kind, types.BaseTuple):
            inner = [
                self.wrapped(item, self.builder and self.builder.extract_value(value, k))
                for k, item in enumerate(kind)
            ]
            made = getattr(kind, "instance_class", None)
            return made(*inner) if made else tuple(inner)
        if isinstance(kind, types.NamedTupleClass):
            return kind.instance_class
        if isinstance(kind, types.Function | types.Dispatcher):
            function = kind.typing_key if isinstance(kind, types.Function) else kind.dispatcher
            return _seen(function)
        return Value(kind, value)

    def kind_of(self, thing: Any) -> types.Type:
        """The Numba type of what point functions see; whole numbers keep their value in it."""
        if isinstance(thing, Value | HeldValue):
            return thing._kind
        if isinstance(thing, int):
            return types.literal(thing)
        if isinstance(thing, tuple):
            kinds = tuple(types.unliteral(self.kind_of(item)) for item in thing)
            made = type(thing) if hasattr(thing, "_fields") else None
            if made:
                self.classes.add(made)
            return types.BaseTuple.from_types(kinds, made)
        if isinstance(thing, _Emitted):
            thing = thing.seen
        elif not isinstance(thing, float | np.generic | type | None):
            raise Untraceable  # nothing that `lowered` knows
        return self.typing.resolve_value_type(thing)

    def lowered(self, thing: Any, wanted: types.Type) -> Any:
        """Code that gives what point functions see, in the type `wanted`."""
        kind = self.kind_of(thing)
        if isinstance(thing, Value | HeldValue):
            return self.context.cast(self.builder, thing._value, kind, wanted)
        if isinstance(thing, tuple):
            items = [self.lowered(a, k) for a, k in zip(thing, wanted, strict=True)]
            return self.context.make_tuple(self.builder, wanted, items)
        number = isinstance(thing, int | float | np.generic)
        if number and not isinstance(wanted, types.Literal):
            kind = types.unliteral(kind)
            made = self.context.get_constant_generic(self.builder, kind, thing)
            return self.context.cast(self.builder, made, kind, wanted)
        return self.context.get_dummy_value()

    def call(self, function: Callable, arguments: tuple) -> Any:
        """What `function` gives for these arguments."""
        self.operations += 1
        if self.operations > MOST_OPERATIONS:
            raise Untraceable
        kinds = tuple(map(self.kind_of, arguments))
        if hasattr(function, "py_func"):
            kinds = tuple(map(types.unliteral, kinds))
        typed, called = _resolved(self.typing, function, kinds)
        if any(isinstance(kind, types.Omitted) for kind in called.args):
            raise Untraceable
        if self.builder is None:
            return self.wrapped(called.return_type, None)
        if called.pysig is not None:  # with *arguments in a tuple
            arguments = fold_arguments(called.pysig, arguments, {}, _as_is, _as_is, _as_is)
        values = [self.lowered(a, k) for a, k in zip(arguments, called.args, strict=True)]
        made = self.context.get_function(typed, called)
        return self.wrapped(called.return_type, made(self.builder, values))

    def attribute(self, thing: Value, name: str) -> Any:
        """An attribute of an array or a record."""
        kind = self.typing.resolve_getattr(thing._kind, name)
        if kind is None:
            raise Untraceable
        if self.builder is None:
            return self.wrapped(kind, None)
        read = self.context.get_getattr(thing._kind, name)
        value = read(self.context, self.builder, thing._kind, thing._value, name)
        return self.wrapped(kind, value)

    def item(self, held: HeldValue, k: int) -> Any:
        """An item of a held tuple."""
        value = self.builder and item_of(self.context, self.builder, held._kind, held._value, k)
        return self.wrapped(held._kind[k], value)


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


def at_work() -> bool:
    """Whether functions are run for a kernel now."""
    return bool(_lowerings)


def run_for_kernel(dispatch: Callable, arguments: tuple) -> Any:
    """What a point function gives where one that nothing sees through calls it, as methods do."""
    return _seen(dispatch)(*arguments)


def emit(function: Callable, *arguments: Any) -> Any:
    """What `function` gives for these arguments: code of Numba's, or of what was chosen by type."""
    return _now().call(function, arguments)


_resolutions: dict[tuple, tuple] = {}


def _numbers_of(kinds: tuple) -> tuple[int, ...]:
    """Numba's numbers of types, which are faster to compare."""
    return tuple([kind._code for kind in kinds])


def _resolved(typing: Any, function: Callable, kinds: tuple) -> tuple:
    """Numba's type of a function, and its signature for arguments of these types."""
    key = typing, function, _numbers_of(kinds)
    if key not in _resolutions:
        typed = typing.resolve_value_type(function)
        called = typing.resolve_function_type(typed, kinds, {})
        if called is None:
            raise Untraceable
        _resolutions[key] = typed, called
    return _resolutions[key]


_operators()


# --- functions as they are run here -----------------------------------------------------------


class _Globals(dict):
    """The globals of a module, as functions that are run here see them."""

    def __init__(self, true: dict):
        super().__init__()
        self.true = true

    def __getitem__(self, name: str) -> Any:
        if name in self.true:
            return _seen(self.true[name])
        return _seen(getattr(builtins, name))


_modules: dict[int, _Globals] = {}
_copies: dict[Any, Any] = {}
_choosers: dict[Callable, list[Callable]] = {}


class _Module:
    """A module, whose functions are seen like globals."""

    def __init__(self, module: python.ModuleType):
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return _seen(getattr(self._module, name))


class _Emitted:
    """A function that compiled code has a version of its own of."""

    def __init__(self, function: Callable):
        self.seen = function

    def __call__(self, *arguments: Any) -> Any:
        return self.seen(*arguments) if self.counts(arguments) else emit(self.seen, *arguments)

    def counts(self, arguments: tuple) -> bool:
        """Whether it is about whole numbers that are known, as lengths of loops are."""
        return self.seen in _OF_WHOLE and all(isinstance(a, int) for a in arguments)


class _Dispatched(_Emitted):
    """A point function: what the classes of its tags choose."""

    def __call__(self, *arguments: Any) -> Any:
        if self.counts(arguments):
            return self.seen(*arguments)
        found = _formula(self.seen, _now().typing, tuple(map(_now().kind_of, arguments)))
        return found.run(*arguments) if found else emit(self.seen, *arguments)

    def defined(self, *classes: type) -> bool:
        """Whether a point function has an implementation for these classes."""
        return self.seen.defined(*classes)


def _range(*bounds: int) -> range:
    made = range(*bounds)
    if len(made) > LONGEST:
        raise Untraceable
    return made


def _attribute(thing: Any, *name: Any) -> Any:
    if isinstance(thing, _Module):
        raise Untraceable
    return getattr(thing, *name)


_OF_WHOLE = {min, max, abs, int, bool}
_OF_NUMBERS = {*_OF_WHOLE, float}
_INSTEAD = {type: _class_of, isinstance: _is_instance, range: _range, getattr: _attribute}
_SAFE = {len, zip, enumerate, tuple, list, dict, set, sum, reversed, any, all, map, slice, hasattr}
_CONSTANT = (type(None), bool, int, float, str, np.number, np.bool_)


def _seen(thing: Any) -> Any:
    """What takes the place of a global in functions that are run here."""
    if isinstance(thing, (*_CONSTANT, _Emitted, _Module)):
        return thing
    if isinstance(thing, python.ModuleType):
        return _Module(thing)
    if isinstance(thing, tuple):
        inner = [_seen(item) for item in thing]
        return type(thing)(*inner) if hasattr(thing, "_fields") else tuple(inner)
    if isinstance(thing, list):
        return list(map(_seen, thing))
    if not isinstance(thing, Hashable):
        raise Untraceable
    if thing not in _copies:
        _copies[thing] = _copy(thing)
    made = _copies[thing]
    if isinstance(made, python.FunctionType) and type(made.__globals__) is _Globals:
        note([made.__code__])
    if isinstance(made, type):
        _now().classes.add(made)
    return made


def _copy(thing: Any) -> Any:
    """The same for what is called."""
    if thing in _INSTEAD:
        return _INSTEAD[thing]
    if thing in _SAFE:
        return thing
    if thing in _choosers:
        return _Dispatched(thing)
    number = isinstance(thing, type) and issubclass(thing, np.generic)
    if number or thing in _OF_NUMBERS or isinstance(thing, types.Number):
        return _Emitted(thing)
    if isinstance(thing, type) and issubclass(thing, tuple):
        return thing
    if hasattr(thing, "py_func") or _numba_knows(thing):
        return _Emitted(thing)
    if isinstance(thing, python.FunctionType):
        return _copied(thing)
    raise Untraceable


def _numba_knows(thing: Any) -> bool:
    """Whether Numba has a version of its own; also before it compiled anything for processors."""
    cpu_target.typing_context.refresh()
    return bool(cpu_target.typing_context._lookup_global(thing))


@functools.cache
def _is_fit(code: python.CodeType) -> bool:
    """Not where a function catches what is raised here, or imports what nothing follows."""
    catches = code.co_exceptiontable and not code.co_flags & inspect.CO_GENERATOR
    return not catches and all(i.opname != "IMPORT_NAME" for i in dis.get_instructions(code))


def _copied(function: Callable) -> Callable:
    """The same function with other globals."""
    code = function.__code__
    if not _is_fit(code):
        raise Untraceable
    true = function.__globals__
    seen = _modules.setdefault(id(true), _Globals(true))
    cells = tuple(python.CellType(_seen(c.cell_contents)) for c in function.__closure__ or ())
    defaults = function.__defaults__ and tuple(map(_seen, function.__defaults__))
    made = python.FunctionType(code, seen, function.__name__, defaults, cells)
    made.__kwdefaults__ = {k: _seen(v) for k, v in (function.__kwdefaults__ or {}).items()}
    return made


_GENERATED = {*vars(namedtuple("_", ())), "__orig_bases__", "__annotations__", "__annotate_func__"}


@functools.cache
def _functions_of(one: type) -> frozenset[str]:
    """The names of what a class of tuples does with its numbers by functions of its own."""
    if not getattr(one, "_fields", ()):
        return frozenset()
    own = {name: value for base in one.__mro__[:-2] for name, value in vars(base).items()}
    return frozenset(
        name
        for name, value in own.items()
        if name not in _GENERATED
        and isinstance(value, python.FunctionType | property | classmethod | staticmethod)
    )


def _names_in(code: python.CodeType) -> set[str]:
    inner = (c for c in code.co_consts if isinstance(c, python.CodeType))
    return set(code.co_names).union(*map(_names_in, inner))


def _refuse_methods(codes: Iterable[python.CodeType], classes: set[type]) -> None:
    """Methods of tuples would run as they are, and nothing would follow them."""
    functions = frozenset().union(*map(_functions_of, classes))
    if any(name.startswith("__") for name in functions):
        raise Untraceable
    if functions and not functions.isdisjoint(set().union(*map(_names_in, codes))):
        raise Untraceable


# --- what kernels call ----------------------------------------------------------------------------


class _Formula(NamedTuple):
    """What is run for arguments of some types, the type of its result, what it consists of."""

    run: Callable
    result: types.Type
    parts: frozenset


_formulas: dict[tuple, _Formula | None] = {}
_asking: dict[python.CodeType, int] = {}  # of functions left to Numba: the line that is why


def _formula(dispatch: Callable, typing: Any, kinds: tuple) -> _Formula | None:
    """What to run for arguments of these types; None if it is Numba's to compile."""
    key = typing, dispatch, _numbers_of(kinds)
    if key not in _formulas:
        _formulas[key] = None  # of one that calls itself
        lowering = _Lowering(typing)
        chosen = None
        try:
            with _at_work(lowering), parts_noted() as parts:
                chosen = _chosen(dispatch, kinds)
                run = _copied(chosen)
                note([run.__code__])
                result = run(*(lowering.wrapped(kind, None) for kind in kinds))
                result = types.unliteral(lowering.kind_of(result))
            codes = {part for part in parts if isinstance(part, python.CodeType)}
            _refuse_methods(codes, lowering.classes)
            if hasattr(dispatch, "tags"):
                parts.add((dispatch, tuple(map(tag_class, kinds[: dispatch.tags]))))
            _formulas[key] = _Formula(run, result, frozenset(parts))
        except (Exception, Untraceable) as why:  # Numba tells what is wrong, if it is
            code = getattr(chosen, "__code__", None)
            lines = [k for frame, k in walk_tb(why.__traceback__) if frame.f_code is code]
            if lines:
                _asking[code] = lines[-1]
    found = _formulas[key]
    if found is not None:
        note(found.parts)
    return found


def line_that_asks(file: str, line: int) -> int | None:
    """The line for which the function at a place was not run, but left to Numba."""
    file = os.path.realpath(file)
    for code, asking in _asking.items():
        lines = (k for _, _, k in code.co_lines())
        if line in lines and os.path.realpath(code.co_filename) == file:
            return asking
    return None


def forget() -> None:
    """A point function has another implementation than was known."""
    _formulas.clear()


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
            result = found.run(*arguments)
            if types.unliteral(lowering.kind_of(result)) != called.return_type:
                raise TypingError(f"{dispatch.__qualname__} has changed while it was compiled")
            value = lowering.lowered(result, called.return_type)
            return impl_ret_borrowed(context, builder, called.return_type, value)
