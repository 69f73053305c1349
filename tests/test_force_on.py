"""Compute force_on: force, torque and point of action, for every way in which a force can act."""

from textwrap import dedent

import numpy as np
import pytest

pytestmark = pytest.mark.xdist_group("force on")
BOX = """
    method({method}, APIC, linear)
    dimension(2, 0, 2, 0, 2, 0.1)
    region(box, block, 0.7, 1, 0.6, 0.8)
    region(mate, block, 0.8, 1.1, 0.4, 0.6)
    region(wall, block, 0, 2, 0, 0.61)
    region(half, block, 0, 2, 0, 0.7)
    region(left, block, 0, 0.8, 0, 0.7)
    region(edge, block, 0, 2, 0.55, 0.6)
    material(rubber, linear, 1000, 1e5, 0.3)
    solid(box, region, box, {ppc}, rubber, 0.1)
    {solids}
    group(box, particles, region, box, solid, box)
    group(low, nodes, region, half, all)
    group(left, nodes, region, left, all)
    group(edge, nodes, region, edge, all)
    group(lower, particles, region, half, solid, box)
    fix(g, force_particles, box, 180, -510*x)
    {lines}
    compute(F, force_on, g, {parts})
    compute(p, linear_momentum, box)
    compute(L, angular_momentum, box)
    set_dt(1e-3)
    set_output(1)
    log_modify(custom, step, F_x, F_y, F_tz, p_x, p_y, L_z)
    run(4)
"""
MATE = """solid(mate, region, mate, 1, rubber, 0.1)
    translate_particles(mate, region, mate, 0, 0.004)"""
LED = "material(steel, rigid, 1000)\n" + MATE.replace("rubber", "steel")
FREE = LED + "\nfix(m, rigid_body, mate, velocity=(0, 1))"
RUBBER = "material(rubber, linear, 1000, 1e5, 0.3)"
WATER = """eos(water, fluid, 1000, 1e5, 7)
    strength(water, fluid, 10)
    material(rubber, eos-strength, water, water)"""
GRID, PLANE = "ulmpm/contacts", "0, 0.7, 0, 0.1, 1, 0"
# For each way its line, and where others than these: the parts, the further solid, the method.
USUAL = "", "w", "", "ulmpm"
WAYS = {
    "wall": ("velocity_nodes, low, NULL, 0",),
    "bound": ("velocity_nodes, low, NULL, geq0.01",),
    "piston": ("velocity_nodes, low, 0.1, 0.2",),
    "rough wall": ("velocity_nodes, low, NULL, 0, mu=0.2",),
    "two walls": ("velocity_nodes, low, NULL, 0.1)\nfix(v, velocity_nodes, left, 0, 0", "w, v"),
    "weight": ("body_force, all, 1, -10*x0",),
    "nodes": ("force_nodes, low, 3, -10",),
    "traction": ("edge_traction, all, box, xlo, 3e3, 1e3*y",),
    "pressure": ("edge_pressure, lower, box, 1e3",),
    "layer": ("neumann_bc_mech, lower, 3, 4*x",),
    "damping": ("local_damping, all, 0.5",),
    "grip": ("velocity_particles, lower, 0.1, 0.2*time",),
    "quake": ("ground_motion, low, 3*sin(20*time), -9",),
    "edge": ("absorbing, edge, rubber, ylo",),
    "cutting tool": ("cuttingtool, all, 1, 0.8, 0.7, 0, 0, 0, 0, 0.7, 0.5, 0.9, 0.5",),
    "surface": ("contact/surface, all, wall, 0.2", "box"),
    "plane": (f"contact/minimize_penetration/plane, box, {PLANE}, 0.2", "box"),
    "hard plane": (f"impenetrablesurface, all, 10, {PLANE}", "box"),
    "ball": ("indent, all, sphere, 1e5, 0.25, 0.8, 0.4, 0", "box"),
    "hard ball": (
        "indent/minimize_penetration, all, sphere, 0.22, 0.8, 0.4, 0, 0, 0, 0, 0.1", "box"),
    "points, first": ("contact/minimize_penetration, box, mate, 0.3", "box", MATE, "tlmpm"),
    "points, second": ("contact/minimize_penetration, mate, box, 0.3", "box", MATE, "tlmpm"),
    "faces": ("contact/solids, mate, box, 0.3", "box", MATE, "tlmpm"),
    "Hertz": ("contact/hertz, mate, box", "box", MATE, "tlmpm"),
    "grid": ("contact/friction, mate, box, 0.3", "box", MATE, GRID),
    "pair": ("contact/friction, box, mate, 0.3", "w", MATE, GRID),
    "led tool": ("contact/friction, box, mate, 0.3", "box", LED, GRID),
    "free body": ("contact/friction, box, mate, 0.3", "box", FREE, GRID),
    "body in water": ("contact/friction, box, mate, 1000", "box", FREE, GRID),
    "surface of a body": ("contact/rigid_body, all, mate, 0.3", "box", FREE),
    "body at a wall": (
        "velocity_nodes, left, 0, NULL)\nfix(v, contact/rigid_body, all, mate", "w, box", FREE),
}  # fmt: skip
# Tools that the centres of points reach only if these lie near the surface of the box.
NEAR = "cutting tool", "plane", "hard plane", "ball"


