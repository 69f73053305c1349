"""Ground that begins with the stress of its weight."""

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


def test_a_stress_that_follows_from_deformation_is_refused(run_interpreted):
    script = LAYERS.format(**LINE).replace("clay, linear", "clay, neo-hookean")
    err = run_interpreted(script, status=1).err
    assert "follows from its deformation" in err
