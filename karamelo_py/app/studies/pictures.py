"""Charts of studies as pictures (PNG, SVG, PDF), by Matplotlib."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from karamelo_py.app.plot import read_log
from karamelo_py.app.studies import look
from karamelo_py.app.studies.curves import (
    Family,
    GroupedRuns,
    Table,
    column,
    label,
    order,
    require,
    sizes,
    usable,
)
from karamelo_py.app.studies.study import plain_table, shown, terminal
from karamelo_py.output.files import savefig
from karamelo_py.output.plots import blank_figure, tick_texts, tidy
from karamelo_py.script.errors import ScriptError, plural, unknown
from karamelo_py.script.terms import number_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
Curve = tuple[float, float, str, str]


class Sheet(NamedTuple):
    path: Path
    x: str = ""
    y: str = ""
    title: str = ""

    def finish(self, figure: "Figure", axes: "Axes", ends: Sequence[Curve]) -> None:
        axes.set(xlabel=self.x, ylabel=self.y)
        axes.set_title(self.title, loc="left", fontsize=10)
        tidy(axes)
        look.direct_labels(axes, ends)
        savefig(figure, self.path)


DECADES = 1e4  # ratio of the values of a curve above which its axis is logarithmic


def lines(family: Family, sheet: Sheet) -> None:
    figure = blank_figure(8.4, 5.2)
    axes = figure.subplots()
    convergence = family.convergence
    styles = look.styles([line.choice for line in family.lines])
    xs = np.concatenate([line.across[line.shown] for line in family.lines])
    ys = np.concatenate([line.error[line.shown] for line in family.lines])
    failed = [line.across[~line.shown & convergence] for line in family.lines]
    bars = np.concatenate([_bars(family, line)[line.shown] for line in family.lines])
    if not family.linear:
        ends = _ends(np.concatenate([xs + bars, np.where(xs > bars, xs - bars, xs), *failed]))
        look.log_axis(axes.xaxis, *ends, list(xs) if convergence else None)
    elif family.words:
        axes.set_xticks(range(len(family.words)), family.words)
    look.log_axis(axes.yaxis, *_ends(ys))
    if not convergence:
        _front(axes, family)
    ends = []
    for line, (colour, marker, dash) in zip(family.lines, styles, strict=True):
        way = np.argsort(line.x[line.shown], kind="stable")
        px, py = line.across[line.shown][way], line.error[line.shown][way]
        if len(px):
            axes.plot(
                px, py, color=colour, marker=look.MARKERS[marker], linestyle=look.DASHES[dash],
                linewidth=1.5, markersize=5.5, zorder=3,
            )  # fmt: skip
            lucky = line.lucky[line.shown][way]
            axes.plot(
                px[lucky], py[lucky], marker=look.MARKERS[marker], linestyle="", color=colour,
                markerfacecolor="white", markersize=5.5, zorder=4,
            )  # fmt: skip
            if (bar := _bars(family, line)[line.shown][way]).any():
                axes.errorbar(
                    px, py, xerr=bar, fmt="none", ecolor=colour, elinewidth=1, capsize=3, zorder=2,
                )  # fmt: skip
            last = int(np.argmax(px))
            ends.append((px[last], py[last], line.label, colour))
    _gone(axes, [(x, style[0]) for style, gone in zip(styles, failed, strict=True) for x in gone])
    if convergence and not family.linear:
        _slope(axes, family)
    _footnote(figure, family)
    sheet.finish(figure, axes, ends)


def _bars(family: Family, line: GroupedRuns) -> np.ndarray:
    spread = column(line.rows, f"{family.cost}_spread")
    return np.zeros(len(spread)) if family.convergence else np.nan_to_num(spread) / 2


def _gone(axes: "Axes", marks: Sequence[tuple[float, str]]) -> None:
    for at in {x for x, _ in marks}:
        colours = [colour for x, colour in marks if x == at]
        for k, colour in enumerate(colours):
            axes.annotate(
                "×", (at, 1.0), xycoords=axes.get_xaxis_transform(), color=colour, fontsize=12,
                xytext=(7 * (k - (len(colours) - 1) / 2), 0), textcoords="offset points",
                ha="center", va="center", annotation_clip=False, in_layout=False,
            )  # fmt: skip


def _slope(axes: "Axes", family: Family) -> None:
    lines = [line for line in family.lines if len(set(line.x[line.shown])) > 1]
    sure = [line for line in lines if not line.lucky.any()] or lines
    fits = [order(line.x[line.shown], line.error[line.shown]).exponent for line in sure]
    if p := round(2 * float(np.median(np.abs(fits)))) / 2 if fits else 0:
        drawn = [(line.x[line.shown], line.error[line.shown]) for line in lines]
        look.slope(axes, drawn, float(np.copysign(p, np.median(fits))))


def _ends(values: np.ndarray) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _front(axes: "Axes", family: Family) -> None:
    front = family.front()
    cost, error = column(front, family.cost), sizes(front, family.accuracy)
    if len(front) > 1:
        axes.step(cost, error, where="post", color="0.8", linewidth=6, zorder=1)
    axes.plot(cost, error, "o", color="0.8", markersize=13, zorder=1)


def _footnote(figure: "Figure", family: Family) -> None:
    said = []
    if not family.convergence and family.front():
        said.append("grey band: Pareto front, no run is both cheaper and more accurate")
    if any(line.lucky.any() for line in family.lines):
        said.append("hollow: may be small by chance")
    if family.without:
        missing = f"not shown: {plural(len(family.without), 'run')} without a value"
        said.append("× at the top: no value (failed)" if family.convergence else missing)
    if said:
        figure.supxlabel("; ".join(said), fontsize=8, color="0.35", x=0.02, ha="left")


def heat(family: Family, x: str, y: str, sheet: Sheet) -> None:
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    rows = family.table.rows
    others = [n for n in [*family.by, family.along] if n and n not in (x, y)]
    panels: dict[tuple, list] = {}
    for row in rows:
        panels.setdefault(tuple(row[n] for n in others), []).append(row)
    across, up = _sorted(rows, x), _sorted(rows, y)
    wide = 2 if len(panels) == 4 else min(3, len(panels))
    high = -(-len(panels) // wide)
    figure = blank_figure(
        1.4 + wide * (1.2 + 0.62 * len(across)), 0.9 + high * (0.9 + 0.42 * len(up))
    )
    all_axes = figure.subplots(high, wide, squeeze=False, sharex=True, sharey=True).ravel()
    numbers = [a for a in sizes(rows, family.accuracy) if usable(a)]
    low, top = min(numbers), max(numbers)
    norm = LogNorm(low, top if top > low else 2 * low)
    colours = colormaps["viridis"]
    for axes, (key, members) in zip(all_axes, panels.items(), strict=False):
        cells = np.full((len(up), len(across)), np.nan)
        ends = np.full(cells.shape, "", object)
        for row, error in zip(members, sizes(members, family.accuracy), strict=True):
            at = up.index(row[y]), across.index(row[x])
            cells[at] = error if usable(error) else np.nan
            ends[at] = row.get("status", "failed") if not usable(error) else f"{error:.2g}"
        mesh = axes.pcolormesh(np.ma.masked_invalid(cells), norm=norm, cmap=colours, edgecolor="w")
        for (k, m), text in np.ndenumerate(ends):
            if not text:
                continue
            has_value = np.isfinite(cells[k, m])
            bright = np.dot(colours(norm(cells[k, m]))[:3], (0.3, 0.59, 0.11)) if has_value else 1.0
            axes.text(
                m + 0.5, k + 0.5, text if has_value else "×\n" + text, ha="center", va="center",
                fontsize=7, color="black" if bright > 0.45 else "white",
            )  # fmt: skip
        axes.set_xticks(np.arange(len(across)) + 0.5, across)
        axes.set_yticks(np.arange(len(up)) + 0.5, up)
        axes.set_facecolor("0.93")
        axes.set_title(label(dict(zip(others, key, strict=True))), fontsize=9)
    for axes in all_axes[len(panels) :]:
        axes.set_visible(False)
    figure.supxlabel(sheet.x, fontsize=10)
    figure.supylabel(sheet.y, fontsize=10)
    ticks = look.log_ticks(float(norm.vmin), float(norm.vmax))
    bar = figure.colorbar(mesh, ax=list(all_axes), label=family.error_label)
    bar.set_ticks(ticks, labels=tick_texts(ticks))
    bar.minorticks_off()
    figure.suptitle(sheet.title, fontsize=10, x=0.02, ha="left")
    savefig(figure, sheet.path)


def _sorted(rows: Sequence[Mapping[str, str]], name: str) -> list[str]:
    values = dict.fromkeys(row[name] for row in rows)
    numbers = all(number_of(v) is not None for v in values)
    return sorted(values, key=number_of) if numbers else [*values]


class History(NamedTuple):
    x: np.ndarray
    y: np.ndarray
    label: str
    stopped: bool = False  # True if the run stopped early


def histories(
    table: Table, by: Sequence[str], over: str, curve: str, *, log: str, names: Sequence[str]
) -> list[History]:
    curves = []
    for k, row in enumerate(table.rows):
        columns = read_log(table.path.parent / row["folder"], log)
        if not columns:
            continue
        for name in (over, curve):
            if name not in columns:
                raise unknown(f"{log} has no column '{name}'", name, columns)
        called = names[k] if k < len(names) else label({name: row[name] for name in by}) or "all"
        stopped = row.get("status", "done") != "done"
        rows = forward(columns["Time"], stopped) if "Time" in columns else slice(None)
        curves.append(History(columns[over][rows], columns[curve][rows], called, stopped))
    if not curves:
        raise ScriptError(f"no run has left a {log}", expected="the folders of the sweep")
    return curves


def forward(time: np.ndarray, stopped: bool) -> np.ndarray:
    """Return a mask (n,) of rows with increasing time.

    A stopped run ends with an earlier good state. After a return to an earlier state, rows are
    invalid.
    """
    if stopped:
        return np.arange(len(time)) <= np.argmax(time)
    after = np.append(np.minimum.accumulate(time[::-1])[::-1][1:], np.inf)
    return time < after


def draw_histories(
    curves: Sequence[History], sheet: Sheet, exact: History | None = None,
    measured: History | None = None, marker: str = "",
) -> None:  # fmt: skip
    figure = blank_figure(7.2, 4.0)
    axes = figure.subplots()
    ys = np.concatenate([each.y for each in curves])
    positive = ys[np.isfinite(ys) & (ys > 0)]
    low = -np.inf
    if not (ys < 0).any() and len(positive) and positive.max() > DECADES * positive.min():
        # Values that are 0 up to round-off stay below the axis.
        top = float(positive.max())
        low = max(float(positive.min()), 1e-16 * top)
        look.log_axis(axes.yaxis, low, top)
    ends = []
    if exact is not None:
        axes.plot(exact.x, exact.y, color="0.6", linewidth=4, zorder=1)
        ends.append((exact.x[-1], exact.y[-1], exact.label, "0.4"))
    words = {word for family in look.FAMILIES for word in family}
    fixed = [look.number(each.label) for each in curves if each.label in words]
    places = fixed if len(fixed) == len(curves) else range(1 + (len(curves) > 1), len(curves) + 2)
    for k, each in enumerate(curves):
        colour = look.PALETTE[places[k] % len(look.PALETTE)]
        axes.plot(
            each.x, each.y, marker=marker, color=colour,
            linestyle=look.DASHES[k % len(look.DASHES)], linewidth=1.6, zorder=3,
        )  # fmt: skip
        name = each.label
        if each.stopped:
            axes.plot(each.x[-1], each.y[-1], "X", color=colour, markersize=9, zorder=4)
            name += " (stopped)"
        last = max(np.flatnonzero(each.y >= low), default=-1)
        ends.append((each.x[last], max(each.y[last], low), name, colour))
    if measured is not None:
        axes.plot(measured.x, measured.y, "k+", markersize=9, zorder=4)
        last = int(np.argmax(measured.x))
        ends.append((measured.x[last], measured.y[last], measured.label, "k"))
    sheet.finish(figure, axes, ends)


@dataclass
class Pair:
    """Numbers of a scene for two values of one variable, NaN where missing."""

    label: str
    error: np.ndarray
    cost: np.ndarray
    bytes: np.ndarray

    @property
    def cost_ratio(self) -> float:
        return self.cost[1] / self.cost[0]


def pairs(table: Table, name: str, accuracy: str, cost: str) -> tuple[list[Pair], list[str]]:
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
    scene = Path(table.made.get("script", table.path)).name.removeprefix("in.").replace("_", " ")
    compared = []
    for case, two in cases.items():
        if len(two) < 2:
            continue
        values_of = dict(zip(others, case, strict=True))
        parts = filter(None, [scene, label({name: values_of[name] for name in differing})])
        columns = (accuracy, cost, "bytes_per_particle")
        numbers = [sizes([two[word] for word in values], column) for column in columns]
        used = (np.where(np.isfinite(n) & (n > 0), n, np.nan) for n in numbers)
        compared.append(Pair(", ".join(parts), *used))
    return compared, values


def tell_pairs(pairs: Sequence[Pair], values: Sequence[str], accuracy: str, cost: str) -> None:
    ratio = f"{values[1]}/{values[0]}"
    headings = [f"{column}, {word}" for column in (accuracy, cost) for word in values]
    table = plain_table([""], [*headings, f"{cost}, {ratio}", f"bytes, {ratio}"])
    for pair in pairs:
        numbers = [*pair.error, *pair.cost, pair.cost_ratio, pair.bytes[1] / pair.bytes[0]]
        table.add_row(pair.label, *(shown(float(f"{a:.3g}")) for a in numbers))
    terminal().print(table)


def draw_pairs(pairs: Sequence[Pair], values: Sequence[str], accuracy: str, sheet: Sheet) -> None:
    figure = blank_figure(9.0, 1.1 + 0.3 * len(pairs))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    errors = np.array([pair.error for pair in pairs])
    good = errors[np.isfinite(errors)]
    if not len(good):
        raise ScriptError(f"no run has a value of '{accuracy}' above 0")
    look.log_axis(left.xaxis, float(good.min()), float(good.max()))
    up = np.arange(len(pairs))[::-1]
    for k, (word, filled) in enumerate(zip(values, (True, False), strict=True)):
        colour = look.PALETTE[1 + k]
        left.plot(
            errors[:, k], up, look.MARKERS[k], color=colour, label=word, markersize=9 - 2 * k,
            markerfacecolor=colour if filled else "white", markeredgewidth=1.6, zorder=3 + k,
        )  # fmt: skip
    ratios = np.array([pair.cost_ratio for pair in pairs])
    right.barh(up, np.nan_to_num(ratios), height=0.55, color="0.7", zorder=2)
    for at, a in zip(up, ratios, strict=True):
        if np.isfinite(a):
            right.text(0.04, at, f"{a:.2f}", va="center", fontsize=8, zorder=4)
    right.axvline(1.0, color="0.3", linewidth=1, linestyle=look.DASHES[1], zorder=3)
    right.set_xlim(0, 1.15 * max(1.0, float(np.nanmax(ratios, initial=1.0))))
    left.set_yticks(up, [pair.label for pair in pairs])
    left.set_ylim(-0.7, len(pairs) - 0.3)
    left.set_xlabel(sheet.x)
    right.set_xlabel(sheet.y)
    left.set_title(sheet.title, loc="left", fontsize=10)
    left.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, fontsize=9)
    for axes in (left, right):
        tidy(axes)
        axes.tick_params(axis="y", length=0)
    savefig(figure, sheet.path)
