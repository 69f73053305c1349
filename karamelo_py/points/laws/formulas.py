"""Formulas in laws: read from a script, differentiated, and turned into code of a class.

The structure of a formula is in the class of the law, so kernels contain it as code; its numbers
are parameters. Laws that differ only in numbers have the same kernels, unless numbers are equal, or
are exponents that are small integers.
"""

from collections import namedtuple
from collections.abc import Callable, Sequence
from functools import partial
from hashlib import sha256
from math import cos, cosh, log, sin, sinh, sqrt, tan, tanh
from typing import Any, ClassVar

from karamelo_py.compiler import importable, real, where
from karamelo_py.compiler.powers import exponential, power
from karamelo_py.compiler.powers import logarithm_near_one as logarithm
from karamelo_py.language.arguments import Argument
from karamelo_py.language.kinds import WithNumbers
from karamelo_py.language.scene import Scene
from karamelo_py.script import evaluation, syntax, terms
from karamelo_py.script.derivatives import OF_ONE, is_number, times
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.script.expressions import applied as of_operands
from karamelo_py.script.parser import parse_text
from karamelo_py.script.terms import Term

WHOLE = {*range(-8, 9)} - {0}  # exponents that become part of the code, not parameters
ONE_BY_ONE = {"sin", "cos", "tan", "tanh", "sinh", "cosh"}  # not computed in lanes
COMPARED = ("<", "<=", ">", ">=")
OF_TWO = ("+", "-", "*", "/", "^", "max", "min")
KNOWN = {*OF_ONE, *OF_TWO, *COMPARED, "number", "name", "if"}

Code = tuple[tuple[str, Any], ...]  # stack program: operation, and operand of pushes


class FormulaOf(WithNumbers):
    """Script argument: a formula of `names` for a `quantity`."""

    names: ClassVar[tuple[str, ...]]
    quantity: ClassVar[str]
    expected: ClassVar[str]

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        value = argument.value_with(cls.names)
        if isinstance(value, str):
            message = f"{argument.text} is text"
            raise ScriptError(message, mark=argument.mark, expected=cls.expected)
        formula = Expression(value)
        if others := formula.names.difference(cls.names):
            raise ScriptError(
                f"{cls.quantity} cannot depend on {min(others)}",
                mark=argument.mark,
                expected=cls.expected,
            )
        return formula


class Constants:
    def __init__(self, numbers: dict[str, float]):
        self.numbers = numbers

    def name(self, name: str, node: syntax.Name, raw: syntax.Raw) -> float | Expression:
        return self.numbers[name] if name in self.numbers else Expression.seed(name)

    def command(self, node: syntax.FunctionCall, raw: syntax.Raw) -> Any:
        raise NotImplementedError(node.name)

    def hides(self, name: str) -> bool:
        return False


def with_numbers(formula: str, **numbers: float) -> Expression:
    """Return a formula with its constants; other names remain names."""
    raw, node = parse_text(formula)
    return Expression(evaluation.evaluate(node, raw, Constants(numbers)))


def check_operations(formula: Term, argument: str, allowed: set[str] = KNOWN) -> None:
    for one in terms.in_order(formula):
        if one.operation not in allowed:
            raise ScriptError(
                f"{one.operation} has no derivative, which the stress needs"
                if allowed is not KNOWN
                else f"{one.operation} is not possible in a law",
                argument=argument,
                expected=f"a formula with + - * / ^ and {', '.join(sorted({*OF_ONE} - {'neg'}))}",
            )


def _equal(a: Expression, b: Expression) -> Expression:
    return times(of_operands(">=", a, b), of_operands("<=", a, b))


def _not(a: Expression) -> Expression:
    return _equal(a, Expression(0))


PLAIN: dict[str, Callable] = {
    "abs": lambda a: of_operands("max", a, of_operands("neg", a)),
    "log10": lambda a: of_operands("/", of_operands("log", a), Expression(log(10))),
    "log2": lambda a: of_operands("/", of_operands("log", a), Expression(log(2))),
    "==": _equal,
    "!=": lambda a, b: _not(_equal(a, b)),
    "not": _not,
    "&&": lambda a, b: _not(of_operands("max", _not(a), _not(b))),
    "||": lambda a, b: _not(times(_not(a), _not(b))),
}


