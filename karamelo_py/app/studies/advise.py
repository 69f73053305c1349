"""karamelo-py advise: the cheapest variant of a script that is accurate enough."""

import subprocess
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, prod
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from karamelo_py.app.options import above_zero, positive
from karamelo_py.app.studies import look, records, variables
from karamelo_py.app.studies.case import (
    PROGRAM,
    CaseOutcome,
    Record,
    Refused,
    Row,
    command_of,
    environment,
    error_of,
    options_of,
    record_of,
    worded,
)
from karamelo_py.app.studies.curves import (
    REACHED,
    WORSE,
    by_chance,
    column,
    credible,
    errors,
    order,
    reached,
    sizes,
    usable,
)
from karamelo_py.app.studies.study import Study, open_study, plain_table, shown, terminal
from karamelo_py.kernels.clock import STILL
from karamelo_py.output.record import NAME
from karamelo_py.script.errors import ScriptError, plural
from karamelo_py.script.terms import number_of

DESCRIPTION = """\
Runs the small members of a family, extrapolates error and cost, and says which variant meets a
target at the least cost, with what certainty, and how to set it.

  karamelo-py advise in.file -var N=10,20,40,80,160 -var basis=linear,cubic-spline \\
    -accuracy err -target 1e-3

One variable, the number with the most values, makes a scene finer; the others are choices. Where
all numbers have one value, words are compared at that size. Cases run one at a time, to measure
their times, unless another cost is named. Runs of an earlier call are used. A run that meets the
target by chance is not advised: if the sign of its error changes, its order exceeds the order of
the basis, or a finer run is worse; finer runs are made to check. With -run the variant is run and
checked against the target. With method(auto, accuracy=0.01) the script states the target, and the
choice of the program is compared with other set-ups (-var auto=rules,linear: only with linear)."""


# Bases whose gradients jump between cells, and methods whose points cross cells.
JUMPING, CROSSED = ("linear", "Bernstein-quadratic"), ("ulmpm", "ulmpm/contacts")
ALONE = "no finer run is known"
UNFOLLOWED = f"{ALONE}, whose points may cross cells"
SECOND = 2.0  # order that all methods may reach


@dataclass(frozen=True)
class Forecast:
    error: float
    low: float
    high: float
    cost: float


def forecast(
    x: float, xs: Sequence[float], rows: Sequence[Row], accuracy: str, cost: str, *,
    highest: float = 4.0,
) -> Forecast | None:  # fmt: skip
    """Predict error and cost at `x` from runs at `xs`, coarse ones first.

    The result is None if fewer than two errors are known, or if the last error is larger than the
    one before. The error is extrapolated with the last order. The bounds of the error follow from
    the smallest and the largest order; they are at least 33 % above and 50 % below the error. An
    order that fell may fall as much again; an order below 2 may reach 2. Errors that are small by
    chance are replaced by `credible` ones. The time is fitted by steps times (a + b points); other
    costs are extrapolated from the last two runs.
    """
    xs, signed = np.asarray(xs, float), errors(rows, accuracy)
    error = credible(xs, signed, highest)
    good = np.isfinite(error) & (error > 0) & (signed != 0)
    if good.sum() < 2 or not good[-1]:
        return None
    xs, error, signed_size = xs[good], error[good], np.abs(signed[good])
    rows = [row for row, is_good in zip(rows, good, strict=True) if is_good]
    # If an error is overestimated, the next one would seem to fall too steeply.
    way, ways = abs(np.log(x / xs[-1])), np.abs(np.diff(np.log(xs)))
    fall = np.fmax(np.diff(np.log(error)), np.fmin(np.diff(np.log(signed_size)), 0.0)) / ways
    if fall[-1] >= 0:
        return None
    expected = -fall[-1]
    rates = [-f for f in fall if f < 0]
    drop = max(-fall[-2] - expected, 0.0) if len(fall) > 1 else 0.0
    slow = max(min(*rates, expected / 2, expected - drop), 0.0)
    fast = max(*rates, 4 / 3 * expected, min(highest, SECOND) if drop == 0 else 0.0)
    at = [float(error[-1] * np.exp(-rate * way)) for rate in (expected, fast, slow)]
    return Forecast(*at, _cost(x, xs, rows, cost))


