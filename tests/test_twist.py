"""Axisymmetric bodies that twist, against closed forms. Points carry one radian."""

import numpy as np
import pytest
from going_on import goes_on, with_files
from scipy.special import j0, j1, jn_zeros

from karamelo_py.points.kinematics import I, Space, det
from karamelo_py.points.kinematics.twist import Twisted

LINEAR = "linear, 1, 100, 0.3"
RUBBER = "neo-hookean, 1, 100, 0.3"
TOTAL, SPLINES = "tlmpm, FLIP, linear, 1", "ulmpm, FLIP, quadratic-spline, 1"


def bar(speed, *, method=TOTAL, scheme="musl", law=RUBBER, n=4, size=(1, 1), more=""):
    """A bar of radius and height `size` with the velocity `speed` around the axis; with `n` cells
    in a length of 1."""
    R, height = size
    return f"""
    method({method})
    scheme({scheme})
    dimension(2, 0, {R}, 0, {height}, 1/{n})
    axisymmetric(true, twist=true)
    material(m, {law})
    region(all, block, 0, {R}, 0, {height})
    solid(bar, region, all, 2, m, 1/{n}, 0)
    group(bar, particles, region, all, solid, bar)
    group(nodes, nodes, region, all, all)
    region(low, block, -INF, INF, 0, 0)
    region(high, block, -INF, INF, {height}, {height})
    group(low, nodes, region, low, all)
    group(high, nodes, region, high, all)
    fix(v, initial_velocity_particles, bar, 0, 0, {speed})
    compute(Ek, kinetic_energy, bar)
    compute(Es, strain_energy, bar)
    compute(L, angular_momentum, bar)
    log_modify(custom, time, Ek, Es, L_y, L_drift)
    {more}
"""


def test_tensors_are_those_of_space_in_another_order():
    """Products, determinants, strains and nominal stresses, but for what acts on the radius."""
    rng, kin, space = np.random.default_rng(3), Twisted(), Space()

    def there(a):
        return space.Tensor._make([a.at()[place] for place in space.Tensor.places])

    def some():
        noise = [0 if i < 2 and j == 2 else rng.normal() / 9 for i, j in kin.Tensor.places]
        return kin.Tensor._make(noise) + I

    a, b = some(), some()
    assert there(a @ b) == pytest.approx(there(a) @ there(b), rel=1e-12)
    assert det(a) == pytest.approx(det(there(a)), rel=1e-12)
    C = a.right_cauchy_green()
    assert tuple(C) == pytest.approx(there(a).right_cauchy_green(), rel=1e-12)
    P, Q = C.nominal(a).at(), space.Symmetric._make(C).nominal(there(a)).at()
    hoop, F = P.pop((2, 2)), a.at()
    assert [*P.values()] == pytest.approx([Q[place] for place in P], rel=1e-12)
    assert hoop * F[2, 2] == pytest.approx(sum(Q[2, k] * F[2, k] for k in range(3)), rel=1e-12)


@pytest.mark.parametrize("spin", [0, 100])
@pytest.mark.parametrize("method", [TOTAL, "ulmpm, APIC, quadratic-spline"])
def test_a_rubber_cylinder_twists(run_interpreted, method, spin):
    """Simple torsion of a neo-Hookean cylinder (Rivlin 1948): G psi r in 23, G psi^2 r^2 in 33.

    No stress follows from the rotation of the whole, by 3 radians in a step.
    """
    rotation = f"x*(2*y + {spin})"
    log = run_interpreted(bar(rotation, method=method, n=2, more=f"""
    fix(held, velocity_nodes, nodes, 0, 0)
    fix(turn, angular_velocity_nodes, nodes, 2*y0 + {spin})
    compute(a, average_stress, bar)
    log_modify(custom, time, Es, a_11, a_22, a_33, a_12, a_13, a_23)
    run_time(0.2)""")).log  # fmt: skip
    G, psi, r = 100 / 2.6, 0.4, (np.arange(4) + 0.5) / 4
    hoop, shear = (np.average((psi * r) ** n, weights=r) for n in (2, 1))
    exact = (0, 0, G * hoop, 0, 0, G * shear)
    found = [log[f"a_{ij}"][-1] for ij in ("11", "22", "33", "12", "13", "23")]
    assert found == pytest.approx(exact, rel=1e-6, abs=1e-8)
    assert log["Es"][-1] == pytest.approx(G / 2 * psi**2 * (r**3).mean(), rel=1e-6)


