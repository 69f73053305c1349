"""What fixes do, each against a calculation by hand."""

import re

import numpy as np
import pytest
from scenes import SCHEMES, block

# 2D block of 0.3 x 0.2 with rho 2 and 24 points: mass 0.12; in 1D 0.3 and 6 points: mass 0.6.
MASS = 0.12
every_scheme = pytest.mark.parametrize("scheme", SCHEMES)


@every_scheme
def test_body_force(run_interpreted, scheme):
    """The total is m b at once; v = b t, whatever the scheme, and positions sum to dt^2 b n(n+1)/2.

    Gravity acts on all nodes alike, so nothing strains.
    """
    script = block(
        2, "fix(g, body_force, all, 2*x0/x0, -3)", "compute(v, average_velocity, all)",
        "fix(u, check_solution, all, 2*0.001^2*timestep*(timestep+1)/2,"
        " -3*0.001^2*timestep*(timestep+1)/2)",
        "log_modify(custom, step, time, g_x, g_y, v_x, v_y, u_s)", "set_dt(0.001)", "run(10)",
        scheme=scheme,
    )  # fmt: skip
    log = run_interpreted(script).log
    assert log.g_x[1:] == pytest.approx(np.full(10, 2 * MASS), rel=1e-9)
    assert log.g_y[1:] == pytest.approx(np.full(10, -3 * MASS), rel=1e-9)
    assert log.v_x == pytest.approx(2 * log.Time, rel=1e-9, abs=1e-15)
    assert log.v_y == pytest.approx(-3 * log.Time, rel=1e-9, abs=1e-15)
    assert log.u_s[-1] < 1e-14


def test_an_id_that_is_in_use_replaces_the_fix_and_says_so(run_interpreted):
    """As in Karamelo: the second force acts alone, at once and after a run."""
    result = run_interpreted(
        block(
            2, "fix(g, body_force, all, 1, 0)", "fix(g, body_force, all, 0, 2)",
            "log_modify(custom, step, g_x, g_y)", "set_dt(0.001)", "run(1)",
            "fix(g, body_force, all, 3, 0)", "run(1)",
        )
    )  # fmt: skip
    assert result.log.g_x == pytest.approx([0, 0, 3 * MASS], rel=1e-9)
    assert result.log.g_y == pytest.approx([0, 2 * MASS, 0], rel=1e-9)
    lines = re.findall(
        r"in.script:(\d+):1: warning: fix 'g' replaces the one of line (\d+)", result.err
    )
    assert [int(new) - int(old) for new, old in lines] == [1, 4]


def test_work_of_gravity_on_a_body_that_falls_freely(run_interpreted):
    """A body that nothing strains has the same velocity before and after it is mapped again."""
    out = run_interpreted(block(1, "fix(g, body_force, all, -3)", "set_dt(0.001)", "run(60)")).out
    assert abs(float(re.search(r"energy +([-+][\d.]+) % of the largest", out)[1])) < 0.02


def test_a_compute_has_the_id_of_a_fix_with_other_values(run_interpreted):
    lines = "fix(E, local_damping, all, 0.1)", "compute(E, kinetic_energy, all)"
    log = run_interpreted(block(2, *lines, "log_modify(custom, step, E, E_x)", "run(1)")).log
    assert len(log["E"]) == len(log["E_x"]) == 2


def test_force_nodes_applies_its_total_once(run_interpreted):
    """With two solids of different laws, too: dp/dt = the total, split over nodes with mass."""
    two = block(
        2, "region(second, block, 0.6, 0.8, 0.3, 0.5)", "material(other, neo-hookean, 3, 50, 0.2)",
        "solid(other, region, second, 2, other, 0.1, 0)",
        "region(part, block, 0.25, 0.85, 0.25, 0.55)", "group(nodes, nodes, region, part, all)",
        "fix(f, force_nodes, nodes, 5, -7*(1+time), NULL)",
        "group(body, particles, region, box, solid, body)",
        "group(rest, particles, region, second, solid, other)",
        "compute(v1, average_velocity, body)", "compute(v2, average_velocity, rest)",
        "log_modify(custom, step, time, f_x, f_y, 0.12*v1_x + 0.12*v2_x, 0.12*v1_y + 0.12*v2_y)",
        "set_dt(0.001)", "run(5)",
    )  # fmt: skip
    log = run_interpreted(two).log
    px, py = list(log.values())[-2:]
    assert log.f_x[1:] == pytest.approx(np.full(5, 5), rel=1e-9)
    assert log.f_y[1:] == pytest.approx(-7 * (1 + log.Time[:-1]), rel=1e-9)
    assert px == pytest.approx(5 * log.Time, rel=1e-8, abs=1e-15)
    impulse = np.concatenate([[0], np.cumsum(-7 * (1 + log.Time[:-1]) * 0.001)])
    assert py == pytest.approx(impulse, rel=1e-8, abs=1e-15)


