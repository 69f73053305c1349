"""Every script of the how-tos runs, with the files that its page shows."""

import re
from pathlib import Path

import pandas
import pytest
from scenes import block

HOWTO = Path(__file__).parent.parent / "docs" / "howto"
FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.S | re.M)
PAGES = sorted(path for path in HOWTO.glob("*.md") if path.name != "index.md")
# Too large for an interpreted run: tests/test_ground.py.
COMPILED = "excavation", "inflow", "landslide", "retaining-wall", "wet-slope"
SCRIPTS = [
    (page, body)
    for page in [*PAGES, HOWTO.parent / "index.md"]
    for language, body in FENCE.findall(page.read_text("utf-8"))
    if language == "karamelo" and page.stem not in COMPILED
]


def test_each_page_has_a_script():
    assert {page.stem for page, _ in SCRIPTS} >= {page.stem for page in PAGES} - {*COMPILED}


def files_of(page):
    """Files that a page shows: the block after a name in back quotes, and modules of Python."""
    text = page.read_text("utf-8")
    shown = re.findall(r"`([\w.]+\.(?:geo|inp|csv))`[^`]*?```text\n(.*?)^```", text, re.S | re.M)
    modules = re.findall(r"^```python\n# (\w+\.py)\n(.*?)^```", text, re.S | re.M)
    return dict([*shown, *modules])


@pytest.mark.parametrize(
    ("page", "script"), SCRIPTS, ids=[f"{page.stem}-{k}" for k, (page, _) in enumerate(SCRIPTS)]
)
def test_scripts_of_how_tos_run(run_interpreted, tmp_path, page, script):
    (tmp_path / "run").mkdir()
    for name, text in files_of(page).items():
        (tmp_path / "run" / name).write_text(text, encoding="utf-8")
    # As far as an interpreted run goes within a second; that of the index on cells twice as large.
    script = re.sub(r"\b0\.025\b", "0.05", script).replace("N = 40", "N = 8")
    script = script.replace("h = 1/4", "h = 1")
    short = re.sub(r"^run(_time\(.*|\((?!1\))\d+)\)$", "run(2)", script, flags=re.M)
    done = run_interpreted(short)
    told = [line for line in done.err.splitlines() if "warning" in line]
    assert told == []


def test_a_log_and_a_dump_are_read_in_python(run_interpreted, monkeypatch):
    """The block of the page, of a log whose columns change between runs, with a word in a row."""
    ((_, body),) = (
        found for found in FENCE.findall((HOWTO / "paraview.md").read_text("utf-8"))
        if found[0] == "python"
    )  # fmt: skip
    script = block(
        2, "dump(a, all, hdf5, 10, points.h5, vx, vy, seq)", "set_dt(1e-3)",
        "log_modify(custom, step, time, dt, limit)", "run(2)",
        "log_modify(custom, time, dt)", "run(2)",
    )  # fmt: skip
    monkeypatch.chdir(run_interpreted(script).folder)
    known = {}
    exec(body, known)
    log = known["log"]
    assert list(log["Time"]) == pytest.approx([0, 1e-3, 2e-3, 2e-3, 3e-3, 4e-3], abs=1e-12)
    assert list(log["Step"][:3]) == [0, 1, 2] and log["Step"][3:].isna().all()
    assert list(log["dt"][1:]) == [1e-3] * 5 and log["limit"].isna().all()
    assert re.search(r"^1 .* set_dt$", Path("log.mpm").read_text(), re.M)
    assert isinstance(log, pandas.DataFrame) and known["points"].sizes["id"] > 1
