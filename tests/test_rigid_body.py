"""Fix rigid_body: rigid bodies that move by the forces on them, and fix contact/rigid_body."""

import re
from math import cos, pi, radians, sin
from types import SimpleNamespace
from typing import NamedTuple

import meshio
import numpy as np
import pytest
from conftest import INPUTS
from going_on import goes_on, same_files, with_files
from meshed import cube_surface, write

from karamelo_py.compiler import kernel
from karamelo_py.kernels import rigid_motion as motion

pytestmark = pytest.mark.xdist_group("rigid body")
ALONE = """
method(ulmpm, FLIP, linear, 1)
dimension({d}, {box}, 1)
{line}
region(body, block, {body})
material(steel, rigid, 6)
solid(body, region, body, {ppc}, steel, 1)
scheme(musl, start=half)
fix(b, rigid_body, body, {given})
set_dt(0.1)
set_output(1)
log_modify(custom, step, time, {names})
dump(end, all, particle, 10, end.*.LAMMPS, x, y, z, x0, y0, z0)
run(10)
"""
BODIES = {1: "2, 4", 2: "2, 4, 3, 4", 3: "2, 4, 3, 4, 1, 2"}


def alone(given, names, d=2, ppc=1, line=""):
    box = ", ".join(["0, 9"] * d)
    return ALONE.format(d=d, box=box, body=BODIES[d], ppc=ppc, given=given, names=names, line=line)


def test_a_throw_is_exact(run_interpreted):
    """A parabola that rotates; the points stay where a rigid body has them."""
    given = "velocity=(1, 2), spin=PI/2, gravity=(0, -3), force=(12, 0), torque=5*time"
    result = run_interpreted(alone(given, "b_x, b_y, b_vx, b_rz, b_wz", ppc=2))
    log, t = result.log, result.log.Time
    # 12 kg; a box of 2 by 1 of points that are squares has exactly m (a^2 + b^2)/12 = 5.
    assert log.b_x == pytest.approx(3 + t + t**2 / 2)
    assert log.b_y == pytest.approx(3.5 + 2 * t - 1.5 * t**2)
    assert log.b_wz[1:] == pytest.approx(pi / 2 + 0.5 * (t[1:] - 0.1) * t[1:], rel=1e-8)
    end = result.dump("end.10.LAMMPS")
    a, c, x0, y0 = log.b_rz[-1], (log.b_x[-1], log.b_y[-1]), end.x0 - 3, end.y0 - 3.5
    assert end.x == pytest.approx(c[0] + np.cos(a) * x0 - np.sin(a) * y0)
    assert end.y == pytest.approx(c[1] + np.sin(a) * x0 + np.cos(a) * y0)


def test_check_takes_a_rigid_body(run_interpreted):
    """Its fix has arrays, among which check looks for materials."""
    result = run_interpreted(alone("velocity=(1, 0)", "b_x"), command="check")
    assert "no solid uses" not in result.out + result.err


def turned(r):
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = np.linalg.norm(r)
    k = np.cross(np.eye(3), r) / (angle or 1)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def test_a_free_top_conserves_energy_and_angular_momentum(run_interpreted):
    """About its middle axis, where it tumbles: 30 steps of 0.3 rad."""
    names = "b_rx, b_ry, b_rz, b_wx, b_wy, b_wz"
    given = "spin=(1, 3, 0.5), inertia=(3, 4, 5)"
    log = run_interpreted(alone(given, names, d=3).replace("run(10)", "run(30)")).log
    energy, momentum, moments = [], [], np.array([3.0, 4.0, 5.0])
    spins = np.c_[log.b_wx, log.b_wy, log.b_wz]
    for r, w in zip(np.c_[log.b_rx, log.b_ry, log.b_rz], spins, strict=True):
        own = turned(r).T @ w
        energy.append(moments @ own**2 / 2)
        momentum.append(turned(r) @ (moments * own))
    assert np.ptp(log.b_wx) > 0.5
    assert np.array(momentum) == pytest.approx(np.tile(momentum[0], (31, 1)), abs=1e-6)
    assert np.ptp(energy) < 5e-3 * energy[0]


class Top(NamedTuple):
    constants: np.recarray
    state: np.recarray
    solution: motion.Solution


@kernel
def turn(top, dt, count, middles):
    """Rotate freely; store the middle of least and largest energy in each `count` steps."""
    state = top.state[0]
    for k in range(middles.size):
        least, most = np.inf, 0.0
        for _ in range(count):
            motion.move(top, dt, 3, False)
            energy = 0.0
            for c in range(3):
                energy += 0.5 * state.spin[c] * state.momentum[c]
            least, most = min(least, energy), max(most, energy)
        middles[k] = 0.5 * (least + most)


