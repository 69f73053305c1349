"""Computes that measure accuracy, in scenes whose every number is known."""

import numpy as np
import pytest

# A block of four points, from 1 to 2, mass 2, in free flight at speed 3.
FLIGHT = """
method(ulmpm, FLIP, linear, 1)
dimension(1, 0, 10, 0.5)
region(line, block, 1, 2)
material(rubber, linear, 2, 100, 0)
solid(body, region, line, 2, rubber, 0.5, 0)
fix(v, initial_velocity_particles, all, 3)
set_dt(0.01)
set_output(5)
{}
run(20)
"""
X0 = np.array([1.125, 1.375, 1.625, 1.875])


def fly(run, lines, status=0):
    return run(FLIGHT.format(lines), status=status)


def test_norms_of_an_error_that_is_known_at_every_point(run_interpreted):
    """The "exact solution" is off by x0: the norms are those of x0 over four equal points."""
    log = fly(
        run_interpreted,
        """
compute(one, error, all, ux, 3*time - x0, L1)
compute(two, error, all, ux, 3*time - x0)
compute(most, error, all, ux, 3*time - x0, max)
compute(share, error, all, x, 2*(x0 + 3*time), L1, relative)
compute(right, error, all, velocity, 3, relative)
log_modify(custom, time, one, two, most, share, right, two_history, two_max)
""",
    ).log
    assert log.one == pytest.approx(X0.mean(), rel=1e-9)
    assert log.two == pytest.approx(np.sqrt((X0**2).mean()), rel=1e-9)
    assert log.most == pytest.approx(X0.max(), rel=1e-9)
    assert log.share == pytest.approx(0.5, rel=1e-9)
    # Free flight is exact up to rounding.
    assert np.abs(log.right).max() < 1e-12
    assert log.two_history == pytest.approx(log.two[0], rel=1e-9)
    assert log.two_max == pytest.approx(log.two[0], rel=1e-9)


def test_exact_values_that_vanish_divide_by_the_largest_so_far(run_interpreted):
    """A velocity of 3 against 3 cos(5 pi t): 3 off where that is 0, over the 3 that it was."""
    lines = """
compute(swing, error, all, vx, 3*cos(5*PI*time), relative)
compute(never, error, all, vx, 0, relative)
set_output(10)
log_modify(custom, time, swing, swing_max, never)
"""
    log = fly(run_interpreted, lines).log
    assert log.Time == pytest.approx([0, 0.1, 0.2])
    assert log.swing == pytest.approx([0, 1, 2], abs=1e-9)
    assert log.swing_max == pytest.approx([0, 1, 2], abs=1e-9)
    assert np.isinf(log.never).all()


@pytest.mark.parametrize("every", [1, 20])
def test_a_history_weighs_time_and_not_outputs(run_interpreted, every):
    """Error 1 in the first half of the time and 0 in the second: sqrt(1/2), whatever the rhythm."""
    lines = f"""
compute(err, error, all, vx, 3 - (time < 0.105))
set_output({every})
log_modify(custom, time, err_history)
set_output(10)
run(10)
set_output({every})
"""
    log = fly(run_interpreted, lines).log
    last = log.err_history[-1]
    # 0.1 of 0.3 time units, as outputs stand for the time before them.
    assert last == pytest.approx(np.sqrt(1 / 3), rel=1e-9)


def test_tensors_and_relative_histories(run_interpreted):
    """Stress is zero in free flight; |e_ij e_ij| counts shear twice: sqrt(3^2 + 2 4^2)."""
    log = fly(
        run_interpreted,
        """
compute(s, error, all, stress, 3, NULL, NULL, 4)
compute(u, error, all, displacement, 6*time, relative)
log_modify(custom, time, s, u, u_history)
""",
    ).log
    assert log.s == pytest.approx(np.sqrt(41), rel=1e-9)
    # At time 0 both displacements vanish: no error.
    assert log.u[0] == 0 and log.u[1:] == pytest.approx(0.5, rel=1e-9)
    assert log.u_history[1:] == pytest.approx(0.5, rel=1e-9)


def test_the_error_of_a_deleted_point_is_gone(run_interpreted):
    """Beyond x = 10 points are deleted; the column of an error follows those that remain."""
    log = fly(
        run_interpreted,
        """
boundary(delete)
compute(err, error, all, x0, 0, L1)
log_modify(custom, time, err)
set_dt(0.01)
run(256)
""",
    ).log
    # At time 2.71 the first of four has left.
    assert set(np.round(log.err, 9)) == {X0.mean(), X0[:3].mean()}


def test_conserved_quantities_and_places(run_interpreted):
    log = fly(
        run_interpreted,
        """
compute(p, linear_momentum, all)
compute(c, center_of_mass, all)
compute(q, position_quantile, all, 0.5)
compute(E, energy_balance, all)
compute(W, energy_balance, all, 9*time)
log_modify(custom, time, p_x, p_drift, c_x, q_x, E, E_drift, W, W_drift)
""",
    ).log
    assert log.p_x == pytest.approx(6, rel=1e-12)  # 2 units of mass at speed 3
    assert log.c_x == pytest.approx(1.5 + 3 * log.Time, rel=1e-9)
    assert log.q_x == pytest.approx(X0[1] + 3 * log.Time, rel=1e-9)
    assert log["E"] == pytest.approx(9, rel=1e-12)
    assert max(np.abs(log.p_drift).max(), np.abs(log.E_drift).max()) < 1e-12
    # Work that is not there is missing: 9 t of 9.
    assert log["W"] == pytest.approx(9 - 9 * log.Time, rel=1e-9)
    assert log.W_drift == pytest.approx(log.Time, rel=1e-9)


