"""Parse text by Lark (script.lark, expression.lark)."""

import hashlib
import marshal
import math
import re
import sys
from contextlib import suppress
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from karamelo_py.compiler import files
from karamelo_py.script import mistakes, syntax
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.syntax import Mistake

# Largest depth of a tree. Trees are traversed recursively; this limit is far below Python's.
MAX_DEPTH = 150

SPELLINGS = {"**": "^", "and": "&&", "or": "||", "not": "!"}
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_SINGLE_QUOTED = re.compile(r"'([^'\"\n]*)'?")


def parse(text: str, file: str = "<text>") -> list[syntax.Statement]:
    """Parse statements, without the arguments of calls.

    Raises ScriptError for a syntax error, with further errors in `others` and the correct
    statements in `statements`.
    """
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    source = syntax.Source(text, file)
    try:
        if not (text.isascii() and text.isprintable()):
            mistakes.check_characters(text)
        spans = parser_of("script").parse(text)
    except refused():
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
    raw = syntax.Raw(syntax.Source(text, file), 0, len(text))
    return raw, parse_expression(raw)


@lru_cache(maxsize=4096)
def _tree(code: str) -> syntax.Node:
    word = code.strip()
    # A shortcut, as most arguments are a single name or number.
    start = code.index(word)
    if word.isascii() and word.isidentifier() and word not in SPELLINGS:
        return syntax.Name(start, start + len(word), 1, word)
    if NUMBER.fullmatch(word):
        return syntax.NumberLiteral(start, start + len(word), 1, literal(word, start))
    if not word:
        raise Mistake("there is nothing here", 0, len(code), expected="an expression")
    try:
        return parser_of("expression").parse(code)
    except refused():
        raise mistakes.in_expression(parser_of("expression"), code) from None


def _statement(source: syntax.Source, span: tuple[str, str, int, int, Any]) -> syntax.Statement:
    kind, name, start, end, parts = span
    mark = source.mark(start, start + max(len(name), 1))
    whole = syntax.Raw(source, start, end)
    if kind == "call":
        return syntax.CommandCall(mark, whole, name, tuple(_arguments(source, name, parts)))
    if kind == "evaluation":
        return syntax.Evaluation(whole.mark, whole, parse_expression(whole))
    begin, stop = parts
    right = syntax.Raw(source, begin, max(stop, begin))
    if not right.code.strip():
        message = f"nothing is assigned to '{name}'"
        expected = "a number, a text in quotes or an expression after the ="
        hint = f"{name} = 1"
        raise ScriptError(message, code="syntax", mark=whole.mark, expected=expected, hint=hint)
    return syntax.Assignment(mark, whole, name, right, parse_expression(right))


def _arguments(source: syntax.Source, name: str, parts: list) -> list[syntax.Raw]:
    """Return raw arguments of a call; `parts` are alternately spans (None if empty) and commas."""
    if parts == [None]:
        return []
    raws = []
    for k, item in enumerate(parts[::2]):
        if item is None:
            after = 2 * k + 1 == len(parts)
            comma = parts[2 * k - 1 if after else 2 * k + 1]
            raise ScriptError(
                f"{name}: argument {k + 1} is missing",
                code="syntax",
                mark=source.mark(*span(comma)),
                expected=f"something {'after' if after else 'before'} this comma",
                hint="leave the comma out, or write NULL for a component that is not set",
            )
        if single := _SINGLE_QUOTED.match(source.text, item[0]):
            bare = ", or the word without quotes" if single[1].isidentifier() else ""
            raise ScriptError(
                f"{single[0]} is in single quotes",
                code="syntax",
                mark=source.mark(*single.span()),
                expected="text in double quotes",
                hint=f'write "{single[1]}"{bare}',
            )
        raws.append(syntax.Raw(source, *item))
    return raws


def refused() -> type[Exception]:
    from lark.exceptions import UnexpectedInput

    return UnexpectedInput


@cache
def parser_of(start: str) -> Any:
    """Return the parser of statements or of expressions.

    Making a parser takes 0.06 s, or 0.01 s from tables that are cached on disk.
    """
    import lark
    from lark.grammar import Rule
    from lark.lexer import TerminalDef

    text = Path(__file__).with_name(f"{start}.lark").read_text(encoding="utf-8")
    # The tables contain only numbers and strings, so loading them executes no code.
    stamp = hashlib.sha256(f"{lark.__version__} {sys.version} {text}".encode()).hexdigest()[:24]
    path = files.folder().with_name("parsers") / f"{start}-{stamp}.tables"
    with suppress(OSError, ValueError, EOFError, TypeError):
        return lark.Lark._load_from_dict(
            *marshal.loads(files.read(path)), transformer=_TreeBuilder()
        )
    made = lark.Lark(
        text, parser="lalr", start=start, keep_all_tokens=True, maybe_placeholders=False,
        transformer=_TreeBuilder(),
    )  # fmt: skip
    data, memo = made.memo_serialize([TerminalDef, Rule])
    data["options"].pop("transformer")
    with suppress(OSError, ValueError):
        files.write(path, marshal.dumps((data, memo)))
    return made


def literal(word: str, start: int) -> float:
    value = float(word)
    if math.isinf(value):
        raise Mistake(f"the number {word} is too large", start, start + len(word), "below 1.8e308")
    return value


def span(item: Any) -> tuple[int, int]:
    return item if isinstance(item, tuple) else (item.start_pos, item.end_pos)


def _around(parts: list) -> tuple[int, int]:
    return span(parts[0])[0], span(parts[-1])[1]


def _spelled(sign: str) -> str:
    return SPELLINGS.get(str(sign), str(sign))


def _above(start: int, end: int, *below: syntax.Node) -> tuple[int, int, int]:
    depth = 1 + max((node.depth for node in below), default=0)
    if depth > MAX_DEPTH:
        raise Mistake(
            "the expression is too long or too deeply nested",
            start,
            end,
            expected=f"at most {MAX_DEPTH} levels",
            hint="name its parts: a = ..., b = ..., then a + b",
        )
    return start, end, depth


class _TreeBuilder:
    """Builds spans and trees while Lark parses, with a method for each grammar rule."""

    def script(self, parts: list) -> list:
        return [item for item in parts if isinstance(item, tuple)]

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
        start, end = span(parts[0])
        return syntax.NumberLiteral(start, end, 1, literal(str(parts[0]), start))

    def text(self, parts: list) -> syntax.Node:
        return syntax.TextLiteral(*span(parts[0]), 1, str(parts[0])[1:-1])

    def name(self, parts: list) -> syntax.Node:
        return syntax.Name(*span(parts[0]), 1, str(parts[0]))

    def unary(self, parts: list) -> syntax.Node:
        sign, operand = parts
        around = _above(sign.start_pos, operand.end, operand)
        return syntax.UnaryOperation(*around, _spelled(sign), operand)

    def binary(self, parts: list) -> syntax.Node:
        left, sign, right = parts
        around = _above(left.start, right.end, left, right)
        return syntax.BinaryOperation(*around, _spelled(sign), left, right)

    def operands(self, parts: list) -> list:
        return parts[::2]

    def function(self, parts: list) -> syntax.Node:
        operands = tuple(parts[2]) if len(parts) == 4 else ()
        around = _above(parts[0].start_pos, parts[-1].end_pos, *operands)
        return syntax.FunctionCall(*around, str(parts[0]), operands)

    def parenthesis(self, parts: list) -> syntax.Node:
        return replace(parts[1], start=parts[0].start_pos, end=parts[2].end_pos)
