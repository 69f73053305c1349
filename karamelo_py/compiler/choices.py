"""What was chosen by type for compiled code: that is in the key of a kernel, and nothing else."""

import functools
import sys
import types as python
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

from numba.core import event

# Known by name: their versions are part of every key.
_OPAQUE = {"numba", "llvmlite", "numpy", *sys.stdlib_module_names}
# What Numba's own functions do with lanes cannot be followed from them: all of it is in every key.
WHOLE = [str(path) for path in sorted(Path(__file__).with_name("lanes").glob("*.py"))]
# Nor are methods of tensors, which belong to objects and not to names.
WHOLE.append(str(Path(__file__).parents[1] / "points" / "kinematics" / "tensors.py"))
SPELLED = "<spelled>"  # the file of functions that are written at compile time


class Unknown(Exception):
    """Something that a kernel depends on cannot be put into a hash."""


# --- implementations of point functions that are in a kernel -----------------------------------


class Choice(NamedTuple):
    """That a kernel asked a point function for these classes of tags, all by name."""

    point_function: str
    classes: tuple[str, ...]


point_functions: dict[str, list[Callable]] = {}
choosers: dict[Callable, list[Callable]] = {}  # of what kernels choose by type


def name_of(thing: Any) -> str:
    """``module:qualified name`` of a function or class."""
    return f"{thing.__module__}:{thing.__qualname__}"


def declare_point_function(dispatch: Callable) -> None:
    """Make a point function known by its name; it has ``find(classes)`` and ``tags``."""
    point_functions.setdefault(name_of(dispatch), []).append(dispatch)


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


def tag_class(numba_type: Any) -> Any:
    """The Python class that a Numba type stands for, as far as point functions select by it."""
    return getattr(numba_type, "instance_class", None)


def found_by_name(name: str) -> Any:
    """What `name_of` called so; Unknown if nothing is, or something else."""
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
            choices = frozenset(map(_choice, noted - run))
        except Unknown:
            _unfit[compiled.library] = True
            return
        if not is_opaque(function):
            run.add(function.__code__)
        # What was spelled out at compile time was spelled by a function that is followed itself.
        codes = frozenset(code for code in run if code.co_filename not in (SPELLED, *WHOLE))
        _contents[compiled.library] = Contents(choices, codes)


event.register("numba:compile", _Watch())


def _choice(part: tuple[Callable, tuple]) -> Choice:
    dispatch, classes = part
    return Choice(name_of(dispatch), tuple(class_name(c) for c in classes))


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


def is_opaque(thing: Any) -> bool:
    module = getattr(thing, "__module__", None)
    if module is None:
        return not isinstance(thing, python.FunctionType)
    return module.partition(".")[0] in _OPAQUE
