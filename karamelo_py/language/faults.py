"""Exceptions in code of a style or plug-in, told with the place in the script that uses it."""

from __future__ import annotations

import inspect
import re
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numba.core.errors import NumbaError

from karamelo_py.language import registry
from karamelo_py.script.errors import Place, Quit, ScriptError

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
    except Exception as error:
        what = (
            _cannot_compile(error, code)
            if isinstance(error, NumbaError)
            else f"{cause_of(error)}{_line(error, code)}"
        )
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


def cause_of(error: Exception) -> str:
    """What went wrong, in one line; of Numba, the cause that it gives."""
    if not isinstance(error, NumbaError):
        return f"{type(error).__name__}: {error}"
    text = re.sub(r"\x1b\[[\d;]*m", "", str(error))
    causes = (line.strip() for line in text.splitlines() if not line.startswith("Failed in "))
    return f"Numba cannot compile it: {next(filter(None, causes), type(error).__name__)}"


def _cannot_compile(error: NumbaError, code: Any) -> str:
    """The cause, and where Numba sees it."""
    place = re.search(r'File "(.*?)", line (\d+)', str(error))
    if place:
        file, line = place.groups()
    else:
        file, line = inspect.getsourcefile(code) or "", inspect.getsourcelines(code)[1]
    return f"{cause_of(error)} ({Path(file).name}:{line})"


def _line(error: Exception, code: Any) -> str:
    """`` (spring.py:28)``: the last line of the style's own file that took part."""
    frames = traceback.extract_tb(error.__traceback__)
    try:
        file = inspect.getsourcefile(code)
    except TypeError:
        file = None
    own = [frame for frame in frames if frame.filename == file] or frames[-1:]
    return f" ({Path(own[-1].filename).name}:{own[-1].lineno})" if own else ""
