"""karamelo-py chart: what accuracy costs, how errors fall, where two variables lead."""

from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.studies import keeping, look, page, pictures, records
from karamelo_py.app.studies.curves import Family, Table, order, require
from karamelo_py.app.studies.study import plain_table, shown, terminal
from karamelo_py.app.studies.variables import add_axes, along, holds, names, out_file, split
from karamelo_py.script.errors import ScriptError

DESCRIPTION = """\
Draws the table of a sweep: errors over costs on logarithmic axes, a line for each choice, and the
Pareto front (runs that none beats in both). Prints the same as a table, with fitted orders.

  karamelo-py chart sweep.csv -accuracy err -cost seconds -by basis,transfer -o chart.png
  karamelo-py chart sweep.csv -accuracy err -x N -o orders.svg       errors over a variable
  karamelo-py chart sweep.csv -accuracy err -heat N,ppc -o heat.pdf  over two variables
  karamelo-py chart sweep.csv -accuracy err -o chart.html            a page of runs
  karamelo-py chart sweep.csv -curve Ek -x Time -o curves.png        columns of the logs
  karamelo-py chart sweep.csv -keeps E -by basis,transfer -o E.md    does an energy stay?
  karamelo-py chart a.csv b.csv -accuracy err -versus digits -o d.png  two values, scene by scene"""
SUFFIXES = (".png", ".svg", ".pdf", ".html")


def add_options(parser: ArgumentParser) -> None:
    """Add what the subcommand takes."""
    parser.add_argument(
        "tables", type=Path, nargs="+", metavar="table",
        help="what karamelo-py sweep has written; several with -versus",
    )  # fmt: skip
    wanted = parser.add_mutually_exclusive_group(required=True)
    wanted.add_argument("-accuracy", metavar="COLUMN", help="the error")
    wanted.add_argument(
        "-curve", metavar="COLUMN", help="a log column, a curve for each run, over -x (Time)"
    )
    wanted.add_argument(
        "-keeps", metavar="COLUMN",
        help="a table of words: does a log column stay (keeps, damps, gains, breaks, refused)? "
        "Rows are -by, columns the other variables",
    )  # fmt: skip
    parser.add_argument("-cost", metavar="COLUMN", help="the cost (seconds)")
    parser.add_argument("-by", default="", metavar="A,B", help="variables that tell lines apart")
    kinds = parser.add_mutually_exclusive_group()
    kinds.add_argument("-x", metavar="NAME", help="errors over this variable, not over cost")
    kinds.add_argument("-heat", metavar="A,B", help="errors over two variables, as colours")
    kinds.add_argument(
        "-versus", metavar="NAME", help="its two values side by side, for each of the tables"
    )
    parser.add_argument("-exact", metavar="COLUMN", help="of -curve: the exact log column")
    parser.add_argument("-names", default="", help="of -curve: what to call the runs, with commas")
    add_axes(parser)
    parser.add_argument("-log", default="log.mpm", metavar="FILE", help="of -curve: another log")
    parser.add_argument("-where", action="append", default=[], help="rows that fulfil a condition")
    parser.add_argument("-title", help="heads the chart (the name of the script)")
    parser.add_argument("-o", type=Path, help="the picture or page: " + ", ".join(SUFFIXES))
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")


def run(options: Any) -> int:
    """Do what the command line says; returns the exit status."""
    costs = bool(options.cost) or not options.x
    options.cost = options.cost or "seconds"
    if options.axes and (options.keeps or not (options.o or options.curve)):
        raise ScriptError("-axes", expected="-curve, or -accuracy with -o")
    if options.versus:
        return side_by_side(options)
    if len(options.tables) > 1:
        raise ScriptError(f"{len(options.tables)} tables", expected="one, or several with -versus")
    table = read(options.tables[0], options.where)
    by = names(options.by)
    if options.keeps:
        return keeps(options, table, by or table.variables)
    if options.curve:
        return curves(options, table, by or table.variables)
    family = Family(table, options.accuracy, options.cost, by, options.x)
    if len(family.without) == len(table.rows):
        raise ScriptError(f"no run has a value of '{options.accuracy}' above 0")
    out = out_file(options.o, *SUFFIXES) if options.o else None
    if out is not None and out.suffix.lower() == ".html":
        page.require_plotly()
    title = table.script if options.title is None else options.title
    axes = names(options.heat or "")
    require("-heat", axes, table.variables)
    if options.heat and len(axes) != 2:
        raise ScriptError(f"-heat {options.heat}", expected="two variables: -heat N,ppc")
    if not options.x and not axes and not any(line.shown.any() for line in family.lines):
        raise ScriptError(f"no run has a value of '{options.cost}' above 0")
    first = family.along if options.x else look.label(family.cost)
    words = along(options, *(axes or (first, family.error_label)))
    tell(family, costs=costs)
    if out is None:
        return 0
    if out.suffix.lower() == ".html":
        if axes:
            raise ScriptError("-heat is a picture", expected="-o heat.png, .svg or .pdf")
        page.write(family, out, words, title or "runs")
    elif axes:
        pictures.heat(family, *axes, out, words, title)
    else:
        pictures.lines(family, out, words, title)
    print(f"drawn: {out}")
    return 0


