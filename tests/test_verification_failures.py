"""Where methods fail, and what cures it: small scenes that show both.

Each has a number that follows from the method, or bounds that separate the failure from the cure.
"""

from __future__ import annotations

import numpy as np
import pytest
from verification import LINEAR, QUADRATIC, TOTAL, errors_on, run_scene, table

from comparisons.results import read_dump
from comparisons.vibrating_bar import frequency
from karamelo_py.schemes.usl import USL

SIGMA = 3.0

# --- Cell crossing ------------------------------------------------------------------------------

CROSSING = """
    method(ulmpm, FLIP, {basis})
    dimension(1, 0, 14, 1)
    region(left, block, 2, 6)
    region(right, block, 6, 10)
    material(heavy, linear, 1e12, 1e-6, 0)
    solid(left, region, left, 2, heavy, 1, 0)
    solid(right, region, right, 3, heavy, 1, 0, points=regular)
    fix(v, initial_velocity_particles, all, 1)
    fix(s, initial_stress, all, 3, NULL, NULL, NULL, NULL, NULL)
    set_dt(0.0201)
    dump(g, all, grid, 1, grid.*.LAMMPS, x, fx)
    run(50)
"""


def crossing_forces(run_interpreted, basis):
    """Nodal forces (50 places, inner nodes) in a bar under uniform stress that moves one cell.

    Points of 1/2 and 1/3 cell meet in the middle; too heavy and soft to feel any of it.
    """
    result = run_interpreted(CROSSING.format(basis=basis))
    forces = []
    for step in range(1, 51):
        grid = read_dump(result.folder / f"grid.{step}.LAMMPS")[-1]
        # Nodes whose functions (4 cells at most) lie within the bar all the time.
        forces.append(grid.fx[(grid.x > 4.9) & (grid.x < 8.1)])
    return np.array(forces)


def test_linear_basis_has_false_forces_that_jump_where_points_cross(run_interpreted):
    """The cell in the middle loses 1/3 and wins 1/2 of its volume by turns: sigma times that."""
    forces = crossing_forces(run_interpreted, "linear, 1")
    assert np.abs(forces).max() == pytest.approx(SIGMA / 3, rel=1e-9)
    assert np.abs(np.diff(forces, axis=0)).max() == pytest.approx(SIGMA / 2, rel=1e-9)


@pytest.mark.parametrize("basis", ["ugimp, 1", "cpgimp, 1, stretch"])
def test_boxes_that_tile_the_bar_have_no_false_forces(run_interpreted, basis):
    assert np.abs(crossing_forces(run_interpreted, basis)).max() < 1e-9 * SIGMA


@pytest.mark.parametrize(("basis", "most"), [("quadratic-spline", 0.1), ("cubic-spline", 0.02)])
def test_splines_have_small_false_forces_without_jumps(run_interpreted, basis, most):
    """The gradient is continuous: from place to place, 0.02 cells on, it changes by little.

    Found: 0.052 and 0.012 of the stress, changing by 0.013 and 0.0016.
    """
    forces = crossing_forces(run_interpreted, basis + ", 1")
    assert 1e-3 * SIGMA < np.abs(forces).max() < most * SIGMA
    assert np.abs(np.diff(forces, axis=0)).max() < 0.3 * np.abs(forces).max()


def test_bernstein_functions_jump_like_hats(run_interpreted):
    """Smooth within a cell, with a kink at its faces."""
    forces = crossing_forces(run_interpreted, "Bernstein-quadratic, 1")
    assert np.abs(np.diff(forces, axis=0)).max() > SIGMA


# --- Noise that the grid does not see -----------------------------------------------------------

RINGING = """
    method(ulmpm, {transfer})
    dimension(1, 0, 24, 1)
    region(line, block, 2, 22)
    material(soft, linear, 1, 1e-12, 0)
    solid(bar, region, line, 2, soft, 1, 0)
    fix(v, initial_velocity_particles, all, {field})
    set_dt(1e-6)
    dump(p, all, particle, {steps}, p.*.LAMMPS, x0, vx)
    run({steps})
"""
SAWTOOTH, MODE = "sin(2*PI*x0)", "cos(PI*(x0 - 2)/20)"


def kept(run_interpreted, transfer, field, steps):
    """Share of a field of velocity that is left; of the sawtooth away from the ends of the bar."""
    text = RINGING.format(transfer=transfer, field=field, steps=steps)
    points = run_interpreted(text).dump(f"p.{steps}.LAMMPS")
    if field == SAWTOOTH:
        inside, start = np.abs(points.x0 - 12) < 4, np.sin(2 * np.pi * points.x0)
    else:
        inside, start = slice(None), np.cos(np.pi * (points.x0 - 2) / 20)
    return (points.vx[inside] @ start[inside]) / (start[inside] @ start[inside])


