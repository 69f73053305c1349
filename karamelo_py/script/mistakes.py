"""Syntax errors in a user's words.

Lark tells where it stopped and which tokens it would have liked; what the user did is found by
looking at the text around that place.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from karamelo_py.script.elsewhere import instead
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


@contextmanager
def explained(explain: Callable[[int], Mistake]) -> Iterator[None]:
    """Turn what Lark raises into what `explain` makes of the offset where it stopped."""
    from lark.exceptions import UnexpectedCharacters, UnexpectedInput, VisitError

    try:
        yield
    except UnexpectedCharacters as error:
        raise explain(error.pos_in_stream) from None
    except UnexpectedInput as error:
        token = getattr(error, "token", None)
        at_end = token is None or token.type == "$END" or token.start_pos is None
        raise explain(-1 if at_end else token.start_pos) from None
    except VisitError as error:
        raise error.orig_exc from None


# ---- the script: quotes and parentheses ---------------------------------------------------------

_PUNCTUATION = re.compile(r'"[^"\n]*"|#[^\n]*|["()“”„‟«»‘’`\x00-\x08\x0e-\x1f\x7f]')


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


def in_script(text: str, _: int) -> Mistake:
    """What is wrong with the quotes or parentheses of a script."""
    opened: list[int] = []
    for match in _PUNCTUATION.finditer(text):
        word, start = match[0], match.start()
        if word == '"':
            return _open_quote(text, start)
        if word == "(":
            opened.append(start)
        elif word == ")":
            if not opened:
                return Mistake(
                    "this ) closes nothing",
                    start,
                    start + 1,
                    expected="as many ( as )",
                    hint="remove it, or add the ( that belongs to it",
                )
            opened.pop()
    if opened:
        return _open_parenthesis(text, opened[0])
    return Mistake("this line cannot be understood", 0, 1, expected="a statement")


def _open_quote(text: str, start: int) -> Mistake:
    end = text.find("\n", start)
    return Mistake(
        "this quote is not closed",
        start,
        len(text) if end < 0 else end,
        expected='a second " in the same line',
        hint='add the missing "',
    )


def _open_parenthesis(text: str, start: int) -> Mistake:
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


# ---- an expression ------------------------------------------------------------------------------

_TOKEN = re.compile(
    r"""(?P<number>(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)
      | (?P<operator>\*\*|&&|\|\||<=|>=|==|!=|[-+*/%^<>!]|(?:and|or|not)\b)
      | (?P<name>[^\W\d]\w*)
      | (?P<text>"[^"\n]*")
      | (?P<mark>[(),=])
      | (?P<space>\s+)
      | (?P<other>.)""",
    re.VERBOSE | re.DOTALL,
)

_REMEDIES = {
    ";": "one statement per line, without ;",
    "&": "write && or and",
    "|": "write || or or",
    "[": "use parentheses ( )",
    "]": "use parentheses ( )",
    "{": "use parentheses ( )",
    "}": "use parentheses ( )",
    "'": 'text stands in double quotes: "..."',
    "$": "a variable is written by its name alone, without $",
    "@": "a name consists of letters, digits and _",
    "\\": "a call may run over several lines inside its parentheses; no \\ is needed",
    ":": "assign with name = expression",
    "?": "write if(condition, a, b)",
    "~": "negate a condition with !",
    "−": "this is a typographic minus; type -",
    "–": "this is a dash; type -",
    "—": "this is a dash; type -",
    "×": "multiply with *",
    "·": "multiply with *",
    "÷": "divide with /",
    "²": "write ^2",
    "³": "write ^3",
    ".": "a number has a digit next to its point; a file name or other word stands in quotes here",
}

_VALUE = "a number, a name or a parenthesis"


class _Token(NamedTuple):
    kind: str
    text: str
    start: int
    end: int

    @property
    def is_value_start(self) -> bool:
        return self.kind in ("number", "name", "text") or self.text == "("

    @property
    def is_value_end(self) -> bool:
        return self.kind in ("number", "name", "text") or self.text == ")"


def in_expression(code: str, position: int) -> Mistake:
    """What is wrong with `code`, at whose `position` (-1: end) the parser stopped."""
    tokens = [
        _Token(m.lastgroup or "", m[0], *m.span())
        for m in _TOKEN.finditer(code)
        if m.lastgroup != "space"
    ]
    odd = next((token for token in tokens if token.kind == "other"), None)
    if odd and odd.text == '"':
        return _open_quote(code, odd.start)
    if odd and (position < 0 or odd.start <= position or odd.text in "&|"):
        return Mistake(
            f"'{odd.text}' means nothing in an expression",
            odd.start,
            odd.end,
            expected="numbers, names, operators and parentheses",
            hint=_REMEDIES.get(odd.text),
        )
    if position < 0:
        position = len(code)
    index = next((k for k, token in enumerate(tokens) if token.start >= position), len(tokens))
    before = tokens[index - 1] if index else None
    here = tokens[index] if index < len(tokens) else None
    opened = _opened(tokens[:index])
    if here is None:
        return _at_end(code, before, opened)
    if here.text == "=":
        return _equals(code, tokens, index)
    if here.text == ",":
        return _comma(code, tokens, index, opened)
    if here.text == ")":
        return _closing(here, before, opened)
    if before is not None and before.is_value_end and here.is_value_start:
        return _side_by_side(code, tokens, index)
    if here.kind == "operator":
        if before is not None and before.kind == "operator":
            message = f"operator '{here.text}' follows operator '{before.text}'"
        elif before is not None and before.is_value_end:
            message = f"'{here.text}' cannot stand between two values"
        else:
            message = f"operator '{here.text}' has nothing on its left"
        hint = "put it in parentheses" if here.text in ("!", "not") else None
        return Mistake(message, here.start, here.end, expected=_VALUE, hint=hint)
    return Mistake(f"'{here.text}' cannot stand here", here.start, here.end, expected=_VALUE)


def _opened(tokens: list[_Token]) -> list[tuple[_Token, bool]]:
    """Parentheses that are open after `tokens`, and whether each belongs to a call."""
    opened: list[tuple[_Token, bool]] = []
    for k, token in enumerate(tokens):
        if token.text == "(":
            opened.append((token, k > 0 and tokens[k - 1].kind == "name"))
        elif token.text == ")" and opened:
            opened.pop()
    return opened


def _at_end(code: str, before: _Token | None, opened: list) -> Mistake:
    if before is None:
        return Mistake("there is nothing here", 0, len(code), expected="an expression")
    if before.kind == "operator":
        return Mistake(
            f"the expression ends after '{before.text}'",
            before.start,
            before.end,
            expected=f"{_VALUE} after '{before.text}'",
        )
    if opened:
        return _open_parenthesis(code, opened[0][0].start)
    return Mistake("the expression ends too early", before.start, before.end, expected=_VALUE)


def _equals(code: str, tokens: list[_Token], index: int) -> Mistake:
    here = tokens[index]
    before = tokens[index - 1] if index else None
    expected = "name = expression, once in a line; == compares"
    if before is None:
        return Mistake("'=' has no name on its left", here.start, here.end, expected=expected)
    first = tokens[0]
    if index == 2 and before.kind == "operator" and first.kind == "name":
        rest = code[here.end :].strip()
        return Mistake(
            f"'{before.text}=' is not known here",
            before.start,
            here.end,
            expected=expected,
            hint=f"{first.text} = {first.text} {before.text} {rest}",
        )
    if first.kind == "name" and len(tokens) > 1 and tokens[1].text == "(" and before.text == ")":
        return Mistake(
            "only a name can stand left of '='",
            first.start,
            before.end,
            expected=expected,
            hint=f"a formula needs no arguments: {first.text} = {code[here.end :].strip()}",
        )
    if all(token.text != "=" for token in tokens[:index]) and first.start < here.start:
        hint = "compare with ==" if _opened(tokens[:index]) else None
        if all(token.kind in ("name", "number", "operator") for token in tokens[:index]):
            hint = "a name begins with a letter and has letters, digits and _ only"
        return Mistake("'=' cannot stand here", here.start, here.end, expected=expected, hint=hint)
    return Mistake("a second '='", here.start, here.end, expected=expected)


def _comma(code: str, tokens: list[_Token], index: int, opened: list) -> Mistake:
    here = tokens[index]
    before = tokens[index - 1] if index else None
    after = tokens[index + 1] if index + 1 < len(tokens) else None
    if before is None or before.text in "(," or before.kind == "operator":
        return Mistake(
            "something is missing before this comma", here.start, here.end, expected=_VALUE
        )
    hint = None
    digits = before.kind == "number" and after is not None and after.kind == "number"
    if digits and after is not None:
        hint = f"write decimals with a point: {before.text}.{after.text}"
    return Mistake(
        "a comma separates the arguments of a call; there is no call here",
        here.start,
        here.end,
        expected="an operator or the end of the expression",
        hint=hint,
    )


def _closing(here: _Token, before: _Token | None, opened: list) -> Mistake:
    if not opened:
        return Mistake(
            "this ) closes nothing",
            here.start,
            here.end,
            expected="as many ( as )",
            hint="remove it, or add the ( that belongs to it",
        )
    if before is not None and before.text == "(":
        return Mistake(
            "there is nothing in these parentheses", before.start, here.end, expected=_VALUE
        )
    after = f" after '{before.text}'" if before else ""
    return Mistake(f"something is missing{after}", here.start, here.end, expected=_VALUE)


def _side_by_side(code: str, tokens: list[_Token], index: int) -> Mistake:
    before, here = tokens[index - 1], tokens[index]
    touching = before.end == here.start
    start, end = before.start, here.end
    if before.kind == "number" and touching and here.kind == "number":
        number = re.match(r"[\d.]+(?:[eE][+-]?\d+)?", code[start:])
        end = start + number.end() if number else end
        return Mistake(
            f"'{code[start:end]}' is not a number",
            start,
            end,
            expected="a number has one point at most",
        )
    if before.kind == "number" and touching and here.kind == "name":
        if re.fullmatch(r"[eEdD]\d*", here.text):
            good = re.fullmatch(r"[dD](\d+)", here.text)
            after = code[end : end + 1] if here.text in ("e", "E", "d", "D") else ""
            end += len(after) if after in ("+", "-") else 0
            return Mistake(
                f"'{code[start:end]}' is not a number",
                start,
                end,
                expected="an exponent as in 1e-5",
                hint=f"{before.text}e{good[1]}" if good else None,
            )
        return Mistake(
            f"an operator is missing between '{before.text}' and '{here.text}'",
            start,
            end,
            expected="an operator, such as *",
            hint=f"{before.text}*{here.text}; a name cannot start with a digit",
        )
    if index == 1 and before.kind == "name":
        rest = code[here.start :].strip().rstrip(",")
        words = [word.strip(",") for word in rest.split()]
        return Mistake(
            f"'{here.text}' follows '{before.text}' without an operator",
            here.start,
            here.end,
            expected="name = expression, or command(arguments)",
            hint=_block_or_call(before.text, words),
        )
    two_statements = _is_call(tokens[:index]) and here.kind == "name"
    hint = "multiply with *; two statements stand on two lines" if two_statements else None
    if two_statements and tokens[0].text in _BLOCKS:
        hint = _NO_BLOCKS
    elif before.kind == "number" and here.kind == "name" and index == len(tokens) - 1:
        hint = "numbers stand without units"
    what = f"'{_short(before)}' and '{_short(here)}'"
    return Mistake(
        f"an operator is missing between {what}",
        here.start,
        here.end,
        expected="an operator, such as *, or a comma between arguments",
        hint=hint,
    )


def _is_call(tokens: list[_Token]) -> bool:
    """Whether `tokens` are one call from end to end."""
    if len(tokens) < 3 or tokens[0].kind != "name" or tokens[1].text != "(":
        return False
    return bool(_opened(tokens[:-1])) and not _opened(tokens)


_BLOCKS = ("for", "while", "if", "else", "elif", "def", "do", "import", "loop", "next", "jump")
_NO_BLOCKS = "there are no loops and blocks; if(condition, a, b) chooses a value"


def _block_or_call(name: str, words: list[str]) -> str:
    """What to write instead of ``name word word``."""
    if name in _BLOCKS:
        return _NO_BLOCKS
    if other := instead("command", name):
        return other
    if all(re.fullmatch(r"[\w.*/+-]+|\"[^\"]*\"", word) for word in words):
        return f"arguments go in parentheses: {name}({', '.join(words)})"
    return f"arguments go in parentheses: {name}(...)"


def _short(token: _Token) -> str:
    return token.text if len(token.text) < 30 else token.text[:27] + "..."
