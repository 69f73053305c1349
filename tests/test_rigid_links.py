"""Fixes contact/bodies and joint: rigid bodies that touch each other, and joints between them."""

from math import cos, radians, sin

import numpy as np
import pytest
from going_on import goes_on, with_files
from selection import parameters

pytestmark = pytest.mark.xdist_group("rigid links")
SCENE = """
method(ulmpm, FLIP, linear, 1)
dimension(2, 0, 20, 0, 12, 1)
material(steel, rigid, 1000)
{solids}
scheme(musl, start=half)
{lines}
set_dt({dt})
set_output({every})
log_modify(custom, step, time, {names})
run({steps})
"""
g, ALPHA = 9.81, radians(20)


def body(ID, shape, given="", material="steel", ppc=2):
    solid = f"region({ID}, {shape})\nsolid({ID}, region, {ID}, {ppc}, {material}, 1)\n"
    return solid, f"fix({ID}, rigid_body, {ID}, mass=1, {given})\n".replace(", )", ")")


def scene(bodies, more, names, dt=0.01, steps=40, every=1, regions=""):
    solids = regions + "".join(one for one, _ in bodies)
    lines = "".join(line for _, line in bodies) + more
    return SCENE.format(solids=solids, lines=lines, names=names, dt=dt, steps=steps, every=every)


def energy_of(log, IDs, inertia):
    velocities = [[log[f"{ID}_{name}"] for name in ("vx", "vy", "wz")] for ID in IDs]
    return sum(vx**2 + vy**2 + inertia * w**2 for vx, vy, w in velocities) / 2


def names_of(*IDs):
    return ", ".join(f"{ID}_{name}" for ID in IDs for name in ("x", "y", "vx", "vy", "wz"))


@pytest.mark.parametrize("shape", ["cylinder", "block"])
@pytest.mark.parametrize("mu", [0, 0.3])
def test_two_bodies_collide_obliquely(run_interpreted, mu, shape):
    """Momentum and angular momentum to round-off; without friction elastic, with it no gain."""
    first, second = "cylinder, 2, 5, 0.5", "cylinder, 4, 5.5, 0.5"
    if shape == "block":
        first, second = "block, 1.5, 2.5, 4.5, 5.5", "block, 3.5, 4.5, 5.1, 6.1"
    L = " + ".join(f"0.125*{k}_wz + ({k}_x - 4)*{k}_vy - ({k}_y - 5)*{k}_vx" for k in "ab")
    a = body("a", first, "inertia=0.125, velocity=(3, 0), spin=2")
    b = body("b", second, "inertia=0.125, velocity=(-1, 0.2)")
    touch = f"fix(t, contact/bodies, a, b, mu={mu}, restitution=1)\n"
    touch += f"L = {L}\npx = a_vx + b_vx\npy = a_vy + b_vy\n"
    text = scene([a, b], touch, names_of("a", "b") + ", t_x, a_fx, px, py, L", dt=0.04, steps=14)
    log = run_interpreted(text).log
    energy = energy_of(log, "ab", 0.125)
    assert np.ptp(log.a_vx) > 1
    for total in (log.px, log.py, log.L):  # L about (4, 5)
        assert total == pytest.approx(np.full(15, total[0]), abs=2e-10)
    assert log.t_x == pytest.approx(log.a_fx) and np.abs(log.t_x).max() > 1
    if mu == 0:
        assert energy == pytest.approx(np.full(15, energy[0]), rel=1e-8)
    else:
        assert energy.max() <= energy[0] * (1 + 1e-9) and energy[-1] < 0.999 * energy[0]


def test_newtons_cradle(run_interpreted):
    """Of four balls that touch the last one leaves, with the speed of the first."""
    x, speeds = (2, 4, 5, 6, 7), (1, 0, 0, 0, 0)
    balls = [
        body(f"b{k}", f"cylinder, {x[k]}, 5, 0.5", f"inertia=0.125, velocity=({speeds[k]}, 0)")
        for k in range(5)
    ]
    IDs = ", ".join(f"b{k}" for k in range(5))
    more = f"fix(t, contact/bodies, {IDs}, mu=0.2, restitution=1)\n"
    names = ", ".join(f"b{k}_vx" for k in range(5))
    log = run_interpreted(scene(balls, more, names, dt=0.1, steps=15)).log
    assert [log[f"b{k}_vx"][-1] for k in range(5)] == pytest.approx([0, 0, 0, 0, 1], abs=1e-9)


