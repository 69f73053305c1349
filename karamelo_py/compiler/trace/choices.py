"""Implementations that are selected by type, and the modules that define them.

The keys of kernels on disk include the sources of these modules (see `cache`).
"""

import contextvars
import functools
import itertools
import sys
import types as python
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import Any

from numba import config, types

from karamelo_py.compiler.trace.session import session

INTERPRETED = bool(config.DISABLE_JIT)  # nothing is compiled

LIBRARIES = {"builtins", "numba", "llvmlite", "numpy", *sys.stdlib_module_names} - {"__main__"}
_PACKAGE = __package__.partition(".")[0]
# Folders whose sources are included in all keys.
ROOMS = "compiler", "script", "points", "kernels", "schemes", "styles"

# modules outside `ROOMS` of functions being compiled, innermost last
_noted: contextvars.ContextVar[tuple[set[str], ...]] = contextvars.ContextVar("noted", default=())


@functools.cache
def is_elsewhere(module: str) -> bool:
    top, _, rest = module.partition(".")
    return top not in LIBRARIES and not (top == _PACKAGE and rest.partition(".")[0] in ROOMS)


def modules_of(*things: Any) -> set[str]:
    """Return modules outside `ROOMS` that define functions or classes."""
    names = [one.__name__ if isinstance(one, python.ModuleType) else "" for one in things]
    names += [one.__module__ for one in things if hasattr(one, "__module__")]
    functions = (one for one in things if isinstance(one, python.FunctionType))
    names += [one.__globals__.get("__name__") for one in functions]
    return {name for name in names if name and is_elsewhere(name)}


def register(made: Callable) -> None:
    """Include an implementation in all keys, unless it is in the sources of `ROOMS`."""
    is_function = isinstance(made, python.FunctionType)
    has_values = is_function and (made.__closure__ or made.__defaults__ or made.__kwdefaults__)
    if has_values or modules_of(made):
        session.registered.append(made)


def note(modules: Collection[str]) -> None:
    if modules and (noted := _noted.get()):
        noted[-1].update(modules)


@contextmanager
def modules_noted() -> Iterator[set[str]]:
    modules: set[str] = set()
    before = _noted.set((*_noted.get(), modules))
    try:
        yield modules
    finally:
        _noted.reset(before)


def name_of(thing: Any) -> str:
    return f"{thing.__module__}:{thing.__qualname__}"


def tag_class(numba_type: Any) -> Any:
    """Return the class of a NamedTuple type, which selects point functions, or None."""
    return getattr(numba_type, "instance_class", None)


def classes_in(numba_type: Any) -> Iterator[type]:
    if tag_class(numba_type):
        yield numba_type.instance_class
    if isinstance(numba_type, types.BaseTuple):
        for item in numba_type:
            yield from classes_in(item)


def codes_in(code: python.CodeType) -> list[python.CodeType]:
    inner = (codes_in(c) for c in code.co_consts if isinstance(c, python.CodeType))
    return [code, *itertools.chain.from_iterable(inner)]