def _cost(x: float, xs: np.ndarray, rows: Sequence[Row], cost: str) -> float:
    values = column(rows, cost)
    if cost == "seconds" and all(usable(a) for a in values):
        steps, points = (np.array(column(rows, name), float) for name in ("steps", "points"))
        # Use equal weights for relative errors; both terms of the time are at least 0.
        matrix = np.stack([steps, steps * points], axis=1) / values[:, None]
        parts = np.linalg.lstsq(matrix, np.ones(len(values)), rcond=None)[0]
        if (parts < 0).any():
            best = int(np.argmax(parts))
            parts = np.zeros(2)
            parts[best] = 1 / np.mean(matrix[:, best])
        more = [_power(x, xs, of) for of in (steps, points)]
        return float(more[0] * (parts[0] + parts[1] * more[1]))
    return _power(x, xs, values)


def _power(x: float, xs: np.ndarray, values: np.ndarray) -> float:
    exponent = order(xs[-2:], values[-2:]).exponent
    return float(values[-1] * (x / xs[-1]) ** (exponent if np.isfinite(exponent) else 0.0))


@dataclass
class ChoiceRuns:
    values: dict[str, str]
    rows: list[Row] = field(default_factory=list)
    words: frozenset[str] = frozenset()
    lines: tuple[str, ...] = ()  # lines of the script, written by method(auto)
    warnings: tuple[str, ...] = ()  # warnings of the finest run

    @property
    def label(self) -> str:
        return worded(self.values) or "the script"

    @property
    def kind(self) -> set[str]:
        return {*self.values.values(), *self.words} & {*REACHED, *look.FAMILIES[2]}

    @property
    def highest(self) -> float:
        return reached(self.kind)

    def look(self, folder: Path) -> None:
        source = folder / self.rows[-1]["folder"]
        record = record_of(source)
        first: dict[str, Any] = next(iter(record.get("runs", ())), {})
        self.words = frozenset(first.get("method", "").split())
        self.lines = tuple(first.get("chosen", {}).get("lines", ()))
        notes = record.get("messages", [])
        self.warnings = tuple(note["text"] for note in notes if note["kind"] == "warning")


@dataclass
class Candidate:
    choice: ChoiceRuns
    step: int
    cost: float
    error: float
    forecast: Forecast | None = None
    chance: str = ""


