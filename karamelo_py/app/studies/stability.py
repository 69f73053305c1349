"""karamelo-py stability: where a script is stable, where its energy grows, where it fails."""

import textwrap
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import ceil, exp, inf, isclose, isfinite, log, nan, prod
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from karamelo_py.advice.energy import not_watched
from karamelo_py.app.options import above_zero, positive
from karamelo_py.app.plot import read_log
from karamelo_py.app.studies import look, records, variables
from karamelo_py.app.studies.case import Row, error_of, record_of
from karamelo_py.app.studies.curves import usable
from karamelo_py.app.studies.study import Study, open_study
from karamelo_py.kernels import watch
from karamelo_py.output.files import savefig
from karamelo_py.output.plots import blank_figure, tick_texts
from karamelo_py.script.errors import ScriptError, plural
from karamelo_py.script.terms import number_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DESCRIPTION = """\
Maps where a script is stable, against one or two of its variables. The classes of runs: stable,
damped (spurious energy loss), growing (spurious energy gain), left (a point left the domain, which
says nothing about the step), short (too few steps to see whether energy grows), and failed, with
the reason. The energy is kinetic + stored + dissipated energy less the work of loads, or a log
column with a bound. An error in the script ends the study. Edges between classes are found by
bisection, from coarse to fine: cells between two of the same class are not run: "run 7 of at most
400" means about 100 runs. Each word (basis, transfer, scheme) has a row that is searched
separately. The table next to the picture (map.csv) says which cells were run. -var with one value
is passed on. -accuracy shades the stable cells by an error.

  karamelo-py stability in.file -var dt_factor=0.1:2:20 -var xi=0:1:20 -o map.png
  karamelo-py stability in.file -var dt_factor=0.1:2:20 -var basis=linear,cubic-spline -accuracy err
"""
Cell = tuple[int, int]
UNKNOWN = -1
GAINED = "spurious energy gain"
LOST = "spurious energy loss"
CLASSES = ("stable", "damped", "growing", "left", "short", "failed")
BORNE = ("stable", "damped")
SILENT = ("left", "short")  # classes without information about the step
LABELS = {"left": "left the domain", "short": "too short to tell"}
FEWEST = watch.FEW * watch.LOOK + 1  # steps after which energy has been checked often enough
SURE = 3 * watch.LOOKS * watch.LOOK  # steps after which slow growth is recognised
FIRST = 0.1  # fraction of the log over which energies are averaged
FEW = 9  # largest number of values of a variable that all get a tick
COLOURS = {
    "stable": "#d9ecf7", "damped": "#c3dfb5", "growing": "#f0a53c", "left": "#9b9b9b",
    "short": "#e4e4e4", "failed": "#7d2a3a",
}  # fmt: skip
REASONS = {
    "inside-out": "det F <= 0",
    "not-a-number": "NaN",
    "point-lost": "point lost",
    "left-domain": "point lost",
    "moves-too-far": "point moves more than a cell",
    "step-collapsed": "stable step collapsed",
    "step-above-limit": "step above the limit",
    "tangled": "domain of a point tangled",
    "energy-gain": GAINED,
    "temperature": "temperature out of bounds",
}


def add_options(parser: ArgumentParser) -> None:
    variables.add_family(parser)
    variables.add_steps(parser)
    parser.add_argument("-energy", metavar="COLUMN", help="log column that must not grow")
    parser.add_argument(
        "-bound", type=above_zero, default=2.0,
        help="growth of -energy relative to the mean of the first tenth of the log (2)",
    )  # fmt: skip
    parser.add_argument(
        "-accuracy", metavar="COLUMN", help="error that shades the stable part: err, off=abs(...)"
    )
    parser.add_argument("-stride", type=positive, default=6, help="cells between first runs (6)")
    variables.add_axes(parser)
    parser.add_argument("-o", type=Path, default=Path("map.png"), help="the picture (map.png)")


