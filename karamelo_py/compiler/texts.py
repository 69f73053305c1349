"""The text of functions that Python has read."""

import ast
import linecache
import os
import textwrap
import time
import types as python
from collections.abc import Callable, Iterator

from karamelo_py.compiler.values import Untraceable

_LONGEST_END = 40  # lines of closing brackets, at most, behind the last one with code


def _last_line(code: python.CodeType) -> int:
    own = max(line for _, _, line in code.co_lines() if line is not None)
    inner = (_last_line(c) for c in code.co_consts if isinstance(c, python.CodeType))
    return max(own, *inner, own)


def _lines(function: Callable) -> Iterator[str]:
    """The text of a function; longer and longer, until it can be parsed."""
    text = vars(function).get("text")
    if text is not None:
        yield text
        return
    code = function.__code__
    lines = linecache.getlines(code.co_filename)
    if not _is_read(code.co_filename) and not _is_in("".join(lines), code):
        raise Untraceable("its file has changed since Python read it: start anew")
    last = _last_line(code)
    for end in range(last, min(last + _LONGEST_END, len(lines)) + 1):
        yield textwrap.dedent("".join(lines[code.co_firstlineno - 1 : end]))


_began = time.time()


def _is_read(file: str) -> bool:
    """Whether a file is as it was when Python read it; what was typed in lies in no file."""
    try:
        about = os.stat(file)
    except OSError:
        return True
    return max(about.st_ctime, about.st_mtime) < _began


def _is_in(text: str, code: python.CodeType) -> bool:
    """Whether a text has a function with this code."""
    ahead: list = [compile(text, code.co_filename, "exec", dont_inherit=True)]
    while ahead and ahead[-1] != code:
        ahead += [c for c in ahead.pop().co_consts if isinstance(c, python.CodeType)]
    return bool(ahead)


def text_of(function: Callable) -> ast.FunctionDef:
    """The text of a function, parsed."""
    for text in _lines(function):
        try:
            (definition,) = ast.parse(text).body
        except (SyntaxError, ValueError):
            continue
        if isinstance(definition, ast.FunctionDef):
            return ast.increment_lineno(definition, function.__code__.co_firstlineno - 1)
        break
    raise Untraceable("its text is not known: write it into a file")
