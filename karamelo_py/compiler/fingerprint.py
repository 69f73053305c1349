"""Hash of everything that a compiled kernel depends on.

Dependencies are followed from the live functions: what they call through globals and closures
(helpers, functions selected by type, other kernels), the constants and classes they name, and for
point functions only the implementations selected for the present types, recorded during tracing.
Comments, and bases that a kernel does not use, do not affect its hash.
"""

import functools
import hashlib
import inspect
import pickle
import types as python
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numba import types

from karamelo_py.compiler import choices
from karamelo_py.compiler.values import Intrinsic

_HERE = f"{__package__}."  # the text of these modules is in every key
_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(Ellipsis), range, slice)


def describe(numba_type: Any) -> str:
    """Describe a type by words that mean the same in every process; tags with their fields."""
    how = type(numba_type).__name__  # held or a value
    if isinstance(numba_type, types.BaseTuple) and hasattr(numba_type, "instance_class"):
        items = zip(numba_type.fields, numba_type, strict=True)
        inner = ",".join(f"{name}={describe(item)}" for name, item in items)
        return f"{how} {choices.class_name(numba_type.instance_class)}({inner})"
    if isinstance(numba_type, types.BaseTuple):
        return f"{how}({','.join(map(describe, numba_type))},)"
    if isinstance(numba_type, (types.Callable, types.Opaque)) and numba_type != types.none:
        raise choices.Unknown(str(numba_type))
    return f"{how}:{numba_type}"


def classes_in(numba_type: Any) -> Iterable[type]:
    """Yield the classes of the tags in a type."""
    if isinstance(numba_type, types.BaseTuple):
        yield from filter(None, [getattr(numba_type, "instance_class", None)])
        for item in numba_type:
            yield from classes_in(item)


def fingerprint(
    roots: Iterable[Any],
    arguments: Iterable[Any],
    chosen: frozenset[choices.Choice],
    codes: frozenset[python.CodeType] = frozenset(),
) -> str:
    """Hash all that code of `roots` depends on, for argument types and recorded choices.

    Raises `Unknown` if something cannot be followed or no longer exists, or if one of `codes` is
    not reached.
    """
    ahead = [*roots]
    for argument in arguments:
        ahead += classes_in(argument)
    for choice in sorted(chosen):
        classes = tuple(choices.found_by_name(name) if name else None for name in choice.classes)
        dispatches = choices.point_functions.get(choice.point_function)
        if not dispatches:
            raise choices.Unknown(choice.point_function)
        ahead += [repr(choice), *(dispatch.find(classes) for dispatch in dispatches)]
    digest = hashlib.sha256()
    order: dict[int, int] = {}
    alive = []  # keeps ids unique
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
            codes -= {*choices.codes_in(thing.__code__)}
        words, parts = _look(thing)
        digest.update(f"{words} {len(parts)};".encode())
        ahead.extend(reversed(parts))
    if codes:
        raise choices.Unknown(f"the way to {min(c.co_qualname for c in codes)}")
    return digest.hexdigest()


def _look(thing: Any) -> tuple[str, list]:
    """Describe a thing in words, and list the things that it consists of."""
    kind = type(thing).__name__
    if isinstance(thing, python.ModuleType):
        return f"module {thing.__name__}", []
    if isinstance(thing, python.FunctionType):
        return _function(thing)
    if isinstance(thing, type):
        return _class(thing)
    if isinstance(thing, types.Type):
        return f"type {describe(thing)}", list(classes_in(thing))
    if isinstance(thing, (np.ndarray, np.generic)):
        array = np.asarray(thing)
        return f"{kind} {array.dtype} {array.shape}", [array.tobytes()]
    for one, parts in _PARTS.items():
        if isinstance(thing, one):
            return kind, parts(thing)
    if hasattr(type(thing), "made_of"):  # a kernel
        return kind, list(thing.made_of)
    if hasattr(thing, "__name__") and choices.is_opaque(thing):
        return f"{kind} {getattr(thing, '__module__', '')} {thing.__name__}", []
    try:
        return kind, [type(thing), pickle.dumps(thing)]
    except Exception as error:
        raise choices.Unknown(f"{thing!r}") from error


_PARTS: dict[Any, Callable] = {
    tuple | list: lambda thing: [type(thing), *thing],
    dict | python.MappingProxyType: lambda thing: [p for item in thing.items() for p in item],
    set | frozenset: lambda thing: sorted(thing, key=repr),
    property: lambda thing: [thing.fget],
    staticmethod | classmethod: lambda thing: [thing.__func__],
    functools._lru_cache_wrapper: lambda thing: [thing.__wrapped__],
    functools.partial: lambda thing: [thing.func, thing.args, thing.keywords],
    Intrinsic: lambda thing: [thing.definition],
}


def _function(function: Callable) -> tuple[str, list]:
    if hasattr(function, "find") and hasattr(function, "tags"):
        # Its implementations are among the choices.
        return (
            f"point function {choices.name_of(function)} {function.tags}",
            choices.of_numbers.get(function, []),
        )
    if hasattr(function, "inner"):
        return f"method {choices.name_of(function)}", [function.inner]
    if choices.is_opaque(function):
        return f"function {choices.name_of(function)}", []
    code = function.__code__
    digest, names = _code(code)
    parts = [function.__defaults__, function.__kwdefaults__]
    for name in () if code.co_filename in choices.WHOLE else names:
        value = function.__globals__.get(name, _NOWHERE)
        if value is _NOWHERE:
            continue
        parts += [name, value, *_from_module(value, names, ())]
    for cell in function.__closure__ or ():
        try:
            parts.append(cell.cell_contents)
        except ValueError:
            parts.append("empty")
    chosen = map(inspect.unwrap, choices.choosers.get(function, ()))
    return f"function {digest}", [*parts, *chosen, *choices.of_numbers.get(function, ())]


def _from_module(value: Any, names: tuple[str, ...], above: tuple) -> list:
    """List the things in a module and its submodules that a function's code names."""
    if not isinstance(value, python.ModuleType) or value in above or choices.is_opaque(value):
        return []
    found = [vars(value)[name] for name in names if name in vars(value)]
    inner = (_from_module(one, names, (*above, value)) for one in found)
    return found + [part for parts in inner for part in parts]


_NOWHERE = object()


@functools.cache
def _code(code: python.CodeType) -> tuple[str, tuple[str, ...]]:
    """Hash Python bytecode without docstrings and the like; also return the names in it."""
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


def _class(one: type) -> tuple[str, list]:
    name = choices.name_of(one)
    if choices.is_opaque(one) or one.__module__.startswith(_HERE):
        return f"class {name}", []
    fields = getattr(one, "_fields", ())
    parts: list = [*one.__bases__, fields]
    for key, value in vars(one).items():
        if getattr(value, "inner", None) is not None:  # a method of `algebra`
            parts += [key, value.inner]
        elif not key.startswith(("__", "_abc_")) and key not in fields:
            parts += [key, value]
    return f"class {name}", parts
