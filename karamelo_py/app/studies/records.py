"""The table of a study: one row per run, as CSV."""

import csv
import io
import os
import re
from collections.abc import Container, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from karamelo_py.app.plot import read_log, read_text
from karamelo_py.app.studies.case import COLUMNS, CaseOutcome, Row
from karamelo_py.app.studies.variables import NamesOfCase, ScriptFiles
from karamelo_py.output.files import write_whole
from karamelo_py.output.quantity import KEYWORDS
from karamelo_py.script.errors import ScriptError, meant, unknown
from karamelo_py.script.evaluation import evaluate
from karamelo_py.script.functions import CONSTANTS
from karamelo_py.script.parser import parse_text
from karamelo_py.script.terms import number_of

REDUCTIONS = {
    "last": lambda v: v[-1], "first": lambda v: v[0], "max": np.max, "min": np.min,
    "mean": np.mean,
}  # fmt: skip
_WORDS = "max:, min:, mean:, last:, first: and the name of a log column, or when:column:value"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_PART = re.compile(rf"\b([^\W\d]\w*):([^\W\d]\w*)(?::({_NUMBER}))?")
_NAME = re.compile(r"\b([^\W\d]\w*)\b(?!\s*\()")
_SIZE = re.compile(r"\s*abs\s*\((.*)\)\s*", re.DOTALL)
SIGNED = "_signed"  # suffix of the column with the signed value


class Reduction:
    def __init__(self, reduction: str, column: str, level: str | None, word: str):
        column = "".join(column.split())
        self.reduction, self.column = reduction, KEYWORDS.get(column, column)
        self.level = None if level is None else number_of(level)
        reductions = [*REDUCTIONS, "when"]
        if reduction not in reductions:
            hint = meant(reduction, reductions, f"{{}}:{self.column}")
            message = f"-record {word}: unknown word '{reduction}'"
            raise ScriptError(message, expected=_WORDS, hint=hint)
        if not column or (reduction == "when") == (self.level is None):
            incomplete = f"-record {word}: '{reduction}:{column}' is not complete"
            raise ScriptError(incomplete, expected=_WORDS)

    def of(self, log: Mapping[str, np.ndarray]) -> float:
        values = log.get(self.column, ())
        if not len(values):
            raise ScriptError(f"the log has no column '{self.column}'")
        if self.level is None:
            return float(REDUCTIONS[self.reduction](values))
        # Interpolate between the first row beyond the level and the previous row.
        above = values >= self.level if values[0] < self.level else values <= self.level
        if not above.any() or "Time" not in log:
            raise ScriptError(f"{self.column} does not reach {self.level:g}")
        k = max(int(np.argmax(above)), 1)
        fraction = (self.level - values[k - 1]) / (values[k] - values[k - 1])
        return float(log["Time"][k - 1] + fraction * (log["Time"][k] - log["Time"][k - 1]))


class Recorded:
    """A number from a log: ``err`` (the last value), ``max:err``, ...

    ``off=abs(max:depth/3.28 - 1)`` is a named formula of such numbers and of variables. If abs(...)
    encloses the whole formula, the value with its sign is also recorded (`signed`).
    """

    signed: "Recorded | None" = None

    def __init__(self, word: str):
        name, equals, formula = (piece.strip() for piece in word.partition("="))
        self.text, self.raw = word, None
        self.parts: dict[str, Reduction] = {}
        if not equals:
            self.word = word
            reduction, colon, rest = word.partition(":")
            column, level = (rest.split(":", 1) + [None])[:2] if colon else (word, None)
            self.parts[""] = Reduction(reduction if colon else "last", column, level, word)
            return
        if not name.isidentifier() or not formula:
            raise ScriptError(f"-record {word}", expected="name=formula, as in off=abs(max:s - 1)")
        self.word = name
        if size := _SIZE.fullmatch(formula):
            with suppress(ScriptError):  # the formula is not a single abs, but e.g. abs(a) + abs(b)
                self.signed = Recorded(f"{name}{SIGNED}={size[1]}")

        def named(match: re.Match) -> str:
            self.parts[f"part{len(self.parts)}"] = Reduction(*match.groups(), word)
            return f"part{len(self.parts) - 1}"

        formula = _PART.sub(named, formula)
        self.raw, self.node = parse_text(formula, f"-record {name}")
        for name in sorted({*_NAME.findall(formula)} - {*self.parts, *CONSTANTS}):
            self.parts[name] = Reduction("last", name, None, word)

    def columns(self, variables: Container[str] = ()) -> list[str]:
        return [reduction.column for name, reduction in self.parts.items() if name not in variables]

    def of(self, log: Mapping[str, np.ndarray], case: Row) -> float:
        numbers = {
            name: number_of(case[name]) if name in case else reduction.of(log)
            for name, reduction in self.parts.items()
        }
        if self.raw is None:
            return numbers[""]
        value = None
        if None not in numbers.values():
            with suppress(ScriptError):
                value = evaluate(self.node, self.raw, NamesOfCase("-record", numbers))
        if not isinstance(value, float):
            raise ScriptError(f"'{self.text}' has no value")
        return value


def recorded(
    text: str, script: ScriptFiles, variables: Container[str] = (), option: str = "-record"
) -> list[Recorded]:
    items = [Recorded(word.strip()) for word in _apart(text) if word.strip()]
    headings = script.logged()
    for item in items:
        for column in item.columns(variables):
            if headings is None or column in headings:
                continue
            message = f"{option} {item.text}: {script.path} does not log '{column}'"
            hint = f"log_modify(custom, step, dt, time, {column}) in the script"
            raise unknown(message, column, headings, hint)
    return items


def _apart(text: str) -> list[str]:
    words, depth = [""], 0
    for sign in text:
        depth += (sign == "(") - (sign == ")")
        if sign == "," and depth <= 0:
            words.append("")
        else:
            words[-1] += sign
    return words


def row(
    case: Mapping[str, str], outcome: CaseOutcome, items: Sequence[Recorded], folder: Path
) -> Row:
    """Make a row of the table; unknown cells are None.

    For a finished run, the reason says why a value is missing.
    """
    words = [word for i in items for word in (i.word, *([i.signed.word] if i.signed else []))]
    numbers: dict[str, float | None] = dict.fromkeys(words)
    reasons = [outcome.reason]
    if outcome.status == "done":
        log = read_log(outcome.folder)
        for item in [*items, *(item.signed for item in items if item.signed)]:
            try:
                numbers[item.word] = item.of(log, case)
            except ScriptError as error:
                reasons.append(error.message)
    return {
        **case,
        **numbers,
        **{name: outcome.facts.get(name) for name in COLUMNS},
        "status": outcome.status,
        "reason": next(filter(None, reasons), ""),
        "folder": os.path.relpath(outcome.folder, folder).replace(os.sep, "/"),
        "machine": outcome.machine,
    }


def write(path: Path, rows: Sequence[Row]) -> None:
    file = io.StringIO()
    writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for each in rows:
        writer.writerow({n: f"{v:.10g}" if isinstance(v, float) else v for n, v in each.items()})
    write_whole(path, file.getvalue())


def read(path: Path) -> list[dict[str, str]]:
    expected = "a table that karamelo-py sweep has written"
    try:
        rows = list(csv.DictReader(io.StringIO(read_text(path, expected), newline="")))
    except csv.Error:
        rows = []
    if not rows or any(None in each or None in each.values() for each in rows):
        raise ScriptError(f"{path} is not a table of runs", expected=expected)
    return rows


def value(each: Row, name: str) -> float | None:
    cell = each.get(name)
    return cell if cell is None or isinstance(cell, float) else number_of(str(cell))