def test_a_top_conserves_energy_over_1e5_revolutions():
    """Energy of Euler's equations, sum L_i^2 / 2 I_i, about the middle axis; no drift."""
    moments, spin = np.array([3.0, 4.0, 5.0]), np.array([1, 3, 0.5])
    exact, errors = moments @ spin**2 / 2, []
    for steps, revolutions in ((12, 10_000), (24, 500)):
        top = Top(
            motion.records(motion.CONSTANTS), motion.records(motion.STATE), motion.new_solution()
        )
        top.constants.inertia, top.constants.axes = moments, np.eye(3)
        top.state.momentum, top.state.q = moments * spin, (1, 0, 0, 0)
        motion.set_matrix(top.state[0])
        middles = np.zeros(10)
        turn(top, 2 * pi / (steps * np.linalg.norm(spin)), steps * revolutions, middles)
        errors.append(np.abs(middles / exact - 1).max())
        assert np.ptp(middles) < 1e-6 * exact
    assert errors[0] < 5e-3 and errors[1] < errors[0] / 3


@pytest.mark.parametrize("d", [1, 2, 3])
def test_prescribed_and_fixed_directions(run_interpreted, d):
    """The centre is led along the last axis, and held along the first."""
    led = {
        1: "motion=2*time",
        2: "motion=(NULL, 2*time), turning=1, fixed=(x)",
        3: "motion=(NULL, NULL, 2*time), turning=(0, NULL, 0), spin=(0, 1, 0), fixed=(x)",
    }[d]
    last, fall = "xyz"[d - 1], {1: "3", 2: "(3, 3)", 3: "(3, 3, 3)"}[d]
    names = f"b_x, b_{last}" + (", b_rz" if d == 2 else ", b_y, b_ry" if d == 3 else "")
    log = run_interpreted(alone(f"{led}, gravity={fall}", names, d=d)).log
    t, moved = log.Time, log[f"b_{last}"] - log[f"b_{last}"][0]
    assert moved == pytest.approx(t * (t - 0.1))  # the rule of rectangles
    if d > 1:
        assert np.ptp(log.b_x) == 0
        assert log["b_rz" if d == 2 else "b_ry"] == pytest.approx(t)
    if d == 3:
        assert log.b_y - log.b_y[0] == pytest.approx(1.5 * t**2)


def test_a_body_of_revolution_moves_along_its_axis(run_interpreted):
    """Its mass per radian is rho r dr dz: 6 times 2^2 / 2 times 1."""
    text = alone("velocity=(0, 1), force=(0, 12)", "b_x, b_y", line="axisymmetric(true)")
    log = run_interpreted(text.replace("block, 2, 4,", "block, 0, 2,")).log
    assert log.b_y - log.b_y[0] == pytest.approx(log.Time + log.Time**2 / 2)
    assert not log.b_x.any()


@pytest.mark.parametrize("word", ["velocity", "force", "gravity", "motion"])
def test_motion_off_the_axis_is_refused(run_interpreted, word):
    text = alone(f"{word}=(1, 0.5)", "step", line="axisymmetric(true)")
    result = run_interpreted(text.replace("block, 2, 4,", "block, 0, 2,"), status=1)
    assert "moves along the axis only, not along x" in result.err and "expected: 0" in result.err


MORE = {
    "moved": ("run(10)", "translate_particles(body, region, body, 2, 0)\nrun(10)", "after its"),
    "fewer": ("run(10)", "delete_particles(body, region, half)\nrun(10)", "after its"),
    "later": ("run(10)", "run(1)\ndelete_particles(body, where, x > 3)\nrun(1)", "cannot be del"),
    "eroded": ("run(10)", "fix(e, erosion, all, x > 3, every=1)\nrun(10)", "cannot be deleted"),
    "reflect": ("set_dt", "boundary(reflect)\nset_dt", "boundary(error)"),
    "leaves": ("velocity=(1, 0)", "velocity=(9, 0)", "the rigid body 'body' leaves the domain at"),
    "delete": ("set_dt", "boundary(delete)\nset_dt", "boundary(error)"),
}


@pytest.mark.parametrize("case", MORE)
def test_points_and_body_stay_together(run_interpreted, case):
    old, new, message = MORE[case]
    text = alone("velocity=(1, 0), spin=0.1", "step", line="region(half, block, 3, 9, 0, 9)")
    result = run_interpreted(text.replace(old, new), status=1)
    assert message in result.err and result.err.count("error:") == 1, result.err


def test_points_may_be_moved_before_the_fix(run_interpreted):
    text = alone("velocity=(1, 0)", "b_x")
    moved = "translate_particles(body, region, body, 2, 0)\nfix(b,"
    assert run_interpreted(text.replace("fix(b,", moved)).log.b_x[-1] == pytest.approx(6)


