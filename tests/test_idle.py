"""Runs in which nothing happens, or that hardly end, are told before them."""

import re

import pytest
from scenes import block

RESTS = "nothing moves in this run"
GAS = "eos(e, ideal-gas, 1, 1.4, p=1)\nstrength(f, fluid, 0)\nmaterial(rubber, eos-strength, e, f)"


def test_a_run_at_rest_is_told_once(run_interpreted):
    """What only measures does not act, and short runs look at a scene."""
    quiet = ("compute(Ek, kinetic_energy, all)", "fix(E, kinetic_energy, all)")
    runs = "run(99)", "run(100)", "run_until(time > 1)"
    said = run_interpreted(block(2, *quiet, *runs, size=(0.1, 0.1))).err
    assert said.count(RESTS) == 1 and "run(100)" in said
    assert RESTS in run_interpreted(block(2, "run_time(9)"), command="check").err


@pytest.mark.parametrize(
    "fix",
    [
        "fix(floor, velocity_nodes, all, NULL, 0)",
        "fix(g, body_force, all, 0, -0)",
        "fix(v, initial_velocity_particles, all, 0, 0)",
    ],
)
def test_walls_and_loads_that_are_none_move_nothing(run_interpreted, fix):
    assert RESTS in run_interpreted(block(2, fix, "run(100)"), command="check").err


@pytest.mark.parametrize(
    "lines",
    [
        ("fix(g, body_force, all, 0, -1e-9)", "run(100)"),
        ("fix(v, initial_velocity_particles, all, 1e-9, 0)", "run(100)"),
        ("fix(s, initial_stress, all, 1e-9, 0, 0, 0, 0, 0)", "run(100)"),
        ("run(99)", "fix(v, initial_velocity_particles, all, 1e-9, 0)", "run(100)"),
    ],
)
def test_what_may_move_is_not(run_interpreted, lines):
    assert RESTS not in run_interpreted(block(2, *lines), command="check").err
    assert RESTS not in run_interpreted(block(2, *lines, size=(0.1, 0.1))).err


def test_a_gas_is_not_at_rest(run_interpreted):
    script = re.sub(r"material\(.*\)", GAS, block(2, "run(100)"))
    assert RESTS not in run_interpreted(script, command="check").err


def test_a_run_that_hardly_ends_says_how_many_steps(run_interpreted):
    """By the step that is set; or by that of waves in water of 1e-9 t/mm^3, in m and Pa."""
    lines = ("fix(v, initial_velocity_particles, all, 10, 0)", "set_dt(0.001)", "run_time(1.1e5)")
    said = run_interpreted(block(2, *lines, size=(0.1, 0.1)), status=1).err
    assert "about 1.1e+08 steps of 0.001 from here to time 110000" in said
    assert said.index("a larger step") < said.index("leaves the domain")
    short = block(2, *lines).replace("1.1e5", "0.9e5")
    assert "steps of" not in run_interpreted(short, command="check").err
    mixed = block(2, "run_time(1)").replace("2, 100", "1e-9, 1e9")
    said = run_interpreted(mixed, command="check").err
    assert "waves move at" in said and "may be mixed" in said
    heat = block(2, "run_time(1e9)").replace("linear, 1)", "linear, 1, thermo-mechanical)")
    heat = heat.replace("2, 100, 0.3)", "2, 100, 0.3, 1, 5)").replace("0.1, 0)", "0.1, 300)")
    said = run_interpreted(heat, command="check").err
    assert "conduction through cells of 0.1 needs such steps" in said and "waves" not in said
    rigid = re.sub(r"material\(.*\)", "material(rubber, rigid, 1000)", block(2, "set_dt(1)"))
    said = run_interpreted(rigid + "\nrun_time(1e9)\n", command="check").err
    assert "about 1e+09 steps" in said and "waves" not in said
