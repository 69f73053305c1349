"""Eos jwl: detonation products on closed forms, and a plane detonation."""

import re
from itertools import pairwise
from math import exp

import numpy as np
import pytest
from conftest import INPUTS

from comparisons import exact
from karamelo_py.points.laws.eos import VolumeStep, bulk_modulus, compressed, ignited, pressure
from karamelo_py.points.laws.eos.fluid import Burning, JwlConstants

RHO, A, B, R1, R2, W, E0, D = exact.TNT
TNT = JwlConstants(RHO, A, B, R1, R2, W, E0, D).checked()["eos"]._replace(cell_size=1e-3)
BURNT = Burning(E0, 1.0)


def test_chapman_jouguet():
    """Where the Rayleigh line touches E - E0 = p (1 - V)/2: 6930 m/s and 21 GPa (Dobratz 1985)."""
    V = np.linspace(0.65, 0.85, 401)
    without = np.array([pressure(TNT, v, Burning(0.0, 1.0), ()) for v in V])
    p = (without + W * E0 / V) / (1 - W * (1 - V) / (2 * V))
    speeds = np.sqrt(p / (1 - V) / RHO)
    k = speeds.argmin()
    assert speeds[k] == pytest.approx(D, rel=2e-3)
    assert p[k] == pytest.approx(21e9, rel=2e-3)
    # There the front is sonic: D - u = c.
    state = Burning(E0 + p[k] * (1 - V[k]) / 2, 1.0)
    c = np.sqrt(bulk_modulus(TNT, V[k], state, ()) * V[k] / RHO)
    assert c == pytest.approx(speeds[k] * V[k], rel=5e-3)


def test_products_expand_along_the_isentrope():
    """p = A exp(-R1 V) + B exp(-R2 V) + C V^-(1+w), of second order in the step."""

    def isentrope(v, C):
        return A * exp(-R1 * v) + B * exp(-R2 * v) + C * v ** -(1 + W)

    start, end = 0.75, 2.5
    C = (pressure(TNT, start, BURNT, ()) - isentrope(start, 0)) * start ** (1 + W)
    errors = []
    for n in (50, 100):
        memory, volumes = BURNT, np.linspace(start, end, n + 1)
        for before, after in pairwise(volumes):
            memory = compressed(TNT, memory, VolumeStep(before, after, 1e-9), 0.0)
        errors.append(pressure(TNT, end, memory, ()) / isentrope(end, C) - 1)
    assert abs(errors[1]) < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)


def test_a_point_burns_while_the_front_passes():
    """F = t D / (1.5 h), from the time at which the point is lit."""
    (memory,) = ignited(TNT, Burning(E0, -1e30), -1e-8)
    full = pressure(TNT, 1.0, BURNT, ())
    assert pressure(TNT, 1.0, memory, ()) == 0
    for t, part in ((1e-8, 0), (1e-8 + 0.75e-3 / D, 0.5), (1.0, 1)):
        later = compressed(TNT, memory, VolumeStep(1.0, 1.0, t), 0.0)
        assert pressure(TNT, 1.0, later, ()) == pytest.approx(part * full, rel=1e-6)


def profile(path):
    _, body = path.read_text().split("ITEM: ATOMS ")
    names, *rows = body.splitlines()
    names, table = names.split(), np.genfromtxt(rows)
    return dict(zip(names, table[table[:, names.index("x")].argsort()].T, strict=True))


def test_the_slab_of_tnt(run_script):
    """Front at 6930 m/s; in the 20 cells after the burn zone the wave of Taylor (1950) within 1 %.

    The pressure falls from 21 GPa by 0.31 % per cell, and the front takes 8 cells.
    """
    script = (INPUTS / "in.tnt_slab").read_text("utf-8")
    done = run_script(script.replace("run_time(T)", "run_time(T/2)\nrun_time(T/2)"))
    assert re.search("^  method +tlmpm TPIC quadratic-spline musl$", done.out, re.M)  # of auto
    files = sorted(done.folder.glob("tnt.*"), key=lambda path: int(path.name.split(".")[1]))
    fronts, peaks = [], []
    for file in files[-2:]:
        at = profile(file)
        peaks.append(at["p"].max())
        fronts.append(at["x"][at["p"] > 0.5 * peaks[-1]].max())
    assert (fronts[1] - fronts[0]) / (0.4 * 0.1 / D) == pytest.approx(D, rel=0.01)
    assert 0.96 * 21e9 < peaks[1] < 21e9
    assert peaks[0] < peaks[1]  # the release behind the front flattens
    speed, p, u = exact.release_of_tnt()
    assert (speed[0], p[0], u[0]) == pytest.approx((D, 21e9, 1859), rel=1e-3)
    behind = (at["x"] < 0.08 - 8 * 0.000125) & (at["x"] > 0.08 - 28 * 0.000125)
    assert sum(behind) > 40
    there = at["x"][behind] / (0.08 / D)
    for name, wanted in (("p", p), ("vx", u)):
        found = at[name][behind]
        assert np.allclose(found, np.interp(there, speed[::-1], wanted[::-1]), rtol=0.01)
    log = done.log
    assert abs(log["total"]).max() < 2e-3 * (E0 * 0.08)


def test_an_explosive_that_nobody_lights_is_reported(run_interpreted):
    script = """
        method(ulmpm, TPIC, quadratic-spline)
        dimension(1, 0, 1, 0.25)
        region(slab, block, 0, 1)
        eos(tnt, jwl, 1630, 371.2e9, 3.231e9, 4.15, 0.95, 0.30, 7e9, 6930)
        strength(none, fluid, 0)
        material(tnt, eos-strength, tnt, none)
        material(soft, linear, 1000, 1e6, 0.3)
        solid(slab, region, slab, 1, {}, 0.25)
        {}
        run(1)
    """
    light = "fix(light, detonation, all, x0/6930)"
    assert "nothing ignites material 'tnt'" in run_interpreted(script.format("tnt", "")).err
    assert "nothing ignites" not in run_interpreted(script.format("tnt", light)).err
    said = run_interpreted(script.format("soft", light)).err
    assert "no point of the group is explosive" in said
    squeeze = "fix(squeeze, initial_stress, all, -1e6, NULL, NULL, NULL, NULL, NULL)"
    result = run_interpreted(script.format("tnt", squeeze), status=1)  # it did nothing, in silence
    assert "initial_stress: the stress of solid 'slab'" in result.err