def test_a_body_under_another_id_is_refused_in_a_restart(run_interpreted):
    text = alone("velocity=(1, 0)", "step")
    run_interpreted(text.replace("run(10)", "restart(5, r.*.h5)\nrun(5)"), folder="a")
    again = text.replace("fix(b,", "fix(other,").replace("run(10)", "read_restart(r.5.h5)\nrun(5)")
    result = run_interpreted(again, folder="a", status=1)
    assert "are not at the position stored by its fix" in result.err, result.err


def test_a_spinning_body_without_its_fix_is_reported(run_interpreted):
    text = alone("spin=1", "step").replace("run(10)", "run(1)\ndelete_fix(b)\nrun(1)")
    result = run_interpreted(text.replace("log_modify(custom, step, time, step)", ""))
    assert "its points move along straight lines" in " ".join(result.err.split())


def test_a_body_is_released(run_interpreted):
    """A fix with the same ID replaces it: the body continues from where it was led to."""
    more = "fix(b, rigid_body, body, gravity=(0, -2))\nrun(10)"
    text = alone("motion=(2, 0), turning=1", "b_x, b_y, b_rz") + more
    log = run_interpreted(text).log
    end = slice(11, None)
    t = log.Time[end] - 1
    assert log.b_x[end] == pytest.approx(5 + 2 * t) and log.b_rz[end] == pytest.approx(1 + t)
    assert log.b_y[end] == pytest.approx(3.5 - t * (t + 0.1))


MISTAKES = {
    "material(steel, rigid, 6)": ("material(steel, linear, 6, 9, 0)", "deforms", "rigid"),
    "velocity=(1, 0)": ("mass=0", "0", "above 0"),
    "spin=1": ("inertia=-1", "no body has", "above 0"),
    "fixed=(x)": ("fixed=(z)", "no direction 'z'", "some of x, y, rz"),
    "gravity=(0, -1)": ("gravity=(0, 0, -1)", "3 components", "2 formulas"),
    "gravity=(0, -9.81)": ("gravity=(0, -9,81)", "3 components", "with a decimal point: -9.81"),
    "gravity=(0, -3)": ("gravity=-3", "1 component", "2 formulas\nhint: such as (0, -3)"),
    "gravity=(0, 1)": ("pivot=(2, 3), velocity=(1, 0)", "pivot already holds the body", "spin=..."),
    "motion=(1, 0)": ("motion=(1, 0), fixed=(x)", "motion prescribes it", "one of the two"),
    "velocity=(0, 1)": ("velocity=(0, 1), motion=(NULL, 2)", "motion sets 2", "NULL or 2 for y"),
    "spin=2": ("spin=2, fixed=(rz)", "fixed sets 0", "NULL or 0 for rz"),
    "turning=1": ("", "no load acts on the body 'body'", "gravity=(...)"),
    "scheme(musl, start=half)": (
        "scheme(newmark)", "newmark does not support fix rigid_body", "scheme(musl)"),
    "set_dt(0.1)": ("precision(single)", "not support precision(single)", "precision(double)"),
    "set_output(1)": (
        "group(g, particles, region, body, solid, body)\nfix(v, velocity_particles, g, 1, 0)",
        "also moves 'body'",
        "another group",
    ),
    "run(10)": ("fix(c, rigid_body, body, spin=1)\nrun(10)", "moves 'body' already", "replaces it"),
    "dump": (
        "fix(c, contact/rigid_body, all, body, 0.2)\ndelete_fix(b)\ndump",
        "is the contact with 'body', which this fix moves",
        "delete_fix(c) in a line before",
    ),
    "set_output": (
        "fix(c, contact/rigid_body, all, body)\nfix(d, contact/rigid_body, all, body)\nset_output",
        "is the contact of points of this group with 'body' already",
        "or one fix",
    ),
    "run": (
        "delete_fix(b)\nrun(1)\nfix(b, rigid_body, body, spin=1)\nrun",
        "earlier runs",
        "before",
    ),
}  # fmt: skip


@pytest.mark.parametrize("right", MISTAKES)
def test_mistakes_are_refused(run_interpreted, right):
    wrong, message, remedy = MISTAKES[right]
    text = alone("velocity=(1, 0)", "step")
    if "=" in right and right not in text:
        text = text.replace("velocity=(1, 0)", right)
    if not wrong:
        text = text.replace(", " + right, "")
    result = run_interpreted(text.replace(right, wrong), status=1)
    assert result.err.count("error:") == 1, result.err
    assert message in result.err and remedy in result.err, result.err


