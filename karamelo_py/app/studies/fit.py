"""karamelo-py fit: values of a script's variables that bring its log nearest to measurements."""

from argparse import ArgumentParser
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.options import positive
from karamelo_py.app.plot import read_log
from karamelo_py.app.studies import variables
from karamelo_py.app.studies.case import command_of, folder_name, worded
from karamelo_py.app.studies.records import recorded
from karamelo_py.app.studies.study import Study, live_page, plain_table, shown, terminal
from karamelo_py.scene.tables import read_table
from karamelo_py.script.errors import ScriptError, plural, unknown
from karamelo_py.script.terms import number_of

DESCRIPTION = """\
Searches the values of variables that bring the log of a script nearest to measurements, by least
squares, and says how surely the measurements determine them.

  karamelo-py fit in.file -var H=5e8,2e9 -var Y=3e8,5e8 -match S_22=test.csv:stress
  karamelo-py fit in.file -var E=1e6,1e8 -match max:depth=3.28 -match when:v:0=0.7

A variable with several values is searched between the smallest and the largest, from the middle on;
one with a single value is passed on. A measurement is a number, or a column of a file over its
first column, the time. Differences are relative to the largest measured value. The true value is
within +- with a probability of 95 %, where the differences that remain are independent. There is
no +- for a value at the end of its range: the measurements ask for a wider one. Runs in the table
(-o) of the same script, program and options are not repeated; -again repeats them."""
STEP = 0.01  # of a range, for derivatives: above the noise of points that cross cells
ENOUGH = 1e-4  # relative change of the misfit, or of the values, at which the search ends
ALIKE = 0.99  # correlation from which on variables are not told apart


class Observation:
    """Hold a measurement: a number of the log, or a log column over time."""

    def __init__(self, text: str, script: variables.ScriptFiles, values: Mapping[str, list[str]]):
        word, _, what = (part.strip() for part in text.partition("="))
        if not (word and what):
            expected = "a log column and a number, or a file and its column: S=test.csv:stress"
            raise ScriptError(f"-match {text}", expected=expected)
        (self.item,) = recorded(word, script, values, "-match")
        number = number_of(what)
        self.times, self.wanted = None, np.array([number], float)
        if number is None:
            file, _, column = what.rpartition(":")
            if not file and Path(what).is_file():
                columns = ", ".join(read_table(Path(what)))
                expected = f"a column of it: {what}:COLUMN, one of {columns}"
                raise ScriptError(f"-match {text}", expected=expected)
            if not Path(file).is_file():
                expected = "a number, or FILE:COLUMN"
                raise ScriptError(f"-match {text}: there is no file '{file}'", expected=expected)
            table = read_table(Path(file))
            if column not in table:
                raise unknown(f"-match {text}: no column '{column}'", column, table)
            self.times, self.wanted = next(iter(table.values())), table[column]

    def differences(self, log: Mapping[str, np.ndarray], case: Mapping[str, str]) -> np.ndarray:
        """Compare a log with what is measured: (n,), over the largest measured value."""
        if self.times is None:
            found = np.array([self.item.of(log, case)])
        elif log["Time"][-1] < self.times[-1] * (1 - 1e-9):
            ends = f"{log['Time'][-1]:g}, the measurement at {self.times[-1]:g}"
            raise ScriptError(f"the run ends at {ends}", hint="a longer run, or a shorter file")
        else:
            found = np.interp(self.times, log["Time"], log[self.item.columns()[0]])
        return (found - self.wanted) / (abs(self.wanted).max() or 1.0)


class Search:
    """Runs of a script by the shares of the ranges of its variables, from 0 to 1."""

    def __init__(self, study: Study, values: Mapping[str, list[str]], measured: list[Observation]):
        self.study, self.measured = study, measured
        self.fixed = {name: given[0] for name, given in values.items()}
        self.names = [name for name, given in values.items() if given[1:]]
        numbers: list[Any] = [[number_of(value) for value in values[name]] for name in self.names]
        if not numbers or any(None in given for given in numbers):
            expected = "two numbers for each variable that is searched: -var E=1e6,1e8"
            raise ScriptError("there is no range to search", expected=expected)
        self.low, self.high = (np.array([end(given) for given in numbers]) for end in (min, max))

    def case(self, share: np.ndarray) -> dict[str, str]:
        """Name the values at these shares of the ranges."""
        at = self.low + share * (self.high - self.low)
        return self.fixed | {n: f"{x:.10g}" for n, x in zip(self.names, at, strict=True)}

    def differences(self, *shares: np.ndarray) -> list[np.ndarray]:
        """Run the script at each of the shares, and compare its logs with what is measured."""
        cases, found = [self.case(share) for share in shares], []
        for case, row in zip(cases, self.study.run(cases), strict=True):
            if row["status"] != "done":
                said = f"the run with {worded(case)} is not done: {row['reason']}"
                raise ScriptError(said, hint="narrower ranges of the variables")
            log = read_log(self.study.folder / folder_name(case))
            found.append(np.concatenate([one.differences(log, case) for one in self.measured]))
        return found

    def slopes(self, share: np.ndarray) -> np.ndarray:
        """Derivatives (n, variables) by differences, towards the middle of the ranges."""
        steps = np.where(share < 0.5, STEP, -STEP)
        first, *others = self.differences(share, *(share + np.diag(steps)))
        return np.column_stack([(o - first) / h for o, h in zip(others, steps, strict=True)])


