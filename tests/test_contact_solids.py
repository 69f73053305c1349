"""Fix contact/solids: faces of two solids push each other."""

from math import cos, radians, sin

import meshio
import numpy as np
import pytest
from test_contact_points import H, bodies

from comparisons import defaults
from karamelo_py.kernels.pairs import Push, TwoBodies, cells_for, push_apart
from karamelo_py.points.bodies import MeetingFaces
from karamelo_py.points.kinematics import KINEMATICS

SLOPE = (defaults.INPUTS / "in.slope_solids").read_text("utf-8")


def slope(**values) -> str:
    """The slope with the two components of the contact force on the block in its log."""
    text = SLOPE.replace("time, along)", "time, along, rub_x, rub_y)").replace("time(T/50)", "1")
    for name, value in values.items():
        assert f"\n{name} = " in text
        head, _, tail = text.partition(f"\n{name} = ")
        text = f"{head}\n{name} = {value}\n{tail.partition(chr(10))[2]}"
    return text


@pytest.mark.parametrize("d", [1, 2, 3])
def test_force_of_two_faces(run_interpreted, d):
    """m/2 p / dt^2 for equal masses on the whole face, or where faces are opposite two halves.

    Points at edges are balls: half a point aside, they touch the inner points alone.
    """
    lines = ("log_modify(custom, step, c_x, c_y)", "set_dt(0.001)", "run(1)")
    script = bodies(-0.01, "contact/solids, a, b", *lines, d=d, n=3, ppc=1)
    force = -0.5 * 0.1**d * 0.01 / 1e-6
    log = run_interpreted(script).log
    assert log.c_x[-1] == pytest.approx(3 ** (d - 1) * force, rel=1e-8)
    if d > 1:
        shift = f"translate_particles(b, region, b, 0, 0.05{', 0' * (d - 2)})"
        fix = "fix(c, contact/solids, a, b)"
        shifted = script.replace("fix(v1", f"{fix}\n{shift}\nfix(v1", 1).replace(
            f"\n{fix}\ncomp", "\ncomp"
        )
        log = run_interpreted(shifted).log
        assert log.c_x[-1] == pytest.approx(1.5 * force, rel=1e-8)
        assert log.c_y[-1] == 0


@pytest.mark.parametrize("d", [1, 2, 3])
def test_force_does_not_depend_on_how_points_are_opposite(d):
    """A face of width 1 above a plane of such faces: m/2 p / dt^2 wherever it is.

    Cones, as in 2D, add up to 0.97 to 1.17 of it in 3D. Hats of a square would be exact, but the
    sides of a face have no known directions.
    """
    rng = np.random.default_rng(1)
    place = np.stack(np.meshgrid(*[np.arange(-3.0, 4.0)] * (d - 1), [0.95]), -1).reshape(-1, d)
    n = len(place)
    up = np.eye(d)[-1]
    face = np.array([[*up, 0.5, 1, 1], *[[*-up, 0.5, 1, 1]] * n])
    sums = []
    for shift in rng.uniform(-0.5, 0.5, (30, d - 1)):
        x = np.array([[*shift, 0.0], *place])
        size, radius = np.ones(n + 1), np.full(n + 1, 1.5)
        none = np.zeros((n + 1, 0))
        two = TwoBodies(x, 0 * x, size, radius, np.zeros_like(x), none, face, 1)
        push = Push(MeetingFaces(0.0), KINEMATICS[d](), np.inf, 0.1, 0.1, 0.1)
        assert push_apart(push, two, cells_for(n + 1)) > 0
        sums.append(two.force[0])
    exact = -0.5 * 0.05 / 0.1**2 * up
    assert np.array(sums) == pytest.approx(
        np.tile(exact, (30, 1)), rel=0.045 if d == 3 else 1e-9, abs=1e-12
    )


