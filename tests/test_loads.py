"""Forces on points, tractions and pressure on the edge of a region, and coming to rest."""

import numpy as np
import pytest
from scenes import block
from test_karamelo_tools import SIDE, forces, given

DISK = """
method(ulmpm, FLIP, linear, 1)
dimension(2, -0.6, 0.6, -0.6, 0.6, 0.1)
region(disk, cylinder, 0, 0, 0.4)
material(rubber, linear, 2, 100, 0.3)
solid(disk, region, disk, 2, rubber, 0.1)
"""


@pytest.mark.parametrize("d", [1, 2, 3])
def test_force_particles_goes_by_mass(run_interpreted, d):
    total = np.array([2.0, -3.0, 0.5])[:d]
    x, force = forces(
        run_interpreted, d, f"fix(F, force_particles, all, {', '.join(map(str, total))})"
    )
    assert force == given(np.tile(total / len(x), (len(x), 1)))


def test_force_particles_is_that_of_the_place(run_interpreted):
    x, force = forces(run_interpreted, 2, "fix(F, force_particles, all, 100*x0, NULL)")
    assert force == given(np.column_stack([100 * x[:, 0] / len(x), 0 * x[:, 0]]))


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("side", ["xlo", "xhi"])
def test_edge_traction_loads_one_side(run_interpreted, d, side):
    """The outermost layer, and in all traction times area: 0.2 and 0.2 x 0.1, a section in 1D."""
    t = np.array([7.0, -2.0, 3.0])[:d]
    fix = f"fix(F, edge_traction, all, box, {side}, {', '.join(map(str, t))})"
    x, force = forces(run_interpreted, d, fix)
    layer = x[:, 0] == (x[:, 0].min() if side == "xlo" else x[:, 0].max())
    assert force == given(layer[:, None] * t * SIDE ** (d - 1))
    assert force.sum(axis=0) == pytest.approx(t * [1, 0.2, 0.02][d - 1], rel=1e-5)


def test_edge_traction_by_a_formula_of_the_edge(run_interpreted):
    """x is the place of the face, not of the point."""
    x, force = forces(run_interpreted, 2, "fix(F, edge_traction, all, box, yhi, 0, y*10 + x)")
    top = x[:, 1] == x[:, 1].max()
    assert force[top, 1] == given(SIDE * (10 * 0.5 + x[top, 0]))


@pytest.mark.parametrize("d", [2, 3])
def test_edge_pressure_of_a_block(run_interpreted, d):
    x, force = forces(run_interpreted, d, "fix(F, edge_pressure, all, box, 5)")
    out = 1.0 * (x > x.max(axis=0) - 1e-6) - 1.0 * (x < x.min(axis=0) + 1e-6)
    assert force == given(-5 * out * SIDE ** (d - 1))


def test_pressure_on_a_round_edge_is_that_on_its_projection(run_interpreted):
    """2 R along each axis, to the side of a point; no resultant, no moment."""
    lines = "fix(F, edge_pressure, all, disk, 3)\ndump(d, all, particle, 1, d.*.LAMMPS, x0, y0, bx, by)\nset_dt(1e-4)\nrun(1)"  # noqa: E501
    last = run_interpreted(DISK + lines).dump("d.1.LAMMPS")
    assert last.bx[last.bx > 0].sum() == pytest.approx(3 * 0.8, rel=1e-4)
    assert last.bx.sum() == pytest.approx(0, abs=1e-4)
    assert (last.x0 * last.by - last.y0 * last.bx).sum() == pytest.approx(0, abs=1e-4)


def test_loads_around_the_axis(run_interpreted):
    """Per radian: p R H on the flank, p R^2/2 on the top, nothing on the axis."""
    text = """
        method(ulmpm, FLIP, linear, 1)
        dimension(2, 0, 1, 0, 1, 0.1)
        axisymmetric(true)
        region(bar, block, 0, 0.3, 0.2, 0.6)
        material(rubber, linear, 2, 100, 0.3)
        solid(bar, region, bar, 2, rubber, 0.1)
        fix(F, edge_pressure, all, bar, 5)
        fix(T, edge_traction, all, bar, yhi, 0, 5)
        set_dt(1e-4)
        log_modify(custom, step, F_x, F_y, T_y)
        run(1)
        """
    log = run_interpreted(text).log
    assert log.F_x[-1] == pytest.approx(-5 * 0.3 * 0.4, rel=1e-9)
    assert log.F_y[-1] == pytest.approx(0, abs=1e-12)
    assert log.T_y[-1] == pytest.approx(5 * 0.3**2 / 2, rel=1e-9)