def scene_of(way, extra=""):
    """The scene of a way, and its line and method."""
    line, parts, solids, method = (*WAYS[way], *USUAL[len(WAYS[way]) :])
    lines = f"fix(w, {line})" + extra
    ppc = 2 if way in NEAR else 1
    parts = "w" if extra else parts
    text = BOX.format(method=method, lines=lines, parts=parts, solids=solids, ppc=ppc)
    return (text.replace(RUBBER, WATER) if "water" in way else text), line, method


@pytest.mark.parametrize("way", WAYS)
def test_the_force_is_the_change_of_momentum(run_interpreted, way):
    """A body takes the momentum and angular momentum that force_on says (APIC keeps both).

    A log has ten digits. In tlmpm weights belong to reference positions, which differ from the
    present ones by the displacement: 4e-6 of an arm.
    """
    text, _, method = scene_of(way)
    log = run_interpreted(text).log
    force = np.stack([log.F_x, log.F_y, log.F_tz])[:, 2:]
    momentum = np.stack([log.p_x, log.p_y, log.L_z]) / 1e-3
    change, size = np.diff(momentum)[:, 1:], np.abs(force).max()
    assert np.abs(force[:2] - [[180], [-433.5]]).max() > 0.9  # more than the load acts
    exact = 1e-9 * max(size, np.abs(momentum).max())
    assert force[:2] == pytest.approx(change[:2], abs=exact)
    if way == "grip":  # its torque lacks what affine transfers store within points
        exact = 0.05 * size
    assert force[2] == pytest.approx(change[2], abs=4e-6 * size if method == "tlmpm" else exact)


@pytest.mark.parametrize("way", [way for way in WAYS if len(WAYS[way]) > 2 and way != "pair"])
def test_action_is_reaction(run_interpreted, way):
    """Between two solids; friction at points acts between their centres, not at one place."""
    both = "\ncompute(R, force_on, mate)\ncompute(B, force_on, box)"
    script, line, _ = scene_of(way, both)
    columns = "B_x, B_y, B_tz, R_x, R_y, R_tz"
    log = run_interpreted(script.replace("F_x, F_y, F_tz, p_x, p_y, L_z", columns)).log
    action = np.stack([log.B_x, log.B_y, log.B_tz])[:, 1:]
    reaction = np.stack([log.R_x, log.R_y, log.R_tz])[:, 1:]
    size = np.abs(action).max()
    assert size > 1
    assert action[:2] == pytest.approx(-reaction[:2], abs=1e-9 * size)
    tolerance = 2e-4 if "minimize_penetration" in line else 1e-9
    if "solids" in line:  # faces push across, not along the line between the two points
        tolerance = 0.03
    assert action[2] == pytest.approx(-reaction[2], abs=tolerance * size)


