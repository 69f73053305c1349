"""Forces of tools, walls and tractions on points, against their formulas point by point."""

import numpy as np
import pytest
from scenes import block
from selection import parameters

# Points of the block: squares (cubes) of side 0.05, rho = 2, G = 100/(2*1.3).
SIDE, RHO, G, DT = 0.05, 2.0, 100 / 2.6, 0.001
AXES = "xyz"


def forces(run, d, fix, *before):
    """Positions (n, d) before the first step, forces (n, d) in it, and the published values."""
    wanted = ", ".join([*AXES[:d], *("b" + axis for axis in AXES[:d])])
    result = run(
        block(
            d, *before, fix, f"dump(d, all, particle, 1, d.*.LAMMPS, {wanted})", f"set_dt({DT})",
            f"log_modify(custom, step, {', '.join('F_' + axis for axis in AXES[:d])})", "run(1)",
        )
    )  # fmt: skip
    first, then = result.dump("d.0.LAMMPS"), result.dump("d.1.LAMMPS")
    x = np.column_stack([first[axis] for axis in AXES[:d]])
    force = np.column_stack([then["b" + axis] for axis in AXES[:d]])
    total = np.array([result.log[f"F_{axis}"][1] for axis in AXES[:d]])
    assert total == pytest.approx(force.sum(axis=0), rel=1e-4, abs=1e-9)
    return x, force


def given(force, scale=1.0):
    """What dumps write with six digits."""
    return pytest.approx(force, rel=1e-5, abs=1e-5 * max(np.abs(force).max(), 1e-30) * scale)


@pytest.mark.parametrize("d", [2, 3])
def test_indent(run_interpreted, d):
    centre = np.array([0.45, 0.55, 0.35])[:d]
    at = ", ".join(f"{c}" for c in [*centre, 0][:3])
    x, force = forces(run_interpreted, d, f"fix(F, indent, all, sphere, 500, 0.13, {at})")
    r = np.linalg.norm(x - centre, axis=1)
    size = RHO * SIDE**d * 500 * np.maximum(0.13 - r, 0) ** 2
    assert 0 < np.count_nonzero(size) < len(size)
    assert force == given((size / r)[:, None] * (x - centre))


@pytest.mark.parametrize("mu", [0, 0.2, 1000])
def test_indent_minimize_penetration_with_friction(run_interpreted, mu):
    """m p/dt^2 along the radius, and mu of it along the slip, up to what stops it: m v/dt."""
    centre, slide = np.array([0.45, 0.55]), 3.0
    fix = (
        f"fix(F, indent/minimize_penetration, all, sphere, 0.1, 0.45, 0.55, 0, {slide}, 0, 0, {mu})"
    )
    x, force = forces(run_interpreted, 2, fix)
    away = x - centre
    r = np.linalg.norm(away, axis=1)[:, None]
    n, m = away / r, RHO * SIDE**2
    push = m * np.maximum(0.1 + SIDE / 2 - r, 0) / DT**2
    slip = np.array([slide, 0]) - n * (n @ [slide, 0])[:, None]
    speed = np.linalg.norm(slip, axis=1)[:, None]
    rub = np.minimum(mu * push, m * speed / DT)
    assert force == given(push * n + rub * slip / np.maximum(speed, 1e-300))


def test_a_free_point_is_taken_out_within_a_step(run_interpreted):
    """One point deep in a wall by p: after the step it touches the wall and no more."""
    fix = "fix(F, contact/minimize_penetration/plane, body, 0.3, 0, 0, 2, 0, 0, 0.5)"
    lines = [fix, f"set_dt({DT})", "compute(c, center_of_mass, all)",
             "log_modify(custom, step, c_x, c_y, F_x)", "run(1)"]  # fmt: skip
    result = run_interpreted(block(2, *lines, ppc=1, size=(0.1, 0.1)))
    # Its centre is at 0.35 and its half side 0.05, so that it touches 0.3 already.
    assert result.log.F_x[1] == pytest.approx(0, abs=1e-9)
    deep = block(2, *lines, ppc=1, size=(0.1, 0.1)).replace("body, 0.3,", "body, 0.32,")
    result = run_interpreted(deep)
    assert result.log.F_x[1] == pytest.approx(RHO * 0.01 * 0.02 / DT**2, rel=1e-9)
    assert result.log.c_x[1] == pytest.approx(0.37, rel=1e-9)
    assert result.log.c_y[1] == pytest.approx(0.35, rel=1e-12)


