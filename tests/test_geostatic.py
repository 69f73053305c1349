"""Ground that begins with the stress of its weight."""

import numpy as np
import pytest

from karamelo_py.styles.fixes.geostatic import load_above, to_middles

LAYERS = """
    method(tlmpm, FLIP, linear, 1)
    dimension({d}, {box}, 0.25)
    region(low, block, {low})
    region(high, block, {high})
    material(clay, linear, 1590, 1e7, 0.25)
    {water}
    material(sand, linear, 1800, 1e7, 0.25)
    solid(clay, region, low, 2, clay, 0.25, 0)
    {more}
    region(bottom, block, {bottom})
    group(bottom, nodes, region, bottom, all)
    fix(base, velocity_nodes, bottom, 0{free})
    {sides}
    fix(weight, body_force, all, {g})
    fix(start, geostatic_stress, all, k0=0.4, gravity=10)
    compute(k, kinetic_energy, all)
    compute(s, probe, all, s11, s22, s33)
    log_modify(custom, time, k, {names}base_x, base_y)
    run(20)
"""
LINE = {
    "d": 1, "box": "0, 1", "low": "0, 1", "high": "1, 2", "bottom": "-INF, 1e-6", "free": "",
    "g": "-10", "sides": "", "names": "s_s11, s_s22, ", "more": "", "water": "",
}  # fmt: skip
PLANE = LINE | {
    "d": 2, "box": "0, 1, 0, 2", "low": "0, 1, 0, 1", "high": "0, 1, 1, 2",
    "bottom": "-INF, INF, -INF, 1e-6", "free": ", 0", "g": "0, -10",
    "sides": """region(left, block, -INF, 1e-6, -INF, INF)
    region(right, block, 1 - 1e-6, INF, -INF, INF)
    group(left, nodes, region, left, all)
    group(right, nodes, region, right, all)
    fix(left, velocity_nodes, left, 0, NULL)
    fix(right, velocity_nodes, right, 0, NULL)""",
    "names": "s_s11, s_s22, s_s33, ",
}  # fmt: skip


def test_a_column_is_at_rest(run_interpreted):
    """Mean vertical stress rho g H/2, horizontal k0 times it; the base carries the weight."""
    log = run_interpreted(LAYERS.format(**LINE).replace("base_x, base_y", "base_x")).log
    assert log["k"].max() < 1e-15
    assert abs(log["s_s11"][-1] / (-1590 * 10 / 2) - 1) < 1e-5
    assert abs(log["s_s22"][-1] / (-1590 * 10 / 2 * 0.4) - 1) < 1e-5
    assert abs(log["base_x"][-1] / 15900 - 1) < 1e-5


def test_saturated_ground_has_effective_stress_and_hydrostatic_pressure(run_interpreted):
    scene = LINE | {
        "water": "pore_water(clay, n=0.4, permeability=1e-3)",
        "more": "region(top, block, 1 - 1e-6, INF)\n    group(top, nodes, region, top, all)\n"
        "    fix(drain, pore_pressure, top, 0)\n    compute(p, probe, all, pore_pressure)",
        "names": "p, s_s11, s_s22, ",
    }
    log = run_interpreted(LAYERS.format(**scene).replace("base_x, base_y", "base_x")).log
    assert abs(log["p"][-1] / (1000 * 10 / 2) - 1) < 1e-5
    assert abs(log["s_s11"][-1] / (-(1590 - 600) * 10 / 2) - 1) < 1e-5
    assert abs(log["base_x"][-1] / 19900 - 1) < 1e-4
    assert log["k"].max() < 1e-12


def test_layers_in_2d(run_interpreted):
    """Clay under sand, on one grid (ulmpm)."""
    scene = PLANE | {"more": "solid(sand, region, high, 2, sand, 0.25, 0)"}
    script = LAYERS.format(**scene).replace("tlmpm", "ulmpm")
    log = run_interpreted(script).log
    clay, sand = -(1800 + 1590 / 2) * 10, -1800 * 10 / 2
    assert abs(log["s_s22"][-1] / ((clay + sand) / 2) - 1) < 1e-3
    assert abs(log["s_s33"][-1] / (0.4 * (clay + sand) / 2) - 1) < 1e-3
    assert abs(log["base_y"][-1] / 33900 - 1) < 0.01


def test_each_layer_has_its_k0(run_interpreted):
    """Of a column: the mean of k0 sigma_v, with 1.2 in the lower half and 0.4 above it."""
    script = LAYERS.format(**LINE).replace("k0=0.4", "k0=if(x0 < 0.5, 1.2, 0.4)")
    log = run_interpreted(script.replace("base_x, base_y", "base_x")).log
    exact = -1590 * 10 * (1.2 * 0.75 + 0.4 * 0.25) / 2
    assert abs(log["s_s22"][-1] / exact - 1) < 1e-5


def test_initial_stress_of_a_weight_has_a_hint(run_interpreted):
    script = LAYERS.format(**LINE).replace("geostatic_stress, all,", "initial_stress, all,")
    err = run_interpreted(script, status=1).err
    assert "fix(ID, geostatic_stress, group, k0=0.5, gravity=9.81)" in err


