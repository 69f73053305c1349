"""Arguments as a script has them: text first, evaluated only when a value is asked for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from karamelo_py.language.scene import Scene
from karamelo_py.script.errors import Place, ScriptError, meant
from karamelo_py.script.evaluation import evaluate
from karamelo_py.script.expressions import Expression, Value
from karamelo_py.script.parser import parse_expression
from karamelo_py.script.syntax import Raw

NULL = "NULL"
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_NAME = re.compile(r"[^\W\d]\w*")
_QUOTED = re.compile(r'"([^"]*)"')
_GAP = re.compile(r'[\w)"]\s+["\w.]')  # two words with nothing but blanks between them
_KEYWORD = re.compile(r"([^\W\d]\w*)\s*=(?!=)")


class Argument:
    """One argument of a call as the script has it, not evaluated.

    Attributes
    ----------
    text : str
        What is written, without blanks around it.
    place : Place
        Where it stands.
    """

    def __init__(self, raw: Raw, interpreter: Any):
        code = raw.code
        start = raw.start + len(code) - len(code.lstrip())
        self._raw = Raw(raw.source, start, start + len(code.strip()))
        self._interpreter = interpreter
        self.text = code.strip()
        if "\n" in raw.source.text[self._raw.start : self._raw.end]:
            self.text = re.sub(r"\s+", " ", self.text)

    @property
    def place(self) -> Place:
        return self._raw.place

    @property
    def statement(self) -> Any:
        """The statement that the script is at."""
        return self._interpreter.statement

    def __repr__(self) -> str:
        return f"Argument({self.text!r})"

    @property
    def is_null(self) -> bool:
        """Tell if it is the word NULL."""
        return self.text == NULL

    def word(self) -> str | None:
        """The word it is: bare, in quotes, or the content of a text variable; None for arithmetic.

        Words such as ``neo-hookean`` or ``dump.*.gz`` count unless a name in them is known, which
        makes them arithmetic.
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
        known = not names or any(self._interpreter.knows(name) for name in names)
        return None if known else self.text

    def words(self, known: Sequence[str] = ()) -> str:
        """The text it stands for where only a word will do, arithmetic or not.

        Raises
        ------
        ScriptError
            If it cannot be meant as a word.
        """
        if self.text in known:
            return self.text
        quoted = _QUOTED.fullmatch(self.text)
        if quoted:
            return quoted[1]
        if '"' in self.text:
            value = self.value(None)
            if isinstance(value, str):
                return value
            raise ScriptError(f"{self.text} is not a text", place=self.place)
        variable = self._interpreter.variables.get(self.text)
        if isinstance(variable, str):
            return variable
        if re.search(r"\s", self.text):
            first, second = self.text.split()[:2]
            raise ScriptError(
                f"'{self.text}' is more than one word",
                place=self.place,
                hint=f'is a comma missing: "{first}, {second}"? A name with blanks needs quotes',
            )
        return self.text

    def value(self, hub: Scene | None) -> Value:
        """The number, text or formula it stands for.

        Raises
        ------
        ScriptError
            With the place of what is wrong inside the argument.
        """
        if self.is_null:
            raise ScriptError(
                "NULL cannot be used here", place=self.place, expected="a number or a formula"
            )
        return self._interpreter.evaluate(parse_expression(self._raw), self._raw)

    def value_with(self, seeds: Sequence[str]) -> Value:
        """The same, where the names `seeds` stand for what a formula is of, whatever they are else.

        Raises
        ------
        ScriptError
            With the place of what is wrong inside the argument.
        """
        return evaluate(parse_expression(self._raw), self._raw, _Seeds(self._interpreter, seeds))

    def behind(self, count: int) -> Argument:
        """Cut off the first `count` characters."""
        return Argument(
            Raw(self._raw.source, self._raw.start + count, self._raw.end), self._interpreter
        )

    def knows(self, name: str) -> bool:
        """Tell if a name means something where the argument stands."""
        return self._interpreter.knows(name)

    def part(self, text: str) -> Argument:
        """The last place of `text` in it, as an argument of its own."""
        source = self._raw.source
        start = source.text.rindex(text, self._raw.start, self._raw.end)
        return Argument(Raw(source, start, start + len(text)), self._interpreter)

    def keyword(self) -> tuple[str, Argument] | None:
        """Name and value if it is written ``name = value``."""
        match = _KEYWORD.match(self.text)
        if not match:
            return None
        start = self._raw.source.text.index("=", self._raw.start) + 1
        return match[1], Argument(Raw(self._raw.source, start, self._raw.end), self._interpreter)


class _Seeds:
    """A scope in which some names are seeds of formulas."""

    def __init__(self, outer: Any, seeds: Sequence[str]):
        self.outer = outer
        self.seeds = seeds

    def name(self, name: str, node: Any, raw: Raw) -> Value:
        """Find the value of a name; the error of an unknown one lists those that are known here."""
        if name in self.seeds:
            return Expression.seed(name)
        try:
            return self.outer.name(name, node, raw)
        except ScriptError as error:
            if error.message.startswith("unknown name"):
                variables = self.outer.variables.items()
                numbers = [n for n, value in variables if isinstance(value, float)]
                others = ", ".join(numbers) or "none so far"
                own = ", ".join(self.seeds)
                error.expected = f"{own}, or a number that the script has set ({others})"
                error.hint = meant(name, [*self.seeds, *numbers]) or f"set it first: {name} = ..."
            raise

    def command(self, node: Any, raw: Raw) -> Value:
        """The value of a call that is not a function."""
        return self.outer.command(node, raw)

    def hides(self, name: str) -> bool:
        """Tell if the script uses the name of a function for something else."""
        return self.outer.hides(name)


def with_gap(arguments: Sequence[Argument]) -> Argument | None:
    """The first argument that may be two, with a comma forgotten between them."""
    return next((argument for argument in arguments if _GAP.search(argument.text)), None)


def look_up(catalogue: Any, argument: Argument):
    """The part of the scene that `argument` names.

    Raises
    ------
    ScriptError
        When it is not a name, or an unknown one.
    """
    word = argument.word()
    if word is None:
        article = "an" if catalogue.kind[0] in "aeiou" else "a"
        raise ScriptError(
            f"'{argument.text}' is not the ID of {article} {catalogue.kind}", place=argument.place
        )
    try:
        return catalogue[word]
    except ScriptError as error:
        if error.place is None:
            error.place = argument.place
        raise