def run(options: Namespace) -> int:
    out = variables.out_file(options.o, ".png", ".svg", ".pdf")
    plan = variables.family(options)
    values, script = plan.values, plan.script
    together = variables.zipped(options)
    variables.cases(values, together)
    leaders = {name: group[0] for group in together for name in group}
    axes = [n for n in values if len(values[n]) > 1 and leaders.get(n, n) == n]
    worded = [name for name in axes if any(number_of(value) is None for value in values[name])]
    axes.sort(key=worded.__contains__)
    if not 1 <= len(axes) <= 2:
        raise ScriptError(
            f"{len(axes)} variables have several values",
            expected="one or two, such as -var dt_factor=0.1:2:20 -var xi=0:1:20",
        )
    for name in axes:
        if name not in {*worded, *leaders}:
            values[name].sort(key=float)
    energy = ""
    if options.energy:
        energy = records.recorded(options.energy, script, option="-energy")[0].columns()[0]
    words = variables.along(options, axes[0], axes[1] if len(axes) > 1 else "")
    table = out.with_suffix(".csv")
    items = [records.Recorded(f"max:{energy}")] if energy else []
    shades = records.recorded(options.accuracy or "", script, values, "-accuracy")
    if len(shades) > 1:
        raise ScriptError(f"-accuracy {options.accuracy}", expected="one column")
    study = open_study(
        options, plan, table, items + shades, axes=axes, strict=True, writes=False,
        most=prod(len(values[name]) for name in axes),
        facts={"energy": energy, "bound": options.bound},
    )  # fmt: skip
    error = shades[0].word if shades else ""
    chart = Map(
        study, values, axes, energy=energy, bound=options.bound, error=error, leaders=leaders
    )
    if study.page:
        study.page.judge(chart.judged, COLOURS)
    apart = [name in worded for name in axes] + [False] * (2 - len(axes))
    try:
        width = study.place.size
        _, chart.inferred = explore(chart.shape, chart.classify, options.stride, apart, width)
    finally:
        if chart.results:
            records.write(table, chart.rows())
            fixed = [f"{name} = {one[0]}" for name, one in values.items() if len(one) == 1]
            title = options.title or ", ".join([variables.title_of(options.script), *fixed])
            chart.draw(out, title, words)
    chart.tell()
    searched = [n for n, words in zip(chart.shape, apart, strict=True) if not words]
    width = unseen(searched, options.stride)
    if chart.inferred and width:
        wide = plural(width, "cell")
        print(f"islands and strips up to {wide} wide between runs are not seen (-stride)")
    print(f"drawn: {out}; the table is {table}")
    return 0