def box_as_file(d: int, folder, lo, hi) -> str:
    """A region style and its argument for a box; 12 triangles of a surface, or two in 2D."""
    ends = np.array([lo, hi])
    x = np.stack(np.meshgrid(*ends.T, indexing="ij"), -1).reshape(-1, d)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    sides = [(0, 2, 3, 1)] if d == 2 else sides
    name = folder / ("b.vtk" if d == 2 else "b.stl")
    triangles = [(a, b, c) for a, b, c, _ in sides] + [(a, c, e) for a, _, c, e in sides]
    if d == 2:
        x = np.column_stack([x, np.zeros(4)])
    meshio.Mesh(x, {"triangle": np.array(triangles)}).write(name)
    return f"{'mesh' if d == 2 else 'stl'}, {name}"


@pytest.mark.parametrize("d", [2, 3])
def test_regions_from_files(run_interpreted, tmp_path, d):
    """A box from a file has the faces of a region block."""
    lines = ("log_modify(custom, step, c_x, c_y)", "set_dt(0.001)", "run(1)")
    script = bodies(-0.01, "contact/solids, a, b", *lines, d=d, n=3, ppc=1)
    lo = np.array([0.79, 0.5, 0.5])[:d]
    head, _, tail = script.partition("region(b, ")
    rest = tail.partition("\n")[2]
    given = f"{head}region(b, {box_as_file(d, tmp_path, lo, lo + 3 * H)})\n{rest}"
    log = run_interpreted(given).log
    assert log.c_x[-1] == pytest.approx(-0.5 * 0.1 * 3 ** (d - 1) * H ** (d - 1) * 1e4, rel=1e-6)
    assert log.c_y[-1] == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("start", [0, -0.3])
def test_force_on_rings(run_interpreted, start):
    """Axisymmetric cylinders meet: m/2 p / dt^2 for each ring, per radian, from the axis on."""
    log = run_interpreted(f"""
        method(tlmpm, FLIP, linear, 1)
        dimension(2, 0, 1, 0, 2, {H})
        axisymmetric(true)
        region(a, block, {start}, 0.3, 0.5, 0.8)
        region(b, block, {start}, 0.3, 0.79, 1.09)
        material(m, neo-hookean, 1, 100, 0.3)
        solid(a, region, a, 1, m, {H})
        solid(b, region, b, 1, m, {H})
        fix(c, contact/solids, a, b)
        log_modify(custom, step, c_x, c_y)
        set_dt(0.001)
        run(1)
    """).log
    assert log.c_y[-1] == pytest.approx(-0.5 * H * 0.3**2 / 2 * 0.01 / 1e-6, rel=1e-8)
    assert log.c_x[-1] == pytest.approx(0, abs=1e-9)


def test_three_solids_in_a_row(run_interpreted):
    """Fixes of two pairs add up: the middle cube is in balance, and momentum is conserved."""
    lines = ("log_modify(custom, step, c_x, e_x, va_x, vb_x, vc_x)", "set_dt(0.001)", "run(1)")
    script = bodies(-0.01, "contact/solids, a, b", *lines, d=3, n=2, ppc=1)
    third = (
        "region(c, block, 0.88, 1.08, 0.5, 0.7, 0.5, 0.7)", f"solid(c, region, c, 1, m, {H}, 0)",
        "group(c, particles, region, c, solid, c)", "fix(e, contact/solids, b, c)",
        "compute(vc, average_velocity, c)",
    )  # fmt: skip
    log = run_interpreted(script.replace("compute(va", "\n".join(third) + "\ncompute(va", 1)).log
    assert log.c_x[-1] == pytest.approx(-0.5 * 0.1 * 0.04 * 1e4, rel=1e-8)
    assert log.e_x[-1] == pytest.approx(log.c_x[-1], rel=1e-8)
    assert log.vb_x[-1] == pytest.approx(-0.1, rel=1e-8)
    assert log.va_x + log.vb_x + log.vc_x == pytest.approx([0, 0], abs=1e-9)