def test_inertia_of_no_body_is_refused(run_interpreted):
    result = run_interpreted(alone("inertia=(1, 1, 3)", "step", d=3), status=1)
    assert "no body has" in result.err and "sum of the other two" in result.err


def test_other_back_ends_are_refused(run_interpreted, state_interpreted):
    text = alone("spin=1", "step")
    assert "--gpu" in run_interpreted(text, "--gpu", status=1).err
    said = state_interpreted(text, ranks=2, fails=True)
    assert "fix rigid_body does not support" in said and "--ranks" in said


HIT = """
method({method}, FLIP, linear, 1)
dimension(2, 0, 10, 0, 10, 1)
region(below, block, 3, 6, 2, 4)
region(above, block, 4, 6, 4.2, 6.2)
material(steel, rigid, {ratio})
material(soft, linear, 1, 100, 0.3)
solid(a, region, below, 1, soft, 1)
solid(b, region, above, 1, steel, 1)
fix(b, rigid_body, b, velocity=(0.2, -0.9), spin=0.1)
{touch}
group(a, particles, region, below, solid, a)
compute(p, linear_momentum, a)
compute(E, kinetic_energy, a)
compute(S, strain_energy, a)
set_output(1)
log_modify(custom, step, p_x, p_y, E, S, b_vx, b_vy, b_wz, b_fy, f_y)
run(20)
"""
GRID = "fix(f, contact/friction, a, b, 0.4)"
POINTS = "fix(f, contact/rigid_body, all, b, 0.4)"


@pytest.mark.parametrize("ratio", [1000, 1, 0.001])
@pytest.mark.parametrize(("method", "touch"), [("ulmpm/contacts", GRID), ("ulmpm", POINTS)])
def test_momentum_is_conserved_and_energy_does_not_grow(run_interpreted, method, touch, ratio):
    """A free block hits a soft one obliquely, with friction, at any ratio of masses."""
    log = run_interpreted(HIT.format(method=method, touch=touch, ratio=ratio)).log
    m = 4 * ratio
    assert np.abs(log.b_fy).max() > 0 and log.b_fy == pytest.approx(-log.f_y)
    for own, other in ((log.p_x, log.b_vx), (log.p_y, log.b_vy)):
        total = own + m * other
        assert total == pytest.approx(np.full(21, total[0]), rel=1e-7, abs=1e-8 * m)
    # Two sides of two: m (4 + 4) / 12 about the centre.
    energy = m / 2 * (log.b_vx**2 + log.b_vy**2 + 2 / 3 * log.b_wz**2) + log.E + log.S
    assert energy.max() < 1.01 * energy[0]


def test_contact_force_of_a_body_is_published(run_interpreted):
    """As its own force, and its torque about the origin."""
    names = "ContactForce_b_y, ContactTorque_b_z, b_x, b_y, b_vx, b_vy, b_fx, b_fy, b_tz"
    text = HIT.format(method="ulmpm", touch=POINTS, ratio=1).replace("p_x, p_y", names)
    log = run_interpreted(text).log
    x, y = log.b_x, log.b_y
    dt = np.diff(log.b_x)[0] / log.b_vx[1]
    x, y = x[1:] - dt * log.b_vx[1:], y[1:] - dt * log.b_vy[1:]  # before each step
    about = log.b_tz[1:] + x * log.b_fy[1:] - y * log.b_fx[1:]
    assert log.ContactForce_b_y == pytest.approx(log.b_fy) and np.abs(log.b_fy).max() > 0
    assert log.ContactTorque_b_z[1:] == pytest.approx(about, rel=1e-4)


def test_the_area_of_contact(run_interpreted):
    """The foot of the block, of width 2, with at most a point more at each end; 0 when apart."""
    text = HIT.format(method="ulmpm", touch=POINTS, ratio=1).replace(", f_y)", ", f_y, f_area)")
    text = text.replace("velocity=(0.2, -0.9), spin=0.1", "velocity=(0, -0.9)").replace("4.2", "4")
    log = run_interpreted(text.replace("run(20)", "run(3)")).log
    assert log.f_y[-1] < 0 and 2 <= log.f_area[-1] <= 4
    log = run_interpreted(text.replace("-0.9", "0.9").replace("run(20)", "run(1)")).log
    assert log.f_area[-1] == log.f_y[-1] == 0


DRAGGED = """
method(ulmpm, FLIP, linear, 1)
dimension({d}, {box}, 1)
region(plate, {plate})
region(block, {block})
material(steel, rigid, 6)
material(soft, linear, 1, 100, 0.3)
solid(block, region, block, {ppc}, soft, 1)
solid(plate, region, plate, 1, steel, 1)
fix(weight, body_force, all{weight})
fix(b, rigid_body, plate, motion=({motion}), turning={turning})
fix(f, contact/rigid_body, all, plate, 10, limit=0.1)
set_dt(0.02)
set_output(3)
log_modify(custom, step, f_x, f_y, f_area)
run(9)
"""


