"""Lines of runs with increasing refinement, their orders, and the Pareto front."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.app.studies.case import COLUMNS, Row
from karamelo_py.app.studies.records import SIGNED, value
from karamelo_py.app.studies.variables import ScriptFiles, title_of
from karamelo_py.output.units import labelled
from karamelo_py.script.errors import ScriptError, unknown
from karamelo_py.script.terms import number_of

NONE = "mechanical"  # label of other methods


class Order(NamedTuple):
    """Exponent in y = c x^exponent, by a least-squares fit of the logarithms."""

    exponent: float  # NaN with fewer than two points
    lowest: float  # smallest exponent between neighbouring points
    highest: float

    @property
    def of_fall(self) -> "Order":
        return Order(-self.exponent, -self.highest, -self.lowest)

    def towards(self, x: Sequence[float]) -> "Order":
        return self.of_fall if x[-1] > x[0] else self

    def __str__(self) -> str:
        if not isfinite(self.exponent):
            return "–"
        if self.highest - self.lowest < 5e-3:
            return f"{self.exponent:.2f}"
        return f"{self.exponent:.2f} ({self.lowest:.2f} to {self.highest:.2f})"


def order(x: Sequence[float], y: Sequence[float]) -> Order:
    pairs = sorted((a, b) for a, b in zip(x, y, strict=True) if usable(a) and usable(b))
    logs = np.log(np.array(pairs).reshape(-1, 2))
    if len(np.unique(logs[:, 0])) < 2:
        return Order(np.nan, np.nan, np.nan)
    slope = np.polyfit(logs[:, 0] - logs[:, 0].mean(), logs[:, 1], 1)[0]
    run, rise = np.diff(logs, axis=0).T
    local = rise[run > 0] / run[run > 0]
    return Order(float(slope), float(local.min()), float(local.max()))


# Orders that smooth solutions reach (p + 1 for polynomials of order p).
REACHED = {
    "linear": 2, "ugimp": 2, "cpgimp": 2, "quadratic-spline": 3, "Bernstein-quadratic": 3,
    "cubic-spline": 4,
}  # fmt: skip
CHANCES = {
    "sign": "the sign of the error changes",
    "falls": "the error falls faster than the order of its basis",
    "coarser": "a coarser run is better",
    "finer": "a finer run is worse",
}
BEYOND = 0.5  # tolerance by which an order may exceed these
WORSE = 1.1  # ratio of errors above which one counts as worse


def reached(words: Iterable[str]) -> float:
    return min((REACHED[word] for word in words if word in REACHED), default=4)


def by_chance(x: Sequence[float], values: Sequence[float], highest: float) -> list[str]:
    """Return, for each run from coarse to fine, why its error is small by chance, or "".

    Possible reasons: a finer run is worse; or no finer run is as good, and the sign changes, the
    error falls faster than the order of the basis (`highest`), or it grows.
    """
    reasons, size = [], np.abs(np.asarray(values, float))
    for k, error in enumerate(size):
        reason, finer = "", size[k + 1 :]
        if k and not (finer[:1] <= WORSE * error).any():
            ratio = abs(np.log(x[k] / x[k - 1]))
            if values[k] * values[k - 1] < 0:
                reason = CHANCES["sign"]
            elif error > 0 and np.log(size[k - 1] / error) > (highest + BEYOND) * ratio:
                reason = CHANCES["falls"]
            elif (WORSE * size[:k] < error).any():
                reason = CHANCES["coarser"]
        if (finer > WORSE * error).any():
            reason = CHANCES["finer"]
        reasons.append(reason if np.isfinite(error) else "")
    return reasons


def credible(x: Sequence[float], values: Sequence[float], highest: float) -> np.ndarray:
    """Return error magnitudes, raised where they are small by chance.

    Each magnitude is at least as large as the error of every finer run, and at least (change from
    the previous run) / (r^p - 1), with the refinement r and the order p = `highest` + 0.5.
    """
    values = np.asarray(values, float)
    size = np.abs(values)
    if len(size) > 1:
        ratio = np.exp(np.abs(np.diff(np.log(np.asarray(x, float)))))
        size[1:] = np.fmax(size[1:], np.abs(np.diff(values)) / (ratio ** (highest + BEYOND) - 1))
    size[~np.isfinite(values)] = np.nan
    return np.fmax.accumulate(size[::-1])[::-1] + 0 * values


def usable(a: float | None) -> bool:
    return a is not None and 0 < a < inf


class Table(NamedTuple):
    rows: list[Mapping[str, str]]
    variables: list[str]
    path: Path = Path()
    made: Mapping[str, Any] = {}

    @property
    def title(self) -> str:
        return title_of(Path(self.made.get("script", "")))

    def label(self, name: str) -> str:
        path = Path(self.made.get("script", ""))
        unit = ScriptFiles(path).unit(name) if path.is_file() else ""
        return labelled(COLUMNS.get(name, name), unit)


@dataclass
class GroupedRuns:
    choice: dict[str, str]  # variables that differ between lines
    rows: list[Mapping[str, str]]
    x: np.ndarray
    cost: np.ndarray
    error: np.ndarray
    across: np.ndarray
    linear: bool = False
    chance: Sequence[str] = ()  # reasons why errors are small by chance (`by_chance`)

    @property
    def lucky(self) -> np.ndarray:
        return np.array([*map(bool, self.chance)], bool)

    @property
    def rises(self) -> bool:
        done = column(self.rows, "particle_steps")
        return not order(self.x, done if np.isfinite(done).all() else self.cost).exponent < 0

    @property
    def label(self) -> str:
        return label(self.choice) or "all"

    @property
    def shown(self) -> np.ndarray:
        good = np.isfinite(self.error) & (self.error > 0)
        return good & np.isfinite(self.across) & (self.linear | (self.across > 0))


def label(choice: Mapping[str, str]) -> str:
    """Label a choice; a value without meaning alone gets its variable's name."""
    choice = {n: v for n, v in choice.items() if v != NONE} or choice
    words = {v for v in choice.values() if number_of(v) is None} - {"true", "false", NONE}
    return ", ".join(v if v in words else f"{n} = {v}" for n, v in choice.items())


