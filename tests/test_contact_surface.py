"""Fix contact/surface: points touch the surface of a region."""

import re
from math import cos, exp, pi, radians, sin

import meshio
import numpy as np
import pytest
from scenes import block

from karamelo_py.scene.region import Region

pytestmark = pytest.mark.xdist_group("surface")
SLOPE = """
    method({method}, FLIP, linear, 1)
    dimension(2, 0, 3, 0, 3, 0.1)
    c = cos(radians(20))
    s = sin(radians(20))
    X = 0.7
    Y = 0.3 + 2.3*s/c
    region(slope, plane, X, Y, -s, -c)
    region(above, plane, X, Y, s, c)
    region(below, plane, X + 0.4*s, Y + 0.4*c, -s, -c)
    region(ahead, plane, X, Y, c, -s)
    region(behind, plane, X + 0.6*c, Y - 0.6*s, -c, s)
    region(block, intersection, above, below, ahead, behind)
    material(rubber, linear, 1000, 1e6, 0.3)
    solid(block, region, block, 2, rubber, 0.1, 0, points=cut)
    fix(rub, contact/surface, all, slope, {mu}{way})
    fix(g, body_force, all, 0, -10)
    compute(p, linear_momentum, all)
    along = (p_x*c - p_y*s + {share}*{mu}*(p_x*s + p_y*c))/max(-g_y/10, 1e-9)
    set_output(time(0.01))
    log_modify(custom, step, time, along)
    run_time(0.2)
"""


@pytest.mark.parametrize(
    ("mu", "way", "share"),
    [
        pytest.param(0.2, "", 1, id="rough"),
        pytest.param(0, "", 0, id="smooth", marks=pytest.mark.full),
        pytest.param(0.2, ", 9*time*c, -9*time*s", -1, id="belt"),
    ],
)
def test_a_block_slides_down(run_script, mu, way, share):
    """Acceleration g (sin - mu cos), or g (sin + mu cos) on a belt that moves faster downhill.

    The weight acts at once, and the block bounces: mu times its velocity across is added, which
    friction takes with each push.
    """
    done = run_script(SLOPE.format(method="tlmpm", mu=mu, way=way, share=share))
    late = done.log.Time > 0.02
    found = np.polyfit(done.log.Time[late], done.log.along[late], 1)[0]
    exact = 10 * (sin(radians(20)) - share * mu * cos(radians(20)))
    assert found == pytest.approx(exact, abs=0.003 * 10 * sin(radians(20)))
    assert "energy balance: spurious gain" not in done.err


BELT = """
    mu = 0.3
    t = 0.1
    h = 0.1
    v = 0.02
    load = 5
    method(tlmpm, FLIP, linear, 0.99)
    dimension(2, -1.4, 1.4, -1.2, 1.4, h)
    region(outer, cylinder, 0, 0, 1 + t)
    region(inner, cylinder, 0, 0, 1, exterior)
    region(top, block, -INF, INF, 0, INF)
    region(arc, intersection, outer, inner, top)
    region(left, block, -1 - t, -1, -0.3, 0)
    region(right, block, 1, 1 + t, -0.3, 0)
    region(belt, union, arc, left, right)
    region(bollard, cylinder, 0, 0, 1)
    material(m, neo-hookean, 1, 1e4, 0)
    solid(belt, region, belt, 2, m, h, points=cut)
    region(le, block, -INF, 0, -INF, -0.3 + 0.01*h)
    region(re, block, 0, INF, -INF, -0.3 + 0.5*h)
    group(drawn, nodes, region, le, all)
    group(loaded, particles, region, re, all)
    fix(load, force_particles, loaded, 0, -load*min(time, 1))
    fix(pull, velocity_nodes, drawn, NULL, if(time < 1, 0, -v*min((time - 1)/0.5, 1)))
    fix(touch, contact/surface, all, bollard, mu)
    fix(calm, local_damping, all, 0.2)
    ratio = -pull_y/load
    set_output(time(0.1))
    log_modify(custom, step, time, ratio)
    run_time(3)
"""


@pytest.mark.full
def test_a_belt_is_drawn_over_a_bollard(run_script):
    """Euler and Eytelwein: a pull of exp(mu pi) times the load for a thin belt, however slow.

    Friction acts on the inner face of this belt, half its thickness nearer to the axis than its
    tension: without bending the ratio would be exp(mu pi/1.05). Friction without memory let the
    belt creep at 1.26 times the load.
    """
    done = run_script(BELT)
    late = done.log.Time > 2.65
    assert exp(0.3 * pi / 1.05) < done.log.ratio[late].mean() < exp(0.3 * pi)


