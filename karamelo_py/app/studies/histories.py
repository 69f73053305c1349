"""Columns of the logs of a study against each other, a curve for each run."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from karamelo_py.app.logs import read_log
from karamelo_py.app.studies import look
from karamelo_py.app.studies.curves import GroupedRuns
from karamelo_py.output.files import savefig
from karamelo_py.output.plots import blank_figure, tidy
from karamelo_py.script.errors import ScriptError, unknown

DECADES = 1e4  # curves that reach over more are drawn on a logarithmic axis


class History(NamedTuple):
    """One column over another, of one run.

    Attributes
    ----------
    x, y
        The numbers.
    label
        What the run was chosen to be.
    stopped
        Whether the run was stopped before its end.
    """

    x: np.ndarray
    y: np.ndarray
    label: str
    stopped: bool = False


def histories(
    rows: Sequence[Mapping[str, str]],
    by: Sequence[str],
    folder: Path,
    log: str,
    over: str,
    curve: str,
    names: Sequence[str] = (),
) -> list[History]:
    """The curves of all runs whose logs there are.

    Parameters
    ----------
    rows, by
        The table, and the variables that tell its runs apart.
    folder
        Where the table is.
    log
        The name of the log in the folder of a run.
    over, curve
        Columns.
    names
        What to call the runs, in the order of the table; by their values without.

    Raises
    ------
    ScriptError
        For a column that the logs do not have, and where there is no log at all.
    """
    found = []
    for k, row in enumerate(rows):
        columns = read_log(folder / row["folder"], log)
        if not columns:
            continue
        for name in (over, curve):
            if name not in columns:
                raise unknown(f"{log} has no column '{name}'", name, columns)
        label = names[k] if k < len(names) else GroupedRuns({name: row[name] for name in by}).label
        stopped = row.get("status", "done") != "done"
        kept = forward(columns["Time"], stopped) if "Time" in columns else slice(None)
        found.append(History(columns[over][kept], columns[curve][kept], label, stopped))
    if not found:
        raise ScriptError(f"no run has left a {log}", expected="the folders of the sweep")
    return found


def forward(time: np.ndarray, stopped: bool) -> np.ndarray:
    """Choose the rows (n,) of a log that belong to one way forward.

    A run that was stopped ends with its last good state, which came before; one that went back and
    on with smaller steps has rows of what it gave up.
    """
    if stopped:
        return np.arange(len(time)) <= np.argmax(time)
    after = np.append(np.minimum.accumulate(time[::-1])[::-1][1:], np.inf)
    return time < after


def draw(
    found: Sequence[History],
    path: Path,
    *,
    x: str,
    y: str,
    title: str = "",
    exact: History | None = None,
) -> None:
    """Draw curves with their names beside them; a cross where a run was stopped."""
    figure = blank_figure(7.2, 4.0)
    axes = figure.subplots()
    ys = np.concatenate([each.y for each in found])
    positive = ys[np.isfinite(ys) & (ys > 0)]
    logarithmic = not (ys < 0).any() and len(positive) and positive.max() > DECADES * positive.min()
    if logarithmic:
        # What is zero but for round-off stays below the axis.
        top = float(positive.max())
        low = max(float(positive.min()), 1e-16 * top)
        look.log_axis(axes.yaxis, low, top)
    ends = []
    if exact is not None:
        axes.plot(exact.x, exact.y, color="0.6", linewidth=4, zorder=1)
        ends.append((exact.x[-1], exact.y[-1], exact.label, "0.4"))
    for k, each in enumerate(found):
        colour = look.PALETTE[(k + 2) % len(look.PALETTE) if len(found) > 1 else 1]
        axes.plot(
            each.x, each.y, color=colour, linestyle=look.DASHES[k % len(look.DASHES)],
            linewidth=1.6, zorder=3,
        )  # fmt: skip
        name = each.label
        if each.stopped:
            axes.plot(each.x[-1], each.y[-1], "X", color=colour, markersize=9, zorder=4)
            name += " (stopped)"
        last = each.y[-1] if not logarithmic else max(each.y[-1], low)
        ends.append((each.x[-1], last, name, colour))
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, loc="left", fontsize=10)
    tidy(axes)
    figure.canvas.draw()  # limits are known from here on
    look.direct_labels(axes, ends)
    savefig(figure, path)