def forces(log, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Forces of contact on the block, out of the slope and down along it."""
    c, s = cos(radians(angle)), sin(radians(angle))
    return log.rub_x * s + log.rub_y * c, log.rub_x * c - log.rub_y * s


def test_faces_that_lean_to_the_grid_are_smooth(run_script):
    """Without friction all of the force is across, also at the edges of the block.

    If edges push along separate normals, as much is along the slope as across it.
    """
    across, along = forces(run_script(slope(refine=2, mu=0, T=0.01)).log, 20)
    assert across.max() > 1000
    assert along == pytest.approx(0, abs=1e-3 * across.max())


def test_friction_is_that_of_coulomb(run_script):
    """Over two bounces of the block, after the first one, in which it begins to slide."""
    log = run_script(slope(angle=27, mu=0.25, T=0.3)).log
    across, along = (force[log.Time > 0.1] for force in forces(log, 27))
    assert along.sum() == pytest.approx(-0.25 * across.sum(), rel=0.015)


@pytest.mark.full
@pytest.mark.parametrize(("mu", "rolls"), [(0.3, True), (0.05, False)])
def test_disk_on_a_plane(run_script, mu, rolls):
    """It rolls with 2/3 of g sin, or slides with g (sin - mu cos); 8 cells in its radius."""
    angle = radians(20)
    log = run_script(f"""
        method(tlmpm, FLIP, linear, 1)
        dimension(2, -1, 4, -0.4, 1.5, 0.0625)
        region(disk, cylinder, 0, 0.5, 0.5)
        region(floor, block, -1, 4, -0.3, 0)
        material(m, neo-hookean, 1000, 1e6, 0.3)
        material(rock, rigid, 1000)
        solid(disk, region, disk, 2, m, 0.0625)
        solid(base, region, floor, 2, rock, 0.0625)
        fix(rub, contact/solids, disk, base, {mu})
        group(disk, particles, region, disk, solid, disk)
        slowly = min(1, time/0.1)
        fix(g, body_force, all, {10 * sin(angle)}*slowly, {-10 * cos(angle)}*slowly)
        compute(v, average_velocity, disk)
        set_output(1)
        log_modify(custom, step, time, v_x)
        run_time(1)
    """).log
    late = log.Time > 0.3
    exact = 10 * sin(angle) / 1.5 if rolls else 10 * (sin(angle) - mu * cos(angle))
    found = np.polyfit(log.Time[late], log.v_x[late], 1)[0]
    assert found == pytest.approx(exact, rel=0.02)


def test_momentum_is_conserved(run_interpreted):
    lines = ("log_modify(custom, step, va_x, vb_x, c_x)", "set_output(1)", "run(6)")
    log = run_interpreted(bodies(-0.01, "contact/solids, a, b, 0.2", *lines, d=2, n=2)).log
    assert np.abs(log.va_x + log.vb_x).max() < 1e-15
    assert log.c_x[1] < 0


MESSAGES = {
    "method": (("ulmpm",), "it needs a separate grid for each solid"),
    "named twice": (("tlmpm", "a, a"), "'a' is named twice"),
    "negative": (("tlmpm", "a, b, -0.1"), "-0.1"),
}


@pytest.mark.parametrize("given, said", MESSAGES.values(), ids=MESSAGES)
def test_messages(run_interpreted, given, said):
    method, names = (*given, "a, b")[:2]
    script = bodies(0, f"contact/solids, {names}", "run(1)", method=method)
    assert said in run_interpreted(script, status=1).err


def test_solids_must_be_in_their_regions(run_interpreted, tmp_path):
    moved = bodies(0.01, "contact/solids, a, b", "run(1)").replace(
        "fix(c,", "region(all, block, INF, INF)\ntranslate_particles(b, region, b, 0.2)\nfix(c,"
    )
    assert "was moved out of its region" in run_interpreted(moved, status=1).err
    (tmp_path / "run").mkdir(exist_ok=True)
    (tmp_path / "run" / "one.csv").write_text("x,volume\n1.05,0.1\n")
    given = bodies(0.01, "contact/solids, a, b", "run(1)").replace(
        "solid(b, region, b, 2, m, 0.1, 0)", "solid(b, points, one.csv, m, 0.1)"
    )
    assert "does not fill a region" in run_interpreted(given, status=1).err


def test_solids_must_be_two_points_thick(run_interpreted):
    script = bodies(0.01, "contact/solids, a, b", "run(1)", n=1, ppc=1)
    assert "is only one point thick" in run_interpreted(script, status=1).err
