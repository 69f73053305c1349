"""Slips in a script that runs as it stands: told before its first step."""

import pytest
from hubs import SmallHub
from scenes import block

from karamelo_py.scene.lattice import Lattice
from karamelo_py.scene.machine_memory import Room
from karamelo_py.scene.placement import SAMPLE, fill
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.regions import Cylinder


@pytest.mark.parametrize(
    ("lines", "material", "says", "hint"),
    [
        (
            ["region(far, block, 1, 1.2, 1, 1.2)", "group(far, nodes, region, far, all)",
             "fix(f, force_nodes, far, 1, 0)"], "",
            "fix force_nodes 'f' acts on nodes that no point reaches", "reaches into the body",
        ),
        (
            ["compute(Ek, kinetic_energy, all)", "plot(p, 1, time, Ek)"], "",
            "plot 'p' is drawn nowhere: the script has no save_plot", "save_plot(curves.png)",
        ),
        (
            [], "eos(e, linear, 1000, 1e6)\nstrength(s, linear, 1e9)",
            "bulk modulus 1e+06 and shear modulus 1e+09 make Poisson's ratio -0.996", "2.17e+09",
        ),
        (
            [], "eos(e, linear, 1000, 1e6)\nstrength(s, plastic, 1e5, 4e5)",
            "yields at 4e+05, above its shear modulus 1e+05", "the shear modulus stands first",
        ),
        (
            [], "eos(e, linear, 1000, 1e6)\nstrength(s, swift, 1e5, 4e5, 1e5, 0.01, 0.2)",
            "above its shear modulus 1e+05", "the shear modulus stands first",
        ),
        (
            [], "eos(e, linear, 1000, 1e6)\nstrength(s, mohr-coulomb, 1e5, 100, 0.5)",
            "its angle of friction is about 0.5 degrees", "not in radians",
        ),
        (
            [], "material(rubber, linear, 2.1e11, 7800, 0.3)",
            "waves of it move at 0.000224, since its density 2.1e+11", "before the modulus",
        ),
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


def test_two_methods(run_interpreted):
    said = run_interpreted("method(ulmpm, PIC, linear)\n" + block(2, "set_dt(1e-9)", "run(1)")).err
    assert "this method takes the place of that of line 1" in said


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
    assert "11 points a cell and direction are 121 in each cell" in said


def test_points_without_memory_are_not_counted():
    """5e7 points where there is room for 4e7: known by some places of the region."""
    hub, looked = SmallHub(), []
    disk = hub.region("r", Cylinder, 0.1, 0, 0.2)
    inside = disk.inside
    disk.inside = lambda x: looked.append(len(x)) or inside(x)
    lattice = Lattice(2, hub.domain.lo, hub.domain.hi, 1e-4)
    room = Room(whole=4e9, of_one=100, already=0, single=False)
    said = (
        r"the scene has some 4.\de\+07 points with these, which take more than 4.\d+ GiB of memory"
    )
    with pytest.raises(ScriptError, match=rf"{said}; this machine has 3.73 GiB in all"):
        fill(disk, hub.domain, lattice, 2, room=lambda: room)
    assert sum(looked) == SAMPLE


def test_a_variable_wins_over_a_first_coordinate(run_interpreted):
    """As in a script of Karamelo, whose FSI example says x0 = l0; it is told."""
    fix = "fix(v, initial_velocity_particles, all, {}, 0)\ncompute(v, average_velocity, all)"
    tail = ["log_modify(custom, v_x)", "set_dt(1e-9)", "run(1)"]
    named = run_interpreted("l0 = 3\nx0 = l0\n" + block(2, fix.format("2*x0"), *tail))
    assert "'x0' is a coordinate of points before the first step, too; from here on" in named.err
    assert named.log.v_x[0] == 6
    other = run_interpreted("l0 = 3\n" + block(2, fix.format("2*x0"), *tail))
    assert "warning" not in other.err and 0.6 < other.log.v_x[0] < 1.2
