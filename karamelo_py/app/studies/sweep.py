"""karamelo-py sweep: every combination of values of variables, run and put into one table."""

import sys
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from karamelo_py.app.options import positive
from karamelo_py.app.studies import records, variables
from karamelo_py.app.studies.study import Study, results_table, terminal
from karamelo_py.script.errors import ScriptError, plural

DESCRIPTION = """\
Runs a script with every combination of values of its variables, and writes one table (CSV).

  karamelo-py sweep in.file -var N=10,20,40 -var basis=linear,quadratic-spline -record err,max:Etot

Each run has a folder of its own, named after its values, in a folder named after the table. A run
that fails is recorded with its reason and stops nothing; where none is done, the exit status is 1.
An interrupted sweep goes on where it stopped when the same command is given again. Processor,
threads and versions are written beside the table (sweep.json)."""


def add_options(parser: ArgumentParser) -> None:
    """Add what the subcommand takes."""
    variables.add_family(parser)
    variables.add_combinations(parser)
    parser.add_argument(
        "-record", default="", metavar="COLUMNS",
        help="log columns: err (the last value), max:err, min:err, mean:err, first:err, the time "
        "when:err:0.1; formulas of them: off=abs(max:u/3.28 - 1); with commas",
    )  # fmt: skip
    parser.add_argument(
        "-time", action="store_true",
        help="measure time: one run at a time, each repeated; seconds are the median",
    )  # fmt: skip
    parser.add_argument("-repeat", type=positive, default=3, help="repetitions of -time (3)")
    parser.add_argument("-o", type=Path, default=Path("sweep.csv"), help="the table (sweep.csv)")


def run(options: Any) -> int:
    """Do what the command line says; returns the exit status."""
    out = variables.out_file(options.o, ".csv")
    repeat = options.repeat if options.time else 1
    values, script, launch, jobs = variables.family(options, timed=options.time, repeat=repeat)
    combinations = variables.cases(values, variables.zipped(options), options.where)
    items = records.recorded(options.record, script, values)
    study = Study(launch, out, items, jobs, again=options.again, title=str(options.script))
    if study.folder.exists() and not study.folder.is_dir():
        expected = "a free name for the folder of the runs"
        raise ScriptError(f"{study.folder} is a file", expected=expected)
    record, computes = [item.text for item in items], script.computes()
    study.describe(
        variables=values, record=record, computes=computes, timed=options.time, repeat=repeat
    )
    try:
        rows = study.run(combinations)
    except KeyboardInterrupt:
        print(
            f"{len(study.rows)} of {len(combinations)} runs are in {out}; "
            "the same command goes on with the others",
            file=sys.stderr,
        )
        raise
    records.write(out, rows)
    tell(rows, values, items, study, out)
    if not any(row["status"] == "done" for row in rows):
        raise ScriptError(
            f"no run is done: {rows[0]['reason']}",
            hint=f"{out.parent / rows[0]['folder'] / 'err.txt'} has all that it said",
        )
    return 0


def tell(rows: list, values: dict, items: list, study: Study, out: Path) -> None:
    """Show the whole table and what became of the runs."""
    console = terminal()
    console.print(results_table(rows, list(values), items, study.title, console.width))
    done = sum(row["status"] == "done" for row in rows)
    left, old = len(rows) - done, len(rows) - study.ran
    said = f"{done} of {plural(len(rows), 'run')} {'is' if done == 1 else 'are'} done"
    said += f", {left} {'is' if left == 1 else 'are'} not (see reason)" if left else ""
    said += f"; {old} were known" if old > 0 else ""
    print(f"{said}; the table is {out}")
    refused = [row["reason"] for row in rows if row["status"] == "refused"]
    if refused and done:
        print(
            f"{len(refused)} of them {'was' if len(refused) == 1 else 'were'} refused before any "
            "step, by a mistake of the script: " + "; ".join([*dict.fromkeys(refused)][:3])
        )