def test_angular_momentum_drifts_only_under_a_brake(run_interpreted):
    scene = """
method(ulmpm, {}, linear)
dimension(2, -2, 2, -2, 2, 0.5)
region(disk, cylinder, 0, 0, 1)
material(rubber, linear, 1, 100, 0)
solid(disk, region, disk, 2, rubber, 0.5, 0)
fix(spin, initial_velocity_particles, all, -y0, x0)
{}
compute(L, angular_momentum, all)
set_dt(0.01)
log_modify(custom, time, L_z, L_drift)
run(10)
"""
    free = run_interpreted(scene.format("APIC", "")).log
    assert free.L_drift.max() < 1e-12  # what APIC conserves (Jiang et al. 2015)
    # Velocity is across the arm everywhere at first: the scale is the angular momentum itself.
    braked = run_interpreted(scene.format("PIC", "fix(b, body_force, all, 2*y, -2*x)")).log
    assert braked.L_drift == pytest.approx(1 - braked.L_z / braked.L_z[0], abs=1e-9)
    assert braked.L_drift[-1] > 0.1


def curve(folder, text):
    (folder / "run").mkdir(exist_ok=True)
    (folder / "run" / "curve.csv").write_text(text, encoding="utf-8")


def test_a_value_against_a_curve_over_time(run_interpreted, tmp_path):
    curve(tmp_path, "# measured\ntime, centre\n0, 1.4\n0.05, 1.55\n1, 4.4\n")
    log = fly(
        run_interpreted,
        """
compute(c, center_of_mass, all)
compute(r, reference, c_x, curve.csv, centre)
compute(m, reference, c_x, curve.csv, centre, max, relative)
log_modify(custom, time, r, r_now, r_curve, m)
""",
    ).log
    # The curve is 1.4 + 3 t: a tenth below the centre of mass, which is 1.5 + 3 t.
    assert log.r == pytest.approx(0.1, rel=1e-9)
    assert log.r_now == pytest.approx(0.1, rel=1e-9)
    assert log.r_curve == pytest.approx(1.4 + 3 * log.Time, rel=1e-9)
    assert log.m[-1] == pytest.approx(0.1 / (1.4 + 3 * log.Time[-1]), rel=1e-9)


def test_points_against_a_curve_over_a_coordinate(run_interpreted, tmp_path):
    curve(tmp_path, "x0 vx\n1.3 3\n2 3.7\n")
    log = fly(
        run_interpreted,
        "compute(r, reference, all, curve.csv, vx, max)\nlog_modify(custom, time, r, r_curve)",
    ).log
    # The first point lies before the curve begins; the others are off by x0 - 1.3.
    assert log.r == pytest.approx(1.875 - 1.3, rel=1e-9)
    assert log.r_curve == pytest.approx(3 + X0[1:].mean() - 1.3, rel=1e-9)


def test_a_condition_reads_an_error(run_interpreted):
    lines = "compute(err, error, all, ux, 0, max)\nlog_modify(custom, step, err)\n"
    log = fly(run_interpreted, lines + "run_until(err > 0.305)").log
    # 3 t > 0.305 is first true after 11 steps, and 20 follow.
    assert log.Step[-1] == 31


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("compute(e, error, all, vxx, 1)", "did you mean 'vx'?"),
        ("compute(e, error, all, velocity, 1, 2)", "2 formulas for velocity"),
        ("compute(e, error, all, vx, L2)", "0 formulas for vx"),
        ("compute(e, error, all, vx, 1, L2, max)", "both L2 and max"),
        ("compute(e, error, all, ep, 1)", "no material of the scene has it"),
        ("compute(r, reference, all, none.csv, vx)", "none.csv does not exist"),
        ("compute(r, reference, all, curve.csv, v)", "has no column 'v'"),
        ("compute(r, reference, all, curve.csv, centre)", "points have no column 'time'"),
        ("compute(r, reference, nothing, curve.csv, centre)", "unknown name 'nothing'"),
        ("compute(q, position_quantile, all, 1.5)", "from 0 to 1"),
    ],
)
def test_mistakes(run_interpreted, tmp_path, line, said):
    curve(tmp_path, "time, centre\n0, 1\n1, 2\n")
    assert said in fly(run_interpreted, line, status=1).err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no rows"),
        ("a b\n1 2\n3\n", "line 3"),
        ("a\n1\nx\n", "line 3"),
        ("0,1;2,5\n0,2;3,5\n", "expected: decimal points: 0.1;2.5"),
        ("# t, a\nt a\n0,1 -2,5\n", "line 3 of"),
    ],
)
def test_files_that_are_no_curves(run_interpreted, tmp_path, text, said):
    curve(tmp_path, text)
    result = fly(run_interpreted, "compute(r, reference, time, curve.csv, a)", status=1)
    assert said in result.err and "in.script:" in result.err
