"""Parsers of script.lark and expression.lark, and the trees they build."""

import functools
import hashlib
import marshal
import math
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from karamelo_py.compiler import files
from karamelo_py.script import syntax
from karamelo_py.script.syntax import Mistake

# Trees are traversed recursively; far below Python's limit.
MAX_DEPTH = 150

SPELLINGS = {"**": "^", "and": "&&", "or": "||", "not": "!"}


def refused() -> type[Exception]:
    from lark.exceptions import UnexpectedInput

    return UnexpectedInput


@functools.cache
def parser_of(start: str) -> Any:
    """Parser of statements or of expressions.

    Lark takes 0.06 s for each, 0.01 s from tables cached on disk. Cache errors are ignored.
    """
    import lark
    from lark.grammar import Rule
    from lark.lexer import TerminalDef

    text = Path(__file__).with_name(f"{start}.lark").read_text(encoding="utf-8")
    # Tables contain only numbers and strings: their bytes create no other objects.
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


def span(part: Any) -> tuple[int, int]:
    """Start and end of a token, or of its result."""
    return part if isinstance(part, tuple) else (part.start_pos, part.end_pos)


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
            hint="give parts of it names: a = ..., b = ..., then a + b",
        )
    return start, end, depth


class _TreeBuilder:
    """Builds statement spans and expression trees while Lark parses.

    Each method is named after the grammar rule whose matches it receives.
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
