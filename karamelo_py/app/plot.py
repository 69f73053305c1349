"""Read logs of earlier runs; karamelo-py plot."""

import argparse
import csv
from math import nan
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from karamelo_py.output.files import picture_format
from karamelo_py.output.plots import PlottedCurve, draw
from karamelo_py.script import reading
from karamelo_py.script.errors import ScriptError, unknown
from karamelo_py.script.terms import number_of

DESCRIPTION = """\
Draw curves of a log.
The log is log.mpm or log.csv. Without columns, lists all columns. The command of scripts
is explained by karamelo-py help command plot."""


def read_text(path: Path, expected: str | None = None) -> str:
    try:
        return reading.read_text(path, largest=None)
    except OSError as error:
        reason = error.strerror or error
        raise ScriptError(f"cannot read {path}: {reason}", expected=expected) from None
    except ValueError:
        return ""


def read_rows(path: str | Path) -> list[dict[str, float]]:
    """Return the rows of a log as dictionaries by column name. Words become NaN.

    A line that begins with # names new columns; an incomplete line is skipped.
    """
    names: list[str] = []
    path, rows = Path(path), []
    # A last line without a line end may be cut off: 2.4 instead of 2.4e+10.
    lines = read_text(path).rpartition("\n")[0].splitlines()
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
    """Return the columns of a log, or {} if the log cannot be read."""
    try:
        rows = read_rows(folder / name)
    except ScriptError:
        return {}
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row[name] for row in rows if name in row]) for name in names}


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("log", metavar="LOG", type=Path)
    parser.add_argument("columns", metavar="Y", nargs="*", help="columns to draw")
    parser.add_argument("-x", help="column to draw over (default: Time, or Step)")
    parser.add_argument(
        "--right", nargs="+", default=[], metavar="Y", help="columns on a second axis, at the right"
    )
    parser.add_argument("--label", help="text at the left axis, such as 'energy (J)'")
    parser.add_argument("--log-scale", action="store_true", help="logarithmic y axes")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("log.png"), metavar="FILE",
        help="picture: .png, .pdf or .svg (default: log.png)",
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    if not options.log.exists() and not options.log.suffix:
        raise ScriptError(
            f"there is no log {options.log}",
            expected="the name of a log, and then the columns",
            hint=f"karamelo-py plot log.mpm {options.log}",
        )
    if not options.log.exists():
        message = f"there is no log {options.log}"
        raise ScriptError(message, hint="run the script first: its log is log.mpm")
    rows = read_rows(options.log / "log.mpm" if options.log.is_dir() else options.log)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    if not options.columns and not options.right:
        print(" ".join(columns))
        return 0
    picture_format(options.output)
    if options.x is None:
        options.x = "Step" if "Time" not in columns and "Step" in columns else "Time"
    for name in (options.x, *options.columns, *options.right):
        if name not in columns:
            raise unknown(f"{options.log} has no column '{name}'", name, columns)
    curves, scale = [], "log" if options.log_scale else "linear"
    for side, names in (("left", options.columns), ("right", options.right)):
        for name in names:
            curve = PlottedCurve(
                1, SimpleNamespace(name=options.x), SimpleNamespace(name=name), side, scale,
                options.label if side == "left" else None,
            )  # fmt: skip
            curve.points = [
                (row[options.x], row[name]) for row in rows if name in row and options.x in row
            ]
            curves.append(curve)
    draw(curves, options.output)
    print(options.output)
    return 0
