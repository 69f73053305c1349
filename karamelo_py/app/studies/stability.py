"""karamelo-py stability: where a script is stable, where its energy grows, where it fails."""

import re
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import isclose, isfinite, nan, prod
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.logs import read_log
from karamelo_py.app.options import above_zero, positive
from karamelo_py.app.studies import records, stretches
from karamelo_py.app.studies.frontier import Cell, explore, unseen
from karamelo_py.app.studies.options import (
    add_axes,
    add_family,
    along,
    family,
    new_parser,
    out_file,
)
from karamelo_py.app.studies.study import Study
from karamelo_py.app.studies.variables import logged
from karamelo_py.output.files import savefig
from karamelo_py.output.plots import blank_figure
from karamelo_py.script.errors import ScriptError, nearest, plural
from karamelo_py.script.terms import number_of

DESCRIPTION = """\
Maps where a script is stable over one or two of its variables: stable, growing (its energy exceeds
a bound), or failed, with the reason. A mistake of the script ends the study. Edges are searched by
halves, from coarse to fine: cells between like ones are not run, and "run 7 of at most 400" is one
of about 100. The table is written beside the picture (map.csv), and says which cells were run; -var
with one value is passed on.

  karamelo-py stability in.file -var dt_factor=0.1:2:20 -var xi=0:1:20 -o map.png

The script logs an energy that should stay about the same, such as Ek + Es."""
ENERGIES = ("Etot", "E_total", "Ek+Es", "Ek_s+Es_s", "Ek+Es+Ed", "Ek", "Ek_s")
CLASSES = ("stable", "growing", "failed")
FIRST = 0.1  # of the rows of a log: energies are means over so many
FEW = 9  # values of a variable that stand at the axis one by one
COLOURS = {"stable": "#d9ecf7", "growing": "#f0a53c", "failed": "#7d2a3a"}  # light to dark
# What the program says of failures, in short.
REASONS = {
    r"det F": "det F <= 0",
    r"not a number|NaN": "NaN",
    r"thrown out|leaves the domain|left the domain": "point lost",
    r"cells in one step": "point moves more than a cell",
    r"stable step has fallen": "stable step collapsed",
    r"stable limit, which has fallen": "step above the limit",
    r"tangled": "domain of a point tangled",
    r"has come from nowhere": "energy from nowhere",
    r"temperature": "temperature out of bounds",
}


def add_parser(subparsers: Any) -> None:
    """The subcommand for the command line."""
    parser = new_parser(subparsers, "stability", "map where a method is stable", DESCRIPTION, run)
    add_family(parser)
    parser.add_argument("-energy", metavar="COLUMN", help="log column that should not grow")
    parser.add_argument(
        "-bound", type=above_zero, default=2.0,
        help="growing: energy above this times that of the first tenth of the log, in the mean (2)",
    )  # fmt: skip
    parser.add_argument("-stride", type=positive, default=6, help="cells between first runs (6)")
    add_axes(parser)
    parser.add_argument("-o", type=Path, default=Path("map.png"), help="the picture (map.png)")


def run(options: Any) -> int:
    """Do what the command line says; returns the exit status."""
    out = out_file(options.o, ".png", ".svg", ".pdf")
    values, launch, jobs = family(options)
    axes = [name for name in values if len(values[name]) > 1]
    for name in axes:
        if any(number_of(value) is None for value in values[name]):
            raise ScriptError(f"-var {name}: not numbers", expected=f"-var {name}=0.1:2:20")
    if not 1 <= len(axes) <= 2:
        raise ScriptError(
            f"{len(axes)} variables have several values",
            expected="one or two, such as -var dt_factor=0.1:2:20 -var xi=0:1:20",
        )
    for name in axes:
        values[name].sort(key=float)
    energy = energy_column(options.energy, logged(options.script), options.script)
    words = along(options, axes[0], axes[1] if len(axes) > 1 else "")
    table = out.with_suffix(".csv")
    items = [records.Recorded(f"max:{energy}")]
    cells = prod(len(values[name]) for name in axes)
    study = Study(
        launch, out.with_suffix(""), items, jobs, again=options.again, strict=True, most=cells
    )
    records.describe(
        table, script=str(options.script), variables=values, energy=energy, bound=options.bound,
        threads=launch.threads, jobs=jobs,
    )  # fmt: skip
    chart = Map(study, values, axes, energy, options.bound, out.parent)
    known, inferred = explore(chart.shape, chart.classify, options.stride)
    rows = chart.rows(known, inferred)
    records.write(table, rows)
    chart.draw(known, inferred, out, options.script.name, words)
    chart.tell(known, inferred)
    width = unseen(chart.shape, options.stride)
    if inferred and width:
        wide = plural(width, "cell")
        print(f"islands and strips up to {wide} wide between runs are not seen (-stride)")
    print(f"drawn: {out}; the table is {table}")
    return 0


