"""Syntax errors in a user's words: characters, quotes and parentheses."""

import re

from karamelo_py.script.errors import ScriptError
from karamelo_py.script.syntax import Source


class Mistake(Exception):
    """A syntax error at offsets of a text whose place in a file is not known here."""

    def __init__(
        self,
        message: str,
        start: int,
        end: int,
        expected: str | None = None,
        hint: str | None = None,
    ):
        super().__init__(message)
        self.message = message
        self.start = start
        self.end = end
        self.expected = expected
        self.hint = hint

    def error(self, source: Source, offset: int = 0) -> ScriptError:
        """The same as an error with a place."""
        place = source.place(offset + self.start, offset + self.end)
        return ScriptError(self.message, place=place, expected=self.expected, hint=self.hint)


CLOSES_NOTHING = (
    "this ) closes nothing", "as many ( as )", "remove it, or add the ( that belongs to it"
)  # fmt: skip
_PUNCTUATION = re.compile(
    r'"[^"\n]*"|#[^\n]*|(?<!&)&(?=[ \t]*(?:#.*)?(?:\n|\Z))|["()“”„‟«»‘’`\x00-\x08\x0e-\x1f\x7f]'
)


# A comment of C in the line that ends there.
_SLASHES = re.compile(r"(?:^|[ \t)])//[^\n]*\Z", re.MULTILINE)


def check_characters(text: str) -> None:
    """Refuse characters that no part of a script may contain outside quotes and comments.

    Raises
    ------
    Mistake
        At the first of them.
    """
    if text.isascii() and text.isprintable():
        return
    for match in _PUNCTUATION.finditer(text):
        word = match[0]
        if len(word) > 1 or word in '"#()':
            continue
        if word == "&":
            raise Mistake(
                "no & stands at the end of a line",
                *match.span(),
                expected="a statement in one line, or a call over several",
                hint="leave it out; a call may run over several lines inside its parentheses",
            )
        if ord(word) < 32 or word == "\x7f":
            raise Mistake(
                f"a control character (code {ord(word)}) stands here",
                *match.span(),
                expected="a text file",
                hint="delete it; is this really a script?",
            )
        raise Mistake(
            f"typographic quote {word}",
            *match.span(),
            expected='the plain quote "',
            hint="such quotes come from word processors and web pages; type them anew",
        )


def in_script(text: str) -> Mistake:
    """Find the mistake in the quotes or parentheses of a script."""
    opened: list[int] = []
    for match in _PUNCTUATION.finditer(text):
        word, start = match[0], match.start()
        if word == '"':
            return open_quote(text, start)
        if word == "(":
            opened.append(start)
        elif word == ")":
            if not opened:
                message, *advice = CLOSES_NOTHING
                return Mistake(message, start, start + 1, *advice)
            opened.pop()
    if opened:
        return open_parenthesis(text, opened[0])
    return Mistake("this line cannot be understood", 0, 1, expected="a statement")


def open_quote(text: str, start: int) -> Mistake:
    """The quote that begins at `start` has no end."""
    end = text.find("\n", start)
    return Mistake(
        "this quote is not closed",
        start,
        len(text) if end < 0 else end,
        expected='a second " in the same line',
        hint="comments begin with #" if _SLASHES.search(text, 0, start) else 'add the missing "',
    )


def open_parenthesis(text: str, start: int) -> Mistake:
    """The parenthesis at `start` is not closed."""
    before = re.search(r"[^\W\d]\w*[ \t]*$", text[:start])
    begin = before.start() if before else start
    what = f"the call of {before[0].rstrip()}" if before else "this parenthesis"
    return Mistake(
        f"{what} is not closed: a ) is missing",
        begin,
        start + 1,
        expected="as many ) as (",
        hint="add the missing )",
    )
