"""Functions that choose by type, and the modules in which what they choose was written.

The key of a kernel on disk contains the sources of these modules, and the versions of libraries
(`cache.py`).
"""

import contextvars
import functools
import itertools
import sys
import types as python
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from numba import config, types

INTERPRETED = bool(config.DISABLE_JIT)  # nothing is compiled

LIBRARIES = {"builtins", "numba", "llvmlite", "numpy", *sys.stdlib_module_names} - {"__main__"}
_PACKAGE = __package__.partition(".")[0]
ROOMS = "compiler", "kernels", "points", "schemes", "styles"  # whose sources are in every key

choosers: dict[Callable, list[Callable]] = {}  # of what kernels choose by type
# What says what functions are in kernels, and is more than the sources of the rooms tell.
registered: list[Callable] = []

# Modules elsewhere that functions are made of that are compiled, innermost last; in each thread of
# Python its own.
_noted: contextvars.ContextVar[tuple[set[str], ...]] = contextvars.ContextVar("noted", default=())


@functools.cache
def is_elsewhere(module: str) -> bool:
    """Tell whether a module is neither of a library nor of the rooms that every key has."""
    top, _, rest = module.partition(".")
    return top not in LIBRARIES and not (top == _PACKAGE and rest.partition(".")[0] in ROOMS)


def modules_of(*things: Any) -> set[str]:
    """List the modules elsewhere in which functions or classes were written."""
    names = [one.__name__ if isinstance(one, python.ModuleType) else "" for one in things]
    names += [one.__module__ for one in things if hasattr(one, "__module__")]
    functions = (one for one in things if isinstance(one, python.FunctionType))
    names += [one.__globals__.get("__name__") for one in functions]
    return {name for name in names if name and is_elsewhere(name)}


def register(made: Callable) -> None:
    """Note what a function is in kernels for some types: all keys have it."""
    is_function = isinstance(made, python.FunctionType)
    given = is_function and (made.__closure__ or made.__defaults__ or made.__kwdefaults__)
    if given or modules_of(made):
        registered.append(made)


def note(modules: Iterable[str]) -> None:
    """Note modules elsewhere that the function consists of that is compiled now."""
    if noted := _noted.get():
        noted[-1].update(modules)


@contextmanager
def modules_noted() -> Iterator[set[str]]:
    """Collect what is noted meanwhile."""
    before, modules = _noted.get(), set()
    _noted.set((*before, modules))
    try:
        yield modules
    finally:
        _noted.set(before)


def name_of(thing: Any) -> str:
    """Return the name of a function or class as ``module:qualified name``."""
    return f"{thing.__module__}:{thing.__qualname__}"


def tag_class(numba_type: Any) -> Any:
    """Return the class of a tag, by which point functions are selected, from its type."""
    return getattr(numba_type, "instance_class", None)


def classes_in(numba_type: Any) -> Iterator[type]:
    """Yield the classes of the tags in a type."""
    if tag_class(numba_type):
        yield numba_type.instance_class
    if isinstance(numba_type, types.BaseTuple):
        for item in numba_type:
            yield from classes_in(item)


def codes_in(code: python.CodeType) -> list[python.CodeType]:
    """List code objects, including nested functions."""
    inner = (codes_in(c) for c in code.co_consts if isinstance(c, python.CodeType))
    return [code, *itertools.chain.from_iterable(inner)]
