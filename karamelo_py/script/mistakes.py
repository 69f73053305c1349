"""Explain syntax errors.

Lark's parser gets the tokens one by one, so that the token at which it stops is known.
"""

import re
from typing import Any, NamedTuple

from karamelo_py.script.errors import instead, table
from karamelo_py.script.syntax import Mistake

CLOSES_NOTHING = (
    "this ) closes nothing", "as many ( as )", "remove it, or add the ( that belongs to it"
)  # fmt: skip
_PUNCTUATION = re.compile(
    r'"[^"\n]*"|#[^\n]*|(?<!&)&(?=[ \t]*(?:#.*)?(?:\n|\Z))|["()“”„‟«»‘’`\x00-\x08\x0e-\x1f\x7f]'
)
# Finds a C++ comment at the end of the text.
_SLASHES = re.compile(r"(?:^|[ \t)])//[^\n]*\Z", re.MULTILINE)
# Matches the beginning of an Abaqus file: empty lines, comments, a keyword.
_KEYWORD = re.compile(r"(?:\s|\*\*.*\n)*(\*[A-Za-z]+)")
_DYNA = re.compile(r"(?:\s|\$.*\n)*(\*KEYWORD)", re.IGNORECASE)


def check_characters(text: str) -> None:
    first = _KEYWORD.match(text)
    if first and first[1].lower() in table()["abaqus"].split():
        hint = "docs/howto/from-abaqus.md gives the equivalents here; solid mesh reads its mesh"
        raise Mistake("this is an input file of Abaqus", *first.span(1), "a script", hint)
    if first := _DYNA.match(text):
        hint = (
            "rewrite the scene, as docs/getting-started.md says; solid mesh reads its mesh once "
            "it is saved as .inp (Abaqus), .bdf (Nastran), .stl or .vtk"
        )
        raise Mistake("this is an input file of LS-DYNA", *first.span(1), "a script", hint)
    for match in _PUNCTUATION.finditer(text):
        word = match[0]
        if len(word) > 1 or word in '"#()':
            continue
        if word == "&":
            message = "lines do not end in &"
            expected = "a statement in one line, or a call over several"
            hint = "leave it out; a call may run over several lines inside its parentheses"
        elif ord(word) < 32 or word == "\x7f":
            message = f"a control character (code {ord(word)})"
            expected, hint = "a text file", "delete it; is this really a script?"
        else:
            message, expected = f"typographic quote {word}", 'the plain quote "'
            hint = "such quotes come from word processors and web pages; type them again"
        raise Mistake(message, *match.span(), expected, hint)


def in_script(text: str) -> Mistake:
    opened: list[int] = []
    for match in _PUNCTUATION.finditer(text):
        word, start = match[0], match.start()
        if word == '"':
            return open_quote(text, start)
        if word == "(":
            opened.append(start)
        elif word == ")" and not opened:
            message, *advice = CLOSES_NOTHING
            return Mistake(message, start, start + 1, *advice)
        elif word == ")":
            opened.pop()
    if opened:
        return open_parenthesis(text, opened[0])
    return Mistake("this line cannot be understood", 0, 1, expected="a statement")


def open_quote(text: str, start: int) -> Mistake:
    end = text.find("\n", start)
    hint = "comments begin with #" if _SLASHES.search(text, 0, start) else 'add the missing "'
    end = len(text) if end < 0 else end
    return Mistake("this quote is not closed", start, end, 'a second " in the same line', hint)


def open_parenthesis(text: str, start: int) -> Mistake:
    before = re.search(r"[^\W\d]\w*[ \t]*$", text[:start])
    begin = before.start() if before else start
    opened = f"the call of {before[0].rstrip()}" if before else "this parenthesis"
    message = f"{opened} is not closed: a ) is missing"
    return Mistake(message, begin, start + 1, "as many ) as (", "add the missing )")


_VALUE = "a number, a name or a parenthesis"
_OPERATORS = ("OR", "AND", "NOT", "COMPARISON", "SIGN", "TIMES", "POWER")
_STARTS = ("NUMBER", "NAME", "STRING", "LPAR")
_ENDS = ("NUMBER", "NAME", "STRING", "RPAR")


def _type(symbol: Any) -> str:
    from lark import Token

    return symbol.type if isinstance(symbol, Token) else ""


class _Stop(NamedTuple):
    """Tokens before and at the point where the parser stops.

    `here` is the character or token at this point, or None at the end of the text.
    """

    code: str
    before: list
    here: Any
    start: int
    stack: list

    @property
    def end(self) -> int:
        return self.start + len(self.here)

    @property
    def last(self) -> Any:
        return self.before[-1] if self.before else None

    @property
    def kind(self) -> str:
        return _type(self.here)

    @property
    def opened(self) -> list[int]:
        return [t.start_pos for t in self.stack if _type(t) == "LPAR"]

    @property
    def after_call(self) -> bool:
        types = [_type(symbol) for symbol in self.stack]
        return types[:2] == ["NAME", "LPAR"] and types[-1] == "RPAR" and types.count("LPAR") == 1

    def mistake(self, message: str, expected: str = _VALUE, hint: str | None = None) -> Mistake:
        return Mistake(message, self.start, self.end, expected, hint)


