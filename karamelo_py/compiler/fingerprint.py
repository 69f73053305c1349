"""What a compiled kernel was made of, as a hash: while it stays the same, so does the kernel.

Numba does not notice when a function in another file changes. Here everything that a kernel's code
can depend on is followed from the living functions: what it calls through its globals and closure
(helpers, choosers by type, other kernels), the constants and classes they name, and, for point
functions, only the implementations that were chosen for the types at hand. Those are noted while
Numba compiles. An edited comment, or another basis, is in no hash of a kernel without it.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import pickle
import sys
import types as python
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numba import types
from numba.core import event
from numba.core.registry import cpu_target

# Known by name: their versions are part of every key.
_OPAQUE = {"numba", "llvmlite", "numpy", *sys.stdlib_module_names}
# What Numba's own functions do with lanes cannot be followed from them: all of it is in every key.
WHOLE = [str(path) for path in sorted(Path(__file__).with_name("lanes").glob("*.py"))]
SPELLED = "<spelled>"  # the file of functions that are written at compile time
_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(Ellipsis), range, slice)


class Unknown(Exception):
    """Something that a kernel depends on cannot be put into a hash."""


# --- implementations of point functions that are in a kernel -----------------------------------


class Choice(NamedTuple):
    """That a kernel asked a point function for these classes of tags, all by name."""

    point_function: str
    classes: tuple[str, ...]


_point_functions: dict[str, list[Callable]] = {}
_serves: WeakKeyDictionary[Callable, list[Callable]] = WeakKeyDictionary()


def name_of(thing: Any) -> str:
    """``module:qualified name`` of a function or class."""
    return f"{thing.__module__}:{thing.__qualname__}"


def declare_point_function(dispatch: Callable) -> None:
    """Make a point function known by its name; it has ``find(classes)`` and ``tags``."""
    _point_functions.setdefault(name_of(dispatch), []).append(dispatch)


def serves(implementation: Callable, dispatch: Callable) -> None:
    """Note that a point function may choose `implementation`."""
    function = getattr(implementation, "py_func", implementation)
    _serves.setdefault(function, []).append(dispatch)


_asked: list[set[tuple[Callable, tuple]]] = []  # of the choosers at work, innermost last
_answers: WeakKeyDictionary[Callable, set[tuple[Callable, tuple]]] = WeakKeyDictionary()


def asks(dispatch: Callable, classes: tuple) -> None:
    """Note that whether `dispatch` is defined for `classes` was asked, maybe by a chooser."""
    if _asked:
        _asked[-1].add((dispatch, classes))
    note([(dispatch, classes)])


# Of the functions that are made, innermost last: what was asked of point functions, and the code
# of functions that were run for them.
_noted: list[set[tuple[Callable, tuple] | python.CodeType]] = []


def note(parts: Iterable[tuple[Callable, tuple] | python.CodeType]) -> None:
    """Note what the function that is compiled now consists of."""
    if _noted:
        _noted[-1].update(parts)


@contextmanager
def parts_noted() -> Iterator[set[tuple[Callable, tuple] | python.CodeType]]:
    """The set of what is noted meanwhile."""
    _noted.append(set())
    try:
        yield _noted[-1]
    finally:
        _noted.pop()


def noting(chooser: Callable) -> Callable:
    """The same chooser of code by type; what it asks is noted with the function that it chooses."""

    @functools.wraps(chooser)
    def choose(*arguments: Any) -> Callable | None:
        _asked.append(set())
        try:
            chosen = chooser(*arguments)
        finally:
            asked = _asked.pop()
        if asked and chosen is not None:
            _answers.setdefault(getattr(chosen, "py_func", chosen), set()).update(asked)
        return chosen

    return choose


def tag_class(numba_type: Any) -> Any:
    """The Python class that a Numba type stands for, as far as point functions select by it."""
    return getattr(numba_type, "instance_class", None)


def _found(name: str) -> Any:
    """What `name_of` called so; Unknown if nothing is, or something else."""
    module, _, path = name.partition(":")
    try:
        return functools.reduce(getattr, path.split("."), sys.modules[module])
    except (KeyError, AttributeError) as error:
        raise Unknown(name) from error


def _class_name(tag: type | None) -> str:
    if tag is None:
        return ""
    name = name_of(tag)
    if _found(name) is not tag:
        raise Unknown(name)
    return name


class Contents(NamedTuple):
    """What is in compiled code: choices, and the Python functions that it was made of."""

    choices: frozenset[Choice]
    codes: frozenset[python.CodeType]


_contents: WeakKeyDictionary[Any, Contents] = WeakKeyDictionary()
_unfit: WeakKeyDictionary[Any, bool] = WeakKeyDictionary()


class _Watch(event.Listener):
    """Notes which implementation each piece of compiled code is."""

    def on_start(self, event: Any) -> None:
        """What is chosen while it is compiled is noted."""
        _noted.append(set())

    def on_end(self, event: Any) -> None:
        """A function was compiled, or failed to."""
        noted = _noted.pop()
        dispatcher, arguments = event.data["dispatcher"], tuple(event.data["args"])
        compiled = dispatcher.overloads.get(arguments)
        if compiled is None:
            return
        function = dispatcher.py_func
        run = {part for part in noted if isinstance(part, python.CodeType)}
        try:
            choices = frozenset(_own_choices(function, arguments, noted - run))
        except Unknown:
            _unfit[compiled.library] = True
            return
        if not _opaque(function):
            run.add(function.__code__)
        # What was spelled out at compile time was spelled by a function that is followed itself.
        codes = frozenset(code for code in run if code.co_filename not in (SPELLED, *WHOLE))
        _contents[compiled.library] = Contents(choices, codes)


event.register("numba:compile", _Watch())


def _own_choices(function: Callable, arguments: tuple, noted: set) -> Iterable[Choice]:
    for dispatch in _serves.get(function, ()):
        classes = tuple(tag_class(a) for a in arguments[: dispatch.tags])
        yield Choice(name_of(dispatch), tuple(_class_name(c) for c in classes))
    for dispatch, classes in (*_answers.get(function, ()), *noted):
        yield Choice(name_of(dispatch), tuple(_class_name(c) for c in classes))


def contents(library: Any) -> Contents:
    """What is in the code of a compiled function, and of all that it calls."""
    choices: set[Choice] = set()
    codes: set[python.CodeType] = set()
    ahead, seen = [library], set()
    while ahead:
        one = ahead.pop()
        if one in seen:
            continue
        seen.add(one)
        if one in _unfit:
            raise Unknown(one.name)
        if one in _contents:
            choices |= _contents[one].choices
            codes |= _contents[one].codes
        ahead += [*one._linking_libraries, *one.needs]
    return Contents(frozenset(choices), frozenset(codes))


def keep_choices(library: Any, choices: frozenset[Choice]) -> None:
    """Note the choices in code that was not compiled here, but loaded."""
    _contents[library] = Contents(choices, frozenset())


# --- types ------------------------------------------------------------------------------------


def describe(numba_type: Any) -> str:
    """A Numba type in words that mean the same in every process; tags with their fields."""
    if isinstance(numba_type, types.BaseNamedTuple):
        items = zip(numba_type.fields, numba_type, strict=True)
        inner = ",".join(f"{name}={describe(item)}" for name, item in items)
        how = type(numba_type).__name__  # held or a value
        return f"{how} {_class_name(numba_type.instance_class)}({inner})"
    if isinstance(numba_type, types.BaseTuple):
        how = type(numba_type).__name__
        return f"{how}({','.join(describe(item) for item in numba_type)},)"
    if isinstance(numba_type, (types.Callable, types.Opaque)) and numba_type != types.none:
        raise Unknown(str(numba_type))
    return f"{type(numba_type).__name__}:{numba_type}"


def classes_in(numba_type: Any) -> Iterable[type]:
    """The classes of the tags in a Numba type."""
    if isinstance(numba_type, types.BaseNamedTuple):
        yield numba_type.instance_class
    if isinstance(numba_type, types.BaseTuple):
        for item in numba_type:
            yield from classes_in(item)


# --- what can be reached from a function --------------------------------------------------------


def fingerprint(
    roots: Iterable[Any],
    arguments: Iterable[Any],
    choices: frozenset[Choice],
    codes: frozenset[python.CodeType] = frozenset(),
) -> str:
    """Hash of all that code made of `roots` depends on, for these types and choices.

    Parameters
    ----------
    roots
        The function that is compiled, and what else its code depends on.
    arguments
        Numba types of its arguments.
    choices
        What its point functions were asked for.
    codes
        What must be among all that is followed.

    Raises
    ------
    Unknown
        Where something cannot be followed, or is no longer there; where one of `codes` is missed.
    """
    ahead = [*roots]
    for argument in arguments:
        ahead += classes_in(argument)
    for choice in sorted(choices):
        classes = tuple(_found(name) if name else None for name in choice.classes)
        dispatches = _point_functions.get(choice.point_function)
        if not dispatches:
            raise Unknown(choice.point_function)
        ahead += [repr(choice), *(dispatch.find(classes) for dispatch in dispatches)]
    digest = hashlib.sha256()
    cpu_target.typing_context.refresh()
    order: dict[int, int] = {}
    alive = []  # so that no id is used twice
    ahead.reverse()
    while ahead:
        thing = ahead.pop()
        if isinstance(thing, _PLAIN):
            digest.update(f"{type(thing).__name__} {thing!r};".encode())
            continue
        if id(thing) in order:
            digest.update(f"#{order[id(thing)]};".encode())
            continue
        order[id(thing)] = len(order)
        alive.append(thing)
        if codes and isinstance(thing, python.FunctionType):
            codes -= _codes(thing.__code__)
        words, parts = _look(thing)
        digest.update(f"{words} {len(parts)};".encode())
        ahead.extend(reversed(parts))
    if codes:
        raise Unknown(f"the way to {min(c.co_qualname for c in codes)}")
    return digest.hexdigest()


def _opaque(thing: Any) -> bool:
    module = getattr(thing, "__module__", None)
    if module is None:
        return not isinstance(thing, python.FunctionType)
    return module.partition(".")[0] in _OPAQUE


def _look(thing: Any) -> tuple[str, list]:
    """What one thing is, in words, and the other things that it consists of."""
    kind = type(thing).__name__
    if isinstance(thing, python.ModuleType):
        return f"module {thing.__name__}", []
    if isinstance(thing, python.FunctionType):
        return _function(thing)
    if isinstance(thing, type):
        return _class(thing)
    if hasattr(thing, "py_func"):  # of Numba's dispatchers
        return kind, [thing.py_func, repr(sorted(thing.targetoptions.items()))]
    if isinstance(thing, types.Type):
        return f"type {describe(thing)}", list(classes_in(thing))
    if isinstance(thing, (np.ndarray, np.generic)):
        array = np.asarray(thing)
        return f"{kind} {array.dtype} {array.shape}", [array.tobytes()]
    if isinstance(thing, (tuple, list)):
        return kind, [type(thing), *thing]
    if hasattr(type(thing), "made_of"):  # a memo
        return kind, list(thing.made_of)
    if isinstance(thing, (dict, python.MappingProxyType)):
        return kind, [part for item in thing.items() for part in item]
    if isinstance(thing, (set, frozenset)):
        return kind, sorted(thing, key=repr)
    if isinstance(thing, property):
        return kind, [thing.fget]
    if isinstance(thing, (staticmethod, classmethod)):
        return kind, [thing.__func__]
    if isinstance(thing, functools._lru_cache_wrapper):
        return kind, [thing.__wrapped__]
    if isinstance(thing, functools.partial):
        return kind, [thing.func, thing.args, thing.keywords]
    if hasattr(thing, "_defn"):  # of Numba's intrinsics
        return kind, [thing._defn]
    if hasattr(thing, "__name__") and _opaque(thing):
        return f"{kind} {getattr(thing, '__module__', '')} {thing.__name__}", []
    try:
        return kind, [type(thing), pickle.dumps(thing)]
    except Exception as error:
        raise Unknown(f"{thing!r}") from error


def _function(function: Callable) -> tuple[str, list]:
    if hasattr(function, "find") and hasattr(function, "tags"):
        # Its implementations are in the choices.
        return f"point function {name_of(function)} {function.tags}", []
    if _opaque(function):
        return f"function {name_of(function)}", []
    code = function.__code__
    digest, names = _code(code)
    parts = [function.__defaults__, function.__kwdefaults__]
    for name in names:
        value = function.__globals__.get(name, _NOWHERE)
        if value is _NOWHERE:
            continue
        parts += [name, value]
        parts += _from_module(value, names, ())
    for cell in function.__closure__ or ():
        try:
            parts.append(cell.cell_contents)
        except ValueError:
            parts.append("empty")
    return f"function {digest}", parts + _choosers(function)


def _from_module(value: Any, names: tuple[str, ...], above: tuple) -> list:
    """What a function may take from a module, or from modules in it, by the names in its code."""
    if not isinstance(value, python.ModuleType) or value in above:
        return []
    if value.__name__.partition(".")[0] in _OPAQUE:
        return []
    found = [vars(value)[name] for name in names if name in vars(value)]
    inner = (_from_module(one, names, (*above, value)) for one in found)
    return found + [part for parts in inner for part in parts]


_NOWHERE = object()


def _choosers(function: Callable) -> list:
    """What decides on the code of an overloaded function, and how it is compiled."""
    known = cpu_target.typing_context._lookup_global(function)
    parts: list = []
    for template in getattr(known, "templates", ()):
        if hasattr(template, "_overload_func"):
            parts += [inspect.unwrap(template._overload_func), repr(template._jit_options)]
    return parts


@functools.cache
def _code(code: python.CodeType) -> tuple[str, tuple[str, ...]]:
    """Hash of compiled Python without what only people read, and the names in it."""
    constants = list(code.co_consts)
    is_function = code.co_flags & inspect.CO_OPTIMIZED and not code.co_name.startswith("<")
    if is_function and isinstance(constants[0], str):
        constants[0] = ""  # the docstring
    digest = hashlib.sha256(code.co_code)
    names = list(code.co_names)
    for constant in constants:
        if isinstance(constant, python.CodeType):
            inner, more = _code(constant)
            digest.update(inner.encode())
            names += more
        elif isinstance(constant, frozenset):
            digest.update(repr(sorted(constant, key=repr)).encode())
        else:
            digest.update(f"{type(constant).__name__} {constant!r}".encode())
    shape = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    digest.update(repr((shape, code.co_argcount, code.co_kwonlyargcount, code.co_flags)).encode())
    return digest.hexdigest(), tuple(dict.fromkeys(names))


def _codes(code: python.CodeType) -> set[python.CodeType]:
    """A function's code, and that of all functions written in it."""
    inner = (c for c in code.co_consts if isinstance(c, python.CodeType))
    return {code}.union(*map(_codes, inner))


def _class(one: type) -> tuple[str, list]:
    name = name_of(one)
    if _opaque(one):
        return f"class {name}", []
    fields = getattr(one, "_fields", ())
    parts: list = [*one.__bases__, fields]
    for key, value in vars(one).items():
        if not key.startswith(("__", "_abc_")) and key not in fields:
            parts += [key, value]
    return f"class {name}", parts
