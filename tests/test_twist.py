"""Axisymmetric bodies that twist, against closed forms. Points carry one radian."""

import numpy as np
import pytest
from going_on import goes_on, with_files
from scipy.special import j0, j1, jn_zeros
from selection import parameters

from comparisons.results import read_log
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
    parameters(
        [(TOTAL, "usl"), (SPLINES, "usf"), ("ulmpm, FLIP, cpgimp, 1", "usavg"),
         ("tlmpm, AFLIP, quadratic-spline, 1", "musl"),
         ("ulmpm, PolyPIC/quadratic, cubic-spline", "musl")],
        [(TOTAL, "musl"), ("tlmpm, TFLIP, quadratic-spline, 1", "musl")],
    ),
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


LOADED = """
    fix(low, velocity_nodes, low, NULL, 0)
    fix(high, velocity_nodes, high, NULL, 0)
    fix(hold, angular_velocity_nodes, low, 0)
    fix(turn, angular_velocity_nodes, high, 0.005)
    log_modify(custom, time, turn_s, hold_s, iterations)
    log(1)
    set_dt(0.0625)
    run(4)
"""


@pytest.mark.parametrize(
    "method", [TOTAL, "ulmpm, FLIP, quadratic-spline, 1)\nanti_volumetric_locking(true"]
)
def test_a_plastic_bar_twists_in_load_steps(run_interpreted, method):
    """Nadai 1923, as above; the elastic step k r^2 beyond the yield stress ends on it."""
    script = bar(0, method=method, scheme="quasi-static", size=(1, 0.25), more=LOADED)
    script = script.replace(
        "material(m, neo-hookean, 1, 100, 0.3)",
        "eos(e, linear, 1, 100)\nstrength(s, plastic, 100, sqrt(3)*0.1)\n"
        "material(m, eos-strength, e, s)",
    )
    log = run_interpreted(
        script.replace("fix(v, initial_velocity_particles, bar, 0, 0, 0)", "")
    ).log
    k, c = 0.1, 1 / (20 * log["Time"][1:])
    assert log["turn_s"][1:] == pytest.approx(k / 3 * (1 - c**3 / 4), rel=0.005)
    assert log["hold_s"][1:] == pytest.approx(-log["turn_s"][1:], rel=1e-9)
    assert log["iterations"].max() <= 3


def test_rubber_twists_in_large_load_steps(run_interpreted):
    """A neo-Hookean bar that is free to shorten and bulge (Rivlin 1948): by 0.5 radians in one step
    as in two, to round-off."""
    found = {}
    for steps in (1, 2):
        script = bar(0, scheme="quasi-static, stabilisation=0", n=2, size=(1, 0.5), more=f"""
        fix(low, velocity_nodes, low, 0, 0)
        fix(hold, angular_velocity_nodes, low, 0)
        fix(turn, angular_velocity_nodes, high, 0.5)
        log_modify(custom, turn_s, Es, iterations)
        set_dt({1 / steps})
        run({steps})""")  # fmt: skip
        script = script.replace("fix(v, initial_velocity_particles, bar, 0, 0, 0)", "")
        found[steps] = run_interpreted(script, folder=f"run{steps}").log
    assert found[1]["turn_s"][-1] == pytest.approx(found[2]["turn_s"][-1], rel=1e-9)
    assert found[1]["Es"][-1] == pytest.approx(found[2]["Es"][-1], rel=1e-9)
    assert found[1]["turn_s"][-1] == pytest.approx(100 / 2.6 / 4, rel=0.2)
    assert found[1]["iterations"][-1] < 8


DISKS = """
    method(ulmpm/contacts, FLIP, linear, 1)
    dimension(2, 0, 1.5, -0.5, 1, 0.25)
    axisymmetric(true, twist=true)
    material(m, neo-hookean, 1, 100, 0)
    region(low, block, 0, 1, 0, 0.25)
    region(high, block, 0, 1, 0.25, 0.5)
    solid(low, region, low, 2, m, 0.25)
    solid(high, region, high, 2, m, 0.25)
    group(upper, particles, region, high, solid, high)
    fix(v, initial_velocity_particles, upper, 0, -0.5, x0)
    fix(rub, contact/friction, low, high, {mu})
    compute(L, angular_momentum, all)
    compute(U, angular_momentum, upper)
    compute(Ek, kinetic_energy, all)
    compute(Es, strain_energy, all)
    log_modify(custom, L_y, L_drift, U_y, Ek, Es, ContactTorque_high_y, ContactTorque_low_y,
               ContactForce_high_y)
    {more}
    log(1)
    run(10)
"""


