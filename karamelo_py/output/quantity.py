"""Quantities of the log and plots."""

import math
import re

from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument
from karamelo_py.script.errors import ScriptError, meant, one_of, unknown
from karamelo_py.script.expressions import POINT_SEEDS, Expression, Value
from karamelo_py.script.syntax import Raw, Source

KEYWORDS = {"step": "Step", "dt": "dt", "time": "Time"}
LIMIT = "limit"
PER_POINT = frozenset(POINT_SEEDS)


class Quantity:
    """A quantity: a word (``dt``), a script variable, a published value (``v_x``) or a formula."""

    script_kind = "a quantity"

    words = False  # True if the text ``limit`` is allowed

    def __init__(self, hub: Scene, name: str, formula: Value | None = None):
        self.hub = hub
        self.name = name
        self.formula = formula
        self._reported_nan = False
        hub.asked.add(name)
        self.is_word = self.words and name == LIMIT and name not in self.names(hub)
        if self.is_word:
            return
        if formula is None and name not in self.names(hub):
            raise unknown(f"unknown quantity '{name}'", name, self.names(hub))
        source = self._source()
        if isinstance(source, Expression) and (per_point := PER_POINT & source.names):
            raise ScriptError(
                f"'{name}' depends on {min(per_point)}, which differs from point to point",
                name=name,
                expected="a formula of time and of values of fixes and computes",
            )

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> "Quantity":
        text = argument.text.strip().strip('"')
        try:
            if text in cls.names(hub) or (cls.words and text == LIMIT):
                return cls(hub, text)
            return cls(hub, text, argument.value(hub))
        except ScriptError as error:
            if error.mark is None:
                error.mark = argument.mark
            if error.code == "unknown-name" and error.name == text:
                error.expected = one_of(text, cls.names(hub))
                if error.alike != "time":
                    names = KEYWORDS if error.alike is None else cls.names(hub)
                    error.hint = meant(text, names) or error.hint
                if text in hub.fields.particle_names():
                    error.hint = (
                        f"{text} differs from point to point: dump(...) writes it, and "
                        f"compute(ID, probe, all, {text}) measures it"
                    )
            raise

    @staticmethod
    def names(hub: Scene) -> list[str]:
        return [*KEYWORDS, *_variables(hub), *hub.values.names()]

    @property
    def heading(self) -> str:
        return KEYWORDS.get(self.name, "".join(self.name.split()))

    def read(self) -> float | int | str:
        """Return the number or word; warn of the first NaN."""
        if self.is_word:
            return self.hub.simulation.ruling_limit
        source = self._source()
        if isinstance(source, Expression):
            number = float(source.evaluate(self.hub.values))
        else:
            number = source
        if math.isnan(number) and not self._reported_nan:
            self._reported_nan = True
            self.hub.warn(
                f"{self.heading} is NaN, which is not a number, from step "
                f"{self.hub.update.step} on",
                hint="causes are a quotient 0/0, or the root of a number below 0",
            )
        return number

    def _source(self) -> float | Expression:
        """Look up the name again, as a script may redefine a variable between runs."""
        variables = _variables(self.hub)
        if self.formula is not None:
            source = self.formula
        elif self.name in KEYWORDS:
            return getattr(self.hub.update, self.name)
        elif self.name in variables:
            source = variables[self.name]
        else:
            return float(self.hub.values.get(self.name))
        if isinstance(source, str):
            raise ScriptError(f"'{self.name}' is text, not a number")
        return source


class Caption:
    """Text in which ``{name}`` or ``{formula}`` becomes a number, and ``{{`` a brace."""

    PIECE = re.compile(r"\$[^$]*\$|{{|}}|{([^{}]+)}")  # mathematics is between dollar signs

    def __init__(self, hub: Scene, text: str, option: str = "title"):
        self.text, self.quantities = text, {}
        for piece in filter(None, self.PIECE.findall(text)):
            argument = Argument(Raw(Source(piece, "title"), 0, len(piece)), hub.interpreter)
            try:
                self.quantities[piece] = Quantity.from_script(hub, argument)
            except ScriptError as error:
                error.mark, error.argument = None, "title"
                error.message = f"{{{piece}}} in {option}: {error.message}"
                ways = f"or mathematics in dollars ($v_{{max}}$), or {{{{{piece}}}}} for braces"
                error.expected = f"{error.expected or 'a formula'}, {ways}"
                raise

    @property
    def names(self) -> set[str]:
        names: set[str] = set()
        for quantity in self.quantities.values():
            source = quantity._source()
            names |= source.names if isinstance(source, Expression) else {quantity.name}
        return names

    def __str__(self) -> str:
        def shown(piece: re.Match) -> str:
            if piece[1]:
                return f"{self.quantities[piece[1]].read():.6g}"
            return piece[0][0] if piece[0] in ("{{", "}}") else piece[0]

        return self.PIECE.sub(shown, self.text)


class Logged(Quantity):
    words = True


def _variables(hub: Scene) -> dict[str, Value]:
    return hub.interpreter.variables if hub.interpreter else {}
