"""A chart of a study as one page (HTML) that needs no server: a point shows its run."""

import base64
import html
import importlib.util
import io
import json
from collections.abc import Mapping
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from karamelo_py.app.studies import look
from karamelo_py.app.studies.case import options_of, worded
from karamelo_py.app.studies.curves import Family, column
from karamelo_py.script.errors import ScriptError

_WIDEST = 480  # pixels of a picture in the page
_MOST = 60  # pictures in a page


def require_plotly() -> None:
    """See that Plotly is there, which takes long to import."""
    if importlib.util.find_spec("plotly") is None:
        raise ScriptError(
            "a page needs the package plotly", hint='pip install "karamelo-py[studies]"'
        )


def write(family: Family, path: Path, words: tuple[str, str], title: str) -> None:
    """Write the page with Plotly; `words` stand along the axes."""
    from plotly import graph_objects
    from plotly import io as plotly_io

    rows = family.table.rows
    number_of = {id(row): k for k, row in enumerate(rows)}
    figure = graph_objects.Figure()
    front = family.front()
    if not family.convergence:
        cost, error = column(front, family.cost), column(front, family.accuracy)
        figure.add_scatter(
            x=cost, y=error, mode="lines+markers", name="Pareto front", hoverinfo="skip",
            line={"shape": "hv", "width": 8, "color": "#cccccc"},
            marker={"size": 18, "color": "#cccccc"},
        )  # fmt: skip
    styles = look.styles([line.choice for line in family.lines])
    for line, (colour, marker, dash) in zip(family.lines, styles, strict=True):
        shown = np.flatnonzero(line.shown)
        figure.add_scatter(
            x=line.across[shown], y=line.error[shown], mode="lines+markers", name=line.label,
            customdata=[number_of[id(line.rows[k])] for k in shown],
            text=[_said(line.rows[k], family) for k in shown],
            hovertemplate="%{text}<br>%{y:.4g} at %{x:.4g}<extra></extra>",
            line={"color": colour, "dash": look.PLOTLY_DASHES[dash], "width": 2},
            marker={"symbol": look.PLOTLY_MARKERS[marker], "size": 10},
        )  # fmt: skip
    usual = {
        "type": "log", "showgrid": True, "gridcolor": "#e6e6e6", "exponentformat": "power",
        "linecolor": "#444", "ticks": "outside",
    }  # fmt: skip
    figure.update_layout(
        template="plotly_white", margin={"l": 70, "r": 20, "t": 20, "b": 60}, hovermode="closest",
        xaxis={**usual, "title": words[0]},
        yaxis={**usual, "title": words[1]},
        legend={"orientation": "h", "y": -0.15},
    )  # fmt: skip
    for axis, numbers in (("xaxis", "across"), ("yaxis", "error")):
        drawn = np.concatenate([getattr(line, numbers)[line.shown] for line in family.lines])
        ticks = look.log_ticks(*(drawn.min(), drawn.max()) if len(drawn) else (1.0, 10.0))
        if 2 <= len(ticks) <= 14:
            figure.layout[axis].tickvals = ticks
            figure.layout[axis].ticktext = [f"{tick:g}" for tick in ticks]
    runs = [_run(row, family, family.table.path.parent, k) for k, row in enumerate(rows)]
    text = json.dumps(runs).replace("</", "<\\/")
    first = number_of[id(front[-1])] if front else 0
    chart = plotly_io.to_html(
        figure, include_plotlyjs=True, full_html=False, div_id="chart",
        default_height="100%", config={"displaylogo": False, "responsive": True},
    )  # fmt: skip
    made = family.table.made
    versions = ", ".join(f"{n} {v}" for n, v in made.get("versions", {}).items())
    threads = f"{made['threads']} threads" if "threads" in made else None
    about = filter(None, [made.get("processor"), threads, versions, made.get("date")])
    template = Template(Path(__file__).with_suffix(".html").read_text(encoding="utf-8"))
    page = template.substitute(
        title=html.escape(title), chart=chart, failures=_failures(family, number_of),
        footer=html.escape("; ".join(about)), runs=text, first=first,
    )  # fmt: skip
    try:
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise ScriptError(f"cannot write {path}: {error.strerror or error}") from None


def _values(row: Mapping[str, str], family: Family) -> dict[str, str]:
    return {name: row[name] for name in family.table.variables}


def _said(row: Mapping[str, str], family: Family) -> str:
    return html.escape(worded(_values(row, family)))


def _run(row: Mapping[str, str], family: Family, folder: Path, k: int) -> dict[str, Any]:
    script = family.table.made.get("script", "SCRIPT")
    values = _values(row, family)
    skipped = {*values, "status", "reason", "folder"}
    return {
        "title": worded(values),
        "command": f"karamelo-py {script} {' '.join(options_of(values))}",
        "status": row.get("status", ""),
        "reason": row.get("reason", ""),
        "numbers": [[n, v] for n, v in row.items() if n not in skipped and v],
        "picture": _picture(folder / row["folder"]) if k < _MOST and row.get("folder") else None,
    }


def _picture(folder: Path) -> str | None:
    """Read the newest picture of a run, small enough for a page, as a data URL."""
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