class Adviser:
    """Finds the cheapest variant whose error is at most `target`.

    `along` is the variable that refines a scene, coarse values first; `accuracy` and `cost` are
    columns of the table. `width` is the number of simultaneous runs.
    """

    def __init__(
        self, study: Study, along: tuple[str, list[str]], choices: list[ChoiceRuns], *,
        accuracy: str, cost: str, target: float, width: int = 1,
    ):  # fmt: skip
        self.study, self.width = study, width
        self.name, self.values = along
        self.xs = [float(value) for value in self.values]
        self.choices = choices
        self.accuracy, self.cost, self.target = accuracy, cost, target

    def go_on(self, *choices: ChoiceRuns) -> None:
        rows = self.study.run([self._next(choice) for choice in choices])
        for choice, row in zip(choices, rows, strict=True):
            choice.rows.append(row)
            choice.look(self.study.folder.parent)

    def _next(self, choice: ChoiceRuns) -> dict[str, str]:
        case = {**choice.values, self.name: self.values[len(choice.rows)]}
        return {name: case[name] for name in self.study.names}

    def pilot(self, count: int) -> None:
        for _ in range(min(count, len(self.values))):
            self.go_on(*(choice for choice in self.choices if not self._met(choice)))
        for choice in self.choices:
            while len(choice.rows) < len(self.values) and self.study.knows(self._next(choice)):
                self.go_on(choice)

    def _met(self, choice: ChoiceRuns) -> list[Candidate]:
        signed = errors(choice.rows, self.accuracy)
        costs = column(choice.rows, self.cost)
        chances = by_chance(self.xs[: len(signed)], signed, choice.highest)
        if len(chances) == 1 < len(self.values):
            chances = [ALONE]
        elif 0 < len(chances) < len(self.values):
            if self._crosses(choice, len(chances)):
                chances[-1] = chances[-1] or UNFOLLOWED
        else:  # no finer run that misses the target
            meets = np.logical_and.accumulate(np.abs(signed[::-1]) <= self.target)[::-1]
            chances[:-1] = ["" if ok else w for w, ok in zip(chances, meets[:-1], strict=False)]
        return [
            Candidate(choice, k, cost, abs(error), None, chance)
            for k, (cost, error, chance) in enumerate(zip(costs, signed, chances, strict=True))
            if abs(error) <= self.target
        ]

    def _crosses(self, choice: ChoiceRuns, step: int) -> bool:
        finer = np.exp(abs(np.log(self.xs[step] / self.xs[len(choice.rows) - 1])))
        stay = column(choice.rows[-1:], "path")[0] * finer <= STILL  # NaN if unknown
        return not stay and bool(choice.kind & {*JUMPING} and choice.kind & {*CROSSED})

    def candidate(
        self, choice: ChoiceRuns, hope: bool = False, lucky: bool = False
    ) -> Candidate | None:
        """Return the cheapest variant of a choice that is known or expected to meet the target.

        With `hope`, the lower bound of the error is used; with `lucky`, errors that are small by
        chance are accepted.
        """
        met = [run for run in self._met(choice) if lucky or not run.chance]
        if met or lucky:
            return met[0] if met else None
        xs = self.xs[: len(choice.rows)]
        for step in range(len(xs), len(self.xs)):
            run = forecast(
                self.xs[step], xs, choice.rows, self.accuracy, self.cost, highest=choice.highest
            )
            if run is None:
                break
            if (run.low if hope else run.error) <= self.target:
                return Candidate(choice, step, run.cost, run.error, run)
        return None

    def lucky(self) -> Candidate | None:
        candidates = filter(None, (self.candidate(choice, lucky=True) for choice in self.choices))
        return min(candidates, key=lambda c: c.cost, default=None)

    def candidates(self, hope: bool = False) -> list[Candidate]:
        chosen = filter(None, (self.candidate(choice, hope) for choice in self.choices))
        return sorted(chosen, key=lambda c: c.cost)

    def best(self) -> Candidate | None:
        """Return the best candidate, after all runs that may change the choice.

        Choices that could become the cheapest are refined to the variant before their candidate.
        """
        while True:
            best = next(iter(self.candidates()), None)
            limit = best.cost if best else inf
            if (doubted := self._doubted(limit)) is not None:
                self.go_on(doubted)
                continue
            doubtful = [
                c for c in self.candidates(hope=True)
                if c.forecast and c.step > len(c.choice.rows) and c.cost <= limit
            ]  # fmt: skip
            follow = [c.choice for c in doubtful[: self.width]]
            follow = follow or [*filter(None, [self._risen(limit)])]
            if not follow:
                return best
            self.go_on(*follow)

    def _doubted(self, limit: float) -> ChoiceRuns | None:
        for choice in self.choices:
            finest = len(choice.rows) - 1
            for last in self._met(choice)[-1:] if finest < len(self.values) - 1 else ():
                if last.chance and last.step == finest and last.cost < limit:
                    return choice
        return None

    def _risen(self, limit: float) -> ChoiceRuns | None:
        for choice in self.choices:
            count = len(choice.rows)
            fell = np.diff(sizes(choice.rows, self.accuracy)) < 0
            if not 2 < count < len(self.xs) or fell[-1] or not fell[:-1].all():
                continue
            if _cost(self.xs[count], np.array(self.xs[:count]), choice.rows, self.cost) < limit:
                return choice
        return None

    def doubts(self, best: Candidate) -> list[str]:
        reasons = [f"its runs warn: {text}" for text in best.choice.warnings[:1]]
        if self._crosses(best.choice, best.step):
            basis = ", ".join(best.choice.kind & {*JUMPING})
            reasons.append(
                f"the gradient of the {basis} basis jumps between cells: errors grow once points "
                "cross them, more so on finer grids"
            )
        for other in self.choices:
            if other.kind != best.choice.kind:
                continue
            signed = errors(other.rows, self.accuracy)
            sizes = np.abs(signed)
            floor = np.nanmin(credible(self.xs[: len(sizes)], signed, other.highest))
            if sizes[-1] > WORSE * np.nanmin(sizes) and floor > best.forecast.low:
                text = f"{other.label} did not stay below {floor:.3g}"
                reasons.append(f"errors with the same basis rose again on finer grids: {text}")
        return reasons

    def hopeful(self) -> Candidate | None:
        return next((c for c in self.candidates(hope=True) if c.forecast), None)

    def label(self, choice: ChoiceRuns, step: int) -> str:
        return worded({**choice.values, **self.at(step)})

    def at(self, step: int) -> dict[str, str]:
        return {self.name: self.values[step]}


