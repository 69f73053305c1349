"""From text to statements. The grammars are in script.lark and expression.lark."""

import functools
import math
import platform
import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from karamelo_py.compiler import cache
from karamelo_py.script import expression_mistakes, mistakes, syntax
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.mistakes import Mistake

# Trees are walked by recursion; this keeps well below Python's limit.
MAX_DEPTH = 150

_SINGLE_QUOTED = re.compile(r"'([^'\"\n]*)'?")
_SPELLINGS = {"**": "^", "and": "&&", "or": "||", "not": "!"}


def parse(text: str, file: str = "<text>") -> list[syntax.Statement]:
    """The statements of a script.

    Arguments of calls stay as they are written; everything else is checked.

    Raises
    ------
    ScriptError
        At the first syntax error, with its place; those of other statements are its `others`, and
        statements without any its `statements`.
    """
    # A byte order mark and the line ends of other systems mean nothing.
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    source = syntax.Source(text, file)
    try:
        mistakes.check_characters(text)
        spans = _lark("script").parse(text)
    except _refused():
        raise mistakes.in_script(text).error(source) from None
    except Mistake as mistake:
        raise mistake.error(source) from None
    statements: list[syntax.Statement] = []
    errors: list[ScriptError] = []
    for span in spans:
        try:
            statements.append(_statement(source, *span))
        except ScriptError as error:
            errors.append(error)
    if errors:
        first, *first.others = errors
        first.statements = statements
        raise first
    return statements


def parse_expression(raw: syntax.Raw) -> syntax.Node:
    """The tree of an expression.

    Raises
    ------
    ScriptError
        At a syntax error, with its place.
    """
    try:
        return _tree(raw.code)
    except Mistake as mistake:
        raise mistake.error(raw.source, raw.start) from None


def parse_text(text: str, file: str = "<text>") -> tuple[syntax.Raw, syntax.Node]:
    """An expression that stands in no script, such as one from the command line."""
    raw = syntax.Raw(syntax.Source(text, file), 0, len(text))
    return raw, parse_expression(raw)


@functools.lru_cache(maxsize=4096)
def _tree(code: str) -> syntax.Node:
    """The tree of `code`; its offsets count from the start of `code`."""
    word = code.strip()
    # Most arguments and many right-hand sides are one name or one whole number.
    if word.isascii() and word.isidentifier() and word not in _SPELLINGS:
        start = code.index(word)
        return syntax.Name(start, start + len(word), 1, word)
    if word.isascii() and word.isdigit():
        start = code.index(word)
        return syntax.NumberLiteral(start, start + len(word), 1, _number(word, start))
    if not word:
        raise Mistake("there is nothing here", 0, len(code), expected="an expression")
    try:
        return _lark("expression").parse(code)
    except _refused():
        raise expression_mistakes.in_expression(_lark("expression"), code) from None


def _number(word: str, start: int) -> float:
    value = float(word)
    if math.isinf(value):
        raise Mistake(
            f"the number {word} is too large", start, start + len(word), expected="below 1.8e308"
        )
    return value


def _statement(
    source: syntax.Source, kind: str, name: str, start: int, end: int, parts: Any
) -> syntax.Statement:
    """The statement that lies at `start` to `end`."""
    place = source.place(start, start + max(len(name), 1))
    whole = syntax.Raw(source, start, end)
    if kind == "assignment":
        begin, stop = parts
        right = syntax.Raw(source, begin, max(stop, begin))
        if not right.code.strip():
            raise ScriptError(
                f"nothing is assigned to '{name}'",
                place=source.place(start, end),
                expected="a number, a text in quotes or an expression after the =",
                hint=f"{name} = 1",
            )
        return syntax.Assignment(place, whole, name, right, parse_expression(right))
    if kind == "call":
        return syntax.CommandCall(place, whole, name, tuple(_arguments(source, name, parts)))
    node = parse_expression(whole)
    return syntax.Evaluation(source.place(start, end), whole, node)


def _arguments(source: syntax.Source, name: str, parts: list) -> list[syntax.Raw]:
    """Raw arguments of a call; `parts` are spans (None where empty) and the commas between."""
    if parts == [None]:
        return []
    raws = []
    for k, part in enumerate(parts):
        if k % 2:
            continue
        if part is None:
            comma = parts[k + 1] if k + 1 < len(parts) else parts[k - 1]
            where = "before" if k + 1 < len(parts) else "after"
            raise ScriptError(
                f"{name}: argument {k // 2 + 1} is missing",
                place=source.place(*_span(comma)),
                expected=f"something {where} this comma",
                hint="leave the comma out, or write NULL where a component is not to be set",
            )
        if single := _SINGLE_QUOTED.match(source.text, part[0]):
            raise ScriptError(
                f"{single[0]} stands in single quotes",
                place=source.place(*single.span()),
                expected="texts stand in double quotes",
                hint=f'write "{single[1]}"'
                + (", or the word without quotes" if single[1].isidentifier() else ""),
            )
        raws.append(syntax.Raw(source, *part))
    return raws


