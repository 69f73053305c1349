"""karamelo-py chart: what accuracy costs, how errors fall, where two variables lead."""

from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.studies import keeping, look, pictures, records, results
from karamelo_py.app.studies.curves import Family, Table, order, require
from karamelo_py.app.studies.study import plain_table, shown, terminal
from karamelo_py.app.studies.variables import add_axes, along, holds, names, out_file
from karamelo_py.output.files import read_json, write_whole
from karamelo_py.script.errors import ScriptError

DESCRIPTION = """\
Draws the table of a sweep: errors over costs on logarithmic axes, a line for each choice, and the
Pareto front (runs that none beats in both). Prints the same as a table, with fitted orders.

  karamelo-py chart sweep.csv -accuracy err -cost seconds -by basis,transfer -o chart.png
  karamelo-py chart sweep.csv -accuracy err -x N -o orders.svg       errors over a variable
  karamelo-py chart sweep.csv -accuracy err -heat N,ppc -o heat.pdf  over two variables
  karamelo-py chart sweep.csv -y runout -x a -law "1.2*a" -data seen.csv -o runout.png   a result
  karamelo-py chart sweep.csv -curve Ek -x Time -o curves.png        columns of the logs
  karamelo-py chart sweep.csv -keeps E -by basis,transfer -o E.md    does an energy stay?
  karamelo-py chart a.csv b.csv -accuracy err -versus digits -o d.png  two values, scene by scene"""


def add_options(parser: ArgumentParser) -> None:
    """Add what the subcommand takes."""
    parser.add_argument(
        "tables", type=Path, nargs="+", metavar="table",
        help="what karamelo-py sweep has written; several with -versus",
    )  # fmt: skip
    wanted = parser.add_mutually_exclusive_group()
    wanted.add_argument("-accuracy", metavar="COLUMN", help="column of the error")
    wanted.add_argument(
        "-curve", metavar="COLUMN", help="draw a log column of each run over -x (Time)"
    )
    wanted.add_argument(
        "-y", metavar="A,B", help="draw results over the variable -x, a line per value of -by"
    )
    wanted.add_argument(
        "-keeps", metavar="COLUMN",
        help="write a table of what a log column does: keeps, damps, gains, breaks, refused; "
        "rows by -by, columns by the other variables",
    )  # fmt: skip
    parser.add_argument("-cost", metavar="COLUMN", help="column of the cost (seconds)")
    parser.add_argument(
        "-by", action="append", default=[], metavar="A,B", help="variables with a line per value"
    )
    kinds = parser.add_mutually_exclusive_group()
    kinds.add_argument("-x", metavar="NAME", help="draw errors over this variable, not over cost")
    kinds.add_argument("-heat", metavar="A,B", help="draw errors over two variables, as colours")
    kinds.add_argument(
        "-versus", metavar="NAME", help="compare its two values in each of the tables"
    )
    parser.add_argument("-law", metavar="FORMULA", help="a formula of -x, drawn with -y")
    parser.add_argument("-data", type=Path, metavar="FILE", help="measured points, drawn with -y")
    parser.add_argument("-exact", metavar="COLUMN", help="log column of the exact -curve")
    parser.add_argument("-names", default="", metavar="A,B", help="names of the runs of -curve")
    add_axes(parser)
    parser.add_argument("-log", default="log.mpm", metavar="FILE", help="log of -curve (log.mpm)")
    parser.add_argument("-where", action="append", default=[], help="draw only these rows")
    parser.add_argument("-title", help="title (the name of the script)")
    parser.add_argument("-o", type=Path, help="the picture: " + ", ".join(pictures.SUFFIXES))