def _stop(parser: Any, code: str) -> _Stop:
    from lark.exceptions import UnexpectedCharacters, UnexpectedToken

    interactive = parser.parse_interactive(code)
    state, before = interactive.parser_state, []
    here, start = None, len(code)
    try:
        for token in interactive.lexer_thread.lex(state):
            interactive.feed_token(token)
            before.append(token)
    except UnexpectedCharacters as error:
        start = error.pos_in_stream or 0
        here = code[start]
    except UnexpectedToken as error:
        here, start = error.token, error.token.start_pos
    return _Stop(code, before, here, start, list(state.value_stack))


def in_expression(parser: Any, code: str) -> Mistake:
    at = _stop(parser, code)
    if at.here is None:
        return _at_end(at)
    if at.here == "=":
        return _equals(at)
    if at.here == '"':
        return open_quote(code, at.start)
    if not at.kind:
        return at.mistake(
            f"'{at.here}' means nothing in an expression",
            "numbers, names, operators and parentheses",
            table()["signs"].get(at.here),
        )
    if at.here == ",":
        return _comma(at)
    if at.here == ")":
        return _closing(at)
    before = at.last
    if before and before.type in _ENDS and at.kind in _STARTS:
        return _side_by_side(at)
    if at.kind not in _OPERATORS:
        return at.mistake(f"unexpected '{at.here}'")
    for start in (at.start - 1, at.start):
        if code[max(start, 0) : start + 2] in ("//", "/*"):
            message = f"'{code[start : start + 2]}' begins no comment"
            return Mistake(message, start, start + 2, _VALUE, "comments begin with #")
    hint = "put it in parentheses" if at.kind == "NOT" else None
    if before and before.type in _OPERATORS:
        return at.mistake(f"operator '{at.here}' follows operator '{before}'", hint=hint)
    if before and before.type in _ENDS:
        return at.mistake(f"'{at.here}' does not join two values", hint=hint)
    return at.mistake(f"operator '{at.here}' has nothing on its left", hint=hint)


def _at_end(at: _Stop) -> Mistake:
    before = at.last
    if before is None:
        return Mistake("there is nothing here", 0, len(at.code), expected="an expression")
    span = before.start_pos, before.end_pos
    if before.type in _OPERATORS:
        message = f"the expression ends after '{before}'"
        hint = "per cent as a fraction: 30 % is 0.3" if before == "%" else None
        return Mistake(message, *span, f"{_VALUE} after '{before}'", hint)
    if at.opened:
        return open_parenthesis(at.code, at.opened[0])
    return Mistake("the expression ends too early", *span, expected=_VALUE)


def _equals(at: _Stop) -> Mistake:
    tokens, before = at.before, at.last
    expected = "name = expression, once in a line; == compares"
    if before is None:
        return at.mistake("'=' has no name on its left", expected)
    first, rest = tokens[0], at.code[at.end :].strip()
    if len(tokens) == 2 and before.type in _OPERATORS and first.type == "NAME":
        longer = f"{first} = {first} {before} {rest}"
        return Mistake(f"'{before}=' is not known here", before.start_pos, at.end, expected, longer)
    if first.type == "NAME" and len(tokens) > 1 and tokens[1] == "(" and before == ")":
        formula = f"a formula needs no arguments: {first} = {rest}"
        span = first.start_pos, before.end_pos
        return Mistake("only a name can be left of '='", *span, expected, formula)
    hint = "compare with ==" if at.opened or len(tokens) == 1 else None
    if len(tokens) > 1 and all(token.type in ("NAME", "NUMBER", *_OPERATORS) for token in tokens):
        hint = "a name begins with a letter and has letters, digits and _ only"
    return at.mistake("unexpected '='", expected, hint)


def _comma(at: _Stop) -> Mistake:
    before = at.last
    if before is None or before in ("(", ",") or before.type in _OPERATORS:
        return at.mistake("something is missing before this comma")
    digits = re.match(r"\s*(\d+([eE][+-]?\d+)?)", at.code[at.end :]) if before.isdigit() else None
    return at.mistake(
        "a comma separates the arguments of a call; there is no call here",
        "an operator or the end of the expression",
        f"write decimals with a point: {before}.{digits[1]}" if digits else None,
    )