def test_flip_keeps_a_sawtooth_pic_and_xpic_take_it_away(run_interpreted):
    """Hammerquist & Nairn 2017: a sawtooth of two points a cell is nothing on the nodes.

    FLIP never changes it; PIC and XPIC take it away in a step. Of the first mode PIC loses most
    in 100 steps, and XPIC the less the higher its order.
    """
    assert kept(run_interpreted, "FLIP, linear, 1", SAWTOOTH, 100) == pytest.approx(1, abs=1e-6)
    assert kept(run_interpreted, "FLIP, linear, 1", MODE, 100) == pytest.approx(1, abs=1e-4)
    modes = []
    for transfer in ("PIC, linear", "XPIC, linear, 2", "XPIC, linear, 5"):
        assert abs(kept(run_interpreted, transfer, SAWTOOTH, 1)) < 1e-9
        modes.append(kept(run_interpreted, transfer, MODE, 100))
    assert modes[0] < 0.85
    assert modes[0] < modes[1] < modes[2] < 1
    assert modes[2] > 0.98


@pytest.mark.xdist_group("bar")
def test_flip_noise_does_not_grow(run_script):
    """The energy of the vibrating bar over 100 periods."""
    check_energy(run_script, 100)


@pytest.mark.full
def test_flip_noise_does_not_grow_in_1000_periods(run_script):
    check_energy(run_script, 1000)


def check_energy(run_script, periods):
    log = run_scene(run_script, "vibrating_bar", LINEAR, periods=periods).log
    total = log.Ek + log.Es
    last = total[log.Time > log.Time[-1] - 10].mean()
    assert total.max() < 1.005 * total[log.Time < 10].max()
    assert last < 1.002 * total[log.Time < 10].mean()
    assert frequency(log.Time, log.v_x) == pytest.approx(2 * np.pi / 10, rel=2e-3)


# --- Tiny masses --------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["usl", "musl", "usf", "usavg"])
def test_a_node_with_next_to_no_mass_does_no_harm(run_interpreted, scheme):
    """One point under stress, a millionth of a cell beyond a face.

    The node ahead has a millionth of its mass and all of its force: f dt / m is 5e4, and USL
    without limit would take 1e5 times the stress from that in a step. Forces add to zero: momentum
    is kept.
    """
    result = run_interpreted(f"""
        method(ulmpm, FLIP, linear, 1)
        scheme({scheme})
        dimension(1, 0, 4, 1)
        region(line, block, 1.500001, 2.500001)
        material(steel, linear, 1, 100, 0)
        solid(point, region, line, 1, steel, 1, 0)
        fix(v, initial_velocity_particles, all, 0.1)
        fix(s, initial_stress, all, 1, NULL, NULL, NULL, NULL, NULL)
        compute(v, average_velocity, all)
        compute(Es, strain_energy, all)
        set_dt(0.05)
        set_output(1)
        log_modify(custom, step, v_x, Es)
        run(10)
    """)
    assert result.log.v_x == pytest.approx(np.full(11, 0.1), rel=1e-9)
    assert result.log.Es.max() < 2 * 0.5 / 100


def test_what_a_light_node_is_depends_on_the_points_near_it(state_interpreted):
    """A body far away, 100 times lighter, changes no bit of a drifting one.

    Light is a node beside the points that it sees, not beside the lightest of the scene: by that
    measure the drifting body turned inside out within a dozen steps.
    """
    states = []
    for second in ("rubber", "foam"):
        states.append(
            state_interpreted(f"""
        method(ulmpm, FLIP, linear, 1)
        scheme(usl)
        dimension(2, 0, 12, 0, 5, 0.5)
        region(ball, cylinder, 2, 2, 1)
        region(far, cylinder, 8, 2, 1)
        material(rubber, neo-hookean, 1, 1, 0.3)
        material(foam, neo-hookean, 0.01, 0.01, 0.3)
        solid(ball, region, ball, 2, rubber, 0.5, 0)
        solid(far, region, far, 2, {second}, 0.5, 0)
        group(ball, particles, region, ball, all)
        fix(v, initial_velocity_particles, ball, 0.2 + 0.03*(x0 - 2), 0.1)
        set_dt(0.2)
        run(25)
    """)
        )
    n = len(states[0]["x"]) // 2
    assert np.array_equal(states[0]["x"][:n], states[1]["x"][:n])
    assert np.array_equal(states[0]["v"][:n], states[1]["v"][:n])


