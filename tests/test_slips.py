"""Slips in a script that runs as it stands: told before its first step."""

import numpy as np
import pytest
from hubs import SmallHub
from scenes import block

from karamelo_py.scene import placement
from karamelo_py.scene.lattice import Lattice
from karamelo_py.scene.machine_memory import Room
from karamelo_py.scene.placement import SAMPLE, fill
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.regions import Cylinder

METAL = (
    "eos(e, linear, 8000, 160e9)\n"
    "strength(s, johnson_cook, 80e9, 4e8, 5e8, 0.3, 1, 0.01, 1, 300, 1300)\n"
)
OF = "material(rubber, eos-strength, e, s"


@pytest.mark.parametrize(
    ("lines", "material", "says", "hint"),
    [
        (
            ["region(far, block, 1, 1.2, 1, 1.2)", "group(far, nodes, region, far, all)",
             "fix(f, force_nodes, far, 1, 0)"], "",
            "fix force_nodes 'f' acts on nodes that no point reaches", "reaches into the body",
        ),
        (["compute(Ek, kinetic_energy, all)", "plot(p, 1, time, Ek)"], "",
         "plot 'p' is not drawn: the script has no save_plot", "save_plot(curves.png)"),
        ([], "eos(e, linear, 1000, 1e6)\nstrength(s, linear, 1e9)",
         "bulk modulus 1e+06 and shear modulus 1e+09 make Poisson's ratio -0.996", "2.17e+09"),
        ([], "eos(e, linear, 1000, 1e6)\nstrength(s, plastic, 1e5, 4e5)",
         "yields at 4e+05, above its shear modulus 1e+05", "the shear modulus comes first"),
        ([], "eos(e, linear, 1000, 1e6)\nstrength(s, swift, 1e5, 4e5, 1e5, 0.01, 0.2)",
         "above its shear modulus 1e+05", "the shear modulus comes first"),
        ([], "eos(e, linear, 1000, 1e6)\nstrength(s, mohr-coulomb, 1e5, 100, 0.5)",
         "its angle of friction is about 0.5 degrees", "not in radians"),
        ([], "material(rubber, linear, 7800, 2.1e11, -0.3)", "Poisson's ratio is -0.3",
         "0.3, unless"),
        ([], "material(rubber, linear, 7800, 2.1e11, -0.6)", "Poisson's ratio is -0.6",
         "from 0 to 0.5, unless"),
        ([], "material(rubber, linear, 2.1e11, 7800, 0.3)",
         "its waves move at 0.000224, since its density 2.1e+11", "before the modulus"),
        ([], "eos(e, linear, 8000, 160e9)\nstrength(s, plastic, 80e9, 4e8, 5e12)",
         "flow stress at a plastic strain of 1 is 5e+12, above its modulus", "in the units of"),
        ([], "eos(e, linear, 8000, 160e9)\n"
         "strength(s, johnson_cook, 80e9, 4e8, 5e8, 0.3, 1, 10, 0, 300, 1300)",
         "rises by 10 times its value if the rate rises by a factor of e", "0.01"),
        ([], "eos(e, linear, 2000, 1e8)\nstrength(s, mu-i, 1e7, 20, 38, 0.279, 5e-4, 2450)",
         "its coefficient of friction is 20", "tangents"),
        (["fix(e, erosion, all, ep > 0.1 && x > 0)"], "",
         "ep will be 0: points have no such field", ""),
        ([], f"{METAL}damage(d, damage_johnson_cook, 54, 489, -3, 0, 0, 1, 300, 1300)\n{OF}, d)",
         "it fails in shear at a plastic strain of 543", "not in per cent"),
        ([], f"{METAL}damage(d, damage_johnson_cook, 0.1, 3, 2.1, 0, 0, 1, 300, 1300)\n{OF}, d)",
         "with d3 = 2.1 its failure strain is larger in tension", "below 0 here"),
        ([], f"{METAL}temperature(w, plastic_work, 0.9, 500, 0, 0, 20, 1300)\n{OF}, w)",
         "T0 of the temperature is 20, Tr of the strength is 300", "degrees Celsius"),
        ([], f"{METAL}temperature(w, plastic_work, 0.9, 0.5, 0, 0, 300, 1300)\n{OF}, w)",
         "a plastic strain of 1 warms it by 9e+04 kelvin", "500 for steel"),
        ([], f"{METAL}temperature(w, plastic_work, 0.9, 500, 0, 12e-6, 300, 1300)\n{OF}, w)",
         "it expands by 2.5e-17 per kelvin", "alpha is 3 K = 4.8e+11 times"),
        ([], "material(rubber, linear, 7850, 2e11, 0.3, 460, 45, 12)",
         "it expands by 12 per kelvin", "1.2e-5"),
        ([], "eos(e, shock, 8930, 1e11, 3940, 1490, 2, 385, 294, 150, 60)\n"
         "strength(s, plastic, 43e9, 4e8)", "the slope S of its shock speed is 1490", "no unit"),
        ([], "eos(e, shock, 8930, 1e11, 3940, 1.49, 2, 385, 294, 150, 60)\n"
         "strength(s, plastic, 43e9, 4e8)", "has the coefficients 150 and 60", "1.5 and 0.06"),
    ],
)  # fmt: skip
def test_told(run_interpreted, lines, material, says, hint):
    text = block(2, *lines, "fix(g, body_force, all, 0, -1)", "set_dt(1e-9)", "run(1)")
    if material:
        (line,) = [one for one in text.splitlines() if one.startswith("material(")]
        whole = "material(" in material
        text = text.replace(
            line, material + ("" if whole else "\nmaterial(rubber, eos-strength, e, s)")
        )
    said = run_interpreted(text).err
    assert said.count(says) == 1, said
    assert hint in said