@pytest.mark.parametrize("heavy", [1, 1000])
def test_a_stack_rests(run_interpreted, heavy):
    """Three boxes on a floor, the last one up to 1000 times as heavy; it bears their weights."""
    fall = "gravity=(0, -10)"
    boxes = [body("a", "block, 5, 6, 1, 2", fall), body("b", "block, 5.05, 6.05, 2, 3", fall)]
    solid, line = body("c", "block, 5, 6, 3, 4", fall)
    boxes.append((solid, line.replace("mass=1", f"mass={heavy}")))
    more = "fix(t, contact/bodies, floor, a, b, c, mu=0.5)\n"
    floor = "region(floor, block, INF, INF, INF, 1)\n"
    names = "a_x, a_y, b_x, b_y, c_x, c_y, c_rz, t_y, a_fy"
    log = run_interpreted(scene(boxes, more, names, dt=1e-3, steps=15, regions=floor)).log
    for name in ("a_x", "b_x", "c_x", "a_y", "b_y", "c_y", "c_rz"):
        assert np.ptp(log[name]) < 1e-8 * heavy
    assert log.t_y[-1] == pytest.approx(-10 * (2 + heavy), rel=5e-3)
    assert log.a_fy[-1] == pytest.approx(10, abs=1e-3 * heavy)


@pytest.mark.parametrize(("mu", "d"), parameters([(0.06, 2), (0.5, 3)], [(0.5, 2), (0.06, 3)]))
def test_a_ball_on_a_slope(run_interpreted, mu, d):
    """2/3 or 5/7 of g sin(alpha) as it rolls; g (sin - mu cos), and the spin of friction."""
    k = {2: 0.5, 3: 0.4}[d]  # inertia / (m R^2)
    down = f"{g * sin(ALPHA)}, {'0, ' * (d - 2)}{-g * cos(ALPHA)}"
    inertia = {2: "0.5", 3: "(0.4, 0.4, 0.4)"}[d]
    shape = {2: "cylinder, 3, 2, 1", 3: "sphere, 3, 5, 2, 1"}[d]
    ball = body("a", shape, f"inertia={inertia}, gravity=({down})")
    floor = "region(floor, block, INF, INF, INF, {}1)\n".format("INF, INF, " * (d - 2))
    spin = {2: "a_wz", 3: "a_wy"}[d]
    more = f"fix(t, contact/bodies, a, floor, mu={mu})\n"
    text = scene(
        [ball], more, f"a_vx, {spin}, t_x", dt=1e-2, steps=20 if d == 2 else 5, regions=floor
    )
    if d == 3:
        text = text.replace("dimension(2, 0, 20, 0, 12, 1)", "dimension(3, 0, 12, 0, 9, 0, 9, 1)")
    log = run_interpreted(text).log
    rolls = mu > 0.2
    along = g * sin(ALPHA) / (1 + k) if rolls else g * (sin(ALPHA) - mu * cos(ALPHA))
    turns = along if rolls else mu * g * cos(ALPHA) / k
    rates = (np.polyfit(log.Time[1:], np.abs(v[1:]), 1)[0] for v in (log.a_vx, log[spin]))
    assert list(rates) == pytest.approx([along, turns], rel=1e-3 if rolls else 1e-4)


@pytest.mark.parametrize("mu", [0.2, 0.4])
def test_a_box_on_a_slope(run_interpreted, mu):
    """It slides with g (sin - mu cos), or is held; the floor is a plane that leans."""
    flat = f"gravity=({g * sin(ALPHA)}, {-g * cos(ALPHA)})"
    box = body("a", "block, 8, 9, 5, 5.5", flat)
    floor = "region(floor, plane, 0, 5, 0, -1)\n"
    more = f"fix(t, contact/bodies, a, floor, mu={mu})\n"
    log = run_interpreted(scene([box], more, "a_vx, a_wz", steps=20, regions=floor)).log
    rate = np.polyfit(log.Time[1:], log.a_vx[1:], 1)[0]
    exact = max(0.0, g * (sin(ALPHA) - mu * cos(ALPHA))) if mu < 0.36 else 0.0
    assert rate == pytest.approx(exact, rel=1e-4, abs=1e-3)
    assert np.abs(log.a_wz).max() < 1e-3


@pytest.mark.parametrize(("speed", "e"), [(10, 0), (50, 0.5)])
def test_nothing_passes_a_thin_wall(run_interpreted, speed, e):
    """A ball of one cell and a held wall of 0.2 cells, up to 0.5 cells per step."""
    ball = body("a", "cylinder, 4, 5, 0.5", f"velocity=({speed}, 0)")
    wall = body("w", "block, 6, 6.2, 3, 7", "motion=(0, 0), turning=0", ppc=4)
    more = f"fix(t, contact/bodies, a, w, restitution={e})\n"
    log = run_interpreted(scene([ball, wall], more, "a_x, a_vx", steps=18)).log
    assert log.a_x.max() <= 5.5 + 2e-6 * speed
    assert log.a_vx[-1] == pytest.approx(-e * speed, abs=2e-5 * speed)