@pytest.mark.parametrize(("d", "ppc"), [(2, 2), (3, 1)])
def test_friction_with_a_limit_acts_on_the_whole_area(run_interpreted, d, ppc):
    """The stress times the area, even where the points do not touch all the time."""
    given = {"box": ", ".join(["0, 6"] * d)}
    given["plate"] = "block, 1, 5, 1, 2" + ", 1, 5" * (d - 2)
    given["block"] = "block, 2, 4, 2, 3" + ", 2, 4" * (d - 2)
    given["motion"], given["weight"] = "0.5, 0" + ", 0" * (d - 2), ", 0, -1" + ", 0" * (d - 2)
    given["turning"] = "0" if d == 2 else "(0, 0, 0)"
    log = run_interpreted(DRAGGED.format(d=d, ppc=ppc, **given)).log
    assert log.f_x[1:] == pytest.approx(np.full(3, 0.1 * 2 ** (d - 1)), rel=0.01)  # it strains
    assert log.f_y[1:].mean() > 0.5 * 2 ** (d - 1)


@pytest.mark.parametrize("ppc", [1, 2])
def test_a_limit_of_friction_acts_on_the_surface_of_a_shaft(run_interpreted, ppc):
    """The stress times radius and length, for points half a cell or a quarter outside of them."""
    text = DRAGGED.format(
        d=2, ppc=ppc, box="0, 7, 0, 6", plate="block, 0, 3, 1, 5", block="block, 3, 5, 2, 4",
        motion="0, 0.5", turning="0", weight=", -1, 0",
    ).replace(", turning=0", "")  # fmt: skip
    text = text.replace("region(plate", "axisymmetric(true)\nregion(plate")
    log = run_interpreted(text).log
    assert log.f_y[1:] == pytest.approx(np.full(3, 0.1 * 3 * 2), rel=0.002)  # it strains


def test_a_limit_of_friction_without_friction_is_refused(run_interpreted):
    script = INSIDE_OUT + "fix(t, contact/rigid_body, all, bar, limit=1)\nrun(1)"
    assert "needs a coefficient of friction mu" in run_interpreted(script, status=1).err


INSIDE_OUT = """
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 1, 0, 1, 0.1)
    anti_volumetric_locking(true)
    region(a, block, 0.2, 0.5, 0.2, 0.5)
    region(c, block, 0.6, 0.8, 0.6, 0.8)
    material(m, neo-hookean, 1000, 1e5, 0.3)
    material(steel, rigid, 1600)
    solid(a, region, a, 2, m, 0.1)
    solid(bar, region, c, 2, steel, 0.1)
    fix(b, rigid_body, bar, motion=(0, -1), turning=0)
"""


def test_averaged_volumes_leave_rigid_bodies_alone(run_interpreted):
    """The averaged volume change of rigid points was 0, so they turned inside out."""
    run_interpreted(INSIDE_OUT + "run(3)")


def test_friction_has_its_limit_in_the_first_step_of_contact(run_interpreted):
    """Points that come to the surface within a step press before they overlap it."""
    falls = "group(g, particles, region, block, solid, block)\nset_dt(0.017)\nset_output(1)\n"
    falls += "fix(fall, initial_velocity_particles, g, 0, -5)\nlog_modify"
    text = DRAGGED.format(
        d=2, ppc=2, box="0, 6, 0, 6", plate="block, 1, 5, 1, 2", block="block, 2, 4, 3, 4",
        motion="0.5, 0", turning="0", weight=", 0, 0",
    ).replace("log_modify", falls).replace("run(9)", "run(12)")  # fmt: skip
    log = run_interpreted(text).log
    assert log.f_x[-2] == 0
    assert log.f_y[-1] > 5
    assert log.f_x[-1] == pytest.approx(0.1 * 2, rel=1e-6)


@pytest.mark.parametrize(("method", "touch"), [("ulmpm/contacts", GRID), ("tlmpm", POINTS)])
def test_a_restarted_run_has_the_same_bits(run_interpreted, method, touch):
    text = HIT.format(method=method, touch=touch, ratio=1).replace("run(20)", "run(10)")
    goes_on(run_interpreted, with_files(text))


