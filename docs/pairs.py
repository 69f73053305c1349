"""Draw two values of a variable next to each other, scene by scene: errors, and ratios of costs."""

import sys
from argparse import ArgumentParser
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.studies import look
from karamelo_py.app.studies.chart import read
from karamelo_py.app.studies.curves import Table, label, require, sizes, usable
from karamelo_py.app.studies.pictures import SUFFIXES
from karamelo_py.app.studies.study import plain_table, shown, terminal
from karamelo_py.app.studies.variables import add_axes, along, out_file
from karamelo_py.output.files import savefig
from karamelo_py.output.plots import blank_figure, tidy
from karamelo_py.script.errors import ScriptError, plural


@dataclass
class Pair:
    """The runs of a scene for two values of one variable, with numbers of both, or NaN."""

    label: str  # the scene, and what else was chosen
    error: tuple[float, float]
    cost: tuple[float, float]
    bytes: tuple[float, float]

    @property
    def cost_ratio(self) -> float:
        """The cost of the second over that of the first."""
        return self.cost[1] / self.cost[0]


def pairs(table: Table, name: str, accuracy: str, cost: str) -> tuple[list[Pair], list[str]]:
    """Find the pairs of a table, and the two values in their order."""
    rows, variables = table.rows, table.variables
    require("-accuracy", [accuracy], rows[0])
    require("-cost", [cost], rows[0])
    require("-versus", [name], variables)
    values = list(dict.fromkeys(row[name] for row in rows))
    if len(values) != 2:
        raise ScriptError(
            f"-versus {name}: {table.path.name} has {plural(len(values), 'value')} of it",
            expected="two",
        )
    others = [n for n in variables if n != name]
    cases: dict[tuple[str, ...], dict[str, Mapping[str, str]]] = {}
    for row in rows:
        cases.setdefault(tuple(row[n] for n in others), {})[row[name]] = row
    differing = [n for k, n in enumerate(others) if len({case[k] for case in cases}) > 1]
    scene = table.script or table.path.name
    found = []
    for case, two in cases.items():
        if len(two) < 2:
            continue
        said = dict(zip(others, case, strict=True))
        parts = filter(None, [scene, label({name: said[name] for name in differing})])
        numbers = [
            tuple(_number(two[word], column) for word in values)
            for column in (accuracy, cost, "bytes_per_particle")
        ]
        found.append(Pair(", ".join(parts), *numbers))
    return found, values


def _number(row: Mapping[str, str], column: str) -> float:
    (found,) = sizes([row], column)
    return found if usable(found) else np.nan


def tell_pairs(found: Sequence[Pair], values: Sequence[str], accuracy: str, cost: str) -> None:
    """Print the pairs as a table."""
    ratio = f"{values[1]}/{values[0]}"
    headings = [f"{what}, {word}" for what in (accuracy, cost) for word in values]
    table = plain_table([""], [*headings, f"{cost}, {ratio}", f"bytes, {ratio}"])
    for pair in found:
        numbers = [*pair.error, *pair.cost, pair.cost_ratio, pair.bytes[1] / pair.bytes[0]]
        table.add_row(pair.label, *(shown(float(f"{a:.3g}")) for a in numbers))
    terminal().print(table)


def draw_pairs(
    found: Sequence[Pair], values: Sequence[str], path: Path, words: Sequence[str], accuracy: str,
    title: str,
) -> None:  # fmt: skip
    """Draw errors of both values on the left, and the ratio of their costs on the right."""
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


def main(words: Sequence[str] | None = None) -> int:
    """Draw the tables of sweeps; returns the exit status."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("tables", type=Path, nargs="+", help="what karamelo-py sweep has written")
    parser.add_argument("-versus", required=True, metavar="NAME", help="variable with two values")
    parser.add_argument("-accuracy", required=True, metavar="COLUMN", help="column of the error")
    parser.add_argument("-cost", default="seconds", metavar="COLUMN", help="column of the cost")
    parser.add_argument("-where", action="append", default=[], help="only these rows")
    add_axes(parser)
    parser.add_argument("-title")
    parser.add_argument("-o", type=Path, help="the picture")
    try:
        return side_by_side(parser.parse_args(words))
    except ScriptError as error:
        print(error.render(), file=sys.stderr)
        return 1


def side_by_side(options: Any) -> int:
    """Draw two values of a variable beside each other, for the scenes of all tables."""
    out = out_file(options.o, *SUFFIXES) if options.o else None
    found, known = [], []
    for path in options.tables:
        table = read(path, options.where)
        some, values = pairs(table, options.versus, options.accuracy, options.cost)
        if known and values != known:
            expected = ", ".join(known) + ", as in the first table"
            raise ScriptError(f"{path}: {options.versus} is {', '.join(values)}", expected=expected)
        known = values
        found += some
    if out is not None:
        cost = look.label(options.cost).removesuffix(" (s)")
        words = along(
            options, look.label(options.accuracy), f"{cost},\n{known[1]} over {known[0]} (1)"
        )
        draw_pairs(found, known, out, words, options.accuracy, options.title or "")
    tell_pairs(found, known, options.accuracy, options.cost)
    if out is not None:
        print(f"drawn: {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
