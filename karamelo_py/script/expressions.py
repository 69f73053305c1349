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
from karamelo_py.script.values import Values

POINT_SEEDS = ("x", "y", "z", "x0", "y0", "z0")
GLOBAL_SEEDS = ("time", "timestep", "dt")
SEEDS = frozenset({*POINT_SEEDS, *GLOBAL_SEEDS})

# Number of operations in all; of those that messages show.
_MAX_SIZE = 20000
_MAX_SHOWN = 1000
_MAX_LEVELS = 100

# Functions that the evaluator does not know as such.
_REWRITTEN = {
    "pow": lambda a, b: _term("^", a, b),
    "mod": lambda a, b: _term("%", a, b),
    "tgamma": lambda a: _term("gamma", a),
    "exp2": lambda a: _term("^", _number(2.0), a),
    "degrees": lambda a: _term("*", a, _number(180 / math.pi)),
    "radians": lambda a: _term("*", a, _number(math.pi / 180)),
    "remainder": lambda a, b: _term("-", a, _term("*", b, _term("round", _term("/", a, b)))),
    "inv_norm": lambda a: _inverse_normal(a),
}

# Numerators and denominators, from the highest power on, of Wichura's algorithm AS 241 (1988) for
# the inverse of the normal distribution: around the middle, and towards the tails.
_MIDDLE = (
    (
        2509.0809287301226727, 33430.575583588128105, 67265.770927008700853, 45921.953931549871457,
        13731.693765509461125, 1971.5909503065514427, 133.14166789178437745, 3.3871328727963666080,
    ),
    (
        5226.4952788528545610, 28729.085735721942674, 39307.895800092710610, 21213.794301586595867,
        5394.1960214247511077, 687.18700749205790830, 42.313330701600911252, 1.0,
    ),
)  # fmt: skip
_SIDES = (
    (
        7.74545014278341407640e-4, 2.27238449892691845833e-2, 2.41780725177450611770e-1,
        1.27045825245236838258, 3.64784832476320460504, 5.76949722146069140550,
        4.63033784615654529590, 1.42343711074968357734,
    ),
    (
        1.05075007164441684324e-9, 5.47593808499534494600e-4, 1.51986665636164571966e-2,
        1.48103976427480074590e-1, 6.89767334985100004550e-1, 1.67638483018380384940,
        2.05319162663775882187, 1.0,
    ),
)  # fmt: skip

_PRECEDENCE = {
    "||": 1,
    "&&": 2,
    "not": 3,
    **dict.fromkeys(("<", "<=", ">", ">=", "==", "!="), 4),
    "+": 5,
    "-": 5,
    "*": 6,
    "/": 6,
    "%": 6,
    "neg": 7,
    "^": 8,
}


class _Term:
    """A node of a formula: a number, the name of a seed, or an operation on terms."""

    __slots__ = ("names", "operands", "operation", "size", "value")

    def __init__(self, operation: str, operands: tuple[_Term, ...], value: Any):
        self.operation = operation
        self.operands = operands
        self.value = value
        self.names: frozenset[str] = frozenset()
        if operation == "name":
            self.names = frozenset({value})
        elif operands:
            self.names = frozenset().union(*(term.names for term in operands))
        # Operations as if none were shared, counted in earnest only where they seem too many.
        self.size = 1 + sum(term.size for term in operands)
        if self.size > _MAX_SIZE:
            self.size = len(in_order(self))
        if self.size > _MAX_SIZE:
            raise ScriptError("the formula is too long", expected=f"at most {_MAX_SIZE} operations")


def _number(value: float) -> _Term:
    return _Term("number", (), float(value))


def _term(operation: str, *operands: _Term) -> _Term:
    return _Term(operation, operands, None)


def _quotient(polynomials: tuple[tuple[float, ...], ...], r: _Term) -> _Term:
    """Two polynomials of `r`, the first over the second."""
    terms = []
    for coefficients in polynomials:
        term = _number(coefficients[0])
        for coefficient in coefficients[1:]:
            term = _term("+", _term("*", term, r), _number(coefficient))
        terms.append(term)
    return _term("/", *terms)


