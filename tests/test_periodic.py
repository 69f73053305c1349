"""Periodic directions: waves, drift, flow down a plane, and what has none."""

import re
from math import pi

import numpy as np
import pytest

WAVE = """
    method(ulmpm, {way})
    dimension(1, 0, 1, 1/{N})
    boundary(periodic, x)
    region(bar, block, 0, 1)
    material(m, linear, 1, 1, 0)
    solid(s, region, bar, 2, m, 1/{N}, 0)
    fix(v, initial_velocity_particles, all, {drift} + 1e-4*sin(2*PI*x0))
    fix(s, initial_stress, all, -1e-4*sin(2*PI*x0), 0, 0, 0, 0, 0)
"""
FLOW = """
    N = 8
    method(ulmpm, APIC, quadratic-spline)
    dimension(2, 0, {wide}/N, 0, 1.25, 1/N)
    boundary(periodic, x)
    region(layer, block, 0, {wide}/N, 0, 1)
    eos(oil, fluid, 1, 200, 1)
    strength(oil, fluid, 0.1)
    material(oil, eos-strength, oil, oil)
    solid(oil, region, layer, 2, oil, 1/N, 0)
    region(bottom, block, -INF, INF, -INF, 1e-6)
    group(bottom, nodes, region, bottom, all)
    fix(base, velocity_nodes, bottom, 0, 0)
    fix(g, body_force, all, 0.1, -0.1)
    log_modify(custom, time, base_x, base_y, g_x)
    dump(d, all, particle, 100000, d.*.txt, x, y, vx, vy)
    set_output(100000)
"""
DUMP = "dump(d, all, particle, 100000, d.*.txt, x0, x, vx)\n"


def final(result):
    return max(result.folder.glob("d.*.txt"), key=lambda path: int(path.name.split(".")[1]))


def columns(path):
    lines = path.read_text("utf-8").splitlines()
    k = next(k for k, line in enumerate(lines) if line.startswith("ITEM: ATOMS"))
    rows = np.array([line.split() for line in lines[k + 1 :]], float)
    return dict(zip(lines[k].split()[2:], rows.T, strict=True))


@pytest.mark.xdist_group("periodic")
def test_a_wave_comes_back(run_script):
    """A travelling wave after ten periods: phase and height, with and without a drift."""
    script = WAVE.format(way="FLIP, quadratic-spline, 1", N=64, drift="0") + DUMP
    dump = final(run_script(script + "run_time(10)"))
    assert "BOX BOUNDS pp sm sm" in dump.read_text("utf-8")
    v = columns(dump)
    waves = [np.mean(v["vx"] * f(2 * pi * v["x0"])) * 2e4 for f in (np.sin, np.cos)]
    assert abs(np.hypot(*waves) - 1) < 0.01
    assert abs(np.arctan2(waves[1], waves[0])) < 2 * pi * 10 * 0.004


@pytest.mark.xdist_group("periodic")
def test_a_drifting_bar_conserves_momentum(run_script):
    """Through the seam many times; all points are in the cell again, or a little outside."""
    script = WAVE.format(way="FLIP, quadratic-spline, 1", N=32, drift="0.2")
    script += "compute(v, average_velocity, all)\nlog_modify(custom, time, v_x)\n" + DUMP
    result = run_script(script + "run_time(25)")
    assert abs(result.log["v_x"][-1] - 0.2) < 1e-12
    x = columns(final(result))["x"]
    assert x.min() >= 0
    assert x.max() < 1 + 0.2 * 10 / 32


@pytest.mark.xdist_group("periodic")
def test_threads_and_restarts_change_no_bit(run_script):
    script = WAVE.format(way="FLIP, quadratic-spline, 1", N=32, drift="0.5")
    script += "run(33)\nwrite_restart(half.h5)\nrun(44)\n" + DUMP + "run(3)"
    whole = final(run_script(script)).read_text("utf-8")
    assert final(run_script(script, "-restart", "half.h5")).read_text("utf-8") == whole
    threads = run_script(script, "--threads", "2", folder="threads")
    assert final(threads).read_text("utf-8") == whole


