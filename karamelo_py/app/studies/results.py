"""karamelo-py chart -y: a result of a sweep against a variable, with a law or measured points."""

from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from karamelo_py.app.studies.curves import Table, column, label, require
from karamelo_py.app.studies.pictures import SUFFIXES, History, Sheet, draw_histories
from karamelo_py.app.studies.study import plain_table, shown, terminal
from karamelo_py.app.studies.variables import NamesOfCase, along, names, out_file
from karamelo_py.scene.tables import read_table
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.evaluation import evaluate
from karamelo_py.script.parser import parse_text

LAW = 200


def draw(options: Namespace, table: Table, by: Sequence[str]) -> int:
    results = names(options.y)
    require("-y", results, table.rows[0])
    if not options.x:
        raise ScriptError("-y without -x", expected=f"-y {options.y} -x NAME, a variable")
    require("-x", [options.x], table.rows[0])
    require("-by", by, table.variables)
    out = out_file(options.o, *SUFFIXES) if options.o else None
    lines = lines_of(table, options.x, results, by)
    if not any(len(line.x) for line in lines):
        raise ScriptError(f"no run has numbers of '{options.x}' and '{options.y}'")
    law = Law(options.law, options.x) if options.law else None
    measured = measured_in(options.data, options.x, results[0]) if options.data else None
    if out is not None:  # drawn first, since a reader of the table may close the pipe
        first = table.label(results[0]) if len(results) == 1 else ""
        title = table.title if options.title is None else options.title
        sheet = Sheet(out, *along(options, table.label(options.x), first), title)
        some = [line for line in lines if len(line.x)]
        exact = None
        if law is not None:
            x = np.concatenate([line.x for line in (*some, *filter(None, [measured]))])
            x = np.linspace(x.min(), x.max(), LAW)
            exact = History(x, law(x), law.text)
        draw_histories(some, sheet, exact, measured, marker="o")
    _tell(lines, law, options)
    if out is not None:
        print(f"drawn: {out}")
    return 0


def lines_of(table: Table, x: str, results: Sequence[str], by: Sequence[str]) -> list[History]:
    differing = [
        n for n in by or table.variables if n != x and len({row[n] for row in table.rows}) > 1
    ]
    groups: dict[tuple, list[Mapping[str, str]]] = {}
    for row in table.rows:
        groups.setdefault(tuple(row[name] for name in differing), []).append(row)
    lines = []
    for result in results:
        for values, rows in groups.items():
            across, up = column(rows, x), column(rows, result)
            finite = np.flatnonzero(np.isfinite(across) & np.isfinite(up))
            finite = finite[np.argsort(across[finite], kind="stable")]
            choice = label(dict(zip(differing, values, strict=True)))
            called = ", ".join(filter(None, (result if len(results) > 1 else "", choice)))
            lines.append(History(across[finite], up[finite], called or result))
    return lines


class Law:
    def __init__(self, text: str, x: str):
        self.text, self.x = text, x
        self.raw, self.node = parse_text(text, "-law")

    def __call__(self, xs: Sequence[float] | np.ndarray) -> np.ndarray:
        cases = [NamesOfCase("-law", {self.x: float(x)}) for x in xs]
        values = [evaluate(self.node, self.raw, case) for case in cases]
        if not all(isinstance(value, float) for value in values):
            message = f"-law {self.text} is not a number"
            raise ScriptError(message, expected=f"a formula of {self.x}")
        return np.array(values)


def measured_in(path: Path, x: str, result: str) -> History:
    columns = read_table(path)
    if len(columns) < 2:
        raise ScriptError(f"{path} has one column", expected="two, of x and of what was measured")
    first, second, *_ = columns
    named = x in columns and result in columns
    across, up = (columns[x], columns[result]) if named else (columns[first], columns[second])
    return History(across, up, path.name)


def _tell(lines: Sequence[History], law: Law | None, options: Namespace) -> None:
    for line in lines:
        table = plain_table([], [options.x, line.label, *([law.text, "%"] if law else [])])
        for at, y in zip(line.x, line.y, strict=True):
            cells = [shown(float(at)), shown(float(y))]
            if law is not None:
                (right,) = law([at])
                cells += [shown(right), f"{100 * (y / right - 1):+.1f}" if right else ""]
            table.add_row(*cells)
        terminal().print(table)
