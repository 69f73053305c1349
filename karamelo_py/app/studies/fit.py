"""karamelo-py fit: values of variables that bring a log closest to measurements."""

from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.options import positive
from karamelo_py.app.plot import read_log
from karamelo_py.app.studies import variables
from karamelo_py.app.studies.case import command_of, folder_name, worded
from karamelo_py.app.studies.records import recorded
from karamelo_py.app.studies.sampling import needs_scipy
from karamelo_py.app.studies.study import Study, open_study, plain_table, shown, terminal
from karamelo_py.scene.tables import read_table
from karamelo_py.script.errors import ScriptError, plural, unknown
from karamelo_py.script.terms import number_of

DESCRIPTION = """\
Searches for values of variables that bring the log of a script nearest to measurements, by least
squares, and prints how accurately the measurements determine them.

  karamelo-py fit in.file -var H=5e8,2e9 -var Y=3e8,5e8 -match S_22=test.csv:stress
  karamelo-py fit in.file -var E=1e6,1e8 -match max:depth=3.28 -match when:v:0=0.7

A variable with several values is searched between the smallest and the largest, from three starts:
the middle, 20 % and 80 % of each range. A variable with a single value is passed on. A measurement
is a number, or a column of a file whose first column is the time. Differences are relative to the
largest measured value. The true value is within +- with a probability of 95 %, if the remaining
differences are independent. There is no +- if the three searches disagree, nor for a value at the
end of its range, which has to be wider. A run that fails counts as a bad trial. Runs
in the table (-o) of the same script, program and options are not repeated; -again repeats them."""
STARTS = (0.5, 0.2, 0.8)  # fractions of each range
# Waves and cell crossing make curves rough: with finite differences of 1 % of a range, searches end
# in local minima.
STEP = 0.04
NEAR = 0.01  # fraction of a range within which values count as equal
ENOUGH = 1e-3  # relative change of misfit or values that ends a search
AGAIN = 3  # number of new searches from better points near an end
ALIKE = 0.99  # correlation above which variables cannot be distinguished


class Observation:
    def __init__(self, text: str, script: variables.ScriptFiles, values: Mapping[str, list[str]]):
        word, _, target = (piece.strip() for piece in text.partition("="))
        if not (word and target):
            expected = "a log column and a number, or a file and its column: S=test.csv:stress"
            raise ScriptError(f"-match {text}", expected=expected)
        (self.item,) = recorded(word, script, values, "-match")
        number = number_of(target)
        self.times, self.wanted = None, np.array([number], float)
        if number is None:
            file, _, column = target.rpartition(":")
            if not file and Path(target).is_file():
                columns = ", ".join(read_table(Path(target)))
                expected = f"a column of it: {target}:COLUMN, one of {columns}"
                raise ScriptError(f"-match {text}", expected=expected)
            if not Path(file).is_file():
                expected = "a number, or FILE:COLUMN"
                raise ScriptError(f"-match {text}: there is no file '{file}'", expected=expected)
            table = read_table(Path(file))
            if column not in table:
                raise unknown(f"-match {text}: no column '{column}'", column, table)
            self.times, self.wanted = next(iter(table.values())), table[column]

    def differences(self, log: Mapping[str, np.ndarray], case: Mapping[str, str]) -> np.ndarray:
        if self.times is None:
            values = np.array([self.item.of(log, case)])
        elif log["Time"][-1] < self.times[-1] * (1 - 1e-9):
            ends = f"{log['Time'][-1]:g}, the measurement at {self.times[-1]:g}"
            raise ScriptError(f"the run ends at {ends}", hint="a longer run, or a shorter file")
        else:
            values = np.interp(self.times, log["Time"], log[self.item.columns()[0]])
        return (values - self.wanted) / (abs(self.wanted).max() or 1.0)


class NoDerivatives(ScriptError):
    pass


@dataclass
class End:
    """End of a search: positions in the ranges (0 to 1), misfits from measurements, slopes."""

    fraction: np.ndarray
    off: np.ndarray
    slopes: np.ndarray

    @property
    def left(self) -> float:
        return float(np.sqrt(np.mean(self.off**2)))