@pytest.mark.parametrize("averaging", ["false", "true"])
def test_the_width_of_a_cell_does_not_matter(run_interpreted, averaging):
    """Of a layer that shears under gravity: one cell wide, or four; with F-bar and without."""
    run = f"anti_volumetric_locking({averaging})\nrun(12)"
    flow = FLOW.replace("N = 8", "N = 4")
    one, four = (
        columns(final(run_interpreted(flow.format(wide=wide) + run, folder=f"{averaging}{wide}")))
        for wide in (1, 4)
    )
    first = four["x"] < 1 / 4
    assert np.ptp(one["vx"]) > 1e-3
    for name in ("y", "vx", "vy"):
        order, other = (np.lexsort((t["x"], t["y"])) for t in (one, four))
        narrow = one[name][order]
        wide = four[name][other][first[other]]
        assert np.allclose(narrow, wide, rtol=1e-9, atol=1e-14)


@pytest.mark.full
def test_a_viscous_layer_has_the_profile_of_nusselt(run_script):
    """Down a plane (Nusselt 1916): u = g (H y - y^2/2) / nu, base force g m; 2.5 % with 8 cells."""
    result = run_script(FLOW.format(wide=2) + "run_time(20)")
    points = columns(final(result))
    exact = points["y"] - points["y"] ** 2 / 2
    assert np.sqrt(np.mean((points["vx"] - exact) ** 2)) < 0.03 * 0.5
    assert abs(result.log["g_x"][-1] - 0.1 * 0.25) < 1e-12
    assert abs(result.log["base_x"][-1] + 0.1 * 0.25) < 0.002


SHEARED = """
    N = 8
    rate = 0.1
    method(ulmpm, {way})
    dimension({d}, 0, 1, 0, 1, {deep}1/N)
    boundary(periodic, x, y, {more}shear=rate)
    region(cell, block, INF, INF, INF, INF{inf})
    eos(oil, fluid, 1, 200, 1)
    strength(oil, {law})
    material(oil, eos-strength, oil, oil)
    solid(oil, region, cell, 2, oil, 1/N, 0)
    fix(v, initial_velocity_particles, all, rate*y, 0.5{zero})
    compute(s, average_stress, all)
    compute(p, linear_momentum, all)
    log_modify(custom, step, time, s_11, s_22, s_12, p_x, p_y)
    dump(d, all, particle, 100000, d.*.txt, y, vx)
    set_output(20)
"""
PLANE = {"d": 2, "deep": "", "more": "", "inf": "", "zero": "", "law": "fluid, 0.1"}


@pytest.mark.xdist_group("sheared")
@pytest.mark.parametrize(
    "way",
    ["FLIP, linear, 0.99", pytest.param("APIC, quadratic-spline", marks=pytest.mark.full)],
)
def test_a_sheared_cell_of_oil(run_script, way):
    """Lees & Edwards 1972: s12 = mu rate and vx = rate (y - vy t), through the edge."""
    result = run_script(SHEARED.format(way=way, **PLANE) + "run_time(5)")
    log, points = result.log, columns(final(result))
    assert np.abs(log["s_12"][1:] / 0.01 - 1).max() < 1e-9
    assert np.abs(log["s_11"]).max() < 1e-12 and np.abs(log["p_y"] - 0.5).max() < 1e-12
    assert np.abs(points["vx"] - 0.1 * (points["y"] - 2.5)).max() < 1e-9


GRAINS = """
    N = 8
    rate = 0.2
    method(ulmpm, APIC, quadratic-spline)
    dimension(2, 0, 1, 0, 1, 1/N)
    boundary(periodic, x, y, shear=rate)
    region(cell, block, 0, 1, 0, 1)
    eos(sand, linear, 1000, 1e5)
    strength(sand, mu-i, 1e5, 0.382, 0.643, 0.279, 0.05, 2000)
    material(sand, eos-strength, sand, sand)
    solid(sand, region, cell, 2, sand, 1/N, 0)
    fix(s, initial_stress, all, -1000, -1000, -1000, 0, 0, 0)
    fix(v, initial_velocity_particles, all, rate*y, 0.1)
    compute(s, average_stress, all)
    compute(p, probe, all, p)
    I = 0.2*0.05/sqrt(1000/2000)
    mu = s_12/p
    exact = 0.382 + 0.261/(0.279/I + 1)
    log_modify(custom, step, time, s_12, p, mu, exact)
    set_output(time(0.5))
    run_time(2)
"""