def test_a_disk_rubs_on_a_disk_that_spins(run_interpreted):
    """Torque 2/3 mu N R of a disk under uniform pressure, with opposite torques on both."""
    log = run_interpreted(DISKS.format(mu=0.3, more="")).log
    torque, force = log["ContactTorque_high_y"][1:3], log["ContactForce_high_y"][1:3]
    assert torque == pytest.approx(-2 / 3 * 0.3 * force, rel=0.01)
    assert log["ContactTorque_low_y"] == pytest.approx(-log["ContactTorque_high_y"], rel=1e-12)
    assert log["L_drift"][-1] < 1e-14
    assert abs(log["U_y"][-1]) < 0.9 * abs(log["U_y"][0])
    assert log["Ek"][-1] + log["Es"][-1] < log["Ek"][0]


def test_disks_that_stick_spin_together(run_interpreted):
    log = run_interpreted(DISKS.format(mu="no-slip", more="")).log
    assert log["U_y"][-1] == pytest.approx(log["L_y"][-1] / 2, rel=0.15)
    assert log["L_drift"][-1] < 1e-14
    assert log["Ek"][-1] + log["Es"][-1] < log["Ek"][0]


def test_contact_leaves_nodes_that_are_held_around_the_axis(run_interpreted):
    """Their reaction takes the torque of friction, and no more: the disk below is at rest."""
    hold = """region(held, block, -INF, INF, -INF, INF)
    group(held, nodes, region, held, solid, low)
    fix(held, angular_velocity_nodes, held, 0)
    log_modify(custom, L_y, U_y, held_s, ContactTorque_low_y)"""
    log = run_interpreted(DISKS.format(mu=0.3, more=hold)).log
    assert log["ContactTorque_low_y"][1] > 0.01
    assert log["held_s"][1:] == pytest.approx(-log["ContactTorque_low_y"][1:], rel=1e-9, abs=1e-9)
    assert log["U_y"] == pytest.approx(log["L_y"], rel=1e-12)


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
    fix(push, body_force, all, 0, 0, x0)
    fix(share, force_nodes, high, 0, 0, time)
    fix(edge, edge_traction, bar, all, xhi, 0, 0, 0.1)
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
        (("dimension(2, 0, 2, 0, 2,", "dimension(3, 0, 2, 0, 2, 0, 2,"), "must have two"),
        (
            (
                "AFLIP, quadratic-spline, 0.99)\n    scheme(musl",
                "FLIP, linear, 1)\n    set_dt(1)\n    scheme(newmark",
            ),
            "has no inertia of rotation around an axis",
        ),
        (
            (
                "method(ulmpm, AFLIP, quadratic-spline, 0.99)\n    scheme(musl)",
                "method(ulmpm/contacts, FLIP, quadratic-spline, 0.99)\n    scheme(quasi-static)",
            ),
            "does not support contact with friction and twist=true",
        ),
        (
            (
                "    run",
                "    region(r, block, 0, 1, -1, 0)\n    fix(w, contact/surface, bar, r)\n    run",
            ),
            "does not support fix contact/surface",
        ),
        (("method(ulmpm, AFLIP, quadratic-spline, 0.99", "method(ulmpm, XPIC, linear, 2"), "XPIC"),
        (("axisymmetric(true, twist=true)", "axisymmetric(true)"), "nothing rotates"),
        (("    run", "    fix(w, velocity_nodes, high, NULL, 0, mu=0.1)\n    run"), "friction"),
    ],
)
def test_what_cannot_twist_is_refused(run_interpreted, change, says):
    err = run_interpreted(TWISTED.replace(*change), status=1).err
    assert says in err and err.count("error:") <= 2


STRESS = "s11, s22, s33, s12, s13, s23"
DUMPS = f"""
    log_modify(custom, time)
    dump(flat, all, particle, 100, flat.*.LAMMPS, x, y, twist, vtheta, vx, vy, {STRESS})
    dump(w, all, particle, 100, whole.*.LAMMPS, x, y, z, x0, z0, vx, vy, vz, {STRESS}, revolve=8)
    dump(vtk, all, vtk, 100, whole.*.vtu, vx, vz, s11, revolve=8)
    run(5)"""


