"""Script arguments: text that is evaluated on request."""

from __future__ import annotations

import re
from collections.abc import Sequence
from copy import copy
from typing import Any

from karamelo_py.language.scene import Scene
from karamelo_py.script.errors import Mark, ScriptError, blaming, meant, one_of
from karamelo_py.script.expressions import Expression, Value
from karamelo_py.script.parser import NUMBER, parse_expression
from karamelo_py.script.syntax import Raw

NULL = "NULL"
_NAME = re.compile(r"[^\W\d]\w*")
_QUOTED = re.compile(r'"([^"]*)"')
_GAP = re.compile(r'[\w)"]\s+(["\w.]|[-+][\w.(])|\w;')  # two words separated by a blank or ;
_KEYWORD = re.compile(r"([^\W\d]\w*)\s*=(?!=)")


class Argument:
    """The `text` of an argument without surrounding blanks, and its `mark`."""

    def __init__(self, raw: Raw, interpreter: Any):
        code = raw.code
        start = raw.start + len(code) - len(code.lstrip())
        self._raw = Raw(raw.source, start, start + len(code.strip()))
        self._interpreter = interpreter
        self._numbers: dict[str, Argument] = {}
        self.text = code.strip()
        if "\n" in raw.source.text[self._raw.start : self._raw.end]:
            self.text = re.sub(r"\s+", " ", self.text)

    @property
    def mark(self) -> Mark:
        return self._raw.mark

    @property
    def statement(self) -> Any:
        return self._interpreter.statement

    def __repr__(self) -> str:
        return f"Argument({self.text!r})"

    @property
    def is_null(self) -> bool:
        return self.text == NULL

    def word(self) -> str | None:
        """The argument as a word: bare, quoted, or the text of a variable.

        The word is None if the argument is arithmetic.

        ``neo-hookean`` or ``dump.*.gz`` are words if no part of them is the name of a value.
        """
        quoted = _QUOTED.fullmatch(self.text)
        if quoted:
            return quoted[1]
        if _NAME.fullmatch(self.text):
            variable = self._interpreter.variables.get(self.text)
            return variable if isinstance(variable, str) else self.text
        if not self.text or re.search(r'[\s()",=<>]', self.text) or NUMBER.fullmatch(self.text):
            return None
        names = _NAME.findall(self.text)
        meaningful = not names or any(self._interpreter.knows(name) for name in names)
        return None if meaningful else self.text

    def refuse_name(self) -> None:
        if named := self.keyword():
            raise ScriptError("no name", mark=self.mark, code="by-position", name=named[0])

    def words(self, literals: Sequence[str] = ()) -> str:
        self.refuse_name()
        if self.text in literals:
            return self.text
        quoted = _QUOTED.fullmatch(self.text)
        if quoted:
            return quoted[1]
        text = '"' in self.text
        value = self.value(None) if text else self._interpreter.variables.get(self.text)
        if isinstance(value, str):
            return value
        if text:
            raise ScriptError(f"{self.text} is not a text", mark=self.mark)
        if re.search(r"\s", self.text):
            first, second = self.text.split()[:2]
            message = f"'{self.text}' is more than one word"
            hint = f'is a comma missing: "{first}, {second}"? A name with blanks needs quotes'
            raise ScriptError(message, mark=self.mark, hint=hint)
        return self.text

    def value(self, hub: Scene | None) -> Value:
        if self.is_null:
            message, expected = "NULL cannot be used here", "a number or a formula"
            raise ScriptError(message, mark=self.mark, expected=expected)
        self.refuse_name()
        return self._interpreter.evaluate(parse_expression(self._raw), self._raw)

    def take(self, numbers: dict[str, Argument]) -> list[str]:
        """Store the `numbers` of the call; return the names that the formula does not use."""
        self._numbers = numbers
        return [name for name in numbers if name not in _NAME.findall(self.text)]

    def value_with(self, seeds: Sequence[str]) -> Value:
        """Return the value of a formula of `seeds`, quoted or not, with the numbers of its call."""
        if _QUOTED.fullmatch(self.text):
            inside = self._from(self._raw.start + 1, self._raw.end - 1)
            inside.take(self._numbers)
            return inside.value_with(seeds)
        interpreter = self._interpreter
        script = copy(interpreter)
        numbers = {}
        for name, argument in self._numbers.items():
            numbers[name] = argument.value(None)
            if name in seeds or not isinstance(numbers[name], float):
                message = f"{name} = {argument.text} is not a number"
                if name in seeds:
                    message = f"{name} is a variable of the formula"
                raise ScriptError(message, mark=argument.mark, expected="another name for it")
        script.variables = interpreter.variables | numbers
        script.variables |= {name: Expression.seed(name) for name in seeds}
        try:
            return script.evaluate(parse_expression(self._raw), self._raw)
        except ScriptError as error:
            if error.code == "unknown-name":
                name, names = error.name or "", [*self.numbers(), *numbers]
                others = ", ".join(names) or "none so far"
                few = one_of(name, seeds)
                choices = f"{few}, or a number that the script has set ({others})"
                hint = meant(name, [*seeds, *names]) or f"{name}=..., after the formula"
                error.expected, error.hint = choices, hint
            raise

    def behind(self, count: int) -> Argument:
        return self._from(self._raw.start + count)

    def _from(self, start: int, end: int | None = None) -> Argument:
        end = self._raw.end if end is None else end
        return Argument(Raw(self._raw.source, start, end), self._interpreter)

    def listed(self) -> list[Argument]:
        code, parts = self._raw.code, []
        begin, depth = 1, 0
        for k, letter in enumerate(code):
            depth += (letter == "(") - (letter == ")")
            if depth == 0 and k < len(code) - 1:
                return [self]  # e.g. (a + b)*(c + d) is no list
            if depth == (letter != ")") and letter in ",)":
                parts.append(self._from(self._raw.start + begin, self._raw.start + k))
                begin = k + 1
        return parts or [self]

    def numbers(self) -> list[str]:
        variables = self._interpreter.variables.items()
        return [name for name, value in variables if isinstance(value, float)]

    def knows(self, name: str) -> bool:
        return self._interpreter.knows(name)

    def piece(self, text: str) -> Argument:
        start = self._raw.source.text.rindex(text, self._raw.start, self._raw.end)
        return self._from(start, start + len(text))

    def keyword(self) -> tuple[str, Argument] | None:
        match = _KEYWORD.match(self.text)
        if not match:
            return None
        return match[1], self._from(self._raw.source.text.index("=", self._raw.start) + 1)


def with_gap(arguments: Sequence[Argument]) -> Argument | None:
    return next((argument for argument in arguments if _GAP.search(argument.text)), None)


class Named:
    """Base of parts of a scene to which scripts refer by an ID."""

    id: str = ""
    mark: Mark | None = None
    catalogue = ""

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        return look_up(getattr(hub, cls.catalogue), argument)


def look_up(catalogue: Any, argument: Argument):
    argument.refuse_name()
    word = argument.word()
    if word is None:
        article = "an" if catalogue.kind[0] in "aeiou" else "a"
        message = f"'{argument.text}' is not the ID of {article} {catalogue.kind}"
        expected = one_of("", catalogue) if catalogue else None
        raise ScriptError(message, mark=argument.mark, expected=expected)
    with blaming(argument.mark):
        return catalogue[word]