@pytest.mark.full
def test_grains_in_a_sheared_cell(run_script):
    """mu(I) (Jop, Forterre & Pouliquen 2006), while points go through the edge across the shear."""
    log = run_script(GRAINS).log
    assert np.abs(log["mu"][1:] / log["exact"][1:] - 1).max() < 1e-5


LAYER = """
    d = 0.5e-3
    H = 40*d
    angle = radians(24)
    I = 0.279*(tan(angle) - 0.382)/(0.643 - tan(angle))
    U = 2/3*I/d*sqrt(1500*9.81*cos(angle)/2450)*H^1.5
    method(ulmpm, AFLIP, cubic-spline, 0.9)
    dimension(2, 0, 4*H/{N}, 0, 1.5*H, H/{N})
    boundary(periodic, x)
    region(layer, block, 0, 4*H/{N}, 0, H)
    eos(grains, linear, 1500, 1.5e5*U*U)
    strength(grains, mu-i, 7.5e4*U*U, 0.382, 0.643, 0.279, d, 2450)
    material(grains, eos-strength, grains, grains)
    solid(layer, region, layer, 2, grains, H/{N})
    region(floor, block, -INF, INF, -INF, 0)
    group(floor, nodes, region, floor, all)
    fix(floor, velocity_nodes, floor, 0, 0)
    fix(weight, body_force, all, 9.81*sin(angle), -9.81*cos(angle))
    p = 1500*9.81*cos(angle)*(H - y0)
    fix(rest, initial_stress, all, -p, -p, -p, 0, 0, 0)
    fix(flow, initial_velocity_particles, all, U*(1 - (1 - y0/H)^1.5), 0)
    dump(d, all, particle, 1000000, d.*.txt, y, vx)
    set_output(1000000)
    run_time({T})
"""


@pytest.mark.parametrize(
    ("N", "T", "within"),
    [(8, 0.4, 0.02), pytest.param(16, 4, 0.007, marks=pytest.mark.full)],
)
def test_grains_down_a_plane(run_script, N, T, within):
    """mu(I) has Bagnold's profile (GDR MiDi 2004; Jop, Forterre & Pouliquen 2006).

    The flow becomes steady after 1.2 s. Its root mean square error is then of order 1.9.
    """
    points = columns(final(run_script(LAYER.format(N=N, T=T))))
    angle, H, d = np.radians(24), 0.02, 0.5e-3
    inertial = 0.279 * (np.tan(angle) - 0.382) / (0.643 - np.tan(angle))
    largest = 2 / 3 * inertial / d * np.sqrt(1500 * 9.81 * np.cos(angle) / 2450) * H**1.5
    exact = largest * (1 - (1 - np.clip(points["y"] / H, 0, 1)) ** 1.5)
    assert np.sqrt(np.mean((points["vx"] - exact) ** 2)) < within * largest


@pytest.mark.xdist_group("sheared")
def test_threads_and_restarts_change_no_bit_of_a_sheared_cell(run_script):
    script = SHEARED.format(way="FLIP, linear, 0.99", **PLANE)
    script = script.replace("0.5)", "0.5 + 0.01*sin(2*PI*x))")
    script += "run(33)\nwrite_restart(half.h5)\nrun(44)\n"
    whole = run_script(script)
    assert abs(whole.log["p_y"][-1] - 0.5) < 1e-13
    lines = final(whole).read_text("utf-8")
    assert final(run_script(script, "-restart", "half.h5")).read_text("utf-8") == lines
    threads = run_script(script, "--threads", "2", folder="threads")
    assert final(threads).read_text("utf-8") == lines


SLIDING = """
    method(ulmpm, FLIP, linear, 1)
    dimension(2, 0, 0.5, -0.25, 1.25, 0.125)
    boundary(periodic, x)
    region(layer, block, 0, 0.5, 0, 1)
    material(m, linear, 1000, 2e6, 0.3)
    solid(layer, region, layer, 2, m, 0.125)
    region(ground, block, {ends}, -INF, 0)
    fix(ground, {ground}, 0.2)
    fix(weight, body_force, all, 5, -5)
    p = 1000*5*(1 - y0)
    fix(rest, initial_stress, all, -3/7*p, -p, -3/7*p, 0, 0, 0)
    compute(v, average_velocity, all)
    fix(u, displacement, all)
    dump(d, all, particle, 100000, d.*.txt, ux)
    log_modify(custom, time, v_x, v_y)
    set_output(time(0.1))
    run_time(0.5)
"""
SURFACE = "contact/surface, all, ground"
PLANE_OF = "contact/minimize_penetration/plane, layer, 0, 0, 0, 0, 1, 0"


