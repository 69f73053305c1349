"""Stages of a job: points that are absent for a time, and displacements from a stage on."""

import os
import subprocess
import sys

import meshio
import numpy as np
import pytest
from scenes import block

# A column of two layers, from the weight of both to the weight of the lower one.
PIT = """
method(ulmpm, FLIP, linear, 1)
scheme(quasi-static)
dimension(1, 0, 2, 0.25)
region(low, block, 0, 1)
region(high, block, 1, 2)
material(clay, linear, 2000, 1e7, 0.25)
solid(low, region, low, 2, clay, 0.25, 0)
solid(high, region, high, 2, clay, 0.25, 0)
group(high, particles, region, high, all)
group(low, particles, region, low, all)
region(bottom, block, -INF, 1e-6)
group(bottom, nodes, region, bottom, all)
fix(base, velocity_nodes, bottom, 0)
fix(weight, body_force, all, -10)
set_dt(1)
{begin}
fix(u, displacement, all)
compute(heave, probe, low, ux)
log_modify(custom, time, heave, base_x)
run(1)
delete_fix(u)
fix(u, displacement, all)
{then}
run(1)
"""


def test_an_excavation_lets_the_ground_rise(run_interpreted):
    """Mean rise of the rest q/M z, q = rho g 1 m, M = 1.2 E: 1/2 q/M, to second order in strain."""
    result = run_interpreted(PIT.format(begin="", then="deactivate(high)"))
    assert "points present" in result.out and "deleted points" not in result.out
    log, exact = result.log, 0.5 * 2000 * 10 / 1.2e7
    assert log["heave"][-2] < -exact
    assert abs(log["heave"][-1] / exact - 1) < 3e-3
    assert abs(log["base_x"][-1] / 2000 / 10 - 1) < 1e-9


def test_fill_loads_the_ground(run_interpreted):
    log = run_interpreted(PIT.format(begin="deactivate(high)", then="activate(high)")).log
    assert abs(log["heave"][-1] / (-0.5 * 2000 * 10 / 1.2e7) - 1) < 3e-3
    assert abs(log["base_x"][-2] / 20000 - 1) < 1e-9
    assert abs(log["base_x"][-1] / 40000 - 1) < 1e-9


MORE = (
    "region(more, block, 0.7, 0.8, 0.3, 0.5)", "solid(fill, region, more, 2, rubber, 0.1, 0)",
    "group(fill, particles, region, more, solid, fill)", "deactivate(fill)",
)  # fmt: skip
FALLS = ("fix(w, body_force, all, 0, -8)", "set_dt(1/512)", "compute(p, linear_momentum, fill)",
         "log_modify(custom, step, time, p_y)", "set_output(1)")  # fmt: skip


def test_points_that_wait_are_not_there(state_interpreted):
    motion = ("fix(v, initial_velocity_particles, all, sin(9*x0), 0)", "run(5)")
    with_fill = state_interpreted(block(2, *MORE, *motion))
    without = state_interpreted(block(2, *motion))
    for name in without:
        if without[name].shape == with_fill[name].shape:
            assert np.array_equal(without[name], with_fill[name], equal_nan=True), name


def test_points_come_in_at_rest_with_their_mass(run_interpreted):
    """Momentum -m g t exactly, since the step at which they come in."""
    again = ("run(3)", "activate(fill)", "run(2)", "deactivate(fill)", "activate(fill)", "run(2)")
    result = run_interpreted(block(2, *MORE, *FALLS, *again))
    mass = 2 * 0.1 * 0.2
    falls = [0, 0, 0, 0, 1, 2, 1, 2]
    assert result.log["p_y"] == pytest.approx([-8 * mass * n / 512 for n in falls], rel=1e-12)
    assert "8 points activated, with a mass of 0.04" in result.out


def test_displacements_begin_where_the_fix_does(run_interpreted):
    fly = ("fix(v, initial_velocity_particles, all, 0, -4)", "set_dt(1/512)", "set_output(1)",
           "fix(w, displacement, body)", "compute(u, probe, all, uy)",
           "log_modify(custom, step, u)", "run(2)", "delete_fix(w)",
           "fix(w, displacement, all)", "run(2)")  # fmt: skip
    named = "group(body, particles, region, box, all)"
    log = run_interpreted(block(2, named, *fly)).log
    assert log["u"] == pytest.approx([0, -1 / 128, -2 / 128, -1 / 128, -2 / 128], abs=1e-12)


@pytest.mark.parametrize(
    "lines, says",
    [
        (("group(no, particles, region, far, all)", "deactivate(no)"), "group 'no' has no points"),
        (("activate(fill)", "activate(fill)"), "are active already"),
        (("run(1)", "group(top, particles, region, near, all)", "activate(top)", "activate(fill)"),
         "are active already"),
        (("group(box, particles, region, box, all)", "delete_particles(fill, region, more)"),
         "would renumber points that are inactive"),
    ],
)  # fmt: skip
def test_what_is_refused_or_warned_of(run_interpreted, lines, says):
    far = ("region(far, block, 1.1, 1.2, 1.1, 1.2)", "region(near, block, 0.3, 0.4, 0.3, 0.4)")
    result = run_interpreted(block(2, *MORE, *far, *lines, "run(1)"), status=None)
    assert says in result.err


def test_points_in_the_way_of_fill_are_named(run_interpreted):
    lines = (*MORE[:1], "solid(fill, region, more, 2, rubber, 0.1, 0)", MORE[2], MORE[3],
             "fix(v, initial_velocity_particles, all, 20, 0)", "run_time(0.008)",
             "activate(fill)", "run(1)")  # fmt: skip
    result = run_interpreted(block(2, *lines))
    assert "are at positions where points of group 'fill' enter" in result.err


def test_stages_and_surfaces_need_no_scipy(tmp_path):
    """`pip install .` has none: fill that comes in, and a closed surface from a file."""
    box = meshio.Mesh(
        np.array([[x, y, z] for x in (0.2, 0.7) for y in (0.2, 0.7) for z in (0.2, 0.7)]),
        [("quad", np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4],
                            [1, 5, 7, 3]]))],
    )  # fmt: skip
    meshio.write(tmp_path / "box.obj", box)
    (tmp_path / "in.surface").write_text("""
    dimension(3, 0, 1, 0, 1, 0, 1, 0.25)
    method(tlmpm, FLIP, linear, 1)
    region(box, stl, box.obj)
    material(m, linear, 1, 1, 0)
    solid(s, region, box, 1, m, 0.25)
    run(1)
    """)
    fill = PIT.format(begin="deactivate(high)", then="activate(high)")
    fill = fill.replace("scheme(quasi-static)", "").replace("set_dt(1)", "set_dt(1e-4)")
    (tmp_path / "in.fill").write_text(fill)
    for name in ("in.surface", "in.fill"):
        hidden = "import sys; sys.modules['scipy'] = None; sys.argv = ['karamelo-py', {!r}]\n"
        text = hidden.format(name) + "from karamelo_py.app.cli import main; sys.exit(main())"
        done = subprocess.run(
            [sys.executable, "-c", text], cwd=tmp_path, capture_output=True, text=True,
            env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