def test_a_stress_that_follows_from_deformation_is_refused(run_interpreted):
    script = LAYERS.format(**LINE).replace("clay, linear", "clay, neo-hookean")
    err = run_interpreted(script, status=1).err
    assert "follows from its deformation" in err


def test_columns_are_the_same_wherever_the_points_lie():
    """Points at x = 0, 0.1, ... 1, whose edges are at round numbers of columns only roughly."""
    x = np.array([(0.1 * i, 0.1 * j) for i in range(11) for j in range(20)])
    for shift in (0.0, 0.05, 1 / 3):
        load = load_above(x + shift, np.full_like(x, 0.1), np.full((len(x), 1), 18000.0))
        depth = 1.95 - x[:, 1]
        assert load[:, 0] == pytest.approx(18000 * depth, rel=1e-9)


@pytest.mark.parametrize("n", [2, 3, 5])
def test_gauss_points_go_to_the_middles_of_their_boxes(n):
    """In cells with a gap between them; points of a file stay, also if few are not on lines."""
    at, weight = np.polynomial.legendre.leggauss(n)
    middle = np.cumsum(weight / 2) - weight / 4
    cells = np.array([0.0, 1, 2, 7, 8])
    x, to = ((cells[:, None] + one).reshape(-1, 1) for one in (at / 2 + 0.5, middle))
    size = np.tile(weight / 2, len(cells))[:, None]
    assert x + to_middles(x, size) == pytest.approx(to)
    random = np.random.default_rng(1).random((50, 2))
    lines = np.append(np.arange(20) + 0.5, [3.2, 3.8, 7.7, 11.1])[:, None]
    for stay, long in ((random, 0.14), (lines, 1.0)):
        assert np.abs(to_middles(stay, np.full_like(stay, long))).max() < 1e-9


@pytest.mark.parametrize("d", [1, 2, 3])
def test_layers_of_points_of_any_size(d):
    """2 points per cell of clay under 3 of sand, and a width that is not a multiple of either."""
    for wide in (1.0, 0.9):
        layers = []
        for size, base, top in ((0.5, 0, 1), (1 / 3, 1, 2)):
            flat = [np.arange(size / 2, 6 * wide, size) for _ in range(d - 1)]
            grid = np.meshgrid(*flat, np.arange(base + size / 2, top, size), indexing="ij")
            layers.append((np.stack(grid, axis=-1).reshape(-1, d), size))
        x = np.concatenate([at for at, _ in layers])
        size = np.concatenate([np.full_like(at, one) for at, one in layers])
        clay = x[:, -1] < 1
        weight = np.where(clay, 15900.0, 18000.0)[:, None]
        exact = np.where(clay, 18000 + 15900 * (1 - x[:, -1]), 18000 * (2 - x[:, -1]))
        load = load_above(x, size, weight)[:, 0]
        if wide == 1 or d == 1:
            assert load == pytest.approx(exact, rel=1e-9)
        else:
            within = np.all((x[:, :-1] > 1) & (x[:, :-1] < 4.4), axis=1)
            assert load[within] == pytest.approx(exact[within], rel=1e-9)


def test_a_dam_with_other_points_per_cell(run_interpreted):
    """Three points per cell of sand load the two per cell of clay below, and those alone."""
    scene = PLANE | {
        "more": """region(under, block, 0.5, 1, 0, 1)
        solid(sand, region, high, 3, sand, 0.25, 0)
        group(below, particles, region, under, solid, clay)""",
        "high": "0.5, 1, 1, 2",
    }
    script = (
        LAYERS.format(**scene)
        .replace("tlmpm", "ulmpm")
        .replace("run(20)", "set_dt(1e-6)\n    run(1)")
    )
    log = run_interpreted(script.replace("probe, all", "probe, below")).log
    assert abs(log["s_s22"][-1] / (-(1800 + 1590 / 2) * 10) - 1) < 1e-3


def test_columns_of_points_from_a_file(run_interpreted, tmp_path):
    """At x = 0, 0.1, ..., 1, where round-off once split and merged columns."""
    rows = [f"{0.1 * i}, {0.1 * j + 0.05}, 0.01" for i in range(11) for j in range(20)]
    (tmp_path / "soil.csv").write_text("\n".join(["x, y, volume", *rows]), encoding="utf-8")
    script = f"""
    method(ulmpm, FLIP, linear, 1)
    dimension(2, -1, 2, 0, 3, 0.2)
    material(sand, linear, 1800, 1e7, 0.25)
    solid(sand, points, "{tmp_path / "soil.csv"}", sand, 0.2)
    fix(start, geostatic_stress, all, gravity=10)
    dump(d, all, particle, 1, d.*.LAMMPS, x, y, s22)
    set_dt(1e-9)
    run(1)
    """
    found = run_interpreted(script).snapshots("d")[-1]
    assert found["s22"] == pytest.approx(-18000 * (2 - found["y"]), rel=1e-4)