def add_options(parser: ArgumentParser) -> None:
    variables.add_family(parser)
    variables.add_combinations(parser)
    parser.add_argument(
        "-accuracy", required=True, metavar="COLUMN",
        help="log column: err, max:err, or a formula: off=abs(max:u/3.28 - 1)",
    )  # fmt: skip
    parser.add_argument(
        "-target", type=above_zero,
        help="largest error allowed (default: accuracy in method(auto, accuracy=0.01))",
    )  # fmt: skip
    parser.add_argument("-cost", default="seconds", help="column of the cost (seconds)")
    parser.add_argument("-along", metavar="NAME", help="variable that refines the scene")
    parser.add_argument("-pilot", type=positive, default=3, help="first runs of each choice (3)")
    parser.add_argument("-run", action="store_true", help="run the advised set-up")
    parser.add_argument("-o", type=Path, default=Path("advise.csv"), help="table (advise.csv)")


def run(options: Namespace) -> int:
    out = variables.out_file(options.o, ".csv")
    timed = options.cost in ("seconds", "wall_s", "particle_steps_per_s")
    plan = variables.family(options, timed=timed)
    values = plan.values
    items = records.recorded(options.accuracy, plan.script, values, "-accuracy")
    if len(items) != 1:
        raise ScriptError(f"-accuracy {options.accuracy}", expected="one column")
    if options.cost not in records.COLUMNS:
        raise ScriptError(f"-cost {options.cost}", expected="one of " + ", ".join(records.COLUMNS))
    numeric = [name for name in values if all(number_of(v) is not None for v in values[name])]
    name = options.along or max(numeric, key=lambda n: len(values[n]), default=None)
    finer = "a number with at least 3 values, such as -var N=10,20,40,80, or with one value and "
    finer += "words to compare"
    if name not in numeric:
        raise ScriptError("no variable makes the scene finer", expected=finer)
    together = variables.zipped(options)
    if any(name in group for group in together):
        raise ScriptError(f"-zip: {name} makes the scene finer", expected="choices in step")
    target, chosen = options.target, {}
    if ["auto"] in (words[:1] for words in plan.script.words("method")):
        chosen = chosen_in(options.script, {name: texts[0] for name, texts in values.items()})
        target = target or chosen.get("accuracy")
        if "alternatives" in chosen:
            values.setdefault("auto", chosen["alternatives"])
    if target is None:
        expected = "-target 1e-2, or method(auto, accuracy=0.01) in the script"
        raise ScriptError("there is no largest error", expected=expected)
    compared = len(values[name]) == 1 < prod(map(len, values.values()))
    if len(values[name]) < 3 and not compared:
        wrong = f"-var {name} has {plural(len(values[name]), 'value')}"
        raise ScriptError(wrong, expected=finer)
    others = {n: v for n, v in values.items() if n != name}
    combined = variables.cases(others, together, options.where) if others else [{}]
    choices = [ChoiceRuns(case) for case in combined]
    most = len(choices) * len(values[name])
    facts = {"record": [items[0].text], "timed": timed, "repeat": 1}
    study = open_study(options, plan, out, items, strict=True, most=most, facts=facts)
    ordered = values[name]
    if len(ordered) > 1:
        ordered = coarse_first(options.script, name, ordered, choices[0].values)
    goal = {"accuracy": items[0].word, "cost": options.cost, "target": target}
    adviser = Adviser(study, (name, ordered), choices, width=study.place.size, **goal)
    adviser.pilot(options.pilot)
    best = adviser.best()
    tell(adviser)
    if best is not None:
        advise(adviser, best, options.script)
    elif not options.run:
        return _nothing(adviser)
    return carry_out(adviser, best, options.script) if options.run else 0