class Search:
    def __init__(self, study: Study, values: Mapping[str, list[str]], measured: list[Observation]):
        self.study, self.measured = study, measured
        self.failed: dict[str, ScriptError] = {}
        self.fixed = {name: words[0] for name, words in values.items()}
        self.names = [name for name, words in values.items() if words[1:]]
        numbers: list[Any] = [[number_of(word) for word in values[name]] for name in self.names]
        if not numbers or any(None in ends for ends in numbers):
            expected = "two numbers for each variable that is searched: -var E=1e6,1e8"
            raise ScriptError("there is no range to search", expected=expected)
        self.low, self.high = (np.array([end(ends) for ends in numbers]) for end in (min, max))

    def case(self, fraction: np.ndarray) -> dict[str, str]:
        at = self.low + fraction * (self.high - self.low)
        return self.fixed | {n: f"{x:.10g}" for n, x in zip(self.names, at, strict=True)}

    def differences(self, *fractions: np.ndarray) -> list[np.ndarray]:
        cases, results = [self.case(fraction) for fraction in fractions], []
        for case, row in zip(cases, self.study.run(cases), strict=True):
            try:
                if row["status"] != "done":
                    message = f"the run with {worded(case)} is not done: {row['reason']}"
                    raise ScriptError(message, hint="narrower ranges of the variables")
                log = read_log(self.study.folder / folder_name(case))
                off = np.concatenate([one.differences(log, case) for one in self.measured])
                if not np.isfinite(off).all():
                    raise ScriptError(f"the run with {worded(case)} logs a NaN")
            except ScriptError as error:
                self.failed[folder_name(case)] = error
                off = np.full(sum(len(one.wanted) for one in self.measured), np.inf)
            results.append(off)
        return results

    def slopes(self, fraction: np.ndarray, both: bool = False) -> np.ndarray:
        """Return derivatives (n, variables), taken towards the middle of the range.

        With `both`, the derivatives are central differences.

        Raises NoDerivatives if the runs on both sides fail.
        """
        moves = np.diag(np.where(fraction < 0.5, STEP, -STEP))
        first, *ahead = self.differences(fraction, *(fraction + moves))
        columns = []
        for k, off in enumerate(ahead):
            points = [(fraction, first), (fraction + moves[k], off)]
            if both or not np.isfinite(off).all():
                back = np.clip(fraction - moves[k], 0, 1)
                points.append((back, *self.differences(back)))
            done = sorted((at[k], tuple(off)) for at, off in points if np.isfinite(off).all())
            (low, below), (high, above) = done[0], done[-1]
            if low == high:
                raise NoDerivatives(*list(self.failed.values())[-1].args)
            columns.append((np.array(above) - below) / (high - low))
        return np.column_stack(columns)

    def down(self, start: np.ndarray, most: int) -> End | None:
        """Run a least-squares search from `start`; return None if runs fail at `start`."""
        from scipy.optimize import least_squares

        if not np.isfinite(self.differences(start)[0]).all():
            return None
        try:
            result = least_squares(
                lambda fraction: self.differences(fraction)[0], start, jac=self.slopes,
                bounds=(0, 1), max_nfev=most, ftol=ENOUGH, xtol=ENOUGH,
            )  # fmt: skip
        except NoDerivatives:
            return None
        return End(result.x, result.fun, result.jac)

    def around(self, end: End) -> End:
        """Search around `end`, along each variable and the weakest direction, to both sides."""

        def nearby(*moves: np.ndarray) -> list[End]:
            near = [np.clip(end.fraction + s * move, 0, 1) for move in moves for s in (1, -1)]
            results = self.differences(*near)
            return [End(at, off, end.slopes) for at, off in zip(near, results, strict=True)]

        ends = nearby(*np.diag([STEP] * len(end.fraction)))
        end.slopes = self.slopes(end.fraction, both=True)
        weak = STEP * np.linalg.eigh(end.slopes.T @ end.slopes)[1][:, 0]
        return min([end, *ends, *nearby(weak, 2 * weak)], key=lambda one: one.left)


def add_options(parser: ArgumentParser) -> None:
    variables.add_family(parser)
    parser.add_argument(
        "-match", action="append", required=True, metavar="COLUMN=VALUE",
        help="a log column, as for -record of sweep, and its measured value: a number or "
        "FILE:COLUMN",
    )  # fmt: skip
    parser.add_argument("-most", type=positive, default=20, help="largest number of steps (20)")
    parser.add_argument("-o", type=Path, default=Path("fit.csv"), help="table of runs (fit.csv)")


