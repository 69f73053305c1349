"""Records of acceleration at the base: site response of a column."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest

# A column of 20 m, c = 200 m/s, shaken at k H = angle; in 1D its waves are P waves.
COLUMN = """
    H = 20
    h = 1
    method(tlmpm, FLIP, linear, 1)
    dimension(1, 0, H, h)
    region(column, block, 0, H)
    material(soil, linear, 2000, 2000*200^2, 0)
    material(rock, linear, 2000, 2000*400^2, 0)
    solid(soil, region, column, 2, soil, h)
    region(low, block, -INF, 1e-6)
    group(base, nodes, region, low, all)
    w = {angle}*200/H
    {edge}
    fix(quake, ground_motion, base, {record}{more})
    region(top, block, H - 0.5, INF)
    group(top, particles, region, top, all)
    compute(u, average_velocity, top)
    log_modify(custom, time, u_x, quake_vx, quake_ax, quake_x)
    set_output(1)
    {run}
"""
USUAL = {"angle": "PI/3", "edge": "", "more": "", "record": "w*cos(w*time)", "run": "run(5)"}


def column(**changes):
    return COLUMN.format(**USUAL | changes)


def amplitude(log, w, span):
    """Amplitude of the velocity at the top at the frequency w, over the last `span`."""
    t, v = log["Time"], log["u_x"]
    last = t >= t[-1] - span * (1 + 1e-9)
    t, v = t[last], v[last]
    parts = [2 / span * np.trapezoid(v * wave(w * t), t) for wave in (np.sin, np.cos)]
    return sqrt(parts[0] ** 2 + parts[1] ** 2)


@pytest.mark.xdist_group("absorbing")
@pytest.mark.parametrize("angle", [pi / 3, pi / 6])
def test_a_rigid_base_amplifies(run_script, angle):
    """1/cos(k H), exact without damping; over 12 H/c the transient has other frequencies.

    Kramer 1996, Geotechnical Earthquake Engineering, equation 7.13.
    """
    log = run_script(column(angle=repr(angle), run="run_time(1.2)")).log
    assert amplitude(log, angle * 10, 1.2) == pytest.approx(1 / cos(angle), rel=6e-3)


@pytest.mark.xdist_group("absorbing")
@pytest.mark.parametrize("angle", [pi / 2, pi / 4])
def test_a_compliant_base_lets_waves_out(run_script, angle):
    """Surface over outcrop 1/sqrt(cos^2 kH + a^2 sin^2 kH), a = 1/2, the ratio of impedances."""
    edge = "fix(edge, absorbing, base, rock, xlo)"
    period = 2 * pi / (angle * 10)
    text = column(
        angle=repr(angle), edge=edge, more=", through=edge", run=f"run_time({4 * period})"
    )
    log = run_script(text).log
    exact = 1 / sqrt(cos(angle) ** 2 + 0.25 * sin(angle) ** 2)
    assert amplitude(log, angle * 10, period) == pytest.approx(exact, rel=0.01)


def test_a_file_is_integrated_exactly(run_interpreted, tmp_path):
    """Linear between its times: a triangle of 2 in 0.04, then rest."""
    (tmp_path / "run").mkdir()
    record = "time, ax\n0, 0\n0.02, 2\n0.04, 0\n0.05, 0\n"
    (tmp_path / "run" / "quake.csv").write_text(record, encoding="utf-8")
    lines = "set_dt(0.002)\nrun(30)"
    log = run_interpreted(column(record="quake.csv", run=lines)).log
    t = log["Time"]
    rising, falling = 50 * t**2, 0.04 - 50 * (0.04 - t) ** 2
    exact = np.where(t < 0.02, rising, np.where(t < 0.04, falling, 0.04))
    assert log["quake_vx"] == pytest.approx(exact, abs=1e-14)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"record": "none.csv"}, "none.csv"),
        ({"record": "flat.csv"}, "rows of increasing time"),
        ({"record": "x0*time"}, "the acceleration depends on x0"),
        ({"more": ", through=quakes"}, "unknown fix 'quakes'"),
        ({"more": ", through=hold", "edge": "fix(hold, velocity_nodes, base, 0)"},
         "fix 'hold' is a fix velocity_nodes"),
        ({"record": "1, 2"}, "more components than the 1 dimension of the domain"),
    ],
)  # fmt: skip
def test_what_is_refused(run_interpreted, tmp_path, changes, says):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "flat.csv").write_text("0, 1\n0, 2\n", encoding="utf-8")
    err = run_interpreted(column(**changes), status=1).err
    assert says in err and err.count("error:") == 1, err


THROUGH = """
    method(tlmpm, FLIP, linear, 1)
    dimension(3, 0, 1, 0, 1, 0, 1, 0.5)
    region(b, block, 0, 1, 0, 1, 0, 1)
    material(m, linear, 1000, 1e6, 0.3)
    solid(s, region, b, 1, m, 0.5, 0)
    region(lo, block, INF, INF, INF, INF, -INF, 0)
    group(low, nodes, region, lo, all)
    fix(edge, absorbing, low, m, zlo)
    fix(q, ground_motion, low, 30, 20, 10, through=edge)
    compute(p, linear_momentum, all)
    log_modify(custom, time, p_x, p_y, p_z)
    set_output(1)
    run(2)
"""


def test_a_compliant_base_moves_in_three_directions(run_interpreted):
    """Tractions rho c v (Joyner & Chen 1975) of S, S and P waves push the ground."""
    log = run_interpreted(THROUGH).log
    p = [log[f"p_{axis}"][-1] for axis in "xyz"]
    fast = np.sqrt(2 * (1 - 0.3) / (1 - 2 * 0.3))  # P over S waves
    assert p[1] / p[0] == pytest.approx(2 / 3, rel=1e-6)
    assert 0.6 < p[2] / p[0] * 3 / fast < 1  # the dashpots of P waves brake more