def test_friction_of_a_plane(run_interpreted):
    """A slow slip is stopped, a fast one is braked by mu of the pressing force."""
    deep, m = 1e-5, RHO * SIDE**2
    fix = f"fix(F, contact/minimize_penetration/plane, body, 0, {0.3 + deep}, 0, 0, 1, 0, 0.3)"
    x, force = forces(
        run_interpreted,
        2,
        fix,
        "fix(v, initial_velocity_particles, all, if(x < 0.45, 0.001, 5), 0)",
    )
    low = x[:, 1] < 0.34
    assert force[low, 1] == pytest.approx(np.full(6, m * deep / DT**2), rel=1e-4)
    slow = low & (x[:, 0] < 0.45)
    assert force[slow, 0] == pytest.approx(np.full(3, -m * 0.001 / DT), rel=1e-5)
    assert force[low & ~slow, 0] == pytest.approx(np.full(3, -0.3 * m * deep / DT**2), rel=1e-4)
    assert not force[~low].any()


@pytest.mark.parametrize("d", [2, 3])
def test_impenetrable_surface(run_interpreted, d):
    """K G p V^(1/d) along the normal, of any length; nothing in front of the plane."""
    x, force = forces(
        run_interpreted, d, "fix(F, impenetrablesurface, all, 0.5, 0.42, 0.35, 0, 3, 4, 0)"
    )
    n = np.array([0.6, 0.8, 0])[:d]
    p = np.maximum((np.array([0.42, 0.35, 0])[:d] - x) @ n, 0)
    assert 0 < np.count_nonzero(p) < len(p)
    assert force == given(0.5 * G * SIDE * p[:, None] * n)


@pytest.mark.parametrize("turned", [False, True])
def test_cutting_tool(run_interpreted, turned):
    """A wedge from (0.4, 0.39) up and to the right, whichever face is A: out of the nearer one."""
    faces = ["0.4, 0.6", "0.6, 0.39"]
    A, B = faces[::-1] if turned else faces
    x, force = forces(
        run_interpreted, 2, f"fix(F, cuttingtool, all, 2, 0.4, 0.39, 0, -1, 0, 0, {A}, {B})"
    )
    right, up = x[:, 0] - 0.4, x[:, 1] - 0.39
    inside = (right > 0) & (up > 0)
    left = inside & (right < up)
    expected = np.zeros_like(x)
    expected[left, 0] = -2 * G * right[left]
    expected[inside & ~left, 1] = -2 * G * up[inside & ~left]
    assert left.any()
    assert (inside & ~left).any()
    assert force == given(expected)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_meld_tool(run_interpreted, axis):
    """A quarter turn leaves a square channel as it is; an eighth turns the way into it."""
    along = AXES.index(axis)
    across = [k for k in range(3) if k != along]
    c = np.array([0.45, 0.4, 0.35])
    lo = 0.31
    for theta in (0, np.pi / 2, np.pi / 4):
        x, force = forces(
            run_interpreted, 3,
            f"fix(F, meldtool, all, 1, {axis}, 0.03, {c[across[0]]}, {c[across[1]]}, {theta},"
            f" {lo}, 2, 0.12)",
        )  # fmt: skip
        expected = np.zeros_like(x)
        for point, row in zip(x, expected, strict=True):
            height, q = point[along] - lo, (point - c)[across]
            r = np.hypot(*q)
            if height < 0 or r > 0.12:
                continue
            turned = np.exp(-1j * theta) * complex(*q)
            into = complex(*np.clip([turned.real, turned.imag], -0.03, 0.03)) - turned
            into *= np.exp(1j * theta)
            ways = [np.zeros(3) for _ in range(3)]
            ways[0][across] = into.real, into.imag
            ways[1][across] = q * (0.12 - r) / r
            ways[2][along] = -height
            row[:] = G * min(ways, key=np.linalg.norm)
        assert expected.any()
        # Ways of equal length are told apart by rounding: compare how long they are there.
        assert np.linalg.norm(force, axis=1) == pytest.approx(
            np.linalg.norm(expected, axis=1), rel=1e-4, abs=1e-4
        )
        same = np.isclose(force, expected, rtol=1e-4, atol=1e-4).all(axis=1)
        assert same.mean() > 0.8


