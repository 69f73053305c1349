"""Rigid solids and contact in implicit steps."""

from pathlib import Path

import numpy as np
import pytest

from comparisons import hertz
from tests.test_implicit import HELD, patch

pytestmark = pytest.mark.xdist_group("implicit tools")
PRESS = """
    basis = "linear"
    method(ulmpm, FLIP, basis, 1)
    scheme({scheme})
    dimension(2, 0, 1.5, 0, 2, 0.5)
    region(box, block, 0, 1, 0, 1)
    region(tool, block, 0, 1.5, 1, 1.5)
    material(m, linear, 1, 1000, 0.25)
    material(steel, rigid, 1)
    solid(s, region, box, 2, m, 0.5, 0)
    region(floor, block, -INF, INF, -INF, 1e-6)
    region(top, block, -INF, INF, 1-1e-6, INF)
    group(floor, nodes, region, floor, all)
    group(top, nodes, region, top, all)
    fix(hold, velocity_nodes, floor, 0, 0)
    {lines}
    set_dt(0.5)
    set_output(1)
    compute(Es, strain_energy, all)
    log_modify(custom, step, time, iterations, Es, hold_x, hold_y{columns})
    run(4)
"""
LED = """solid(t, region, tool, 2, steel, 0.5, 0)
    group(t, particles, region, tool, solid, t)
    fix(press, {kind}, t, 1e-3, {value})"""


@pytest.mark.parametrize(
    ("scheme", "kind"),
    [("quasi-static", "velocity_particles"), ("newmark", "initial_velocity_particles")],
)
def test_a_rigid_solid_leads_its_nodes(run_interpreted, scheme, kind):
    """The same as nodes that are given the velocity of the end of each step, and the reaction."""
    value = "-0.01" if kind.startswith("initial") else "-0.01*time"
    lines = LED.format(kind=kind, value=value)
    columns = ", ContactForce_t_x, ContactForce_t_y"
    by_tool = run_interpreted(PRESS.format(scheme=scheme, lines=lines, columns=columns)).log
    lines = f"fix(press, velocity_nodes, top, 1e-3, {value})"
    columns = ", press_x, press_y"
    by_nodes = run_interpreted(
        PRESS.format(scheme=scheme, lines=lines, columns=columns), folder="nodes"
    ).log
    for axis in "xy":
        force = by_tool[f"ContactForce_t_{axis}"]
        assert np.allclose(force[1:], -by_nodes[f"press_{axis}"][1:], rtol=1e-9)
        assert np.allclose(by_tool[f"hold_{axis}"], by_nodes[f"hold_{axis}"], rtol=1e-9)
    assert abs(by_tool["hold_y"][-1]) > 1 and np.allclose(by_tool["Es"], by_nodes["Es"], rtol=1e-9)


def test_velocities_of_soft_points_are_refused(run_script):
    lines = LED.format(kind="velocity_particles", value="0")
    lines = lines.replace("tool, solid, t)", "tool, all)")
    lines = lines.replace("region, tool", "region, box")
    result = run_script(PRESS.format(scheme="quasi-static", lines=lines, columns=""), status=1)
    assert "velocity_particles" in result.err and "for rigid solids" in result.err


INPUTS = Path(__file__).parent.parent / "inputs"


def test_a_block_sticks_and_slides(run_script):
    """Coulomb: mu times the pressing force, exactly; before, what the way of the top strains."""
    result = run_script(INPUTS / "in.static_block", "-var", "mu", "0.3")
    log_of = result.log
    # A spring of 1000 times the modulus lies in between: 1/1000 of a cell, of 8.
    assert log_of["pressing"][1] == pytest.approx(1000 * 1e-3, rel=1e-3)
    assert np.allclose(log_of["ratio"][9:], 0.3, rtol=1e-9)
    assert 0.05 < log_of["ratio"][5] < 0.1 and np.all(np.diff(log_of["ratio"][4:9]) > 0)
    assert max(log_of["iterations"]) <= 8 and max(log_of["parts"]) == 1