def warm_block(T0, *fixes):
    """A block in which heat flows, at T0 at first."""
    text = block(2, *fixes, "set_dt(1e-9)", "run(1)")
    text = text.replace("FLIP, linear, 1", "FLIP, linear, 1, thermo-mechanical")
    lines = text.splitlines()
    (k,) = [k for k, line in enumerate(lines) if line.startswith("material(")]
    lines[k] = f"{METAL}temperature(w, plastic_work, 0.9, 500, 50, 0, 300, 1300)\n{OF}, w)"
    return "\n".join(lines).replace("rubber, 0.1, 0)", f"rubber, 0.1, {T0})")


@pytest.mark.parametrize(
    ("T0", "fix", "says"),
    [
        (20, "", "T0 = 20, but temperatures of the material start at 300"),
        (300, "fix(f, temperature_nodes, near, -20)",
         "the temperature is -20, but bodies start at 3"),
        (300, "fix(f, convection_particles, top, 25, 20)",
         "the temperature is 20, but bodies start"),
        (300, "fix(f, heat_flux_particles, all, 1e3)", "all points of solid 'body' get heat as if"),
        (300, "fix(f, temperature_nodes, far, 400)", "'f' acts on nodes that no point reaches"),
    ],
)  # fmt: skip
def test_slips_of_heat(run_interpreted, T0, fix, says):
    lines = [
        "region(near, block, 0.25, 0.35, 0.2, 0.6)", "group(near, nodes, region, near, all)",
        "region(far, block, 1, 1.2, 1, 1.2)", "group(far, nodes, region, far, all)",
        "region(top, block, -INF, INF, 0.45, INF)", "group(top, particles, region, top, all)",
    ]  # fmt: skip
    said = run_interpreted(warm_block(T0, *lines, fix)).err
    assert said.count("warning") == 1 and says in said, said


@pytest.mark.parametrize(
    "line",
    ["fix(p, force_particles, all, 0, 1e30)", "fix(p, initial_stress, all, 1e20, 0, 0, 0, 0, 0)"],
)
def test_loads_in_other_units(run_interpreted, line):
    """No larger domain holds what they drive out of it."""
    said = run_interpreted(block(2, line, "run(1)"), status=1).err
    assert "cells in one step, out of the domain" in said and "larger" not in said
    assert "check loads, stresses and velocities, and their units" in said


