"""Exceptions in code of a style or plug-in, told with the place in the script that uses it."""

import inspect
import linecache
import sysconfig
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from karamelo_py.compiler.trace import CannotCompile, Undefined, places_of
from karamelo_py.language import registry
from karamelo_py.script.errors import FAILURES, Place, Quit, ScriptError

TRACEBACK = "; --debug shows the traceback"

# These are told elsewhere in words of their own.
KNOWN = (ScriptError, Quit, OSError, OverflowError, MemoryError, RecursionError)


@contextmanager
def told(name: str, where: str, code: Any, place: Place | None) -> Iterator[None]:
    """Turn an exception of a style into an error of the script.

    Parameters
    ----------
    name
        What uses the code: ``fix drag``.
    where
        Which part of it is at work, such as the name of a hook.
    code
        The class or function, whose file is looked for in the traceback.
    place
        Where the script asks for it.
    """
    try:
        yield
    except KNOWN:
        raise
    except FAILURES as error:
        what = f"{cause_of(error)}{place_in(code, error)}"
        raise fault(name, f"{where}: {what}", place, TRACEBACK) from error


def fault(name: str, what: str, place: Place | None, more: str = "") -> ScriptError:
    """The error of a script that uses a style with a fault in it: names its package.

    Parameters
    ----------
    name
        What uses the code: ``fix drag``.
    what
        What is wrong with it.
    place
        Where the script asks for it.
    more
        What follows the hint.
    """
    family, _, style = name.partition(" ")
    family, style = (family, style) if style else ("command", family)
    package = f" (of {registry.origin(family, style)})" if registry.knows(family, style) else ""
    error = ScriptError(
        f"{name}{package}: {what}",
        place=place,
        hint=f"tell the author of {style}{more}",
    )
    error.complete = True
    return error


def cause_of(error: BaseException) -> str:
    """Tell what went wrong, in one line; of what cannot be compiled, with the user's own line."""
    if isinstance(error, Undefined):
        return str(error)
    if not isinstance(error, CannotCompile):
        return ": ".join(filter(None, (type(error).__name__, str(error))))
    own = (place for place in places_of(error) if not place[0].startswith(_OTHERS))
    lines = (linecache.getline(*place).strip() for place in own)
    line = next(filter(None, lines), None)
    return f"it cannot be compiled: {error}" + (f", in '{line}'" if line else "")


# Not of the user: this program, Python's own library, and what is installed.
_OTHERS = (
    str(Path(__file__).parents[1]),
    *map(sysconfig.get_path, ("stdlib", "purelib", "platlib")),
)


def steps_to(error: BaseException) -> list[str]:
    """``ropes.py:12 in pull: inner(points)``: the lines of the user that led to an exception."""
    return [
        f"{Path(frame.filename).name}:{frame.lineno} in {frame.name}: {frame.line}".rstrip(": ")
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith(_OTHERS)
    ]


def place_of(function: Callable) -> str:
    """`` (spring.py:12)``: where a function in Python begins."""
    code = function.__code__
    return f" ({Path(code.co_filename).name}:{code.co_firstlineno})"


def place_in(code: Any, error: BaseException) -> str:
    """`` (spring.py:28)``: the last line of the own file of `code` that took part."""
    try:
        own = inspect.getsourcefile(code)
    except TypeError:
        own = None
    places = [*places_of(error)]
    same = [place for place in places if own and Path(place[0]).resolve() == Path(own).resolve()]
    for file, line in [*same, *places][:1]:
        return f" ({Path(file).name}:{line})"
    return ""