SAND = """
    h = 0.5
    units(m, kg, s)
    method(ulmpm, FLIP, quadratic-spline, 0.99)
    dimension(3, 0, 20, 0, 10, -2, 9, h)
    boundary(delete)
    region(ground, stl, ground.stl)
    region(mass, sphere, 4, 5, 6, 1.5)
    eos(s, linear, 1800, 5e6)
    strength(s, drucker-prager, 2e6, 0, 25)
    material(s, eos-strength, s, s)
    solid(mass, region, mass, 2, s, h)
    fix(grav, body_force, all, 0, 0, -9.81)
    fix(ground, contact/surface, all, ground, 0.2)
    compute(Ek, kinetic_energy, all)
    compute(c, center_of_mass, all)
    set_output(1)
    log_modify(custom, step, time, ground_x, ground_z, Ek, c_z)
    run(200)
"""


def facets() -> meshio.Mesh:
    """A closed surface whose top of 36 facets slopes down by a quarter along x."""
    x, y = np.meshgrid(np.linspace(-1, 21, 7), np.linspace(-1, 11, 4), indexing="ij")
    z = 4 - 0.25 * x + 0.2 * np.sin(x) * np.cos(y)
    top = np.stack([x, y, z], -1).reshape(-1, 3)
    n, number = len(top), np.arange(x.size).reshape(x.shape)

    def split(a, b, c, d):
        corners = [np.stack([k.ravel() for k in t], -1) for t in ((a, b, c), (a, c, d))]
        return np.concatenate(corners)

    up = split(number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    rim = np.concatenate([number[:, 0], number[-1, 1:], number[-2::-1, -1], number[0, -2::-1]])
    sides = split(rim[:-1], rim[:-1] + n, rim[1:] + n, rim[1:])[:, ::-1]
    faces = np.concatenate([up, up[:, ::-1] + n, sides])
    return meshio.Mesh(np.concatenate([top, top * [1, 1, 0] - [0, 0, 3]]), {"triangle": faces})


def test_sand_slides_on_facets(run_script, tmp_path):
    """Friction only dissipates energy, and the force on the ground balances the momentum.

    Sums slightly below 0 from rounding once let friction accelerate an unloaded point from step 180
    on, by up to 1 cell per step and with 6 times the normal force.
    """
    (tmp_path / "run").mkdir()
    facets().write(tmp_path / "run" / "ground.stl", binary=True)
    done = run_script(SAND)
    log = done.log
    speed = np.diff(log.c_z) / np.diff(log.Time)
    weight = 9.81 * 2 * log.Ek[60] / speed[59] ** 2  # until then all points fall freely
    energy = log.Ek + weight * log.c_z
    assert np.diff(energy).max() < 1e-3 * energy[0]
    assert "energy balance" not in done.err
    late = log.Time > log.Time[100]
    # Faces lean by up to 0.45, and friction adds 0.2.
    steepest = (0.45 + 0.2) / (1 - 0.45 * 0.2)
    assert np.all(np.abs(log.ground_x[late]) < steepest * log.ground_z[late])
    middle = 0.5 * (log.Time[1:] + log.Time[:-1])
    pushed = (log.ground_z[102:] * np.diff(middle)[100:]).sum()
    gained = weight / 9.81 * (speed[-1] - speed[100])
    assert pushed == pytest.approx(weight * (middle[-1] - middle[100]) + gained, rel=0.01)


def pushed(run_interpreted, d: int, die: str, *lines: str, folder: str) -> list[float]:
    """Force on a block that falls on a region below it, which its lowest points overlap."""
    names = [f"F_{axis}" for axis in "xyz"[:d]]
    text = block(
        d, *lines, die, "fix(F, contact/surface, all, die)",
        f"fix(falls, initial_velocity_particles, all, {'0, ' * (d - 1)}-1)",
        f"log_modify(custom, step, {', '.join(names)})", "set_dt(0.001)", "run(1)",
    )  # fmt: skip
    log = run_interpreted(text, folder=folder).log
    return [float(log[name][-1]) for name in names]


def test_any_region_pushes(run_interpreted, tmp_path):
    """A block, a plane, the exterior of a block and a mesh give the same forces."""
    corners = np.array([[0.0, 0.0], [0.9, 0.0], [0.9, 0.31], [0.0, 0.31]])
    meshio.Mesh(corners, {"triangle": [[0, 1, 2], [0, 2, 3]]}).write(tmp_path / "die.vtk")
    styles = {
        "block": "region(die, block, 0, 0.9, 0, 0.31)",
        "plane": "region(die, plane, 0, 0.31, 0, -1)",
        "mould": "region(die, block, 0, 0.9, 0.31, 0.9, exterior)",
        "mesh": f"region(die, mesh, {tmp_path}/die.vtk)",
    }
    forces = {n: pushed(run_interpreted, 2, die, folder=n) for n, die in styles.items()}
    assert forces["plane"][1] > 0
    for name, found in forces.items():
        assert found == pytest.approx(forces["plane"], rel=1e-6, abs=1e-9), name


ROD = """
    h = 0.125
    method(ulmpm, FLIP, linear, 1)
    dimension(1, -0.25, 1.5, h)
    region(rod, block, 0.002, 1.002)
    material(rubber, neo-hookean, 1, 100, 0)
    solid(rod, region, rod, 2, rubber, h)
    fix(flies, initial_velocity_particles, all, -0.1)
    region(wall, block, -INF, 0)
    fix(wall, contact/surface, all, wall)
    compute(v, average_velocity, all)
    set_output(5)
    log_modify(custom, step, time, v_x)
    run_time(0.4)
"""


def test_a_rod_rebounds(run_interpreted):
    """An elastic rod returns as fast as it came (Saint-Venant 1867), and loses what it is told.

    When points were stopped at the wall, this rod returned with 0.75 of its speed.
    """
    done = run_interpreted(ROD)
    assert 0.92 < done.log.v_x[-1] / 0.1 < 1
    lost = float(re.search(r"lost by contact +([\d.]+) % of the largest", done.out)[1])
    assert 1 < lost < 5
    assert "energy balance" not in done.err


def test_a_wall_of_one_cell_stops_a_rod(run_interpreted):
    """Of APIC with splines at a fifth of its wave speed; points stopped one by one went through."""
    text = ROD.replace("ulmpm, FLIP, linear, 1", "ulmpm, APIC, quadratic-spline")
    text = (
        text.replace("-INF, 0", "-h, 0").replace("all, -0.1", "all, -2").replace(", v_x", ", a_x")
    )
    text = text.replace("run_time(0.4)", "run_time(0.1)")
    done = run_interpreted(text.replace("compute(v, average_velocity", "compute(a, min_position"))
    assert min(done.log.a_x) > -0.5 * 0.125


@pytest.mark.parametrize("scheme", ["musl", "usavg"])
def test_bounces_gain_no_energy(run_interpreted, scheme):
    """A column whose weight acts at once bounces on a wall: damping alone takes its energy.

    A spring that followed the points, not the velocity that strains, gave back a tenth more.
    """
    text = ROD.replace("ulmpm,", "tlmpm,").replace("1, 100, 0)", "1000, 1e6, 0)")
    text = text.replace("0.002, 1.002", "0, 1").replace(
        "fix(flies, initial_velocity_particles, all", "fix(weight, body_force, all"
    )
    text = text.replace("-0.1)", "-10)").replace(
        "h)\n    region", f"h)\n    scheme({scheme})\n    region", 1
    )
    done = run_interpreted(text)
    change = float(re.search(r"energy +([-+][\d.]+) % of the largest", done.out)[1])
    assert abs(change) < 0.5 and "energy balance" not in done.err


@pytest.mark.parametrize("offset", [0, 0.5])
def test_a_body_at_rest_has_its_stress_down_to_the_surface(run_interpreted, offset):
    """Columns under their weight: rho g times the height above, wherever cells end.

    With forces at the centres of points the lowest row had 25 or 57 % too little.
    """
    done = run_interpreted(f"""
        method(ulmpm, FLIP, linear, 0.99)
        dimension(1, 0, 1, 0.1)
        Y = 0.2 + {offset}*0.1
        region(b, block, Y, Y + 0.2)
        region(wall, block, 0, Y)
        material(rubber, linear, 1000, 2e5, 0)
        solid(b, region, b, 2, rubber, 0.1)
        fix(weight, body_force, all, -10*min(time/0.1, 1))
        fix(w, contact/surface, all, wall)
        fix(calm, local_damping, all, 0.8)
        run_time(0.6)
        dump(e, all, particle, 1, e.*.LAMMPS, x, s11)
        run(1)
    """)
    rows = done.dump(next(done.folder.glob("e.*.LAMMPS")).name)
    exact = [1500, 1500, 500, 500] if offset == 0 else [1750, 1000, 1000, 250]  # means of cells
    assert -rows.s11[np.argsort(rows.x)] == pytest.approx(exact, rel=0.12, abs=45)


def test_a_body_that_begins_in_a_region_is_told(run_interpreted):
    lines = "region(die, block, 0, 0.9, 0, 0.9)", "fix(F, contact/surface, all, die, 0.1)"
    said = run_interpreted(block(2, *lines, "set_dt(1e-9)", "run(1)"), status=None).err
    assert "points in the region of fix 'F': all points of its group begin there" in said


@pytest.mark.parametrize("outside", ["line", "union"])
def test_a_region_without_an_inside_is_refused(run_interpreted, tmp_path, outside):
    corners = np.array([[0.0, 0.31], [0.9, 0.31]])
    marks = {name: [np.array([7])] for name in ("gmsh:physical", "gmsh:geometrical")}
    mesh = meshio.Mesh(corners, {"line": [[0, 1]]}, cell_data=marks)
    mesh.write(tmp_path / "line.msh", file_format="gmsh22")
    lines = (
        f"region(line, mesh, {tmp_path}/line.msh, 7)", "region(die, block, 0, 0.9, 0, 0.2)",
        "region(union, union, die, line)", f"fix(F, contact/surface, all, {outside})", "run(1)",
    )  # fmt: skip
    said = run_interpreted(block(2, *lines), status=1).err
    assert f"region '{outside}' has lines or surfaces and no inside" in said
    assert "fix(F, contact/surface" in said and "a region with an inside" in said


def test_a_point_too_deep_ends_the_run(run_interpreted):
    """More than a cell below the surface the direction outwards is not known."""
    lines = "region(die, block, 0, 0.9, 0, 0.9)", "fix(F, contact/surface, all, die)"
    said = run_interpreted(block(2, *lines, "set_dt(1e-9)", "run(1)"), status=1).err
    assert "point 1 of solid 'body' is so deep in region 'die' of fix 'F'" in said
    assert "smaller steps" in said and "fix(F, contact/surface" in said


@pytest.mark.parametrize(
    ("fix", "told"),
    [
        ("contact/surface, all, die, 0, 0, x", "'x' depends on x, which differs from point"),
        ("indent, all, sphere, 1, 0.1, 0, y, 0", "'y' depends on y, which differs from point"),
        ("contact/surface, all, die, 0, 0", "expected: ux, uy\n"),
    ],
)
def test_motions_are_formulas_of_time(run_interpreted, fix, told):
    text = block(2, "region(die, block, 0, 0.9, 0, 0.2)", f"fix(F, {fix})", "run(1)")
    said = run_interpreted(text, status=1).err
    assert told in said and f"fix(F, {fix})" in said
    assert "expected: a formula of time" in said or "ux, uy" in told


def test_friction_is_not_below_0(run_interpreted):
    lines = "region(die, block, 0, 0.9, 0, 0.2)", "fix(F, contact/surface, all, die, -0.1)"
    assert "at least 0" in run_interpreted(block(2, *lines), status=1).err


RUBBED = "fix(F, contact/surface, all, die, 0.3, 0.2*time, 0)"


def test_a_region_that_kernels_do_not_know_pushes_with_the_same_force(run_script, monkeypatch):
    """Like a region of a plug-in, without outline: Python computes the depths; with friction."""
    text = block(
        2, "region(die, cylinder, 0.4, -4, 4.31)", RUBBED, "log_modify(custom, step, F_x, F_y)",
        "set_dt(0.001)", "set_output(1)", "run(5)",
    )  # fmt: skip
    known = run_script(text, folder="known").log
    monkeypatch.setattr(Region, "outline", lambda region: None)
    told = run_script(text, folder="unknown").log
    assert max(known["F_y"]) > 0 and max(known["F_x"]) > 0
    for name in ("F_x", "F_y"):
        assert told[name] == pytest.approx(known[name], rel=1e-9, abs=1e-9)


def test_a_point_too_deep_ends_a_compiled_run(run_script):
    """One message whichever thread finds the point, and none from the compiler."""
    text = block(2, "region(die, cylinder, 0.4, -4, 4.9)", RUBBED, "set_dt(1e-9)", "run(1)")
    for threads in (1, 2):
        said = run_script(text, "--threads", str(threads), status=1).err
        assert "point 1 of solid 'body' is so deep in region 'die' of fix 'F'" in said
        assert "fix(F, contact/surface" in said and "Error" not in said


def test_check_counts_what_contact_with_faces_costs(run_interpreted, tmp_path):
    corners = np.array([[0.0, 0.0], [0.9, 0.0], [0.9, 0.31], [0.0, 0.31]])
    meshio.Mesh(corners, {"triangle": [[0, 1, 2], [0, 2, 3]]}).write(tmp_path / "die.vtk")
    lines = f"region(die, mesh, {tmp_path}/die.vtk)", "fix(F, contact/surface, all, die)"
    said = run_interpreted(block(2, *lines, "run_time(1)"), command="check").out
    assert "s or more\n               most of it for fix contact/surface 'F'\n" in said
