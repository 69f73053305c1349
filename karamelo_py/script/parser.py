"""Parse text as statements and expression trees."""

import difflib
import re
from functools import lru_cache
from pathlib import Path
from typing import Any

from karamelo_py.script import grammar, mistakes, reading, syntax
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.syntax import Mistake

NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_SINGLE_QUOTED = re.compile(r"'([^'\"\n]*)'?")
# Endings of files that programs write next to scripts.
_WRITTEN = (
    *(".png", ".pdf", ".svg", ".gif", ".mp4", ".gz", ".bin", ".h5", ".vtu", ".pvd", ".csv", ".txt"),
    *(".LAMMPS", ".log", ".part"),
)


def read_script(path: Path) -> str:
    try:
        return reading.read_text(path)
    except IsADirectoryError:
        expected = "the name of a script"
        raise ScriptError(f"{path} is a folder", expected=expected, code="file") from None
    except FileNotFoundError:
        parent = path.parent
        files = parent.iterdir() if parent.is_dir() else ()
        scripts = sorted(f.name for f in files if f.suffix not in _WRITTEN and f.is_file())
        close = difflib.get_close_matches(path.name, scripts, n=1, cutoff=0.75)
        where = "" if parent.is_dir() else f": the folder {parent} does not exist"
        raise ScriptError(
            f"there is no file {path}{where}",
            code="no-file",
            expected="the name of a script",
            hint=f"did you mean {parent / close[0]}?" if close else None,
        ) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        message = f"{path} cannot be read: {reason}"
        raise ScriptError(message, expected="a script, which is a text file", code="file") from None


def parse(text: str, file: str = "<text>") -> list[syntax.Statement]:
    """Statements of a script; arguments of calls stay unparsed.

    The first syntax error has further ones in `others`, and correct statements in `statements`.
    """
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    source = syntax.Source(text, file)
    try:
        if not (text.isascii() and text.isprintable()):
            mistakes.check_characters(text)
        spans = grammar.parser_of("script").parse(text)
    except grammar.refused():
        raise mistakes.in_script(text).error(source) from None
    except Mistake as mistake:
        raise mistake.error(source) from None
    statements: list[syntax.Statement] = []
    errors: list[ScriptError] = []
    for span in spans:
        try:
            statements.append(_statement(source, span))
        except ScriptError as error:
            errors.append(error)
    if errors:
        first, *first.others = errors
        first.statements = statements
        raise first
    return statements


def parse_expression(raw: syntax.Raw) -> syntax.Node:
    try:
        return _tree(raw.code)
    except Mistake as mistake:
        raise mistake.error(raw.source, raw.start) from None


def parse_text(text: str, file: str = "<text>") -> tuple[syntax.Raw, syntax.Node]:
    """An expression from outside a script, such as the command line."""
    raw = syntax.Raw(syntax.Source(text, file), 0, len(text))
    return raw, parse_expression(raw)


@lru_cache(maxsize=4096)
def _tree(code: str) -> syntax.Node:
    """Offsets count from the start of `code`."""
    word = code.strip()
    # Fast path: most arguments and right-hand sides are one name or number.
    start = code.index(word)
    if word.isascii() and word.isidentifier() and word not in grammar.SPELLINGS:
        return syntax.Name(start, start + len(word), 1, word)
    if NUMBER.fullmatch(word):
        return syntax.NumberLiteral(start, start + len(word), 1, grammar.literal(word, start))
    if not word:
        raise Mistake("there is nothing here", 0, len(code), expected="an expression")
    try:
        return grammar.parser_of("expression").parse(code)
    except grammar.refused():
        raise mistakes.in_expression(grammar.parser_of("expression"), code) from None


def _statement(source: syntax.Source, span: tuple[str, str, int, int, Any]) -> syntax.Statement:
    kind, name, start, end, parts = span
    place = source.place(start, start + max(len(name), 1))
    whole = syntax.Raw(source, start, end)
    if kind == "call":
        return syntax.CommandCall(place, whole, name, tuple(_arguments(source, name, parts)))
    if kind == "evaluation":
        return syntax.Evaluation(whole.place, whole, parse_expression(whole))
    begin, stop = parts
    right = syntax.Raw(source, begin, max(stop, begin))
    if not right.code.strip():
        message = f"nothing is assigned to '{name}'"
        expected = "a number, a text in quotes or an expression after the ="
        hint = f"{name} = 1"
        raise ScriptError(message, code="syntax", place=whole.place, expected=expected, hint=hint)
    return syntax.Assignment(place, whole, name, right, parse_expression(right))


def _arguments(source: syntax.Source, name: str, parts: list) -> list[syntax.Raw]:
    """Raw arguments of a call; `parts` alternates spans (None: empty) and commas."""
    if parts == [None]:
        return []
    raws = []
    for k, part in enumerate(parts[::2]):
        if part is None:
            after = 2 * k + 1 == len(parts)
            comma = parts[2 * k - 1 if after else 2 * k + 1]
            raise ScriptError(
                f"{name}: argument {k + 1} is missing",
                code="syntax",
                place=source.place(*grammar.span(comma)),
                expected=f"something {'after' if after else 'before'} this comma",
                hint="leave the comma out, or write NULL where a component is not to be set",
            )
        if single := _SINGLE_QUOTED.match(source.text, part[0]):
            bare = ", or the word without quotes" if single[1].isidentifier() else ""
            raise ScriptError(
                f"{single[0]} is in single quotes",
                code="syntax",
                place=source.place(*single.span()),
                expected="text in double quotes",
                hint=f'write "{single[1]}"{bare}',
            )
        raws.append(syntax.Raw(source, *part))
    return raws
