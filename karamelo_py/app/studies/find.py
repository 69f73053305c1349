"""karamelo-py find: the value of a variable at which a condition changes."""

import re
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from math import ceil, isnan, log2
from pathlib import Path

from karamelo_py.app.options import above_zero
from karamelo_py.app.studies import variables
from karamelo_py.app.studies.case import worded
from karamelo_py.app.studies.records import recorded
from karamelo_py.app.studies.study import Study, open_study
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.terms import number_of

DESCRIPTION = """\
Finds the value of a variable at which a condition of the results changes, by bisection: the factor
of safety of a slope, a limit load, a critical speed. The searched variable has two ends,
NAME=first:last. For each combination of values of other variables it finds one value.

  karamelo-py find in.slope -var F=1:2 -when 'time < 15' -within 0.01
  karamelo-py find in.slope -var F=1:2 -var N=40,80 -when 'max:sunk - first:sunk > 0.1'

The condition is a formula of log columns, as in sweep -record, and of the variables. It must differ
at the two ends. It should change once between them: bisection finds one change. The table (CSV) has
all runs. A run that fails ends the study, because its condition is unknown."""
ENDS = re.compile(r"([^\W\d]\w*)=([^:,]+):([^:,]+)")
EVENT = "event"
EXPECTED = "one variable with two ends, such as -var F=1:2"


def add_options(parser: ArgumentParser) -> None:
    variables.add_family(parser, "NAME=first:last for the searched one, else NAME=value,value,...")
    parser.add_argument(
        "-when", required=True, metavar="CONDITION",
        help="condition of log columns: 'time < 15', 'max:u > 0.1 || mean:err > 0.01'",
    )  # fmt: skip
    parser.add_argument(
        "-within", type=above_zero, metavar="WIDTH",
        help="tolerance of the value (1/100 of the range)",
    )  # fmt: skip
    parser.add_argument("-o", type=Path, default=Path("find.csv"), help="the table (find.csv)")


def run(options: Namespace) -> int:
    out = variables.out_file(options.o, ".csv")
    ends = [match for word in options.var if (match := ENDS.fullmatch(word.replace(" ", "")))]
    if len(ends) != 1:
        raise ScriptError(f"{len(ends)} variables have two ends", expected=EXPECTED)
    name, *texts = ends[0].groups()
    first, last = map(number_of, texts)
    if first is None or last is None or first == last:
        raise ScriptError(f"-var {ends[0][0]}: the ends are not two numbers", expected=EXPECTED)
    options.var = [
        f"{name}={','.join(texts)}" if ENDS.fullmatch(word.replace(" ", "")) else word
        for word in options.var
    ]
    plan = variables.family(options)
    within = options.within or abs(last - first) / 100
    items = recorded(f"{EVENT}={options.when}", plan.script, plan.values, "-when")
    if len(items) != 1:
        raise ScriptError(f"-when {options.when}", expected="one condition")
    others = {other: values for other, values in plan.values.items() if other != name}
    cases = variables.cases(others) if others else [{}]
    halvings = max(ceil(log2(abs(last - first) / within)), 0)
    study = open_study(
        options, plan, out, items, strict=True, most=len(cases) * (2 + halvings),
        title=str(options.script), facts={"when": options.when, "within": within},
    )  # fmt: skip

    def happens(values: list[str]) -> list[bool]:
        named = [case | {name: value} for case, value in zip(cases, values, strict=True)]
        return judged(study, [{n: one[n] for n in plan.values} for one in named], options.when)

    before, after = happens(texts[:1] * len(cases)), happens(texts[1:] * len(cases))
    for case, begins, changed in zip(cases, before, after, strict=True):
        if begins == changed:
            so = "true" if begins else "false"
            at = f"with {worded(case)}, " if case else ""
            raise ScriptError(
                f"{at}{options.when} is {so} at both ends, {name} = {texts[0]} and {texts[1]}",
                expected="ends between which the condition changes",
            )
    low, high = ([number] * len(cases) for number in (first, last))
    for _ in range(halvings):
        middle = [f"{(a + b) / 2:.10g}" for a, b in zip(low, high, strict=True)]
        for k, event in enumerate(happens(middle)):
            (low if event == before[k] else high)[k] = float(middle[k])
    for case, a, b, begins in zip(cases, low, high, before, strict=True):
        at = f"{worded(case)}: " if case else ""
        words = ("true", "false") if begins else ("false", "true")
        print(f"{at}{name} = {(a + b) / 2:.6g} +- {abs(b - a) / 2:.2g} ({options.when} is "
              f"{words[0]} at {a:.6g}, {words[1]} at {b:.6g})")  # fmt: skip
    print(f"the table is {out}")
    return 0


def judged(study: Study, cases: list[Mapping[str, str]], condition: str) -> list[bool]:
    events = []
    for row, case in zip(study.run(cases), cases, strict=True):
        if row[EVENT] is None or isnan(row[EVENT]):
            raise ScriptError(
                f"with {worded(case)}, {condition} has no value: {row['reason'] or 'it is NaN'}",
                expected="runs that reach their end, and a condition of log columns",
            )
        events.append(row[EVENT] != 0)
    return events
