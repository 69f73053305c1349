"""Fixes contact/hertz and contact/minimize_penetration: points of two solids push each other."""

import numpy as np
import pytest

from karamelo_py.kernels.pairs import Push, TwoBodies, cells_for, push_apart
from karamelo_py.points.bodies import MinimizePenetration
from karamelo_py.points.kinematics import KINEMATICS

H = 0.1
SPRINGS = "contact/minimize_penetration, a, b"
MINIMIZE = "contact/minimize_penetration, a, b, 0"


def bodies(gap: float, contact: str, *lines: str, d: int = 1, n: int = 4, v: float = 0.1,
           E: float = 100, ppc: int = 2, method: str = "tlmpm") -> str:  # fmt: skip
    """Two cubes of n cells per side, `gap` apart, that move towards each other at `v` each."""
    side = f", 0.5, {0.5 + n * H}" * (d - 1)
    zeros = ", 0" * (d - 1)
    a, b = 0.5 + n * H, 0.5 + n * H + gap
    return "\n".join([
        f"method({method}, FLIP, linear, 1)", f"dimension({d}{', 0, 2' * d}, {H})",
        f"region(a, block, 0.5, {a}{side})", f"region(b, block, {b}, {b + n * H}{side})",
        f"material(m, neo-hookean, 1, {E}, 0.3)",
        f"solid(a, region, a, {ppc}, m, {H}, 0)", f"solid(b, region, b, {ppc}, m, {H}, 0)",
        "group(a, particles, region, a, solid, a)", "group(b, particles, region, b, solid, b)",
        f"fix(v1, initial_velocity_particles, a, {v}{zeros})",
        f"fix(v2, initial_velocity_particles, b, {-v}{zeros})",
        f"fix(c, {contact})",
        "compute(va, average_velocity, a)", "compute(vb, average_velocity, b)",
        "compute(k, kinetic_energy, all)", "compute(e, strain_energy, all)", *lines,
    ])  # fmt: skip


# --- pairs ------------------------------------------------------------------------------------


def by_hand(d, x1, x2, r1, r2, reach, dt):
    """All pairs, one by one: forces of equal masses 1 without friction, and the number of pairs."""
    f1, f2, count = np.zeros_like(x1), np.zeros_like(x2), 0
    for i in range(len(x1)):
        for j in range(len(x2)):
            dx = x2[j] - x1[i]
            r = np.sqrt(dx @ dx)
            if r < r1[i] + r2[j] and np.abs(dx).max() < reach:
                f = 0.5 / dt**2 * (1 - (r1[i] + r2[j]) / r) * dx
                f1[i] += f
                f2[j] -= f
                count += 1
    return f1, f2, count


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("overlap", [0.05, 0.6, 1.0])
def test_no_pair_is_missed(d, overlap):
    """Clouds of random points with random radii, against all pairs one by one."""
    rng = np.random.default_rng(d)
    n, m = 150, 200
    x1, x2 = rng.random((n, d)), rng.random((m, d))
    x2[:, 0] += 1 - overlap
    spacing = n ** (-1 / d)
    r1, r2 = (spacing * (0.2 + 0.4 * rng.random(k)) for k in (n, m))
    bound = TwoBodies(
        x=np.concatenate([x1, x2]), v=np.zeros((n + m, d)), mass=np.ones(n + m),
        radius=np.concatenate([r1, r2]), force=np.zeros((n + m, d)), grip=np.zeros((n + m, 0)),
        face=np.zeros((n + m, 0)), first2=n,
    )  # fmt: skip
    cells = cells_for(n + m)._replace(start=np.zeros(100, np.int64))
    for reach in (spacing, 0.5 * spacing):
        bound.force[:] = 0
        law, kin = MinimizePenetration(0.0), KINEMATICS[d]()
        found = push_apart(Push(law, kin, reach, 0.1, 0.1, 0.1), bound, cells)
        f1, f2, count = by_hand(d, x1, x2, r1, r2, reach, 0.1)
        assert found == count > 0
        assert bound.force == pytest.approx(np.concatenate([f1, f2]), rel=1e-10, abs=1e-10)
        assert cells.total[:d] == pytest.approx(f1.sum(axis=0), rel=1e-10, abs=1e-10)