def test_a_chain_of_two_hinges_swings(run_interpreted):
    """Its energy stays, and its joints hold; a first one holds it to the ground."""
    fall = "inertia=0.4, gravity=(0, -10)"
    first, second = (
        body("a", "block, 10, 12, 9.5, 10.5", fall),
        body("b", "block, 12, 14, 9.5, 10.5", fall),
    )
    more = "fix(pin, joint, hinge, a, at=(10, 10))\nfix(elbow, joint, hinge, a, b, at=(12, 10))\n"
    names = names_of("a", "b") + ", a_rz, b_rz, elbow_y, b_fy"
    log = run_interpreted(scene([first, second], more, names, dt=0.01, steps=40)).log
    energy = energy_of(log, "ab", 0.4)
    # Velocities belong to the middle of a step.
    energy += 10 * sum(log[f"{ID}_y"] - 0.005 * log[f"{ID}_vy"] - 10 for ID in "ab")
    assert log.b_y.min() < 9.5 and np.abs(energy).max() < 5e-3 * 40
    end = np.stack([log.a_x + np.cos(log.a_rz), log.a_y + np.sin(log.a_rz)])
    begin = np.stack([log.b_x - np.cos(log.b_rz), log.b_y - np.sin(log.b_rz)])
    assert np.abs(end - begin).max() < 2e-3  # of the order of dt^2
    assert log.elbow_y == pytest.approx(-log.b_fy)


def test_action_is_reaction_of_links(run_interpreted):
    """A chain of two bodies, on which a third one lies: what joints and contact exert is theirs."""
    solids, lines, fall = "", "", "gravity=(0, -10)"
    shapes = "block, 10, 12, 9.5, 10.5", "block, 12, 14, 9.5, 10.5", "block, 12.5, 13.5, 10.5, 11.5"
    for ID, shape in zip("abc", shapes, strict=True):
        one, move = body(ID, shape, fall)
        solids, lines = solids + one, lines + move.replace("fix(", "fix(m")
    lines += "fix(pin, joint, hinge, a, at=(10, 10))\nfix(elbow, joint, hinge, a, b, at=(12, 10))\n"
    lines += "fix(t, contact/bodies, b, c, mu=0.3)\n"
    IDs = {"A": "a", "B": "b", "C": "c", "P": "pin", "E": "elbow", "T": "t"}
    lines += "".join(f"compute({k}, force_on, {IDs[k]})\n" for k in IDs)
    names = ", ".join(f"{k}_{axis}" for k in IDs for axis in ("x", "y", "tz"))
    log = run_interpreted(scene([(solids, lines)], "", names, steps=3)).log
    A, B, C, P, E, T = (np.stack([log[f"{k}_{x}"] for x in ("x", "y", "tz")]) for k in IDs)
    assert np.abs(C[1:, 1:]).max() > 0.1
    for found, exact in ((A, P + E), (B, T - E), (C, -T)):
        assert found == pytest.approx(exact, abs=1e-7)


def test_a_spring_on_a_slider(run_interpreted):
    """A leapfrog of period 2 pi, on a line that leans, which no torque or gravity leaves."""
    box = body("a", "block, 5, 7, 5, 6", "gravity=(0.8, -0.6), spin=0")
    more = "fix(rail, joint, slider, a, axis=(0.6, 0.8))\n"
    more += "fix(coil, joint, spring, a, end=(12, 13.5), stiffness=1, length=9)\n"
    log = run_interpreted(scene([box], more, "a_x, a_y, a_rz, coil_x", dt=0.1, steps=40)).log
    rate = 2 * np.arcsin(0.05) / 0.1
    # The line meets the end of the spring, which is 1 longer than its length without force.
    way = 1 - np.cos(rate * log.Time)
    assert log.a_x - 6 == pytest.approx(0.6 * way, abs=1e-3)
    assert log.a_y - 5.5 == pytest.approx(0.8 * way, abs=1e-3)
    assert np.abs(log.a_rz).max() < 1e-5 and log.coil_x[1] == pytest.approx(0.6, rel=1e-3)


