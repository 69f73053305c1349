"""Every scene that has a published number meets it, at a small size (``-m full``: at its own)."""

import re
import sys
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from charts import contrast, faults, has_unit
from verification import run_scene

from comparisons import __main__
from comparisons.__main__ import scene, scenes
from comparisons.pictures import STYLE, finish
from comparisons.row import Row


def found(run_script, name: str, full: bool) -> list[Row]:
    """The rows of a scene, run in this process."""
    comparison = scene(name)
    size = {} if full else comparison.SMALL

    def run(scene=name, **variables):
        return run_scene(run_script, scene, None, **{**size, **variables})

    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
        rows = list(comparison.compare(run, axes, full))
        finish(axes, comparison.__doc__)
    wrong = faults(figure)
    plt.close(figure)
    assert wrong == []
    return rows


def test_the_checkout_is_written_to_when_it_is_asked_for(monkeypatch, tmp_path, capsys):
    """README's `python -m comparisons sod` leaves page and pictures alone."""
    docs = tmp_path / "docs"
    (docs / "_static" / "comparison").mkdir(parents=True)
    monkeypatch.setattr(__main__, "DOCS", docs)
    monkeypatch.setattr(__main__, "PICTURES", docs / "_static" / "comparison")

    def compare(name, folder, pictures, full):
        (pictures / f"{name}.png").write_bytes(b"")
        return [Row("speed", 1.0, 1.01, 0.02, "a paper")]

    monkeypatch.setattr(__main__, "compare", compare)
    for more, files in (([], 0), (["--small", "--write"], 0), (["--write"], 2)):
        out = tmp_path / f"out{len(more)}{files}"
        monkeypatch.setattr(sys, "argv", ["comparisons", "sod", "--folder", str(out), *more])
        __main__.main()
        assert f"pictures, logs and dumps: {out}" in capsys.readouterr().out
        assert sum(path.is_file() for path in docs.rglob("*")) == files
        assert (out / "sod.png").exists() == (files == 0)


# Scenes that share compiled loops with each other or with other tests.
SHARED = {
    "two_disks": "disks", "axis_aligned": "neo-hookean",
    "hertz": "contact", "slump": "soil",
    "dam_break": "water", "dam_ritter": "water",
}  # fmt: skip
# Of these a sibling shows the same in less: a cylinder and a vertical cut in test_implicit.py, a
# slab in test_heat.py, slump, taylor_bar_axisymmetric, friction in test_contact_grid.py, disks that
# turn in test_conservation.py, a bar that vibrates in test_bar.py.
SHOWN = {"footing", "static_footing", "lame", "static_slope", "collapse", "incline"}
SHOWN |= {"taylor_bar", "taylor_bar_227", "tensile_bar", "disk_impact", "spinning_disk"}
SHOWN |= {"vibrating_bar", "thick_cylinder", "heat_slab"}
SMALL = [
    pytest.param(name, marks=pytest.mark.xdist_group(SHARED.get(name, name)))
    for name in scenes()
    if scene(name).SMALL is not None and name not in SHOWN
]


@pytest.mark.parametrize("name", SMALL)
def test_scene(run_script, name):
    """Each row says what is allowed."""
    rows = found(run_script, name, full=False)
    assert rows
    assert not [row for row in rows if not row.agrees]


@pytest.mark.full
@pytest.mark.parametrize("name", scenes())
def test_scene_full(run_script, name):
    """At the published size."""
    assert not [row for row in found(run_script, name, full=True) if not row.agrees]


def test_differences():
    """Differences are relative, to the nearer end of a range, absolute where zero is published."""
    assert Row("", 2.0, 2.1, 0.06, "").agrees
    assert not Row("", 2.0, 2.1, 0.04, "").agrees
    assert Row("", (2.0, 3.0), 2.7, 0.0, "").agrees
    assert Row("", (2.0, 3.0), 3.3, 0.2, "").difference == pytest.approx(0.1)
    assert Row("", 0.0, 0.01, 0.02, "").agrees
    assert not Row("", 1.0, float("nan"), 1e9, "").agrees


ROOT = Path(__file__).parent.parent


def test_charts_name_their_units():
    """Those of the comparisons that take too long for a test, and those of the atlas."""
    texts = [path.read_text("utf-8") for path in (ROOT / "comparisons").glob("*.py")]
    texts += [(ROOT / "docs" / name).read_text("utf-8") for name in ("conf.py", "pictures.py")]
    labels = [one for text in texts for one in re.findall(r'[xy]label="([^"]+)"', text)]
    entries = tomllib.loads((ROOT / "docs" / "atlas.toml").read_text("utf-8"))["entry"]
    commands = [line for entry in entries for line in entry["commands"]]
    axes = [one for line in commands for one in re.findall(r'-axes "([^"]+)"', line)]
    labels += [label for pair in axes for label in pair.split(",") if label]
    assert len(labels) > 100
    assert [label for label in labels if not has_unit(label)] == []
    assert "(1)" not in "".join(commands)


def test_faults_of_charts_are_found():
    """A chart without units, one with pale letters, and one with labels on each other."""
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    axes.plot([0, 1])
    axes.set(xlabel="time (s)", ylabel="share (1)")
    assert faults(figure) == []
    axes.set_xlabel("time")
    assert faults(figure) == ["no unit: 'time'"]
    axes.set_xlabel("time (s)", color="0.7")
    assert ["little contrast" in one for one in faults(figure)] == [True]
    axes.set_xlabel("time (s)", color="black")
    axes.set_xticks([0, 0.01], ["a long name", "another name"])
    assert any("lies on" in one for one in faults(figure))
    assert contrast("white", "black") == pytest.approx(21)
    plt.close(figure)