class Family:
    """Lines of runs, distinguished by the variables `by` and by all others that differ.

    `along` changes along a line; by default, it is the number with the most values.
    """

    def __init__(
        self, table: Table, accuracy: str, cost: str, *, by: Sequence[str] = (),
        along: str | None = None,
    ):  # fmt: skip
        self.table, self.accuracy, self.cost = table, accuracy, cost
        rows, variables = table.rows, table.variables
        require("-accuracy", [accuracy], rows[0])
        require("-cost", [cost], rows[0])
        require("-by", by, variables)
        require("-x", [along] if along else [], variables)
        self.convergence = bool(along)  # True: errors against `along`; False: errors against cost
        values = {name: list(dict.fromkeys(row[name] for row in rows)) for name in variables}
        differing = [name for name in variables if len(values[name]) > 1]
        numbers = [
            name for name in differing
            if name not in by and all(number_of(v) is not None for v in values[name])
        ]  # fmt: skip
        self.along = along or max(numbers, key=lambda name: len(values[name]), default=None)
        self.by = [*by, *(n for n in differing if n not in by and n != self.along)]
        ends = values[along] if along else []
        self.words = ends if any(number_of(v) is None for v in ends) else []
        self.linear = bool(self.words or any(number_of(v) <= 0 for v in ends))
        groups: dict[tuple[str, ...], list[Mapping[str, str]]] = {}
        for row in rows:
            groups.setdefault(tuple(row[name] for name in self.by), []).append(row)
        self.lines = [
            self._line(dict(zip(self.by, key, strict=True)), members)
            for key, members in groups.items()
        ]
        self.without = [row for row in rows if not usable(abs(value(row, accuracy) or 0.0))]

    def _line(self, choice: dict[str, str], rows: list[Mapping[str, str]]) -> GroupedRuns:
        x = np.zeros(len(rows))
        if self.along:
            rows.sort(key=self.abscissa)
            x = np.array([self.abscissa(row) for row in rows], float)
        cost, signed = column(rows, self.cost), errors(rows, self.accuracy)
        across = x if self.convergence else cost
        chance = self._chance(rows, x, signed)
        return GroupedRuns(choice, rows, x, cost, np.abs(signed), across, self.linear, chance)

    def _chance(self, rows: Sequence[Mapping], x: np.ndarray, signed: np.ndarray) -> list[str]:
        points = column(rows, "points")
        rise = np.diff(points[np.isfinite(points)])
        if self.words or len(rise) < 1 or not ((rise > 0).all() or (rise < 0).all()):
            return [""] * len(rows)
        way = 1 if rise[0] > 0 else -1
        highest = reached(rows[0][name] for name in self.table.variables)
        return by_chance(x[::way], signed[::way], highest)[::way]

    def abscissa(self, row: Mapping[str, str]) -> float:
        end = row[self.along]
        return self.words.index(end) if self.words else number_of(end)

    @property
    def error_label(self) -> str:
        words = (word.partition("=") for word in self.table.made.get("record", ()))
        formula = {name: formula for name, _, formula in words}.get(self.accuracy)
        if not formula:
            return self.table.label(self.accuracy)
        signed = any((value(row, self.accuracy) or 0.0) < 0 for row in self.table.rows)
        return f"{self.accuracy} = {f'abs({formula})' if signed else formula}"

    def front(self) -> list[Mapping[str, str]]:
        members = [
            (c, e, k, row)
            for line in self.lines
            for k, (c, e, row, lucky) in enumerate(
                zip(line.cost, line.error, line.rows, line.lucky, strict=True)
            )
            if usable(c) and usable(e) and not lucky
        ]
        best, front = inf, []
        for _, error, _, row in sorted(members, key=lambda m: m[:3]):
            if error < best:
                best = error
                front.append(row)
        return front


def errors(rows: Sequence[Row], name: str) -> np.ndarray:
    signed = column(rows, name + SIGNED)
    return np.where(np.isfinite(signed), signed, column(rows, name))


def sizes(rows: Sequence[Row], name: str) -> np.ndarray:
    return np.abs(column(rows, name))


def column(rows: Sequence[Row], name: str) -> np.ndarray:
    numbers = [value(row, name) for row in rows]
    return np.array([np.nan if a is None else a for a in numbers], float)


def require(option: str, names: Iterable[str], names_of_table: Iterable[str]) -> None:
    for name in names:
        if name not in names_of_table:
            raise missing(option, name, list(names_of_table))


def missing(option: str, name: str, names: Sequence[str], where: str = "the table") -> ScriptError:
    return unknown(f"{option}: {where} has no '{name}'", name, names)
