"""Runs judged by a log column, such as an energy, that should stay: a cell for each."""

import re
from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from karamelo_py.app.logs import read_log
from karamelo_py.app.studies import stretches
from karamelo_py.app.studies.curves import missing
from karamelo_py.kernels.watch import WITHIN

SHARE = 0.2  # of the run: means over its first and its last part are compared
WRONG = ("gains", "breaks")
OF_PARTS = {"gains": "grows", "damps": "falls"}
_SAID = re.compile(r"(?:^|: )(?:warning|error): (.*)")
_WARNED = re.compile(r"(?:^|: )warning: ")
_CAUSE = re.compile(r"Known to do that here: (.*)|(numerical fracture)")
_OWN = re.compile(r"^(\w+: )?step \d+, time [^:]*: | at \([^)]*\)| \(through[^)]*\)")
_POINT = re.compile(r"point \d+ of solid '[^']*'")


class Kept(NamedTuple):
    """Verdict on the column in a run.

    Attributes
    ----------
    word
        ``keeps``, ``damps``, ``gains``, ``breaks`` (the run was stopped on its way), ``refused``
        (it made no step), or ``unknown`` (given up or killed). What is a part of the energy
        ``falls`` or ``grows``: whether the whole is lost or gained it does not tell.
    number
        Mean of the last part of the run over that of the first; of a run that breaks, when.
    said
        Warnings of the run, and the error that ended it; what is known to be the cause where the
        program named that.
    warned
        Whether it warned, or the error that ended it names a known cause.
    """

    word: str
    number: float
    said: tuple[str, ...]
    warned: bool

    @property
    def silent(self) -> bool:
        """Tell whether it went wrong and nothing says why."""
        return self.word in WRONG and not self.warned


def judge(x: np.ndarray, y: np.ndarray, within: float = WITHIN) -> tuple[str, float]:
    """The word for a column `y` over `x`, and its mean over the last part over that at first."""
    first, last = stretches.ends(x, y, SHARE)
    share = stretches.grown(first, last)
    ratio = last / first if first else np.nan
    if not share <= within:  # nor for NaN
        return "gains", ratio
    return ("damps" if share < -within else "keeps"), ratio


def look_at(
    row: Mapping[str, str], folder: Path, over: str, column: str, within: float,
    parts: Container[str] = (),
) -> Kept:  # fmt: skip
    """Judge a column in a run; a value of one of the computes `parts` is no whole.

    Raises
    ------
    ScriptError
        For a column that its log does not have.
    """
    place = folder / row["folder"]
    try:
        lines = (place / "err.txt").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    said = [match[1] for line in lines if (match := _SAID.search(line))]
    causes = [_general(text) for text in said]
    warned = any(_WARNED.search(line) for line in lines)
    log = read_log(place)
    if not log or row["status"] in ("too long", "killed"):
        word = "refused" if row["status"] in ("refused", "failed") else "unknown"
        return Kept(word, np.nan, tuple(dict.fromkeys(causes)), warned)
    for name in (over, column):
        if name not in log:
            raise missing("-keeps" if name == column else "-x", name, list(log), "the log")
    if row["status"] == "failed":
        word, number = "breaks", float(log[over][-1])
        warned = warned or any(_CAUSE.search(text) for text in said)
    else:
        word, number = judge(log[over], log[column], within)
        if column in parts or column.rpartition("_")[0] in parts:
            word = OF_PARTS.get(word, word)
    return Kept(word, number, tuple(dict.fromkeys(causes)), warned)


def _general(text: str) -> str:
    """The known cause in a warning or an error; without one its text, without what is its own."""
    cause = _CAUSE.search(text)
    if cause:
        return cause[1] or "a point has come loose from its solid (numerical fracture)"
    return _POINT.sub("a point", _OWN.sub("", text))


class Verdicts(NamedTuple):
    """Cells of runs: rows and columns are the values of variables."""

    headings: list[str]
    rows: list[list[str]]
    notes: list[str]
    silent: list[str]


def table(rows: Sequence[Mapping[str, str]], kept: Sequence[Kept], by: Sequence[str],
          variables: Sequence[str]) -> Verdicts:  # fmt: skip
    """Arrange runs: a row for each value of the variables `by`, a column for each of the others.

    Variables that go in step with those of the rows are left out.
    """
    keys = [tuple(row[name] for name in by) for row in rows]

    def follows(name: str) -> bool:
        return len({(key, row[name]) for key, row in zip(keys, rows, strict=True)}) == len(
            set(keys)
        )

    across = [name for name in variables if name not in by and not follows(name)]
    columns = list(dict.fromkeys(tuple(row[name] for name in across) for row in rows))
    notes: list[str] = []
    cells: dict[tuple, str] = {}
    silent = []
    for key, row, one in zip(keys, rows, kept, strict=True):
        for text in one.said:
            if text not in notes:
                notes.append(text)
        marks = ", ".join(str(notes.index(text) + 1) for text in one.said)
        number = f" {one.number:.3g}" if np.isfinite(one.number) else ""
        if one.word == "breaks":
            number = f" at{number}"
        marks = f" [{marks}]" if marks else ""
        place = tuple(row[name] for name in across)
        cells[key, place] = one.word + number + marks + (" (silent)" if one.silent else "")
        if one.silent:
            silent.append(", ".join(f"{name} = {row[name]}" for name in (*by, *across)))
    headings = [", ".join(f"{n} = {v}" for n, v in zip(across, c, strict=True)) for c in columns]
    return Verdicts(
        [*by, *(heading or "all" for heading in headings)],
        [[*key, *(cells.get((key, c), "") for c in columns)] for key in dict.fromkeys(keys)],
        notes,
        silent,
    )


def markdown(found: Verdicts) -> str:
    """The table as Markdown, and below what runs said, by the numbers in brackets."""
    lines = [found.headings, ["---"] * len(found.headings), *found.rows]
    text = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    notes = "\n".join(f"{k}. {note}" for k, note in enumerate(found.notes, 1))
    return f"{text}\n\n{notes}".rstrip() + "\n"
