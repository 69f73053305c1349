"""Classify runs by a log column that should stay constant, such as an energy."""

from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from karamelo_py.app.plot import read_log
from karamelo_py.app.studies.case import record_of, worded
from karamelo_py.app.studies.curves import Table, missing
from karamelo_py.kernels.watch import WITHIN, growth
from karamelo_py.script.errors import codes

ENDS = 0.2  # fraction of the run at each end; the two means are compared
WRONG = ("gains", "breaks")
OF_PARTS = {"gains": "grows", "damps": "falls"}


class Kept(NamedTuple):
    """Verdict: ``keeps``, ``damps``, ``gains``, ``breaks`` (stopped), ``refused`` (no step) ...

    ``unknown`` means that the run was killed or took too long. A component of the energy ``falls``
    or ``grows`` instead of ``damps`` or ``gains``.
    """

    word: str
    number: float  # mean of the last part / mean of the first part; for ``breaks``, the last x
    said: tuple[str, ...]  # causes or titles of warnings and of the error
    warned: bool  # True also if the run's error names a cause

    @property
    def silent(self) -> bool:
        return self.word in WRONG and not self.warned


def judge(x: np.ndarray, y: np.ndarray, within: float = WITHIN) -> tuple[str, float]:
    span = ENDS * (x[-1] - x[0])
    first, last = float(y[x <= x[0] + span].mean()), float(y[x >= x[-1] - span].mean())
    if first == 0:
        return "gains", np.nan
    fraction, ratio = growth(first, last, first), last / first
    if not fraction <= within:  # also if the fraction is NaN
        return "gains", ratio
    return ("damps" if fraction < -within else "keeps"), ratio


def look_at(
    row: Mapping[str, str], folder: Path, over: str, column: str, *, within: float = WITHIN,
    parts: Container[str] = (),
) -> Kept:  # fmt: skip
    """Classify a run. The computes `parts` are components of the energy, which may fall or grow."""
    run_folder = folder / row["folder"]
    messages = record_of(run_folder).get("messages", [])
    causes = tuple(dict.fromkeys(_general(note) for note in messages))
    warned = any(note["kind"] == "warning" for note in messages)
    log = read_log(run_folder)
    if not log or row["status"] in ("too long", "killed"):
        word = "refused" if row["status"] in ("refused", "failed") else "unknown"
        return Kept(word, np.nan, causes, warned)
    for name in (over, column):
        if name not in log:
            raise missing("-keeps" if name == column else "-x", name, list(log), "the log")
    if row["status"] == "failed":
        word, number = "breaks", float(log[over][-1])
        warned = warned or any("cause" in note for note in messages)
    else:
        word, number = judge(log[over], log[column], within)
        if column in parts or column.rpartition("_")[0] in parts:
            word = OF_PARTS.get(word, word)
    return Kept(word, number, causes, warned)


def _general(note: Mapping[str, str]) -> str:
    title = codes().get(note.get("code", ""), {}).get("title")
    return note.get("cause") or title or note["text"]


def verdicts(table: Table, kept: Sequence[Kept], by: Sequence[str]) -> tuple[str, list[str]]:
    """Return a Markdown table, a row per combination of the variables `by`, and silent failures.

    Numbered messages follow. Variables that depend only on the row variables get no columns.
    """
    rows = table.rows
    keys = [tuple(row[name] for name in by) for row in rows]

    def differs(name: str) -> bool:
        pairs = {(key, row[name]) for key, row in zip(keys, rows, strict=True)}
        return len(pairs) > len(set(keys))

    across = [name for name in table.variables if name not in by and differs(name)]
    columns = list(dict.fromkeys(tuple(row[name] for name in across) for row in rows))
    notes: list[str] = []
    cells: dict[tuple, str] = {}
    silent = []
    for key, row, verdict in zip(keys, rows, kept, strict=True):
        notes += [text for text in verdict.said if text not in notes]
        marks = ", ".join(str(notes.index(text) + 1) for text in verdict.said)
        number = f" {verdict.number:.3g}" if np.isfinite(verdict.number) else ""
        if verdict.word == "breaks":
            number = f" at{number}"
        marks = f" [{marks}]" if marks else ""
        values_across = tuple(row[name] for name in across)
        cells[key, values_across] = (
            verdict.word + number + marks + (" (silent)" if verdict.silent else "")
        )
        if verdict.silent:
            silent.append(worded({name: row[name] for name in (*by, *across)}))
    headings = [worded(dict(zip(across, values, strict=True))) for values in columns]
    lines = [
        [*by, *(heading or "all" for heading in headings)],
        ["---"] * (len(by) + len(headings)),
        *([*key, *(cells.get((key, c), "") for c in columns)] for key in dict.fromkeys(keys)),
    ]
    text = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    footnotes = "\n".join(f"{k}. {note}" for k, note in enumerate(notes, 1))
    return f"{text}\n\n{footnotes}".rstrip() + "\n", silent
