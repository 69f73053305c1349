"""Outputs go on from an earlier state than the last that they show, and show no state twice."""

import os
import re
import subprocess
import sys
from itertools import pairwise

import h5py
import numpy as np
import pytest
from scenes import block
from test_failures import against_a_wall

OUTPUTS = """\
dump(e, all, particle, 10, e.txt, x)
dump(h, all, hdf5, time(0.05), h.h5, x)
dump(m, all, movie, 20, m.gif, 100, 100, vx)
plot(p, 3, timestep, time)
save_plot(p.svg)
"""


def frames(path) -> int:
    """How many pictures a .gif holds: a graphic control extension comes before each."""
    return path.read_bytes().count(b"\x21\xf9\x04")


def drawn(path) -> int:
    """How many corners the curve of a plot has."""
    curves = re.findall(r'<path d="(M [^"]*)" clip-path', path.read_text(encoding="utf-8"))
    return max(len(re.findall("[ML] ", curve)) for curve in curves)


def test_what_goes_on_from_before_energy_grew_shows_each_state_once(run_interpreted):
    """A body meets a wall and breaks at step 81; the last good state is that of step 21."""
    script = against_a_wall(2, 0.0097).replace("run(1000)", f"{OUTPUTS}run(1000)")
    broken = run_interpreted(script, status=1)
    assert "-restart last_good.21.h5" in broken.err and broken.log.Step[-1] == 80
    smaller = script.replace("set_dt(0.0097)", "set_dt(0.0035)").replace("run(1000)", "run(60)")
    again = run_interpreted(smaller, "-restart", "last_good.21.h5")
    assert again.log.Step.tolist() == list(range(0, 61, 5))
    dumped = (again.folder / "e.txt").read_text(encoding="utf-8")
    assert re.findall(r"TIMESTEP\n(\d+)", dumped) == [str(10 * k) for k in range(7)]
    with h5py.File(again.folder / "h.h5") as file:
        times = file["time"][()].tolist()
    # 21 steps of 0.0097, and 39 of 0.0035: every 0.05, and the first and last states.
    assert times[0] == 0 and abs(times[-1] - 0.3402) < 1e-9
    assert len(times) == 1 + 6 + 1 and all(a < b for a, b in pairwise(times))
    assert frames(again.folder / "m.gif") == 4  # steps 0, 20, 40, 60
    assert drawn(again.folder / "p.svg") == 21  # steps 0, 3, ..., 60


SUMS = """\
compute(e, error, all, vx, 2, L1)
fix(s, check_solution, all, 0.01*time)
log_modify(custom, step, time, e, e_history, e_max, s_x, s_z)
"""


def test_what_goes_on_from_before_energy_grew_adds_up_each_state_once(run_interpreted):
    """Sums over time are those of a run that took the smaller step from that state on."""
    script = against_a_wall(2, 0.0097).replace("log_modify(custom, step, time)\n", SUMS)
    broken = run_interpreted(script, folder="a", status=1)
    assert "-restart last_good.21.h5" in broken.err and broken.log.Step[-1] == 80
    smaller = script.replace("set_dt(0.0097)", "set_dt(0.0035)").replace("run(1000)", "run(60)")
    again = run_interpreted(smaller, "-restart", "last_good.21.h5", folder="a")
    # A file of a run that has not broken yet holds the same state.
    early = script.replace("run(1000)", "restart(21, at.*.h5)\nrun(30)")
    run_interpreted(early, folder="b")
    through = run_interpreted(smaller, "-restart", "at.21.h5", folder="b")
    assert through.log.Step.tolist() == list(range(0, 61, 5))
    for name in ("Step", "Time", "e", "e_history", "e_max", "s_x", "s_z"):
        assert np.array_equal(again.log[name], through.log[name]), name


COUNTS = """\
remembers = ("called", "seen")
called, seen = 0, []

def count(points):
    global called
    called += 1
    seen.append(points.time)
    return called
"""


def test_a_function_remembers_each_step_once_in_the_last_good_state(run_interpreted, tmp_path):
    """A block leaves the domain in step 63: steps from 1 on are taken once more before."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "counting.py").write_text(COUNTS, encoding="utf-8")
    lines = ("fix(v, initial_velocity_particles, all, 10)", "fix(c, python, all, counting.count)",
             "set_dt(0.001)", "set_output(5)", "log_modify(custom, step, c)")  # fmt: skip
    script = block(1, *lines, "run(200)")
    broken = run_interpreted(script, status=1)
    assert "-restart last_good.62.h5" in broken.err
    assert broken.log.Step[-1] == broken.log.c[-1] == 62
    smaller = script.replace("set_dt(0.001)", "set_dt(0.0001)").replace("run(200)", "run(65)")
    again = run_interpreted(smaller, "-restart", "last_good.62.h5")
    assert again.log.Step[-1] == 65 and again.log.c.tolist() == again.log.Step.tolist()


# Prints how many states are marked at most, and how many of them lie ahead, script by script.
HELD = """\
import sys
from karamelo_py.app.cli import main
from karamelo_py.run import recovery

class Counted(recovery.RollbackPoint):
    most = ahead = 0
    def note(self, **options):
        super().note(**options)
        Counted.most = max(Counted.most, len(self._parts))
        ahead = sum(step > self.hub.update.step for step in self._parts)
        Counted.ahead = max(Counted.ahead, ahead)

recovery.RollbackPoint = Counted
for script in sys.argv[1:]:
    Counted.most = Counted.ahead = 0
    main([script])
    print("most", Counted.most, Counted.ahead)
"""


@pytest.mark.full
def test_no_more_states_are_marked_than_a_run_may_go_back_to(tmp_path, starts_are_cheap):
    """Those since the last good one; none where that is the start, as the step is too large.

    Those behind the good one that half the step begins at are not marked any more.
    """
    fly = "fix(v, initial_velocity_particles, all, 0.01*sin(30*x0))"
    for name, dt in (("good", 0.001), ("large", 0.0125)):
        script = block(1, fly, f"set_dt({dt})", "set_output(1)", "run(250)")
        (tmp_path / name).write_text(script, encoding="utf-8")
    script = against_a_wall(2, 0.0097).replace("run(1000)", "run(100, on_trouble=halve)")
    (tmp_path / "halved").write_text(script, encoding="utf-8")
    said = subprocess.run(
        [sys.executable, "-c", HELD, "good", "large", "halved"], cwd=tmp_path, capture_output=True,
        text=True, env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert "above the stability limit" in said.stderr
    assert "with 1/2 of the step" in said.stderr
    good, large, halved = re.findall(r"^most (\d+) (\d+)", said.stdout, re.M)
    assert (good, large) == (("100", "0"), ("0", "0")), said.stderr
    assert int(halved[0]) > 1 and halved[1] == "0"