def growth(energy: np.ndarray) -> float:
    """Return the largest running mean (over 10 % of the rows) / the first one; inf for NaN.

    If the first mean is 0, it is replaced by the median.
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


def remains(energy: np.ndarray) -> float:
    rows = max(1, ceil(FIRST * len(energy)))
    first, last = (float(np.abs(end).mean()) if len(end) else 0.0
                   for end in (energy[:rows], energy[-rows:]))  # fmt: skip
    return last / first if first > 0 else 1.0


def in_short(row: Row, code: str) -> str:
    if row["status"] == "too long":
        return "too long"
    if code in REASONS:
        return REASONS[code]
    return textwrap.shorten(str(row["reason"]), 60, placeholder=" …")


class Map:
    """Map of stability against one or two `axes`, which are variables in `values`.

    A run is growing if the log column `energy` grows by more than the factor `bound`; without this
    column, the energy balance decides. The column `error` shades stable cells. `leaders` maps a
    variable to the one that it changes with (-zip).
    """

    def __init__(
        self, study: Study, values: dict[str, list[str]], axes: list[str], *, energy: str = "",
        bound: float = 2.0, error: str = "", leaders: Mapping[str, str] | None = None,
    ):  # fmt: skip
        self.leaders = leaders or {}
        self.study, self.values, self.axes = study, values, axes
        self.energy, self.bound, self.error = energy, bound, error
        self.words = [
            [] if all(number_of(v) is not None for v in values[name]) else values[name]
            for name in axes
        ]
        self.x, *more = (
            [*map(float, range(len(words)) if words else values[name])]
            for name, words in zip(axes, self.words, strict=True)
        )
        self.y = more[0] if more else [0.0]
        self.shape = len(self.x), len(self.y)
        self.results: dict[Cell, Row] = {}
        self.inferred: dict[Cell, Hashable] = {}

    @property
    def classes(self) -> dict[Cell, Hashable]:
        return {cell: row["class"] for cell, row in self.results.items()} | self.inferred

    @property
    def failures(self) -> list[tuple[str, int]]:
        failed = (row["why"] for row in self.results.values() if row["class"] == "failed")
        return Counter(failed).most_common()

    def case(self, cell: Cell) -> dict[str, str]:
        at = dict(zip(self.axes, cell, strict=False))
        index = {name: at.get(self.leaders.get(name, name), 0) for name in self.values}
        return {name: values[index[name]] for name, values in self.values.items()}

    def classify(self, cells: Sequence[Cell]) -> list[str]:
        cases = {cell: self.case(cell) for cell in cells}
        try:
            self.study.run([*cases.values()])
        finally:
            for cell, case in cases.items():
                if (row := self.study.rows.get(tuple(case.values()))) is not None:
                    self.results[cell] = self.judged(row)
        return [self.results[cell]["class"] for cell in cells]

    def judged(self, row: Row) -> Row:
        folder = self.study.out.parent / row["folder"]
        record = record_of(folder)
        runs, code = record.get("runs", []), error_of(record).get("code", "")
        codes = {note.get("code") for note in record.get("messages", [])}
        verdict = {"class": "stable", "why": "", "growth": None, "limit": "", "unwatched": ""}
        limit = runs[0].get("limited_by") if runs else None
        if limit not in (None, "set_dt", "end"):  # a limit that the script has set
            verdict["limit"] = limit
        done = row["status"] == "done"
        if self.energy:
            log = read_log(folder)
            if done and self.energy not in log:
                raise ScriptError(
                    f"the log has no column '{self.energy}'", expected=", ".join(log) or "a log"
                )
            energy = log.get(self.energy, np.empty(0))
            verdict["growth"] = factor = growth(energy)
            grows = f"{self.energy} grows {factor:.3g} times" if factor > self.bound else ""
            fraction = remains(energy)
            falls = f"{self.energy} falls to {fraction:.3g}" if fraction < 1 / self.bound else ""
        else:
            changes = [run.get("energy_change_percent") for run in runs]
            changes = [change for change in changes if change is not None]
            verdict["growth"] = max((1 + change / 100 for change in changes), default=None)
            if runs and "energy_unwatched" in runs[0]:
                verdict["unwatched"] = not_watched(runs[0]["energy_unwatched"])
            change = (verdict["growth"] or 1.0) - 1
            grows = GAINED if "energy-gain" in codes or change > watch.WITHIN else ""
            falls = LOST if "energy-loss" in codes or change < -watch.WITHIN else ""
        if not done:
            left = code == "left-domain" and "energy-gain" not in codes
            verdict |= {"class": "left" if left else "failed", "why": in_short(row, code)}
        elif not (self.energy or changes) and row["steps"] < FEWEST:
            verdict |= {"class": "short", "why": f"{row['steps']:.0f} steps"}
        elif grows:
            verdict |= {"class": "growing", "why": grows}
        elif falls:
            verdict |= {"class": "damped", "why": falls}
        return {**row, **verdict}

    def rows(self) -> list[dict]:
        rows = []
        for cell, kind in sorted(self.classes.items()):
            row = self.results.get(cell, {})
            cells = {"class": kind, "run": "yes" if row else "no", "reason": row.get("why")}
            cells |= {name: row.get(name) for name in ("growth", "dt", "stable_dt", "own_dt")}
            cells |= {"limit": row.get("limit"), "message": row.get("reason")}
            if self.error:
                cells[self.error] = row.get(self.error)
            rows.append({**self.case(cell), **cells, "folder": row.get("folder")})
        return rows

    def line(self, step: str) -> list[float | None]:
        """Return, for each row, x where the first step equals the column `step`, or None."""
        points: list[list[tuple[float, float]]] = [[] for _ in self.y]
        for (i, j), row in sorted(self.results.items()):
            dt, same = row.get("dt"), row.get(step)
            if dt and same and isfinite(dt / same):
                points[j].append((self.x[i], dt / same))
        at_row = {j: at for j, row in enumerate(points) if (at := self._crossing(row)) is not None}
        crossings: list[float | None] = [at_row.get(j) for j in range(len(self.y))]
        for (before, low), (after, high) in pairwise(sorted(at_row.items())):
            for j in range(before + 1, after):
                if len(points[j]) < 2 and not self.words[-1]:
                    fraction = (self.y[j] - self.y[before]) / (self.y[after] - self.y[before])
                    crossings[j] = low + fraction * (high - low)
        return crossings

    def _crossing(self, points: Sequence[tuple[float, float]]) -> float | None:
        for (xa, a), (xb, b) in pairwise(points):
            if (a - 1) * (b - 1) <= 0 and not isclose(a, b, rel_tol=1e-6):
                return xa + (1 - a) / (b - a) * (xb - xa)
        if len(points) < 2 or self.x[0] <= 0:
            return None
        first_is_near = abs(points[0][1] - 1) < abs(points[-1][1] - 1)
        (xa, a), (xb, b) = points[:2] if first_is_near else points[-2:]
        if isclose(a, b, rel_tol=1e-6):  # both steps are proportional to the variable of the row
            return None
        at = log(xa) - log(xb / xa) * log(a) / log(b / a)
        low, *_, high = edges(self.x)
        return exp(at) if at <= log(high) and exp(at) >= low else None

    def margins(self) -> list[tuple[float, int]]:
        ratios, classes = [], self.classes
        for j in range(self.shape[1]):
            column = [classes[i, j] for i in range(self.shape[0])]
            edge = next((i for i, kind in enumerate(column) if kind not in BORNE), None)
            row = self.results.get((edge - 1, j)) if edge and column[edge] not in SILENT else None
            if row and row.get("dt") and row.get("stable_dt"):
                ratios.append((row["dt"] / row["stable_dt"], int(row["steps"])))
        return ratios

    def tell(self) -> None:
        count, run = Counter(self.classes.values()), len(self.results)
        print(
            f"{run} of {len(self.classes)} cells were run; the rest is between cells of one class"
        )
        for kind in CLASSES:
            if count[kind]:
                print(f"  {kind:<8} {plural(count[kind], 'cell')}")
        for reason, times in self.failures:
            print(f"    {reason}: {plural(times, 'run')}")
        if unwatched := Counter(filter(None, (row["unwatched"] for row in self.results.values()))):
            (why, times), *_ = unwatched.most_common()
            print(f"energy is {why} ({plural(times, 'run')}): runs that reached their end count as")
            print("stable, whatever energy they gained; -energy COLUMN checks a log column")
        if count["short"]:
            print(f"runs of fewer than {FEWEST} steps do not show whether energy grows: run longer")
        margins = self.margins()
        if margins:
            ratios, steps = zip(*margins, strict=True)
            low, high, few = min(ratios), max(ratios), min(steps)
            ends = f"{low:.3g}" if high - low < 1e-3 else f"{low:.3g} to {high:.3g}"
            step_words = "first step that a run survived" if unwatched else "stable first step"
            caution = f", for {few} steps: longer runs may show slow growth" if few < SURE else ""
            print(f"the largest {step_words} is {ends} times the program's stable step{caution}")

    def draw(self, path: Path, title: str, words: tuple[str, str]) -> None:
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
        if self.error:
            self._shade(figure, axes)
        numbers = {reason: str(k) for k, (reason, _) in enumerate(self.failures, 1)}
        for (i, j), row in self.results.items():
            if row["class"] == "failed":
                axes.text(x[i], y[j], numbers[row["why"]], ha="center", va="center",
                          fontsize=7, color="white")  # fmt: skip
            else:
                axes.plot(x[i], y[j], "k.", markersize=4)
        handles = [
            Patch(facecolor=COLOURS[k], edgecolor="0.4", label=LABELS.get(k, k))
            for k in CLASSES if k in self.classes.values()
        ]  # fmt: skip
        handles += [
            Patch(facecolor="none", edgecolor="none", label=f"{k}  {reason}")
            for reason, k in numbers.items()
        ]  # fmt: skip
        names = dict.fromkeys(row["limit"] for row in self.results.values() if row["limit"])
        limit = "stability limit" + (f" ({', '.join(names)})" if names else "")
        lines = ("stable_dt", limit, "k--"), ("own_dt", "step of the program", "k:")
        rows = list(pairwise(edges(y)))
        for step, label, style in lines:
            ends = [
                (nan if at is None else at, up)
                for at, row in zip(self.line(step), rows, strict=True) for up in row
            ]  # fmt: skip
            if any(at == at for at, _ in ends):
                handles += axes.plot(*zip(*ends, strict=True), style, linewidth=1.4, label=label)
        label = "run (cells without a dot or\nnumber are inferred)"
        handles.append(Line2D([], [], color="k", marker=".", linestyle="", label=label))
        axes.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False,
            fontsize=8, borderaxespad=0,
        )  # fmt: skip
        axes.set(xlabel=words[0], ylabel=words[1])
        axes.set_title(title, loc="left", fontsize=10)
        if len(y) <= FEW:
            axes.set_yticks(y if two else [])
        for axis, at, words in zip((axes.xaxis, axes.yaxis), (x, y), self.words, strict=False):
            if words:
                axis.set_ticks(at, words)
        savefig(figure, path)

    def _shade(self, figure: "Figure", axes: "Axes") -> None:
        from matplotlib.colors import LinearSegmentedColormap, LogNorm

        stable = [cell for cell, kind in self.classes.items() if kind == "stable"]
        logs = {
            cell: float(np.log(abs(row[self.error]))) for cell, row in self.results.items()
            if cell in stable and usable(abs(row[self.error] or 0.0))
        }  # fmt: skip
        grid = np.full(self.shape, nan)
        for i, j in stable:
            near = {c: e for c, e in logs.items() if c[1] == j or not self.words[-1]}
            if near:
                far = np.array([(i - k) ** 2 + (j - m) ** 2 for k, m in near], float)
                weight = np.where(far == 0, 1e9, 1 / np.maximum(far, 1))
                grid[i, j] = np.exp(np.average([*near.values()], weights=weight))
        if not logs:
            return
        low, high = np.nanmin(grid), np.nanmax(grid)
        colours = LinearSegmentedColormap.from_list("", ["#eef6fb", "#3f8fc4"])
        mesh = axes.pcolormesh(
            edges(self.x), edges(self.y), np.ma.masked_invalid(grid.T), cmap=colours,
            norm=LogNorm(low, max(high, 1.01 * low)),
        )  # fmt: skip
        bar = figure.colorbar(mesh, ax=axes, location="bottom", shrink=0.6, aspect=30)
        bar.set_label(f"{self.error} where it is stable", fontsize=8)
        ticks = look.log_ticks(float(low), float(high)) if high > low else [float(low)]
        bar.set_ticks(ticks, labels=tick_texts(ticks))
        bar.minorticks_off()


def edges(centres: Sequence[float]) -> np.ndarray:
    at = np.asarray(centres, float)
    if len(at) == 1:
        return np.array([at[0] - 0.5, at[0] + 0.5])
    middle = (at[:-1] + at[1:]) / 2
    return np.concatenate([[2 * at[0] - middle[0]], middle, [2 * at[-1] - middle[-1]]])


def explore(
    shape: tuple[int, int],
    classify: Callable[[Sequence[Cell]], Sequence[Hashable]],
    stride: int = 6,
    apart: Sequence[bool] = (False, False),
    width: int = 1,
) -> tuple[dict[Cell, Hashable], dict[Cell, Hashable]]:
    """Return classes of the cells that were run, and classes inferred for all other cells.

    A grid of cells about `stride` apart is run first. Cells between two runs of the same class, in
    a row or column, get that class. Between runs of different classes, the middle cell is run,
    longest gaps first; along an edge between classes, at least one cell in three is run. Islands
    between runs are missed. Along an axis of words (`apart`), every value is run. At least `width`
    cells are run at once.
    """
    classes: list[Hashable] = []
    plane = np.full(shape, UNKNOWN)
    first = [_cuts(n, 1 if words else stride) for n, words in zip(shape, apart, strict=True)]
    cells = [(i, j) for i in first[0] for j in first[1]]
    while cells:
        for cell, kind in zip(cells, classify(cells), strict=True):
            if kind not in classes:
                classes.append(kind)
            plane[cell] = classes.index(kind)
        filled = _filled(plane, stride, apart)
        halves = [*_halves(filled, apart)]
        cells = more = _spaced(halves or ([] if any(apart) else [*_unproved(plane, filled)]))
        guess = plane.copy()
        while more and len(cells) < width:
            for cell in more:
                guess[cell] = guess.max() + 1  # unlike its neighbours
            further = _spaced([*_halves(_filled(guess, stride, apart), apart)])
            more = further[: width - len(cells)]
            cells = cells + more
    asked = {cell: classes[k] for cell, k in np.ndenumerate(plane) if k != UNKNOWN}
    return asked, {cell: classes[k] for cell, k in np.ndenumerate(filled) if cell not in asked}


def unseen(shape: Sequence[int], stride: int) -> int:
    return max((b - a - 1 for n in shape for a, b in pairwise(_cuts(n, stride))), default=0)


def _cuts(count: int, stride: int) -> list[int]:
    pieces = max(1, ceil((count - 1) / stride))
    return sorted({round(k * (count - 1) / pieces) for k in range(pieces + 1)})


def _gaps(line: np.ndarray) -> Iterator[tuple[int, int]]:
    return ((a, b) for a, b in pairwise(np.flatnonzero(line != UNKNOWN)) if b - a > 1)


def _filled(plane: np.ndarray, stride: int, apart: Sequence[bool]) -> np.ndarray:
    """Fill cells between two cells of one class, unless the row and the column disagree."""
    filled, reach = plane.copy(), 2
    while reach <= stride:
        along_x, along_y = (0 if words else reach for words in apart)
        rows, columns = _between(filled, along_y), _between(filled.T, along_x).T
        agreed = np.where((rows == columns) | (columns == UNKNOWN), rows, columns)
        agreed[(rows != columns) & (np.minimum(rows, columns) != UNKNOWN)] = UNKNOWN
        new = (filled == UNKNOWN) & (agreed != UNKNOWN)
        filled[new] = agreed[new]
        reach = 2 if new.any() else reach + 1
    return filled


def _between(plane: np.ndarray, reach: int) -> np.ndarray:
    said = np.full(plane.shape, UNKNOWN)
    for line, out in zip(plane, said, strict=True):
        for a, b in _gaps(line):
            if b - a <= reach and line[a] == line[b]:
                out[a + 1 : b] = line[a]
    return said


def _halves(plane: np.ndarray, apart: Sequence[bool]) -> Iterator[tuple[int, Cell]]:
    for i, line in enumerate(plane if not apart[1] else ()):
        yield from ((b - a, (i, (a + b) // 2)) for a, b in _gaps(line))
    for j, line in enumerate(plane.T if not apart[0] else ()):
        yield from ((b - a, ((a + b) // 2, j)) for a, b in _gaps(line))


def _unproved(runs: np.ndarray, plane: np.ndarray) -> Iterator[tuple[int, Cell]]:
    """Yield length and middle cell of each stretch without a run, along an edge between classes."""
    for i, k in np.ndindex(plane.shape[0] - 1, 2):
        for stretch in _stretches(runs[i + k], plane[i], plane[i + 1], k):
            yield len(stretch), (i + k, stretch[len(stretch) // 2])
    for j, k in np.ndindex(plane.shape[1] - 1, 2):
        for stretch in _stretches(runs[:, j + k], plane[:, j], plane[:, j + 1], k):
            yield len(stretch), (stretch[len(stretch) // 2], j + k)


def _stretches(runs: np.ndarray, near: np.ndarray, far: np.ndarray, which: int) -> list[list[int]]:
    line = (near, far)[which]
    stretches: list[list[int]] = [[]]
    for i in np.flatnonzero((near != far) & (runs == UNKNOWN)):
        last = stretches[-1]
        if last and (i > last[-1] + 1 or line[i] != line[last[-1]]):
            stretches.append([])
        stretches[-1].append(int(i))
    return [stretch for stretch in stretches if len(stretch) > 1]


def _spaced(wanted: list[tuple[int, Cell]]) -> list[Cell]:
    """Choose cells in the longest gaps, at least half a gap apart."""
    chosen: list[tuple[int, Cell]] = []
    for size, (i, j) in sorted(wanted, key=lambda one: (-one[0], one[1])):
        if all(max(abs(i - k), abs(j - m)) > longer // 2 for longer, (k, m) in chosen):
            chosen.append((size, (i, j)))
    return [cell for _, cell in chosen]