# --- forces of single points ------------------------------------------------------------------


def two_points(contact: str, d: int, *, other: float = 0) -> str:
    """A point per cell: cubes of one cell that overlap by 0.01 = p; R = 0.05 each."""
    dump = "dump(d, all, particle, 1, d.*.LAMMPS, x, bx, by, mass)"
    slip = f"fix(s, initial_velocity_particles, b, -0.1, {other}{', 0' * (d - 2)})" if d > 1 else ""
    log = "log_modify(custom, step, c_x, c_y)"
    return bodies(-0.01, contact, slip, dump, log, "set_dt(0.001)", "run(1)", d=d, n=1, ppc=1)


@pytest.mark.parametrize("d", [2, 3])
def test_force_of_hertz(run_interpreted, d):
    """E* = E / (2 (1 - nu^2)); pi/4 E* sqrt(R p^3) in the plane, 4/3 of it in space; R = 0.025."""
    log = run_interpreted(two_points("contact/hertz, a, b", d)).log
    force = 100 / (2 * (1 - 0.09)) * np.sqrt(0.025 * 0.01**3) * (np.pi / 4 if d == 2 else 4 / 3)
    assert log.c_x[-1] == pytest.approx(-force, rel=1e-8)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_force_of_minimize_penetration(run_interpreted, d):
    """m/2 p / dt^2 for equal masses."""
    result = run_interpreted(two_points(MINIMIZE, d))
    force = 0.5 * 0.1**d * 0.01 / 1e-6
    assert result.log.c_x[-1] == pytest.approx(-force, rel=1e-8)
    dump = result.dump("d.1.LAMMPS")
    assert dump.bx == pytest.approx([-force, force], rel=1e-8)
    assert "bx" not in result.err


def test_force_of_springs(run_interpreted):
    """m/2 rate p, as stiff as the step allows above a tenth of R1 + R2 = 0.1 (here above p).

    The rate is s (rho c^2/h) over m/2 per area; c^2 = (lambda + 2 G)/rho, R = h/2, rho = 1.
    """
    fast = 100 * 0.7 / (1.3 * 0.4)
    log = run_interpreted(two_points(f"{SPRINGS}, stiffness=0.5", 2)).log
    soft = 0.5 * 0.01 * 0.01 * 0.5 * 2 * fast / 0.01
    assert log.c_x[-1] == pytest.approx(-soft, rel=1e-8)
    deeper = two_points(f"{SPRINGS}, stiffness=0.5", 2).replace("0.59,", "0.57,")
    stiff = 0.5 * 0.01 * 0.02 / 1e-6 * (1 - 0.5 * 2 * fast * 1e-6 / 0.01)
    force = run_interpreted(deeper).log.c_x[-1]
    assert force == pytest.approx(-3 * soft - stiff, rel=1e-8)


def test_springs_are_not_stiffer_than_the_step_allows(run_interpreted):
    """Above m/2 p / dt^2, points that separate would gain or lose energy."""
    force = 0.5 * 0.01 * 0.01 / 1e-6
    log = run_interpreted(two_points(f"{SPRINGS}, stiffness=1e6", 2)).log
    assert log.c_x[-1] == pytest.approx(-force, rel=1e-8)


@pytest.mark.parametrize("second", ["minimize_penetration, b, a, 0.2", "hertz, a, b"])
def test_two_contacts_of_one_pair_are_refused(run_interpreted, second):
    """Their forces added up."""
    again = f"fix(again, contact/{second})\nrun(1)"
    text = two_points(MINIMIZE, 2).replace("run(1)", again)
    assert again in text
    error = run_interpreted(text, status=1).err
    assert "fix 'c' (line" in error
    assert "is the contact of 'a' and 'b' already" in error
    replaced = text.replace("fix(again", "fix(c")
    run_interpreted(replaced)


@pytest.mark.parametrize("slip, share", [(50, 0.2), (-50, -0.2), (0.5, 0.05)])
def test_friction_of_two_points(run_interpreted, slip, share):
    """mu times the force across, along the slip of the other; at most what stops it (m/2 v/dt)."""
    log = run_interpreted(two_points("contact/minimize_penetration, a, b, 0.2", 2, other=slip)).log
    assert log.c_y[-1] == pytest.approx(share * 0.5 * 0.01 * 0.01 / 1e-6, rel=1e-8)


