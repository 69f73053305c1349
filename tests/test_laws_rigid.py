"""Rigid bodies: they keep the velocity they are given, and push what they meet."""

from __future__ import annotations

import re

import numpy as np
import pytest

from karamelo_py.app.cli import main

SCENE = """
method(METHOD, FLIP, linear, 1)
dimension(2, -2, 4, 0, 1, 0.25)
region(left, block, -1, 0, 0, 1)
region(right, block, 0.5, 1.5, 0, 1)
material(tool, rigid, RHO)
material(soft, linear, 1, 10, 0)
solid(a, region, left, 1, tool, 0.25)
solid(b, region, right, 1, soft, 0.25)
group(tool, particles, region, left, solid, a)
group(block, particles, region, right, solid, b)
fix(v, initial_velocity_particles, tool, 0.5, 0, NULL)
compute(va, average_velocity, tool)
compute(vb, average_velocity, block)
dump(end, all, particle, 100000, end.*.LAMMPS, x, x0, vx, vy, s11, volume, ienergy)
log_modify(custom, step, time, va_x, vb_x)
run_time(3)
"""


def scene(method="ulmpm", rho=1000):
    return SCENE.replace("METHOD", method).replace("RHO", str(rho))


@pytest.mark.parametrize("method", ["ulmpm", "ulmpm/contacts"])
def test_a_tool_pushes_a_block(run_interpreted, method):
    """The tool keeps its velocity to the last bit; the block goes with it, or bounces off."""
    result = run_interpreted(scene(method))
    last = result.dump(sorted(p.name for p in result.folder.glob("end.*"))[-1])
    tool = last.type == 1
    assert last.vx[tool].tolist() == [0.5] * 16 and last.vy[tool].tolist() == [0] * 16
    assert last.x[tool] == pytest.approx(last.x0[tool] + 1.5, rel=1e-8)
    assert last.s11[tool].tolist() == [0] * 16 and last.ienergy[tool].tolist() == [0] * 16
    assert last.volume[tool] == pytest.approx(np.full(16, 1 / 16))
    assert result.log.vb_x.max() > 0.45 and last.x[~tool].min() > last.x[tool].max() - 0.05


def test_its_velocity_may_be_a_formula(run_interpreted):
    text = scene().replace(
        "fix(v, initial_velocity_particles, tool, 0.5, 0, NULL)",
        "fix(v, velocity_particles, tool, 0.2*time, 0)\nset_dt(0.02)",
    )
    result = run_interpreted(text)
    last = result.dump("end.150.LAMMPS")
    tool = last.type == 1
    assert last.x[tool] - last.x0[tool] == pytest.approx(np.full(16, 0.1 * 9), rel=1e-2)


def test_gravity_does_not_move_it(run_interpreted):
    result = run_interpreted(scene() + "fix(g, body_force, all, 1, 0)\nrun(5)\n")
    assert result.log.va_x[-1] == 0.5


def test_it_has_no_state_and_no_limit_of_the_step(tmp_path, capsys):
    """A step of h over the speed; no number in the state."""
    path = tmp_path / "in.check"
    text = scene().replace("solid(b, region, right, 1, soft, 0.25)\n", "")
    text = re.sub(r"(group\(block|compute\(vb).*\n", "", text).replace(", vb_x", "")
    path.write_text(text)
    assert main(["check", str(path)]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^  state +0 +0$", out, re.M)
    assert "stable limit 0.5)" in out
    path.write_text(re.sub(r"fix\(v.*\n", "", text).replace("run_time(3)", "run(5)"))
    assert main(["check", str(path)]) == 1
    assert "nothing limits the time step" in capsys.readouterr().err


@pytest.mark.parametrize("method", ["ulcpdi, FLIP, linear, 1, Q4", "ulmpm, FLIP, cpgimp, 1, det"])
def test_domains_that_deform_are_refused(run_interpreted, method):
    text = scene().replace("method(METHOD, FLIP, linear, 1)", "")
    text = re.sub(r"method\(.*\)", f"method({method})", text)
    assert "is rigid, and the domains" in run_interpreted(text, status=1).err


def test_mistakes(run_interpreted):
    assert "'rho' must be a number above 0" in run_interpreted(scene(rho=0), status=1).err