@pytest.mark.parametrize(("mu", "far"), [(0.5, 0.05), (0.06, 0.08)], ids=["rolls", "slides"])
def test_a_wheel_on_a_slope(run_script, mu, far):
    """in.rolling: 2/3 g sin without slip; g (sin - mu cos) and the spin of friction with it."""
    text = (INPUTS / "in.rolling").read_text("utf-8").replace("mu = 0.5", f"mu = {mu}")
    log, g, a = run_script(text).log, 9.81, radians(20)
    late = log.Time > 0.5
    along, spin = (np.polyfit(log.Time[late], v[late], 1)[0] for v in (log.w_vx, -log.w_wz))
    exact = g * sin(a) * 2 / 3 if mu > 0.2 else g * (sin(a) - mu * cos(a))
    turns = exact / 0.3 if mu > 0.2 else 2 * mu * g * cos(a) / 0.3
    assert along == pytest.approx(exact, rel=far) and spin == pytest.approx(turns, rel=far)
    assert log.w_fy == pytest.approx(-log.touch_y)


def test_a_box_that_friction_holds_does_not_creep(run_script):
    """On the slope of in.rolling, tan(20 degrees) = 0.36 < 0.5; viscous friction creeps."""
    text = (INPUTS / "in.rolling").read_text("utf-8")
    text = text.replace("cylinder, 0.6, 0.3 + R, R)", "block, 0.3, 0.9, 0.3, 0.9)")
    log = run_script(text.replace("all, 0.1)", "all, 0.3)")).log
    before, after = (log.w_x[(log.Time > t) & (log.Time < t + 0.2)].mean() for t in (0.8, 1))
    assert after == pytest.approx(before, abs=0.01 * 0.1)  # of a cell


@pytest.mark.parametrize(
    ("refine", "draught", "end"), [(0.5, 0.05, 2), pytest.param(1, 0.01, 8, marks=pytest.mark.full)]
)
def test_a_box_floats(run_script, refine, draught, end):
    """in.floating: Archimedes. The level is 1.2 + (draught - 0.4) 1.2/4 with what is displaced."""
    text = (INPUTS / "in.floating").read_text("utf-8").replace("refine = 1", f"refine = {refine}")
    result = run_script(text.replace("end = 8", f"end = {end}"))
    assert abs(float(re.search(r"^ +energy +(\S+) %", result.out, re.M)[1])) < 1.5
    log = result.log
    late = log.Time > end / 2
    depth = 1.08 + 0.4 - log.b_y[late].mean()  # d - 0.3 d
    assert depth / 0.7 == pytest.approx(0.48, rel=draught)
    assert log.b_fy[late].mean() == pytest.approx(0.96 * 600 * 9.81, rel=0.03)
    assert np.abs(log.b_rz).max() < 1e-3


@pytest.mark.parametrize("block", [0, 1])
def test_scripts_of_the_page_give_no_warning(run_script, block):
    page = (INPUTS.parent / "docs" / "howto" / "free-body.md").read_text("utf-8")
    text = re.findall(r"```karamelo\n(.*?)```", page, re.DOTALL)[block]
    result = run_script(text)
    assert "warning" not in result.err + result.out


def test_rigid_bodies_that_pass_through_each_other_are_reported(run_interpreted):
    """And a spring to the ground, of the values of its own fix."""
    second = "region(two, block, 6, 8, 3, 4)\nsolid(two, region, two, 1, steel, 1)\n"
    second += "fix(c, rigid_body, two, spin=1)\n"
    text = alone("force=(-12*(b_x - 4), 0)", "b_x").replace("scheme(", second + "scheme(")
    result = run_interpreted(text)
    assert "it passes through other rigid solids: two" in result.err
    # Leapfrog of period 2 pi: 2 arcsin(dt / 2) / dt.
    rate = 2 * np.arcsin(0.05) / 0.1
    assert result.log.b_x == pytest.approx(4 - np.cos(rate * result.log.Time), rel=1e-3)


def body_among(contacts, velocity, mass, dofs):
    """What Newton's method reads of a body at the origin with some contacts."""
    solution = motion.new_solution()
    solution.momentum[:], solution.u[:] = mass * velocity, velocity
    solution.mass[:] = np.diag(mass)
    return SimpleNamespace(
        contacts=contacts, count=[len(contacts)], solution=solution,
        state=motion.records(motion.STATE), dofs=np.array(dofs),
    )  # fmt: skip