LOADED = """
fix(F, edge_pressure, all, body, 3)
fix(T, edge_traction, all, body, xhi, 0, 5)
dump(d, all, particle, 1, d.*.LAMMPS, x0, y0, bx, by)
set_dt(1e-5)
log_modify(custom, step, F_x, F_y, T_y)
run(1)
"""
BODIES = {
    "disk": "region(body, cylinder, 0.02, -0.03, 0.4)",
    "square turned by 30 degrees": """
        c = cos(PI/6)
        region(a, plane, 0.4*c, 0.2, -c, -0.5)
        region(b, plane, -0.4*c, -0.2, c, 0.5)
        region(c, plane, -0.2, 0.4*c, 0.5, -c)
        region(d, plane, 0.2, -0.4*c, -0.5, c)
        region(body, intersection, a, b, c, d)""",
}


@pytest.mark.parametrize("body", BODIES)
def test_a_smooth_edge_bears_what_its_projection_does(run_interpreted, body):
    """Of points that a region cuts: the projected width, no resultant, no moment."""
    width = {"disk": 0.8}.get(body, 0.8 * (np.cos(np.pi / 6) + 0.5))
    scene = DISK.replace("region(disk, cylinder, 0, 0, 0.4)", BODIES[body])
    scene = scene.replace(
        "region, disk, 2, rubber, 0.1)", "region, body, 2, rubber, 0.1, points=cut)"
    )
    alone = LOADED.replace("fix(T", "#").replace(", T_y", "")
    result = run_interpreted(scene + alone)
    last, log = result.dump("d.1.LAMMPS"), run_interpreted(scene + LOADED, folder="both").log
    assert abs(log.F_x[-1]) + abs(log.F_y[-1]) < 1e-6
    if body == "disk":  # points at corners show opposite sides
        assert last.bx[last.bx > 0].sum() == pytest.approx(3 * width, rel=2e-3)
        assert last.by[last.by > 0].sum() == pytest.approx(3 * width, rel=2e-3)
    # Forces act half a point inside the edge.
    assert abs((last.x0 * last.by - last.y0 * last.bx).sum()) < 0.02 * 3 * width * 0.4
    # Opposite sides cancel in a quarter of a point (0.0125) at each of two corners.
    assert log.T_y[-1] == pytest.approx(5 * width, abs=5 * 0.0125)


def test_no_load_on_the_side_of_the_domain(run_interpreted):
    """Half a disk about it: what would be beyond has no points, and bears nothing."""
    half = DISK.replace("-0.6, 0.6, -0.6", "0, 0.6, -0.6").replace(
        "rubber, 0.1)", "rubber, 0.1, points=cut)"
    )
    lines = (
        "fix(F, edge_pressure, all, disk, 3)\nset_dt(1e-5)\nlog_modify(custom, step, F_x)\nrun(1)"
    )
    log = run_interpreted(half + lines).log
    assert log.F_x[-1] == pytest.approx(-3 * 0.8, rel=2e-3)


def test_a_ball_around_the_axis_is_pressed_from_all_sides(run_interpreted):
    """Per radian: p R^2/2 from above and from below."""
    text = """
        method(ulmpm, FLIP, linear, 1)
        dimension(2, 0, 1, -1, 1, 0.1)
        axisymmetric(true)
        region(ball, cylinder, 0, 0, 0.6)
        material(rubber, linear, 2, 100, 0.3)
        solid(ball, region, ball, 2, rubber, 0.1, points=cut)
        fix(F, edge_pressure, all, ball, 3)
        fix(T, edge_traction, all, ball, ylo, 0, 1)
        set_dt(1e-5)
        log_modify(custom, step, F_y, T_y)
        run(1)
        """
    log = run_interpreted(text).log
    assert log.F_y[-1] == pytest.approx(0, abs=1e-6)
    assert log.T_y[-1] == pytest.approx(0.6**2 / 2, rel=0.01)


