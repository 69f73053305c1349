"""Numbers, texts, and formulas.

An operation that involves a position, time or published value gives a formula; operations on
constants are carried out at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np

from karamelo_py.compiler.programs import BLOCK, ROWS
from karamelo_py.script import formula, terms
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.values import Values

POINT_SEEDS = ("x", "y", "z", "x0", "y0", "z0")
FIRST = frozenset(POINT_SEEDS[3:])
GLOBAL_SEEDS = ("time", "timestep", "dt")
SEEDS = frozenset({*POINT_SEEDS, *GLOBAL_SEEDS})

_MAX_SIZE = 20000
CHUNK = 1 << 18  # points evaluated at a time


class Expression:
    """A number, or a formula of positions, time and published values.

    `names` are some of x y z x0 y0 z0, time timestep dt, and published names.
    """

    __slots__ = ("names", "operands", "operation", "size", "value")

    def __init__(
        self, value: Any, operation: str = "number", operands: tuple[Expression, ...] = ()
    ):
        if isinstance(value, Expression):
            operation, operands, value = value.operation, value.operands, value.value
        self.operation: str = operation
        self.operands: tuple[Expression, ...] = operands
        self.value: Any = float(value) if operation == "number" else value
        seeds = {value} if operation == "name" else ()
        self.names: frozenset[str] = frozenset(seeds).union(*(one.names for one in operands))
        # An operand that occurs several times counts each time.
        self.size: int = 1 + sum(one.size for one in operands)
        if self.size > _MAX_SIZE:
            self.size = len(terms.in_order(self))
        if self.size > _MAX_SIZE:
            raise ScriptError("the formula is too long", expected=f"at most {_MAX_SIZE} operations")

    @classmethod
    def seed(cls, name: str) -> Expression:
        return cls(name, "name")

    @classmethod
    def from_script(cls, hub: Any, argument: Any) -> Self:
        value = argument.value(hub)
        if isinstance(value, str):
            raise ScriptError(
                f"'{value}' is text", mark=argument.mark, expected="a number or a formula"
            )
        return cls(value)

    def minus(self, other: Expression) -> Expression:
        return applied("-", self, other)

    @property
    def is_constant(self) -> bool:
        return not self.names

    @property
    def constant(self) -> float:
        if not self.is_constant:
            raise ValueError(f"{self.text} is not constant")
        return self.value

    @property
    def text(self) -> str:
        if not terms.is_short(self):
            return f"a long formula of {', '.join(sorted(self.names)) or 'numbers'}"
        return terms.text_of(self)

    def __repr__(self) -> str:
        return f"Expression({self.text})"

    def is_like(self, other: Expression) -> bool:
        return terms.alike(self, other)

    def evaluate(self, values: Values) -> float:
        """Return the present value; raises ScriptError for a formula of positions."""
        needed = self.names.intersection(POINT_SEEDS)
        if needed:
            message = f"'{self.text}' depends on {min(needed)}, which differs from point to point"
            expected = "a formula of time and of values of fixes and computes"
            raise ScriptError(message, name=self.text, expected=expected)
        return terms.evaluated(self, lambda name: values.get(_published(name, values)))

    def program(self, values: Values) -> formula.Program:
        def push(name: str) -> tuple[int, int]:
            if name in POINT_SEEDS:
                return formula.POINT, POINT_SEEDS.index(name)
            return formula.GLOBAL, values.slot(_published(name, values))

        return terms.program(self, push)

    def evaluate_points(
        self, values: Values, x: np.ndarray, x0: np.ndarray | None = None
    ) -> np.ndarray:
        """Return values (n,) at `x` (n, 1 to 3), with initial positions `x0` (default: `x`)."""
        if not self.names.intersection(POINT_SEEDS):
            return np.full(len(x), self.evaluate(values))

        out = np.empty(len(x))
        scratch = np.empty((6 + ROWS, BLOCK))
        program = self.program(values)
        # Use chunks, since three-column copies of millions of points take much memory.
        for first in range(0, len(x), CHUNK):
            some = slice(first, first + CHUNK)
            here = _three_columns(x[some])
            before = here if x0 is None else _three_columns(x0[some])
            formula.evaluate_all(program, values.array, here, before, out[some], scratch)
        return out

    def evaluate_columns(self, values: Values, columns: Mapping[str, np.ndarray]) -> np.ndarray:
        names = list(columns)
        if not names:
            return np.array([self.evaluate(values)])

        def push(name: str) -> tuple[int, int]:
            if name in columns:
                return formula.POINT, names.index(name)
            return formula.GLOBAL, values.slot(_published(name, values))

        rows = np.zeros((len(columns[names[0]]), len(POINT_SEEDS)))
        for k, name in enumerate(names):
            rows[:, k] = columns[name]
        out, scratch = np.empty(len(rows)), np.empty((6 + ROWS, BLOCK))
        now, before = (np.ascontiguousarray(block) for block in (rows[:, :3], rows[:, 3:]))
        formula.evaluate_all(terms.program(self, push), values.array, now, before, out, scratch)
        return out


def applied(operation: str, *operands: Expression) -> Expression:
    return Expression(None, operation, operands)


Value = float | str | Expression


def shown(value: Value) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, Expression):
        return value.text
    return terms.number_text(value)


def _published(name: str, values: Values) -> str:
    if name not in values:
        raise ScriptError(f"'{name}' is no longer a value of a fix or a compute")
    return name


def _three_columns(x: np.ndarray) -> np.ndarray:
    x = np.asarray(x, dtype=np.float64)
    if x.shape[1] < 3:
        x = np.pad(x, ((0, 0), (0, 3 - x.shape[1])))
    return np.ascontiguousarray(x)