def test_contact_goes_on_from_a_file(run_script):
    """The same bytes: what touched and stuck is in the file."""
    text = (
        (INPUTS / "in.static_block").read_text().replace("run(14)", "restart(7, r.*.h5)\nrun(14)")
    )
    whole = run_script(text)
    rest = run_script(text, "-restart", str(whole.folder / "r.7.h5"), folder="again")
    for name in ("pressing", "shear", "residual"):
        assert whole.log[name][-1] == rest.log[name][-1]


def test_bodies_part_freely(run_script):
    """Pulled up again, the block leaves the plane: no force is left."""
    text = (INPUTS / "in.static_block").read_text()
    text = text.replace("if(time > 4.5, 0, -way)", "if(time > 4.5, 2*way, -way)")
    log_of = run_script(text, "-var", "mu", "0").log
    assert log_of["pressing"][4] > 3.9 and abs(log_of["pressing"][-1]) < 1e-12


LYING = """
    method(ulmpm/contacts, FLIP, linear, 1)
    scheme(quasi-static)
    dimension(2, 0, 2, 0, 2, 0.25)
    region(block, block, 0.5, 1.5, 0.5, 1.5)
    region(ground, block, 0, 2, 0, 0.5)
    material(rubber, neo-hookean, 1, 1000, 0.25)
    material(rock, rigid, 1)
    solid(block, region, block, 2, rubber, 0.25, 0)
    solid(ground, region, ground, 2, rock, 0.25, 0)
    {lines}
    fix(weight, body_force, all, 0, -1)
    set_output(1)
    log_modify(custom, step, iterations, ContactForce_block_y, ContactForce_ground_y)
    run(2)
"""


def test_a_block_lies_on_a_plane(run_script):
    """Nothing else holds it: the plane bears its weight, and friction keeps it in its place."""
    log_of = run_script(LYING.format(lines="fix(rub, contact/friction, block, ground, 0.3)")).log
    assert np.allclose(log_of["ContactForce_block_y"][1:], 1, rtol=1e-9)
    assert np.allclose(log_of["ContactForce_ground_y"][1:], -1, rtol=1e-9)
    result = run_script(LYING.format(lines=""), status=1, folder="smooth")
    assert "not held along x" in result.err


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("fix(wall, contact/minimize_penetration/plane, block, 0, 0.6, 0, 0, 1, 0, 0)",
         "contact/minimize_penetration/plane"),
        ("fix(h, contact/hertz, block, ground)", "contact/hertz"),
    ],
)  # fmt: skip
def test_forces_that_follow_points_are_refused(run_script, line, name):
    text = LYING.format(lines=line).replace("rock, rigid, 1", "rock, linear, 1, 1, 0")
    result = run_script(text, status=1)
    assert f"fix {name}" in result.err and "ulmpm/contacts" in result.err


def test_a_wall_presses_as_far_as_its_force_is_borne(run_script):
    """Springs in a row: K G of the wall, and M over 0.95625 of the bar between points and base.

    The outermost points share their force out to two nodes, 3/4 of it to the one at the end.
    """
    wall = "fix(pull, impenetrablesurface, all, 10, 0.975 - 1e-5*time, 0, 0, -1, 0, 0)"
    lines = HELD.replace("fix(pull, velocity_nodes, right, 1e-4, NULL)", wall)
    log_of = run_script(patch(lines, ", hold_x")).log
    G, M = 400, 1200
    force = 10 * G * 1e-5 * np.arange(5) / (1 + 0.95625 * 10 * G / M)
    assert np.allclose(log_of["pull_x"], -force, rtol=2e-4)
    assert np.allclose(log_of["hold_x"], force, rtol=2e-4)
    assert max(log_of["iterations"]) <= 4 and max(log_of["parts"]) == 1


