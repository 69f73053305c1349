"""A table of runs as lines of ever finer runs, their orders, and the Pareto front."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.app.studies import look
from karamelo_py.app.studies.records import value
from karamelo_py.script.errors import ScriptError, unknown
from karamelo_py.script.terms import number_of

NONE = "mechanical"  # what a script says where a method has no such word


class Order(NamedTuple):
    """The exponent of a power law y = c x^exponent, fitted to logarithms by least squares."""

    exponent: float  # NaN with fewer than two points
    lowest: float  # exponents between neighbouring points
    highest: float

    def __str__(self) -> str:
        if not isfinite(self.exponent):
            return "–"
        if self.highest - self.lowest < 5e-3:
            return f"{self.exponent:.2f}"
        return f"{self.exponent:.2f} ({self.lowest:.2f} to {self.highest:.2f})"


def order(x: Sequence[float], y: Sequence[float]) -> Order:
    """Fit the order of y in x; points that have no logarithm are left out."""
    pairs = sorted((a, b) for a, b in zip(x, y, strict=True) if usable(a) and usable(b))
    logs = np.log(np.array(pairs).reshape(-1, 2))
    if len(np.unique(logs[:, 0])) < 2:
        return Order(np.nan, np.nan, np.nan)
    slope = np.polyfit(logs[:, 0] - logs[:, 0].mean(), logs[:, 1], 1)[0]
    run, rise = np.diff(logs, axis=0).T
    local = rise[run > 0] / run[run > 0]
    return Order(float(slope), float(local.min()), float(local.max()))


def usable(a: float | None) -> bool:
    """Tell whether a number can stand on a logarithmic axis."""
    return a is not None and 0 < a < inf


class Table(NamedTuple):
    """A table of runs, the variables among its columns, and how it was made."""

    rows: list[Mapping[str, str]]
    variables: list[str]
    path: Path = Path()
    made: Mapping[str, Any] = {}

    @property
    def script(self) -> str:
        """The name of the script."""
        return Path(self.made.get("script", "")).name


@dataclass
class GroupedRuns:
    """Runs that differ in one variable only, in its order."""

    choice: dict[str, str]  # values of the other variables that differ between lines
    rows: list[Mapping[str, str]]
    # Numbers of each, NaN where there is none.
    x: np.ndarray
    cost: np.ndarray
    error: np.ndarray
    across: np.ndarray  # one of the first two: what errors are drawn over
    linear: bool = False  # along an axis that shows zero and what is below

    @property
    def label(self) -> str:
        """Write the choice in words."""
        return label(self.choice) or "all"

    @property
    def shown(self) -> np.ndarray:
        """Choose the members that have a place in a diagram of errors."""
        good = np.isfinite(self.error) & (self.error > 0)
        return good & np.isfinite(self.across) & (self.linear | (self.across > 0))


def label(choice: Mapping[str, str]) -> str:
    """Write a choice in words; what says nothing alone says what it is the value of."""
    choice = {n: v for n, v in choice.items() if v != NONE} or choice
    words = {v for v in choice.values() if number_of(v) is None} - {"true", "false", NONE}
    return ", ".join(v if v in words else f"{n} = {v}" for n, v in choice.items())


class Family:
    """A table of runs as lines.

    `accuracy` and `cost` are the columns to compare. Variables `by` tell the lines apart; others
    that differ are added. `along` differs along a line: by default the number with the most values.
    What the sweep has recorded is shown as a formula where it is one.
    """

    def __init__(
        self, table: Table, accuracy: str, cost: str, by: Sequence[str] = (),
        along: str | None = None,
    ):  # fmt: skip
        self.table, self.accuracy, self.cost = table, accuracy, cost
        rows, variables = table.rows, table.variables
        require("-accuracy", [accuracy], rows[0])
        require("-cost", [cost], rows[0])
        require("-by", by, variables)
        require("-x", [along] if along else [], variables)
        self.convergence = bool(along)  # errors over that variable, not over cost
        values = {name: list(dict.fromkeys(row[name] for row in rows)) for name in variables}
        differing = [name for name in variables if len(values[name]) > 1]
        numbers = [
            name for name in differing
            if name not in by and all(number_of(v) is not None for v in values[name])
        ]  # fmt: skip
        self.along = along or max(numbers, key=lambda name: len(values[name]), default=None)
        self.by = [*by, *(n for n in differing if n not in by and n != self.along)]
        ends = values[along] if along else []
        self.words = ends if any(number_of(v) is None for v in ends) else []  # side by side
        # A logarithmic axis has no place for zero.
        self.linear = bool(self.words or any(number_of(v) <= 0 for v in ends))
        groups: dict[tuple[str, ...], list[Mapping[str, str]]] = {}
        for row in rows:
            groups.setdefault(tuple(row[name] for name in self.by), []).append(row)
        self.lines = [
            self._line(dict(zip(self.by, key, strict=True)), members)
            for key, members in groups.items()
        ]
        self.without = [row for row in rows if not usable(value(row, accuracy))]

    def _line(self, choice: dict[str, str], rows: list[Mapping[str, str]]) -> GroupedRuns:
        x = np.zeros(len(rows))
        if self.along:
            rows.sort(key=self.place)
            x = np.array([self.place(row) for row in rows], float)
        cost, error = column(rows, self.cost), column(rows, self.accuracy)
        across = x if self.convergence else cost
        return GroupedRuns(choice, rows, x, cost, error, across, self.linear)

    def place(self, row: Mapping[str, str]) -> float:
        """Find the place of a run along its line: the number, or which of the words it is."""
        end = row[self.along]
        return self.words.index(end) if self.words else number_of(end)

    @property
    def error_label(self) -> str:
        """Name the error for an axis."""
        words = (word.partition("=") for word in self.table.made.get("record", ()))
        formula = {name: formula for name, _, formula in words}.get(self.accuracy)
        return f"{self.accuracy} = {formula}" if formula else look.label(self.accuracy)

    def front(self) -> list[Mapping[str, str]]:
        """Find the Pareto front: runs that none beats in both cost and error, cheapest first."""
        members = [
            (c, e, k, row)
            for line in self.lines
            for k, (c, e, row) in enumerate(zip(line.cost, line.error, line.rows, strict=True))
            if usable(c) and usable(e)
        ]
        best, found = inf, []
        for _, error, _, row in sorted(members, key=lambda m: m[:3]):
            if error < best:
                best = error
                found.append(row)
        return found


def column(rows: Sequence[Mapping[str, Any]], name: str) -> np.ndarray:
    """Read the numbers of a column, NaN where there is none."""
    found = [value(row, name) for row in rows]
    return np.array([np.nan if a is None else a for a in found], float)


def require(option: str, names: Iterable[str], known: Iterable[str]) -> None:
    """See that a table has columns, or variables."""
    for name in names:
        if name not in known:
            raise missing(option, name, list(known))


def missing(option: str, name: str, known: Sequence[str], place: str = "the table") -> ScriptError:
    """Make the error for a column or a variable that a table does not have."""
    return unknown(f"{option}: {place} has no '{name}'", name, known)
