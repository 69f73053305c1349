"""Implicit steps, against exact solutions; and what they refuse."""

from math import log, pi, sqrt
from pathlib import Path

import numpy as np
import pytest

from comparisons.results import read_dump

pytestmark = pytest.mark.xdist_group("implicit")
INPUTS = Path(__file__).parent.parent / "inputs"
PATCH = """
    d = 2
    kind = "ulmpm"
    basis = "linear"
    domains = "mechanical"
    method(kind, FLIP, basis, 1, domains)
    scheme(quasi-static)
    dimension(2, 0, 1.4, 0, 1, 0.1)
    region(box, block, 0, 1, 0, 1)
    material(m, linear, 1, 1000, 0.25)
    solid(s, region, box, 2, m, 0.1, 0)
    region(left, block, -INF, 1e-6, -INF, INF)
    region(right, block, 1-1e-6, INF, -INF, INF)
    region(everywhere, block, -INF, INF, -INF, INF)
    group(left, nodes, region, left, all)
    group(right, nodes, region, right, all)
    group(everywhere, nodes, region, everywhere, all)
    {lines}
    set_output(1)
    log_modify(custom, step, time, iterations, residual, parts, pull_x{columns})
    run(4)
"""
HELD = """fix(flat, velocity_nodes, everywhere, NULL, 0)
    fix(hold, velocity_nodes, left, 0, NULL)
    fix(pull, velocity_nodes, right, 1e-4, NULL)"""


def patch(lines: str = HELD, columns: str = "") -> str:
    return PATCH.format(lines=lines, columns=columns)


def coarse(lines: str = HELD) -> str:
    """The patch on cells of a half: interpreted load steps are slow."""
    text = patch(lines).replace("0, 1.4, 0, 1, 0.1", "0, 1.5, 0, 1, 0.5")
    return text.replace("m, 0.1", "m, 0.5")


WORDS = ("kind", "basis", "domains")


def test_patch(run_script):
    """Uniaxial strain: the force is (lam + 2 G) strain, exact for small strains (Hooke's law)."""
    check_patch(run_script(patch()).log)


@pytest.mark.parametrize(
    "values",
    [
        ("tlmpm", "linear", "mechanical"),
        ("ulmpm", "cpgimp", "stretch"),
        ("ulcpdi", "linear", "Q4"),
    ],
)
def test_patch_with_other_functions(run_interpreted, values):
    words = [w for k, v in zip(WORDS, values, strict=True) for w in ("-var", k, v)]
    check_patch(run_interpreted(coarse(), *words).log)


def check_patch(log_of):
    G = 1000 / 2 / 1.25
    modulus = 2 * G + 2 * G * 0.25 / 0.5
    assert np.allclose(log_of["pull_x"][1:] / modulus, 1e-4 * np.arange(1, 5), rtol=2e-3)
    # Quadratic convergence: from 1 to below 1e-10 in a few corrections.
    assert max(log_of["iterations"]) <= 3
    assert max(log_of["residual"]) < 1e-10


def test_a_column_under_its_weight(run_script):
    """The exact stress is the weight above (Coombs & Augarde 2020): order 2 with GIMP."""
    errors = []
    for n in (8, 16):
        result = run_script(INPUTS / "in.static_column", "-var", "N", str(n), folder=f"run{n}")
        assert result.log["floor_y"][-1] == pytest.approx(80 * 10 * 50 * 50 / n, rel=1e-9)
        points = read_dump(result.folder / "static_column.40.LAMMPS")[-1]
        exact = -80 * 10 * (50 - points["y0"])
        errors.append(np.mean(np.abs(points["s22"] - exact)) / (80 * 10 * 50))
    assert errors[0] < 0.026 and errors[1] < 0.0094
    assert log(errors[0] / errors[1]) / log(2) > 1.4


Q4 = "-var", "kind", "ulcpdi", "-var", "basis", "linear", "-var", "domains", "Q4"
WYSER = "-var", "H", "10", "-var", "E", "1e4", "-var", "g", "9.81"