@pytest.mark.parametrize("ground", [SURFACE, PLANE_OF])
def test_a_layer_slides_on_ground_without_ends(run_script, ground):
    """Coulomb: acceleration g_x - mu g_y, through the seam. Ground that ends is refused."""
    result = run_script(SLIDING.format(ends="-INF, INF", ground=ground))
    log, ux = result.log, columns(final(result))["ux"]
    assert np.abs(ux / 0.5 - 1).max() < 0.02  # each point moved by one period
    if ground == SURFACE:
        lost = float(re.search(r"lost by contact +([\d.]+) %", result.out)[1])
        assert abs(lost / 25 - 1) < 0.1  # 0.2 g s divided by v^2/2, and bounces
    acceleration = np.diff(log["v_x"][[1, -1]]) / np.diff(log["Time"][[1, -1]])
    assert abs(acceleration / 4 - 1) < 0.005
    if ground == SURFACE:
        err = run_script(SLIDING.format(ends="0, INF", ground=ground), status=1).err
        assert "boundary(periodic) does not support fix contact/surface" in err


REFUSED = {
    "method(tlmpm, FLIP, linear, 1)": "method tlmpm",
    "method(ulmpm, FLIP, cpgimp, 1)": "the basis cpgimp",
    "method(ulmpm, XPIC, linear, 2)": "transfer XPIC",
    "method(ulmpm, FLIP, linear, 1)\nscheme(usl)": "scheme usl",
    "method(ulmpm, FLIP, linear, 1)\nscheme(quasi-static)": "scheme quasi-static",
    "method(ulmpm, FLIP, linear, 1)\nboundary(delete)": "boundary(delete)",
}
SCENE = """
    {head}
    dimension(2, 0, 1, 0, 1, 0.25)
    boundary(periodic{directions})
    region(body, block, 0, 1, 0.25, 0.75)
    material(m, linear, 1, 1, 0)
    {water}
    solid(body, region, body, 2, m, 0.25, 0)
    run(1)
"""
USUAL = {"head": "method(ulmpm, FLIP, linear, 1)", "directions": ", x", "water": ""}


SATURATED = """
    method(ulmpm, FLIP, linear, 1)
    dimension({domain})
    {periodic}
    region(layer, block, {body})
    material(clay, linear, 1590, 1e7, 0)
    pore_water(clay, n=0.4, permeability=1e-2)
    solid(clay, region, layer, 2, clay, 0.25, 0)
    region(base, block, {base})
    region(top, block, {top})
    group(base, nodes, region, base, all)
    group(top, nodes, region, top, all)
    fix(base, velocity_nodes, base, {held})
    fix(weight, body_force, all, {weight})
    fix(drain, pore_pressure, top, 0)
    compute(p, probe, all, pore_pressure, {foot})
    log_modify(custom, step, dt, p, base_{up}, drain_s)
    set_output(1)
    run(4)
"""


def test_a_saturated_layer_is_a_column(run_interpreted):
    """It falls on its base and drains, half a metre of it as the same column in 1D."""
    column = {"domain": "1, 0, 1.25, 0.25", "periodic": "", "body": "0, 1", "base": "-INF, 0",
              "top": "1, INF", "held": "0", "weight": "-9.81", "foot": "x=0",
              "up": "x"}  # fmt: skip
    layer = {
        "domain": "2, 0, 0.5, 0, 1.25, 0.25", "periodic": "boundary(periodic, x)",
        "body": "0, 0.5, 0, 1", "base": "-INF, INF, -INF, 0", "top": "-INF, INF, 1, INF",
        "held": "NULL, 0", "weight": "0, -9.81", "foot": "x=0.25, y=0", "up": "y",
    }  # fmt: skip
    one, two = (
        run_interpreted(SATURATED.format(**words), folder=f"{words['up']}").log
        for words in (column, layer)
    )
    assert one["p"][-1] > 1e3
    np.testing.assert_allclose(two["p"], one["p"], rtol=1e-9)
    np.testing.assert_allclose(2 * two["base_y"], one["base_x"], rtol=1e-9)
    np.testing.assert_allclose(2 * two["drain_s"], one["drain_s"], rtol=1e-9, atol=1e-9)