def energy_column(asked: str | None, headings: Sequence[str] | None, script: Path) -> str:
    """The log column to watch.

    Raises
    ------
    ScriptError
        If the script does not log it, or logs no energy that is known by its name.
    """
    if asked is not None:
        return records.recorded(asked, headings, script, option="-energy")[0].columns[0]
    for name in ENERGIES:
        if headings is None or name in headings:
            return name
    close = nearest("Ek+Es", headings or [])
    raise ScriptError(
        f"{script} logs no energy under a usual name",
        expected="-energy COLUMN, or log_modify(custom, step, dt, time, Ek + Es) in the script",
        hint=f"-energy {close}" if close else None,
    )


def growth(energy: np.ndarray) -> float:
    """The largest mean of an energy over the mean of its first tenth; infinite for NaN."""
    first, later = stretches.most(energy, FIRST)
    if first == 0:
        return np.inf if later > 0 else 0.0
    return 1 + stretches.grown(first, later)


def in_short(row: Mapping[str, Any]) -> str:
    """The reason of a failure in a few words."""
    if row["status"] == "too long":
        return "too long"
    for pattern, words in REASONS.items():
        if re.search(pattern, row["reason"]):
            return words
    cause = re.sub(r"^(run\w*: )?step \d+, time [^:]+: ", "", str(row["reason"]))
    return textwrap.shorten(cause, 60, placeholder=" …")


def limited_by(folder: Path) -> str:
    """Read by name what limits the first step of a run; nothing where the script says the step."""
    try:
        said = (folder / "out.txt").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    match = re.search(r"^  limited by +(\w+);", said, re.M)
    return match[1] if match and match[1] not in ("set_dt", "end") else ""


