"""Choices by type made in compiled code; the key of a kernel contains them."""

import contextvars
import functools
import itertools
import sys
import types as python
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from numba import config

INTERPRETED = bool(config.DISABLE_JIT)  # nothing is compiled

# Identified by name: their versions are part of every key.
_OPAQUE = {"numba", "llvmlite", "numpy", *sys.stdlib_module_names}
# Code generators are in every key as a whole, and so are methods of tensors, which are found
# through objects, not names.
_HERE = Path(__file__).parent
WHOLE = sorted(
    map(str, [*_HERE.rglob("*.py"), _HERE.parent / "points" / "kinematics" / "__init__.py"])
)


class Unknown(Exception):
    """Something that a kernel depends on cannot be hashed."""


class Choice(NamedTuple):
    """A point function and the classes of tags it was selected for, all by name."""

    point_function: str
    classes: tuple[str, ...]


point_functions: dict[str, list[Callable]] = {}  # by name; they have `find(classes)` and `tags`
choosers: dict[Callable, list[Callable]] = {}  # functions that kernels select by type
of_numbers: dict[Callable, list[Callable]] = {}  # implementations of functions for number types


def name_of(thing: Any) -> str:
    """Return the name of a function or class as ``module:qualified name``."""
    return f"{thing.__module__}:{thing.__qualname__}"


# A selection of a point function, code of a function that was run, or a class that it names.
Part: TypeAlias = "tuple[Callable, tuple] | Choice | python.CodeType | type"
# Functions in progress, innermost last; separate for each Python thread.
_noted: contextvars.ContextVar[tuple[set[Part], ...]] = contextvars.ContextVar("noted", default=())


def note(parts: Iterable[Part]) -> None:
    """Record parts of the function that is compiled now."""
    if noted := _noted.get():
        noted[-1].update(parts)


@contextmanager
def parts_noted() -> Iterator[set[Part]]:
    """Collect the parts recorded within this context."""
    before, parts = _noted.get(), set()
    _noted.set((*before, parts))
    try:
        yield parts
    finally:
        _noted.set(before)


def tag_class(numba_type: Any) -> Any:
    """Return the class of a tag, by which point functions are selected, from its type."""
    return getattr(numba_type, "instance_class", None)


def found_by_name(name: str) -> Any:
    """Return the object with this `name_of`."""
    module, _, path = name.partition(":")
    try:
        return functools.reduce(getattr, path.split("."), sys.modules[module])
    except (KeyError, AttributeError) as error:
        raise Unknown(name) from error


def class_name(tag: type | None) -> str:
    if tag is None:
        return ""
    name = name_of(tag)
    if found_by_name(name) is not tag:
        raise Unknown(name)
    return name


def contents(parts: Iterable[Part]) -> tuple[frozenset[Choice], frozenset[python.CodeType]]:
    """Separate parts into choices and the Python functions that were compiled."""
    codes = {part for part in parts if isinstance(part, python.CodeType)}
    choices = {
        part if isinstance(part, Choice) else Choice(name_of(part[0]), (*map(class_name, part[1]),))
        for part in {*parts} - codes
        if not isinstance(part, type)
    }
    return frozenset(choices), frozenset(c for c in codes if c.co_filename not in WHOLE)


def codes_in(code: python.CodeType) -> list[python.CodeType]:
    """List code objects, including nested functions."""
    inner = (codes_in(c) for c in code.co_consts if isinstance(c, python.CodeType))
    return [code, *itertools.chain.from_iterable(inner)]


def is_opaque(thing: Any) -> bool:
    """Tell whether a thing is identified by name because it belongs to a library."""
    is_module = isinstance(thing, python.ModuleType)
    module = thing.__name__ if is_module else getattr(thing, "__module__", None)
    if module is None:
        return not isinstance(thing, python.FunctionType)
    return module.partition(".")[0] in _OPAQUE
