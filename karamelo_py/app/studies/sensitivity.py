"""karamelo-py sensitivity: which variables matter for a result."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.options import positive
from karamelo_py.app.studies import surrogate, variables
from karamelo_py.app.studies.case import worded
from karamelo_py.app.studies.records import recorded, value, write
from karamelo_py.app.studies.sampling import (
    KINDS,
    Random,
    described,
    needs_scipy,
    random_variables,
    require_power_of_2,
)
from karamelo_py.app.studies.study import Study, open_study, plain_table, shown, terminal
from karamelo_py.app.studies.uncertainty import RESAMPLED, SURE, Interval
from karamelo_py.script.errors import ScriptError, plural

DESCRIPTION = """\
Says which random variables matter for a result, by runs of a script.

  karamelo-py sensitivity in.slope -var 'phi=uniform(25, 35)' -var 'c=normal(5e3, 1e3)' -record u
  karamelo-py sensitivity in.slope -method morris -n 10 ...     first: which of many matter at all

sobol: the fraction of the variance that a variable explains by itself (first), and with all its
interactions (total), with 95 % confidence intervals (Saltelli et al. 2010); n (d + 2) runs for d
variables.
morris: how much a variable changes the result over its range (1 % to 99 % quantile): mean absolute
change (mu*), and standard deviation of the changes (sigma), which shows curvature and interaction
(Morris 1991; Campolongo et al. 2007); n (d + 1) runs.
fit: for expensive runs: sobol indices of a surrogate fitted to n runs, a polynomial or a Gaussian
process, whichever has the smaller leave-one-out error (printed). Existing runs are reused."""
DOUBTED = 0.2  # leave-one-out error / standard deviation of the runs for a warning
LEVELS = 4  # values of each variable in method morris
ENDS = 0.01, 0.99  # quantiles at the ends of a range

Results = Callable[[np.ndarray], np.ndarray]  # maps (d, n) to (results, n)


def _problem(laws: Sequence) -> dict[str, Any]:
    names = [f"x{k}" for k in range(len(laws))]
    return {"num_vars": len(laws), "names": names, "bounds": [[0.0, 1.0]] * len(laws)}


def _intervals(analysis: Mapping, word: str) -> list[Interval]:
    middles, halves = (np.asarray(analysis[name], float) for name in (word, f"{word}_conf"))
    return [
        Interval(m, m - h, m + h) for m, h in zip(middles.tolist(), halves.tolist(), strict=True)
    ]


def sobol(
    laws: Sequence, results: Results, n: int, seed: int
) -> list[list[tuple[Interval, Interval]]]:
    from SALib.analyze import sobol as analyzer
    from SALib.sample import sobol as sampler

    require_power_of_2("-n", n)
    problem = _problem(laws)
    how: dict[str, Any] = {"calc_second_order": False, "seed": seed}
    parts = sampler.sample(problem, n, **how)
    numbers = results(np.array([law.ppf(u) for law, u in zip(laws, parts.T, strict=True)]))
    how |= {"num_resamples": RESAMPLED // 4, "conf_level": SURE}
    analyses = [analyzer.analyze(problem, one, **how) for one in numbers]
    return [[*zip(_intervals(one, "S1"), _intervals(one, "ST"), strict=True)] for one in analyses]


def morris(
    laws: Sequence, results: Results, n: int, seed: int
) -> list[list[tuple[Interval, float]]]:
    from SALib.analyze import morris as analyzer
    from SALib.sample import morris as sampler

    low, high = (np.array([law.ppf(end) for law in laws]) for end in ENDS)
    problem = _problem(laws)
    how: dict[str, Any] = {"num_levels": LEVELS, "seed": seed}
    parts = sampler.sample(problem, n, **how)
    numbers = results((low + parts * (high - low)).T)
    how |= {"conf_level": SURE, "print_to_console": False}
    analyses = [analyzer.analyze(problem, parts, one, **how) for one in numbers]
    return [
        [*zip(_intervals(one, "mu_star"), map(float, one["sigma"]), strict=True)]
        for one in analyses
    ]


def results_of(study: Study, randoms: Sequence[Random], fixed: dict[str, str]) -> Results:
    def results(numbers: np.ndarray) -> np.ndarray:
        cases = [
            {one.name: f"{x:.10g}" for one, x in zip(randoms, column, strict=True)} | fixed
            for column in np.atleast_2d(numbers).T
        ]
        rows = study.run(cases)
        made = [[value(row, item.word) for item in study.items] for row in rows]
        for case, row, one in zip(cases, rows, made, strict=True):
            if None in one or not np.isfinite(one).all():
                raise ScriptError(
                    f"the run with {worded(case)} has no result: {row['reason'] or row['status']}",
                    hint="narrower distributions: every run must have a result",
                )
        return np.array(made, float).T

    return results


def add_options(parser: ArgumentParser) -> None:
    variables.add_family(parser, ", ".join(KINDS.values()) + "; or one value")
    parser.add_argument(
        "-record", action="append", required=True, metavar="COLUMNS",
        help="results: log columns as for sweep",
    )  # fmt: skip
    parser.add_argument(
        "-method", choices=("sobol", "morris", "fit"), default="sobol", help="indices (sobol)"
    )
    parser.add_argument("-n", type=positive, default=64, help="base number n of samples (64)")
    parser.add_argument("-seed", type=int, default=1, help="random seed of the samples (1)")
    parser.add_argument(
        "-o", type=Path, default=Path("sensitivity.csv"), help="table of runs (sensitivity.csv)"
    )


def run(options: Namespace) -> int:
    needs_scipy("sensitivity")
    if options.method != "fit" and find_spec("SALib") is None:
        hint = "pip install '.[studies]' in the folder of karamelo-py"
        raise ScriptError(
            f"karamelo-py sensitivity -method {options.method} needs SALib", hint=hint
        )
    out = variables.out_file(options.o, ".csv")
    randoms, options.var = random_variables(options.var)
    if len(randoms) < 2:
        expected = "two of " + ", ".join(KINDS.values())
        raise ScriptError("sensitivity compares random variables", expected=expected)
    fixed = variables.choices(options.var)
    if several := next((name for name, words in fixed.items() if words[1:]), None):
        raise ScriptError(f"-var {several} has several values", expected="one, or a distribution")
    options.var = [f"{one.name}={one.law.ppf(0.3):.10g},{one.law.ppf(0.7):.10g}" for one in randoms]
    options.var += [f"{name}={word}" for name, (word,) in fixed.items()]
    plan = variables.family(options)
    items = recorded(",".join(options.record), plan.script, plan.values)
    runs = (
        options.n
        * {"sobol": len(randoms) + 2, "morris": len(randoms) + 1, "fit": 1}[options.method]
    )
    facts = {"random": described(randoms), "method": options.method, "n": options.n}
    study = open_study(options, plan, out, items, strict=True, most=runs, facts=facts)
    results = results_of(study, randoms, {name: word for name, (word,) in fixed.items()})
    laws = [one.law for one in randoms]
    method: Callable = {"sobol": sobol, "morris": morris, "fit": surrogate.indices}[options.method]
    indices, fits = method(laws, results, options.n, options.seed), []
    if options.method == "fit":
        indices, fits = indices
    write(out, list(study.rows.values()))
    heads = ["mu*", "sigma"] if options.method == "morris" else ["first", "total"]
    for item, rows in zip(items, indices, strict=True):
        table = plain_table(["variable"], heads, f"\n{item.word}")
        for one, pair in zip(randoms, rows, strict=True):
            table.add_row(
                one.name, *[str(x) if isinstance(x, Interval) else shown(x) for x in pair]
            )
        terminal().print(table)
        if options.method == "sobol":
            widest = max(total.high - total.low for _, total in rows)
            if widest > 0.2:
                more = 2 * options.n
                print(f"intervals are up to {widest:.2g} wide: -n {more} makes them narrower")
    for item, (name, wrong) in zip(items, fits, strict=False):
        print(f"{item.word}: {name} has a leave-one-out error of {wrong:.2g} standard deviations")
        if wrong > DOUBTED:
            print(f"too large for reliable indices: -n {2 * options.n}, or -method sobol")
    print(f"{plural(len(study.rows), 'run')}; the table is {out}")
    return 0