@pytest.mark.parametrize("d", [1, 2, 3])
def test_traction(run_interpreted, d):
    """f = t A with A = 1, V^(1/2), V^(2/3): over a whole side, the traction times its area."""
    load = ", ".join(["-7*(1 + 2*y0)" if d > 1 else "-7", "3", "NULL"][:d])
    x, force = forces(
        run_interpreted, d, f"fix(F, neumann_bc_mech, face, {load})",
        "region(end, block, 0.55, INF" + ", -INF, INF" * (d - 1) + ")",
        "group(face, particles, region, end, all)",
    )  # fmt: skip
    end = x[:, 0] > 0.55
    size = SIDE ** (d - 1)
    expected = np.zeros_like(x)
    expected[end, 0] = -7 * size * (1 + 2 * x[end, 1] if d > 1 else 1)
    if d > 1:
        expected[end, 1] = 3 * size
        assert force[:, 1].sum() == pytest.approx(3 * 0.2 * (0.1 if d == 3 else 1), rel=1e-5)
    assert force == given(expected)


@pytest.mark.parametrize(
    ("d", "tools"),
    parameters(
        [
            (
                2,
                [
                    "indent, all, sphere, 500, 0.13, 0.45, 0.55 - time, 0",
                    "indent/minimize_penetration, all, sphere, 0.1, 0.3, 0.54, 0, 1, 0, 0, 0.3",
                    "contact/minimize_penetration/plane, body, 0, 0.3001, 0, 0, 1 + time, 0, 0.3",
                    "impenetrablesurface, all, 0.5, 0.42, 0.35, 0, 3, 4, 0",
                    "cuttingtool, all, 2, 0.4 + time, 0.39, 0, -1, 0, 0, 0.4, 0.6, 0.6, 0.39",
                    "neumann_bc_mech, all, -7*(1 + x), 3",
                ],
            )
        ],
        [(3, ["meldtool, all, 1, y, 0.03, 0.4, 0.35, 9*time, 0.31, 2, 0.12"])],
    ),
)
def test_compiled_tools_exert_the_same_forces(run_script, run_interpreted, d, tools):
    fixes = [f"fix(F{k}, {tool})" for k, tool in enumerate(tools)]
    columns = ", ".join(f"F{k}_{axis}" for k in range(len(tools)) for axis in "xy")
    lines = [*fixes, "set_dt(0.001)", "set_output(1)", f"log_modify(custom, step, {columns})"]
    script = block(d, "fix(v, initial_velocity_particles, all, 1, 0, 0)", *lines, "run(3)")
    compiled, interpreted = [run(script).log for run in (run_script, run_interpreted)]
    for name in compiled:
        assert compiled[name] == pytest.approx(interpreted[name], rel=1e-9, abs=1e-9)
    assert all(np.abs(compiled[name]).max() > 0 for name in compiled if name.endswith("_y"))


def test_force_of_the_moduli_of_a_run(run_script):
    """Solids after the fix count, as do moduli changed between runs, and damage of metals."""
    script = block(
        2,
        "fix(F, impenetrablesurface, all, 0.5, 0, 0.35, 0, 0, 1, 0)",
        "region(other, block, 0.7, 0.9, 0.3, 0.5)",
        "eos(bulk, linear, 2, 100)",
        "strength(steel, plastic, 40, 1e9)",
        "damage(breaks, damage_johnson_cook, 1, 0, 0, 0, 0, 1, 300, 1000)",
        "material(metal, eos-strength, bulk, steel, breaks)",
        "solid(metal, region, other, 2, metal, 0.1)",
        "set_dt(1e-4)", "set_output(1)", "log_modify(custom, step, F_y)", "run(1)",
        "modify(material, rubber, E=200)", "run(1)",
    )  # fmt: skip
    rubber, metal = (0.5 * n * SIDE * 0.025 for n in (6, 4))
    forces = run_script(script).log["F_y"]
    assert forces[1] == pytest.approx(rubber * G + metal * 40, rel=1e-3)
    assert forces[-1] == pytest.approx(rubber * 2 * G + metal * 40, rel=1e-2)


