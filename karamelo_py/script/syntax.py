"""Parsed scripts: statements, raw arguments, expression trees."""

import re
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

from karamelo_py.script.errors import Mark, ScriptError

# Quoted text is matched first, as a # in quotes does not begin a comment.
_BLANKS = re.compile(r'"[^"\n]*"|\s+')
_COMMENT_OR_BREAK = re.compile(r'"[^"\n]*"|#[^\n]*|\n')


class Source:
    """The text of a script; converts offsets to marks."""

    def __init__(self, text: str, file: str):
        self.text = text
        self.file = file

    @cached_property
    def _starts(self) -> list[int]:
        return [0] + [m.end() for m in re.finditer("\n", self.text)]

    def mark(self, start: int, end: int) -> Mark:
        start = min(max(start, 0), len(self.text))
        line = bisect_right(self._starts, start) - 1
        first = self._starts[line]
        last = self.text.find("\n", first)
        last = len(self.text) if last < 0 else last
        length = max(min(end, last) - start, 1)
        return Mark(self.file, line + 1, start - first + 1, length, self.text[first:last])

    def code(self, start: int, end: int) -> str:
        """Return the text of a span, with blanks for comments and line ends."""
        text = self.text[start:end]
        if "#" in text or "\n" in text:
            text = _COMMENT_OR_BREAK.sub(
                lambda m: m[0] if m[0][0] == '"' else " " * len(m[0]), text
            )
        return text


@dataclass(eq=False)
class Mistake(Exception):
    """A syntax error between two offsets in a text."""

    message: str
    start: int
    end: int
    expected: str | None = None
    hint: str | None = None

    def error(self, source: Source, offset: int = 0) -> ScriptError:
        mark = source.mark(offset + self.start, offset + self.end)
        expected, hint = self.expected, self.hint
        return ScriptError(self.message, mark=mark, expected=expected, hint=hint, code="syntax")


@dataclass(frozen=True, slots=True)
class Node:
    start: int
    end: int
    depth: int = field(compare=False)


@dataclass(frozen=True, slots=True)
class NumberLiteral(Node):
    value: float


@dataclass(frozen=True, slots=True)
class TextLiteral(Node):
    value: str


@dataclass(frozen=True, slots=True)
class Name(Node):
    name: str


@dataclass(frozen=True, slots=True)
class UnaryOperation(Node):
    operator: str
    operand: Node


@dataclass(frozen=True, slots=True)
class BinaryOperation(Node):
    """`left` `operator` `right`. Operators with several spellings are stored as ``^ && ||``."""

    operator: str
    left: Node
    right: Node


@dataclass(frozen=True, slots=True)
class FunctionCall(Node):
    name: str
    operands: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Raw:
    source: Source
    start: int
    end: int

    @property
    def code(self) -> str:
        return self.source.code(self.start, self.end)

    @property
    def mark(self) -> Mark:
        return self.source.mark(self.start, self.end)


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement; `mark` is the location of its first word."""

    mark: Mark
    raw: Raw

    def spelled(self, without: Iterable[str] = ()) -> str:
        """Return the statement without blanks, comments, line ends and keywords in `without`."""
        text = _BLANKS.sub(lambda m: m[0] if m[0][0] == '"' else "", self.raw.code)
        for word in without:
            text = re.sub(rf",{word}=[^,()]*", "", text)
        return text


@dataclass(frozen=True, slots=True)
class Assignment(Statement):
    name: str
    right: Raw
    node: Node


@dataclass(frozen=True, slots=True)
class CommandCall(Statement):
    name: str
    arguments: tuple[Raw, ...]


@dataclass(frozen=True, slots=True)
class Evaluation(Statement):
    node: Node
