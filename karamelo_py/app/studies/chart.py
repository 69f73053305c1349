"""karamelo-py chart: errors against cost, convergence, maps of two variables, curves of logs."""

import base64
import html
import io
import json
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template

import numpy as np

from karamelo_py.app.live.server import require_plotly
from karamelo_py.app.studies import keeping, look, pictures, records, results, uncertainty
from karamelo_py.app.studies.case import COLUMNS, Row, command_of, worded
from karamelo_py.app.studies.curves import Family, Table, column, order, require, sizes
from karamelo_py.app.studies.study import plain_table, shown, terminal
from karamelo_py.app.studies.variables import add_axes, along, holds, names, out_file
from karamelo_py.output.files import read_json, write_whole
from karamelo_py.output.plots import tick_texts
from karamelo_py.script.errors import ScriptError

DESCRIPTION = """\
Draws the table of a sweep: errors against costs on logarithmic axes, a line for each choice, and
the Pareto front (runs that none beats in both). Prints the same as a table, with fitted orders.

  karamelo-py chart sweep.csv -accuracy err -cost seconds -by basis,transfer -o chart.png
  karamelo-py chart sweep.csv -accuracy err -x N -o orders.svg       errors against a variable
  karamelo-py chart sweep.csv -accuracy err -heat N,ppc -o heat.pdf  against two variables
  karamelo-py chart sweep.csv -accuracy err -o chart.html            a page of runs
  karamelo-py chart sweep.csv -y runout -x a -law "1.2*a" -data seen.csv -o runout.png   a result
  karamelo-py chart sweep.csv -curve Ek -x Time -o curves.png        columns of the logs
  karamelo-py chart sweep.csv -keeps E -by basis,transfer -o E.md    is an energy conserved?
  karamelo-py chart a.csv b.csv -accuracy err -versus digits -o d.png  two values, scene by scene"""
SUFFIXES = (*pictures.SUFFIXES, ".html")
WANTED = ("accuracy", "y", "curve", "keeps", "distribution")


def add_options(parser: ArgumentParser) -> None:
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
        "-y", metavar="A,B", help="draw results against the variable -x, a line per value of -by"
    )
    wanted.add_argument(
        "-keeps", metavar="COLUMN",
        help="write a table of the behaviour of a log column: keeps, damps, gains, breaks, "
        "refused; rows by -by, columns by the other variables",
    )  # fmt: skip
    wanted.add_argument(
        "-distribution", metavar="COLUMN",
        help="draw a result of sweep -sample: its distribution, and against each variable",
    )  # fmt: skip
    parser.add_argument("-cost", metavar="COLUMN", help="column of the cost (seconds)")
    parser.add_argument(
        "-by", action="append", default=[], metavar="A,B", help="variables with a line per value"
    )
    kinds = parser.add_mutually_exclusive_group()
    kinds.add_argument("-x", metavar="NAME", help="draw errors against this variable, not cost")
    kinds.add_argument("-heat", metavar="A,B", help="draw errors against two variables, as colours")
    kinds.add_argument(
        "-versus", metavar="NAME", help="compare results for its two values in each table"
    )
    parser.add_argument("-law", metavar="FORMULA", help="a formula of -x, drawn with -y")
    parser.add_argument("-data", type=Path, metavar="FILE", help="measured points, drawn with -y")
    parser.add_argument("-exact", metavar="COLUMN", help="log column of the exact -curve")
    parser.add_argument("-names", default="", metavar="A,B", help="names of the runs of -curve")
    add_axes(parser)
    parser.add_argument("-log", default="log.mpm", metavar="FILE", help="log of -curve (log.mpm)")
    parser.add_argument("-where", action="append", default=[], help="draw only these rows")
    parser.add_argument("-o", type=Path, help="the picture or page: " + ", ".join(SUFFIXES))


