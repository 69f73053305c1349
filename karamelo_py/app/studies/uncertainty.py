"""Distribution of the results of a sample, and probability of an event."""

from argparse import Namespace
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from karamelo_py.app.studies import look, variables
from karamelo_py.app.studies.case import Row
from karamelo_py.app.studies.curves import Table, column, require
from karamelo_py.app.studies.pictures import SUFFIXES
from karamelo_py.app.studies.records import value
from karamelo_py.app.studies.study import plain_table, shown, terminal
from karamelo_py.output.files import savefig
from karamelo_py.output.plots import blank_figure, tidy
from karamelo_py.script.errors import ScriptError, plural

QUANTILES = (0.05, 0.5, 0.95)
SURE = 0.95  # probability that an interval contains the value
RESAMPLED = 2000


class Interval(NamedTuple):
    value: float
    low: float  # lower end of the 95 % interval
    high: float

    def __str__(self) -> str:
        return f"{shown(self.value)} ({shown(self.low)} to {shown(self.high)})"


def statistics_of(values: np.ndarray) -> list[Interval]:
    """Return mean, standard deviation and quantiles, with bootstrap intervals (Efron 1979)."""
    from scipy.stats import bootstrap

    def of(sample: np.ndarray, axis: int = -1) -> np.ndarray:
        mean, deviation = sample.mean(axis=axis), sample.std(axis=axis, ddof=1)
        return np.stack([mean, deviation, *np.quantile(sample, QUANTILES, axis=axis)])

    interval = bootstrap(
        (values,), of, n_resamples=RESAMPLED, confidence_level=SURE, method="percentile",
        rng=np.random.default_rng(0), vectorized=True, axis=-1,
    ).confidence_interval  # fmt: skip
    return [Interval(*map(float, one)) for one in zip(of(values), *interval, strict=True)]


def probability(count: int, of: int) -> Interval:
    """Return the probability of an event seen `count` times, with Wilson's interval (1927)."""
    from scipy.stats import binomtest

    interval = binomtest(count, of).proportion_ci(SURE, method="wilson")
    return Interval(count / of, float(interval.low), float(interval.high))


def samples_in(rows: Sequence[Row], others: Sequence[str]) -> dict[str, list[Row]]:
    cases: dict[str, list[Row]] = {}
    for row in rows:
        cases.setdefault(", ".join(f"{name} = {row[name]}" for name in others), []).append(row)
    return cases


def tell(
    rows: Sequence[Row], results: Sequence[str], fails: str | None, others: Sequence[str] = ()
) -> None:
    print("\nin brackets: 95 % confidence intervals, by resampling")
    for words, sample in samples_in(rows, others).items():
        if words:
            print(f"\n{words}")
        _tell_of(sample, results, fails)


def _tell_of(rows: Sequence[Row], results: Sequence[str], fails: str | None) -> None:
    done = [row for row in rows if row["status"] == "done"]
    table = plain_table(["result"], ["mean", "deviation", *(f"{q:.0%}" for q in QUANTILES)])
    for name in results:
        numbers = [value(row, name) for row in done]
        values = np.array([x for x in numbers if x is not None and np.isfinite(x)])
        if len(values) > 2:
            table.add_row(name, *map(str, statistics_of(values)))
    if table.row_count:
        terminal().print(table)
    if lost := len(rows) - len(done):
        print(f"{plural(lost, 'run')} without results {'is' if lost == 1 else 'are'} left out")
    if fails and done:
        seen = sum(_happens(fails, row) for row in done)
        print(f"probability of {fails}: {probability(seen, len(done))}; {seen} of {len(done)} runs")
        if lost:
            print(
                f"  with the {plural(lost, 'run')} without a result: between {seen} and "
                f"{seen + lost} of {len(rows)}, {seen / len(rows):.3g} to "
                f"{(seen + lost) / len(rows):.3g}"
            )


def check(condition: str, names: Sequence[str]) -> None:
    variables.holds(condition, dict.fromkeys(names, "1"), option="-fails")


def _happens(condition: str, row: Row) -> bool:
    some = {n: cell for n, cell in row.items() if cell is not None}
    cells = {n: f"{c:.17g}" if isinstance(c, float) else str(c) for n, c in some.items()}
    return variables.holds(condition, cells, option="-fails")


def draw(options: Namespace, table: Table) -> int:
    name = options.distribution
    require("-distribution", [name], table.rows[0])
    if options.o is None:
        raise ScriptError("-distribution without -o", expected="-o distribution.png")
    out = variables.out_file(options.o, *SUFFIXES)
    names = list(table.made.get("random", ())) or [
        n for n in table.variables if len({row[n] for row in table.rows}) > 2
    ]
    others = [n for n in table.variables if n not in names] if table.made.get("random") else []
    if len(several := samples_in(table.rows, others)) > 1:
        first, *_ = several
        raise ScriptError(
            f"the runs are {len(several)} samples: {'; '.join(several)}"[:200],
            expected="one of them, by -where",
            hint=f"-where '{first.replace(' = ', ' == ').replace(', ', ' && ')}'",
        )
    result = column(table.rows, name)
    some = np.isfinite(result)
    if some.sum() < 3:
        raise ScriptError(f"fewer than 3 runs have numbers of '{name}'")
    figure = blank_figure(2.6 * (len(names) + 1) + 1, 3.2)
    first, *panels = np.atleast_1d(figure.subplots(1, len(names) + 1))
    first.hist(result[some], bins="auto", density=True, color=look.PALETTE[1], alpha=0.5)
    for interval in statistics_of(result[some])[2:]:
        first.axvline(interval.value, color="0.2", linewidth=1)
        first.axvspan(interval.low, interval.high, color="0.2", alpha=0.15, linewidth=0)
    first.set(xlabel=table.label(name), ylabel="density")
    for axes, variable in zip(panels, names, strict=True):
        axes.plot(column(table.rows, variable)[some], result[some], ".", color=look.PALETTE[1])
        axes.set(xlabel=table.label(variable), ylabel=table.label(name))
    for axes in (first, *panels):
        tidy(axes)
        axes.set_axisbelow(True)
    first.set_title(options.title or table.title, loc="left", fontsize=10)
    savefig(figure, out)
    tell([{**row, "status": row.get("status", "done")} for row in table.rows], [name], None)
    print(f"drawn: {out}; lines: 5 %, 50 % and 95 %, with their 95 % intervals")
    return 0