def test_a_weld_makes_two_bodies_one(run_interpreted):
    """Two boxes of masses 1 and 100 fly as one body of 101, at a uniform spin."""
    a = body("a", "block, 5, 6, 5, 6", "inertia=0.17, velocity=(0, 1)")
    solid, line = body("b", "block, 6, 7, 5, 6", "inertia=17")
    b = solid, line.replace("mass=1,", "mass=100,")
    log = run_interpreted(
        scene([a, b], "fix(w, joint, weld, a, b)\n", names_of("a", "b") + ", a_rz, b_rz", steps=30)
    ).log
    assert log.a_rz == pytest.approx(log.b_rz, abs=1e-6)
    arm = np.hypot(log.b_x - log.a_x, log.b_y - log.a_y)
    assert arm == pytest.approx(1, abs=1e-5)
    # 1 m/s at an arm of 100/101 from the centre: I = 17.17 + 1 - 1/101.
    spin = (100 / 101) / (17.17 + 100 / 101)
    assert log.b_wz[1:] == pytest.approx(-spin, rel=1e-3)


@pytest.mark.parametrize("kind", ["ball", "hinge"])
def test_a_top_on_a_joint_equals_one_on_a_pivot(run_interpreted, kind):
    """In 3D, 6 steps of 0.02: the same centre, to the order of the step."""
    axis = ", axis=(0, 0, 1)" if kind == "hinge" else ""
    shape, given = "block, 3, 5, 3, 4, 3, 4", "inertia=(1, 2, 2), gravity=(0, -3, 0)"
    turning = "(0, 0, 1)" if kind == "hinge" else "(3, 0, 1)"
    logs = []
    for pivot in (True, False):
        how = f", spin={turning}, " + ("pivot=(3, 3.5, 3.5)" if pivot else "velocity=(0, 1, 0)")
        top = body("a", shape, given + how)
        more = "" if pivot else f"fix(j, joint, {kind}, a, at=(3, 3.5, 3.5){axis})\n"
        text = scene([top], more, "a_rx, a_ry, a_rz, a_wz", dt=0.02, steps=6)
        text = text.replace("dimension(2, 0, 20, 0, 12, 1)", "dimension(3, 0, 8, 0, 8, 0, 8, 1)")
        logs.append(run_interpreted(text, folder=str(pivot)).log)
    for name in ("a_rx", "a_ry", "a_rz", "a_wz"):
        assert logs[0][name] == pytest.approx(logs[1][name], abs=2e-3)
    assert logs[0].a_rz[-1] > 0.05


TWO = [
    body("a", "block, 5, 6, 5, 6", "velocity=(0, 1)"),
    body("b", "block, 5, 6, 7, 8", "spin=0.1"),
]
MISTAKES = {
    "contact/bodies, a, c": ("there is no solid and no region 'c'", "one of still, a, b"),
    "contact/bodies, a, fat": ("there is no solid and no region 'fat'", "did you mean 'far'?"),
    "contact/bodies, a, a": ("'a' is named twice", "each once"),
    "contact/bodies, a, b, restitution=2": ("restitution", "from 0 to 1"),
    "contact/bodies, a, b, mu=-1": ("mu", "at least 0"),
    "contact/bodies, a, soft": ("solid 'soft' deforms", "contact/rigid_body"),
    "contact/bodies, a, still": ("solid 'still' has no fix rigid_body", "motion="),
    "contact/bodies, a, b)\nfix(s, contact/bodies, b, a": ("of 'a' with 'b' already", "one fix"),
    "contact/bodies, a, near": ("'a' and 'near' overlap by 0.8", "a gap"),
    "contact/bodies, far, near": ("none of its parts moves", "rigid_body"),
    "joint, hinge, a, a": ("'a' is named twice", "another body"),
    "joint, ball, a": ("needs a domain in 3D", "hinge"),
    "joint, slider, a": ("a slider needs its axis", "axis="),
    "joint, slider, a, axis=(0, 0)": ("the axis has no length", "not 0"),
    "joint, spring, a, b": ("a spring needs its stiffness", "stiffness=k"),
    "joint, spring, a, stiffness=2": ("needs the position of its end", "end="),
    "joint, weld, a, b, stiffness=2": ("stiffness is not an argument of a weld", "without"),
    "joint, weld, a, soft": ("solid 'soft' deforms", "rigid"),
    "joint, bolt, a, b": ("bolt", "hinge"),
    "joint, weld, a, still": ("solid 'still' has no fix rigid_body", "motion="),
    "joint, hinge, a, b, at=(1, 2, 3)": ("3 components", "2 numbers"),
}