@pytest.mark.parametrize("scheme", ["quasi-static", "newmark"])
def test_a_ball_is_pressed_in(run_script, scheme):
    """Newton's method squares errors with a force that turns as points move, too."""
    ball = "fix(pull, indent, all, sphere, 1e5, 0.4, 1.3 - 0.02*time, 0.5, 0)"
    lines = "fix(hold, velocity_nodes, left, 0, 0)\n    " + ball + "\n    set_dt(1)"
    log_of = run_script(patch(lines, ", hold_x, pull_s").replace("quasi-static", scheme)).log
    assert log_of["pull_x"][-1] < -0.1 and max(log_of["iterations"]) <= 6
    if scheme == "quasi-static":
        assert np.allclose(log_of["hold_x"], -log_of["pull_x"], rtol=1e-8)
        assert [*log_of["pull_s"]] == [0, 16, 18, 24, 28]  # points in the ball after each step


@pytest.mark.full
def test_a_pressed_disk(run_script):
    """Force and stress below the contact after Hertz (Johnson 1985); errors fall with the cells."""
    # Friction that is none: compiled with that of test_splines_rub.
    text = (
        (INPUTS / "in.static_hertz")
        .read_text()
        .replace("fix(top,", "fix(rub, contact/friction, disk, ground, 0)\nfix(top,")
    )
    forces, errors = [], []
    for refine in (0.5, 1):
        result = run_script(text, "-var", "refine", str(refine), folder=f"run{refine}")
        forces.append(result.log["force"][-1] / hertz.LOAD - 1)
        errors.append(hertz.error(result.snapshots("static_hertz")[-1], 0.7))
        assert max(result.log["iterations"]) <= 8 and max(result.log["parts"]) == 1
    # With 64 cells -1.4 % and 0.007. The formula itself leaves out (half width / R)^2, 1.3 %.
    assert abs(forces[1]) < 0.04 and np.log2(forces[0] / forces[1]) > 1
    assert errors[1] < 0.028 and np.log2(errors[0] / errors[1]) > 1.5


@pytest.mark.full
def test_a_rough_footing(run_script):
    """(2 + pi) c, for a rough base as for a smooth one (Chen 1975)."""
    log_of = run_script(INPUTS / "in.static_rough_footing", "-var", "steps", "12").log
    assert max(log_of["load"]) == pytest.approx(2 + np.pi, rel=0.03)
    assert max(log_of["iterations"]) <= 8


# Means of the load in kN over 1.2 % of the height, of the explicit steps of in.billet_axisymmetric.
EXPLICIT = {0.05: 239.4, 0.1: 260.1, 0.15: 284.9, 0.2: 307.7}


@pytest.mark.full
def test_a_billet_is_pressed(run_script):
    """The load of explicit steps, within 2 %; test_paper_scenes.py has those."""
    log_of = run_script(
        INPUTS / "in.static_billet", "-var", "squeeze", "0.21", "-var", "steps", "42"
    ).log
    for press, load in EXPLICIT.items():
        near = abs(log_of["press"] - press) < 0.006
        assert log_of["load"][near].mean() == pytest.approx(load, rel=0.02)


def test_a_disk_slides_down(run_script):
    """g (sin(angle) - mu cos(angle)), in steps of eight times what a wave needs for a cell."""
    text = (INPUTS / "in.incline").read_text().replace("dt_factor(CFL)", "set_dt(0.01)")
    text = text.replace("dimension(2, 0, 7", "scheme(newmark)\ndimension(2, 0, 7")
    lines = [one for one in text.splitlines() if not one.startswith(("dump", "plot", "save_plot"))]
    text = "\n".join(lines).replace("run_time(1)", "run_time(0.5)")
    log_of = run_script(text, "-var", "mu", "0.1").log
    exact = 10 * (np.sin(np.pi / 6) - 0.1 * np.cos(np.pi / 6)) * 0.5
    assert log_of["v_x"][-1] == pytest.approx(exact, rel=0.01)


