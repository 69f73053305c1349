"""What expressions stand for: numbers, texts, and formulas that are evaluated again and again.

An operation on numbers is done at once. As soon as something that changes takes part (a position,
the time, a published value), the result is a `Formula`, with the numbers folded in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from karamelo_py.compiler.formula import GLOBAL, POINT, Program
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.functions import FUNCTIONS, TAIL, compute, compute_quietly
from karamelo_py.script.programs import in_order, program
from karamelo_py.script.syntax import Binary, Function, Name, Node, Number, Raw, Text, Unary
from karamelo_py.script.terms import REWRITTEN, Term, applied, constant, is_short, text_of
from karamelo_py.script.values import Values

POINT_SEEDS = ("x", "y", "z", "x0", "y0", "z0")
GLOBAL_SEEDS = ("time", "timestep", "dt")
SEEDS = frozenset({*POINT_SEEDS, *GLOBAL_SEEDS})

CHUNK = 1 << 18  # points at which a formula is evaluated together


class Formula:
    """A formula of positions, time and published values.

    Attributes
    ----------
    names : frozenset of str
        The seeds it needs: some of x y z x0 y0 z0, time timestep dt, published names.
    """

    __slots__ = ("_term",)

    def __init__(self, term: Term):
        self._term = term

    @classmethod
    def of(cls, value: float | Formula) -> Formula:
        """A number as a formula; a formula as it is."""
        return value if isinstance(value, Formula) else cls(constant(value))

    @classmethod
    def seed(cls, name: str) -> Formula:
        """The formula that is nothing but a name."""
        return cls(Term("name", (), name))

    def minus(self, other: Formula) -> Formula:
        """The formula of the difference."""
        return Formula(applied("-", self._term, other._term))

    @property
    def names(self) -> frozenset[str]:
        return self._term.names

    @property
    def is_constant(self) -> bool:
        """Whether it is one number for ever."""
        return not self._term.names

    @property
    def text(self) -> str:
        """The formula as it could stand in a script, down to its seeds, unless it is too long."""
        if not is_short(self._term):
            return f"a long formula of {', '.join(sorted(self.names)) or 'numbers'}"
        return text_of(self._term)

    def __repr__(self) -> str:
        return f"Formula({self.text})"

    def evaluate(self, values: Values) -> float:
        """The number it has now.

        Raises
        ------
        ScriptError
            If it needs a position.
        """
        needed = self.names.intersection(POINT_SEEDS)
        if needed:
            raise ScriptError(
                f"'{self.text}' depends on {min(needed)}, which differs from point to point",
                expected="a formula of time and of values of fixes and computes",
            )
        return _evaluate(self._term, values)

    def program(self, values: Values) -> Program:
        """The formula for :func:`karamelo_py.compiler.formula.evaluate`."""

        def place(name: str) -> tuple[int, int]:
            if name in POINT_SEEDS:
                return POINT, POINT_SEEDS.index(name)
            return GLOBAL, values.slot(_published(name, values))

        return program(self._term, place)

    def program_of(self, seeds: Sequence[str], depth: int) -> Program:
        """The formula of numbers that are not published, for a stack of this depth alone."""
        return program(self._term, lambda name: (POINT, seeds.index(name)), depth=depth)

    def evaluate_points(
        self, values: Values, x: np.ndarray, x0: np.ndarray | None = None
    ) -> np.ndarray:
        """The numbers it has at positions `x`, whose reference positions are `x0`.

        Parameters
        ----------
        values
            Published values.
        x, x0 : ndarray (n, 1 to 3)
            Missing directions count as 0; `x0` defaults to `x`.

        Returns
        -------
        ndarray (n,) float64
        """
        if not self.names.intersection(POINT_SEEDS):
            return np.full(len(x), self.evaluate(values))
        from karamelo_py.compiler import formula as kernels

        out = np.empty(len(x))
        scratch = np.empty((6 + kernels.ROWS, kernels.BLOCK))
        program = self.program(values)
        # Some at a time: copies with three columns of millions of points would take much memory.
        for first in range(0, len(x), CHUNK):
            some = slice(first, first + CHUNK)
            here = _three_columns(x[some])
            before = here if x0 is None else _three_columns(x0[some])
            kernels.evaluate_all(program, values.array, here, before, out[some], scratch)
        return out


class Expression:
    """For signatures: a number or a formula, used alike.

    Attributes
    ----------
    formula : Formula
    """

    def __init__(self, value: float | Formula):
        self.formula = Formula.of(value)

    @classmethod
    def from_script(cls, hub: Any, argument: Any) -> Expression:
        """The expression that a script's argument stands for."""
        value = argument.value(hub)
        if isinstance(value, str):
            raise ScriptError(
                f"'{value}' is text",
                place=argument.place,
                expected="a number or a formula",
            )
        return cls(value)

    @property
    def is_constant(self) -> bool:
        return self.formula.is_constant

    @property
    def constant(self) -> float:
        """The number, if it is one for ever (else a ValueError)."""
        if not self.is_constant:
            raise ValueError(f"{self.text} is not constant")
        return self.formula._term.value

    @property
    def names(self) -> frozenset[str]:
        return self.formula.names

    @property
    def text(self) -> str:
        return self.formula.text

    def __repr__(self) -> str:
        return f"Expression({self.text})"

    def program(self, values: Values) -> Program:
        """See :meth:`Formula.program`."""
        return self.formula.program(values)

    def evaluate(self, values: Values) -> float:
        """See :meth:`Formula.evaluate`."""
        return self.formula.evaluate(values)

    def evaluate_points(
        self, values: Values, x: np.ndarray, x0: np.ndarray | None = None
    ) -> np.ndarray:
        """See :meth:`Formula.evaluate_points`."""
        return self.formula.evaluate_points(values, x, x0)