def shaken(run_interpreted, scheme, ppc, factor, method="tlmpm, FLIP, linear, 1"):
    """Energy of a small free body, shaken a little, after 150 steps over the one at the start."""
    result = run_interpreted(f"""
        method({method})
        scheme({scheme})
        dimension(2, -2, 5, -2, 5, 1)
        region(box, block, 0, 3, 0, 2)
        material(rubber, neo-hookean, 1, 100, 0.3)
        solid(box, region, box, {ppc}, rubber, 1, 0)
        fix(v, initial_velocity_particles, all, 1e-6*sin(37*x + 11*y), 1e-6*sin(29*x*x + 17*y))
        compute(Ek, kinetic_energy, all)
        compute(Es, strain_energy, all)
        dt_factor({factor})
        set_output(1000)
        log_modify(custom, step, Ek, Es)
        run(150)
    """, folder=f"{scheme}{ppc}{factor}")  # fmt: skip
    total = result.log.Ek + result.log.Es
    return total[-1] / total[0]


@pytest.mark.parametrize("ppc", [1, 2])
def test_usl_has_a_stable_step_of_its_own(run_interpreted, ppc):
    """Benchmark C11. Strain that points average away follows e <- (1 - (w dt)^2) e with usl.

    That is stable for w dt < sqrt(2), where the other schemes have 2. One point a cell: w^2 h^2 is
    at most 4 (2 lambda + 2 mu) / rho in the plane, stable below 0.59 h/c at nu = 0.3.
    """
    above = (0.9 if ppc == 2 else 0.75) / USL.courant[ppc == 1]
    assert shaken(run_interpreted, "usl", ppc, above) > 5
    assert shaken(run_interpreted, "musl", ppc, 0.99) < 1.5


SHAKEN = [
    "tlmpm, FLIP, linear, 1",
    "tlmpm, FLIP, Bernstein-quadratic, 1",
    "ulmpm, FLIP, linear, 1",
    "ulmpm, FLIP, Bernstein-quadratic, 1",
    "ulmpm, FLIP, quadratic-spline, 1",
    "ulmpm, FLIP, ugimp, 1",
    "ulmpm, FLIP, cpgimp, 1",
    "ulcpdi, FLIP, linear, 1, R4",
]


# Its limit differs between one point a cell and more.
@pytest.mark.parametrize("ppc", [1, 2, pytest.param(3, marks=pytest.mark.full)])
@pytest.mark.parametrize("method", SHAKEN)
def test_usl_is_stable_at_the_default_step(run_interpreted, method, ppc):
    assert shaken(run_interpreted, "usl", ppc, 0.9, method) < 1.5


# --- Hourglass ----------------------------------------------------------------------------------


def hourglass(run_interpreted, ppc):
    """Strain energy after a step in which nodes move to and fro by turns."""
    result = run_interpreted(f"""
        method(tlmpm, FLIP, linear, 1)
        dimension(2, -1, 5, -1, 5, 1)
        region(box, block, 0, 4, 0, 4)
        material(rubber, linear, 1, 100, 0.3)
        solid(box, region, box, {ppc}, rubber, 1, 0)
        fix(v, initial_velocity_nodes, all, cos(PI*x0)*cos(PI*y0), 0)
        compute(Es, strain_energy, all)
        set_dt(0.001)
        set_output(1)
        log_modify(custom, step, Es)
        run(1)
    """, folder=str(ppc))  # fmt: skip
    return result.log.Es[-1]


def test_one_point_a_cell_does_not_feel_hourglasses(run_interpreted):
    """The gradient of the hourglass vanishes in the middle of a cell, and only there.

    With 2 x 2 points: d v_x / dx = -+ 2 sin(pi/4 ...) of hats is 1 (the mean over the other
    direction halves the slope of 2), and so is d v_x / dy.
    """
    # u_x changes by 1e-3 (2 - 4 y) between nodes: a strain of 1e-3 at y = 1/4, and so along y.
    strain, lam, mu = 1e-3, 100 * 0.3 / (1.3 * 0.4), 100 / 2.6
    energy = 16 * ((lam / 2 + mu) * strain**2 + mu / 2 * strain**2)
    assert hourglass(run_interpreted, 1) == pytest.approx(0, abs=1e-12 * energy)
    assert hourglass(run_interpreted, 2) == pytest.approx(energy, rel=0.01)


