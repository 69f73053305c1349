"""Values of expressions: numbers, texts, and formulas that are evaluated repeatedly.

An operation with a variable operand (position, time, published value) gives a formula, with
constants folded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np

from karamelo_py.script import formula, terms
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.values import Values

POINT_SEEDS = ("x", "y", "z", "x0", "y0", "z0")
FIRST = frozenset(POINT_SEEDS[3:])
GLOBAL_SEEDS = ("time", "timestep", "dt")
SEEDS = frozenset({*POINT_SEEDS, *GLOBAL_SEEDS})

CHUNK = 1 << 18  # points per evaluation of a formula


class Expression:
    """A number, or a formula of positions, time and published values.

    `names` are its seeds: some of x y z x0 y0 z0, time timestep dt, published names.
    """

    __slots__ = ("_term",)

    def __init__(self, value: float | terms.Term | Expression):
        if not isinstance(value, terms.Term):
            value = value._term if isinstance(value, Expression) else terms.constant(value)
        self._term: terms.Term = value

    @classmethod
    def seed(cls, name: str) -> Expression:
        return cls(terms.Term("name", (), name))

    @classmethod
    def from_script(cls, hub: Any, argument: Any) -> Self:
        value = argument.value(hub)
        if isinstance(value, str):
            raise ScriptError(
                f"'{value}' is text", push=argument.push, expected="a number or a formula"
            )
        return cls(value)

    def minus(self, other: Expression) -> Expression:
        return Expression(terms.applied("-", self._term, other._term))

    @property
    def names(self) -> frozenset[str]:
        return self._term.names

    @property
    def is_constant(self) -> bool:
        return not self._term.names

    @property
    def constant(self) -> float:
        if not self.is_constant:
            raise ValueError(f"{self.text} is not constant")
        return self._term.value

    @property
    def text(self) -> str:
        """Write the formula in script syntax down to its seeds, unless too long."""
        if not terms.is_short(self._term):
            return f"a long formula of {', '.join(sorted(self.names)) or 'numbers'}"
        return terms.text_of(self._term)

    def __repr__(self) -> str:
        return f"Expression({self.text})"

    def is_like(self, other: Expression) -> bool:
        """Return True if both are visibly the same number everywhere."""
        return terms.alike(self._term, other._term)

    def evaluate(self, values: Values) -> float:
        """Return the present number; ScriptError for a formula of positions."""
        needed = self.names.intersection(POINT_SEEDS)
        if needed:
            message = f"'{self.text}' depends on {min(needed)}, which differs from point to point"
            expected = "a formula of time and of values of fixes and computes"
            raise ScriptError(message, name=self.text, expected=expected)
        return terms.evaluated(self._term, lambda name: values.get(_published(name, values)))

    def program(self, values: Values) -> formula.Program:
        def push(name: str) -> tuple[int, int]:
            if name in POINT_SEEDS:
                return formula.POINT, POINT_SEEDS.index(name)
            return formula.GLOBAL, values.slot(_published(name, values))

        return terms.program(self._term, push)

    def program_of(self, seeds: Sequence[str], depth: int) -> formula.Program:
        """Compile a formula without published numbers for a stack of this depth."""
        return terms.program(
            self._term, lambda name: (formula.POINT, seeds.index(name)), depth=depth
        )

    def evaluate_points(
        self, values: Values, x: np.ndarray, x0: np.ndarray | None = None
    ) -> np.ndarray:
        """Evaluate (n,) at `x` (n, 1 to 3), with initial positions `x0` (default: `x`)."""
        if not self.names.intersection(POINT_SEEDS):
            return np.full(len(x), self.evaluate(values))

        out = np.empty(len(x))
        scratch = np.empty((6 + formula.ROWS, formula.BLOCK))
        program = self.program(values)
        # In chunks: three-column copies of millions of points take much memory.
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
        out, scratch = np.empty(len(rows)), np.empty((6 + formula.ROWS, formula.BLOCK))
        now, before = (np.ascontiguousarray(block) for block in (rows[:, :3], rows[:, 3:]))
        formula.evaluate_all(
            terms.program(self._term, push), values.array, now, before, out, scratch
        )
        return out


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