def plain(formula: Expression, argument: str, by: dict[str, Callable] = PLAIN) -> Expression:
    """Return the formula in operations that laws support; raise ScriptError if it cannot be."""
    results: dict[int, Expression] = {}
    for one in terms.in_order(formula):
        operands = [results[id(operand)] for operand in one.operands]
        made = by.get(one.operation, partial(of_operands, one.operation))
        results[id(one)] = made(*operands) if operands else one
    check_operations(results[id(formula)], argument)
    return results[id(formula)]


class ProgramWriter:
    """Writes formulas in `names`, with common `numbers` that include all other names."""

    def __init__(self, names: Sequence[str]):
        self.names = names
        self.numbers: dict[Any, int] = {}

    def code(self, root: Term) -> Code:
        if is_number(root, 0):
            return ()
        made: list[tuple[str, Any]] = []
        self._append(root, made)
        return tuple(made)

    def _append(self, term: Term, made: list) -> None:
        operation, operands = term.operation, term.operands
        if operation == "name" and term.value in self.names:
            made.append(("name", self.names.index(term.value)))
        elif not operands:
            made.append(("number", self.numbers.setdefault(term.value, len(self.numbers))))
        elif operation == "^" and operands[1].value in WHOLE:
            self._append(operands[0], made)
            made.append(("whole power", int(operands[1].value)))
        else:
            for operand in operands:
                self._append(operand, made)
            made.append((operation, None))

    def law(self, kind: type, fields: dict[str, Any], codes: dict[str, Any], **named: float):
        """Return a NamedTuple of `kind` with `fields` and numbers; `named` numbers may change."""
        numbers = [key if isinstance(key, str) else f"number{k}" for key, k in self.numbers.items()]
        name = f"{kind.__name__}_{sha256(repr((codes, numbers)).encode()).hexdigest()[:16]}"

        def made() -> type:
            base = namedtuple(name, (*fields, *numbers))
            traits = {**codes, "start": len(fields), "__slots__": (), "__module__": kind.__module__}
            return type(name, (kind, base), traits)

        values = [named.get(key, key) for key in self.numbers]
        return importable(kind.__module__, name, made)(*fields.values(), *values)


def in_lanes(*formulas: Code) -> bool:
    return all(ONE_BY_ONE.isdisjoint(dict(code)) for code in formulas)


def applied(operation, a, b):
    if operation in ("+", "-"):
        return a + b if operation == "+" else a - b
    if operation in ("*", "/"):
        return a * b if operation == "*" else a / b
    if operation in ("max", "min"):
        return max(a, b) if operation == "max" else min(a, b)
    if operation in COMPARED:
        return where(compared(operation, a, b), real(1, a), real(0, a))
    return power(a, b)


def compared(operation, a, b):
    if operation in ("<", "<="):
        return a < b if operation == "<" else a <= b
    return a > b if operation == ">" else a >= b


def function_of(name):
    return {
        "sqrt": sqrt, "exp": exponential, "log": logarithm, "sin": sin, "cos": cos, "tan": tan,
        "tanh": tanh, "sinh": sinh, "cosh": cosh,
    }[name]  # fmt: skip


def whole_power(a, n):
    made = a
    for _ in range(abs(n) - 1):
        made = made * a
    return made if n > 0 else 1 / made


def evaluated(code, law, arguments):
    if not len(code):
        return 0
    stack = ()
    for operation, operand in code:
        if operation == "name":
            stack = (arguments[operand], *stack)
        elif operation == "number":
            stack = (law[law.start + operand], *stack)
        elif operation == "whole power":
            stack = (whole_power(stack[0], operand), *stack[1:])
        elif operation in OF_TWO or operation in COMPARED:
            stack = (applied(operation, stack[1], stack[0]), *stack[2:])
        elif operation == "if":
            stack = (where(stack[2] != 0, stack[1], stack[0]), *stack[3:])
        elif operation == "neg":
            stack = (-stack[0], *stack[1:])
        else:
            stack = (function_of(operation)(stack[0]), *stack[1:])
    return stack[0]