# --- bodies -----------------------------------------------------------------------------------


FULL = pytest.mark.full


# The forces of pairs are looked at in every dimension above.
@pytest.mark.parametrize("d", [1, pytest.param(2, marks=FULL), pytest.param(3, marks=FULL)])
def test_collision(run_script, d):
    """Momentum is kept in every step, energy nearly; contact begins when the faces meet.

    Balls of half the edge of a point's domain touch when the domains do.
    """
    n = {1: 4, 2: 3, 3: 2}[d]
    lines = (
        "log_modify(custom, step, time, va_x, vb_x, k, e, c_x)", "dt_factor(0.4)",
        "set_output(1)", "run_time(0.6)" if d < 3 else "run_time(0.3)",
    )  # fmt: skip
    log = run_script(bodies(0.02, MINIMIZE, *lines, d=d, n=n)).log
    assert np.abs(log.va_x + log.vb_x).max() < 1e-15
    first = log.Time[np.flatnonzero(log.c_x)[0]]
    assert 0.1 <= first <= 0.1 + 2 * np.diff(log.Time).max()
    assert log.c_x.max() <= 0
    energy = log.k + log.e
    assert energy.max() < 1.02 * energy[0]
    if d < 3:
        assert energy[-1] > 0.7 * energy[0]
        assert log.va_x[-1] < -0.06
        assert log.c_x[-1] == 0


def test_springs_keep_energy(run_script):
    """Elastic bars part with the speeds at which they met, with any step.

    The surface nodes have a twelfth of the energy, most of which stiff contact takes.
    """
    kept = []
    for factor, more in ((0.3, ""), (0.3, ", stiffness=0.25"), (0.1, ", stiffness=0.25")):
        lines = ("log_modify(custom, step, time, va_x, vb_x, k, e)", f"dt_factor({factor})",
                 "set_output(1000)", "run_time(3)")  # fmt: skip
        log = run_script(bodies(0.02, SPRINGS + more, *lines, n=6, v=0.01)).log
        assert abs(log.va_x[-1] + log.vb_x[-1]) < 1e-15
        kept.append((log.k + log.e)[-1] / log.k[0])
    assert kept[0] < 0.95
    assert kept[1:] == pytest.approx([1, 1], abs=0.012)
    assert log.va_x[-1] == pytest.approx(-0.01, rel=0.03)


def test_hertz_collision(run_script):
    """Slow enough for the force of single points: the bodies bounce, and energy is kept."""
    lines = (
        "log_modify(custom, step, time, va_x, vb_x, k, e, c_x)", "dt_factor(0.4)",
        "set_output(5)", "run_time(2.7)",
    )  # fmt: skip
    log = run_script(bodies(0.02, "contact/hertz, a, b", *lines, n=2, v=0.01, E=100)).log
    assert np.abs(log.va_x + log.vb_x).max() < 1e-16
    assert log.va_x[-1] == pytest.approx(-0.01, rel=0.05)
    assert log.k[-1] + log.e[-1] == pytest.approx(log.k[0], rel=0.05)


def sliding(mu: float) -> str:
    """A block that slides on a base that is held, pressed on it by gravity (10)."""
    return f"""
        method(tlmpm, FLIP, linear, 0.99)
        dimension(2, 0, 4, 0, 1, 0.1)
        region(top, block, 0.5, 0.9, 0.3, 0.5)
        region(base, block, 0, 4, 0.1, 0.3)
        material(m, neo-hookean, 1, 1e4, 0.3)
        solid(top, region, top, 2, m, 0.1, 0)
        solid(base, region, base, 2, m, 0.1, 0)
        region(low, block, 0, 4, 0, 0.3)
        group(low, nodes, region, low, solid, base)
        group(top, particles, region, top, solid, top)
        fix(hold, velocity_nodes, low, 0, 0)
        fix(g, body_force, all, 0, -10)
        fix(v, initial_velocity_particles, top, 3, 0)
        fix(c, contact/minimize_penetration, top, base, {mu})
        compute(v, average_velocity, top)
        log_modify(custom, step, time, v_x, v_y, c_x, c_y)
        set_output(5)
        dt_factor(0.4)
        run_time(0.5)
    """