class Map:
    """The plane of a stability map.

    Parameters
    ----------
    study
        Runs the cases.
    values, axes
        Values of all variables, and the names of the one or two that vary.
    energy, bound
        The log column to watch, and how much it may grow.
    folder
        What folders in the table are relative to.
    """

    def __init__(
        self, study: Study, values: dict[str, list[str]], axes: list[str], energy: str,
        bound: float, folder: Path,
    ):  # fmt: skip
        self.study, self.values, self.axes = study, values, axes
        self.energy, self.bound, self.folder = energy, bound, folder
        self.shape = (len(values[axes[0]]), len(values[axes[1]]) if len(axes) > 1 else 1)
        self.found: dict[Cell, dict[str, Any]] = {}

    def case(self, cell: Cell) -> dict[str, str]:
        """The values of the variables of a cell."""
        at = dict(zip(self.axes, cell, strict=False))
        return {name: values[at.get(name, 0)] for name, values in self.values.items()}

    def classify(self, cells: Sequence[Cell]) -> list[str]:
        """Run cells; the class of each."""
        rows = self.study.run([self.case(cell) for cell in cells])
        classes = []
        for cell, row in zip(cells, rows, strict=True):
            log = read_log(self.folder / row["folder"])
            if row["status"] == "done" and self.energy not in log:
                raise ScriptError(
                    f"the log has no column '{self.energy}'", expected=", ".join(log) or "a log"
                )
            factor = growth(log.get(self.energy, np.empty(0)))
            kind = "failed" if row["status"] != "done" else "stable"
            if kind == "stable" and factor > self.bound:
                kind = "growing"
            reason = in_short(row) if kind == "failed" else ""
            if kind == "growing":
                reason = f"{self.energy} grows {factor:.3g} times"
            name = limited_by(self.folder / row["folder"])
            found = {**row, "class": kind, "why": reason, "growth": factor, "limit": name}
            self.found[cell] = found
            classes.append(kind)
        return classes

    def rows(self, known: Mapping[Cell, Any], inferred: Mapping[Cell, Any]) -> list[dict]:
        """The table: every cell, whether it was run, and what it showed."""
        rows = []
        for cell in sorted({**known, **inferred}):
            row = self.found.get(cell, {})
            rows.append(
                {
                    **self.case(cell),
                    "class": known.get(cell) or inferred.get(cell),
                    "run": "yes" if cell in known else "no",
                    "reason": row.get("why", ""),
                    "growth": row.get("growth"),
                    "dt": row.get("dt"),
                    "stable_dt": row.get("stable_dt"),
                    "own_dt": row.get("own_dt"),
                    "limit": row.get("limit", ""),
                    "message": row.get("reason", ""),
                    "folder": row.get("folder", ""),
                }
            )
        return rows

    def where(self, step: str, j: int) -> float | None:
        """The first variable where the first step is the one of this column, in row j."""
        x = [float(v) for v in self.values[self.axes[0]]]
        points = []
        for (i, other), row in sorted(self.found.items()):
            dt, same = row.get("dt"), row.get(step)
            if other == j and dt and same and isfinite(dt / same):
                points.append((x[i], dt / same))
        for (xa, a), (xb, b) in pairwise(points):
            if (a - 1) * (b - 1) <= 0 and a != b:
                return xa + (1 - a) / (b - a) * (xb - xa)
        return None

    def margins(self, classes: Mapping[Cell, Any]) -> list[float]:
        """The largest stable step over the program's stable step, in each row that has an edge."""
        found = []
        for j in range(self.shape[1]):
            column = [classes[i, j] for i in range(self.shape[0])]
            edge = next((i for i, kind in enumerate(column) if kind != "stable"), None)
            row = self.found.get((edge - 1, j)) if edge else None
            if row and row.get("dt") and row.get("stable_dt"):
                found.append(row["dt"] / row["stable_dt"])
        return found

    def tell(self, known: Mapping[Cell, Any], inferred: Mapping[Cell, Any]) -> None:
        """Print how many cells are of each class and why runs failed."""
        classes = {**inferred, **known}
        count = Counter(classes.values())
        print(f"{len(known)} of {len(classes)} cells were run (the others lie between like ones)")
        for kind in CLASSES:
            if count[kind]:
                print(f"  {kind:<8} {plural(count[kind], 'cell')}")
        why = Counter(row["why"] for row in self.found.values() if row["class"] == "failed")
        for reason, times in why.most_common():
            print(f"    {reason}: {plural(times, 'run')}")
        margins = self.margins(classes)
        if margins:
            low, high = min(margins), max(margins)
            ends = f"{low:.3g}" if high - low < 1e-3 else f"{low:.3g} to {high:.3g}"
            print(f"the largest stable first step is {ends} times the program's stable step")

    def draw(
        self,
        known: Mapping[Cell, Any],
        inferred: Mapping[Cell, Any],
        path: Path,
        title: str,
        words: tuple[str, str],
    ) -> None:
        """Draw the map, with `words` along its axes."""
        from matplotlib.colors import ListedColormap
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        classes = {**inferred, **known}
        x = [float(v) for v in self.values[self.axes[0]]]
        two = len(self.axes) > 1
        y = [float(v) for v in self.values[self.axes[1]]] if two else [0.0]
        grid = np.array(
            [[CLASSES.index(classes[i, j]) for i in range(len(x))] for j in range(len(y))]
        )
        figure = blank_figure(9.0, 5.6 if two else 2.8)
        axes = figure.subplots()
        axes.pcolormesh(
            edges(x), edges(y), grid, cmap=ListedColormap([COLOURS[k] for k in CLASSES]),
            vmin=-0.5, vmax=2.5,
        )  # fmt: skip
        reasons = Counter(row["why"] for row in self.found.values() if row["class"] == "failed")
        number_of = {reason: str(k) for k, (reason, _) in enumerate(reasons.most_common(), 1)}
        for (i, j), row in self.found.items():
            if row["class"] == "failed":
                axes.text(x[i], y[j], number_of[row["why"]], ha="center", va="center",
                          fontsize=7, color="white")  # fmt: skip
            else:
                axes.plot(x[i], y[j], "k.", markersize=4)
        handles = [
            Patch(facecolor=COLOURS[k], edgecolor="0.4", label=k)
            for k in CLASSES if k in classes.values()
        ]  # fmt: skip
        handles += [
            Patch(facecolor="none", edgecolor="none", label=f"{k}  {reason}")
            for reason, k in number_of.items()
        ]  # fmt: skip
        names = dict.fromkeys(row["limit"] for row in self.found.values() if row["limit"])
        limit = "the program's limit" + (f"\n({', '.join(names)})" if names else "")
        lines = ("stable_dt", limit, "k--"), ("own_dt", "the program's own", "k:")
        rows = list(pairwise(edges(y)))
        for step, said, style in lines:
            ends: list[tuple[float, float]] = []
            before = 0
            for j, row in enumerate(rows):
                if (at := self.where(step, j)) is None:
                    continue
                if ends and j > before + 1 and not isclose(at, ends[-1][0], rel_tol=1e-3):
                    ends.append((nan, nan))  # nobody knows how it goes on between such rows
                ends += [(at, up) for up in row]
                before = j
            if ends:
                handles += axes.plot(
                    *zip(*ends, strict=True), style, linewidth=1.4, label=f"first step = {said}"
                )
        said = "run; others inferred"
        handles.append(Line2D([], [], color="k", marker=".", linestyle="", label=said))
        axes.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False,
            fontsize=8, borderaxespad=0,
        )  # fmt: skip
        axes.set(xlabel=words[0], ylabel=words[1])
        fixed = [f"{n} = {v[0]}" for n, v in self.values.items() if len(v) == 1]
        axes.set_title(", ".join([title, *fixed]), loc="left", fontsize=10)
        if len(y) <= FEW:
            axes.set_yticks(y if two else [])
        savefig(figure, path)


def edges(centres: Sequence[float]) -> np.ndarray:
    """Edges of cells around centres."""
    at = np.asarray(centres, float)
    if len(at) == 1:
        return np.array([at[0] - 0.5, at[0] + 0.5])
    middle = (at[:-1] + at[1:]) / 2
    return np.concatenate([[2 * at[0] - middle[0]], middle, [2 * at[-1] - middle[-1]]])
