"""Charts of studies as pictures (PNG, SVG, PDF), drawn with Matplotlib."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.studies import look
from karamelo_py.app.studies.curves import Family, column, usable
from karamelo_py.output.files import savefig
from karamelo_py.output.plots import blank_figure, tick_text, tidy
from karamelo_py.script.errors import plural
from karamelo_py.script.terms import number_of


def lines(
    family: Family, path: Path, *, convergence: bool, words: tuple[str, str], title: str = ""
) -> None:
    """Errors over costs with the Pareto front, or over the variable along lines.

    `words` stand along the axes.
    """
    figure = blank_figure(8.4, 5.2)
    axes = figure.subplots()
    styles = look.styles([line.choice for line in family.lines])
    across = [line.x if convergence else line.cost for line in family.lines]
    drawn = [line.shown(x) for line, x in zip(family.lines, across, strict=True)]
    xs = np.concatenate([x[k] for x, k in zip(across, drawn, strict=True)])
    ys = np.concatenate([line.error[k] for line, k in zip(family.lines, drawn, strict=True)])
    failed = [x[~k & (x > 0)] for x, k in zip(across, drawn, strict=True)] if convergence else []
    look.log_axis(
        axes.xaxis, *_ends(np.concatenate([xs, *failed])), list(xs) if convergence else None
    )
    look.log_axis(axes.yaxis, *_ends(ys))
    if not convergence:
        _front(axes, family)
    ends = []
    for line, x, k, style in zip(family.lines, across, drawn, styles, strict=True):
        colour, marker, dash = style
        way = np.argsort(line.x[k], kind="stable")
        px, py = x[k][way], line.error[k][way]
        if len(px):
            axes.plot(
                px, py, color=colour, marker=look.MARKERS[marker], linestyle=look.DASHES[dash],
                linewidth=1.5, markersize=5.5, zorder=3,
            )  # fmt: skip
            last = int(np.argmax(px))
            ends.append((px[last], py[last], line.label, colour))
    _gone(axes, [(x, style[0]) for style, gone in zip(styles, failed, strict=False) for x in gone])
    look.direct_labels(axes, ends)
    axes.set(xlabel=words[0], ylabel=words[1])
    axes.set_title(title, loc="left", fontsize=10)
    tidy(axes)
    _footnote(figure, family, convergence, not convergence and family.front())
    savefig(figure, path)


def _gone(axes: Any, marks: Sequence[tuple[float, str]]) -> None:
    """A cross at the top for each run without a value; those at one place stand side by side."""
    for at in {x for x, _ in marks}:
        colours = [colour for x, colour in marks if x == at]
        for k, colour in enumerate(colours):
            axes.annotate(
                "×", (at, 1.0), xycoords=axes.get_xaxis_transform(), color=colour, fontsize=12,
                xytext=(7 * (k - (len(colours) - 1) / 2), 0), textcoords="offset points",
                ha="center", va="center", annotation_clip=False, in_layout=False,
            )  # fmt: skip


def _ends(values: np.ndarray) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _front(axes: Any, family: Family) -> None:
    front = family.front()
    cost, error = column(front, family.cost), column(front, family.accuracy)
    if len(front) > 1:
        axes.step(cost, error, where="post", color="0.8", linewidth=6, zorder=1)
    axes.plot(cost, error, "o", color="0.8", markersize=13, zorder=1)


def _footnote(figure: Any, family: Family, convergence: bool, front: Any) -> None:
    said = []
    if front:
        said.append("grey band: Pareto front, no run is both cheaper and more accurate")
    if convergence and family.without:
        said.append("× at the top: no value (failed)")
    elif family.without:
        said.append(f"not shown: {plural(len(family.without), 'run')} without a value")
    if said:
        figure.supxlabel("; ".join(said), fontsize=8, color="0.35", x=0.02, ha="left")


def heat(
    family: Family, rows: Sequence[Any], x: str, y: str, path: Path, title: str = "", *,
    words: tuple[str, str],
) -> None:  # fmt: skip
    """A column of the table over two variables, as coloured cells with their numbers.

    `words` stand along the axes.
    """
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    others = [n for n in [*family.by, family.along] if n and n not in (x, y)]
    panels: dict[tuple, list] = {}
    for row in rows:
        panels.setdefault(tuple(row[n] for n in others), []).append(row)
    across, up = _sorted(rows, x), _sorted(rows, y)
    wide = min(3, len(panels))
    high = -(-len(panels) // wide)
    figure = blank_figure(
        1.4 + wide * (1.2 + 0.62 * len(across)), 0.9 + high * (0.9 + 0.42 * len(up))
    )
    all_axes = figure.subplots(high, wide, squeeze=False, sharex=True, sharey=True).ravel()
    numbers = [a for a in column(rows, family.accuracy) if usable(a)]
    low, top = min(numbers), max(numbers)
    norm = LogNorm(low, top if top > low else 2 * low)
    colours = colormaps["viridis"]
    for axes, (key, members) in zip(all_axes, panels.items(), strict=False):
        cells = np.full((len(up), len(across)), np.nan)
        ends = np.full(cells.shape, "", object)
        for row, error in zip(members, column(members, family.accuracy), strict=True):
            at = up.index(row[y]), across.index(row[x])
            cells[at] = error if usable(error) else np.nan
            ends[at] = row.get("status", "failed") if not usable(error) else f"{error:.2g}"
        mesh = axes.pcolormesh(np.ma.masked_invalid(cells), norm=norm, cmap=colours, edgecolor="w")
        for (k, m), text in np.ndenumerate(ends):
            if not text:
                continue
            known = np.isfinite(cells[k, m])
            bright = np.dot(colours(norm(cells[k, m]))[:3], (0.3, 0.59, 0.11)) if known else 1.0
            axes.text(
                m + 0.5, k + 0.5, text if known else "×\n" + text, ha="center", va="center",
                fontsize=7, color="black" if bright > 0.45 else "white",
            )  # fmt: skip
        axes.set_xticks(np.arange(len(across)) + 0.5, across)
        axes.set_yticks(np.arange(len(up)) + 0.5, up)
        axes.set_facecolor("0.93")
        said = [
            v if number_of(v) is None else f"{n} = {v}" for n, v in zip(others, key, strict=True)
        ]
        axes.set_title(", ".join(said), fontsize=9)
    for axes in all_axes[len(panels) :]:
        axes.set_visible(False)
    figure.supxlabel(words[0], fontsize=10)
    figure.supylabel(words[1], fontsize=10)
    ticks = look.log_ticks(float(norm.vmin), float(norm.vmax))
    bar = figure.colorbar(mesh, ax=list(all_axes), label=family.error_label)
    bar.set_ticks(ticks, labels=[tick_text(tick) for tick in ticks])
    bar.minorticks_off()
    figure.suptitle(title, fontsize=10, x=0.02, ha="left")
    savefig(figure, path)


def _sorted(rows: Sequence[Any], name: str) -> list[str]:
    found = list(dict.fromkeys(row[name] for row in rows))
    return sorted(found, key=number_of) if all(number_of(v) is not None for v in found) else found