@pytest.mark.parametrize("line", MISTAKES)
def test_mistakes_are_refused(run_interpreted, line):
    message, remedy = MISTAKES[line]
    regions = "region(near, block, INF, INF, INF, 5.8)\nregion(far, block, INF, INF, INF, 1)\n"
    regions += "material(rubber, linear, 1000, 1e6, 0.3)\nregion(soft, block, 9, 11, 9, 11)\n"
    regions += "solid(soft, region, soft, 1, rubber, 1)\nregion(still, block, 9, 11, 2, 4)\n"
    regions += "solid(still, region, still, 1, steel, 1)\n"
    text = scene(TWO, f"fix(t, {line})\n", "step", steps=1, regions=regions)
    text = text.replace("method(ulmpm,", "method(ulmpm/contacts,")
    result = run_interpreted(text, status=1)
    assert result.err.count("error:") == 1, result.err
    said = " ".join(result.err.split())
    assert message in said and remedy in said, result.err


@pytest.mark.parametrize("fails", [True, False])
def test_a_body_on_which_nothing_acts(run_interpreted, fails):
    """A joint to the ground, or to a body at rest, does not move it; to one that moves it does."""
    still = body("c", "block, 9, 10, 5, 6")
    joint = f"fix(j, joint, hinge, c{'' if fails else ', a'}, at=(9, 6))\n"
    text = scene([*TWO, still], f"fix(t, contact/bodies, a, b)\n{joint}", "step", steps=1)
    said = " ".join(run_interpreted(text, status=int(fails)).err.split())
    assert ("acts on the body 'c'" in said) == fails, said


def test_bodies_without_a_contact_are_reported(run_interpreted):
    said = " ".join(run_interpreted(scene(TWO, "", "step", steps=1)).err.split())
    assert "passes through other rigid solids: b" in said and "contact/bodies, a, b" in said
    said = run_interpreted(
        scene(TWO, "fix(t, contact/bodies, a, b)\n", "step", steps=1), folder="b"
    )
    assert "passes through" not in said.err


def test_a_restarted_run_has_the_same_bits(run_interpreted):
    """Boxes collide, one on a hinge, before and after the restart."""
    more = "fix(t, contact/bodies, a, b, mu=0.3)\nfix(j, joint, hinge, b, at=(5, 7.5))\n"
    boxes = [body("a", "block, 5, 6, 5, 6", "velocity=(0, 9)"), body("b", "block, 5, 6, 7, 8")]
    goes_on(run_interpreted, with_files(scene(boxes, more, "a_y, b_rz, t_y", dt=0.02, steps=10)))


ON_SOFT = """
method({method}, FLIP, linear, 1)
dimension(2, 0, 10, 0, 12, 1)
region(a, block, 3, 6, 2, 4)
region(b, block, 4, 6, 4.2, 6.2)
region(c, block, 4, 6, 6.21, 8.21)
material(steel, rigid, {ratio})
material(soft, linear, 1, 100, 0.3)
solid(a, region, a, 1, soft, 1)
solid(b, region, b, 1, steel, 1)
solid(c, region, c, 1, steel, 1)
fix(mb, rigid_body, b, velocity=(0.2, -1.5))
fix(mc, rigid_body, c, velocity=(0, -2), spin=0.1)
{touch}
fix(t, contact/bodies, b, c, mu=0.3, restitution=0.5)
group(a, particles, region, a, solid, a)
compute(p, linear_momentum, a)
compute(F, force_on, b)
set_output(1)
log_modify(custom, step, p_x, p_y, mb_vx, mb_vy, mc_vx, mc_vy, t_y, mb_fy, F_y)
run(12)
"""


@pytest.mark.parametrize("ratio", [1000, 0.01])
@pytest.mark.parametrize("method", ["ulmpm/contacts", "ulmpm"])
def test_two_bodies_and_what_deforms(run_interpreted, method, ratio):
    """One rigid block falls on another one on a soft block: momentum is conserved."""
    touch = "contact/friction, a, b, 0.4" if "contacts" in method else "contact/rigid_body, all, b"
    text = ON_SOFT.format(method=method, ratio=ratio, touch=f"fix(f, {touch})")
    log = run_interpreted(text).log
    for own, one, other in ((log.p_x, log.mb_vx, log.mc_vx), (log.p_y, log.mb_vy, log.mc_vy)):
        total = own + 4 * ratio * (one + other)
        assert total == pytest.approx(np.full(13, total[0]), rel=1e-7, abs=1e-8 * ratio)
    assert np.abs(log.t_y).max() > 0 and log.F_y == pytest.approx(log.mb_fy, rel=1e-8)