def add_options(parser: ArgumentParser) -> None:
    """Add what the subcommand takes."""
    variables.add_family(parser)
    parser.add_argument(
        "-match", action="append", required=True, metavar="COLUMN=VALUE",
        help="a log column, as for -record of sweep, and its measured value: a number or "
        "FILE:COLUMN",
    )  # fmt: skip
    parser.add_argument("-most", type=positive, default=20, help="steps of the search at most (20)")
    parser.add_argument("-o", type=Path, default=Path("fit.csv"), help="table of runs (fit.csv)")


def run(options: Any) -> int:
    """Do what the command line says; returns the exit status."""
    try:
        from scipy.optimize import least_squares
    except ImportError:
        hint = "pip install '.[implicit]' in the folder of karamelo-py"
        raise ScriptError("karamelo-py fit needs SciPy", hint=hint) from None
    out = variables.out_file(options.o, ".csv")
    values, script, launch, jobs = variables.family(options)
    measured = [Observation(text, script, values) for text in options.match]
    items = [one.item for one in measured if one.times is None]
    study = Study(launch, out, list(values), items, jobs, options.again, strict=True)
    search = Search(study, values, measured)
    study.most = options.most * (len(search.names) + 1)
    study.page = live_page(options, study)
    study.describe(variables=values, match=options.match)
    best = least_squares(
        lambda share: search.differences(share)[0], np.full(len(search.names), 0.5),
        jac=search.slopes, bounds=(0, 1), max_nfev=options.most, ftol=ENOUGH, xtol=ENOUGH,
    )  # fmt: skip
    half, alike = certainty(best.jac, best.fun)
    at_end = (best.x <= STEP) | (best.x >= 1 - STEP)
    half[at_end] = np.nan
    table = plain_table(["variable"], ["value", "+-"])
    for k, name in enumerate(search.names):
        value = shown(float(search.case(best.x)[name]))
        table.add_row(name, value, shown(float(half[k] * (search.high - search.low)[k])))
    terminal().print(table)
    for k, name in enumerate(search.names):
        if not best.jac[:, k].any():
            print(f"{name} changes nothing that is measured")
        elif at_end[k]:
            print(f"{name} is at the end of its range: search a wider one")
    for a, b in alike:
        print(f"the measurements do not tell {search.names[b]} and {search.names[a]} apart")
    left = f"{np.sqrt(np.mean(best.fun**2)):.3g} of the largest measured value"
    earlier = len(study.rows) - study.ran
    before = f", and {earlier} of an earlier study (-again repeats them)" if earlier else ""
    print(f"what remains is {left} in the mean, after {plural(study.ran, 'run')}{before}")
    print(command_of(options.script, search.case(best.x)))
    return 0


def certainty(slopes: np.ndarray, off: np.ndarray) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """Half the ranges of 95 %, NaN where nothing tells, and pairs that are not told apart.

    Of the covariance s^2 (J^T J)^-1, s^2 from the n - p differences `off` that remain (Seber & Wild
    2003, Nonlinear Regression, section 2.1).
    """
    from scipy.stats import t

    free = slopes.shape[0] - slopes.shape[1]
    size = np.linalg.norm(slopes, axis=0)
    scaled = slopes / np.where(size > 0, size, 1)
    pairs = [(a, b) for a in range(len(size)) for b in range(a)]
    alike = [(a, b) for a, b in pairs if abs(scaled[:, a] @ scaled[:, b]) > ALIKE]
    if free < 1 or np.linalg.matrix_rank(scaled, 1e-6) < len(size):
        return np.full(len(size), np.nan), alike
    spread = np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled))) / size
    return t.ppf(0.975, free) * np.sqrt(off @ off / free) * spread, alike