TABLE = """
    method(ulmpm/contacts, FLIP, linear, 0.99)
    dimension(2, 0, 1, 0, 0.7, 0.1)
    region(table, block, 0, 1, 0.1, 0.3)
    region(block, block, 0.4, 0.7, 0.3, 0.5)
    material(rubber, neo-hookean, 1000, 1e5, 0.3)
    solid(table, region, table, 2, rubber, 0.1)
    solid(block, region, block, 2, rubber, 0.1)
    region(low, block, INF, INF, INF, 0.1)
    group(low, nodes, region, low, all)
    group(block, particles, region, block, solid, block)
    fix(low, velocity_nodes, low, 0, 0)
    fix(weight, body_force, all, 0, -10)
    fix(push, force_particles, block, {push}, 0)
    fix(rub, contact/friction, block, table, 0.5)
    fix(calm, local_damping, all, 0.8)
    compute(B, force_on, block, x=0.55, y=0.3)
    compute(T, force_on, table)
    compute(S, force_on, low)
    compute(G, force_on, low, weight, push)
    compute(c, center_of_mass, block)
    set_output(1500)
    log_modify(custom, step, B_x, B_y, B_tz, B_px, T_x, T_y, S_y, S_px, G_x, G_y, G_tz, c_x, c_y)
    run(1500)
"""


@pytest.mark.parametrize("push", [0, 30])
def test_a_block_on_a_table_pushed_above_its_foot(run_script, push):
    """The table bears m g below the centre; pushed by F at the height y, F y / m g further on."""
    log = run_script(TABLE.format(push=push)).log
    end = {name: log[name][-1] for name in log}
    assert [end[name] for name in ("B_x", "B_y", "T_x", "T_y", "S_y")] == pytest.approx(
        [-push, 600, push, -600, 2600], abs=6e-7
    )
    assert [end[f"G_{name}"] for name in ("x", "y", "tz")] == pytest.approx([0, 0, 0], abs=6e-7)
    acts_at = 0.55 + end["B_tz"] / end["B_y"]
    assert acts_at == pytest.approx(end["c_x"] + push * (end["c_y"] - 0.3) / 600, abs=1e-8)
    assert end["B_px"] == pytest.approx(acts_at, abs=2e-5)  # of the inclined line, near its foot


TANK = """
    method(ulmpm, APIC, quadratic-spline)
    dimension(2, 0, 1, 0, 1, 0.1)
    region(water, block, 0, 0.6, 0, 0.8)
    eos(water, fluid, 1000, 1e5, 7)
    strength(water, fluid, 10)
    material(water, eos-strength, water, water)
    solid(water, region, water, 2, water, 0.1)
    region(wall, block, 0.6, INF, INF, INF)
    region(other, block, INF, 0, INF, INF)
    region(floor, block, INF, INF, INF, 0)
    group(wall, nodes, region, wall, all)
    group(other, nodes, region, other, all)
    group(floor, nodes, region, floor, all)
    fix(wall, velocity_nodes, wall, 0, NULL)
    fix(other, velocity_nodes, other, 0, NULL)
    fix(floor, velocity_nodes, floor, NULL, 0)
    fix(g, body_force, all, 0, -10)
    fix(calm, local_damping, all, 0.8)
    compute(F, force_on, wall)
    compute(G, force_on, wall, other, floor, g)
    compute(c, max_position, all)
    set_output(500)
    log_modify(custom, step, F_x, F_y, F_px, F_py, G_x, G_y, G_tz, c_y)
    run(1500)
"""


def test_a_wall_holds_water(run_script):
    """rho g H^2/2 at the height H/3, and all walls and the weight balance."""
    log = run_script(TANK).log
    assert log.F_x[-1] == pytest.approx(-1000 * 10 * 0.8**2 / 2, rel=0.01)
    assert log.F_py[-1] == pytest.approx(0.8 / 3, rel=0.01)
    assert log.G_x[-1] == pytest.approx(0, abs=1e-8)
    assert log.G_y[-1] == pytest.approx(0, abs=1)
    assert log.G_tz[-1] == pytest.approx(0.3 * log.G_y[-1], abs=1e-6)  # what is left, in the middle


LOADED = """
    method(ulmpm, FLIP, linear, 1)
    scheme(quasi-static)
    dimension(2, 0, 0.6, 0, 0.4, 0.1)
    region(box, block, 0.2, 0.4, 0.1, 0.3)
    region(low, block, INF, INF, INF, 0.1)
    material(rubber, linear, 1000, 1e6, 0.3)
    solid(box, region, box, 2, rubber, 0.1)
    group(low, nodes, region, low, all)
    fix(low, velocity_nodes, low, 0, 0)
    fix(push, force_particles, all, 30*time, 0)
    fix(weight, body_force, all, 0, -10*time)
    compute(G, force_on, low, push, weight)
    set_dt(0.5)
    set_output(1)
    log_modify(custom, step, low_y, G_x, G_y, G_tz)
    run_time(1)
"""


