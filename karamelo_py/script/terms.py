"""Trees of formulas: order, value, text and program."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np

from karamelo_py.compiler import programs
from karamelo_py.script import formula
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.functions import compute_quietly
from karamelo_py.script.operations import OPERATIONS

_MAX_SHOWN = 1000
_MAX_LEVELS = 100

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


class Term(Protocol):
    """A number, the name of a seed, or an operation (:class:`expressions.Expression`)."""

    operation: str
    value: Any

    @property
    def operands(self) -> Sequence[Any]: ...


Tree = TypeVar("Tree", bound=Term)


def in_order(root: Tree) -> list[Tree]:
    """List each term once, operands first."""
    ordered: dict[int, Tree] = {}
    open_terms = [(root, False)]
    while open_terms:
        term, done = open_terms.pop()
        if id(term) in ordered:
            continue
        if done:
            ordered[id(term)] = term
        else:
            open_terms.append((term, True))
            open_terms += [(operand, False) for operand in reversed(term.operands)]
    return list(ordered.values())


def evaluated(root: Term, value_of: Callable[[str], float]) -> float:
    results: dict[int, float] = {}
    for term in in_order(root):
        if term.operation == "number":
            result = term.value
        elif term.operation == "name":
            result = value_of(term.value)
        else:
            result = compute_quietly(term.operation, *[results[id(t)] for t in term.operands])
        results[id(term)] = result
    return results[id(root)]


def alike(one: Term, other: Term) -> bool:
    numbers: dict[tuple, int] = {}
    kinds: dict[int, int] = {}
    for term in (*in_order(one), *in_order(other)):
        operands = [kinds[id(t)] for t in term.operands]
        if term.operation in ("+", "*"):
            operands.sort()
        kinds[id(term)] = numbers.setdefault((term.operation, term.value, *operands), len(numbers))
    return kinds[id(one)] == kinds[id(other)]


def number_text(value: float) -> str:
    return repr(float(value)).removesuffix(".0")


def number_of(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def is_short(root: Term) -> bool:
    """Return True if a term is short enough for its text to repeat common terms."""
    levels: dict[int, int] = {}
    sizes: dict[int, int] = {}
    for term in in_order(root):
        levels[id(term)] = 1 + max((levels[id(t)] for t in term.operands), default=0)
        sizes[id(term)] = 1 + sum(sizes[id(t)] for t in term.operands)
    return levels[id(root)] <= _MAX_LEVELS and sizes[id(root)] <= _MAX_SHOWN


def text_of(term: Term) -> str:
    operation, operands = term.operation, term.operands
    if operation == "number":
        return number_text(term.value)
    if operation == "name":
        return term.value
    level = _PRECEDENCE.get(operation)
    if level is None:
        return f"{operation}({', '.join(text_of(operand) for operand in operands)})"
    if operation in ("neg", "not"):
        return ("-" if operation == "neg" else "!") + _bracketed(operands[0], level)
    if operation == "^":
        return _bracketed(operands[0], 9) + "^" + _bracketed(operands[1], 7)
    left, right = operands
    blank = "" if level >= 6 else " "
    return f"{_bracketed(left, level)}{blank}{operation}{blank}{_bracketed(right, level + 1)}"


def _bracketed(term: Term, level: int) -> str:
    if term.operation == "number":
        precedence = 7 if math.copysign(1.0, term.value) < 0 else 9
    else:
        precedence = _PRECEDENCE.get(term.operation, 9)
    return text_of(term) if precedence >= level else f"({text_of(term)})"


# Common terms, and operands that would not fit on the stack, are computed once and stored.

# Depth of the stack without stored rows; it also limits Python's recursion.
_MOST_LEVELS = 60


def program(root: Term, push: Callable[[str], tuple[int, int]]) -> formula.Program:
    """Compile a term; `push` returns the instruction and operand for a name."""
    return _Writer(root, push).program()


class _Writer:
    """Compiles a program; equal terms have the same number."""

    def __init__(self, root: Term, push: Callable[[str], tuple[int, int]]):
        self.push = push
        self.terms: list[tuple[str, tuple[int, ...], Any]] = []
        self.uses: list[int] = []
        self.uniform: list[bool] = []
        self.code: list[tuple[int, int]] = []
        self.constants: dict[str, int] = {}  # by hexadecimal text, in which 0.0 and -0.0 differ
        self.rows: dict[int, int] = {}
        self.free = list(range(programs.MAX_KEPT))[::-1]
        self.root = self._number(root)
        self.kept = self._chosen()

    def _number(self, root: Term) -> int:
        numbers: dict[int, int] = {}
        indices: dict[tuple, int] = {}
        for term in in_order(root):
            operands = tuple(numbers[id(operand)] for operand in term.operands)
            value = term.value.hex() if term.operation == "number" else term.value
            key = term.operation, operands, value
            if key not in indices:
                indices[key] = len(self.terms)
                self.terms.append(key)
                self.uses.append(0)
                self.uniform.append(self._is_uniform(*key))
                for operand in operands:
                    self.uses[operand] += 1
            numbers[id(term)] = indices[key]
        return numbers[id(root)]

    def _is_uniform(self, operation: str, operands: tuple[int, ...], value: Any) -> bool:
        if operation == "name":
            return self.push(value)[0] != formula.POINT
        return all(self.uniform[operand] for operand in operands)

    def _chosen(self) -> set[int]:
        kept = {k for k, (_, below, _) in enumerate(self.terms) if below and self.uses[k] > 1}
        rows, levels = [1] * len(self.terms), [1] * len(self.terms)
        for k, (_, operands, _) in enumerate(self.terms):
            while True:
                # An operand remains on the stack while the next one is computed.
                asked = [i + (1 if o in kept else rows[o]) for i, o in enumerate(operands)]
                deep = [0 if o in kept else levels[o] for o in operands]
                rows[k], levels[k] = max(asked, default=1), 1 + max(deep, default=0)
                if rows[k] <= programs.MAX_DEPTH and levels[k] <= _MOST_LEVELS:
                    break
                kept.add(operands[deep.index(max(deep))])
        return kept

    def program(self) -> formula.Program:
        for k in range(len(self.terms)):
            if k in self.kept:
                self._write(k)
                if not self.free:
                    raise ScriptError(
                        "the formula is too long",
                        expected=f"at most {programs.MAX_KEPT} intermediate results",
                    )
                self.rows[k] = self.free.pop()
                self._append(formula.KEEP, self.rows[k], self.uniform[k])
        self._write_or_take(self.root)
        return formula.Program(
            np.array(self.code, dtype=np.int64).reshape(-1, 2),
            np.array([*map(float.fromhex, self.constants)], dtype=np.float64),
        )

    def _append(self, operation: int, operand: int, uniform: bool) -> None:
        self.code.append((operation + (formula.UNIFORM if uniform else 0), operand))

    def _write_or_take(self, k: int) -> None:
        if k not in self.rows:
            self._write(k)
            return
        self._append(formula.KEPT, self.rows[k], self.uniform[k])
        self.uses[k] -= 1
        if self.uses[k] == 0:
            self.free.append(self.rows.pop(k))

    def _write(self, k: int) -> None:
        operation, operands, value = self.terms[k]
        same = self.uniform[k]
        if operation == "number":
            slot = self.constants.setdefault(value, len(self.constants))
            self._append(formula.CONSTANT, slot, same)
            return
        if operation == "name":
            self._append(*self.push(value), same)
            return
        for operand in operands:
            self._write_or_take(operand)
        if not same:
            for i, operand in enumerate(operands):
                if self.uniform[operand]:
                    self.code.append((formula.SPREAD, len(operands) - 1 - i))
        self._append(OPERATIONS[operation], 0, same)