def run(options: Namespace) -> int:
    costs = bool(options.cost) or not options.x
    options.cost = options.cost or "seconds"
    if options.axes and (options.keeps or not (options.o or options.curve)):
        raise ScriptError("-axes", expected="-curve, or -accuracy or -y with -o")
    if not any(vars(options)[name] for name in WANTED):
        hint = f"karamelo-py chart {options.tables[0]} -accuracy error -o chart.png"
        raise ScriptError("no column is named", expected=f"-{', -'.join(WANTED)}", hint=hint)
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
    if options.distribution:
        return uncertainty.draw(options, table)
    if options.y:
        return results.draw(options, table, by)
    if costs:
        require_one_machine(table, options.cost)
    family = Family(table, options.accuracy, options.cost, by=by, along=options.x)
    if len(family.without) == len(table.rows):
        raise ScriptError(f"no run has a value of '{options.accuracy}' above 0")
    out = out_file(options.o, *SUFFIXES) if options.o else None
    if out is not None and out.suffix.lower() == ".html":
        require_plotly()
    title = table.title if options.title is None else options.title
    axes = names(options.heat or "")
    require("-heat", axes, table.variables)
    if options.heat and len(axes) != 2:
        raise ScriptError(f"-heat {options.heat}", expected="two variables: -heat N,ppc")
    if not options.x and not axes and not any(line.shown.any() for line in family.lines):
        raise ScriptError(f"no run has a value of '{options.cost}' above 0")
    first = family.along if options.x else table.label(family.cost)
    labels = along(options, *(axes or (first, family.error_label)))
    # Draw the picture first, since a reader of the table may close the pipe.
    if out is not None:
        sheet = pictures.Sheet(out, *labels, title)
        if out.suffix.lower() != ".html":
            pictures.heat(family, *axes, sheet) if axes else pictures.lines(family, sheet)
        elif axes:
            raise ScriptError("-heat is a picture", expected="-o heat.png, .svg or .pdf")
        else:
            write_page(family, sheet)
    tell(family, costs=costs)
    if out is not None:
        print(f"drawn: {out}")
    return 0


def read(path: Path, where: Sequence[str]) -> Table:
    rows, made = records.read(path), read_json(path.with_suffix(".json"))
    if "folder" not in rows[0] and "variables" not in made:
        raise ScriptError(
            f"{path} does not say which columns are variables",
            expected=f"{path.with_suffix('.json')}, which sweep writes next to it",
        )
    variables = list(made.get("variables") or list(rows[0])[: list(rows[0]).index("seconds")])
    tested = [*variables, *(["machine"] if "machine" in rows[0] else [])]
    words = {row[name] for row in rows for name in tested}
    for condition in where:
        rows = [r for r in rows if holds(condition, {n: r[n] for n in tested}, words)]
    if not rows:
        raise ScriptError("no row fulfils -where " + " and ".join(where))
    return Table(rows, variables, path, made)


def require_one_machine(table: Table, cost: str) -> None:
    machines = sorted({row["machine"] for row in table.rows if row.get("machine")})
    if cost in TIMES and len(machines) > 1:
        raise ScriptError(
            f"these runs took their times on {len(machines)} machines: {', '.join(machines)}",
            expected="a cost that all machines have in common, or the runs of one machine",
            hint=f"-cost node_visits, or -where 'machine == \"{machines[0]}\"'",
        )


def side_by_side(options: Namespace) -> int:
    if not options.accuracy:
        raise ScriptError(f"-versus {options.versus}", expected="-accuracy COLUMN with it")
    out = out_file(options.o, *pictures.SUFFIXES) if options.o else None
    pairs: list = []
    values: list = []
    for path in options.tables:
        table = read(path, options.where)
        more, two = pictures.pairs(table, options.versus, options.accuracy, options.cost)
        if values and two != values:
            expected = ", ".join(values) + ", as in the first table"
            raise ScriptError(f"{path}: {options.versus} is {', '.join(two)}", expected=expected)
        values = two
        pairs += more
    if out is not None:
        cost = COLUMNS.get(options.cost, options.cost).removesuffix(" (s)")
        accuracy = COLUMNS.get(options.accuracy, options.accuracy)
        labels = along(options, accuracy, f"{cost},\n{values[1]} / {values[0]}")
        sheet = pictures.Sheet(out, *labels, options.title or "")
        pictures.draw_pairs(pairs, values, options.accuracy, sheet)
    pictures.tell_pairs(pairs, values, options.accuracy, options.cost)
    if out is not None:
        print(f"drawn: {out}")
    return 0