def test_velocity_nodes_and_its_reaction(run_interpreted):
    """A body at rest carried at v(t) = t takes the force m dv/dt = m, and m g to hold its weight.

    All nodes are held, so all is rigid. The velocity before the first step, v(-dt), is 0 too.
    """
    script = block(
        2, "fix(hold, velocity_nodes, all, max(time, 0), 0)", "fix(g, body_force, all, NULL, -9)",
        "compute(v, average_velocity, all)", "log_modify(custom, step, time, hold_x, hold_y, v_x)",
        "set_dt(0.001)", "run(6)",
    )  # fmt: skip
    log = run_interpreted(script).log
    assert log.hold_y[1:] == pytest.approx(np.full(6, 9 * MASS), rel=1e-8)
    assert log.hold_x[2:] == pytest.approx(np.full(5, MASS), rel=1e-8)
    assert np.diff(log.v_x)[1:] == pytest.approx(np.full(5, 0.001), rel=1e-6)


def test_velocity_particles(run_interpreted):
    """Points move by dt v in each step, v at the time of the step, and carry that velocity."""
    script = block(
        2, "fix(go, velocity_particles, all, 1 + 100*time, NULL)", "set_dt(0.001)",
        "compute(v, average_velocity, all)",
        "fix(u, check_solution, all, 0.001*(timestep + 0.1*timestep*(timestep-1)/2), 0)",
        "log_modify(custom, step, time, u_s, v_x, v_y)", "run(5)",
    )  # fmt: skip
    log = run_interpreted(script).log
    assert log.u_s[-1] < 1e-14
    assert log.v_x[1:] == pytest.approx(1 + 100 * log.Time[:-1], rel=1e-9)
    assert log.v_y[-1] == pytest.approx(0, abs=1e-14)


@pytest.mark.parametrize(
    ("method", "scheme"),
    [
        ("tlmpm, FLIP, linear, 1", "usl"),
        ("ulmpm, TPIC, linear", "usf"),
        ("tlmpm, AFLIP, linear, 1", "usavg"),
        ("tlmpm, APIC, linear", "musl"),
    ],
)
def test_a_body_follows_its_grips(run_interpreted, method, scheme):
    """The mean stress of a bar whose ends are led is E times elongation over length.

    It was 0.10 to 0.28 for 0.25: strains followed velocities that the grid gave the led points.
    """
    script = f"""
    method({method})
    scheme({scheme})
    dimension(1, 0, 1.5, 0.2)
    region(b, block, 0, 1)
    region(tip, block, 0.6, INF)
    region(foot, block, -INF, 0.4)
    material(m, neo-hookean, 1, 100, 0)
    solid(b, region, b, 2, m, 0.2)
    group(tip, particles, region, tip, all)
    group(foot, particles, region, foot, all)
    fix(tip, velocity_particles, tip, 0.01)
    fix(foot, velocity_particles, foot, 0)
    compute(s, average_stress, all)
    set_dt(0.01)
    set_output(25)
    log_modify(custom, s_11)
    run(25)
    """
    assert run_interpreted(script).log["s_11"][-1] == pytest.approx(0.25, rel=0.045)


@every_scheme
def test_initial_velocity_nodes(run_interpreted, scheme):
    """One step with v* = A X at the nodes; with PIC the points then have v = A x0, F = I + dt A."""
    script = block(
        2, "fix(kick, initial_velocity_nodes, all, 0.5*x0, -0.2*y0)", "set_dt(0.001)",
        "dump(d, all, particle, 1, d.*.LAMMPS, x, y, vx, vy, volume)", "run(1)",
        transfer="PIC", scheme=scheme, law="neo-hookean",
    )  # fmt: skip
    result = run_interpreted(script)
    first, last = result.dump("d.0.LAMMPS"), result.dump("d.1.LAMMPS")
    assert last.vx == pytest.approx(0.5 * first.x, abs=1e-9)
    assert last.vy == pytest.approx(-0.2 * first.y, abs=1e-9)
    assert last.x == pytest.approx(first.x * (1 + 0.0005), abs=1e-9)
    if scheme != "usf":  # whose strain comes before the forces of the next step
        share = 0.5 if scheme == "usavg" else 1  # the other half comes then, too
        growth = (1 + 0.0005 * share) * (1 - 0.0002 * share)
        assert last.volume == pytest.approx(growth * first.volume, rel=1e-8)