def check(script: Path, case: Mapping[str, str], folder: str) -> Record:
    command = [*PROGRAM, "check", str(script), "--threads", "1"]
    command += ["-record", str(Path(folder) / NAME), *options_of(case)]
    subprocess.run(command, capture_output=True, env=environment())
    return record_of(Path(folder))


def chosen_in(script: Path, case: Mapping[str, str]) -> dict[str, Any]:
    """Return the choice of ``method(auto)`` in a case, and other set-ups that it supports."""
    with TemporaryDirectory() as folder:
        record = check(script, case, folder)
        if error := error_of(record):
            raise Refused(case, CaseOutcome("refused", error["text"], folder=Path(folder)))
    return next((one["chosen"] for one in record.get("runs", ()) if "chosen" in one), {})


def coarse_first(
    script: Path, name: str, values: list[str], others: Mapping[str, str]
) -> list[str]:
    ordered = sorted(values, key=float)
    work = []
    for value in (ordered[0], ordered[-1]):
        with TemporaryDirectory() as folder:
            runs = check(script, {name: value, **others}, folder).get("runs")
        work.append(runs[0]["points"] / runs[0]["dt"] if runs else None)
    if None not in work and work[0] > work[1]:
        ordered.reverse()
    return ordered


def tell(adviser: Adviser) -> None:
    headings = ("runs", f"finest {adviser.name}", adviser.accuracy, "order", "meets it at", "cost")
    table = plain_table(["choice"], headings)
    for choice in adviser.choices:
        signed = errors(choice.rows, adviser.accuracy)
        last, count = choice.rows[-1], len(choice.rows)
        candidate = adviser.candidate(choice) or adviser.candidate(choice, lucky=True)
        where = cost = error = "–"
        if candidate is not None:
            where = adviser.values[candidate.step] + " by chance" * bool(candidate.chance)
            cost = "about " * bool(candidate.forecast) + shown(float(candidate.cost))
        fit = f"{last['status']}: {last['reason']}"[:60]
        if np.isfinite(signed[-1]):
            xs = adviser.xs[:count]
            error, fit = shown(float(signed[-1])), str(order(xs, np.abs(signed)).towards(xs))
        table.add_row(choice.label, str(count), adviser.values[count - 1], error, fit, where, cost)
    terminal().print(table)


