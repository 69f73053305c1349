"""The table of a study: one row a run, as CSV, and what it was made with beside it."""

from __future__ import annotations

import csv
import json
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

import karamelo_py
from karamelo_py.app.studies.case import COLUMNS, Outcome, read_log
from karamelo_py.app.studies.variables import number
from karamelo_py.output.quantity import KEYWORDS
from karamelo_py.script.errors import ScriptError, nearest

REDUCTIONS = {"last": lambda v: v[-1], "max": np.max, "min": np.min, "mean": np.mean}


class Recorded:
    """What is recorded of a log column: ``err`` (its last value), ``max:err``, ``mean:err``, ..."""

    def __init__(self, word: str):
        reduction, colon, column = word.partition(":")
        self.word = word
        self.reduction = reduction if colon else "last"
        name = "".join((column if colon else word).split())
        self.column = KEYWORDS.get(name, name)
        if self.reduction not in REDUCTIONS or not self.column:
            close = nearest(self.reduction, REDUCTIONS)
            raise ScriptError(
                f"-record {word}: unknown word '{self.reduction}'",
                expected="the name of a log column, or max:, min:, mean:, last: and the name",
                hint=f"did you mean '{close}:{self.column}'?" if close else None,
            )

    def of(self, log: Mapping[str, np.ndarray]) -> float | None:
        """The number, if the log has the column."""
        values = log.get(self.column)
        return float(REDUCTIONS[self.reduction](values)) if values is not None else None


def recorded(text: str, headings: Sequence[str] | None, script: Path) -> list[Recorded]:
    """What -record asks for.

    Raises
    ------
    ScriptError
        For a column that the script does not log, as far as that is known beforehand.
    """
    found = [Recorded(word.strip()) for word in text.split(",") if word.strip()]
    for item in found:
        if headings is not None and item.column not in headings:
            known = list(dict.fromkeys(headings))
            close = nearest(item.column, known)
            raise ScriptError(
                f"-record {item.word}: {script} does not log '{item.column}'",
                expected="one of " + ", ".join(known),
                hint=f"did you mean '{close}'?"
                if close
                else f"log_modify(custom, step, dt, time, {item.column}) in the script",
            )
    return found


def row(
    case: Mapping[str, str], outcome: Outcome, items: Iterable[Recorded], folder: Path
) -> dict[str, Any]:
    """The row of a run; what is not known of it is left empty.

    A run that did not end well has no recorded values: those of its last moments say nothing.
    """
    log = read_log(outcome.folder) if outcome.status == "done" else {}
    found: dict[str, Any] = dict(case)
    for item in items:
        found[item.word] = item.of(log)
    for name in COLUMNS:
        found[name] = outcome.facts.get(name)
    found["status"], found["reason"] = outcome.status, outcome.reason
    found["folder"] = os.path.relpath(outcome.folder, folder).replace(os.sep, "/")
    return found


def write(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a table, in one piece: a reader sees the old one or the new one."""
    part = path.with_name(path.name + ".part")
    try:
        with part.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            for each in rows:
                writer.writerow({name: _cell(value) for name, value in each.items()})
        part.replace(path)
    except OSError as error:
        raise ScriptError(f"cannot write {path}: {error.strerror or error}") from None


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.10g}"
    return str(value)


def read(path: Path) -> list[dict[str, str]]:
    """The rows of a table.

    Raises
    ------
    ScriptError
        If there is no such file, or no table in it.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except OSError as error:
        raise ScriptError(
            f"cannot read {path}: {error.strerror or error}",
            expected="a table that karamelo-py sweep has written",
        ) from None
    except (UnicodeDecodeError, csv.Error):
        rows = []
    if not rows or any(None in each or None in each.values() for each in rows):
        raise ScriptError(
            f"{path} is not a table of runs", expected="a table that karamelo-py sweep has written"
        )
    return rows


def value(each: Mapping[str, Any], name: str) -> float | None:
    """The number in a column, None where it is empty or no number."""
    cell = each.get(name)
    if cell is None or isinstance(cell, float):
        return cell
    return number(str(cell))


def describe(path: Path, **said: Any) -> None:
    """Write beside a table what it was made with: processor, threads, versions, date."""
    text = json.dumps({**said, **surroundings()}, indent=1) + "\n"
    path.with_suffix(".json").write_text(text, encoding="utf-8")


def surroundings() -> dict[str, Any]:
    """Date, machine and versions, for what is measured here and now."""
    versions = {"python": platform.python_version(), "karamelo-py": karamelo_py.__version__}
    for name in ("numpy", "numba", "llvmlite"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return {
        "date": datetime.now().astimezone().isoformat(timespec="seconds"),
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.release()}",
        "versions": versions,
    }


def beside(path: Path) -> dict[str, Any]:
    """What `describe` wrote beside a table, or nothing."""
    try:
        return json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def processor() -> str:
    """The name of the processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.lower().startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