def read(path: Path, where: Sequence[str]) -> Table:
    """Read a table, of its rows those that fulfil the conditions."""
    rows, made = records.read(path), records.beside(path)
    if "folder" not in rows[0] and "variables" not in made:
        raise ScriptError(
            f"{path} does not say which columns are variables",
            expected=f"{path.with_suffix('.json')}, which sweep writes beside it",
        )
    variables = list(made.get("variables") or list(rows[0])[: list(rows[0]).index("seconds")])
    words = {row[name] for row in rows for name in variables}
    for condition in where:
        rows = [r for r in rows if holds(condition, {n: r[n] for n in variables}, words)]
    if not rows:
        raise ScriptError("no row fulfils -where " + " and ".join(where))
    return Table(rows, variables, path, made)


def side_by_side(options: Any) -> int:
    """Draw two values of a variable beside each other, for the scenes of all tables."""
    if not options.accuracy:
        raise ScriptError(f"-versus {options.versus}", expected="-accuracy COLUMN with it")
    out = out_file(options.o, *SUFFIXES[:-1]) if options.o else None
    found, known = [], []
    for path in options.tables:
        table = read(path, options.where)
        some, values = pictures.pairs(table, options.versus, options.accuracy, options.cost)
        if known and values != known:
            expected = ", ".join(known) + ", as in the first table"
            raise ScriptError(f"{path}: {options.versus} is {', '.join(values)}", expected=expected)
        known = values
        found += some
    pictures.tell_pairs(found, known, options.accuracy, options.cost)
    if out is not None:
        cost = look.label(options.cost).removesuffix(" (s)")
        words = along(
            options, look.label(options.accuracy), f"{cost},\n{known[1]} over {known[0]} (1)"
        )
        pictures.draw_pairs(found, known, out, words, options.accuracy, options.title or "")
        print(f"drawn: {out}")
    return 0


def curves(options: Any, table: Table, by: list[str]) -> int:
    """Draw a column of the logs, a curve for each run."""
    out = out_file(options.o or Path("curves.png"), *SUFFIXES[:-1])
    differing = [name for name in by if len({row[name] for row in table.rows}) > 1]
    over = options.x or "Time"
    called = [name for name in split(options.names) if name]

    def read(column: str) -> list[pictures.History]:
        return pictures.histories(table, differing, options.log, over, column, called)

    exact = None
    if options.exact:
        whole = max(read(options.exact), key=lambda each: len(each.x))
        exact = whole._replace(label=options.exact)
    title = table.script if options.title is None else options.title
    found = read(options.curve)
    words = along(options, over, options.curve)
    pictures.draw_histories(found, out, words, title, exact)
    for each in found:
        print(f"{each.label}: {options.curve} {shown(float(each.y[-1]))} at the end")
    print(f"drawn: {out}")
    return 0


def keeps(options: Any, table: Table, by: list[str]) -> int:
    """Show whether a log column stays what it was, and which runs fail without a known cause."""
    out = out_file(options.o, ".md") if options.o else None
    require("-by", by, table.variables)
    what = options.x or "Time", options.keeps, keeping.WITHIN, table.made.get("computes", ())
    kept = [keeping.look_at(row, table.path.parent, *what) for row in table.rows]
    text, silent = keeping.verdicts(table, kept, by)
    print(text)
    for word in dict.fromkeys(one.word for one in kept):
        print(f"{word}: {sum(one.word == word for one in kept)} of {len(kept)}")
    for line in silent:
        print(f"nothing says why: {line}")
    if out:
        out.write_text(text, encoding="utf-8")
        print(f"written: {out}")
    return 0


def tell(family: Family, *, costs: bool) -> None:
    """Print the runs, by cost with the Pareto front marked, and the order of each line."""
    front = {id(row) for row in family.front()} if costs else set()
    named = {"x": family.along, "cost": family.cost if costs else None, "error": family.accuracy}
    columns = {column: name for column, name in named.items() if name}
    table = plain_table(family.by, list(columns.values()))
    table.add_column("Pareto" if costs else "", no_wrap=True)
    members = [(line, k) for line in family.lines for k in range(len(line.rows))]
    if costs:
        members.sort(key=lambda m: (np.isnan(m[0].cost[m[1]]), m[0].cost[m[1]]))
    for line, k in members:
        row = line.rows[k]
        end = "front" if id(row) in front else ""
        if np.isnan(line.error[k]):
            end = (row.get("status", "") + ": " + row.get("reason", ""))[:70]
        numbers = (shown(float(getattr(line, column)[k])) for column in columns)
        table.add_row(*line.choice.values(), *numbers, end)
    console = terminal()
    console.print(table)
    pairs = {
        f"{columns[y]} by {columns[x]}": (x, y)
        for x, y in (("cost", "error"), ("x", "error"), ("x", "cost")) if {x, y} <= {*columns}
    }  # fmt: skip
    orders = plain_table([""], list(pairs), "\norders, of all and between neighbours")
    for line in family.lines:
        fits = (order(getattr(line, x), getattr(line, y)) for x, y in pairs.values())
        orders.add_row(line.label, *map(str, fits))
    console.print(orders)
    if costs and family.cost == "seconds" and family.table.made.get("timed") is False:
        print(
            "note: these runs went side by side, their times disturb each other; "
            "sweep -time measures"
        )