# ---- Lark ---------------------------------------------------------------------------------------


def _refused() -> type[Exception]:
    from lark.exceptions import UnexpectedInput

    return UnexpectedInput


@functools.cache
def _lark(start: str) -> Any:
    """Make the parser of statements, or that of expressions, which knows no other tokens.

    Lark needs 0.06 s for each, and 0.01 s to read one that it has kept; what it cannot read or
    write there is no matter.
    """
    import lark

    folder = cache.folder().with_name("parsers")
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    versions = f"{lark.__version__}-{platform.python_version()}"
    return lark.Lark(
        Path(__file__).with_name(f"{start}.lark").read_text(encoding="utf-8"),
        parser="lalr",
        start=start,
        transformer=_TreeBuilder(),
        keep_all_tokens=True,
        maybe_placeholders=False,
        cache=str(folder / f"{start}-{versions}.parser"),
    )


def _span(part: Any) -> tuple[int, int]:
    return part if isinstance(part, tuple) else (part.start_pos, part.end_pos)


def _around(parts: list) -> tuple[int, int]:
    return _span(parts[0])[0], _span(parts[-1])[1]


def _deeper(start: int, end: int, *below: syntax.Node) -> int:
    depth = 1 + max((node.depth for node in below), default=0)
    if depth > MAX_DEPTH:
        raise Mistake(
            "the expression is too long or too deeply nested",
            start,
            end,
            expected=f"at most {MAX_DEPTH} levels",
            hint="give parts of it names: a = ..., b = ..., then a + b",
        )
    return depth


class _TreeBuilder:
    """Makes spans of statements and trees of expressions while Lark parses.

    Each method is named after a rule of the grammar and gets what the rule matched.
    """

    def script(self, parts: list) -> list:
        return [part for part in parts if isinstance(part, tuple)]

    def assignment(self, parts: list) -> tuple:
        head = parts[0]
        start, end = _around(parts)
        return "assignment", head[:-1].rstrip(), start, end, (head.end_pos, end)

    def call(self, parts: list) -> tuple:
        return "call", parts[0][:-1].rstrip(), *_around(parts), parts[1]

    def evaluation(self, parts: list) -> tuple:
        return "evaluation", "", *_around(parts), None

    def group(self, parts: list) -> tuple:
        return _around(parts)

    nested = group

    def arguments(self, parts: list) -> list:
        return parts

    def argument(self, parts: list) -> tuple | None:
        parts = [p for p in parts if isinstance(p, tuple) or p.type != "NEWLINE"]
        return _around(parts) if parts else None

    def number(self, parts: list) -> syntax.Node:
        start, end = _span(parts[0])
        return syntax.NumberLiteral(start, end, 1, _number(str(parts[0]), start))

    def text(self, parts: list) -> syntax.Node:
        return syntax.TextLiteral(*_span(parts[0]), 1, str(parts[0])[1:-1])

    def name(self, parts: list) -> syntax.Node:
        return syntax.Name(*_span(parts[0]), 1, str(parts[0]))

    def unary(self, parts: list) -> syntax.Node:
        sign, operand = parts
        operator = _SPELLINGS.get(str(sign), str(sign))
        start, end = sign.start_pos, operand.end
        return syntax.UnaryOperation(start, end, _deeper(start, end, operand), operator, operand)

    def binary(self, parts: list) -> syntax.Node:
        left, sign, right = parts
        operator = _SPELLINGS.get(str(sign), str(sign))
        start, end = left.start, right.end
        return syntax.BinaryOperation(
            start, end, _deeper(start, end, left, right), operator, left, right
        )

    def operands(self, parts: list) -> list:
        return parts[::2]

    def function(self, parts: list) -> syntax.Node:
        operands = tuple(parts[2]) if len(parts) == 4 else ()
        start, end = parts[0].start_pos, parts[-1].end_pos
        return syntax.FunctionCall(
            start, end, _deeper(start, end, *operands), str(parts[0]), operands
        )

    def parenthesis(self, parts: list) -> syntax.Node:
        # The same tree, but marked and quoted with its parentheses.
        return replace(parts[1], start=parts[0].start_pos, end=parts[2].end_pos)