def test_sliding_warms(run_interpreted):
    """What the top is pulled with, less what the block stores, is heat of friction."""
    text = (INPUTS / "in.static_block").read_text()
    text = text.replace(
        "rubber, neo-hookean, 1000, E, 0)", "rubber, neo-hookean, 1000, E, 0, 10, 0)"
    )
    text = text.replace("x, y, s11, s22, s12)", "x, y, T, mass)")
    text = text.replace("set_output(1)", "compute(Es, strain_energy, all)\nset_output(1)")
    result = run_interpreted(text.replace("shear, ratio", "shear, Es"), "-var", "n", "2")
    last = result.snapshots("static_block")[-1]
    shear, stored = result.log["shear"], result.log["Es"]
    work = 1e-3 * np.sum((shear[5:] + shear[4:-1]) / 2) - (stored[-1] - stored[4])
    heat = 10 * np.sum(last.mass * last.T)
    # Loads of a step are those of its end: half a step of the ten is not known better.
    assert heat == pytest.approx(work, rel=0.05) and heat > 5e-3


SQUEEZED = """
    basis = "quadratic-spline"
    method(ulmpm/contacts, FLIP, basis, 1)
    scheme(quasi-static)
    dimension(2, -1, 2, 0, 2, 0.25)
    region(body, block, 0, 1, 0, 1)
    region(lid, block, -0.5, 1.5, 1, 1.5)
    material(soft, neo-hookean, 1000, 1e6, 0.3)
    material(steel, rigid, 7800)
    solid(body, region, body, 2, soft, 0.25, 0)
    solid(lid, region, lid, 2, steel, 0.25, 0)
    fix(rub, contact/friction, body, lid, 0.2)
    region(base, block, INF, INF, INF, 0)
    group(base, nodes, region, base, solid, body)
    fix(base, velocity_nodes, base, 0, 0)
    group(lid, particles, region, lid, solid, lid)
    fix(press, velocity_particles, lid, 0, -0.01)
    set_output(1)
    log_modify(custom, step, iterations, parts, base_y, ContactForce_lid_y)
    run(4)
"""


@pytest.mark.full
@pytest.mark.parametrize("basis", ["quadratic-spline", "cubic-spline"])
def test_splines_rub(run_script, basis):
    """Nodes beside the body, which bear next to nothing, slide: Newton's method ends."""
    log_of = run_script(SQUEEZED, "-var", "basis", basis).log
    assert max(log_of["iterations"]) <= 8 and max(log_of["parts"]) == 1
    assert np.allclose(log_of["base_y"], log_of["ContactForce_lid_y"], rtol=1e-8)
    assert log_of["base_y"][-1] > 4e4 * 0.8  # E strain, less what the first contact takes


RELEASED = """
    method(tlmpm, FLIP, linear, 0.99)
    scheme({scheme})
    dimension(2, 0, 1, 0, 1, 0.1)
    region(b, block, 0.3, 0.7, 0.2, 0.3)
    material(soft, linear, 1000, 1e5, 0.3)
    solid(b, region, b, 2, soft, 0.1)
    region(low, block, -INF, INF, -INF, 0.2)
    group(low, nodes, region, low, all)
    fix(hold, velocity_nodes, low, 0, 0)
    fix(weight, body_force, all, 0, -10*min({load}, 1))
    compute(c, center_of_mass, all)
    log_modify(custom, step, time, c_y)
    set_dt({dt})
    run(2)
    delete_fix(hold)
    scheme(musl)
    {contact}
    set_dt(0.002)
    set_output(5)
    run(20)
"""
ON_SURFACE = "region(q, block, 0.2, 0.8, 0.1, 0.2)\n    fix(w, contact/surface, all, q)"


