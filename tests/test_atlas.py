"""The atlas: entries run by their commands, go on where they stopped, and become a page."""

import json
from pathlib import Path

import numpy as np
import pytest

import karamelo_py
from karamelo_py.app.cli import main
from karamelo_py.app.studies import atlas, pictures

ROOT = Path(__file__).parent.parent
SCRIPT = """
N = 4
law = 2
exact = time
err = time^law
method(ulmpm, FLIP, linear, 1)
dimension(1, 0, 10, 1)
region(line, block, 1, 2)
material(rubber, linear, 2, 100, 0)
solid(body, region, line, 1, rubber, 1, 0)
set_dt(1)
set_output(1)
log_modify(custom, step, time, err, exact)
run(N)
"""
ATLAS = """
inputs = "."
[[entry]]
name = "laws/power"
text = "A law of time."
interpreted = true
commands = [
  "sweep {inputs}/in.law -var N={steps} -var law=1,2 -o runs.csv",
  "chart runs.csv -curve err -exact exact -o power.png",
]
whole = {steps = "6"}
small = {steps = "2"}
[[entry]]
name = "broken"
commands = ["sweep {inputs}/in.law -var M=1"]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch, starts_are_cheap):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.law").write_text(SCRIPT, encoding="utf-8")
    (tmp_path / "a.toml").write_text(ATLAS, encoding="utf-8")
    return tmp_path


def test_the_list_has_the_first_sentence_of_each(folder, capsys):
    text = ATLAS.replace('"A law of time."', '"""A law\nof time: two of them.\nNo more."""')
    (folder / "a.toml").write_text(text, encoding="utf-8")
    assert main(["atlas", "a.toml", "-list"]) == 0
    listed = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()]
    assert listed == [["laws/power", "A law of time:"], ["broken"]]


def test_an_atlas_runs_its_commands_once_and_writes_a_page(folder, capsys):
    words = ["atlas", "a.toml", "-only", "laws", "-page", "page.md"]
    assert main([*words, "-small"]) == 0
    assert not (folder / "page.md").exists()
    assert len((folder / "atlas/small/laws/power/runs.csv").read_text().splitlines()) == 3
    assert main(words) == 0
    assert "1 of 1: laws/power done" in capsys.readouterr().out
    place = folder / "atlas/laws/power"
    # t^1 and t^2 after 6 steps of 1, as the chart says of each run.
    said = (place / "said.txt").read_text(encoding="utf-8")
    assert "law = 1: err 6 at the end" in said and "law = 2: err 36 at the end" in said
    page = (folder / "page.md").read_text(encoding="utf-8")
    assert "## Laws" in page and "![A law of time](_static/atlas/laws/power/power.png)" in page
    assert "$ karamelo-py chart runs.csv -curve err" in page
    assert "1/2" not in page
    assert str(folder) not in page
    made = json.loads((place / "entry.json").read_text(encoding="utf-8"))
    assert f"*karamelo-py {karamelo_py.__version__}, {made['processor']}, 2" in page
    assert (folder / "_static/atlas/laws/power/power.png").read_bytes()[1:4] == b"PNG"
    assert main(words) == 0
    assert "laws/power known" in capsys.readouterr().out
    assert main([*words[:3], "broken", *words[4:], "-o", "other"]) == 1
    assert (folder / "page.md").read_text(encoding="utf-8") == page  # what was not made stays
    # Another script would be another result.
    lines = [f"sweep {folder / 'in.law'} -var N=6"]
    key = atlas.key_of(lines)
    (folder / "in.law").write_text(SCRIPT + "# changed\n", encoding="utf-8")
    assert atlas.key_of(lines) != key


def test_an_entry_that_fails_stops_no_other(folder, capsys):
    (folder / "a.toml").write_text(
        ATLAS.replace('whole = {steps = "6"}', 'whole = {steps = "1"}'), encoding="utf-8"
    )
    assert main(["atlas", "a.toml"]) == 1
    out = capsys.readouterr().out
    assert "laws/power done" in out and "broken failed" in out and "failed: broken" in out


def test_runs_that_end_early_are_named(folder, capsys):
    """0/0 is refused; where that is what the entry shows, it may be."""
    text = ATLAS.partition('[[entry]]\nname = "broken"')[0].replace("law=1,2", "law=1,0/0")
    (folder / "a.toml").write_text(text, encoding="utf-8")
    words = ["atlas", "a.toml", "-small"]
    for state in ("done", "known"):
        assert main(words) == 1
        out = capsys.readouterr().out
        assert f"laws/power {state}, 1 of 2 runs ended early" in out
        assert "failed: laws/power (N=2,law=0_0" in out
    text = text.replace("interpreted", "ends_early = true\ninterpreted")
    (folder / "a.toml").write_text(text, encoding="utf-8")
    assert main(words) == 0
    assert "1 of 2 runs ended early" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.toml"], "cannot read"),
        (["a.toml", "-only", "law"], "did you mean 'laws'?"),
    ],
)
def test_mistakes(folder, capsys, words, said):
    assert main(["atlas", *words]) == 1
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x", "is not TOML"),
        ("a = 1", "has no entries"),
        ("[[entry]]\nname = 'a'\ncolour = 1", "colour"),
        ("[[entry]]\nname = 'a'\ncommands = ['sweep {way}']", "no value for 'way'"),
    ],
)
def test_mistakes_in_the_list(folder, capsys, text, said):
    (folder / "b.toml").write_text(text, encoding="utf-8")
    assert main(["atlas", "b.toml"]) == 1
    assert said in capsys.readouterr().err


def test_the_atlas_of_the_pages_names_scripts_and_commands_that_exist():
    """Every entry: its words have values, its scripts are there, its command lines can be read."""
    import argparse
    import importlib
    import shlex

    from karamelo_py.app.cli import ELSEWHERE
    from karamelo_py.app.studies.records import recorded
    from karamelo_py.app.studies.variables import ScriptFiles, cases, choices, zipped

    entries, inputs = atlas.read(ROOT / "docs" / "atlas.toml")
    assert len({entry.name for entry in entries}) == len(entries)
    parser = argparse.ArgumentParser()
    commands = parser.add_subparsers()
    for name in ("sweep", "chart", "stability", "bench", "advise"):
        importlib.import_module(ELSEWHERE[name][0]).add_options(commands.add_parser(name))
    for entry in entries:
        for small in (False, True):
            for line in entry.lines(str(inputs), small=small):
                options = parser.parse_args(shlex.split(line))
                script = getattr(options, "script", None)
                assert script is None or script.is_file(), line
                if line.startswith("sweep"):
                    values = choices(options.var, {n for g in zipped(options) for n in g})
                    ScriptFiles(script).check(values)
                    assert cases(values, zipped(options), options.where)
                    recorded(",".join(options.record), ScriptFiles(script), values)


def test_curves_of_a_sweep(folder, capsys):
    words = ["sweep", "in.law", "-var", "law=1,2", "-o", "s.csv", "-jobs", "1"]
    assert main(words) == 0
    draw = ["chart", "s.csv", "-curve", "err", "-names", "line,parabola", "-o", "c.svg"]
    assert main([*draw, "-axes", "time (s),error (m)"]) == 0
    out = capsys.readouterr().out
    assert "line: err 4 at the end" in out and "parabola: err 16 at the end" in out
    text = (folder / "c.svg").read_text(encoding="utf-8")
    assert text.startswith("<?xml") and "time (s)" in text and "error (m)" in text
    assert main([*draw, "-axes", "time (s)"]) == 1
    assert "two, such as -axes" in capsys.readouterr().err
    assert main(["chart", "s.csv", "-curve", "er"]) == 1
    assert "did you mean 'err'?" in capsys.readouterr().err
    (folder / "s/law=1/log.mpm").unlink()
    (folder / "s/law=2/log.mpm").unlink()
    assert main(["chart", "s.csv", "-curve", "err"]) == 1
    assert "no run has left a log.mpm" in capsys.readouterr().err


def test_rows_that_a_run_gave_up_are_no_part_of_its_curve():
    time = np.array([0.0, 1.0, 2.0, 3.0, 1.0, 1.5])
    assert list(time[pictures.forward(time, stopped=True)]) == [0, 1, 2, 3]
    assert list(time[pictures.forward(time, stopped=False)]) == [0, 1, 1.5]


@pytest.mark.full
def test_the_atlas_of_the_pages_can_be_made_small(tmp_path, monkeypatch):
    """Every entry at its smaller values, compiled where it is not interpreted: minutes."""
    monkeypatch.chdir(tmp_path)
    assert main(["atlas", str(ROOT / "docs" / "atlas.toml"), "-small"]) == 0
