"""Accelerations corrected for the lumped masses: exact waves, momentum, walls, what is refused."""

from math import pi

import numpy as np
import pytest
from conftest import INPUTS
from scenes import block

# A bar between two walls in its first mode. One period takes 2 L/c; the log counts the second
# passage through the state at rest, by which time lumped masses are late.
WAVE = """
method(ulmpm, {method})
scheme({scheme}, start=half)
dimension(1, 0, 1, 1/{n})
region(bar, block, 0, 1)
material(m, linear, 1, 1, 0)
solid(bar, region, bar, 2, m, 1/{n})
region(low, block, -INF, 0)
region(high, block, 1, INF)
region(walls, union, low, high)
group(walls, nodes, region, walls, all)
fix(walls, velocity_nodes, walls, 0)
fix(start, initial_velocity_particles, all, 1e-6*sin(PI*x0))
set_dt(0.4/{n})
dump(d, all, particle, {steps}, d.*.LAMMPS, x, x0)
run({steps})
"""


def _late(run_interpreted, method, scheme, n=8):
    """Return the relative error of the frequency, by the displacement after one period."""
    steps = 5 * n
    script = WAVE.format(method=method, scheme=scheme, n=n, steps=steps)
    points = run_interpreted(script).snapshots("d")[-1]
    shape = np.sin(pi * points["x0"])
    amplitude = np.mean((points["x"] - points["x0"]) * shape) / np.mean(shape**2)
    return amplitude / (2e-6 / pi * pi)


@pytest.mark.parametrize(
    ("method", "scheme", "lumped", "corrected"),
    [
        ("APIC, quadratic-spline", "usl", 0.017, 0.0047),
        ("AFLIP, cubic-spline, 1", "musl", 0.022, 0.0038),
    ],
)
def test_the_frequency_of_a_bar(run_interpreted, method, scheme, lumped, corrected):
    """The lumped mass costs kappa (k h)^2 / 2: 1.9 % with quadratic, 2.6 % with cubic splines."""
    assert abs(_late(run_interpreted, method, scheme)) > lumped
    assert abs(_late(run_interpreted, f"{method}, mass=corrected", scheme)) < corrected


AXIS = """
method(ulmpm, APIC, quadratic-spline, mass=corrected)
scheme({scheme})
dimension(2, 0, 1.2, 0, 2, 0.2)
axisymmetric(true)
region(b, block, 0, 0.8, 0.5, 1.5)
material(m, linear, 1, 1, 0.3)
solid(b, region, b, 2, m, 0.2)
fix(start, initial_velocity_particles, all, 0.05*x0, 0)
dump(d, all, particle, 20, d.*.LAMMPS, x0, s11, s33)
set_dt(0.04)
run(20)
"""


@pytest.mark.parametrize("scheme", ["usl", "musl"])
def test_stress_at_the_axis(run_interpreted, scheme):
    """Nodes on the axis take no radial velocity from their neighbours: s11 = s33 there."""
    points = run_interpreted(AXIS.format(scheme=scheme)).snapshots("d")[-1]
    inner = points["x0"] < 0.1
    s11, s33 = (points[name][inner] for name in ("s11", "s33"))
    assert abs(s11).min() > 1e-3
    assert np.allclose(s11, s33, rtol=0.02)


@pytest.mark.parametrize(("basis", "most"), [("quadratic", 0.0075), ("cubic", 0.0055)])
def test_a_square_that_pulsates(run_script, basis, most):
    """Manufactured solution of in.axis_aligned, G = 0.05: 2.03 and 2.41 % with lumped masses."""
    chosen = {"G": "0.05", "transfer": "APIC", "alpha": "mechanical", "mass": "corrected"}
    chosen["basis"] = f"{basis}-spline"
    words = [word for name, value in chosen.items() for word in ("-var", name, value)]
    script = (INPUTS / "in.axis_aligned").read_text("utf-8").split("dump(")[0]
    log = run_script(f"{script}run_time(2/c)", *words).log
    assert log["error_z"][-1] < most


