"""Rigid solids and contact in implicit steps."""

import numpy as np
import pytest

PRESS = """
    basis = "linear"
    method(ulmpm, FLIP, basis, 1)
    scheme({scheme})
    dimension(2, 0, 1.25, 0, 1.75, 0.25)
    region(box, block, 0, 1, 0, 1)
    region(tool, block, 0, 1.25, 1, 1.5)
    material(m, linear, 1, 1000, 0.25)
    material(steel, rigid, 1)
    solid(s, region, box, 2, m, 0.25, 0)
    region(floor, block, -INF, INF, -INF, 1e-6)
    region(top, block, -INF, INF, 1-1e-6, INF)
    group(floor, nodes, region, floor, all)
    group(top, nodes, region, top, all)
    fix(hold, velocity_nodes, floor, 0, 0)
    {lines}
    set_dt(0.5)
    set_output(1)
    compute(Es, strain_energy, all)
    log_modify(custom, step, time, iterations, Es, hold_x, hold_y{columns})
    run(4)
"""
LED = """solid(t, region, tool, 2, steel, 0.25, 0)
    group(t, particles, region, tool, solid, t)
    fix(press, {kind}, t, 1e-3, {value})"""


@pytest.mark.parametrize("scheme", ["quasi-static", "newmark"])
@pytest.mark.parametrize("kind", ["velocity_particles", "initial_velocity_particles"])
def test_a_rigid_solid_leads_its_nodes(run_script, scheme, kind):
    """The same as nodes that are given the velocity of the end of each step, and the reaction."""
    value = "-0.01" if kind.startswith("initial") else "-0.01*time"
    lines = LED.format(kind=kind, value=value)
    columns = ", ContactForce_t_x, ContactForce_t_y"
    by_tool = run_script(PRESS.format(scheme=scheme, lines=lines, columns=columns)).log
    lines = f"fix(press, velocity_nodes, top, 1e-3, {value})"
    columns = ", press_x, press_y"
    by_nodes = run_script(
        PRESS.format(scheme=scheme, lines=lines, columns=columns), folder="nodes"
    ).log
    for axis in "xy":
        force = by_tool[f"ContactForce_t_{axis}"]
        assert np.allclose(force[1:], -by_nodes[f"press_{axis}"][1:], rtol=1e-9)
        assert np.allclose(by_tool[f"hold_{axis}"], by_nodes[f"hold_{axis}"], rtol=1e-9)
    assert abs(by_tool["hold_y"][-1]) > 1 and np.allclose(by_tool["Es"], by_nodes["Es"], rtol=1e-9)


def test_velocities_of_soft_points_are_refused(run_script):
    lines = LED.format(kind="velocity_particles", value="0")
    lines = lines.replace("tool, solid, t)", "tool, all)")
    lines = lines.replace("region, tool", "region, box")
    result = run_script(PRESS.format(scheme="quasi-static", lines=lines, columns=""), status=1)
    assert "velocity_particles" in result.err and "for rigid solids" in result.err
