"""Exceptions in code of a style or plug-in as errors of the script that uses it."""

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

# Each of these has words of its own elsewhere.
KNOWN = (ScriptError, Quit, OSError, OverflowError, MemoryError, RecursionError)


@contextmanager
def as_script_error(name: str, where: str, code: Any, place: Place | None) -> Iterator[None]:
    """Turn an exception of a style into an error of the script.

    Parameters
    ----------
    name
        Family and style: ``fix drag``.
    where
        The part of it that is at work, such as the name of a hook.
    code
        The class or function, whose file is looked for in the traceback.
    place
        The place in the script that asks for it.
    """
    try:
        yield
    except KNOWN:
        raise
    except FAILURES as error:
        what = f"{cause_of(error)}{place_in(code, error)}"
        raise fault(name, f"{where}: {what}", place, TRACEBACK) from error


def fault(name: str, what: str, place: Place | None, more: str = "") -> ScriptError:
    """Make the error of a script that uses a style (``fix drag``) with a fault in it.

    It names the package; `more` follows its hint.
    """
    family, _, style = name.rpartition(" ")
    family = family or "command"
    package = f" (of {registry.origin(family, style)})" if registry.knows(family, style) else ""
    hint = f"tell the author of {style}{more}"
    error = ScriptError(f"{name}{package}: {what}", place=place, hint=hint)
    error.complete = True
    return error


def is_of_numba(error: BaseException) -> bool:
    """Tell if Numba refuses to compile something."""
    return isinstance(error, NumbaError) or type(error).__module__.startswith("numba.")


def cause_of(error: BaseException) -> str:
    """Tell in one line what went wrong; of Numba, the cause that it gives."""
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
    """List files and lines that took part in an exception, the innermost first.

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


def steps_to(error: BaseException) -> list[str]:
    """List the user's lines that led to an exception: ``ropes.py:12 in pull: inner(points)``."""
    # Not of the user: this program, Python's own library, and what is installed.
    libraries = map(sysconfig.get_path, ("stdlib", "purelib", "platlib"))
    others = (str(Path(__file__).parents[1]), *libraries)
    return [
        f"{Path(frame.filename).name}:{frame.lineno} in {frame.name}: {frame.line}".rstrip(": ")
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith(others)
    ]


def place_of(function: Callable) -> str:
    """Show where a function in Python begins: `` (spring.py:12)``."""
    code = function.__code__
    return f" ({Path(code.co_filename).name}:{code.co_firstlineno})"


def place_in(code: Any, error: BaseException) -> str:
    """Show the last line of the own file of `code` that took part: `` (spring.py:28)``."""
    try:
        own = inspect.getsourcefile(code)
    except TypeError:
        own = None
    places = places_of(error)
    same = [place for place in places if own and Path(place[0]).resolve() == Path(own).resolve()]
    return next((f" ({Path(file).name}:{line})" for file, line in [*same, *places]), "")