@pytest.mark.full
@pytest.mark.parametrize(
    ("column", "cells", "most"), [((), (64, 128), 2.1e-4), (WYSER, (640, 1280), 7.6e-7)]
)
def test_published_columns(run_script, column, cells, most):
    """Errors of AMPLE (Coombs & Augarde 2020), and a third of the explicit floor of 2e-6.

    Wyser et al. 2020 find that floor with their explicit program (figure 4). Steps carry no point
    over more than half a cell.
    """
    errors = []
    for n in cells:
        words = "-var", "N", str(n), "-var", "steps", str(max(40, n // 2))
        result = run_script(INPUTS / "in.static_column", *Q4, *column, *words, folder=str(n))
        errors.append(result.log["share"][-1])
    assert errors[1] < most
    assert log(errors[0] / errors[1]) / log(2) > 1.8


@pytest.mark.full
@pytest.mark.parametrize("law", ["neo-hookean", "linear"])
def test_elastica(run_script, law):
    """Tip of a beam that bends by 80 % of its length (Bisshopp & Drucker 1945).

    Laws in rate form do so, too: points turn by up to 10 degrees per step.
    """
    # Cells of a quarter of the height: 1 % of the length, as AMPLE has it (tip 0.813 to 0.821).
    words = "-var", "law", law, "-var", "steps", "20", "-var", "ppc", "2"
    text = (INPUTS / "in.elastica").read_text().replace("pin_y, Es", "pin_y, parts")
    result = run_script(text, *words)
    assert max(result.log["parts"]) == 1  # though its end goes over several cells at once
    assert result.log["down"][-1] == pytest.approx(0.8106, abs=0.012)
    assert result.log["back"][-1] == pytest.approx(0.5550, abs=0.012)
    assert result.log["pin_y"][-1] == pytest.approx(100e3, rel=1e-8)


def test_a_cylinder_flows_through(run_script):
    """2/sqrt(3) Y ln(b/a) is the most that the wall bears (Hill 1950); nothing bears more."""
    result = run_script(INPUTS / "in.thick_cylinder")
    exact = 2 / sqrt(3) * log(2)
    pressure = result.log["pressure"]
    assert pressure[-1] == pytest.approx(exact, rel=5e-3) and max(pressure) < exact * 1.001
    # Elastic at first, by Lame: u = U at r = a in plane strain.
    E, nu, U = 1000, 0.3, 4 / 1000 / 30
    lame = E * U * (2**2 - 1) / ((1 + nu) * ((1 - 2 * nu) + 2**2))
    assert pressure[1] == pytest.approx(lame, rel=2e-3)
    # Means over the points of a cell: inside one the strain of linear functions is constant.
    last = result.snapshots("cylinder")[-1]
    order = np.argsort(last.x)
    r, radial = (column[order].reshape(-1, 4).mean(1) for column in (last.x, last.s11))
    assert np.abs(radial + 2 / sqrt(3) * np.log(2 / r)).max() < 0.01


BAR = """
    N = 32
    h = 1/N
    T = 0.4
    steps = 64
    rule = "newmark"
    beta = 0.25
    gamma = 0.5
    method(tlmpm, FLIP, linear, 1)
    scheme(newmark, beta, gamma, rule=rule)
    dimension(1, 0, 1 + 4*h, h)
    region(bar, block, 0, 1)
    material(m, linear, 1, 100, 0)
    solid(s, region, bar, 2, m, h, 0)
    region(wall, block, -INF, 1e-9)
    group(wall, nodes, region, wall, all)
    fix(hold, velocity_nodes, wall, 0)
    fix(v, initial_velocity_particles, all, 1e-4*sin(PI*x/2))
    compute(Ek, kinetic_energy, all)
    compute(Es, strain_energy, all)
    set_dt(T/steps)
    set_output(1)
    log_modify(custom, step, time, Ek, Es)
    run_time(2*T)
"""


@pytest.mark.full
def test_cooks_membrane(run_script):
    """Way of the load 23.96 F/E (Bergan & Felippa 1985): 7.9 and 3.2 % below, on two grids."""
    ways = []
    for refine in ("1", "2"):
        result = run_script(INPUTS / "in.cook", "-var", "refine", refine, folder=refine)
        assert result.log["left_y"][-1] == pytest.approx(-1, rel=1e-8)
        ways.append(result.log["way"][-1])
    errors = 1 - np.array(ways) / 23.96
    assert 0 < errors[1] < 0.035 and errors[0] / errors[1] > 2


@pytest.mark.full
def test_a_block_flows(run_script):
    """Its centre of gravity sinks as far as in time, 7.9 % of the height, less 5 % of that.

    `python -m comparisons static_collapse` runs both.
    """
    log_of = run_script(INPUTS / "in.static_collapse").log
    assert log_of["sunk"][-1] == pytest.approx(0.0787, rel=0.05)
    assert log_of["front"][-1] == pytest.approx(1.209, rel=0.02)
    assert log_of["base_y"][-1] == pytest.approx(16 * 8 * 1000 * 10, rel=1e-8)
    assert log_of["lost"][-1] > 3e5


def test_a_vertical_cut(run_script):
    """N = 3.78 (Pastor et al. 2000), 12 % above on 10 cells to the height, 7 % on 20."""
    result = run_script(INPUTS / "in.vertical_cut")
    assert 3.78 < result.log["N"][-1] < 3.78 * 1.15
    assert result.log["sunk"][-2] < 0.005 < result.log["sunk"][-1]


def period(log_of) -> float:
    """Time between the first and the last minimum of the kinetic energy, by parabolas."""
    E, t = log_of["Ek"], log_of["Time"]
    found = []
    for k in range(1, len(E) - 1):
        if E[k] <= E[k - 1] and E[k] < E[k + 1]:
            a, b, c = E[k - 1 : k + 2]
            found.append(t[k] + (t[k + 1] - t[k]) * (a - c) / (2 * (a - 2 * b + c)))
    return 2 * (found[-1] - found[0]) / (len(found) - 1)


def test_a_bar_swings_at_its_period(run_script):
    """4 L/c, and steps of twice the limit of waves; the trapezoidal rule keeps the energy."""
    result = run_script(BAR)
    total = result.log["Ek"] + result.log["Es"]
    # The rule lengthens the period by (w dt)^2/12, 0.08 %.
    assert period(result.log) == pytest.approx(0.4, rel=4e-3)
    assert np.allclose(total, total[0], rtol=5e-3)


def test_a_bar_swings_in_steps_of_a_hundred_cells(run_script):
    """The trapezoidal rule turns by 2 atan(w dt/2) per step, and keeps the energy.

    Points have less of it on the way, by the acceleration that the end of a step has still to give.
    """
    log_of = run_script(INPUTS / "in.slow_bar", "-var", "periods", "2").log
    assert np.abs(log_of["v_x"] - log_of["exact"]).max() < 5e-3 * log_of["exact"][0]
    total = log_of["Ek"] + log_of["Es"]
    assert np.allclose(total, total[0], rtol=4e-3) and total[-1] == pytest.approx(total[0], 1e-5)


def generalized_alpha(rho: float, turn: float, count: int) -> np.ndarray:
    """Velocities and energies (count + 1, 2) of one vibration that turns by `turn` per step.

    Those of the first are 1. Chung & Hulbert 1993, eqs. 12 to 25.
    """
    am, af = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    gamma, beta = 0.5 - am + af, (1 - am + af) ** 2 / 4
    x, v, a, k = 0.0, 1.0, 0.0, turn**2
    rows = [(v, 1.0)]
    for _ in range(count):
        free = x + v + (0.5 - beta) * a
        new = -(k * ((1 - af) * free + af * x) + am * a) / (1 - am + (1 - af) * k * beta)
        x, v, a = free + beta * new, v + (1 - gamma) * a + gamma * new, new
        rows.append((v, v * v + k * x * x))
    return np.array(rows)


@pytest.mark.parametrize("rho", [0, 0.8])
def test_generalized_alpha_keeps_what_a_step_resolves(run_script, rho):
    """The first mode of a bar, 40 steps per period, as a single vibration (Chung & Hulbert 1993).

    Small, as strains of 1 % change the period; cells of 1/4000 of a wave change it by 4e-5.
    """
    words = "-var", "periods", "2", "-var", "radius", str(rho), "-var", "v0", "0.001"
    log_of = run_script(INPUTS / "in.slow_bar", *words).log
    v, energy = generalized_alpha(rho, pi / 20, 80).T
    assert np.abs(log_of["v_x"] / log_of["v_x"][0] - v).max() < 1e-4
    total = (log_of["Ek"] + log_of["Es"]) / log_of["Ek"][0]
    assert np.abs(total - energy).max() < 1e-4
    assert 1 - total[-1] == pytest.approx(1 - energy[-1], rel=5e-3)


def test_generalized_alpha_damps_what_a_step_does_not_resolve(run_script):
    """Of a mode that vibrates 5 times per step 0.8^40 are left after 20 steps, next to nothing."""
    text = (INPUTS / "in.slow_bar").read_text()
    one = "v0*sin(PI*x0/(2*L))"
    text = text.replace(one, f"{one} + v0*sin(201*PI*x0/(2*L))")
    left = []
    for rho in ("1", "0.8"):
        words = "-var", "periods", "0.5", "-var", "radius", rho
        log_of = run_script(text, *words, folder=rho).log
        left.append((log_of["Ek"] + log_of["Es"])[-1] / 0.0625 - 1)  # the first mode keeps 0.0625
    assert left[0] > 0.3 and abs(left[1]) < 5e-3


def test_rules_that_damp(run_script):
    """Euler's rule: 1/(1 + (w dt)^2) per step; gamma 0.6: 0.1 (w dt)^2 of it (Hughes 2000, 9.1)."""
    for words, rate in (
        (("rule", "euler"), 1.0),
        (("gamma", "0.6", "-var", "beta", "0.3025"), 0.1),
    ):
        log_of = run_script(BAR, "-var", *words).log
        kept = (log_of["Ek"] + log_of["Es"])[-1] / log_of["Ek"][0]
        exact = (1 + (2 * pi / 64) ** 2) ** (-128 * rate)
        assert kept == pytest.approx(exact, rel=0.06)


DRIVEN = """
    N = 32
    h = 1/N
    T = 0.4
    led = 1
    method(tlmpm, FLIP, linear, 1)
    scheme(newmark)
    dimension(1, 0, 1 + 4*h, h)
    region(bar, block, 0, 1)
    material(m, linear, 1, 100, 0)
    solid(s, region, bar, 2, m, h, 0)
    region(wall, block, -INF, 1e-9)
    group(wall, nodes, region, wall, all)
    fix(hold, velocity_nodes, wall, led*1e-2*sin(2*PI*time/0.37))
    fix(g, body_force, all, (1-led)*0.1*sin(2*PI*time/0.37))
    set_dt(T/16)
    run_time(2*T)
"""


def energy_told(out: str) -> float:
    """Change of the energy in the summary of a run, in percent."""
    return float(next(line.split()[1] for line in out.splitlines() if " of the largest" in line))


@pytest.mark.parametrize("led", ["0", "1"])
def test_the_energy_of_newmark_is_watched(run_script, led):
    """The trapezoidal rule adds what loads, and those who hold nodes, do; here by coarse steps."""
    assert abs(energy_told(run_script(DRIVEN, "-var", "led", led).out)) < 0.3


def test_energy_that_a_step_loses_is_told(run_script):
    """Vibrations of five periods per step lose it on the way to the nodes; rho is known to damp."""
    one = "v0*sin(PI*x0/(2*L))"
    text = (INPUTS / "in.slow_bar").read_text()
    text = text.replace(one, f"{one} + v0*sin(201*PI*x0/(2*L))")
    told, damped = (
        run_script(text, "-var", "periods", "0.5", "-var", "radius", rho, folder=rho)
        for rho in ("1", "0.8")
    )
    assert "energy balance: spurious loss" in told.err and "dt_factor" not in told.err
    assert energy_told(told.out) < -20
    assert "energy balance: spurious loss" not in damped.err and energy_told(damped.out) < -45
    assert "scheme newmark with rho 0.8 dissipates energy" in damped.out


FLIGHT = """
    kind = "ulmpm"
    method(kind, FLIP, linear, 1)
    scheme(newmark)
    dimension(2, 0, 3, 0, 1, 0.25)
    region(box, block, 0.5, 1, 0.25, 0.75)
    material(m, linear, 1, 1000, 0.25)
    solid(s, region, box, 2, m, 0.25, 0)
    fix(v, initial_velocity_particles, all, 1, 0)
    {lines}
    compute(Ek, kinetic_energy, all)
    compute(Es, strain_energy, all)
    set_dt(0.0625)
    set_output(1)
    log_modify(custom, step, time, Ek, Es{columns})
    run(8)
"""


def test_a_body_flies(run_script):
    """Points on lines between cells, which they cross by quarters of a cell: nothing happens."""
    log_of = run_script(FLIGHT.format(lines="", columns="")).log
    assert np.allclose(log_of["Ek"], 0.125, rtol=1e-9) and max(log_of["Es"]) < 1e-12


def test_forces_that_are_rounding_are_none(run_interpreted):
    """A body that nothing strains flies on: what its inertia is rounded to is no force."""
    text = FLIGHT.format(lines="", columns=", iterations, residual").replace("0.0625", "0.01")
    text = text.replace(", all, 1, 0", ", all, 0.3, 0.1").replace(
        "linear, 1, 1000", "linear, 1e6, 1"
    )
    log_of = run_interpreted(text).log
    assert np.allclose(log_of["Ek"], 12500, rtol=1e-9)
    assert max(log_of["iterations"]) <= 2 and max(log_of["residual"]) <= 1e-10


AT_REST = FLIGHT.replace(", all, 1, 0", ", all, 0, 0")
BEFORE = """fix(g, body_force, all, 0, -0.1)
    scheme(musl)
    set_dt(0.001)
    run(10)
    scheme(newmark)"""
EVERY = """region(every, block, -INF, INF, -INF, INF)
    group(every, nodes, region, every, all)
    fix(hold, velocity_nodes, every, 0, 0)
    fix(g, body_force, all, 0, -10)"""


def test_a_body_falls(run_interpreted):
    """v = g t, behind another scheme, too."""
    out = run_interpreted(AT_REST.format(lines=BEFORE, columns="")).out
    last = [line.split() for line in out.splitlines() if line[:2] == "18"][-1]
    assert float(last[2]) == pytest.approx(0.125 * (0.1 * float(last[1])) ** 2, rel=2e-2)


def test_held_nodes_bear_the_weight(run_script):
    """From the first step on: m g."""
    log_of = run_script(AT_REST.format(lines=EVERY, columns=", hold_y")).log
    assert np.allclose(log_of["hold_y"][1:], 2.5, rtol=1e-9)


WRONG = [
    (HELD.replace("left, 0, NULL", "left, leq 0, NULL"), "whose changes depend on the velocities",
     "hold"),
    (HELD + "\n    fix(calm, local_damping, all, 0.8)", "whose changes depend on the velocities",
     "calm"),
    (HELD + "\n    fix(v, velocity_particles, all, 0, 0)", "support fix velocity_particles", "v"),
    ("fix(pull, body_force, all, 1, 0)", "solid 's' is held by nothing", ""),
    ("region(corner, block, -INF, 1e-6, -INF, 1e-6)\n    "
     "group(corner, nodes, region, corner, all)" "\n    fix(pull, velocity_nodes, corner, 0, 0)",
     "solid 's' can rotate", ""),
    ("fix(hold, velocity_nodes, left, 0, NULL)\n    fix(pull, body_force, all, 1, 0)",
     "solid 's' is not held along y", ""),
]  # fmt: skip


def test_check_says_that_nothing_is_held(run_interpreted):
    said = run_interpreted(patch("fix(pull, body_force, all, 1, 0)"), command="check", status=1).err
    assert "step 1, time 0: solid 's' is held by nothing, and there is no inertia" in said
    assert "error: " not in run_interpreted(patch(HELD), command="check").err


@pytest.mark.parametrize(("lines", "message", "marked"), WRONG)
def test_refusals(run_script, lines, message, marked):
    result = run_script(patch(lines), status=1)
    assert message in result.err and "Traceback" not in result.err
    assert marked in result.err


METHODS = [
    ("method(kind, FLIP, basis, 1, domains)", "method(ulmpm, APIC, quadratic-spline)",
     "transfer APIC"),
    ("scheme(quasi-static)", "scheme(quasi-static, tolerance=0)", "tolerance"),
    ("scheme(quasi-static)", "scheme(quasi-static, solver=cg)", "solver"),
    ("scheme(quasi-static)", "scheme(newmark)", "set_dt"),
    ("scheme(quasi-static)", "scheme(newmark, 0.1, 0.5)", "gamma/2"),
    ("scheme(quasi-static)", "scheme(newmark, rho=1.1)", "rho"),
    ("scheme(quasi-static)", "scheme(newmark, 0.25, rho=0.8)", "rho alone"),
    ("scheme(quasi-static)", "scheme(quasi-static)\n    precision(single)", "precision(single)"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "wrong", "message"), METHODS)
def test_refused_choices(run_script, line, wrong, message):
    result = run_script(patch().replace(line, wrong), status=1)
    assert message in result.err and "Traceback" not in result.err


def test_steps_that_are_too_large_are_done_in_parts(run_script):
    """A stretch by one in one step: the end would go to nodes that are held, and nothing saw."""
    fast = patch(HELD).replace("1e-4", "0.16").replace("run(4)", "run(2)")
    log_of = run_script(fast).log
    assert max(log_of["parts"]) > 1
    assert log_of["Time"][-1] == 2 and len(log_of["Time"]) == 3
    assert np.all(np.diff(log_of["pull_x"]) > 0)


BEYOND = """fix(hold, velocity_nodes, left, 0, NULL)
    region(foot, block, -INF, 1e-6, -INF, 1e-6)
    region(end, block, 0.95, INF, -INF, INF)
    group(foot, nodes, region, foot, all)
    group(end, particles, region, end, solid, s)
    fix(middle, velocity_nodes, foot, NULL, 0)
    fix(pull, force_particles, end, time/2, 0)
    F = time/2"""
STEEL = """eos(steel, linear, 1, 1000)
    strength(steel, plastic, 400, 1)
    material(m, eos-strength, steel, steel)"""


@pytest.mark.full
def test_a_run_ends_at_the_limit_load(run_script):
    """A bar bears 2/sqrt(3) of its yield stress in plane strain: its ends are pulled by no more."""
    text = patch(BEYOND).replace("pull_x", "F").replace("material(m, linear, 1, 1000, 0.25)", STEEL)
    text = text.replace("quasi-static", "quasi-static, limit=stop, stabilisation=0")
    words = "-var", "basis", "quadratic-spline"
    result = run_script(text, *words)
    assert "limit load: no equilibrium beyond time 2.2" in result.out
    assert result.log["F"][-1] == pytest.approx(2 / sqrt(3), rel=0.01)
    result = run_script(text.replace("limit=stop", "limit=error"), *words, status=1, folder="error")
    assert "there is no equilibrium" in result.err


def test_a_cell_bears_its_limit_load(run_interpreted):
    """The points at the end, h/4 within the cell, pull its nodes there by 3/4 of their force.

    Eight corrections are enough, or no number of them is.
    """
    text = patch(BEYOND).replace("pull_x", "F").replace("material(m, linear, 1, 1000, 0.25)", STEEL)
    text = text.replace("0, 1.4, 0, 1, 0.1", "0, 2, 0, 2, 1").replace("m, 0.1", "m, 1")
    text = text.replace("0.95, INF", "0.5, INF")
    text = text.replace("quasi-static", "quasi-static, limit=stop, stabilisation=0, iterations=8")
    result = run_interpreted(text)
    assert "limit load: no equilibrium beyond time 3.0" in result.out
    assert 0.75 * result.log["F"][-1] == pytest.approx(2 / sqrt(3), rel=0.01)
    error = run_interpreted(text.replace("limit=stop", "limit=error"), status=1, folder="error")
    assert "there is no equilibrium" in error.err


def test_multigrid_solves_as_a_direct_solver(run_script):
    """The same forces, and the same bits each time."""
    logs = [
        run_script(
            patch().replace("quasi-static", f"quasi-static, solver={solver}"), folder=f"{k}{solver}"
        ).log
        for k, solver in enumerate(("amg", "amg", "direct"))
    ]
    assert np.allclose(logs[0]["pull_x"], logs[2]["pull_x"], rtol=1e-8)
    assert np.all(logs[0]["residual"] == logs[1]["residual"])


def test_threads_have_the_same_bits(run_script):
    """Each node sums what points give it in one order."""
    logs = [
        run_script(patch(), "--threads", str(n), folder=f"threads{n}").log for n in (1, 2)
    ]  # fmt: skip
    assert np.all(logs[0]["pull_x"] == logs[1]["pull_x"])
    assert np.all(logs[0]["residual"] == logs[1]["residual"])


@pytest.mark.parametrize("scheme", ["quasi-static", "newmark", "newmark, rho=0.6"])
def test_restarts_have_the_same_bytes(run_interpreted, scheme):
    """A run in two pieces writes the rows that a whole one writes."""
    text = coarse(HELD + f"\n    scheme({scheme})\n    set_dt(0.5)\n    restart(2, r.*.h5)")
    whole = run_interpreted(text)
    rest = run_interpreted(text, "-restart", str(whole.folder / "r.2.h5"), folder="again")
    assert whole.log["pull_x"][-1] == rest.log["pull_x"][-1]
    assert whole.log["residual"][-1] == rest.log["residual"][-1]


def test_a_file_of_load_steps_begins_a_run_in_time(run_script):
    """Stress in the ground by load steps, then motion: another scheme reads the state."""
    weight = "fix(hold, velocity_nodes, left, 0, 0)\n    fix(g, body_force, all, 0, -0.1)"
    first = patch(weight).replace(", pull_x", ", hold_y")
    whole = run_script(first + "    write_restart(state.h5)\n")
    then = first.replace("quasi-static", "newmark").replace("run(4)", "set_dt(0.01)\n    run(4)")
    then = then.replace("    run(4)", f"    read_restart({whole.folder / 'state.h5'})\n    run(4)")
    log_of = run_script(then, folder="then").log
    assert np.allclose(log_of["hold_y"], whole.log["hold_y"][-1], rtol=1e-4)
