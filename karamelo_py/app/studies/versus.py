"""Two values of a variable side by side, scene by scene: gain and cost."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.studies import look
from karamelo_py.app.studies.curves import missing, require, usable
from karamelo_py.app.studies.records import value
from karamelo_py.app.studies.study import plain_table, shown, terminal
from karamelo_py.output.files import savefig
from karamelo_py.output.plots import blank_figure, tidy
from karamelo_py.script.errors import ScriptError, plural
from karamelo_py.script.terms import number_of


@dataclass
class Pair:
    """The runs of a scene that differ in one variable only.

    Attributes
    ----------
    label
        The scene, and what else was chosen.
    error, cost, bytes
        Of the first and the second value, NaN where there is none.
    """

    label: str
    error: tuple[float, float]
    cost: tuple[float, float]
    bytes: tuple[float, float]

    @property
    def cost_ratio(self) -> float:
        """The cost of the second over that of the first."""
        return self.cost[1] / self.cost[0]


def pairs(
    rows: Sequence[Mapping[str, str]],
    made: Mapping[str, Any],
    variables: Sequence[str],
    name: str,
    accuracy: str,
    cost: str,
) -> tuple[list[Pair], list[str]]:
    """The pairs of a table, and the two values in their order.

    Raises
    ------
    ScriptError
        If the table lacks a column, or the variable has not two values.
    """
    for option, column in (("-accuracy", accuracy), ("-cost", cost)):
        require(rows, option, column)
    if name not in variables:
        raise missing("-versus", name, variables)
    values = list(dict.fromkeys(row[name] for row in rows))
    if len(values) != 2:
        raise ScriptError(
            f"-versus {name}: {made['table']} has {plural(len(values), 'value')} of it",
            expected="two",
        )
    others = [n for n in variables if n != name]
    cases: dict[tuple[str, ...], dict[str, Mapping[str, str]]] = {}
    for row in rows:
        cases.setdefault(tuple(row[n] for n in others), {})[row[name]] = row
    differing = [n for k, n in enumerate(others) if len({case[k] for case in cases}) > 1]
    scene = Path(made.get("script") or made["table"]).name
    found = []
    for case, two in cases.items():
        if len(two) < 2:
            continue
        said = dict(zip(others, case, strict=True))
        parts = [said[n] if number_of(said[n]) is None else f"{n} = {said[n]}" for n in differing]
        numbers = [
            tuple(_number(two[word], column) for word in values)
            for column in (accuracy, cost, "bytes_per_particle")
        ]
        found.append(Pair(", ".join([scene, *parts]), *numbers))
    return found, values


def _number(row: Mapping[str, str], column: str) -> float:
    found = value(row, column)
    return found if usable(found) else np.nan


def tell(found: Sequence[Pair], values: Sequence[str], accuracy: str, cost: str) -> None:
    """Print the pairs as a table."""
    ratio = f"{values[1]}/{values[0]}"
    headings = [f"{what}, {word}" for what in (accuracy, cost) for word in values]
    table = plain_table([""], [*headings, f"{cost}, {ratio}", f"bytes, {ratio}"])
    for pair in found:
        numbers = [*pair.error, *pair.cost, pair.cost_ratio, pair.bytes[1] / pair.bytes[0]]
        table.add_row(pair.label, *(shown(float(f"{a:.3g}")) for a in numbers))
    terminal().print(table)


def draw(
    found: Sequence[Pair],
    values: Sequence[str],
    path: Path,
    words: Sequence[str],
    accuracy: str,
    title: str,
) -> None:
    """Draw errors of both values on the left, and the ratio of their costs on the right.

    `words` stand along these axes.
    """
    figure = blank_figure(9.0, 1.1 + 0.3 * len(found))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    errors = np.array([pair.error for pair in found])
    good = errors[np.isfinite(errors)]
    if not len(good):
        raise ScriptError(f"no run has a value of '{accuracy}' above 0")
    look.log_axis(left.xaxis, float(good.min()), float(good.max()))
    up = np.arange(len(found))[::-1]
    for k, (word, filled) in enumerate(zip(values, (True, False), strict=True)):
        colour = look.PALETTE[1 + k]
        left.plot(
            errors[:, k], up, look.MARKERS[k], color=colour, label=word, markersize=9 - 2 * k,
            markerfacecolor=colour if filled else "white", markeredgewidth=1.6, zorder=3 + k,
        )  # fmt: skip
    ratios = np.array([pair.cost_ratio for pair in found])
    right.barh(up, np.nan_to_num(ratios), height=0.55, color="0.7", zorder=2)
    for at, a in zip(up, ratios, strict=True):
        if np.isfinite(a):
            right.text(0.04, at, f"{a:.2f}", va="center", fontsize=8, zorder=4)
    right.axvline(1.0, color="0.3", linewidth=1, linestyle=look.DASHES[1], zorder=3)
    right.set_xlim(0, 1.15 * max(1.0, float(np.nanmax(ratios, initial=1.0))))
    left.set_yticks(up, [pair.label for pair in found])
    left.set_ylim(-0.7, len(found) - 0.3)
    left.set_xlabel(words[0])
    right.set_xlabel(words[1])
    left.set_title(title, loc="left", fontsize=10)
    # Above the axes: within them it would hide points.
    left.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, fontsize=9)
    for axes in (left, right):
        tidy(axes)
        axes.tick_params(axis="y", length=0)
    savefig(figure, path)