Value = float | str | Formula


# ---- formulas: text, numbers, programs ----------------------------------------------------------


def _evaluate(root: Term, values: Values) -> float:
    found: dict[int, float] = {}
    for term in in_order(root):
        if term.operation == "number":
            result = term.value
        elif term.operation == "name":
            result = values.get(_published(term.value, values))
        else:
            result = compute_quietly(term.operation, *[found[id(t)] for t in term.operands])
        found[id(term)] = result
    return found[id(root)]


def _published(name: str, values: Values) -> str:
    if name not in values:
        raise ScriptError(f"'{name}' is no longer a value of a fix or a compute")
    return name


def _three_columns(x: np.ndarray) -> np.ndarray:
    x = np.asarray(x, dtype=np.float64)
    if x.shape[1] < 3:
        x = np.concatenate([x, np.zeros((len(x), 3 - x.shape[1]))], axis=1)
    return np.ascontiguousarray(x)


# ---- from trees to values -----------------------------------------------------------------------


class Scope(Protocol):
    """Where names and calls of commands get their meaning: the interpreter."""

    def name(self, name: str, node: Name, raw: Raw) -> Value:
        """What a name stands for."""

    def command(self, node: Function, raw: Raw) -> Value:
        """The value of a call that is not a function."""

    def hides(self, name: str) -> bool:
        """Whether the script uses the name of a function for something else."""


def evaluate(node: Node, raw: Raw, scope: Scope) -> Value:
    """What the tree of `raw` stands for: a number, a text or a formula.

    Raises
    ------
    ScriptError
        With the place of the operand to blame.
    """
    if isinstance(node, Number):
        return node.value
    if isinstance(node, Text):
        return node.value
    if isinstance(node, Name):
        return scope.name(node.name, node, raw)
    if isinstance(node, Unary):
        operand = _numeric(node.operand, raw, scope, f"'{node.operator}'")
        if node.operator == "+":
            return operand
        return _apply("not" if node.operator == "!" else "neg", node, (operand,), raw)
    if isinstance(node, Binary):
        return _binary(node, raw, scope)
    assert isinstance(node, Function)
    if node.name not in FUNCTIONS or scope.hides(node.name):
        return scope.command(node, raw)
    return _function(node, raw, scope)


def mark(raw: Raw, node: Node) -> Any:
    """The place of `node`, a part of `raw`."""
    return raw.source.place(raw.start + node.start, raw.start + node.end)


def _binary(node: Binary, raw: Raw, scope: Scope) -> Value:
    left = evaluate(node.left, raw, scope)
    logical = node.operator in ("&&", "||") and isinstance(left, float) and not math.isnan(left)
    if logical and (left != 0) == (node.operator == "||"):
        # What cannot matter is not evaluated, so that a != 0 && 1/a > 2 is fine.
        return 1.0 if left != 0 else 0.0
    right = evaluate(node.right, raw, scope)
    if isinstance(left, str) or isinstance(right, str):
        return _texts(node, left, right, raw)
    return _apply(node.operator, node, (left, right), raw)


def _texts(node: Binary, left: Value, right: Value, raw: Raw) -> Value:
    if isinstance(left, str) and isinstance(right, str):
        if node.operator == "+":
            return left + right
        if node.operator in ("==", "!="):
            return float((left == right) == (node.operator == "=="))
        guilty, text = node.left, left
    else:
        guilty, text = (node.left, left) if isinstance(left, str) else (node.right, right)
    raise ScriptError(
        f"'{text}' is text, and '{node.operator}' needs numbers",
        place=mark(raw, guilty),
        expected="a number; texts can be joined with + and compared with == and !=",
    )


