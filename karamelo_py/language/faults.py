"""Convert exceptions in styles and plug-ins to script errors."""

import inspect
import linecache
import sysconfig
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from karamelo_py.compiler import CannotCompile, Undefined, places_of
from karamelo_py.language import registry
from karamelo_py.script.errors import FAILURES, Mark, Quit, ScriptError

TRACEBACK = "; --debug shows the traceback"

KNOWN = (ScriptError, Quit, OSError, OverflowError, MemoryError, RecursionError)


@contextmanager
def as_script_error(name: str, where: str, code: Any, mark: Mark | None) -> Iterator[None]:
    """Convert an exception in a style of this `name` (``fix drag``) to a ScriptError.

    `where` is what was called, such as a hook. The message names the last line of the traceback in
    the file of `code`.
    """
    try:
        yield
    except KNOWN:
        raise
    except FAILURES as error:
        raise of_style(error, name, where, code, mark) from error


def of_style(
    error: BaseException, name: str, where: str, code: Any, mark: Mark | None
) -> ScriptError:
    message = f"{cause_of(error)}{place_in(code, error)}"
    return fault(name, f"{where}: {message}", mark, TRACEBACK)


def fault(name: str, message: str, mark: Mark | None, more: str = "") -> ScriptError:
    family, _, style = name.rpartition(" ")
    family = family or "command"
    origin = registry.origin(family, style) if registry.knows(family, style) else ""
    package = f" (of {origin})" if origin else ""
    hint = f"tell the author of {style}{more}"
    if origin.startswith("the module "):
        hint = f"correct it in {origin.removeprefix('the ')}{more}"
    error = ScriptError(f"{name}{package}: {message}", mark=mark, hint=hint, code="plug-in")
    error.complete = True
    return error


def cause_of(error: BaseException) -> str:
    """Describe an error in one line; if code does not compile, include the user's line."""
    if isinstance(error, Undefined):
        return str(error)
    if not isinstance(error, CannotCompile):
        return ": ".join(filter(None, (type(error).__name__, str(error))))
    user_places = (mark for mark in places_of(error) if not mark[0].startswith(_others()))
    line = next(filter(None, (linecache.getline(*mark).strip() for mark in user_places)), None)
    return f"it cannot be compiled: {error}" + (f", in '{line}'" if line else "")


def _others() -> tuple[str, ...]:
    libraries = map(sysconfig.get_path, ("stdlib", "purelib", "platlib"))
    return (str(Path(__file__).parents[1]), *libraries)


def steps_to(error: BaseException) -> list[str]:
    """List the user's lines: ``ropes.py:12 in pull: inner(points)``."""
    others = _others()
    return [
        f"{Path(frame.filename).name}:{frame.lineno} in {frame.name}: {frame.line}".rstrip(": ")
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith(others)
    ]


def place_of(function: Callable) -> str:
    code = function.__code__
    return f" ({Path(code.co_filename).name}:{code.co_firstlineno})"


def place_in(code: Any, error: BaseException) -> str:
    """Return the place in `code` of the last line of the traceback:"""
    try:
        source = inspect.getsourcefile(inspect.unwrap(code))
    except TypeError:
        source = None
    places = [*places_of(error)]
    same = [mark for mark in places if source and Path(mark[0]).resolve() == Path(source).resolve()]
    return next((f" ({Path(file).name}:{line})" for file, line in [*same, *places]), "")
