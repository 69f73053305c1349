"""Exceptions in code of a style or plug-in, told with the place in the script that uses it."""

import inspect
import linecache
import re
import sysconfig
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numba.core.errors import NumbaError

from karamelo_py.compiler.compile import Undefined
from karamelo_py.compiler.trace import line_that_asks
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


def is_of_numba(error: BaseException) -> bool:
    """Whether Numba refuses to compile something."""
    return isinstance(error, NumbaError) or type(error).__module__.startswith("numba.")


def cause_of(error: BaseException) -> str:
    """What went wrong, in one line; of Numba, the cause that it gives."""
    if isinstance(error, Undefined):
        return str(error)
    if not is_of_numba(error):
        return ": ".join(filter(None, (type(error).__name__, str(error))))
    text = re.sub(r"\x1b\[[\d;]*m", "", str(error))
    inner = text.rpartition("raised a specific error:")[2] or text
    lines = (line.strip() for line in inner.splitlines())
    causes = (line for line in lines if line and not re.match(r"(\w+: )?Failed in ", line))
    text = f"Numba cannot compile it: {next(causes, type(error).__name__)}"
    for file, line in places_of(error):
        asking = line_that_asks(file, line)
        if asking is not None:
            what = linecache.getline(file, asking).strip()
            return f"{text} (Numba compiles it for line {asking}, '{what}')"
    return text


def places_of(error: BaseException) -> list[tuple[str, int]]:
    """Files and lines that took part in an exception, the innermost first.

    Of Numba those that its text names, and the functions that it was compiling.
    """
    frames = list(traceback.walk_tb(error.__traceback__))[::-1]
    here = [(frame.f_code.co_filename, line) for frame, line in frames]
    if not is_of_numba(error):
        return here
    named = [(f, int(k)) for f, k in re.findall(r'File "(.*?)", line (\d+)', str(error))]
    compiled = (frame.f_locals.get("func") for frame, _ in frames)
    codes = [f.__code__ for f in compiled if inspect.isfunction(f)]
    return [*named, *((code.co_filename, code.co_firstlineno) for code in codes), *here]


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
    places = places_of(error)
    same = [place for place in places if own and Path(place[0]).resolve() == Path(own).resolve()]
    for file, line in [*same, *places][:1]:
        return f" ({Path(file).name}:{line})"
    return ""