def test_impulses_are_found_for_light_bodies_with_much_friction():
    """60 random contacts: mu up to 1, a body down to 0.001 of what it touches; Coulomb's law."""
    random = np.random.default_rng(1)
    for case in range(60):
        count, d, mu = (2, 6, 20)[case % 3], 2 + case % 2, (0.3, 0.6, 1.0)[case % 3]
        c = motion.records(motion.CONTACT, count)
        normal = random.normal(size=(count, 3)) - (0, 1, 0)
        normal[:, d:] = 0
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        c.at = c.normal = normal
        c.v[:, :d] = random.normal(0, 0.3, (count, d))
        c.mass, c.mu, c.share = random.uniform(0.1, 1, count), mu, 0.1
        mass = np.repeat([2.0, 1.0], 3) * c.mass.sum() * 10.0 ** -(case % 4)
        dofs = [1] * 6 if d == 3 else [1, 1, 0, 0, 0, 1]
        start = (random.normal(size=6) - (0, 1, 0, 0, 0, 0)) * dofs
        body = body_among(c, start, mass, dofs)
        motion.solve(body, 1e-3)
        assert body.state.failed == 0
        # M (U - U*) and the impulses at the places, about the centre, add up to nothing.
        p = c.impulse
        total = np.concatenate([p.sum(axis=0), np.cross(normal, p).sum(axis=0)])
        rest = mass * (body.solution.u - start) + total
        assert rest[np.array(dofs) > 0] == pytest.approx(0, abs=1e-9 * np.abs(mass * start).max())
        push = (p * normal).sum(axis=1)
        assert (push >= 0).all()
        rub = np.linalg.norm(p - push[:, None] * normal, axis=1)
        assert (rub <= mu * push * (1 + 1e-9) + 1e-12).all()


@pytest.mark.parametrize("d", [2, 3])
def test_a_pendulum(run_interpreted, d):
    """A box of 2 by 1 on a pivot at the middle of its left edge: small oscillations.

    rate^2 = m g / I, with its centre at 1 and I = 5 + 12 about the pivot.
    """
    pivot, down = {2: "(2, 3.5)", 3: "(2, 3.5, 1.5)"}[d], {2: "(3, 0)", 3: "(3, 0, 0)"}[d]
    turns = {2: "spin=0.01", 3: "spin=(0, 0, 0.01)"}[d]
    given = f"pivot={pivot}, gravity={down}, {turns}"
    log = run_interpreted(alone(given, "b_x, b_y, b_rz", d=d).replace("run(10)", "run(40)")).log
    rate, dt = np.sqrt(12 * 3 / (5 + 12)), 0.1
    leapfrog = 2 * np.arcsin(rate * dt / 2) / dt
    swing = 0.01 * dt / np.sin(leapfrog * dt) * np.sin(leapfrog * log.Time)
    assert log.b_rz == pytest.approx(swing, abs=1e-3 * np.abs(swing).max())
    assert np.ptp(log.b_x) == 0


def test_pore_water_is_refused(run_interpreted):
    text = HIT.format(method="ulmpm", touch=POINTS, ratio=1)
    wet = "0.3)\npore_water(soft, n=0.3, permeability=1e-5)"
    result = run_interpreted(text.replace("0.3)", wet, 1), status=1)
    assert "fix rigid_body does not support pore_water" in result.err
    assert "expected: a dry material" in result.err


def test_a_body_that_touches_nothing_is_reported(run_interpreted):
    text = HIT.format(method="ulmpm", touch="", ratio=1).replace(", f_y", "")
    result = run_interpreted(text.replace("run(20)", "run(1)"))
    assert "it passes through other solids" in result.err and "contact/rigid_body" in result.err


@pytest.mark.full
@pytest.mark.parametrize("scene", ["in.rolling", "in.floating"])
def test_one_thread_or_two(run_script, scene):
    text = (INPUTS / scene).read_text("utf-8").replace("refine = 1", "refine = 0.5")
    text = re.sub(
        r"^run_time.*",
        "dump(d, all, particle/bin, 50, d.*.bin, x, y, vx, vy)\nrun(100)",
        text,
        flags=re.M,
    )
    one = run_script(text, "--threads", "1", folder="one").folder
    same_files(one, run_script(text, "--threads", "2", folder="two").folder)


CUBE = """
method(ulmpm, FLIP, linear, 1)
dimension(3, 0, 4, 0, 4, 0, 4, 1)
region(below, block, 1, 3, 1, 3, 0, 1)
region(box, block, 1.2, 2.8, 1.2, 2.8, 1.2, 2.8)
region(skin, stl, cube.stl)
material(soft, linear, 1, 100, 0.3)
material(steel, rigid, 2)
solid(a, region, below, 1, soft, 1)
solid(b, region, box, 1, steel, 1)
fix(b, rigid_body, b, velocity=(0.1, 0, -1))
fix(f, contact/rigid_body, all, b, 0.3, region={region})
set_output(1)
log_modify(custom, step, b_z, b_vx, b_vz, b_fz, f_z)
run(30)
"""