def run(options: Any) -> int:
    """Do what the command line says; returns the exit status."""
    costs = bool(options.cost) or not options.x
    options.cost = options.cost or "seconds"
    if options.axes and (options.keeps or not (options.o or options.curve)):
        raise ScriptError("-axes", expected="-curve, or -accuracy or -y with -o")
    if not (options.accuracy or options.curve or options.keeps or options.y):
        hint = f"karamelo-py chart {options.tables[0]} -accuracy error -o chart.png"
        expected = "-accuracy of an error, -y of a result, -curve or -keeps"
        raise ScriptError("no column is named", expected=expected, hint=hint)
    if (options.law or options.data) and not options.y:
        raise ScriptError("-law and -data are drawn with -y", expected="-y COLUMN -x NAME")
    if options.versus:
        return side_by_side(options)
    if len(options.tables) > 1:
        raise ScriptError(f"{len(options.tables)} tables", expected="one, or several with -versus")
    table = read(options.tables[0], options.where)
    by = names(",".join(options.by))
    if options.keeps:
        return keeps(options, table, by or table.variables)
    if options.curve:
        return curves(options, table, by or table.variables)
    if options.y:
        return results.draw(options, table, by)
    family = Family(table, options.accuracy, options.cost, by, options.x)
    if len(family.without) == len(table.rows):
        raise ScriptError(f"no run has a value of '{options.accuracy}' above 0")
    out = out_file(options.o, *pictures.SUFFIXES) if options.o else None
    title = table.script if options.title is None else options.title
    axes = names(options.heat or "")
    require("-heat", axes, table.variables)
    if options.heat and len(axes) != 2:
        raise ScriptError(f"-heat {options.heat}", expected="two variables: -heat N,ppc")
    if not options.x and not axes and not any(line.shown.any() for line in family.lines):
        raise ScriptError(f"no run has a value of '{options.cost}' above 0")
    first = family.along if options.x else table.label(family.cost)
    words = along(options, *(axes or (first, family.error_label)))
    # First the picture: who reads the table may close the pipe.
    if out is None:
        pass
    elif axes:
        pictures.heat(family, *axes, out, words, title)
    else:
        pictures.lines(family, out, words, title)
    tell(family, costs=costs)
    if out is not None:
        print(f"drawn: {out}")
    return 0


def read(path: Path, where: Sequence[str]) -> Table:
    """Read a table, of its rows those that fulfil the conditions."""
    rows, made = records.read(path), read_json(path.with_suffix(".json"))
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
    out = out_file(options.o, *pictures.SUFFIXES) if options.o else None
    found, known = [], []
    for path in options.tables:
        table = read(path, options.where)
        some, values = pictures.pairs(table, options.versus, options.accuracy, options.cost)
        if known and values != known:
            expected = ", ".join(known) + ", as in the first table"
            raise ScriptError(f"{path}: {options.versus} is {', '.join(values)}", expected=expected)
        known = values
        found += some
    if out is not None:
        cost = look.label(options.cost).removesuffix(" (s)")
        words = along(
            options, look.label(options.accuracy), f"{cost},\n{known[1]} over {known[0]} (1)"
        )
        pictures.draw_pairs(found, known, out, words, options.accuracy, options.title or "")
    pictures.tell_pairs(found, known, options.accuracy, options.cost)
    if out is not None:
        print(f"drawn: {out}")
    return 0


def curves(options: Any, table: Table, by: list[str]) -> int:
    """Draw a column of the logs, a curve for each run."""
    out = out_file(options.o or Path("curves.png"), *pictures.SUFFIXES)
    differing = [name for name in by if len({row[name] for row in table.rows}) > 1]
    over = options.x or "Time"

    def read(column: str) -> list[pictures.History]:
        return pictures.histories(table, differing, options.log, over, column, names(options.names))

    exact = None
    if options.exact:
        whole = max(read(options.exact), key=lambda each: len(each.x))
        exact = whole._replace(label=options.exact)
    title = table.script if options.title is None else options.title
    found = read(options.curve)
    words = along(options, table.label(over), table.label(options.curve))
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
    if out:
        write_whole(out, text)
    print(text)
    for word in dict.fromkeys(one.word for one in kept):
        print(f"{word}: {sum(one.word == word for one in kept)} of {len(kept)}")
    for line in silent:
        print(f"nothing says why: {line}")
    if out:
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
        end = "front" if id(row) in front else line.chance[k] and f"by chance: {line.chance[k]}"
        if np.isnan(line.error[k]):
            end = (row.get("status", "") + ": " + row.get("reason", ""))[:70]
        numbers = {column: shown(float(getattr(line, column)[k])) for column in columns}
        if family.words:
            numbers["x"] = row[family.along]
        table.add_row(*line.choice.values(), *numbers.values(), end)
    console = terminal()
    console.print(table)
    fitted = {*columns} - ({"x"} if family.words else set())
    pairs = {
        f"{columns[y]} by {columns[x]}": (x, y)
        for x, y in (("cost", "error"), ("x", "error"), ("x", "cost")) if {x, y} <= fitted
    }  # fmt: skip
    if pairs:
        orders = plain_table([""], list(pairs), "\norders, of all and between neighbours")
        for line in family.lines:
            fits = []
            for x, y in pairs.values():
                fit = order(getattr(line, x), getattr(line, y))
                # Errors fall where costs grow.
                turned = line.rises or x == "cost" if y == "error" else not line.rises
                fits.append(fit.of_fall if turned else fit)
            orders.add_row(line.label, *map(str, fits))
        console.print(orders)
    made = family.table.made
    together = made.get("timed") is False and made.get("jobs") != 1
    if costs and family.cost in ("seconds", "wall_s") and together:
        print(
            "note: these runs went side by side, their times disturb each other; "
            "sweep -time measures"
        )