def advise(adviser: Adviser, best: Candidate, script: Path) -> None:
    values = {**best.choice.values, adviser.name: adviser.values[best.step]}
    print(f"\nfor {adviser.accuracy} <= {adviser.target:g} at the least {adviser.cost}:")
    for name, value in values.items():
        if name != "auto":
            text = value if number_of(value) is not None else f'"{value}"'
            print(f"  {name} = {text}")
    for line in best.choice.lines:
        print(f"  {line}")
    print(f"or: {command_of(script, values)}")
    print(sureness(adviser, best))
    lucky = adviser.lucky()
    if lucky is not None and lucky.chance and lucky.cost < best.cost:
        print(f"cheaper, but perhaps by chance: {by_luck(adviser, lucky)}")


def by_luck(adviser: Adviser, lucky: Candidate) -> str:
    numbers = f"{adviser.accuracy} {lucky.error:.3g}, {adviser.cost} {lucky.cost:.3g}"
    return f"{adviser.label(lucky.choice, lucky.step)} ({numbers}): {lucky.chance}"


def sureness(adviser: Adviser, best: Candidate) -> str:
    numbers = f"{adviser.accuracy} {best.error:.3g}, {adviser.cost} {best.cost:.3g}"
    if best.forecast is None:
        alone = ", and it is not known whether finer runs are as good" * (len(adviser.values) == 1)
        return f"sure: it was run ({numbers}){alone}"
    if doubts := adviser.doubts(best):
        return "\n  ".join(
            [f"not sure: expected {numbers}, if the error continues to fall", *doubts]
        )
    low, high = best.forecast.low, best.forecast.high
    word = "almost sure"
    if high > adviser.target:
        near = adviser.target**2 < best.error * high
        word = "uncertain" if near else "likely"
    return f"{word}: expected {numbers}; its orders give an error from {low:.3g} to {high:.3g}"


def _nothing(adviser: Adviser) -> int:
    lucky = adviser.lucky()
    luck = ", unless by chance" * (lucky is not None)
    print(f"\nno variant is expected to reach {adviser.accuracy} <= {adviser.target:g}{luck}")
    sizes = [
        (abs(error), adviser.label(choice, k))
        for choice in adviser.choices
        for k, error in enumerate(errors(choice.rows, adviser.accuracy)) if np.isfinite(error)
    ]  # fmt: skip
    if lucky is not None:
        print(f"reaches it only by chance: {by_luck(adviser, lucky)}")
    elif sizes:
        error, label = min(sizes, key=lambda item: item[0])
        further = f"finer values of {adviser.name} or other choices may suffice"
        print(f"nearest: {label} with {error:.3g}; {further}")
    hope = adviser.hopeful()
    if hope is not None:
        print(
            f"{adviser.label(hope.choice, hope.step)} may suffice, at about {adviser.cost} "
            f"{hope.cost:.3g}: expected {hope.error:.3g}, at best {hope.forecast.low:.3g}; "
            "-run tries it"
        )
    return 1


def carry_out(adviser: Adviser, best: Candidate | None, script: Path) -> int:
    best = best or adviser.hopeful()
    while best is not None and best.forecast is not None:
        advised = best.step == len(best.choice.rows)
        adviser.go_on(best.choice)
        row = best.choice.rows[-1]
        error = abs(errors([row], adviser.accuracy)[0])
        state = "met" if error <= adviser.target else "missed" if advised else "not yet met"
        label = adviser.label(best.choice, len(best.choice.rows) - 1)
        print(f"\nrun: {label}: {adviser.accuracy} {error:.4g}, the target is {state}")
        if row["reason"]:
            print(f"{row['status']}: {row['reason']}")
        best = adviser.best()
        if best is not None and best.forecast is not None:
            advise(adviser, best, script)
        best = best or adviser.hopeful()
    if best is None:
        return _nothing(adviser)
    print(
        f"\nthe target is met: {adviser.label(best.choice, best.step)} with {adviser.accuracy} "
        f"{best.error:.4g} at {adviser.cost} {best.cost:.4g}; its files are in "
        f"{best.choice.rows[best.step]['folder']}"
    )
    return 0
