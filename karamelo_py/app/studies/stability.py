"""karamelo-py stability: where a script is stable, where its energy grows, where it fails."""

import re
import textwrap
from argparse import ArgumentParser
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import ceil, inf, isclose, isfinite, nan, prod
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.options import above_zero, positive
from karamelo_py.app.plot import read_log
from karamelo_py.app.studies import records, variables
from karamelo_py.app.studies.case import said_in
from karamelo_py.app.studies.study import Study, live_page
from karamelo_py.kernels import watch
from karamelo_py.output.files import savefig
from karamelo_py.output.plots import blank_figure
from karamelo_py.script.errors import ScriptError, plural
from karamelo_py.script.terms import number_of

DESCRIPTION = """\
Maps where a script is stable over one or two of its variables: stable, growing (energy comes from
nowhere, as the program itself finds by kinetic + stored + dissipated energy less the work of loads,
or a log column exceeds a bound), left (a point left the domain, which tells nothing of the step),
or failed, with the reason. A mistake of the script ends the study. Edges are searched by halves,
from coarse to fine: cells between like ones are not run, and "run 7 of at most 400" is one of about
100. The table is written beside the picture (map.csv), and says which cells were run; -var with one
value is passed on.

  karamelo-py stability in.file -var dt_factor=0.1:2:20 -var xi=0:1:20 -o map.png"""
Cell = tuple[int, int]
UNKNOWN = -1
FROM_NOWHERE = "energy comes from nowhere"  # what the program says of growth
CLASSES = ("stable", "growing", "left", "failed")
FIRST = 0.1  # of the rows of a log: energies are means over so many
FEW = 9  # values of a variable that stand at the axis one by one
COLOURS = {
    "stable": "#d9ecf7", "growing": "#f0a53c", "left": "#9b9b9b", "failed": "#7d2a3a"
}  # fmt: skip
LEFT = re.compile("leaves the domain|left the domain")  # and was not thrown out of it
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


def add_options(parser: ArgumentParser) -> None:
    """Add what the subcommand takes."""
    variables.add_family(parser)
    parser.add_argument(
        "-energy", metavar="COLUMN", help="judge by a log column that should not grow"
    )
    parser.add_argument(
        "-bound", type=above_zero, default=2.0,
        help="of -energy: growing is above this times the first tenth of the log, in the mean (2)",
    )  # fmt: skip
    parser.add_argument("-stride", type=positive, default=6, help="cells between first runs (6)")
    variables.add_axes(parser)
    parser.add_argument("-o", type=Path, default=Path("map.png"), help="the picture (map.png)")


def run(options: Any) -> int:
    """Do what the command line says; returns the exit status."""
    out = variables.out_file(options.o, ".png", ".svg", ".pdf")
    values, script, launch, jobs = variables.family(options)
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
    energy = ""
    if options.energy:
        energy = records.recorded(options.energy, script, option="-energy")[0].columns()[0]
    words = variables.along(options, axes[0], axes[1] if len(axes) > 1 else "")
    table = out.with_suffix(".csv")
    items = [records.Recorded(f"max:{energy}")] if energy else []
    most = prod(len(values[name]) for name in axes)
    study = Study(
        launch, table, list(values), items, jobs, options.again, strict=True, most=most,
        writes=False,
    )  # fmt: skip
    study.page = live_page(options, study, axes)
    study.describe(variables=values, energy=energy, bound=options.bound)
    chart = Map(study, values, axes, energy, options.bound)
    try:
        _, chart.inferred = explore(chart.shape, chart.classify, options.stride)
    finally:
        if chart.found:  # also of a study that is interrupted
            records.write(table, chart.rows())
            chart.draw(out, options.script.name, words)
    chart.tell()
    width = unseen(chart.shape, options.stride)
    if chart.inferred and width:
        wide = plural(width, "cell")
        print(f"islands and strips up to {wide} wide between runs are not seen (-stride)")
    print(f"drawn: {out}; the table is {table}")
    return 0


def growth(energy: np.ndarray) -> float:
    """Find the largest mean of an energy over that of its first tenth; infinite for NaN.

    Means are over a tenth of the rows. From rest the median stands for the beginning.
    """
    if not len(energy):
        return 0.0
    if not np.isfinite(energy).all():
        return inf
    rows = max(1, ceil(FIRST * len(energy)))
    means = np.convolve(np.abs(energy), np.full(rows, 1 / rows), "valid")
    first = float(means[0]) or float(np.median(np.abs(energy)))
    if first == 0:
        return inf if means.max() > 0 else 0.0
    return 1 + watch.growth(first, float(means.max()), first)