def test_load_steps_balance(run_interpreted):
    """Torques to the displacement in a step, since loads act where the step begins."""
    log = run_interpreted(LOADED).log
    assert log.low_y[1:] == pytest.approx([200, 400], rel=1e-9)
    assert np.stack([log.G_x, log.G_y]) == pytest.approx(np.zeros((2, 3)), abs=4e-7)
    assert np.abs(log.G_tz).max() < 1e-2  # of 120


SPACE = """
    method(ulmpm, APIC, linear)
    dimension(3, 0, 4, 0, 4, 0, 4, 1)
    region(box, block, 1, 3, 1, 2, 1, 2)
    region(low, block, INF, INF, INF, INF, 0, 1)
    material(rubber, linear, 1, 100, 0.3)
    solid(box, region, box, 1, rubber, 1)
    group(low, nodes, region, low, all)
    fix(push, force_particles, all, 2*y, -x, 3)
    fix(floor, velocity_nodes, low, NULL, 0.1, 0)
    compute(F, force_on, push, floor, x=1, y=2, z=3)
    compute(p, linear_momentum, all)
    compute(L, angular_momentum, all, 1, 2, 3)
    set_dt(1e-2)
    set_output(1)
    log_modify(custom, F_x, F_y, F_z, F_tx, F_ty, F_tz, F_px, F_py, F_pz, {momenta})
    run(4)
"""


def test_in_space_the_point_of_action_is_on_the_central_axis(run_interpreted):
    """Force and torque are rates of momentum; about the point only a torque along F remains."""
    momenta = ", ".join(f"{name}_{axis}" for name in "pL" for axis in "xyz")
    log = run_interpreted(SPACE.format(momenta=momenta)).log
    found = {k: np.stack([log[f"{k}{axis}"] for axis in "xyz"], 1) for k in ("F_", "F_t", "F_p")}
    force, torque, place = found["F_"][2:], found["F_t"][2:], found["F_p"][2:]
    for name, rate in (("p_", force), ("L_", torque)):
        change = np.diff(np.stack([log[f"{name}{axis}"] for axis in "xyz"], 1), axis=0)[1:]
        assert rate == pytest.approx(change / 1e-2, abs=2e-8)
    left = torque - np.cross(place - [1, 2, 3], force)
    assert np.cross(left, force) == pytest.approx(0, abs=1e-6)


WRONG = {
    "nothing": ("compute(F, force_on, nothing)", "there is no solid and no fix 'nothing'"),
    "no force": ("compute(F, force_on, start)", "publishes no force with a torque"),
    "the same grid": ("compute(F, force_on, box)", "box, mate have the same nodes"),
    "a sum": (
        "fix(w, contact/surface, all, wall)\ncompute(F, force_on, box)",
        "acts on box, mate, and its force is their sum",
    ),
    "twice": (
        "fix(w, contact/surface, box, wall)\ncompute(F, force_on, box, w)",
        "the force of 'w' would count twice",
    ),
    "two meanings": ("fix(box, body_force, all, 0, 1)\ncompute(F, force_on, box)", "and a fix"),
    "later": (
        "fix(w, contact/surface, box, wall)\ncompute(F, force_on, box)\n"
        "fix(v, contact/surface, box, wall)\nrun(1)",
        "fixes that act on its solid have been defined or deleted since",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_summed_is_refused(run_interpreted, case):
    lines, message = WRONG[case]
    text = BOX.format(method="ulmpm", solids=MATE, lines="", parts="", ppc=1)
    head = text.partition("    compute(")[0]
    line = "fix(start, initial_velocity_particles, box, 1, 0)"
    done = run_interpreted(f"{dedent(head)}{line}\n{lines}\n", status=1)
    assert message in done.err


AXIS = """
    method(ulmpm, FLIP, linear, 1)
    dimension(2, 0, 1, 0, 1, 0.1)
    axisymmetric(true)
    region(box, block, 0, 0.2, 0, 0.2)
    material(rubber, linear, 1000, 1e5, 0.3)
    solid(box, region, box, 2, rubber, 0.1)
    fix(w, body_force, all, 0, 1)
    compute(F, force_on, w)
    run(1)
"""


def test_around_an_axis_there_is_no_point_of_action(run_interpreted):
    done = run_interpreted(AXIS, status=1)
    assert "compute force_on does not support axisymmetric scenes" in done.err