def test_dumps_revolve_twisted_bodies(run_interpreted):
    """Lengths, speeds and invariants of stress are those of the half plane; angles are twists."""
    result = run_interpreted(bar("x*(1 + cos(PI*y))", n=2, more=DUMPS))
    flat, whole = (result.snapshots(name)[-1] for name in ("flat", "whole"))
    n = len(flat.x)
    assert len(whole.x) == 8 * n and len(set(whole.id)) == 8 * n
    r, speed = np.hypot(whole.x, whole.z), whole.vx**2 + whole.vy**2 + whole.vz**2
    assert r.reshape(8, n) == pytest.approx(np.tile(flat.x, (8, 1)), rel=1e-7)
    square = flat.vx**2 + flat.vy**2 + flat.vtheta**2
    assert speed.reshape(8, n) == pytest.approx(np.tile(square, (8, 1)), rel=1e-6)
    turned = np.arctan2(whole.z, whole.x) - np.arctan2(whole.z0, whole.x0)
    off = np.angle(np.exp(1j * (turned.reshape(8, n) - flat.twist)))
    assert abs(off).max() < 1e-6 < abs(flat.twist).max()

    def stress(t):
        rows = (t.s11, t.s12, t.s13), (t.s12, t.s22, t.s23), (t.s13, t.s23, t.s33)
        return np.array(rows).transpose(2, 0, 1)

    assert abs(flat.s23).max() > 0.1
    values = np.linalg.eigvalsh(stress(whole)).reshape(8, n, 3)
    assert values == pytest.approx(np.tile(np.linalg.eigvalsh(stress(flat)), (8, 1, 1)), abs=1e-4)
    # The shear acts around the axis: along (-z, x).
    s = stress(whole)
    around = np.stack([-whole.z / r, 0 * r, whole.x / r], axis=1)
    shear = np.einsum("ni,nij->nj", around, s)[:, 1]
    assert shear.reshape(8, n) == pytest.approx(np.tile(flat.s23, (8, 1)), abs=1e-4)


def test_copies_around_no_axis_are_refused(run_interpreted):
    script = TWISTED.replace("axisymmetric(true, twist=true)", "")
    begin = script.index("solid(bar")
    dump = "dump(d, all, particle, 100, d.*.LAMMPS, x, revolve=8)"
    err = run_interpreted(f"{script[:begin]}{dump}", status=1).err
    assert "only bodies of revolution in 2D have copies around an axis" in err


# --- torques --------------------------------------------------------------------------------------

# Torques of a total force of 0.02 at the mean radius 2/3 of mass, and at 9 of 15 nodes; of an
# acceleration of 0.01, of a shear stress of 0.01 on the surface of the bar.
TORQUES = {
    "force_particles, bar, 0, 0, 0.02": 0.02 * 2 / 3,
    "force_nodes, nodes, 0, 0, 0.02": 0.01,
    "body_force, all, 0, 0, 0.01": 0.01 / 3,
    "edge_traction, bar, all, xhi, 0, 0, 0.01": 0.01,
}


@pytest.mark.parametrize(("load", "torque"), TORQUES.items())
def test_torque_times_time_is_angular_momentum(state_interpreted, tmp_path, load, torque):
    """And the work of the torque is the energy of a free bar."""
    script = bar("0", law=LINEAR, n=2, more=f"""
    fix(load, {load})
    set_dt(0.02)
    log_modify(custom, Ek, Es, L_y, load_z)
    log(1)
    run(10)""")  # fmt: skip
    work = state_interpreted(script, "work", out="run")["work"]
    log = read_log(tmp_path / "run" / "log.mpm")
    assert log["load_z"][1:] == pytest.approx(torque, rel=0.02)
    assert -log["L_y"][-1] == pytest.approx(0.02 * log["load_z"].sum(), rel=1e-8)
    assert log["Ek"][-1] + log["Es"][-1] == pytest.approx(work, rel=2e-3)  # in 10 steps


BY_TORQUE = """
    method(tlmpm, FLIP, linear, 1)
    scheme(quasi-static)
    dimension(2, 0, 1, 0, 2, 0.5)
    axisymmetric(true, twist=true)
    material(m, linear, 1, 260, 0.3)
    region(all, block, 0, 1, 0, 2)
    solid(bar, region, all, 2, m, 0.5, 0)
    region(low, block, -INF, INF, 0, 0)
    region(high, block, -INF, INF, 2, 2)
    group(low, nodes, region, low, all)
    group(high, nodes, region, high, all)
    fix(low, velocity_nodes, low, NULL, 0)
    fix(hold, angular_velocity_nodes, low, 0)
    fix(load, {})
    set_dt(1)
    run(1)
"""


@pytest.mark.parametrize(
    ("load", "angle"),
    [
        ("edge_traction, all, all, yhi, 0, 0, 0.1*x", lambda y: 1e-3 * y),
        ("force_nodes, high, 0, 0, 0.05", lambda y: 1e-3 * y),
    ],
)
def test_torques_twist_a_bar_in_load_steps(state_interpreted, load, angle):
    """T/(G J) per length, with R^4/4 for a radian; traction at coarse faces lacks 3 %."""
    state = state_interpreted(BY_TORQUE.format(load), "x", "y", "twist")
    low = state["y"] < 1  # far from the end, where loads are not distributed as in torsion
    assert state["twist"][low] == pytest.approx(angle(state["y"][low]), rel=0.035)
