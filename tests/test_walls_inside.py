"""Held planes of nodes inside the grid: splines have the functions of the grid's end there."""

import numpy as np
import pytest
from selection import parameters

SCENE = """
method(METHOD)
dimension(2, LOW, HIGH, -1, 2, 0.5)
region(bar, block, LEFT, RIGHT, 0, 1)
material(rubber, linear, 1000, 1e6, 0.3)
solid(bar, region, bar, 2, rubber, 0.5, 0)
region(held, block, HELD, INF, INF)
group(held, nodes, region, held, all)
fix(wall, velocity_nodes, held, 0.1, -0.2)
fix(v, initial_velocity_particles, all, 0.5*x0, 0.3*x0^2)
compute(x, center_of_mass, all)
compute(Es, strain_energy, all)
compute(Ek, kinetic_energy, all)
set_output(1)
log_modify(custom, step, time, x_x, x_y, Es, Ek, wall_x, wall_y)
run(3)
"""


def scene(method, low, high, bar, held):
    text = SCENE.replace("METHOD", method).replace("LOW", str(low)).replace("HIGH", str(high))
    text = text.replace("LEFT", str(bar[0])).replace("RIGHT", str(bar[1]))
    return text.replace("HELD", held)


METHODS = "ulmpm, FLIP, cubic-spline, 1", "ulmpm, APIC, quadratic-spline"
PLACES = [
    (1, -1, 3, "-0.01, 0.01"),
    (1, -0.5, 3, "-0.01, 0.01"),
    (1, -1, 3, "-INF, 0.01"),
    (1, -1, 3, "-0.6, 0.01"),
    (-1, -3, 1, "-0.01, 0.01"),
    (-1, -3, 0.5, "-0.01, INF"),
]
BY_TURNS = [(METHODS[k % 2], *place) for k, place in enumerate(PLACES)]
OTHERS = [(METHODS[1 - k % 2], *place) for k, place in enumerate(PLACES)]


@pytest.mark.parametrize("method, side, low, high, held", parameters(BY_TURNS, OTHERS))
def test_a_body_at_a_wall_inside_moves_as_at_the_end(
    run_interpreted, method, side, low, high, held
):
    """Motion, energies and reactions to round-off, whatever of the nodes behind is held."""
    bar, ends = (0, 2 * side)[::side], (0, high) if side == 1 else (low, 0)
    at_end = run_interpreted(scene(method, *ends, bar, held), folder="end").log
    inside = run_interpreted(scene(method, low, high, bar, held), folder="inside").log
    for name in ("x_x", "x_y", "Es", "Ek", "wall_x", "wall_y"):
        first, second = getattr(at_end, name), getattr(inside, name)
        np.testing.assert_allclose(second, first, rtol=1e-8, atol=1e-8 * np.abs(first).max())


@pytest.mark.parametrize("basis", ["quadratic-spline", "cubic-spline"])
def test_a_wall_inside_a_grid_that_is_one_cell_wide(run_interpreted, basis):
    """The nodes beyond the box, which splines see, have no cells."""
    logs = []
    for low in (0, -1):
        text = scene(f"ulmpm, FLIP, {basis}, 1", low, 3, (0, 2), "-INF, 0.01")
        text = text.replace("-1, 2, 0.5", "0, 0.5, 0.5")
        text = text.replace("2, 0, 1)", "2, 0, 0.5)").replace("0.1, -0.2", "0.1, 0")
        logs.append(run_interpreted(text, folder=f"from{low}").log)
    np.testing.assert_allclose(logs[1].Es, logs[0].Es, rtol=1e-8)
    np.testing.assert_allclose(logs[1].wall_x, logs[0].wall_x, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("basis", ["quadratic-spline", "cubic-spline"])
def test_a_bar_that_is_stretched_evenly_from_a_wall_inside(run_interpreted, basis):
    """The strain is the same everywhere: the functions reproduce linear fields up to the wall."""
    text = f"""
        method(ulmpm, FLIP, {basis}, 1)
        dimension(1, -3, 8, 1)
        region(bar, block, 0, 6)
        material(soft, linear, 1, 1, 0)
        solid(bar, region, bar, 2, soft, 1, 0)
        fix(stretch, velocity_nodes, all, 0.1*x0)
        region(wall, block, -INF, 0)
        group(wall, nodes, region, wall, all)
        fix(wall, velocity_nodes, wall, 0)
        region(part, block, 0, 4)
        group(part, particles, region, part, all)
        compute(error, error, part, s11, 0.1*time, max)
        set_dt(1e-3)
        log_modify(custom, step, time, error)
        run(10)
    """
    assert run_interpreted(text).log.error[-1] < 1e-15
