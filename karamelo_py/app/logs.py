"""Files of earlier runs, read back, such as logs: log.mpm or log.csv."""

import csv
from math import nan
from pathlib import Path

import numpy as np

from karamelo_py.script.errors import ScriptError
from karamelo_py.script.terms import number_of


def read_text(path: Path, expected: str | None = None) -> str:
    """Read a file of an earlier run; nothing where it is no text."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        reason = error.strerror or error
        raise ScriptError(f"cannot read {path}: {reason}", expected=expected) from None
    except UnicodeDecodeError:
        return ""


def read_rows(path: Path) -> list[dict[str, float]]:
    """Read the rows of a log, by column; words, such as what limits the step, are NaN.

    A line that begins with # names the columns anew; one that a killed run has left half is passed
    over.
    """
    names: list[str] = []
    rows = []
    lines = read_text(path).splitlines()
    for cells in filter(
        None, csv.reader(lines) if path.suffix == ".csv" else map(str.split, lines)
    ):
        if not names or cells[0].startswith("#"):
            names = [name for name in (cells[0].lstrip("# "), *cells[1:]) if name]
            continue
        numbers = [number_of(cell) for cell in cells]
        if len(cells) == len(names) and any(number is not None for number in numbers):
            kept = (nan if number is None else number for number in numbers)
            rows.append(dict(zip(names, kept, strict=True)))
    if not rows:
        raise ScriptError(f"{path} is not a log", expected="log.mpm or log.csv of a run")
    return rows


def read_log(folder: Path, name: str = "log.mpm") -> dict[str, np.ndarray]:
    """Read the columns of a log in a folder, those of no log where it cannot be read.

    Where they change between runs, all rows of a column.
    """
    try:
        rows = read_rows(folder / name)
    except ScriptError:
        return {}
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row[name] for row in rows if name in row]) for name in names}
