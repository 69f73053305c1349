"""karamelo-py bench: its scenes, and what it says of them. No speed is asserted."""

import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from selection import few

from karamelo_py.app.bench import apart, command, measure
from karamelo_py.app.bench.measure import WORKLOADS, Measured
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


SMALL = {
    "column": ("N", "8"), "beam": ("N", "1", "-var", "ppc", "2"), "footing": ("N", "2"),
    "disks": ("N", "6"), "block": ("N", "2"), "dam": ("N", "6"), "bar": ("coarser", "8"),
}  # fmt: skip


# At one size these are those of disks-20.
SIZES = "disks-80", "disks-320"


@pytest.mark.parametrize("name", few(WORKLOADS, *(name for name in WORKLOADS if name not in SIZES)))
def test_scenes_run(name, run_interpreted):
    """At small sizes; a mistake in a script would show here."""
    size = SMALL[name.partition("-")[0]]
    result = run_interpreted(f"{WORKLOADS[name].script}run(1)\n", "-var", *size, "--quiet")
    assert "error" not in result.err  # of hourglasses it warns
    assert result.log.Step[-1] == 1


def compiled(name, changes=()):
    """Places and velocities after 20 steps of a workload with few cells, no power of 2."""
    workload = WORKLOADS[name]
    for old, new in dict(changes).items():
        assert old in workload.script
        workload = workload._replace(script=workload.script.replace(old, new))
    simulation = measure.build(workload, 1, {"N": "3" if "3d" in name else "6"})
    measure.timed_steps(simulation, 20)
    state = simulation.state()
    assert {state.v.dtype.name} == {"float32" if name.endswith("single") else "float64"}
    return state.places, state.v


# Neither they nor their like are compiled by other tests; all are run interpreted.
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("disks-320-mls-single", marks=pytest.mark.xdist_group("mls")),
        pytest.param("disks-320-q4", marks=pytest.mark.full),
        pytest.param("block-3d-quadratic", marks=pytest.mark.full),
    ],
)
def test_scenes_are_compiled(name):
    """Nothing pulls at the bodies: their momentum stays."""
    _, v = compiled(name)
    mean = (0, 0, 0) if name.startswith("disks") else (0.1, 0.1, 0.1)
    assert v.mean(axis=1) == pytest.approx(mean[: len(v)], abs=2e-7)
    assert np.abs(v).max() > 0.09


# Disks that turn: where all points of a body have one velocity moments are zero.
TURNING = {
    "disk1, 0.1, 0.1": "disk1, 0.5*y0, -0.5*x0", "disk2, -0.1, -0.1": "disk2, 0.5*y0, -0.5*x0",
}  # fmt: skip


@pytest.mark.xdist_group("mls")
@pytest.mark.parametrize(
    ("name", "changes"),
    [("disks-320-mls", TURNING), pytest.param("block-3d-mls", {}, marks=pytest.mark.full)],
)
def test_moments_in_single_precision(name, changes):
    """Close to double: places of 1 are rounded by 6e-8 in each of 20 steps, velocities of 0.1 by a
    tenth of that; forces, differences over a cell of strains times 1000, add as little. Without
    the moments of the beginning some velocities would differ by a hundredth or (disks) three.
    """
    both = compiled(f"{name}-single", changes), compiled(name, changes)
    for single, double in zip(*both, strict=True):
        assert np.abs(single - double).max() < 2e-6


@pytest.mark.xdist_group("disks")
def test_one_process_runs_a_group(request):
    """Else each process compiles the loops that tests share (pytest 9.2 with pytest-xdist 3.8)."""
    if not getattr(request.config.option, "loadgroup", False):
        pytest.skip("the tests are not run by group")
    assert request.node.nodeid.endswith("@disks")