def curves(options: Namespace, table: Table, by: list[str]) -> int:
    out = out_file(options.o or Path("curves.png"), *pictures.SUFFIXES)
    differing = [name for name in by if len({row[name] for row in table.rows}) > 1]
    over = options.x or "Time"
    settings = {"log": options.log, "names": names(options.names)}
    exact = None
    if options.exact:
        runs = pictures.histories(table, differing, over, options.exact, **settings)
        exact = max(runs, key=lambda each: len(each.x))._replace(label=options.exact)
    title = table.title if options.title is None else options.title
    histories = pictures.histories(table, differing, over, options.curve, **settings)
    labels = along(options, table.label(over), table.label(options.curve))
    pictures.draw_histories(histories, pictures.Sheet(out, *labels, title), exact)
    for each in histories:
        print(f"{each.label}: {options.curve} {shown(float(each.y[-1]))} at the end")
    print(f"drawn: {out}")
    return 0


def keeps(options: Namespace, table: Table, by: list[str]) -> int:
    out = out_file(options.o, ".md") if options.o else None
    require("-by", by, table.variables)
    over, parts, folder = options.x or "Time", table.made.get("computes", ()), table.path.parent
    verdicts = [
        keeping.look_at(row, folder, over, options.keeps, parts=parts) for row in table.rows
    ]
    text, silent = keeping.verdicts(table, verdicts, by)
    if out:
        write_whole(out, text)
    print(text)
    for word in dict.fromkeys(verdict.word for verdict in verdicts):
        print(f"{word}: {sum(verdict.word == word for verdict in verdicts)} of {len(verdicts)}")
    for line in silent:
        print(f"nothing says why: {line}")
    if out:
        print(f"written: {out}")
    return 0


def tell(family: Family, *, costs: bool) -> None:
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
                turned = line.rises or x == "cost" if y == "error" else not line.rises
                fits.append(fit.of_fall if turned else fit)
            orders.add_row(line.label, *map(str, fits))
        console.print(orders)
    made = family.table.made
    together = made.get("timed") is False and made.get("jobs") != 1
    if costs and family.cost in ("seconds", "wall_s") and together:
        print(
            "note: these runs ran at the same time, which affects their times; sweep -time measures"
        )


TIMES = ("seconds", "cpu_seconds", "wall_s", "particle_steps_per_s")
_WIDEST = 480
_MOST = 60


