"""A chart of a study as one page (HTML) that needs no server: a point shows its run."""

import base64
import html
import importlib.util
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.app.studies import look
from karamelo_py.app.studies.curves import Family, column
from karamelo_py.script.errors import ScriptError

_WIDEST = 480  # pixels of a picture in the page
_MOST = 60  # pictures in a page
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 14px/1.4 system-ui, sans-serif; margin: 1.5em; color: #222; background: #fff }}
main {{ display: flex; gap: 1.5em }}
@media (max-width: 900px) {{ main {{ flex-direction: column }} }}
.chart {{ flex: 1 1 600px; min-width: 0; height: 640px }}
aside {{ flex: 0 0 380px; order: 2; box-sizing: border-box }}
aside {{ border-left: 3px solid #ddd; padding-left: 1.2em }}
aside code {{ display: block; white-space: pre-wrap; background: #f4f4f4; padding: .6em }}
aside img {{ max-width: 100%; margin-top: 1em }}
aside .bad {{ color: #b00020 }}
table {{ border-collapse: collapse; margin: .6em 0 }} td {{ padding: .1em .9em .1em 0 }}
td:last-child {{ font-variant-numeric: tabular-nums }}
h1 {{ font-size: 1.2em }} footer {{ color: #666; margin-top: 1em; font-size: 12px }}
</style></head><body><h1>{title}</h1><main>
<aside id="run"><p>Choose a point to see its run.</p></aside>
<div class="chart">{chart}</div></main>
{failures}<footer>{footer}</footer><script>{script}</script></body></html>
"""
_SCRIPT = """
window.addEventListener("load", () => {
const runs = %s, aside = document.getElementById("run");
function text(tag, words, parent, kind) {
  const made = document.createElement(tag);
  made.textContent = words; if (kind) made.className = kind;
  parent.appendChild(made); return made;
}
function show(k) {
  const run = runs[k]; aside.replaceChildren();
  text("h2", run.title, aside);
  if (run.reason) text("p", run.status + ": " + run.reason, aside, "bad");
  text("code", run.command, aside);
  const table = document.createElement("table"); aside.appendChild(table);
  for (const [name, number] of run.numbers) {
    const row = document.createElement("tr"); table.appendChild(row);
    text("td", name, row); text("td", number, row);
  }
  if (run.picture) {
    const image = document.createElement("img"); image.src = run.picture; image.alt = "the run";
    aside.appendChild(image);
  }
}
document.getElementById("chart").on("plotly_click", event => {
  const k = event.points[0].customdata;
  if (k !== undefined && k !== null) show(k);
});
document.querySelectorAll("[data-run]").forEach(link =>
  link.addEventListener("click", event => { event.preventDefault(); show(link.dataset.run); }));
show(%d);
Plotly.Plots.resize(document.getElementById("chart"));
});
"""


def require_plotly() -> None:
    """See that Plotly is there, which takes long to import."""
    if importlib.util.find_spec("plotly") is None:
        raise ScriptError(
            "a page needs the package plotly", hint='pip install "karamelo-py[studies]"'
        )


def write(
    family: Family, rows: list, path: Path, words: tuple[str, str], title: str, made: Mapping
) -> None:
    """Write the page with Plotly; `words` stand along the axes."""
    from plotly import graph_objects
    from plotly import io as plotly_io

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
        ticks = look.log_ticks(drawn.min(), drawn.max()) if len(drawn) else []
        if 2 <= len(ticks) <= 14:
            figure.layout[axis].tickvals = ticks
            figure.layout[axis].ticktext = [f"{tick:g}" for tick in ticks]
    runs = [_run(row, family, path.parent, made, k) for k, row in enumerate(rows)]
    text = json.dumps(runs).replace("</", "<\\/")
    first = number_of[id(front[-1])] if front else 0
    chart = plotly_io.to_html(
        figure, include_plotlyjs=True, full_html=False, div_id="chart",
        default_height="100%", config={"displaylogo": False, "responsive": True},
    )  # fmt: skip
    page = _PAGE.format(
        title=html.escape(title), chart=chart, failures=_failures(family, number_of),
        footer=html.escape(_footer(made)), script=_SCRIPT % (text, first),
    )  # fmt: skip
    try:
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise ScriptError(f"cannot write {path}: {error.strerror or error}") from None


def _said(row: Mapping[str, str], family: Family) -> str:
    return ", ".join(f"{name} = {html.escape(row[name])}" for name in family.variables)


def _run(row: Mapping[str, str], family: Family, folder: Path, made: Mapping, k: int) -> dict:
    words = " ".join(f"-var {name} {row[name]}" for name in family.variables)
    skipped = {*family.variables, "status", "reason", "folder"}
    return {
        "title": ", ".join(f"{name} = {row[name]}" for name in family.variables),
        "command": f"karamelo-py {made.get('script', 'SCRIPT')} {words}",
        "status": row.get("status", ""),
        "reason": row.get("reason", ""),
        "numbers": [[n, v] for n, v in row.items() if n not in skipped and v],
        "picture": _picture(folder / row["folder"]) if k < _MOST and row.get("folder") else None,
    }


def _picture(folder: Path) -> str | None:
    """The newest picture of a run, small enough for a page, as a data URL."""
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
    items = "".join(
        f'<li><a href="#" data-run="{number_of[id(row)]}">{_said(row, family)}</a>: '
        f"{html.escape(row.get('reason') or row.get('status', ''))}</li>"
        for row in family.without
    )
    return f"<h2>Without a value</h2><ul>{items}</ul>"


def _footer(made: Mapping[str, Any]) -> str:
    versions = ", ".join(f"{n} {v}" for n, v in made.get("versions", {}).items())
    parts = [made.get("processor"), f"{made['threads']} threads" if "threads" in made else None]
    return "; ".join(filter(None, [*parts, versions, made.get("date")]))