# Walls on two sides, one of which moves: in between the block is shaken.
HELD = (
    "region(left, block, INF, 0.31, INF, INF)", "group(left, nodes, region, left, all)",
    "region(low, block, INF, INF, INF, 0.31)", "group(low, nodes, region, low, all)",
    "fix(left, velocity_nodes, left, 0.3*time, NULL)", "fix(low, velocity_nodes, low, NULL, 0)",
    "fix(v, initial_velocity_particles, all, sin(9*x0) - 1, cos(9*y0))",
    "fix(g, body_force, all, 0.2*y0, -1)", "compute(p, linear_momentum, all)", "set_output(1)",
    "log_modify(custom, step, dt, time, p_x, p_y, left_x, low_y, g_x, g_y)",
)  # fmt: skip


def _corrected(*lines, d=2, **changes):
    script = block(d, *lines, **({"transfer": "APIC", "size": (0.3, 0.2)} | changes))
    return script.replace("spline)", "spline, mass=corrected)")


@pytest.mark.parametrize("kind", ["ulmpm", "tlmpm"])
def test_momentum_to_round_off(run_interpreted, kind):
    """The forces of walls and loads are all that changes it; with musl and constant steps."""
    script = _corrected("set_dt(0.004)", *HELD, "run(12)").replace("(ulmpm,", f"({kind},")
    log = run_interpreted(script).log
    for axis, wall in (("x", "left"), ("y", "low")):
        force = log[f"{wall}_{axis}"] + log[f"g_{axis}"]
        change = np.diff(log[f"p_{axis}"]) / 0.004
        assert np.abs(force).max() > 0.1
        assert (
            np.abs(change - force[1:])[1:].max() < 1e-8 * np.abs(force).max()
        )  # ten digits in the log


def test_flight_is_untouched(state_interpreted):
    """All nodes have the acceleration of gravity: nothing is corrected."""
    lines = "fix(g, body_force, all, 0, -1)", "fix(v, initial_velocity_particles, all, 1, 0.5)"
    script = _corrected(*lines, "set_dt(0.004)", "run(10)")
    plain = state_interpreted(script.replace(", mass=corrected", ""), "vx", "vy")
    found = state_interpreted(script, "vx", "vy")
    for name in ("vx", "vy"):
        assert np.abs(found[name] - plain[name]).max() < 1e-14


REFUSED = {
    "method(ulmpm, FLIP, quadratic-spline, 0.9, mass=corrected)": "transfer FLIP",
    "method(ulmpm, APIC, linear, mass=corrected)": "the basis linear",
    "method(ulmpm, APIC, cpgimp, mass=corrected)": "the basis cpgimp",
    "method(ulcpdi, APIC, linear, R4, mass=corrected)": "the basis linear R4",
    "method(ulmpm, APIC, cubic-spline, mass=corrected)\nscheme(quasi-static)": "quasi-static",
    "method(ulmpm/contacts, APIC, cubic-spline, mass=corrected)": "method ulmpm/contacts",
    "method(ulmpm, APIC, cubic-spline, mass=consistent)": "lumped, corrected",
}


@pytest.mark.parametrize("method", REFUSED)
def test_what_has_no_correction_is_refused_by_name(run_interpreted, method):
    lines = () if "scheme" not in method else ("run(1)",)  # else at the line, before any run
    script = block(2, *lines).replace("method(ulmpm, FLIP, linear, 1)\nscheme(musl)", method)
    err = run_interpreted(script, status=1).err
    assert REFUSED[method] in err
    assert f"in.script:{method.count(chr(10)) + 1}" in err


@pytest.mark.parametrize("wall", ["geq0", "0, mu=0.3"])
def test_a_wall_that_yields_is_refused(run_interpreted, wall):
    hold = f"fix(w, velocity_nodes, low, NULL, {wall})"
    err = run_interpreted(_corrected(*HELD[2:4], hold, "run(1)"), status=1).err
    assert "mass=corrected does not support fix velocity_nodes with a bound or friction" in err


@pytest.mark.parametrize(("kind", "share"), [("ulmpm", 0.8), ("tlmpm", 0.7)])
def test_the_own_step(run_interpreted, kind, share):
    script = _corrected("set_output(1)", "log_modify(custom, step, dt)", "run(1)", size=(0.3, 0.3))
    script = script.replace("(ulmpm,", f"({kind},")
    lumped = run_interpreted(script.replace(", mass=corrected", "")).log["dt"][0]
    corrected = run_interpreted(script)
    assert corrected.log["dt"][0] == pytest.approx(share * lumped, rel=1e-6)
    assert "light_nodes" not in corrected.out and "mass=corrected" in corrected.out