def test_traction_around_an_axis(run_interpreted):
    """A pressure on the outer face acts at the radius of the points: t r dz per radian."""
    script = block(
        2, "region(end, block, 0.55, INF, -INF, INF)", "group(face, particles, region, end, all)",
        "fix(F, neumann_bc_mech, face, -7, NULL)", "log_modify(custom, step, F_x)", "set_dt(0.001)",
        "run(1)",
    )  # fmt: skip
    log = run_interpreted(script.replace("region(box", "axisymmetric(true)\nregion(box")).log
    assert log.F_x[1] == pytest.approx(-7 * 0.575 * 0.2, rel=1e-9)


def test_static_column_under_traction(run_interpreted):
    """A column with a step load oscillates about sigma = t: its mean over a period is the load.

    E = 2, rho = 2 and nu = 0: waves at 1, period 4 L = 1.2 for a fixed foot.
    """
    script = block(
        1, "region(end, block, 0.55, INF)", "group(face, particles, region, end, all)",
        "region(low, block, INF, 0.3)", "group(foot, nodes, region, low, all)",
        "fix(F, neumann_bc_mech, face, -0.01)", "fix(hold, velocity_nodes, foot, 0)",
        "compute(s, average_stress, all)", "log_modify(custom, step, time, s_11)",
        "set_dt(0.006)", "run(200)",
    )  # fmt: skip
    log = run_interpreted(script.replace("linear, 2, 100, 0.3", "linear, 2, 2, 0")).log
    # Three cells, and a load half a point inside of the end: a tenth.
    assert log.s_11[1:].mean() == pytest.approx(-0.01, rel=0.1)


@pytest.mark.full
def test_indentation_after_hertz(run_script):
    """A quarter of a block under a frictionless ball: 4/3 E* sqrt(R) delta^1.5, within 10 %.

    Where the contact is three to four cells wide. With fewer the grid is too soft, later the block
    of one side is: its foot is held, and five times the radius of contact away.
    """
    walls = [
        line
        for k, axis in enumerate("xyz")
        for line in (
            f"region({axis}0, block, " + ", ".join("INF, 0.001" if j == k else "INF, INF"
                                                   for j in range(3)) + ")",
            f"group(g{axis}, nodes, region, {axis}0, all)",
            f"fix(s{axis}, velocity_nodes, g{axis}, "
            + ", ".join("0" if j == k else "NULL" for j in range(3)) + ")",
        )
    ]  # fmt: skip
    log = run_script(
        "\n".join([
            "method(ulmpm, FLIP, linear, 0.95)", "h = 0.0625",
            "dimension(3, 0, 1.25, 0, 1.25, 0, 1.25, h)", "region(box, block, 0, 1, 0, 1, 0, 1)",
            "material(m, neo-hookean, 1, 1000, 0.3)", "solid(body, region, box, 2, m, h, 0)",
            *walls, "R = 2", "delta = time/24",
            "fix(F, indent/minimize_penetration, all, sphere, R, 0, 0, 1 + R - delta, 0, 0, 0, 0)",
            "hertz = 1000/(1 - 0.3^2)*R^0.5*delta^1.5/3", "set_output(40)",
            "log_modify(custom, step, delta, F_z, hertz)", "run_time(0.72)",
        ])
    ).log  # fmt: skip
    wide = (log.delta > 0.015) & (log.delta < 0.03)
    assert wide.sum() > 5
    assert -log.F_z[wide] == pytest.approx(log.hertz[wide], rel=0.1)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("fix(F, indent, all, cube, 1, 1, 0, 0, 0)", "the word sphere"),
        ("fix(F, indent, all, sphere, 1, 1, 0, 0, 5)", "more components than the 2"),
        ("fix(F, body_force, all, 1, 1, 0, 0)", "4 components, but there are at most 3"),
        ("fix(F, meldtool, all, 1, x, 0.1, 0, 0, 0, 0, 1, 0.3)", "a domain in 3D"),
        ("fix(F, cuttingtool, all, 1, 0, 0, 0, 0, 0, 0, 1, 1, 2, 2)", "lie in one line"),
        ("fix(F, impenetrablesurface, all, 1, 0, 0, 0, 0, 0, 0)", "normal has no direction"),
        ("fix(F, contact/minimize_penetration/plane, body, 0, 0, 0, 0, 1, 0, -1)", "at least 0"),
    ],
)
def test_what_tools_refuse(run_interpreted, line, says):
    assert says in run_interpreted(block(2, line), status=1).err