@pytest.mark.parametrize(
    ("method", "scheme"),
    [(TOTAL, "musl"), (SPLINES, "usf"), ("ulmpm, FLIP, cpgimp, 1", "usavg"), (TOTAL, "usl"),
     ("tlmpm, AFLIP, quadratic-spline, 1", "musl"), ("tlmpm, TFLIP, quadratic-spline, 1", "musl")],
)  # fmt: skip
def test_waves_of_torsion_have_the_speed_of_shear(run_interpreted, method, scheme):
    """sqrt(G/rho) in round bars (Kolsky 1963, section 15): after a quarter of the free period
    2 L / c the energy of the first mode, a third, is stored; the rest rotates."""
    wave = "run_time(0.5/sqrt(100/2.6))"
    speed, size = "0.01*x*(1 + cos(PI*y))", (0.125, 1)
    script = bar(speed, method=method, scheme=scheme, law=LINEAR, n=8, size=size, more=wave)
    log = run_interpreted(script.replace("2, 0, 0.125, 0, 1,", "2, 0, 0.5, -0.25, 1.25,")).log
    assert log["Es"][-1] == pytest.approx(log["Ek"][0] / 3, rel=0.08)
    assert log["Ek"][-1] == pytest.approx(log["Ek"][0] * 2 / 3, rel=0.02)
    assert log["L_drift"][-1] < 1e-14


def test_a_plastic_bar_twists(run_interpreted):
    """Nadai 1923: k R^3/3 (1 - (c/R)^3/4) per radian, elastic up to the radius c = k / (G psi)."""
    log = run_interpreted(bar("0.02*x*y", n=4, size=(1, 0.25), more="""
    fix(low, velocity_nodes, low, NULL, 0)
    fix(high, velocity_nodes, high, NULL, 0)
    fix(hold, angular_velocity_nodes, low, 0)
    fix(turn, angular_velocity_nodes, high, 0.005)
    log_modify(custom, time, turn_s, hold_s, Ek, Es)
    log(1)
    run_time(0.1875)""").replace(
        "material(m, neo-hookean, 1, 100, 0.3)",
        "eos(e, linear, 1, 100)\nstrength(s, plastic, 100, sqrt(3)*0.1)\n"
        "material(m, eos-strength, e, s)",
    )).log  # fmt: skip
    k, c = 0.1, np.minimum(1, 1 / (20 * log["Time"][4:-1]))  # forces act at the last time
    elastic = k / 4 * 20 * log["Time"][4:-1]
    exact = np.where(c < 1, k / 3 * (1 - c**3 / 4), elastic)
    assert log["turn_s"][5:] == pytest.approx(exact, rel=0.02)
    assert log["turn_s"][-1] == pytest.approx(k / 3, rel=0.01)
    assert log["hold_s"][-1] == pytest.approx(-log["turn_s"][-1], rel=1e-3)


SPIN_UP = """
    method(ulmpm, APIC, linear)
    dimension(2, 0, 1, 0, 1/8, 1/8)
    axisymmetric(true, twist=true)
    eos(e, fluid, 1, 25, 7)
    strength(s, fluid, 0.1)
    material(m, eos-strength, e, s)
    region(all, block, 0, 1, 0, 1/8)
    solid(water, region, all, 2, m, 1/8)
    region(wall, block, 1, 1, -INF, INF)
    region(low, block, -INF, INF, 0, 0)
    region(high, block, -INF, INF, 1/8, 1/8)
    group(wall, nodes, region, wall, all)
    group(low, nodes, region, low, all)
    group(high, nodes, region, high, all)
    fix(low, velocity_nodes, low, NULL, 0)
    fix(high, velocity_nodes, high, NULL, 0)
    fix(wall, velocity_nodes, wall, 0, NULL)
    fix(turn, angular_velocity_nodes, wall, 1)
    compute(L, angular_momentum, all)
    log_modify(custom, time, L_y)
    run_time(0.25)
"""


