"""Argument lists that depend on the dimension."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from karamelo_py.language.arguments import with_gap
from karamelo_py.language.scene import Scene
from karamelo_py.language.unknown import size_of_cells, words_of
from karamelo_py.script.errors import ScriptError, meant, plural
from karamelo_py.script.expressions import Expression

_HUGE = 1e20  # Karamelo's value of INF


class Forms:
    """The forms of an argument list, one for each dimension.

    `pattern` is a call that contains ``{names}`` and perhaps ``{dimension}``. `names` maps a
    dimension to names of arguments. Some arguments may be `words`. INF and EDGE mean the
    `open_ends` (-inf, inf).
    """

    def __init__(
        self,
        pattern: str,
        names: Mapping[int, Sequence[str]],
        *,
        words: Mapping[str, Sequence[str]] | None = None,
        open_ends: Mapping[str, float] | None = None,
    ):
        self.pattern = pattern
        self.names = names
        self.words = words or {}
        self.open_ends = open_ends or {}

    def line(self, dimension: int) -> str:
        names = ", ".join(self.names[dimension])
        return self.pattern.format(dimension=dimension, names=names)

    def read(self, hub: Scene, arguments: Sequence[Any], dimension: int) -> dict[str, float | str]:
        if dimension not in self.names:
            dimensions = " or ".join(map(str, sorted(self.names)))
            expected = f"a domain with {dimensions} dimensions"
            raise ScriptError(f"there is no form for {dimension}D", expected=expected)
        names = self.names[dimension]
        if len(arguments) != len(names):
            self._refuse_count(hub, arguments, dimension)
        return {
            name: self._convert(hub, argument, name, dimension)
            for name, argument in zip(names, arguments, strict=True)
        }

    def _refuse_count(self, hub: Scene, arguments: Sequence[Any], dimension: int) -> None:
        names = self.names[dimension]
        got = len(arguments)
        missing = names[got:]
        are = "is" if len(missing) == 1 else "are"
        message = f"{', '.join(missing)} {are} missing in {dimension}D"
        if not missing:
            message = f"{plural(got - len(names), 'argument')} too many in {dimension}D"
        gap = with_gap(arguments)
        fitting = [d for d, names in self.names.items() if len(names) == got and d != dimension]
        hint = self._own_line(hub, arguments, dimension) if got else None
        if fitting and got:
            verb = "is" if got == 1 else "are"
            other = f"{plural(got, 'argument')} {verb} the form for {fitting[0]}D"
            longer = self.names[fitting[0]]
            if not missing and set(names) <= set(longer):
                pairs = zip(longer, arguments, strict=True)
                kept = [argument for name, argument in pairs if name in names]
                hint = self._own_line(hub, kept, dimension)
            hint = other if missing else f"{other}; here {hint}"
        mark = gap.mark if gap else None if missing else arguments[len(names)].mark
        hint = f"is a comma missing in '{gap.text}'?" if gap else hint
        line = self.line(dimension)
        more = max(got - len(names), 0)
        raise ScriptError(
            message, mark=mark, expected=line, hint=hint, code="arguments", surplus=more
        )

    def _own_line(self, hub: Scene, arguments: Sequence[Any], dimension: int) -> str:
        names = self.names[dimension]
        words = [argument.text for argument in arguments][: len(names)]
        line = re.sub(r"\[.*?\]", "", self.pattern)
        further = list(names[len(words) :])
        size, below = size_of_cells(hub.interpreter) if further == ["h"] else ("", None)
        further = [size] if size else further
        line = line.format(dimension=dimension, names=", ".join([*words, *further]))
        line += f", after line {below}, which sets {size}" if below else ""
        ID = (words_of(arguments[0].statement) or ["ID"])[0]
        return line.replace("(ID,", f"({ID},")

    def _convert(self, hub: Scene, argument: Any, name: str, dimension: int) -> float | str:
        if name in self.words:
            return self._word(argument, name, dimension)
        end = self.open_ends.get(name)
        if end is not None:
            text = (argument.word() or argument.text).replace(" ", "")
            if text in ("INF", "EDGE"):
                return end
            if text in ("+INF", "-INF"):
                if (text == "-INF") == (end < 0):
                    return end
                raise ScriptError(f"{name} cannot be {text}", mark=argument.mark, expected="INF")
        value = number(hub, argument, name, expected=self.line(dimension))
        if end is not None and abs(value) >= _HUGE and (value < 0) == (end < 0):
            return end
        return value

    def _word(self, argument: Any, name: str, dimension: int) -> str:
        word, choices = argument.word(), self.words[name]
        if word in choices:
            return word
        message, hint = f"{name} must be one of {', '.join(choices)}", meant(word or "", choices)
        line, mark = self.line(dimension), argument.mark
        raise ScriptError(message, mark=mark, expected=line, hint=hint, code="argument")


def number(hub: Scene, argument: Any, name: str, expected: str | None = None) -> float:
    """Return a finite constant. In a rehearsal, the result of a run is NaN."""
    value = argument.value(hub)
    if isinstance(value, float):
        return finite(hub, value, name, argument)
    wanted, hint = f"a number, not the text '{value}'", None
    if isinstance(value, Expression):
        wanted = "a constant number, not a formula"
        hint = f"value({argument.text}) is its present value"
    message, mark = f"{name} must be {wanted}", argument.mark
    raise ScriptError(message, mark=mark, expected=expected, hint=hint)


def finite(hub: Scene, value: float, name: str, argument: Any | None = None) -> float:
    if math.isfinite(value) or (math.isnan(value) and hub.rehearsing):
        return value
    message = f"{name} must be a finite number, not {value}"
    mark = argument.mark if argument is not None else None
    raise ScriptError(message, mark=mark, argument=None if argument is not None else name)