@pytest.mark.xdist_group("disks")
def test_what_is_said(capsys, monkeypatch):
    monkeypatch.setattr(measure, "bandwidth", lambda threads, size=1: 1e9)
    assert main(["bench", "disks-20", "--seconds", "0.01"]) == 0
    out = capsys.readouterr().out
    assert "disks-20: two disks, 20 cells per side; 416 points" in out
    # Two places, velocity, mass; det F and four stresses; numbers of point, law and grid.
    assert re.search(rf"bytes per particle +{3 * 16 + 8 + 5 * 8 + 16}\n", out)
    speed, other, ratio = (
        float(re.search(rf"{what} +([\d.]+)", out)[1])
        for what in ("particle-steps/s", "of Karamelo in C[+][+]", "ratio of the two")
    )
    assert ratio == pytest.approx(speed / other, abs=0.06)
    assert "another machine" in out
    # Nodes or the rest of a step, whichever: the machine decides.
    assert re.search(r"limited by +(memory|arithmetic|nodes|overhead|unknown) \(", out)


@pytest.mark.xdist_group("disks")
def test_another_size(capsys, monkeypatch):
    """Published numbers are not compared with another scene."""
    monkeypatch.setattr(measure, "bandwidth", lambda threads, size=1: 1e9)
    assert main(["bench", "disks-20", "-var", "N", "10", "--seconds", "0.01"]) == 0
    out = capsys.readouterr().out
    assert "104 points" in out and "Karamelo" not in out


def test_an_unknown_scene(capsys):
    assert main(["bench", "disks-30"]) == 1
    assert "did you mean 'disks-320'?" in capsys.readouterr().err


def fake(speeds=(1e6, 3e6, 2e6), place=0.1, of_points=8e-4, of_nodes=1e-4, waits=0.0):
    """What could be measured of 3000 points: the fastest repetition takes 1 ms per step."""
    points, nodes = {"Move": of_points}, {"Update": of_nodes}
    return Measured(3000, list(speeds), 112, 350.0, 0.4, place, points, nodes, waits, "double")


@pytest.mark.parametrize(
    ("measured", "word"),
    [
        (fake(), "arithmetic"),
        (fake(place=0.6), "memory"),
        (fake(of_points=4e-4, of_nodes=5e-4, place=0.6), "nodes"),
        # 0.6 ms of 1 ms are none of the sweeps; or threads wait in them for as long.
        (fake(of_points=3e-4, place=0.6), "overhead"),
        (fake(waits=5e-4), "overhead"),
        # One by one they take 1.6 ms: what calls them is most of it.
        (fake(of_points=1.2e-3, of_nodes=4e-4), "unknown"),
    ],
)
def test_what_limits_a_workload(measured, word):
    assert measured.limit == word
    swept = sum((measured.sweeps_of_points | measured.sweeps_of_nodes).values()) - measured.waits
    assert measured.rest == pytest.approx(max(0, 1 - swept / 1e-3))


@pytest.fixture
def faked(tmp_path, monkeypatch):
    """The command without its measuring."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(measure, "bandwidth", lambda threads, size=1: 2e10)
    for name in ("measured", "measured_apart"):
        monkeypatch.setattr(apart, name, lambda part: fake())
    return tmp_path


def test_load_steps_are_timed(tmp_path, monkeypatch, capsys):
    """Unknowns, corrections, and shares of a step that make up the whole."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(measure, "bandwidth", lambda threads, size=1: 2e10)
    words = "column-implicit", "-var", "N", "8", "--seconds", "0.1", "--threads", "1"
    assert main(["bench", *words, "-o", "a.json"]) == 0
    one = json.loads((tmp_path / "a.json").read_text("utf-8"))["workloads"]["column-implicit"]
    assert one["points"] == 32 and one["unknowns"] > 8 and one["corrections"] >= 2
    assert sum(one["stages"].values()) == pytest.approx(1)
    assert min(one["stages"].values()) > 0
    assert "seconds per load step" in capsys.readouterr().out