@pytest.mark.full
def test_sliding_block_slows_down(run_script):
    """Friction brakes by mu g, and balls that ride over balls by some more, without friction too.

    That drag is of the order of 0.1 g here.
    """
    braking = []
    for mu in (0, 0.3):
        log = run_script(sliding(mu)).log
        late = log.Time > 0.1
        braking.append(np.polyfit(log.Time[late], log.v_x[late], 1)[0])
        assert log.c_y[late].mean() == pytest.approx(0.08 * 10, rel=0.1)
    assert -2 < braking[0] < 0
    assert braking[1] - braking[0] == pytest.approx(-3, rel=0.1)


def test_two_contacts_add_up(run_interpreted):
    """Each of two solids at one place pushes the third, and each fix publishes its force."""
    log = "log_modify(custom, step, c_x, c2_x, va_x)"
    twin = ("solid(b2, region, b, 1, m, 0.1)", f"fix(c2, {MINIMIZE.replace('b', 'b2')})")
    once = ("set_dt(0.001)", log, "run(1)")
    one = run_interpreted(bodies(-0.01, MINIMIZE, *twin, *once, n=1, ppc=1)).log
    assert one.c_x[-1] == one.c2_x[-1] == pytest.approx(-0.05 * 0.01 / 1e-6, rel=1e-8)
    assert one.va_x[-1] == pytest.approx(0.1 + 2 * one.c_x[-1] / 0.1 * 0.001, rel=1e-8)


def test_forces_end_with_the_fix(run_interpreted):
    lines = (
        "set_dt(1e-4)", "log_modify(custom, step, va_x)", "run(1)", "delete_fix(c)", "run(3)",
    )  # fmt: skip
    log = run_interpreted(bodies(-0.01, MINIMIZE, *lines, n=1, ppc=1)).log
    assert log.va_x[1] != log.va_x[0]
    assert log.va_x[-1] == log.va_x[2]


# --- messages ---------------------------------------------------------------------------------

MESSAGES = {
    "named twice": ("contact/hertz, a, a", "'a' is named twice"),
    "negative": ("contact/minimize_penetration, a, b, -0.1", "-0.1"),
    "unknown": ("contact/minimize_penetration, a, c, 0", "unknown solid 'c'"),
}


@pytest.mark.parametrize("contact, said", MESSAGES.values(), ids=MESSAGES)
def test_messages(run_interpreted, contact, said):
    assert said in run_interpreted(bodies(0, contact, "run(1)"), status=1).err


@pytest.mark.parametrize("method", ["ulmpm", "ulmpm/contacts"])
def test_shared_grids_are_a_warning(run_interpreted, method):
    script = bodies(0.1, MINIMIZE, "log_modify(custom, step)", "run(1)", method=method)
    assert "in contact there already" in run_interpreted(script).err


def test_solids_without_contact_are_told(run_interpreted):
    """Bodies of total Lagrangian methods pass through each other, unless a fix says otherwise."""
    script = """
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 4, 0, 1, 1)
    region(left, block, 0, 1, 0, 1)
    region(right, block, 2, 3, 0, 1)
    material(m, linear, 1, 1, 0.3)
    solid(a, region, left, 1, m, 1, 0)
    solid(b, region, right, 1, m, 1, 0)
    set_dt(0.1)
    {}
    run(1)
    run(1)
    """
    said = run_interpreted(script.format("")).err
    assert said.count("pass through each other: a, b") == 1
    said = run_interpreted(script.format("fix(c, contact/minimize_penetration, a, b, 0)")).err
    assert "pass through" not in said


@pytest.mark.parametrize(("mu", "told"), [("", 0), (", 0", 1), (", 0.3", 1), (", 1", 1)])
def test_friction_that_balls_cannot_give_is_told(run_interpreted, mu, told):
    """Of `sliding`: braked by 0.19, 0.49, 0.53, 0.46 of the weight with mu 0, 0.3, 0.5, 1."""
    script = sliding(0.5).replace("run_time(0.5)", "run(0)").replace("base, 0.5)", f"base{mu})")
    assert run_interpreted(script).err.count("surfaces of balls slow") == told
