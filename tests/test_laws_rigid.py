"""Rigid bodies: they keep the velocity they are given, and push what they meet."""

import re

import numpy as np
import pytest
from selection import few

from karamelo_py.app.cli import main

pytestmark = pytest.mark.xdist_group("rigid")
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
log_modify(custom, step, time, va_x, vb_x, ContactForce_a_x, ContactTorque_a_z)
run_time(3)
"""


def scene(method="ulmpm", rho=1000):
    return SCENE.replace("METHOD", method).replace("RHO", str(rho))


@pytest.mark.parametrize("method", few(("ulmpm", "ulmpm/contacts"), "ulmpm/contacts"))
def test_a_tool_pushes_a_block(run_script, method):
    """The tool keeps its velocity to the last bit; the block goes with it, or bounces off."""
    result = run_script(scene(method).replace("run_time(3)", "run_time(2.5)"))
    last = result.dump(sorted(p.name for p in result.folder.glob("end.*"))[-1])
    tool = last.type == 1
    assert last.vx[tool].tolist() == [0.5] * 16 and last.vy[tool].tolist() == [0] * 16
    assert last.x[tool] == pytest.approx(last.x0[tool] + 1.25, rel=1e-8)
    assert last.s11[tool].tolist() == [0] * 16 and last.ienergy[tool].tolist() == [0] * 16
    assert last.volume[tool] == pytest.approx(np.full(16, 1 / 16))
    # The force acts at half of the height, and pushes the tool back.
    force, torque = result.log.ContactForce_a_x, result.log.ContactTorque_a_z
    assert force.min() < -0.1 and torque == pytest.approx(-force / 2, abs=1e-9)
    assert result.log.vb_x.max() > 0.45 and last.x[~tool].min() > last.x[tool].max() - 0.05


def test_its_velocity_may_be_a_formula(run_script):
    text = scene().replace(
        "fix(v, initial_velocity_particles, tool, 0.5, 0, NULL)",
        "fix(v, velocity_particles, tool, 0.2*time, 0)\nset_dt(0.02)",
    )
    result = run_script(text)
    last = result.dump("end.150.LAMMPS")
    tool = last.type == 1
    assert last.x[tool] - last.x0[tool] == pytest.approx(np.full(16, 0.1 * 9), rel=1e-2)


def test_gravity_does_not_move_it(run_script):
    text = scene().replace("run_time(3)", "run_time(1)")
    result = run_script(text + "fix(g, body_force, all, 1, 0)\nrun(5)\n")
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
    assert "cannot choose a time step" in capsys.readouterr().err


@pytest.mark.parametrize("method", ["ulcpdi, FLIP, linear, 1, Q4", "ulmpm, FLIP, cpgimp, 1, det"])
def test_domains_that_deform_are_refused(run_interpreted, method):
    text = scene().replace("method(METHOD, FLIP, linear, 1)", "")
    text = re.sub(r"method\(.*\)", f"method({method})", text)
    assert "is rigid, and the domains" in run_interpreted(text, status=1).err


def test_mistakes(run_interpreted):
    assert "'rho' must be a number above 0" in run_interpreted(scene(rho=0), status=1).err


PLATES = """
method(ulmpm, FLIP, linear, 0.9)
scheme(SCHEME)
dimension(2, -1, 3, 0, 0.5, 0.5)
region(left, block, -0.5, 0, 0, 0.5)
region(right, block, 2, 2.5, 0, 0.5)
region(middle, block, 0, 2, 0, 0.5)
material(tool, rigid, RHO)
material(soft, linear, 1000, 1e6, 0)
solid(a, region, left, 1, tool, 0.5)
solid(b, region, right, 1, tool, 0.5)
solid(c, region, middle, 2, soft, 0.5)
group(a, particles, region, left, solid, a)
group(b, particles, region, right, solid, b)
fix(va, velocity_particles, a, 0.01*min(time/0.1, 1), 0)
fix(vb, velocity_particles, b, -0.01*min(time/0.1, 1), 0)
fix(flat, velocity_nodes, all, NULL, 0)
compute(Es, strain_energy, all)
set_output(10)
log_modify(custom, step, time, Es, ContactForce_a_x, ContactForce_b_x, ContactTorque_a_z)
dt_factor(0.25)
run_time(0.3)
"""


@pytest.mark.parametrize("scheme", few(("musl", "usf"), "musl"))
def test_a_block_between_plates(run_script, scheme):
    """Uniaxial strain without Poisson's ratio: energy and force of a bar, whatever the density.

    When nodes had the mean velocity by mass, half of the energy was missing at equal densities.
    """
    text = PLATES.replace("SCHEME", scheme)
    result = run_script(text.replace("RHO", "1"), folder="light")
    (share,) = re.findall(r"  energy +(\S+) % of the largest", result.out)
    assert -3 < float(share) < 1  # FLIP 0.9 takes some of what vibrates
    light = result.log
    heavy = run_script(text.replace("RHO", "1024"), folder="heavy").log
    assert light.Es.tolist() == heavy.Es.tolist()
    strain = 0.005 / 2  # each plate has come 0.01 (0.05 + 0.2) nearer
    assert light.Es[-1] == pytest.approx(1e6 * strain**2 / 2, rel=0.05)
    assert light.ContactForce_a_x[-1] == pytest.approx(-5e5 * strain, rel=0.05)
    # Both plates feel the same force, at half of its height.
    assert light.ContactForce_b_x == pytest.approx(-light.ContactForce_a_x, rel=1e-6, abs=1e-6)
    assert light.ContactTorque_a_z == pytest.approx(-light.ContactForce_a_x / 4, rel=1e-6, abs=1e-6)