def test_a_file_and_a_comparison_with_it(faked, capsys):
    assert main(["bench", "disks-20", "disks-80", "-o", "a.json"]) == 0
    found = json.loads((faked / "a.json").read_text(encoding="utf-8"))
    one = found["workloads"]["disks-80"]
    assert found["threads"] == 1 and found["triad"] == 2e10 and found["versions"]["numba"]
    assert one["best"] == 3e6 and one["median"] == 2e6 and one["speeds"] == [1e6, 3e6, 2e6]
    assert one["precision"] == "double" and one["bytes_per_particle"] == 112
    assert one["limited_by"] == "arithmetic" and one["roofline"] == 0.4
    one["best"] = 1.5e6
    found["processor"] = "a slower one"
    found["versions"]["numba"] = "0.1"
    (faked / "a.json").write_text(json.dumps(found), encoding="utf-8")
    capsys.readouterr()
    assert main(["bench", "disks-80", "disks-320", "--against", "a.json"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^disks-80 +1\.50 +3\.00 +2\.00$", out, re.M)
    assert re.search(r"^disks-20 +3\.00 +- +- +not measured now$", out, re.M)
    assert re.search(r"^disks-320 +- +3\.00 +- +new$", out, re.M)
    assert "another processor: a slower one then, " in out
    assert "another version of numba: 0.1 then, " in out
    assert "another threads" not in out


def test_other_scenes_have_no_ratio(faked, capsys):
    """A variable that was set, or another precision, makes another workload."""
    assert main(["bench", "disks-20", "-o", "a.json"]) == 0
    assert main(["bench", "disks-20", "-var", "N", "40", "--against", "a.json"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^disks-20 +3\.00 +3\.00 +- +other variables$", out, re.M)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "cannot read a.json"),
        ("x", "a.json is not the output of a bench"),
        ("[1]", "is not the output of a bench"),
        ('{"kind": "karamelo-py bench", "workloads": {"disks-20": {"best": "fast"}}}', "is not"),
        ('{"kind": "karamelo-py bench", "workloads": {"disks-20": {"best": NaN}}}', "is not"),
    ],
)
def test_what_is_no_bench(faked, capsys, text, said):
    if text is not None:
        (faked / "a.json").write_text(text, encoding="utf-8")
    assert main(["bench", "disks-20", "--against", "a.json"]) == 1
    err = capsys.readouterr().err
    assert err.count("error") == 1 and said in err and "Traceback" not in err


def test_the_commit_is_that_of_the_repository():
    words = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
    try:
        head = subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("there is no repository here")
    assert command.commit() in (head, head + "-dirty")


# --- several workloads ----------------------------------------------------------------------------

TWO = ["bench", "disks-20", "disks-80", "--seconds", "0.01", "-var", "N"]


@pytest.mark.full
@pytest.mark.xdist_group("disks")
def test_each_of_several_workloads_has_a_process(tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(measure, "bandwidth", lambda threads, size=1: 2e10)
    monkeypatch.setattr(measure, "build", None)  # not in this one
    assert main([*TWO, "10", "-o", "a.json"]) == 0
    out, err = capfd.readouterr()
    assert out.count("; 104 points\n") == 2 and not err
    found = json.loads((tmp_path / "a.json").read_text("utf-8"))
    assert found["triad"] == 2e10 and list(found["workloads"]) == ["disks-20", "disks-80"]
    assert all(
        len(one["speeds"]) == 5 and one["variables"] == {"N": "10"} and one["sweeps_of_points"]
        for one in found["workloads"].values()
    )
    assert main([*TWO, "0"]) == 1
    out, err = capfd.readouterr()
    assert "points" not in out and err.startswith("bench:") and err.count("error: ") == 1
    assert "h = 1/N" in err and "Traceback" not in err


@pytest.mark.xdist_group("disks")
def test_the_process_of_a_workload_ends_with_bench():
    """Also where that is killed, and can tell nobody."""
    part = apart.Measurement("disks-320", 1, {}, 600.0, 1e9, False)
    with subprocess.Popen(
        [*apart.COMMAND, json.dumps(part)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.communicate() == (b"", b"")
    assert process.returncode == 0


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="there are no such signals here")
def test_a_process_that_somebody_ends(capfd, monkeypatch):
    monkeypatch.setattr(measure, "bandwidth", lambda threads, size=1: 2e10)
    ended = "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"
    monkeypatch.setattr(apart, "COMMAND", (sys.executable, "-c", ended))
    assert main([*TWO, "10"]) == 1
    err = capfd.readouterr().err
    assert err == "error: disks-20 could not be measured: its process was ended by SIGKILL\n"


def test_an_interrupt_ends_the_process_of_a_workload(capfd, monkeypatch):
    """Ctrl-C comes to the one process that waits, and the other ends with it."""
    begun = []

    class Interrupted(subprocess.Popen):
        def wait(self, timeout=None):
            if self in begun:
                return super().wait(timeout)
            begun.append(self)
            raise KeyboardInterrupt

    monkeypatch.setattr(measure, "bandwidth", lambda threads, size=1: 2e10)
    ends = "import os; os.read(0, 1); os._exit(7)"
    monkeypatch.setattr(apart, "COMMAND", (sys.executable, "-c", ends))
    monkeypatch.setattr(subprocess, "Popen", Interrupted)
    monkeypatch.setattr(command, "commit", lambda: None)  # of which another process tells
    assert main([*TWO, "10"]) == 130
    assert capfd.readouterr().err == "error: interrupted\n"
    assert len(begun) == 1 and begun[0].wait(60) == 7


# --- several processes ----------------------------------------------------------------------------


def test_processes_beside_threads(tmp_path, monkeypatch, capsys):
    """Strong, with as many threads, and weak; shares of waiting as they were found."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(measure, "bandwidth", lambda threads, size=1: 2e10)
    monkeypatch.setattr("numba.config.NUMBA_NUM_THREADS", 2)
    parts = []

    def measured(part, *, weak=False):
        parts.append(part)
        best = 1e6 * part.ranks**0.5
        return apart.Scaled(part.ranks, part.threads, weak, 100, best, 0.02, 0.125)

    monkeypatch.setattr(apart, "measured_with_ranks", measured)
    assert main(["bench", "block-3d-mls", "--ranks", "4,2", "-o", "a.json"]) == 0
    out = capsys.readouterr().out
    assert [(p.ranks, p.threads) for p in parts] == [(1, 1), (2, 1), (1, 2), (4, 1), (2, 1), (4, 1)]
    assert parts[4].presets == {"N": "29"} and parts[5].presets == {"N": "37"}  # of 23
    assert re.search(r"4 x 1 \(larger\) +100 +2\.00 +2\.00 +2\.0 % +12\.5 %\n", out)
    rows = json.loads((tmp_path / "a.json").read_text("utf-8"))["workloads"]["block-3d-mls"]
    assert rows["best"] == 1e6 and [row["weak"] for row in rows["scaling"]] == 4 * [False] + 2 * [
        True
    ]


def test_scenes_grow_with_processes():
    points = {}
    for times in (1, 4):
        found = apart.grown(WORKLOADS["bar-3d-ul"].script, {"coarser": "4"}, times)
        hub = Hub()
        Interpreter(hub, presets=found).run_text(WORKLOADS["bar-3d-ul"].script)
        points[times] = sum(solid.count for solid in hub.solids.values())
    # Cells of another size do not fill the bar as well.
    assert points[4] == pytest.approx(4 * points[1], rel=0.2)


def test_what_is_no_list_of_ranks(capsys):
    assert main(["bench", "--ranks", "1,x"]) == 1
    assert "'1,x' is not a list of process counts, such as 1,2,4" in capsys.readouterr().err