def test_check_solution(run_interpreted):
    """u = 0.3 t against 0.25 t: error 0.05 t; the history sums to 0.05/0.25 of the solution."""
    script = block(
        2, "fix(v, initial_velocity_particles, all, 0.3, 0)",
        "fix(e, check_solution, all, 0.25*time, 0)", "set_dt(0.001)",
        "log_modify(custom, step, time, e_s, e_x, e_y, e_z)", "run(4)",
    )  # fmt: skip
    log = run_interpreted(script).log
    assert log.e_s == pytest.approx(0.05 * log.Time, rel=1e-8, abs=1e-15)
    volume = 0.06
    total = 0.001 * volume * (0.05 * log.Time) ** 2
    assert log.e_x == pytest.approx(np.cumsum(total), rel=1e-8, abs=1e-20)
    assert log.e_z[-1] == pytest.approx(0.2, rel=1e-8)


def test_initial_fixes_act_once(run_interpreted):
    """Not again in a second run, nor when a new solid makes the scene anew; a new fix does act."""
    script = block(
        1, "fix(v0, initial_velocity_particles, all, 0.5)", "compute(v, average_velocity, all)",
        "log_modify(custom, step, v_x)", "set_dt(0.001)", "fix(g, body_force, all, 10)", "run(3)",
        "region(far, block, 0.9, 1)", "solid(far, region, far, 2, rubber, 0.1, 0)", "run(2)",
        "fix(v0, initial_velocity_particles, all, 0.25)", "run(1)",
    )  # fmt: skip
    log = run_interpreted(script).log
    assert log.v_x[log.Step == 3][0] == pytest.approx(0.53, rel=1e-9)
    # 6 points at 0.5 + 0.05 and 2 new ones at 0.02
    assert log.v_x[log.Step == 5][0] == pytest.approx((6 * 0.55 + 2 * 0.02) / 8, rel=1e-9)
    assert log.v_x[-1] == pytest.approx(0.26, rel=1e-9)


def test_an_empty_group_is_a_warning(run_interpreted):
    script = block(
        1, "region(nowhere, block, 1, 1.1)", "group(none, particles, region, nowhere, all)",
        "fix(v, initial_velocity_particles, none, 1)", "log_modify(custom, step)", "run(1)",
    )  # fmt: skip
    result = run_interpreted(script)
    assert "warning" in result.err
    assert "'none'" in result.err


def test_formulas_of_place_and_time(run_interpreted):
    """b = x0 t on nodes: the total is t sum m_I X_I = t m times the centre of mass."""
    script = block(
        2, "fix(g, body_force, all, x0*time, y0*y0/y0)", "set_dt(0.001)",
        "log_modify(custom, step, time, g_x, g_y)", "run(3)",
    )  # fmt: skip
    log = run_interpreted(script).log
    # The force uses the time at the start of a step; linear weights keep the centre of mass.
    expected = MASS * 0.45 * log.Time[:-1]
    assert log.g_x[1:] == pytest.approx(expected, rel=1e-5, abs=1e-15)
    assert log.g_y[1:] == pytest.approx(np.full(3, MASS * 0.4), rel=1e-5)


@pytest.mark.parametrize("share", [1, 0.9, 0])
def test_reaction_is_the_stress(run_interpreted, share):
    """The grips of a bar that is stretched slowly bear E ln(1 + strain), whatever points keep."""
    script = f"""
    h = 0.25
    method(tlmpm, FLIP, linear, {share})
    dimension(1, -0.5, 1.5, h)
    region(bar, block, 0, 1)
    material(m, linear, 1e-3, 1, 0)
    solid(bar, region, bar, 2, m, h, 0)
    region(left, block, -h/4, h/4)
    region(right, block, 1 - h/4, 1 + h/4)
    group(left, nodes, region, left, all)
    group(right, nodes, region, right, all)
    fix(v0, initial_velocity_particles, all, 0.01*x0)
    fix(left, velocity_nodes, left, 0)
    fix(right, velocity_nodes, right, 0.01)
    log_modify(custom, step, time, left_x, right_x)
    set_output(100)
    run_time(1)
    """
    log = run_interpreted(script).log
    exact = np.log(1.01)  # a step later: of 140 steps
    assert log.right_x[-1] == pytest.approx(exact, rel=1 / 140)
    assert log.left_x[-1] == pytest.approx(-exact, rel=1 / 140)