def test_water_in_a_periodic_cell_may_cross_its_ends(state_interpreted):
    """A wave that begins half a period further on has the same numbers there."""
    script = """
        method(ulmpm, FLIP, quadratic-spline, 1)
        dimension(1, 0, 2, 0.25)
        boundary(periodic, x)
        region(body, block, 0, 2)
        material(clay, neo-hookean, 1590, 1e7, 0.2)
        pore_water(clay, n=0.4, permeability=1)
        solid(body, region, body, 2, clay, 0.25, 0)
        fix(v, initial_velocity_particles, all, 300 + 10*sin(PI*(x0 - {})))
        dt_factor(0.5)
        run(20)
    """
    names = "x", "vx", "wx", "pore_pressure"
    one, two = (state_interpreted(script.format(begin), *names) for begin in (0, 1))
    assert one["x"].argmin() != 0  # some have crossed
    assert np.abs(one["wx"]).max() > 0.1
    for name in names[1:]:
        shifted = np.roll(two[name], -8)
        np.testing.assert_allclose(shifted, one[name], atol=1e-9 * np.abs(one[name]).max())


@pytest.mark.parametrize("head", REFUSED)
def test_what_has_no_periodic_directions_is_refused_by_name(run_interpreted, head):
    err = run_interpreted(SCENE.format(**USUAL | {"head": head}), status=1).err
    assert f"boundary(periodic) does not support {REFUSED[head]}" in err


MISTAKES = [
    ({"directions": ""}, (), "no direction is named"),
    ({"directions": ", z"}, (), "no such direction"),
    (
        {"water": "pore_water(m, n=0.4, permeability=1)", "directions": ", x, y, shear=1"},
        (),
        "does not support pore_water",
    ),
    ({"directions": ", x, shear=1"}, (), "a sheared cell is periodic in x and y"),
    ({}, ("--gpu",), "does not support --gpu"),
    (
        {
            "directions": ", x, y, shear=1",
            "head": "anti_volumetric_locking(true)\n" + USUAL["head"],
        },
        (),
        "boundary(periodic, shear=...) does not support anti_volumetric_locking",
    ),
]


@pytest.mark.parametrize(("change", "options", "told"), MISTAKES)
def test_mistakes_get_one_message(run_interpreted, change, options, told):
    err = run_interpreted(SCENE.format(**USUAL | change), *options, status=1).err
    assert told in err
    assert err.count("error:") == 1


def test_a_wall_on_a_periodic_edge_is_refused(run_interpreted):
    """A wall inside the cell is none, nor a floor that ends at the edges."""
    wall = ("region(left, block, -INF, {x}, -INF, {y})\n    group(left, nodes, region, left, all)\n"
            "    fix(wall, velocity_nodes, left, 0, NULL)\n    run(1)")  # fmt: skip
    for x, y, status in ((0, "INF", 1), (0.25, "INF", 0), ("INF", 0.25, 0)):
        script = SCENE.format(**USUAL).replace("run(1)", wall.format(x=x, y=y))
        err = run_interpreted(script, status=status).err
        assert ("'wall' is a wall on the edges of a periodic cell" in err) == bool(status)


def test_a_sheared_cell_is_full(run_interpreted):
    script = SCENE.format(**USUAL | {"directions": ", x, y, shear=1"})
    tall = script.replace("dimension(2, 0, 1, 0, 1,", "dimension(2, 0, 1, 0, 16,")
    assert "a sheared cell has empty places" in run_interpreted(tall, status=1).err


@pytest.mark.parametrize(
    "line",
    ["boundary(error, x)", "boundary(error, shear=1)", "dimension(2, 0, 1.1, 0, 1, 0.25)"],
)
def test_directions_and_lengths_are_checked(run_interpreted, line):
    script = SCENE.format(**USUAL)
    if line.startswith("dim"):
        script = script.replace("dimension(2, 0, 1, 0, 1, 0.25)", line)
    else:
        script = script.replace("boundary(periodic, x)", line)
    err = run_interpreted(script, status=1).err
    told = "applies to all directions", "has no shear", "is not a multiple of the cells"
    assert any(words in err for words in told)