def _inverse_normal(p: _Term) -> _Term:
    q = _term("-", p, _number(0.5))
    middle = _quotient(_MIDDLE, _term("-", _number(0.180625), _term("*", q, q)))
    tail = _term("min", p, _term("-", _number(1.0), p))
    far = _term("sqrt", _term("neg", _term("log", tail)))
    side = _quotient(_SIDES, _term("-", far, _number(1.6)))
    within = _term(">=", tail, _number(TAIL))
    side = _term("if", within, _term("*", _term("sign", q), side), _number(math.nan))
    near = _term("<=", _term("abs", q), _number(0.425))
    return _term("if", near, _term("*", q, middle), side)


class Formula:
    """A formula of positions, time and published values.

    Attributes
    ----------
    names : frozenset of str
        The seeds it needs: some of x y z x0 y0 z0, time timestep dt, published names.
    """

    __slots__ = ("_term",)

    def __init__(self, term: _Term):
        self._term = term

    @classmethod
    def of(cls, value: float | Formula) -> Formula:
        """A number as a formula; a formula as it is."""
        return value if isinstance(value, Formula) else cls(_number(value))

    @classmethod
    def seed(cls, name: str) -> Formula:
        """The formula that is nothing but a name."""
        return cls(_Term("name", (), name))

    def minus(self, other: Formula) -> Formula:
        """The formula of the difference."""
        return Formula(_term("-", self._term, other._term))

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
        if not _is_short(self._term):
            return f"a long formula of {', '.join(sorted(self.names)) or 'numbers'}"
        return _text(self._term)

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

        x = _three_columns(x)
        x0 = x if x0 is None else _three_columns(x0)
        out = np.empty(len(x))
        scratch = np.empty((6 + kernels.ROWS, kernels.BLOCK))
        kernels.evaluate_all(self.program(values), values.array, x, x0, out, scratch)
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


def number_text(value: float) -> str:
    """A number as a script says it, exactly."""
    text = repr(float(value))
    return text.removesuffix(".0")


def _is_short(root: _Term) -> bool:
    """Whether a term can be written down, where what is shared is written again and again."""
    levels: dict[int, int] = {}
    sizes: dict[int, int] = {}
    for term in in_order(root):
        levels[id(term)] = 1 + max((levels[id(t)] for t in term.operands), default=0)
        sizes[id(term)] = 1 + sum(sizes[id(t)] for t in term.operands)
    return levels[id(root)] <= _MAX_LEVELS and sizes[id(root)] <= _MAX_SHOWN


def _text(term: _Term) -> str:
    operation, operands = term.operation, term.operands
    if operation == "number":
        return number_text(term.value)
    if operation == "name":
        return term.value
    level = _PRECEDENCE.get(operation)
    if level is None:
        return f"{operation}({', '.join(_text(operand) for operand in operands)})"
    if operation == "neg":
        return "-" + _bracketed(operands[0], 7)
    if operation == "not":
        return "!" + _bracketed(operands[0], 3)
    if operation == "^":
        return _bracketed(operands[0], 9) + "^" + _bracketed(operands[1], 7)
    left, right = operands
    blank = "" if level >= 6 else " "
    return f"{_bracketed(left, level)}{blank}{operation}{blank}{_bracketed(right, level + 1)}"


def _bracketed(term: _Term, level: int) -> str:
    """The text of `term`, in parentheses if it binds less than `level`."""
    if term.operation == "number":
        own = 7 if math.copysign(1.0, term.value) < 0 else 9
    else:
        own = _PRECEDENCE.get(term.operation, 9)
    return _text(term) if own >= level else f"({_text(term)})"


def _evaluate(root: _Term, values: Values) -> float:
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
        terms = [v._term if isinstance(v, Formula) else _number(v) for v in values]
        try:
            rewrite = _REWRITTEN.get(operation)
            return Formula(rewrite(*terms) if rewrite else _term(operation, *terms))
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