# --- The axis -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "basis",
    ["linear, 1", "quadratic-spline, 1", "cubic-spline, 1", "Bernstein-quadratic, 1", "ugimp, 1",
     "cpgimp, 1, stretch"],
)  # fmt: skip
def test_hoop_strain_is_the_radial_one_up_to_the_axis(run_interpreted, basis):
    """A uniform radial field: eps_theta = v_r / r and eps_r = dv_r / dr agree at every point."""
    result = run_interpreted(f"""
        method(ulmpm, FLIP, {basis})
        dimension(2, 0, 1.2, 0, 1, 0.1)
        axisymmetric(true)
        region(box, block, 0, 0.8, 0.2, 0.6)
        material(rubber, linear, 1, 1, 0.3)
        solid(body, region, box, 2, rubber, 0.1, 0)
        fix(v, initial_velocity_nodes, all, 0.5*x0, 0)
        set_dt(0.001)
        dump(p, all, particle, 1, p.*.LAMMPS, x0, s11, s33)
        run(1)
    """)
    points = result.dump("p.1.LAMMPS")
    assert points.x0.min() == pytest.approx(0.025)
    assert np.abs(points.s11).min() > 1e-4
    assert points.s33 == pytest.approx(points.s11, rel=1e-6)


@pytest.mark.parametrize("scheme", ["musl", "usl", "usf", "usavg"])
@pytest.mark.parametrize("basis", ["linear", "quadratic-spline"])
def test_a_ball_on_the_axis_stays_whole(run_interpreted, scheme, basis):
    """Nodes on the axis do not move along the radius: points h / 6 from it see N / r = 5 / h.

    With nodes that move the ball breaks in the fourth step (musl) or the eighth (usl).
    """
    result = run_interpreted(f"""
        method(ulmpm, FLIP, {basis}, 1)
        scheme({scheme})
        dimension(2, 0, 1.5, -1.5, 1.5, 0.25)
        axisymmetric(true)
        region(ball, cylinder, 0, 0, 1)
        material(rubber, neo-hookean, 1, 1, 0.3)
        solid(ball, region, ball, 3, rubber, 0.25, 0)
        fix(v, initial_velocity_particles, all, 0.03*x0, 0.03*y0)
        compute(Ek, kinetic_energy, all)
        compute(Es, strain_energy, all)
        set_output(1)
        log_modify(custom, step, Ek, Es)
        dump(g, all, grid, 15, grid.*.LAMMPS, x, vx)
        run(15)
    """)
    total = result.log.Ek + result.log.Es
    # Kinetic and stored energy are half a step apart, and a period has about ten.
    assert total.max() < 1.5 * total[0]
    nodes = result.dump("grid.15.LAMMPS")
    assert (nodes.vx[nodes.x == 0] == 0).all()
    assert np.abs(nodes.vx).max() > 1e-3


def test_bodies_that_meet_on_the_axis_push_along_it(run_interpreted):
    """A ball falls on a plate, without friction: no node of the axis gets a radial velocity."""
    result = run_interpreted("""
        method(ulmpm/contacts, FLIP, linear, 1)
        dimension(2, 0, 1.5, -1, 1.5, 0.25)
        axisymmetric(true)
        region(ball, cylinder, 0, 0.5, 0.5)
        region(plate, block, 0, 1, -0.5, 0)
        material(rubber, neo-hookean, 1, 1, 0.3)
        solid(ball, region, ball, 2, rubber, 0.25, 0)
        solid(plate, region, plate, 2, rubber, 0.25, 0)
        region(upper, block, 0, 1, 0, 1)
        group(ball, particles, region, upper, all)
        fix(v, initial_velocity_particles, ball, 0, -0.2)
        compute(p, linear_momentum, all)
        set_output(1)
        log_modify(custom, step, p_y, ContactForce_ball_y)
        dump(g, all, grid, 1, grid.*.LAMMPS, x, vx)
        run(20)
    """)
    assert result.log.p_y == pytest.approx(np.full(21, result.log.p_y[0]), rel=1e-8)
    assert result.log.ContactForce_ball_y.max() > 1e-3
    for step in range(1, 21):
        nodes = read_dump(result.folder / f"grid.{step}.LAMMPS")[-1]
        assert (nodes.vx[nodes.x == 0] == 0).all()


# --- Points per cell ----------------------------------------------------------------------------


@pytest.mark.full
@pytest.mark.parametrize(("way", "most"), table((LINEAR, 0.1), (QUADRATIC, 0.1), (TOTAL, 0.1)))
def test_points_per_cell(run_script, way, most):
    """The same scene with 1, 2 and 3 points a direction: all see the solution."""
    for ppc in (1, 2, 3):
        (error,) = errors_on(run_script, "axis_aligned", way, (1,), G=1e-4, ppc=ppc)
        assert error < most, ppc
