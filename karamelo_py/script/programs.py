"""Formulas as programs: what a formula needs more than once is computed once and kept.

A formula is a graph: a variable that is used twice is one term with two users. Terms with several
users are computed first, each into a row of its own; so are operands that would not fit on the
stack. What remains are trees without branches that meet again.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from karamelo_py.compiler import formula
from karamelo_py.compiler.operations import OPERATIONS
from karamelo_py.script.errors import ScriptError

# Levels that are put on the stack without a row between; Python's own stack is spared, too.
_MOST_LEVELS = 60


def in_order(root: Any) -> list[Any]:
    """List the terms below `root` and itself, each once, operands before what is made of them."""
    found: dict[int, Any] = {}
    open_terms = [(root, False)]
    while open_terms:
        term, done = open_terms.pop()
        if id(term) in found:
            continue
        if done:
            found[id(term)] = term
        else:
            open_terms.append((term, True))
            open_terms += [(operand, False) for operand in reversed(term.operands)]
    return list(found.values())


def program(root: Any, place: Callable[[str], tuple[int, int]], *, depth: int | None = None) -> Any:
    """Write the stack program of a term.

    Parameters
    ----------
    root
        The term (`karamelo_py.script.expressions`).
    place
        The instruction that pushes a name: GLOBAL or POINT, and where it is.
    depth
        Of a stack without rows behind it; the program keeps nothing then.

    Raises
    ------
    ScriptError
        If more has to be kept at a time than there are rows.
    """
    return _Writer(root, place, depth).program()


class _Writer:
    """One program while it is written: terms by their numbers, equal ones counted as one."""

    def __init__(self, root: Any, place: Callable[[str], tuple[int, int]], depth: int | None):
        self.bare = depth is not None
        self.depth = depth or formula.MAX_DEPTH
        self.place = place
        self.terms: list[tuple[str, tuple[int, ...], Any]] = []
        self.uses: list[int] = []
        self.uniform: list[bool] = []
        self.code: list[tuple[int, int]] = []
        self.constants: dict[_Exact, int] = {}
        self.rows: dict[int, int] = {}  # of terms that are kept now
        self.free = list(range(formula.MAX_KEPT))[::-1]
        self.root = self._number(root)
        self.kept = self._chosen()

    def _number(self, root: Any) -> int:
        """Give a number to each term; to terms that are alike the same."""
        numbers: dict[int, int] = {}
        known: dict[tuple, int] = {}
        for term in in_order(root):
            operands = tuple(numbers[id(operand)] for operand in term.operands)
            value = _Exact(term.value) if term.operation == "number" else term.value
            key = term.operation, operands, value
            if key not in known:
                known[key] = len(self.terms)
                self.terms.append(key)
                self.uses.append(0)
                self.uniform.append(self._is_uniform(*key))
                for operand in operands:
                    self.uses[operand] += 1
            numbers[id(term)] = known[key]
        return numbers[id(root)]

    def _is_uniform(self, operation: str, operands: tuple[int, ...], value: Any) -> bool:
        if operation == "name":
            return self.place(value)[0] != formula.POINT
        return all(self.uniform[operand] for operand in operands)

    def _chosen(self) -> set[int]:
        """Choose terms to keep: those with several users, and what the stack cannot hold."""
        kept = set()
        if not self.bare:
            kept = {k for k, (_, below, _) in enumerate(self.terms) if below and self.uses[k] > 1}
        rows, levels = [1] * len(self.terms), [1] * len(self.terms)
        for k, (_, operands, _) in enumerate(self.terms):
            while True:
                # Operands wait on the stack while the next one is computed.
                asked = [i + (1 if o in kept else rows[o]) for i, o in enumerate(operands)]
                deep = [0 if o in kept else levels[o] for o in operands]
                rows[k], levels[k] = max(asked, default=1), 1 + max(deep, default=0)
                if rows[k] <= self.depth and levels[k] <= _MOST_LEVELS:
                    break
                if self.bare:
                    raise ScriptError(
                        "the formula is too long", expected=f"nested {self.depth} deep at most"
                    )
                kept.add(operands[deep.index(max(deep))])
        return kept

    def program(self) -> Any:
        """Write the program."""
        for k in range(len(self.terms)):
            if k in self.kept:
                self._write(k)
                if not self.free:
                    raise ScriptError(
                        "the formula is too long",
                        expected=f"at most {formula.MAX_KEPT} results that wait for their use",
                    )
                self.rows[k] = self.free.pop()
                self._append(formula.KEEP, self.rows[k], self.uniform[k])
        self._write_or_take(self.root)
        return formula.Program(
            np.array(self.code, dtype=np.int64).reshape(-1, 2),
            np.array(list(self.constants), dtype=np.float64),
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
            self._append(*self.place(value), same)
            return
        for operand in operands:
            self._write_or_take(operand)
        if not same:
            for i, operand in enumerate(operands):
                if self.uniform[operand]:
                    self.code.append((formula.SPREAD, len(operands) - 1 - i))
        self._append(OPERATIONS[operation], 0, same)


class _Exact(float):
    """A float that equals only its own bits: 0.0 and -0.0 are different numbers."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, float) and self.hex() == other.hex()

    def __hash__(self) -> int:
        return hash(self.hex())
