"""Meanings of names and calls in expressions: variables, published values, functions, commands."""

from typing import Any

from karamelo_py.language import registry, signature
from karamelo_py.language.unknown import defined_later, no_value, unknown_call, unknown_name
from karamelo_py.script import evaluation
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import SEEDS, Expression, Value
from karamelo_py.script.functions import CONSTANTS, FUNCTIONS, WORDS
from karamelo_py.script.syntax import FunctionCall, Name, Node, Raw
from karamelo_py.script.terms import number_text


class Meanings:
    """Gives names their meaning, from the variables of a script and what its hub publishes."""

    # Scripts in progress, the innermost last, and the statement: for hints.
    frames: list[Any]
    statement: Any

    def __init__(self, hub: Any):
        self.hub = hub
        self.variables: dict[str, Value] = {}

    def evaluate(self, node: Node, raw: Raw) -> Value:
        """Evaluate an expression now: to a number, a text or a formula."""
        return evaluation.evaluate(node, raw, self)

    def knows(self, name: str) -> bool:
        """Tell if a name means something in an expression."""
        return (
            name in self.variables or name in SEEDS or name in CONSTANTS or name in self.hub.values
        )

    def hides(self, name: str) -> bool:
        """Tell if a variable has the name of a function or command, which it hides then."""
        return name in self.variables

    def name(self, name: str, node: Name, raw: Raw) -> Value:
        """Find the value of a name in an expression."""
        if name in SEEDS:
            return Expression.seed(name)
        if name in self.variables:
            return self.variables[name]
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name in self.hub.values:
            return Expression.seed(name)
        raise unknown_name(self, name, evaluation.mark(raw, node))

    def means_something(self, name: str) -> bool:
        """Tell if a name can stand in a script here, be it as a call or further down."""
        known = self.knows(name) or name in WORDS or name in FUNCTIONS
        return known or registry.knows("command", name) or bool(defined_later(self, name, None))

    def command(self, node: FunctionCall, raw: Raw) -> Value:
        """The value of a call inside an expression that is not a function."""
        name = node.name
        begin = raw.start + node.start
        place = raw.source.place(begin, begin + len(name))
        if not registry.knows("command", name) or self.hides(name):
            raise unknown_call(self, name, place, statement=False)
        target = registry.find("command", name)
        # What gives no value must not be carried out here, least of all a run.
        if getattr(target, "__annotations__", {}).get("return", "") in (None, "None"):
            raise no_value(name, place)
        arguments = [
            signature.Argument(Raw(raw.source, raw.start + o.start, raw.start + o.end), self)
            for o in node.operands
        ]
        try:
            value = signature.call(target, self.hub, arguments, name)
        except ScriptError as error:
            error.place = error.place or place
            raise
        if isinstance(value, (bool, int, float)):
            return float(value)
        if isinstance(value, (str, Expression)):
            return value
        raise no_value(name, place)


def shown(value: Value) -> str:
    """A value as a script would say it."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, Expression):
        return value.text
    return number_text(value)
