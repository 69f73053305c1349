"""karamelo-py sweep: run a script with many values of its variables."""

from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from karamelo_py.app.options import positive
from karamelo_py.app.studies import sampling, uncertainty, variables
from karamelo_py.app.studies.case import COLUMNS, Row
from karamelo_py.app.studies.records import recorded, write
from karamelo_py.app.studies.study import Study, open_study, results_table, terminal
from karamelo_py.script.errors import ScriptError, plural

DESCRIPTION = """\
Runs a script with every combination of values of its variables, and writes one table (CSV).

  karamelo-py sweep in.file -var N=10,20,40 -var basis=linear,quadratic-spline -record err,max:Etot

Each run has a separate folder, named after its values, in a folder named after the table. A run
that fails is recorded with its reason, and the sweep continues. The exit status is 0 if all runs
are done, else 1. An interrupted sweep continues where it stopped when the same command is given
again.
Processor, threads and versions are written next to the table (sweep.json)."""


def add_options(parser: ArgumentParser) -> None:
    variables.add_family(parser)
    variables.add_combinations(parser)
    sampling.add_options(parser)
    parser.add_argument(
        "-record", action="append", default=[], metavar="COLUMNS",
        help="log columns, separated by commas: err (the last value), max:err, min:err, mean:err, "
        "first:err, the time when:err:0.1, or a formula: off=abs(max:u/3.28 - 1)",
    )  # fmt: skip
    parser.add_argument(
        "-time", action="store_true",
        help="measure time: one run at a time, each several times; the table has the median",
    )  # fmt: skip
    parser.add_argument("-repeat", type=positive, default=3, help="repetitions for -time (3)")
    parser.add_argument("-o", type=Path, default=Path("sweep.csv"), help="the table (sweep.csv)")


def run(options: Namespace) -> int:
    out = variables.out_file(options.o, ".csv")
    drawn = sampling.prepare(options)
    repeat = options.repeat if options.time else 1
    plan = variables.family(options, timed=options.time, repeat=repeat)
    combinations = variables.cases(plan.values, variables.zipped(options), options.where)
    items = recorded(",".join(options.record), plan.script, plan.values)
    if options.fails:
        uncertainty.check(options.fails, [*plan.values, *(item.word for item in items), *COLUMNS])
    if options.keep and not options.on:
        raise ScriptError("-keep without -on", expected="-on WHERE (local files always stay)")
    facts = {
        "record": [item.text for item in items], "computes": plan.script.computes(),
        "timed": options.time, "repeat": repeat, **drawn,
    }  # fmt: skip
    if not items and not options.time:
        print("note: without -record NAME no result is recorded, only how the runs end")
    study = open_study(options, plan, out, items, title=str(options.script), facts=facts)
    rows = study.run(combinations)
    write(out, rows)
    tell(rows, study)
    if drawn:
        others = [name for name in plan.values if name not in drawn["random"]]
        uncertainty.tell(rows, [item.word for item in items], options.fails, others)
    if not items and not options.time:
        print("no result is recorded: repeat the command with -record NAME, which reads the logs")
    if not any(row["status"] == "done" for row in rows):
        messages = out.parent / rows[0]["folder"] / "err.txt"
        hint = f"{messages} has all its messages" if messages.is_file() else None
        raise ScriptError(f"no run is done: {rows[0]['reason']}", hint=hint)
    return int(any(row["status"] != "done" for row in rows))


def tell(rows: Sequence[Row], study: Study) -> None:
    console = terminal()
    console.print(results_table(rows, study, console))
    ends, old = Counter(row["status"] for row in rows), len(rows) - study.ran
    done = ends.pop("done", 0)
    text = f"{done} of {plural(len(rows), 'run')} {'is' if done == 1 else 'are'} done"
    text += "".join(f", {count} {status}" for status, count in ends.items())
    text += f"; {old} were known" if old > 0 else ""
    print(f"{text}; the table is {study.out}")
    refused = dict.fromkeys(row["reason"] for row in rows if row["status"] == "refused")
    if refused and done:
        print(f"refused before any step, by a mistake of the script: {'; '.join([*refused][:3])}")
    failed = dict.fromkeys(row["reason"] for row in rows if row["status"] == "failed")
    for reason in [*failed][:3] if done else ():
        print(f"failed: {reason}")