def test_two_methods(run_interpreted):
    said = run_interpreted("method(ulmpm, PIC, linear)\n" + block(2, "set_dt(1e-9)", "run(1)")).err
    assert "this method replaces the one in line 1" in said


def test_what_is_usual_is_not_doubted(run_interpreted):
    """A force at nodes of the body, a curve that is drawn later, nearly incompressible rubber."""
    lines = [
        "region(near, block, 0.25, 0.35, 0.2, 0.6)", "group(near, nodes, region, near, all)",
        "fix(f, force_nodes, near, 1, 0)", "plot(p, 1, time, f_x)", "set_dt(1e-9)", "run(1)",
        "save_plot(curves.png)",
    ]  # fmt: skip
    assert "warning" not in run_interpreted(block(2, *lines)).err


def test_a_probe_of_no_point(run_interpreted):
    """Ids count from 1."""
    text = block(2, "compute(p, probe, all, x, point={})", "log_modify(custom, p)", "set_dt(1e-9)",
                 "run(1)")  # fmt: skip
    for wrong in (0, 25):
        said = run_interpreted(text.format(wrong), status=1).err
        assert "point" in said and f"point={wrong}" in said
    assert "an id from 1 to 24" in said
    assert run_interpreted(text.format(24)).log.p[-1] > 0


def test_many_points_a_cell(run_interpreted):
    text = block(2, "set_dt(1e-9)", "run(1)").replace("box, 2, rubber", "box, 11, rubber")
    said = run_interpreted(text).err
    assert "11 points per cell and direction are 121 in each cell" in said


def test_points_without_memory_are_not_counted():
    """5e7 points where there is room for 4e7: known by some places of the region."""
    hub, looked = SmallHub(), []
    disk = hub.region("r", Cylinder, 0.1, 0, 0.2)
    inside = disk.inside
    disk.inside = lambda x: looked.append(len(x)) or inside(x)
    lattice = Lattice(2, hub.domain.lo, hub.domain.hi, 1e-4)
    room = Room(whole=4e9, of_one=100, already=0, single=False)
    said = (
        r"with these, the scene has some 4.\de\+07 points, which take more than 4.\d+ GiB of memory"
    )
    with pytest.raises(ScriptError, match=rf"{said}; this machine has 3.73 GiB in total"):
        fill(disk, hub.domain, lattice, 2, room=lambda: room)
    assert sum(looked) == SAMPLE


def test_many_points_a_cell_without_memory_are_refused_at_once(monkeypatch):
    """A thin ring with 4000^2 points a cell: known before the pattern of a cell is made."""
    monkeypatch.setattr(placement, "cell_pattern", None)
    hub = SmallHub()
    ring = hub.region("r", Cylinder, 0.1, 0, 0.2)
    disk = ring.inside
    ring.inside = lambda x: disk(x) & (np.hypot(x[:, 0] - 0.1, x[:, 1]) > 0.195)
    lattice = Lattice(2, hub.domain.lo, hub.domain.hi, 0.05)
    # pi (0.2^2 - 0.195^2) (4000/0.05)^2 = 4.0e7 points
    room = Room(whole=3.6e9, of_one=100, already=0, single=False)
    with pytest.raises(ScriptError, match=r"with these, the scene has some 3.[6-9]\d*e\+07 points"):
        fill(ring, hub.domain, lattice, 4000, room=lambda: room)


def test_a_variable_wins_over_a_first_coordinate(run_interpreted):
    """As in a script of Karamelo, whose FSI example says x0 = l0; it is told."""
    fix = "fix(v, initial_velocity_particles, all, {}, 0)\ncompute(v, average_velocity, all)"
    tail = ["log_modify(custom, v_x)", "set_dt(1e-9)", "run(1)"]
    named = run_interpreted("l0 = 3\nx0 = l0\n" + block(2, fix.format("2*x0"), *tail))
    assert "'x0' is a coordinate of points before the first step, too; from here on" in named.err
    assert named.log.v_x[0] == 6
    other = run_interpreted("l0 = 3\n" + block(2, fix.format("2*x0"), *tail))
    assert "warning" not in other.err and 0.6 < other.log.v_x[0] < 1.2
