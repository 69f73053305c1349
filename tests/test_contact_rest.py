"""Bodies resting in contact stay at rest whatever the time step, and hold loads below friction."""

import numpy as np
import pytest

WEIGHT = 1000 * 0.2 * 0.1 * 10
BASE = """
    base = 0.2
    method({method})
    dimension(2, 0, 1, 0, 1, 0.1)
    region(b, block, 0.4, 0.6, base, base + 0.1)
    region(q, block, 0.3, 0.7, 0.1, base)
    material(soft, linear, 1000, 1e5, 0.3)
    material(stiff, linear, 1000, 1e5, 0.3)
    solid(b, region, b, 2, soft, 0.1)
    {more}
    fix(weight, body_force, all, 0, -10*min(time/0.1, 1))
    fix(w, {fix})
    fix(calm, local_damping, all, 0.8*(time < 0.5))
    compute(Ek, kinetic_energy, all)
    set_output(1)
    log_modify(custom, step, dt, time, w_x, w_y, Ek)
"""
HELD = "solid(q, region, q, 2, stiff, 0.1)\nregion(low, block, -INF, INF, -INF, 0.1)\n"
HELD += "group(low, nodes, region, low, all)\nfix(hold, velocity_nodes, low, 0, 0)"
TOTAL, UPDATED = "tlmpm, FLIP, linear, 0.99", "ulmpm, TPIC, quadratic-spline"
KINDS = {
    "surface": (TOTAL, "contact/surface, all, q, 0.3"),
    "surface-updated": (UPDATED, "contact/surface, all, q"),
    "plane": (TOTAL, "contact/minimize_penetration/plane, b, 0, base, 0, 0, 1, 0, 0.3"),
    "ball": (TOTAL, "indent/minimize_penetration, all, sphere, 5, 0.5, -4.8, 0, 0, 0, 0, 0"),
    "points": (TOTAL, "contact/minimize_penetration, b, q", HELD),
}
ROUGH = {
    "surface": (TOTAL, "contact/surface, all, q, 0.25"),
    "surface-updated": (UPDATED, "contact/surface, all, q, 0.25"),
    "plane": (TOTAL, "contact/minimize_penetration/plane, b, 0, base, 0, 0, 1, 0, 0.25"),
    "ball": (TOTAL, "indent/minimize_penetration, all, sphere, 5, 0.5, -4.8, 0, 0, 0, 0, 0.25"),
    "points": (TOTAL, "contact/minimize_penetration, b, q, 0.25", HELD),
}


def scene(kind: str, *lines: str, kinds: dict = KINDS) -> str:
    method, fix, *more = kinds[kind]
    return BASE.format(method=method, fix=fix, more="".join(more)) + "\n".join(lines)


@pytest.mark.parametrize("kind", KINDS)
def test_a_shortened_step_leaves_bodies_at_rest(run_interpreted, kind):
    """The last two steps of run_time are shortened: the contact force stays constant within 5 %.

    The block of the surface in ulmpm still vibrates by 2.5 %, since that contact hardly damps.
    With contact as stiff as the shortened step allows, the block was thrown up by up to twice its
    weight.
    """
    log = run_interpreted(scene(kind, "run_time(0.6)", *["run_time(0.0113)"] * 3)).log
    short = log.dt < 0.97 * np.median(log.dt)
    assert short[-8:].any()
    before = (log.Time > 0.5) & (log.Time < log.Time[short & (log.Time > 0.5)][0])
    after = log.Time >= log.Time[before][-1]
    assert log.w_y[after] == pytest.approx(log.w_y[before][-1], rel=0.05)
    assert log.w_y[after] == pytest.approx(WEIGHT, rel=0.03)
    assert log.Ek[after].max() <= log.Ek[before].max()


@pytest.mark.parametrize("kind", ["surface", "plane"])
def test_a_smaller_step_leaves_bodies_at_rest(run_interpreted, kind):
    """At half the step contact becomes four times as stiff, gradually: the force stays the weight.

    If it did so at once, the force would be four times the weight. The tolerance of a tenth covers
    remaining oscillation, whose period on the softest contact is 40 steps.
    """
    text = scene(kind, "set_dt(0.004)", "run(70)", "set_dt(0.002)", "run(70)")
    log = run_interpreted(text.replace("time < 0.5", "time < 0.2")).log
    after = log.Step >= 70
    assert log.w_y[after] == pytest.approx(WEIGHT, rel=0.1)


PULL = "\n".join([
    "region(up, block, -INF, INF, base, INF)", "group(b, particles, region, up, all)",
    "compute(c, center_of_mass, b)", "log_modify(custom, step, dt, time, w_x, w_y, c_x)",
    "fix(pull, force_particles, b, 0.2*20*10*min(time/0.2, 1), NULL)",
])  # fmt: skip


@pytest.mark.parametrize("kind", ROUGH)
def test_friction_holds_what_it_can(run_interpreted, kind):
    """A block pulled by 0.2 of its weight with mu = 0.25 rests, and friction balances the pull.

    Friction that only cancels the present slip of a point lets the block creep: by 2 m/s^2 times
    the time step and the number of rows of points above the contact, 0.03 m/s here.
    """
    log = run_interpreted(scene(kind, PULL, "run_time(0.65)", kinds=ROUGH)).log
    late = log.Time > 0.4
    assert log.c_x[late].max() - log.c_x[late].min() < 0.01 * 0.1
    assert log.w_x[late].mean() == pytest.approx(-0.2 * WEIGHT, rel=0.05)
    assert log.c_x[-1] - log.c_x[0] < 0.05 * 0.1


FADES = "-10*max(exp(-max(time - 0.1, 0)/0.1)*min(time/0.1, 1) - 0.02, 0)"
SLIDES = "fix(start, initial_velocity_particles, all, 0.7, 0)"


@pytest.mark.parametrize("kind", ["surface", "ball"])
def test_friction_ends_with_its_load(run_interpreted, kind):
    """A block slides while its weight fades, then moves on at constant speed along the surface.

    On a ball, sums slightly below 0 from rounding once let friction accelerate it without limit.
    """
    text = scene(kind, SLIDES, "run_time(1)", kinds=ROUGH)
    text = text.replace("-10*min(time/0.1, 1)", FADES).replace("0.8*(time < 0.5)", "0")
    log = run_interpreted(text).log
    late = log.Time > 0.7
    assert not log.w_x[late].any()
    assert log.Ek[late].max() < 1.01 * log.Ek[late][0]
    if kind == "surface":  # the top of the ball leans
        pushed, rubbed = (np.dot(force[1:], np.diff(log.Time)) for force in (log.w_y, log.w_x))
        assert rubbed == pytest.approx(-0.25 * pushed, rel=0.01)
