"""karamelo-py bench: its scenes, and what it says of them. No speed is asserted."""

from __future__ import annotations

import re

import pytest

from karamelo_py.app.bench import measure
from karamelo_py.app.bench.workloads import WORKLOADS
from karamelo_py.app.cli import main
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.scene.hub import Hub

# Points of the scenes that Karamelo was measured on.
PUBLISHED = {
    "disks-20": 416, "disks-80": 6456, "disks-320": 102936,
    "bar-3d-ul": 74664, "bar-3d-tl": 74052, "dam-break": 88804,
}  # fmt: skip


@pytest.mark.parametrize("name", PUBLISHED)
def test_scenes_have_the_published_size(name):
    hub = Hub()
    Interpreter(hub).run_text(WORKLOADS[name].script)
    assert sum(solid.count for solid in hub.solids.values()) == PUBLISHED[name]


@pytest.mark.parametrize("name", WORKLOADS)
def test_scenes_run(name, run_interpreted):
    """At small sizes; a mistake in a script would show here."""
    small = {"disks": ("N", "6"), "block": ("N", "2"), "dam": ("N", "6"), "bar": ("coarser", "8")}
    size = small[name.partition("-")[0]]
    result = run_interpreted(WORKLOADS[name].script + "run(3)\n", "-var", *size, "--quiet")
    assert "error" not in result.err  # of hourglasses it warns
    assert result.log.Step[-1] == 3


@pytest.mark.xdist_group("disks")
def test_one_process_runs_a_group(request):
    """Else each process compiles the loops that tests share (pytest 9.2 with pytest-xdist 3.8)."""
    if not getattr(request.config.option, "loadgroup", False):
        pytest.skip("the tests are not run by group")
    assert request.node.nodeid.endswith("@disks")


@pytest.mark.xdist_group("disks")
def test_what_is_said(capsys, monkeypatch):
    monkeypatch.setattr(measure, "bandwidth", lambda threads: 1e9)
    assert main(["bench", "disks-20", "--seconds", "0.01"]) == 0
    out = capsys.readouterr().out
    assert "disks-20: two disks, 20 cells a side; 416 points" in out
    # Two places, velocity, mass; det F and four stresses; numbers of point, law and grid.
    assert re.search(rf"bytes per particle +{3 * 16 + 8 + 5 * 8 + 16}\n", out)
    speed, other, ratio = (
        float(re.search(rf"{what} +([\d.]+)", out)[1])
        for what in ("particle-steps/s", "of Karamelo in C[+][+]", "ratio of the two")
    )
    assert ratio == pytest.approx(speed / other, abs=0.06)
    assert "another machine" in out


@pytest.mark.xdist_group("disks")
def test_another_size(capsys, monkeypatch):
    """Published numbers are not compared with another scene."""
    monkeypatch.setattr(measure, "bandwidth", lambda threads: 1e9)
    assert main(["bench", "disks-20", "-var", "N", "10", "--seconds", "0.01"]) == 0
    out = capsys.readouterr().out
    assert "104 points" in out and "Karamelo" not in out


def test_an_unknown_scene(capsys):
    assert main(["bench", "disks-30"]) == 1
    assert "did you mean 'disks-320'?" in capsys.readouterr().err