def test_an_edge_without_points_is_told(run_interpreted):
    lines = "region(off, block, 0.9, 1, 0.9, 1)\nfix(F, edge_pressure, all, off, 5)\nset_dt(1e-4)\nrun(1)"  # noqa: E501
    said = run_interpreted(block(2, lines)).err
    assert "no point of the group lies at this edge" in said
    assert "hint: the region that the solid fills" in said


def test_a_column_comes_to_rest_by_local_damping(run_script):
    """sigma = -rho g (L - x) as the weight asks for, while without damping it goes on swinging."""
    text = """
        method(ulmpm, FLIP, linear, 1)
        dimension(1, 0, 1.2, 0.2)
        region(column, block, 0, 1)
        region(base, block, 0, 0)
        group(base, nodes, region, base, all)
        material(soft, linear, 2, 100, 0)
        solid(column, region, column, 2, soft, 0.2)
        fix(base, velocity_nodes, base, 0)
        fix(weight, body_force, all, -0.5)
        CALM
        compute(Ek, kinetic_energy, all)
        compute(Es, strain_energy, all)
        dt_factor(0.5)
        set_output(1)
        log_modify(custom, step, time, Ek, Es, base_x)
        dump(end, all, particle, 1000, end.*.LAMMPS, x0, s11)
        """
    calm = text.replace("CALM", "fix(calm, local_damping, all, 0.8)") + "run(700)"
    result = run_script(calm, folder="calm")
    log, end = result.log, result.dump("end.700.LAMMPS")
    swing = run_script(text.replace("CALM", "") + "run(350)", folder="free").log.Ek
    # Ten periods of 4 L/c: a thousandth of the first swing is left at most.
    assert log.Ek[-50:].max() < 1e-6 * swing.max()
    assert log.base_x[-1] == pytest.approx(2 * 0.5 * 1, rel=1e-4)
    # A cell has one strain, that of its middle; strains are a percent.
    cells = (end.s11[::2] + end.s11[1::2]) / 2
    assert cells == pytest.approx(-2 * 0.5 * np.arange(0.9, 0, -0.2), abs=0.01)
    assert swing[-200:].max() > 0.8 * swing.max()


@pytest.mark.parametrize("alpha", ["1.5", "-0.1"])
def test_damping_shares_that_are_refused(run_interpreted, alpha):
    result = run_interpreted(block(2, f"fix(calm, local_damping, all, {alpha})"), status=1)
    assert "from 0 to 1" in result.err or "between" in result.err


def test_a_bar_under_traction_has_its_stress(run_interpreted):
    """E eps = t everywhere in a bar pulled at one end, held at the other, at rest."""
    text = block(
        2,
        "region(left, block, 0.3, 0.3, INF, INF)",
        "group(left, nodes, region, left, all)",
        "fix(left, velocity_nodes, left, 0, NULL)",
        "fix(pull, edge_traction, all, box, xhi, 0.2, 0)",
        "fix(calm, local_damping, all, 0.8)",
        "dt_factor(0.9)",
        "compute(mean, average_stress, all)",
        "set_output(85)",
        "log_modify(custom, step, mean_11, mean_22, left_x, pull_x)",
        "run(85)",
        size=(0.3, 0.1),
    )  # fmt: skip
    log = run_interpreted(text).log
    assert log.pull_x[-1] == pytest.approx(0.2 * 0.1, rel=1e-9)
    assert log.left_x[-1] == pytest.approx(-0.2 * 0.1, rel=1e-3)
    # The load acts a quarter of a cell inside of the end: the last 0.025 of 0.3 bear nothing.
    assert log.mean_11[-1] == pytest.approx(0.2 * (1 - 0.025 / 0.3), rel=0.02)
    assert log.mean_22[-1] == pytest.approx(0, abs=2e-3)