@pytest.mark.parametrize(
    ("tool", "says"),
    [
        ("impenetrablesurface, all, 1, 0.2, 0, 0, LATER, 0, 0", "the normal has no direction"),
        ("cuttingtool, all, 1, 0, 0, 0, 0, 0, 0, 0, 0.1, LATER, 0.1", "tip, A and B lie in one"),
    ],
)
def test_a_shape_that_becomes_undefined_stops_the_run(run_script, tool, says):
    fix = f"fix(F, {tool})".replace("LATER", "if(time < 0.005, 0.1, 0)")
    err = run_script(block(2, fix, f"set_dt({DT})", "run(10)"), status=1).err
    assert f"fix F: {says}" in err


def test_a_tool_needs_a_shear_modulus(run_interpreted):
    text = block(2, "fix(F, impenetrablesurface, all, 1, 0, 0, 0, 0, 1, 0)")
    fluid = "eos(e, fluid, 2, 100, 7)\nstrength(s, fluid, 0)\nmaterial(rubber, e, s)"
    text = text.replace("material(rubber, linear, 2, 100, 0.3)", fluid)
    assert "has no shear modulus" in run_interpreted(text, status=1).err


@pytest.mark.parametrize(
    "style", ["contact/minimize_penetration/plane, body", "impenetrablesurface, all, 1"]
)
@pytest.mark.parametrize(("normal", "says"), [(-1, "all points"), (1, "8 of 24 points")])
def test_a_body_that_begins_behind_a_plane_is_told(run_interpreted, style, normal, says):
    """The block from 0.3 to 0.6, a plane at 0.4 with the normal to the body, or away from it."""
    place = 0.4 if normal > 0 else 0.2
    mu = ", 0" * ("contact" in style)
    fix = f"fix(F, {style}, {place}, 0, 0, {normal}, 0, 0{mu})"
    result = run_interpreted(block(2, fix, "set_dt(1e-9)", "run(1)"), status=None)
    assert f"points behind the plane of fix 'F': {says} of its group begin there" in result.err
    touching = block(2, fix.replace("0.4", "0.3"), "set_dt(1e-9)", "run(1)")
    if normal > 0:
        assert "behind" not in run_interpreted(touching).err


def test_a_ball_outside_the_domain_is_told(run_interpreted):
    """As of 2019, with x, y, z, R, K: K is taken for z, far away, and nothing touches."""
    for order, told in (("0.4, 0.4, 0.4, 0.2, 1e3", True), ("1e3, 0.2, 0.4, 0.4, 0.4", False)):
        fix = f"fix(F, indent, all, sphere, {order})"
        err = run_interpreted(block(3, fix, "run(0)"), folder=order[:3], command="check").err
        assert ("hint: K and R come before x, y, z" in err) == told


def test_a_body_that_begins_in_a_ball_is_told(run_interpreted):
    """A ball that reaches the middle of the block's 0.3 x 0.2, or one beside it."""
    for x, told in (("0.3", True), ("-0.3", False)):
        fix = f"fix(F, indent/minimize_penetration, all, sphere, 0.15, {x}, 0.4, 0, 0, 0, 0, 0)"
        err = run_interpreted(block(2, fix, "run(0)"), folder=x, command="check").err
        assert ("points in the ball of fix 'F': " in err) == told