def _closing(at: _Stop) -> Mistake:
    if not at.opened:
        return at.mistake(*CLOSES_NOTHING)
    if at.last == "(":
        message = "these parentheses are empty"
        return Mistake(message, at.last.start_pos, at.end, expected=_VALUE)
    return at.mistake(f"something is missing after '{at.last}'")


def _side_by_side(at: _Stop) -> Mistake:
    code, before, here = at.code, at.last, at.here
    start, end = before.start_pos, at.end
    touching = before.type == "NUMBER" and before.end_pos == at.start
    if touching and at.kind == "NUMBER":
        number = re.match(r"[\d.]+([eE][+-]?[\d.]+)?", code[start:])
        assert number is not None
        end = start + number.end()
        expected = "a number has one point at most"
        if "." in (number[1] or ""):
            expected = "a whole number after e; for other powers write x^y"
        return Mistake(f"'{code[start:end]}' is not a number", start, end, expected)
    if touching and at.kind == "NAME":
        if re.fullmatch(r"[eEdD]\d*", here):
            good = re.fullmatch(r"[dD](\d+)", here)
            end += len(here) == 1 and code[end : end + 1] in ("+", "-")
            hint = f"{before}e{good[1]}" if good else None
            message = f"'{code[start:end]}' is not a number"
            return Mistake(message, start, end, "an exponent as in 1e-5", hint)
        message = f"an operator is missing between '{before}' and '{here}'"
        hint = f"{before}*{here}; a name cannot start with a digit"
        if re.fullmatch(r"[xX]10", here):
            hint = f"a power of 10 is written {before}e6"
        elif re.fullmatch(r"(_\d+)+", here):
            hint = f"digits are not grouped: {before}{here.replace('_', '')}"
        elif unit := re.fullmatch("([kMG]|m(?=.))?(kg|Pa|N|m|s|J|W|Hz|K)", here):
            factor = {"k": "e3", "M": "e6", "G": "e9", "m": "e-3"}.get(unit[1], "")
            times = "*1" if factor and "e" in before.lower() else ""
            hint = f"numbers have no units: {before}{times}{factor}"
        return Mistake(message, start, end, "an operator, such as *", hint)
    if len(at.before) == 1 and before.type == "NAME":
        words = [word.strip(",") for word in code[at.start :].strip().rstrip(",").split()]
        hint = _block_or_call(before, words)
        if re.match(r"\s*=(?!=)", code[at.end :]):
            hint = f"a name has no blanks: {before}_{here} = ..."
        if here.lower() in ("and", "or", "not"):
            hint = f"write {here.lower()}"
        return at.mistake(
            f"'{here}' follows '{before}' without an operator",
            "name = expression, or command(arguments)",
            hint,
        )
    hint = None
    if at.after_call and at.kind == "NAME":
        hint = "multiply with *; write two statements on two lines"
        hint = NO_BLOCKS if at.before[0] in table()["blocks"] else hint
    elif before.type == "NUMBER" and at.kind == "NAME" and not code[end:].strip():
        hint = "write numbers without units"
    return at.mistake(
        f"an operator is missing between '{_short(before)}' and '{_short(here)}'",
        "an operator, such as *, or a comma between arguments",
        hint,
    )


_NAMED = ("region", "group", "fix", "compute", "dump", "unfix", "uncompute", "undump")
NO_BLOCKS = "a script has no loops, blocks or imports; if(condition, a, b) chooses a value"


def _block_or_call(name: str, words: list[str]) -> str:
    if name in table()["blocks"]:
        return NO_BLOCKS
    if name in _NAMED and words and re.fullmatch(r"\d\w*", words[0]):
        words[0] = f"n{words[0]}"  # the ID is missing
    if other := table()["otherwise"].get(name) or instead("command", name):
        form = re.match(r"(\w+)\(\w+\)", other)
        return f"{form[1]}({words[0]})" if form and len(words) == 1 else other
    if name in ("fix", "compute") and len(words) > 2:
        other = instead(name, words[2]) or ""
        style = other.removeprefix("the style ")
        if other and (style == other or " " in style):
            return other
        if words[1] == "all" or other:  # as LAMMPS writes the group before the style
            words[1:3] = style or words[2], words[1]
    if name == "dump" and len(words) > 2:
        words[2] = (instead(name, words[2]) or words[2]).removeprefix("the style ")
    if name == "group" and words[1:2] == ["region"] and len(words) == 3:  # as in LAMMPS
        words = [words[0], "particles", *words[1:], "all"]
    if all(re.fullmatch(r"[\w.*/+-]+|\"[^\"]*\"", word) for word in words):
        return f"arguments go in parentheses: {name}({', '.join(words)})"
    return f"arguments go in parentheses: {name}(...)"


def _short(text: str) -> str:
    return text if len(text) < 30 else text[:27] + "..."