AGAIN = (
    CUBE.format(region="skin")
    .replace("1.2, 2.8, 1.2, 2.8, 1.2, 2.8", "1.2, 2.8, 1.2, 2.8, 0.9, 2.5")
    .replace("velocity=(0.1, 0, -1)", "velocity=(0, 0, 0)")
    .replace("run(30)", "group(a, particles, region, below, solid, a)\nset_dt(0.01)\nrun(14)\n")
)


def test_points_that_enter_again_touch_at_once(run_interpreted, tmp_path):
    """In the step before, they were far from the surface, and were not searched for some steps."""
    (tmp_path / "run").mkdir()
    points, triangles = cube_surface(1.2, 2.8)
    stl = tmp_path / "run" / "cube.stl"
    write(stl, points - [0, 0, 0.3], {"triangle": triangles}, binary=True)
    log = run_interpreted(AGAIN + "deactivate(a)\nactivate(a)\nrun(1)\n").log
    assert log.f_z[1] < 0 and log.f_z[14] == 0 and log.f_z[15] < 0


DEEP = (
    CUBE.replace("4, 0, 4, 0, 4, 1)", "4, 0, 4, 0, 5, 1)")
    .replace("1, 3, 1, 3, 0, 1", "1, 3, 1, 3, 1, 1.5")
    .replace("below, 1, soft", "below, 2, soft")
    .replace("1.2, 2.8, 1.2, 2.8, 1.2, 2.8", "0.4, 3.6, 0.4, 3.6, 0.9, 4.1")
    .replace("velocity=(0.1, 0, -1)", "velocity=(0, 0, 0)")
    .replace("run(30)", "set_dt(0.01)\nrun(1)")
)


def test_points_deeper_than_their_radius_are_pushed_out_of_faces(run_interpreted, tmp_path):
    """They begin 0.35 of a cell deep, with a radius of 0.25; a block has the shape of the faces."""
    (tmp_path / "run").mkdir()
    points, triangles = cube_surface(0.4, 3.6)
    write(tmp_path / "run" / "cube.stl", points + [0, 0, 0.5], {"triangle": triangles}, binary=True)
    faces, block = [run_interpreted(DEEP.format(region=r)).log.f_z for r in ("skin", "box")]
    assert block[1] < 0 and faces[1] == pytest.approx(block[1], rel=1e-5)  # STL: single precision


HULL = (
    CUBE.format(region="skin")
    .replace("(0.1, 0, -1)", "(0.1, 0, 0), spin=(0, 0, 2)")
    .replace("run(30)", "dump(hull, all, surface/vtk, 10, hull.*.vtu)\nset_dt(0.01)\nrun(20)")
)


def test_the_surface_of_a_body_is_written_where_it_is(run_interpreted, tmp_path):
    """Read back by meshio: a cube that translates and turns about z, before anything touches it."""
    (tmp_path / "whole").mkdir()
    points, triangles = cube_surface(1.2, 2.8)
    write(tmp_path / "whole" / "cube.stl", points, {"triangle": triangles}, binary=True)
    folder = goes_on(run_interpreted, with_files(HULL))
    before, after = (meshio.read(folder / f"hull.{step}.vtu") for step in (0, 20))
    assert before.cells_dict["triangle"].shape == (len(triangles), 3)
    a, arm = 0.4, before.points - 2
    turned = [arm[:, 0] * np.cos(a) - arm[:, 1] * np.sin(a),
              arm[:, 0] * np.sin(a) + arm[:, 1] * np.cos(a), arm[:, 2]]  # fmt: skip
    assert after.points == pytest.approx(np.transpose(turned) + [2.02, 2, 2], abs=1e-6)
    assert np.unique(before.points.round(6)) == pytest.approx([1.2, 2.8])
    assert "hull.20.vtu" in (folder / "hull.pvd").read_text("utf-8")
    none = CUBE.format(region="box").replace("run(30)", "dump(d, all, surface/vtk, 1, d.*.vtu)")
    assert "has a surface from a file" in run_interpreted(none, folder="whole", status=1).err


def test_faces_of_a_file_touch_as_the_shape_does(run_interpreted, tmp_path):
    """Away from edges, where normals of a block are smoothed over 0.05 cells."""
    for folder in ("box", "skin"):
        (tmp_path / folder).mkdir()
        points, triangles = cube_surface(1.2, 2.8)
        write(tmp_path / folder / "cube.stl", points, {"triangle": triangles}, binary=True)
    logs = [run_interpreted(CUBE.format(region=name), folder=name).log for name in ("box", "skin")]
    for name in ("b_z", "b_vz", "b_fz"):
        size = np.abs(logs[0][name]).max()
        assert logs[0][name] == pytest.approx(logs[1][name], abs=1e-4 * size)
    assert np.abs(logs[0].b_fz).max() > 0.2