def write_page(family: Family, sheet: pictures.Sheet) -> None:
    from plotly import graph_objects
    from plotly import io as plotly_io

    rows = family.table.rows
    number_of = {id(row): k for k, row in enumerate(rows)}
    figure = graph_objects.Figure()
    front = family.front()
    if not family.convergence:
        cost, error = column(front, family.cost), sizes(front, family.accuracy)
        figure.add_scatter(
            x=cost, y=error, mode="lines+markers", name="Pareto front", hoverinfo="skip",
            line={"shape": "hv", "width": 8, "color": "#cccccc"},
            marker={"size": 18, "color": "#cccccc"},
        )  # fmt: skip
    styles = look.styles([line.choice for line in family.lines])
    for line, (colour, marker, dash) in zip(family.lines, styles, strict=True):
        shown = np.flatnonzero(line.shown).tolist()
        figure.add_scatter(
            x=line.across[shown], y=line.error[shown], mode="lines+markers", name=line.label,
            customdata=[number_of[id(line.rows[k])] for k in shown],
            text=[_said(line.rows[k], family) for k in shown],
            hovertemplate="%{text}<br>%{y:.4g} at %{x:.4g}<extra></extra>",
            line={"color": colour, "dash": look.PLOTLY_DASHES[dash], "width": 2},
            marker={
                "symbol": [
                    look.PLOTLY_MARKERS[marker] + "-open" * bool(line.chance[k]) for k in shown
                ], "size": 10,
            },
        )  # fmt: skip
    usual = {
        "showgrid": True, "gridcolor": "#e6e6e6", "exponentformat": "power",
        "linecolor": "#444", "ticks": "outside",
    }  # fmt: skip
    figure.update_layout(
        template="plotly_white", margin={"l": 70, "r": 20, "t": 20, "b": 60}, hovermode="closest",
        xaxis={**usual, "title": sheet.x, "type": "linear" if family.linear else "log"},
        yaxis={**usual, "title": sheet.y, "type": "log"},
        legend={"orientation": "h", "y": -0.15},
    )  # fmt: skip
    for axis, numbers in (("xaxis", "across"), ("yaxis", "error"))[family.linear :]:
        drawn = np.concatenate([getattr(line, numbers)[line.shown] for line in family.lines])
        ticks = look.log_ticks(*(drawn.min(), drawn.max()) if len(drawn) else (1.0, 10.0))
        if 2 <= len(ticks) <= 14:
            figure.layout[axis].tickvals = ticks
            figure.layout[axis].ticktext = tick_texts(ticks, in_html)
    if family.words:
        figure.update_xaxes(tickvals=[*range(len(family.words))], ticktext=family.words)
    runs = [_about(row, family, family.table.path.parent, k) for k, row in enumerate(rows)]
    text = json.dumps(runs).replace("<", "\\u003c")
    first = number_of[id(front[-1])] if front else 0
    chart = plotly_io.to_html(
        figure, include_plotlyjs=True, full_html=False, div_id="chart",
        default_height="100%", config={"displaylogo": False, "responsive": True},
    )  # fmt: skip
    made = family.table.made
    versions = ", ".join(f"{n} {v}" for n, v in made.get("versions", {}).items())
    threads = f"{made['threads']} threads" if "threads" in made else None
    about = filter(None, [made.get("processor"), threads, versions, made.get("date")])
    template = Template(Path(__file__).with_name("page.html").read_text(encoding="utf-8"))
    page = template.substitute(
        title=html.escape(sheet.title or "runs"), chart=chart, runs=text, first=first,
        failures=_failures(family, number_of), footer=html.escape("; ".join(about)),
    )  # fmt: skip
    write_whole(sheet.path, page)


def in_html(lead: str, exponent: int) -> str:
    return f"{lead}·10<sup>{exponent}</sup>" if lead else f"10<sup>{exponent}</sup>"


def _said(row: Mapping[str, str], family: Family) -> str:
    return html.escape(worded({name: row[name] for name in family.table.variables}))


def _about(row: Mapping[str, str], family: Family, folder: Path, k: int) -> Row:
    script = family.table.made.get("script", "SCRIPT")
    values = {name: row[name] for name in family.table.variables}
    skipped = {*values, "status", "reason", "folder"}
    return {
        "title": worded(values),
        "command": command_of(script, values),
        "status": row.get("status", ""),
        "reason": row.get("reason", ""),
        "numbers": [[n, v] for n, v in row.items() if n not in skipped and v],
        "picture": _picture(folder / row["folder"]) if k < _MOST and row.get("folder") else None,
    }


def _picture(folder: Path) -> str | None:
    pictures = sorted(folder.glob("*.png"), key=lambda p: p.stat().st_mtime)
    if not pictures:
        return None
    from PIL import Image

    try:
        with Image.open(pictures[-1]) as image:
            small = image.convert("RGB")
            small.thumbnail((_WIDEST, _WIDEST))
            out = io.BytesIO()
            small.save(out, "PNG", optimize=True)
    except OSError:
        return None
    return "data:image/png;base64," + base64.b64encode(out.getvalue()).decode()


def _failures(family: Family, number_of: Mapping[int, int]) -> str:
    if not family.without:
        return ""
    items = ""
    for row in family.without:
        why = html.escape(row.get("reason") or row.get("status", ""))
        link = f'<a href="#" data-run="{number_of[id(row)]}">{_said(row, family)}</a>'
        items += f"<li>{link}: {why}</li>"
    return f"<h2>Without a value</h2><ul>{items}</ul>"
