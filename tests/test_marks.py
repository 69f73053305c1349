"""Outputs go on from an earlier state than the last that they show, and show no state twice."""

import re
from itertools import pairwise

import h5py
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
    assert "last_good.21.h5 goes on" in broken.err and broken.log.Step[-1] == 80
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