def in_short(row: Mapping[str, Any]) -> str:
    """Give the reason of a failure in a few words."""
    if row["status"] == "too long":
        return "too long"
    for pattern, words in REASONS.items():
        if re.search(pattern, row["reason"]):
            return words
    cause = re.sub(r"^(run\w*: )?step \d+, time [^:]+: ", "", str(row["reason"]))
    return textwrap.shorten(cause, 60, placeholder=" …")


class Map:
    """The plane of a stability map.

    Of all variables in `values` the one or two `axes` vary. Growth is that of the log column
    `energy` by more than the factor `bound`, or, where none is named, what the program finds.
    """

    def __init__(
        self, study: Study, values: dict[str, list[str]], axes: list[str], energy: str, bound: float
    ):
        self.study, self.values, self.axes = study, values, axes
        self.energy, self.bound = energy, bound
        self.x, *more = ([float(v) for v in values[name]] for name in axes)
        self.y = more[0] if more else [0.0]
        self.shape = len(self.x), len(self.y)
        self.found: dict[Cell, dict[str, Any]] = {}  # cells that were run
        self.inferred: dict[Cell, Any] = {}  # the classes of others

    @property
    def classes(self) -> dict[Cell, Any]:
        """Tell the class of each cell that is known."""
        return {cell: row["class"] for cell, row in self.found.items()} | self.inferred

    @property
    def failures(self) -> list[tuple[str, int]]:
        """Count why runs failed, the commonest first."""
        failed = (row["why"] for row in self.found.values() if row["class"] == "failed")
        return Counter(failed).most_common()

    def case(self, cell: Cell) -> dict[str, str]:
        """Find the values of the variables of a cell."""
        at = dict(zip(self.axes, cell, strict=False))
        return {name: values[at.get(name, 0)] for name, values in self.values.items()}

    def classify(self, cells: Sequence[Cell]) -> list[str]:
        """Run cells, and tell the class of each."""
        cases = {cell: self.case(cell) for cell in cells}
        try:
            self.study.run([*cases.values()])
        finally:
            for cell, case in cases.items():
                if (row := self.study.rows.get(tuple(case.values()))) is not None:
                    self.found[cell] = self.judged(row)
        return [self.found[cell]["class"] for cell in cells]

    def judged(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """Add to the row of a run its class, and why it is of that one."""
        place = self.study.out.parent / row["folder"]
        said, complaint = said_in(place / "out.txt"), said_in(place / "err.txt")
        limit = re.search(r"^  limited by +(\w+);", said, re.M)
        found = {"class": "stable", "why": "", "growth": None, "limit": "", "unwatched": ""}
        if limit and limit[1] not in ("set_dt", "end"):  # where the script says the step
            found["limit"] = limit[1]
        done = row["status"] == "done"
        if self.energy:
            log = read_log(place)
            if done and self.energy not in log:
                raise ScriptError(
                    f"the log has no column '{self.energy}'", expected=", ".join(log) or "a log"
                )
            found["growth"] = factor = growth(log.get(self.energy, np.empty(0)))
            grows = f"{self.energy} grows {factor:.3g} times" if factor > self.bound else ""
        else:
            changes = map(float, re.findall(r"^  energy +([-+][.\d]+) %", said, re.M))
            found["growth"] = max((1 + change / 100 for change in changes), default=None)
            if unwatched := re.search(r"^  energy +is (not watched: .*)", said, re.M):
                found["unwatched"] = unwatched[1]
            grows = FROM_NOWHERE if FROM_NOWHERE in complaint else ""
        if not done:
            # A domain that is too small tells nothing of the step.
            left = LEFT.search(row["reason"]) and FROM_NOWHERE not in complaint
            found |= {"class": "left" if left else "failed", "why": in_short(row)}
        elif grows:
            found |= {"class": "growing", "why": grows}
        return {**row, **found}

    def rows(self) -> list[dict]:
        """Make the table: every cell, whether it was run, and what it showed."""
        rows = []
        for cell, kind in sorted(self.classes.items()):
            row = self.found.get(cell, {})
            found = {"class": kind, "run": "yes" if row else "no", "reason": row.get("why")}
            found |= {name: row.get(name) for name in ("growth", "dt", "stable_dt", "own_dt")}
            found |= {"limit": row.get("limit"), "message": row.get("reason")}
            rows.append({**self.case(cell), **found, "folder": row.get("folder")})
        return rows

    def where(self, step: str, j: int) -> float | None:
        """Find the first variable where the first step is that of this column, in row j."""
        points = []
        for (i, other), row in sorted(self.found.items()):
            dt, same = row.get("dt"), row.get(step)
            if other == j and dt and same and isfinite(dt / same):
                points.append((self.x[i], dt / same))
        for (xa, a), (xb, b) in pairwise(points):
            if (a - 1) * (b - 1) <= 0 and a != b:
                return xa + (1 - a) / (b - a) * (xb - xa)
        return None

    def margins(self) -> list[float]:
        """Divide the largest stable step by the program's, in each row that has an edge."""
        found, classes = [], self.classes
        for j in range(self.shape[1]):
            column = [classes[i, j] for i in range(self.shape[0])]
            edge = next((i for i, kind in enumerate(column) if kind != "stable"), None)
            row = self.found.get((edge - 1, j)) if edge and column[edge] != "left" else None
            if row and row.get("dt") and row.get("stable_dt"):
                found.append(row["dt"] / row["stable_dt"])
        return found

    def tell(self) -> None:
        """Print how many cells are of each class and why runs failed."""
        count, run = Counter(self.classes.values()), len(self.found)
        print(f"{run} of {len(self.classes)} cells were run (the others lie between like ones)")
        for kind in CLASSES:
            if count[kind]:
                print(f"  {kind:<8} {plural(count[kind], 'cell')}")
        for reason, times in self.failures:
            print(f"    {reason}: {plural(times, 'run')}")
        if unwatched := Counter(filter(None, (row["unwatched"] for row in self.found.values()))):
            (why, times), *_ = unwatched.most_common()
            print(f"energy is {why} ({plural(times, 'run')}); -energy COLUMN judges by the log")
        margins = self.margins()
        if margins:
            low, high = min(margins), max(margins)
            ends = f"{low:.3g}" if high - low < 1e-3 else f"{low:.3g} to {high:.3g}"
            print(f"the largest stable first step is {ends} times the program's stable step")

    def draw(self, path: Path, title: str, words: tuple[str, str]) -> None:
        """Draw the map, with `words` along its axes."""
        from matplotlib.colors import ListedColormap
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        x, y, two = self.x, self.y, len(self.axes) > 1
        grid = np.full(self.shape, np.nan)
        for cell, kind in self.classes.items():
            grid[cell] = CLASSES.index(kind)
        figure = blank_figure(9.0, 5.6 if two else 2.8)
        axes = figure.subplots()
        axes.pcolormesh(
            edges(x), edges(y), grid.T, cmap=ListedColormap([COLOURS[k] for k in CLASSES]),
            vmin=-0.5, vmax=len(CLASSES) - 0.5,
        )  # fmt: skip
        number_of = {reason: str(k) for k, (reason, _) in enumerate(self.failures, 1)}
        for (i, j), row in self.found.items():
            if row["class"] == "failed":
                axes.text(x[i], y[j], number_of[row["why"]], ha="center", va="center",
                          fontsize=7, color="white")  # fmt: skip
            else:
                axes.plot(x[i], y[j], "k.", markersize=4)
        handles = [
            Patch(facecolor=COLOURS[k], edgecolor="0.4", label=k + " the domain" * (k == "left"))
            for k in CLASSES if k in self.classes.values()
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
    """Find the edges of cells around centres."""
    at = np.asarray(centres, float)
    if len(at) == 1:
        return np.array([at[0] - 0.5, at[0] + 0.5])
    middle = (at[:-1] + at[1:]) / 2
    return np.concatenate([[2 * at[0] - middle[0]], middle, [2 * at[-1] - middle[-1]]])


# ---- where a plane of cells changes, with few runs -----------------------------------------------


def explore(
    shape: tuple[int, int],
    classify: Callable[[Sequence[Cell]], Sequence[Hashable]],
    stride: int = 6,
) -> tuple[dict[Cell, Hashable], dict[Cell, Hashable]]:
    """Find the class of every cell of a plane, most of them by inference.

    First lines and columns about `stride` cells apart are crossed. What lies in a row or a column
    between two cells of one class is taken to be like them, the nearest ones first; between unlike
    ones the middle is asked for, in the longest gaps first. Where an edge goes along a row, one in
    three of its cells is asked for, so that no bow of it is cut off. So edges are found to the
    cell; an island that lies wholly between the cells that were asked for is missed.

    `classify` gives the classes of cells; it is asked for several at once, none of which tells
    another. Returns the classes of those cells, and of the others.
    """
    classes: list[Hashable] = []  # those of the numbers in the planes
    known = np.full(shape, UNKNOWN)
    cells = [(i, j) for i in _cuts(shape[0], stride) for j in _cuts(shape[1], stride)]
    while cells:
        for cell, kind in zip(cells, classify(cells), strict=True):
            if kind not in classes:
                classes.append(kind)
            known[cell] = classes.index(kind)
        found = _filled(known, stride)
        cells = _apart([*_halves(found)] or [*_unproved(known, found)])
    asked = {cell: classes[k] for cell, k in np.ndenumerate(known) if k != UNKNOWN}
    return asked, {cell: classes[k] for cell, k in np.ndenumerate(found) if cell not in asked}


def unseen(shape: tuple[int, int], stride: int) -> int:
    """Count the cells across islands and strips that no run needs to meet."""
    return max((b - a - 1 for n in shape for a, b in pairwise(_cuts(n, stride))), default=0)


def _cuts(count: int, stride: int) -> list[int]:
    pieces = max(1, ceil((count - 1) / stride))
    return sorted({round(k * (count - 1) / pieces) for k in range(pieces + 1)})


def _gaps(line: np.ndarray) -> Iterator[tuple[int, int]]:
    """Neighbours in a line between which nothing is known."""
    return ((a, b) for a, b in pairwise(np.flatnonzero(line != UNKNOWN)) if b - a > 1)


def _filled(known: np.ndarray, stride: int) -> np.ndarray:
    """Fill in what lies between like cells; where row and column disagree, nothing."""
    found, reach = known.copy(), 2
    while reach <= stride:
        rows, columns = _between(found, reach), _between(found.T, reach).T
        agreed = np.where((rows == columns) | (columns == UNKNOWN), rows, columns)
        agreed[(rows != columns) & (np.minimum(rows, columns) != UNKNOWN)] = UNKNOWN
        new = (found == UNKNOWN) & (agreed != UNKNOWN)
        found[new] = agreed[new]
        reach = 2 if new.any() else reach + 1
    return found


def _between(plane: np.ndarray, reach: int) -> np.ndarray:
    """Fill each row between like cells at most `reach` apart."""
    said = np.full(plane.shape, UNKNOWN)
    for line, out in zip(plane, said, strict=True):
        for a, b in _gaps(line):
            if b - a <= reach and line[a] == line[b]:
                out[a + 1 : b] = line[a]
    return said


def _halves(found: np.ndarray) -> Iterator[tuple[int, Cell]]:
    """The middles of gaps in rows and columns, each with the length of its gap."""
    for i, line in enumerate(found):
        yield from ((b - a, (i, (a + b) // 2)) for a, b in _gaps(line))
    for j, line in enumerate(found.T):
        yield from ((b - a, ((a + b) // 2, j)) for a, b in _gaps(line))


def _unproved(known: np.ndarray, found: np.ndarray) -> Iterator[tuple[int, Cell]]:
    """The middles of stretches along an edge in which no cell is known, with their lengths."""
    for i, k in np.ndindex(found.shape[0] - 1, 2):
        for stretch in _stretches(known[i + k], found[i], found[i + 1], k):
            yield len(stretch), (i + k, stretch[len(stretch) // 2])
    for j, k in np.ndindex(found.shape[1] - 1, 2):
        for stretch in _stretches(known[:, j + k], found[:, j], found[:, j + 1], k):
            yield len(stretch), (stretch[len(stretch) // 2], j + k)


def _stretches(known: np.ndarray, near: np.ndarray, far: np.ndarray, which: int) -> list[list[int]]:
    """Find stretches longer than 1 where two lines differ and nothing is known of one of them."""
    line = (near, far)[which]
    stretches: list[list[int]] = [[]]
    for i in np.flatnonzero((near != far) & (known == UNKNOWN)):
        last = stretches[-1]
        if last and (i > last[-1] + 1 or line[i] != line[last[-1]]):
            stretches.append([])
        stretches[-1].append(int(i))
    return [stretch for stretch in stretches if len(stretch) > 1]


def _apart(wanted: list[tuple[int, Cell]]) -> list[Cell]:
    """Cells of the longest gaps, those left out that lie within half the gap of another."""
    chosen: list[tuple[int, Cell]] = []
    for size, (i, j) in sorted(wanted, key=lambda one: (-one[0], one[1])):
        if all(max(abs(i - k), abs(j - m)) > longer // 2 for longer, (k, m) in chosen):
            chosen.append((size, (i, j)))
    return [cell for _, cell in chosen]