def _numeric(node: Node, raw: Raw, scope: Scope, user: str) -> float | Formula:
    value = evaluate(node, raw, scope)
    if isinstance(value, str):
        raise ScriptError(
            f"'{value}' is text, and {user} needs a number",
            place=mark(raw, node),
            expected="a number",
        )
    return value


def _function(node: Function, raw: Raw, scope: Scope) -> Value:
    signature = FUNCTIONS[node.name]
    count = len(node.operands)
    if not signature.least <= count <= signature.most:
        wanted = (
            f"at least {signature.least} operands"
            if signature.most > signature.least
            else "1 operand"
            if signature.least == 1
            else f"{signature.least} operands"
        )
        raise ScriptError(
            f"{node.name} takes {wanted}, not {count}",
            place=mark(raw, node),
            expected=usage(node.name),
        )
    if node.name == "if":
        condition = _numeric(node.operands[0], raw, scope, "if")
        if isinstance(condition, float):
            if math.isnan(condition):
                return math.nan
            return evaluate(node.operands[1 if condition != 0 else 2], raw, scope)
    values = tuple(_numeric(operand, raw, scope, node.name) for operand in node.operands)
    if node.name in ("min", "max"):
        # Pairwise: the evaluator knows them for two operands.
        result = values[0]
        for value in values[1:]:
            result = _apply(node.name, node, (result, value), raw)
        return result
    return _apply(node.name, node, values, raw)


def usage(name: str) -> str:
    """How a function is called."""
    operands = {"if": "condition, a, b", "atan2": "y, x", "min": "a, b, ...", "max": "a, b, ..."}
    return f"{name}({operands.get(name) or ('a, b' if FUNCTIONS[name].least == 2 else 'a')})"


def _apply(operation: str, node: Node, values: tuple, raw: Raw) -> float | Formula:
    """The operation on numbers, or a formula if one of the values is."""
    if any(isinstance(value, Formula) for value in values):
        terms = [v._term if isinstance(v, Formula) else constant(v) for v in values]
        try:
            rewrite = REWRITTEN.get(operation)
            return Formula(rewrite(*terms) if rewrite else applied(operation, *terms))
        except ScriptError as error:
            error.place = mark(raw, node)
            raise
    try:
        return compute(operation, *values)
    except (ValueError, ZeroDivisionError, OverflowError) as error:
        raise _impossible(operation, node, values, raw, error) from None


def _impossible(
    operation: str, node: Node, values: tuple, raw: Raw, error: Exception
) -> ScriptError:
    """The error for an operation on constants that has no result."""
    operands = _operands(node)
    shown = ", ".join(f"{value:g}" for value in values)
    if isinstance(error, ZeroDivisionError) or (operation in ("^", "pow") and values[0] == 0):
        guilty = operands[0] if operation in ("^", "pow") else operands[-1]
        code = raw.code[guilty.start : guilty.end]
        return ScriptError(
            "division by zero" + ("" if isinstance(guilty, Number) else f": {code} is 0"),
            place=mark(raw, guilty),
            expected="a number other than 0",
        )
    if isinstance(error, OverflowError):
        return ScriptError(
            f"the result of {_spelled(operation, shown)} is too large",
            place=mark(raw, node),
            expected="at most 1.8e308",
        )
    domains = {
        "sqrt": "a number of at least 0",
        "asin": "a number between -1 and 1",
        "acos": "a number between -1 and 1",
        "atanh": "a number between -1 and 1, both excluded",
        "acosh": "a number of at least 1",
        "inv_norm": f"a number from {TAIL:g} to 1 - {TAIL:g}",
        "log1p": "a number above -1",
        "^": "a whole exponent for a negative base",
        "pow": "a whole exponent for a negative base",
        "gamma": "any number but 0, -1, -2, ...",
        "lgamma": "any number but 0, -1, -2, ...",
        "tgamma": "any number but 0, -1, -2, ...",
    }
    positive = operation in ("log", "log2", "log10")
    return ScriptError(
        f"{_spelled(operation, shown)} is not a real number",
        place=mark(raw, operands[0] if len(operands) == 1 else node),
        expected="a number above 0" if positive else domains.get(operation, "a finite result"),
    )


def _spelled(operation: str, shown: str) -> str:
    if operation in FUNCTIONS:
        return f"{operation}({shown})"
    return f" {operation} ".join(shown.split(", "))


def _operands(node: Node) -> tuple[Node, ...]:
    if isinstance(node, Unary):
        return (node.operand,)
    if isinstance(node, Binary):
        return node.left, node.right
    assert isinstance(node, Function)
    return node.operands