def run(options: Namespace) -> int:
    needs_scipy("fit")
    out = variables.out_file(options.o, ".csv")
    plan = variables.family(options)
    measured = [Observation(text, plan.script, plan.values) for text in options.match]
    items = [one.item for one in measured if one.times is None]
    count = sum(len(numbers) > 1 for numbers in plan.values.values())
    most = (len(STARTS) * (count + 1) + AGAIN * (3 * count + 5)) * options.most
    facts = {"match": options.match}
    study = open_study(options, plan, out, items, strict=True, most=most, facts=facts)
    search = Search(study, plan.values, measured)
    ends = [search.down(np.full(count, start), options.most) for start in STARTS]
    best, others = settled(search, [end for end in ends if end], options.most)
    half, alike = certainty(best.slopes, best.off)
    apart: list[End] = []
    for end in sorted(others, key=lambda end: end.left):
        if all(disagree(one, end, half) for one in [best, *apart]):
            apart.append(end)
    if apart:
        half[:] = np.nan
    at_end = (best.fraction <= NEAR) | (best.fraction >= 1 - NEAR)
    half[at_end | np.isinf(half)] = np.nan
    table = plain_table(["variable"], ["value", "+-"])
    for k, name in enumerate(search.names):
        value = shown(float(search.case(best.fraction)[name]))
        table.add_row(name, value, shown(float(half[k] * (search.high - search.low)[k])))
    terminal().print(table)
    for k, name in enumerate(search.names):
        if not best.slopes[:, k].any():
            print(f"{name} has no effect on the measured values")
        elif at_end[k]:
            print(f"{name} is at the end of its range: search a wider range")
    for a, b in alike:
        pair = f"{search.names[b]} and {search.names[a]}"
        print(f"the measurements determine only a combination of {pair}")
    if apart:
        tell_apart(search, [best, *apart])
    if search.failed:
        reason = list(search.failed.values())[-1].message
        print(f"{plural(len(search.failed), 'run')} of the search failed: {reason}")
    left = f"{best.left:.3g} of the largest measured value"
    earlier = len(study.rows) - study.ran
    before = f", and {earlier} of an earlier study (-again repeats them)" if earlier else ""
    print(f"remaining difference: {left} on average, after {plural(study.ran, 'run')}{before}")
    print(command_of(options.script, search.case(best.fraction)))
    return 0


def settled(search: Search, ends: Sequence[End], most: int) -> tuple[End, list[End]]:
    if not ends:
        raise next(iter(search.failed.values()))
    best, *others = sorted(ends, key=lambda end: end.left)
    for _ in range(AGAIN):
        lower = search.around(best)
        if lower.left > best.left * (1 - ENOUGH):
            break
        others.append(best)
        best = min(search.down(lower.fraction, most) or lower, lower, key=lambda end: end.left)
    return best, others


def disagree(best: End, other: End, half: np.ndarray) -> bool:
    """Return True if the ends of two searches differ by more than both 95 % ranges."""
    off = abs(best.fraction - other.fraction)
    wide = np.maximum(np.where(np.isnan(half), 0, 2 * half), NEAR)
    return bool((off > wide)[best.slopes.any(axis=0)].any())


def tell_apart(search: Search, ends: Sequence[End]) -> None:
    print("The searches end at different values, so there is no +-:")
    for end in ends:
        values = search.case(end.fraction)
        text = ", ".join(f"{name} = {shown(float(values[name]))}" for name in search.names)
        print(f"  {text}: remaining difference {end.left:.3g}")
    print("  Likely cause: a rough curve. Inertia makes curves rough: waves run through the body.")
    print("  Fix: load slowly, or add fix local_damping. If both values match: measure more.")


def certainty(slopes: np.ndarray, off: np.ndarray) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """Return half-widths of 95 % intervals, and pairs of variables that cannot be distinguished.

    A half-width is NaN if the variable has no effect or measurements are too few, and inf if only a
    combination of variables is determined. The covariance is s^2 (J^T J)^-1, with the variance s^2
    of the differences `off`, which have n - p degrees of freedom (Seber & Wild 2003, Nonlinear
    Regression, section 2.1).
    """
    from scipy.stats import t

    size = np.linalg.norm(slopes, axis=0)
    scaled = slopes / np.where(size > 0, size, 1)
    pairs = [(a, b) for a in range(len(size)) for b in range(a)]
    alike = [(a, b) for a, b in pairs if abs(scaled[:, a] @ scaled[:, b]) > ALIKE]
    half, matters = np.full(len(size), np.nan), size > 0
    columns = scaled[:, matters]
    free = len(columns) - matters.sum()
    if not matters.any():
        return half, alike
    if np.linalg.matrix_rank(columns, 1e-6) < matters.sum():
        half[matters] = np.inf
    elif free > 0:
        spread = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns))) / size[matters]
        half[matters] = t.ppf(0.975, free) * np.sqrt(off @ off / free) * spread
    return half, alike