@pytest.mark.parametrize("scheme", ["quasi-static", "newmark"])
def test_contact_bears_a_body_after_long_load_steps(run_interpreted, scheme):
    """The body comes to the same place as after short load steps to the same load.

    Under its weight the body sinks by at most twice its static sag, rho g H^2 / (2 E) = 0.0005 at
    the top, and by the same at its rough foot.
    """
    logs = []
    for dt in (0.5, 0.002):
        load = f"time/{2 * dt}" if scheme == "quasi-static" else "1"
        of = {"scheme": scheme, "load": load, "dt": dt, "contact": ON_SURFACE}
        logs.append(run_interpreted(RELEASED.format(**of), folder=str(dt)).log)
        sunk = logs[-1].c_y[logs[-1].Step > 2]
        assert len(sunk) > 3 and sunk.min() > 0.25 - 4 * 0.0005
    if scheme == "quasi-static":  # with inertia the state depends on the time
        long, short = logs
        assert long.c_y[-1] == pytest.approx(short.c_y[-1], rel=1e-9)


FREE = """
    method(ulmpm/contacts, FLIP, linear, 1)
    scheme(quasi-static, limit=stop)
    dimension(2, 0, 2, 0, 2, 0.25)
    region(ground, block, {ends}, 0, 1)
    region(box, block, 0.5, 1.5, 1, 1.5)
    material(rubber, linear, 1, 1e5, 0)
    material(steel, rigid, 8)
    solid(ground, region, ground, 2, rubber, 0.25, 0)
    solid(box, region, box, 2, steel, 0.25, 0)
    region(low, block, INF, INF, INF, 0)
    group(low, nodes, region, low, all)
    fix(low, velocity_nodes, low, 0, 0)
    fix(b, rigid_body, box, {loads})
    fix(rub, contact/friction, ground, box, 0.3)
    set_dt({dt})
    set_output(1)
    log_modify(custom, step, time, b_x, b_y, b_rz, b_vy, b_fx, b_fy, low_x, low_y)
    run_time(1)
"""


def test_a_free_body_rests_in_load_steps(run_script):
    """A box of 4 kg on a column of its width: sigma H / E, and its weight."""
    text = FREE.format(ends="0.5, 1.5", loads="gravity=(0, -0.1*time)", dt=0.5)
    log = run_script(text).log
    assert log.b_fy == pytest.approx([0, 0.2, 0.4], rel=1e-5)
    assert log.low_y == pytest.approx(log.b_fy, rel=1e-5) and not log.b_vy.any()
    assert 1.25 - log.b_y == pytest.approx([0, 2e-6, 4e-6], rel=2e-3, abs=1e-12)
    assert np.abs(log.b_rz).max() < 1e-12


def test_a_free_body_slides_beyond_the_limit_of_friction(run_script):
    """Pushed by 40 N t, with mu N = 12 N: no equilibrium beyond t = 0.3."""
    text = FREE.format(ends="0, 2", loads="gravity=(0, -10), force=(40*time, 0)", dt=0.25)
    result = run_script(text)
    assert result.log.Time[-1] == pytest.approx(0.3, rel=2e-3)
    assert result.log.b_fx[1:] == pytest.approx(-40 * result.log.Time[1:], rel=1e-8)
    assert "limit load: no equilibrium beyond" in result.out + result.err
    loose = run_script(text.replace("1, 1.5)", "1.5, 2)"), status=1, folder="loose").err
    assert "solid 'box' is not held along" in loose and "fixed=(" in loose


def test_free_bodies_that_touch_are_refused_in_load_steps(run_script):
    top = "region(top, block, 0.5, 1.5, 1.5, 2)\nsolid(top, region, top, 2, steel, 0.25, 0)"
    text = FREE.format(ends="0, 2", loads="gravity=(0, -1)", dt=0.5)
    text = text.replace("0, 2, 0.25)", "0, 3, 0.25)")
    text = text.replace("fix(b", f"{top}\nfix(t, rigid_body, top, gravity=(0, -1))\nfix(b")
    assert "rigid solids touch (top, box)" in run_script(text, status=1).err