def test_a_viscous_fluid_spins_up(state_interpreted):
    """In a cylinder that rotates suddenly (Batchelor 1967, section 4.5)."""
    state = state_interpreted(SPIN_UP, "x", "vtheta")
    r, z = state["x"], jn_zeros(1, 20)[:, None]
    exact = r + 2 * (j1(z * r) / (z * j0(z)) * np.exp(-(z**2) * 0.1 * 0.25)).sum(axis=0)
    error = np.sqrt(np.average((state["vtheta"] - exact) ** 2, weights=r))
    assert error < 0.06 * np.sqrt(np.average(exact**2, weights=r))


def test_a_ring_spins(run_interpreted):
    """Let go at rho w^2 R^2 / E << 1, a thin ring swings between R and R + 2 rho w^2 R^3 / E, with
    the frequency sqrt(E/rho)/R (Timoshenko & Goodier 1970, section 32)."""
    log = run_interpreted("""
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 9.5, 10.5, 0, 0.5, 0.5)
    axisymmetric(true, twist=true)
    material(m, linear, 1, 1000, 0)
    region(ring, block, 9.5, 10, 0, 0.5)
    solid(ring, region, ring, 2, m, 0.5, 0)
    fix(v, initial_velocity_particles, all, 0, 0, 0.1*x)
    compute(c, center_of_mass, all)
    compute(L, angular_momentum, all)
    log_modify(custom, time, c_x, L_drift)
    run_time(PI*9.75/sqrt(1000))
""").log  # fmt: skip
    R = log["c_x"][0]
    ratio = 1000 / R**2 / 0.1**2  # of the squares of both frequencies; Coriolis' force stiffens it
    assert log["c_x"][-1] - R == pytest.approx(2 * R / (ratio + 3), rel=0.01)
    assert log["L_drift"][-1] < 1e-13


@pytest.mark.full
def test_large_vibrations_conserve_energy(run_script):
    """2000 steps with shears of 0.3, and the radial vibrations that follow."""
    log = run_script(bar("x*(1 + 2*cos(PI*y))", n=8, more="run(2000)")).log
    assert log["Ek"][-1] + log["Es"][-1] == pytest.approx(log["Ek"][0], rel=0.02)
    assert log["L_drift"][-1] < 1e-14


TWISTED = bar("x*(1 + cos(PI*y))", n=2, method="ulmpm, AFLIP, quadratic-spline, 0.99", more="""
    anti_volumetric_locking(true)
    fix(turn, angular_velocity_nodes, low, 0.5*time)
    run(5)""").replace("2, 0, 1, 0, 1,", "2, 0, 2, 0, 2,")  # fmt: skip


def test_processes_and_restarts_have_the_same_bits(state_interpreted, run_interpreted):
    columns = "x", "v", "vtheta", "twist", "s23"
    whole = state_interpreted(TWISTED, *columns, boxes=True)
    assert np.abs(whole["s23"]).max() > 1 and np.abs(whole["twist"]).max() > 0.05
    other = state_interpreted(TWISTED, *columns, boxes=True, ranks=2)
    assert all(np.array_equal(whole[name], other[name]) for name in whole)
    goes_on(run_interpreted, with_files(TWISTED))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("axisymmetric(true", "axisymmetric(false"), "only a body of revolution can twist"),
        (("dimension(2, 0, 2, 0, 2,", "dimension(3, 0, 2, 0, 2, 0, 2,"), "two dimensions"),
        (("musl", "quasi-static"), "twist=true does not support scheme quasi-static"),
        (("method(ulmpm, AFLIP", "method(ulmpm/contacts, AFLIP"), "does not support method"),
        (("method(ulmpm, AFLIP, quadratic-spline, 0.99", "method(ulmpm, XPIC, linear, 2"), "XPIC"),
        (("axisymmetric(true, twist=true)", "axisymmetric(true)"), "nothing rotates"),
        (("    run", "    fix(w, velocity_nodes, high, NULL, 0, mu=0.1)\n    run"), "friction"),
    ],
)
def test_what_cannot_twist_is_refused(run_interpreted, change, says):
    err = run_interpreted(TWISTED.replace(*change), status=1).err
    assert says in err and err.count("error:") <= 2
