"""No more than a scene needs: fields, memory, and what check says could be left out."""

import os
import re
import subprocess
import sys
import tracemalloc
from contextlib import suppress
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import INPUTS, ROOT

from comparisons.lesser import MODELS, ROWS
from karamelo_py.advice.suggestions import _output as output
from karamelo_py.advice.suggestions import suggestions
from karamelo_py.app.cli import main
from karamelo_py.compiler import classes_in
from karamelo_py.compiler.disk import cache
from karamelo_py.compiler.fields import name_of, rows_of_points, some_points
from karamelo_py.compiler.trace.functions import PointFunction, forget, outdate_kernels
from karamelo_py.kernels.equations.fbar import NodalMean
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.step import advance
from karamelo_py.kernels.table import in_scene, scene_additions, take
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.implicit.load_steps import LoadSteps
from karamelo_py.run.lower.memory import bytes_per_point, node_fields, point_fields
from karamelo_py.run.stable_step import own_weight_of_drift
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Quit, ScriptError

DOCS = ROOT / "docs" / "needs.md"


@pytest.fixture
def lowered(tmp_path, monkeypatch):
    """``lowered(script or path, **variables)``: the hub at its first run, nothing compiled."""
    monkeypatch.chdir(tmp_path)

    def build(script, **variables) -> Hub:
        path = script
        if isinstance(script, str):
            path = tmp_path / "in.script"
            path.write_text(script, encoding="utf-8")
        found = []
        monkeypatch.setattr(
            "karamelo_py.commands.run.report", lambda hub, end_time=0: found.append(hub)
        )
        # It asks for points that are sorted, as the report leaves them.
        monkeypatch.setattr(LoadSteps, "refuse_all_loose", lambda steps: None)
        hub = Hub(Console(quiet=True))
        hub.checking = True
        hub.interpreter = Interpreter(hub, presets={k: str(v) for k, v in variables.items()})
        with suppress(Quit):  # the check ends the script
            hub.interpreter.run_file(str(path))
        return found[0]

    return build


PLANE = """
method({method})
dimension(2, 0, {side}, 0, {side}, 1)
region(box, block, 2, 2 + {n}, 2, 2 + {n})
material(rubber, {law})
solid(body, region, box, 2, rubber, 1)
{more}
run(1)
"""


def plane(
    method="ulmpm, FLIP, linear, 1", law="neo-hookean, 1, 100, 0.3", more="", side=12, n=4
) -> str:
    return PLANE.format(method=method, law=law, more=more, side=side, n=n)


# --- Fields --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "numbers"), [("neo-hookean, 1, 100, 0.3", 4), ("linear, 1, 100, 0.3", 5)]
)
def test_an_elastic_plane_has_two_coordinates_and_nothing_else(lowered, law, numbers):
    """F has four components in plane strain; a stress four (s33 is not zero there), and det F.

    No temperature, damage, third coordinate, nor hoop component; nodes have mass, momentum, force
    (five numbers of the eight of a record), two velocities and what changed.
    """
    s = lowered(plane(law=law)).simulation.setup
    [block] = s.blocks
    found = {name: (int(size), size_of) for name, size, size_of in point_fields(block)}
    assert found == {
        "x": (2, 16), "x moved": (2, 16), "v": (2, 16), "mass": (1, 8),
        "state": (numbers, 8 * numbers), "material": (1, 4), "grid": (1, 4), "id": (1, 8),
    }  # fmt: skip
    assert block.points.home is None and block.points.fields == ()
    assert [(name, array.shape[1]) for name, array in node_fields(s)] == [
        ("sums", 8), ("update", 4), ("velocity", 2)
    ]  # fmt: skip
    assert not isinstance(s.heat, Conducting)


MORE = {
    "thermo-mechanical": (
        {"method": "ulmpm, FLIP, linear, 1, thermo-mechanical",
         "law": "neo-hookean, 1, 100, 0.3, 2, 3"}, {"temperature", "heat gradient"}),
    "affine": ({"method": "ulmpm, APIC, quadratic-spline"}, {"moment"}),
    "averaged": ({"method": "ulmpm, FLIP, linear, 1",
                  "more": "anti_volumetric_locking(true)"}, {"volume ratio"}),
    "pushed": ({"more": "fix(p, indent, all, sphere, 1e3, 3, 9, 1, 0)"}, {"force"}),
}  # fmt: skip


@pytest.mark.parametrize("name", MORE)
def test_fields_come_with_what_needs_them(lowered, name):
    """What is absent above is there where somebody asks for it."""
    words, wanted = MORE[name]
    [block] = lowered(plane(**words)).simulation.setup.blocks
    fields = {name_of(type(one)) for one in block.points.fields}
    assert wanted <= fields
    plain = lowered(plane()).simulation.setup.blocks[0].points.fields
    assert plain == ()


def test_only_what_averages_has_a_nodal_mean(lowered):
    kinds = [type(one) for one in lowered(plane()).simulation.setup.nodes.fields]
    assert NodalMean not in kinds


IN_KERNEL = {
    # what the scene has: components, grid, basis, transfer, threads
    "PlaneStrain", "Grid", "Linear", "FLIP", "Serial",
    # that it has no more: heat, contact, fixes at every step, other processes
    "NoHooks", "FixedFrame", "Alone",
    # what is done at points and nodes in the two visits of musl
    "Strain", "Move", "MassMomentum", "MomentumAgain", "InternalForce", "NodalUpdate",
    "MomentumToVelocity", "Stencil",
}  # fmt: skip


@pytest.mark.xdist_group("disks")
def test_a_kernel_has_the_code_of_what_is_there_and_no_other(run_script, monkeypatch):
    """All that is chosen by type while the steps of two elastic disks are traced.

    Nothing in it is of heat that flows, contact, damage, plastic flow or a third direction: what is
    absent cannot branch.
    """
    text = (INPUTS / "in.two_disks").read_text(encoding="utf-8")
    run_script(text.replace("run_time(3.5)", "run(2)"))
    steps = [kinds for kinds in advance.units if {*names_in(kinds)} >= STEPS]
    assert all(advance.files._key(kinds, None) for kinds in steps)  # found by its sources
    words, find = set(), PointFunction.find

    def noted(self, classes):
        if self not in (take, in_scene, scene_additions):
            words.update(one.__name__ for one in classes if one)
        return find(self, classes)

    monkeypatch.setattr(PointFunction, "find", noted)
    monkeypatch.setattr(cache, "machine_code", lambda name, make: b"")
    monkeypatch.setattr(cache.KernelFiles, "kernel", lambda self, kinds, result, made: made())
    found = []
    for kinds in reversed(steps):  # those of other tests, too
        forget()
        outdate_kernels()
        words.clear()
        advance.unit(kinds)
        found.append({*words})
        if found[-1] == IN_KERNEL:
            break
    outdate_kernels()
    assert IN_KERNEL in found


STEPS = {"PlaneStrain", "FLIP", "MUSL", "Linear", "Insulated", "NoContact"}


def names_in(kinds):
    return [one.__name__ for kind in kinds for one in classes_in(kind)]


# --- Bytes of every script -----------------------------------------------------------------------

SCRIPTS = sorted(path.name for path in INPUTS.glob("in.*") if path.name != "in.element")
# Sizes do not matter for bytes per point; large scenes are made small here.
SMALL = {"in.taylor_bar": "1/3", "in.vertical_bar": "1/2", "in.taylor_bar_227": "1/2"}


def listed() -> dict[str, int]:
    """Bytes of a point by script, as docs/needs.md says."""
    found = {}
    for line in DOCS.read_text(encoding="utf-8").splitlines():
        match = re.match(r"\| `(in\.\w+)` \|.*\| (\d+) \|$", line)
        if match:
            found[match[1]] = int(match[2])
    return found


@pytest.mark.parametrize("script", SCRIPTS)
def test_bytes_of_a_point_are_those_that_are_listed(lowered, script):
    """Guards against growth: who adds a number per point has to say so in docs/needs.md."""
    if script == "in.cantilever_tets":
        pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    small = {"refine": SMALL[script]} if script in SMALL else {}
    hub = lowered(INPUTS / script, **small)
    found = bytes_per_point(hub.simulation)
    words = hub.simulation.setup.kin.word, hub.update.words
    row = f"| `{script}` | {' | '.join(words)} | LAW | {found} |"
    assert found == listed().get(script), f"if it must be, write to docs/needs.md: {row}"


# --- Memory --------------------------------------------------------------------------------------


def peak_of(path, command="check", *, compiled=False, find="", threads=0, **variables) -> float:
    """MiB that a subcommand takes at most, in a process of its own, or that it says."""
    words = ["--threads", str(threads)] if threads else []
    words += [word for k, v in variables.items() for word in ("-var", k, str(v))]
    code = (
        "import sys; from karamelo_py.app.cli import main; status = main(sys.argv[1:]); "
        "print(open('/proc/self/status').read().split('VmHWM:')[1].split()[0]); sys.exit(status)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, command, str(path), *words], text=True, check=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": str(int(not compiled))}, capture_output=True,
    )  # fmt: skip
    if find:
        return float(re.search(find, done.stdout)[1])
    return int(done.stdout.split()[-1]) / 2**10


# What getrusage says is that of the process which starts it, where that is larger.
known_peak = pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="needs /proc")


@known_peak
def test_a_domain_100_times_larger_takes_no_more_memory(tmp_path):
    """The same body; a million nodes more would be 112 MB if they were touched."""
    path = tmp_path / "in.script"
    path.write_text("side = 100\n" + plane(side="side"), encoding="utf-8")
    near, far = (peak_of(path, side=side) for side in (100, 1000))
    # Two processes differ by a MiB or so; 16 000 tiles have 60 bytes each.
    assert far - near < 4


@pytest.mark.full
@known_peak
@pytest.mark.xdist_group("disks")
def test_a_scene_is_made_in_twice_its_memory(tmp_path, monkeypatch, capsys):
    """Peak of all arrays while check builds half a million points, over what it says of them."""
    monkeypatch.chdir(tmp_path)
    text = (INPUTS / "in.two_disks").read_text(encoding="utf-8")
    path = tmp_path / "in.disks"
    path.write_text(text, encoding="utf-8")
    assert main(["check", "in.disks", "-var", "N", "700"]) == 0
    said = re.search(
        r"memory +(\d+) MiB in a run.*\n +([\d.]+) MiB of them are a copy", capsys.readouterr().out
    )
    whole, copy = float(said[1]), float(said[2])
    assert whole - copy > 60 and copy > 40
    _, few, many = (peak_of(path, compiled=True, N=N) for N in (20, 20, 700))
    assert 60 < many - few < 2 * (whole - copy)  # the copy is made later


@known_peak
@pytest.mark.xdist_group("disks")
def test_what_check_says_of_the_memory_of_the_process(tmp_path, monkeypatch, capsys):
    """Without dumps and without compiling; allocators keep a few percent for themselves."""
    monkeypatch.chdir(tmp_path)
    text = (INPUTS / "in.two_disks").read_text(encoding="utf-8").replace("run_time(3.5)", "run(3)")
    path = tmp_path / "in.disks"
    path.write_text(re.sub(r"(?m)^(dump|plot|save_plot)\(.*$", "", text), encoding="utf-8")
    # What this process compiled before may lie in another cache than that of its children.
    peak_of(path, "run", compiled=True, threads=1, N=20)
    said = peak_of(path, compiled=True, threads=1, find=r"(\d+) MiB with the program", N=300)
    assert said == pytest.approx(peak_of(path, "run", compiled=True, threads=1, N=300), rel=0.15)


# --- What could be left out ----------------------------------------------------------------------


@pytest.fixture
def advice(lowered):
    """``advice(script, dt=1, limit=1)``: what check says could be left out, as one text."""

    def say(script, dt=1.0, limit=1.0, **variables) -> str:
        hub = lowered(script, **variables)
        weight = own_weight_of_drift(hub)
        control = SimpleNamespace(
            step=[SimpleNamespace(spacing=limit, end_time=inf)],
            motion=[SimpleNamespace(rate=1, weight=weight)],
            heat=[SimpleNamespace(heat_limit=inf)],
        )
        known = {"dt": dt, "limit": limit, "control": control, "implicit": False}
        known["steps"] = SimpleNamespace(later_dt=dt)
        found = suggestions(hub, SimpleNamespace(**known, fastest=lambda: 0.0))
        return "\n".join(f"{suggestion.reason} / {suggestion.cure}" for suggestion in found)

    return say


def test_scenes_without_waste_hear_nothing(advice):
    assert advice(plane()) == ""
    for script in ("in.vibrating_bar", "in.lame", "in.vortex", "in.two_disks", "in.dam_break"):
        assert advice(INPUTS / script) == "", script


@pytest.mark.parametrize(("script", "weight"), [("in.dam_break", 1), ("in.energy_disk", 0)])
def test_what_flows_keeps_the_common_drift_in_its_step(lowered, script, weight):
    assert own_weight_of_drift(lowered(INPUTS / script, basis="cubic-spline")) == weight


def test_a_small_step_is_no_waste(advice):
    """With the program's step in its place, 3 of 14 scenes stop, and two move by 12 and 17 %.

    Measured in docs/study-measurements.md: check tells that step, and says no more of it.
    """
    for more in ("set_dt(0.001)", "dt_factor(0.1)"):
        assert advice(plane(more=more), dt=0.001, limit=0.04) == ""


def test_what_is_measured_and_shown_nowhere(advice):
    text = plane(more="compute(Ek, kinetic_energy, all)\ncompute(Es, strain_energy, all)\n"
                      "# Ek is not shown\nlog_modify(custom, step, Es)")  # fmt: skip
    said = advice(text)
    assert "compute Ek (kinetic_energy) is measured at each output but never shown" in said
    assert "name Ek in log_modify" in said and "Es" not in said


def test_materials_that_nothing_uses(advice):
    said = advice(plane(more="material(spare, linear, 1, 1, 0)\neos(water, linear, 1, 1)"))
    assert said.splitlines() == [
        "no solid uses the material spare / leave it out, or name it in a solid",
        "no material uses the eos water / leave it out, or name it in a material",
    ]


def test_materials_of_solids_after_a_run_are_used(advice):
    before = "material(late, linear, 1, 1, 0)\neos(water, linear, 1, 1)\nstrength(s, fluid, 0)"
    after = """
        material(more, eos-strength, water, s)
        region(further, block, 7, 9, 2, 4)
        solid(further, region, further, 1, {}, 1)
        run(1)
        """
    said = advice(plane(more=before) + after.format("late"))
    assert "late" not in said and "water" not in said
    assert "late" in advice(plane(more=before) + after.format("more"))


def test_what_an_included_script_shows(advice, tmp_path):
    """Also one that stands behind the run that is looked at."""
    (tmp_path / "rest.in").write_text("log_modify(custom, step, Ek)\n")
    text = plane(more="compute(Ek, kinetic_energy, all)")
    assert "Ek" in advice(text)
    assert "Ek" not in advice(text + "include(rest.in)\nrun(1)\n")


METAL = """
eos(bulk, linear, 1, 100)
strength(hard, {strength})
{more}
material(metal, eos-strength, bulk, hard{parts})
"""


@pytest.mark.parametrize(
    ("strength", "more", "parts", "said"),
    [
        ("johnson_cook, 50, 3, 0, 0.3, 1, 0, 0, 0, 100", "", "",
         "strength(..., plastic, 50, 3)"),
        ("johnson_cook, 50, 3, 1, 0.3, 1, 0, 1, 0, 100", "", "", ""),
        ("plastic, 50, 3", "temperature(warm, plastic_work, 0.9, 2, 0, 0, 5, 100)", ", warm",
         "leave the temperature out"),
        # Damage by temperature, and flow stresses by it that have no softening as a part.
        ("plastic, 50, 3", "damage(old, damage_johnson_cook, 1, 1, -1, 0, 0, 1, 5, 100)\n"
         "temperature(warm, plastic_work, 0.9, 2, 0, 0, 5, 100)", ", old, warm",
         "leave the temperature out"),
        ("plastic, 50, 3", "damage(old, damage_johnson_cook, 1, 1, -1, 0, 5, 1, 5, 100)\n"
         "temperature(warm, plastic_work, 0.9, 2, 0, 0, 5, 100)", ", old, warm", ""),
        ("zerilli-armstrong, 50, 3, 1, 0, 1e-3, 0, 0, 1",
         "temperature(warm, plastic_work, 0.9, 2, 0, 0, 5, 100)", ", warm", ""),
        ("zerilli-armstrong, 50, 3, 0, 0, 1e-3, 0, 1, 1",
         "temperature(warm, plastic_work, 0.9, 2, 0, 0, 5, 100)", ", warm",
         "leave the temperature out"),
        ("formula, 50, 3 + ep - 0.01*T",
         "temperature(warm, plastic_work, 0.9, 2, 0, 0, 5, 100)", ", warm", ""),
        ("formula, 50, 3 + ep",
         "temperature(warm, plastic_work, 0.9, 2, 0, 0, 5, 100)", ", warm",
         "leave the temperature out"),
        ("johnson_cook, 50, 3, 1, 0.3, 1, 0, 1, 0, 100",
         "temperature(warm, plastic_work, 0.9, 2, 0, 0, 5, 100)", ", warm", ""),
    ],
)  # fmt: skip
def test_parts_of_a_law_that_never_act(advice, strength, more, parts, said):
    metal = METAL.format(strength=strength, more=more, parts=parts)
    text = plane().replace("material(rubber, neo-hookean, 1, 100, 0.3)", metal)
    found = advice(text.replace(", 2, rubber, 1)", ", 2, metal, 1, 5)"))
    assert said in found if said else found == ""


def test_heat_that_does_not_flow(advice):
    warm = "neo-hookean, 1, 100, 0.3, 2, 3"
    assert "leave cp and kappa out" in advice(plane(law=warm))
    assert advice(plane(law=warm + ", 1e-3")) == ""  # friction may heat it
    read = "compute(T, average_temperature, all)\nlog_modify(custom, step, T)"
    assert advice(plane(law=warm, more=read)) == ""
    assert advice(INPUTS / "defaults" / "in.slide") == ""
    assert advice(plane(law=warm, method="ulmpm, FLIP, linear, 1, thermo-mechanical")) == ""


SPACE = """
method(ulmpm, FLIP, linear, 1)
dimension(3, 0, 6, 0, 5, 0, 2, 1)
region(box, {region})
material(rubber, neo-hookean, 1, 100, 0.3)
solid(body, region, box, 2, rubber, 1)
fix(v, initial_velocity_particles, all, {v})
{held}
run(1)
"""
HELD = "fix(walls, velocity_nodes, all, NULL, NULL, 0)"


def test_space_for_what_is_plane(advice):
    slab = SPACE.format(region="block, 1, 4, 1, 3, 0, 2", v="0.1*x0, 0.2, 0", held=HELD)
    said = advice(slab)
    assert "uniform along z" in said and "4 times the points of plane strain" in said
    assert "dimension(2, 0, 6, 0, 5, 1)" in said
    # Free to move along z, moved by a formula of z, or another shape in each layer: no.
    for old, new in (
        (HELD, ""), ("0.1*x0", "0.1*z0"), ("block, 1, 4, 1, 3, 0, 2", "sphere, 2, 2, 1, 1")
    ):  # fmt: skip
        assert "uniform along" not in advice(slab.replace(old, new))


PLATE = """
method(ulmpm, FLIP, linear, 1)
dimension(3, 0, {box}, 0, 14, -2, 4, 1)
region(box, block, 1, 11, 1, 13, 0, {thick})
material(rubber, neo-hookean, 1, 100, 0.3)
solid(body, region, box, 1, rubber, 1)
{fixes}
run(1)
"""


def test_plane_stress_for_a_thin_plate(advice):
    pull = "fix(v, initial_velocity_particles, all, 0.1*x0, 0, 0)"
    said = advice(PLATE.format(box=12, thick=2, fixes=pull))
    assert "a plate with free faces, and nothing acts along z: 2 times the points of" in said
    assert "dimension(2, 0, 12, 0, 14, 1) and plane_stress(true, thickness=2)" in said
    locking = pull + "\nanti_volumetric_locking(true)"
    said = advice(PLATE.format(box=12, thick=2, fixes=locking))
    assert "not with anti_volumetric_locking" in said
    loaded = "fix(pull, edge_traction, all, box, xhi, {tx}, 0, 0)"
    said = advice(PLATE.format(box=12, thick=2, fixes=loaded.format(tx="2*y")))
    assert "plane_stress(true, thickness=2)" in said
    bent = "fix(v, initial_velocity_particles, all, 0, 0, 0.1*x0)"
    uneven = loaded.format(tx="z")
    sheared = loaded.format(tx=1).replace("xhi", "zhi")
    held = (
        "group(all_nodes, nodes, region, box, all)\n"
        + pull
        + ("\nfix(hold, velocity_nodes, all_nodes, NULL, NULL, 0)")
    )
    for thick, fixes in ((4, pull), (2, bent), (2, held), (2, uneven), (2, sheared)):
        assert "plane stress" not in advice(PLATE.format(box=12, thick=thick, fixes=fixes))


def test_a_plane_for_what_is_a_line(advice):
    text = plane(more="fix(walls, velocity_nodes, all, 0, NULL)", side=8)
    said = advice(text)
    assert "uniform along x" in said and "8 times the points of a line" in said
    assert "dimension(1, 0, 8, 1), with y called x" in said


STANDS = """
method(ulmpm, FLIP, linear, 0.99)
dimension({domain}, 0.1)
region(box, block, {box})
material(soil, neo-hookean, 1000, 1e4, 0.3)
solid(body, region, box, 2, soil, 0.1)
{groups}
{fixes}
run(1)
"""


def walls(**regions: str) -> str:
    """Groups of the nodes in regions."""
    return "\n".join(
        f"region({name}, block, {where})\ngroup({name}, nodes, region, {name}, all)"
        for name, where in regions.items()
    )


def foot(end: str) -> str:
    """Walls about a square, and the nodes above it up to x = `end`."""
    return walls(
        floor="-INF, INF, -INF, 0", left="-INF, 0, -INF, INF", right="1, INF, -INF, INF",
        foot=f"-INF, {end}, 0.5, INF",
    )  # fmt: skip


SQUARE = {"domain": "2, 0, 1, 0, 1", "box": "0, 1, 0, 0.5", "groups": foot("INF")}
BOX = "fix(l, velocity_nodes, left, 0, NULL)\nfix(r, velocity_nodes, right, 0, NULL)\n"
FLOOR = "fix(b, velocity_nodes, floor, 0, 0)\nfix(w, body_force, all, 0, -9.81)\n"
PRESS = "fix(p, velocity_nodes, foot, NULL, -0.1)\n"


@pytest.mark.parametrize(
    ("fixes", "changed", "said"),
    [
        (BOX + FLOOR, {}, "uniform along x"),  # uniaxial strain
        (BOX + FLOOR + PRESS, {}, "uniform along x"),
        (BOX + FLOOR + PRESS, {"groups": foot("0.5")}, ""),  # a footing
        (FLOOR, {}, ""),  # bulges to both sides
        (FLOOR + BOX.splitlines()[0], {}, ""),  # a column that collapses
        (BOX + FLOOR, {"box": "0, 0.7, 0, 0.5"}, ""),  # free to move as far as the wall
        (BOX.replace("left, 0, NULL", "left, 0, NULL, mu=0.3") + FLOOR, {}, ""),
        (BOX + FLOOR.replace("0, -9.81", "0, -9.81*x"), {}, ""),
    ],
)
def test_a_line_only_between_walls_that_act_alike(advice, fixes, changed, said):
    """What is held at its foot only, or moved by a part of the width, is no line."""
    found = advice(STANDS.format(**{**SQUARE, "fixes": fixes, **changed}))
    assert said in found if said else "uniform along" not in found


def test_plane_strain_only_between_walls(advice):
    space = {
        "domain": "3, 0, 1, 0, 1, 0, 0.2", "box": "0.2, 0.8, 0, 0.5, 0, 0.2",
        "groups": walls(floor="-INF, INF, -INF, 0, -INF, INF", low="-INF, INF, -INF, INF, -INF, 0",
                        high="-INF, INF, -INF, INF, 0.2, INF"),
    }  # fmt: skip
    floor = "fix(b, velocity_nodes, floor, 0, 0, 0)\nfix(w, body_force, all, 0, -9.81, 0)\n"
    low, high = (f"fix({w}, velocity_nodes, {w}, NULL, NULL, 0)\n" for w in ("low", "high"))
    assert "uniform along z" in advice(STANDS.format(**space, fixes=floor + low + high))
    for fixes in (floor, floor + low):
        assert "uniform along" not in advice(STANDS.format(**space, fixes=fixes))


def test_bodies_of_which_one_ends_before_the_other_are_no_line(advice):
    """Side by side between the walls: each is uniform along x, both together are not."""
    text = STANDS.format(**{**SQUARE, "box": "0, 0.5, 0, 0.5"}, fixes=BOX + FLOOR)
    second = "region(rest, block, 0.5, 1, 0, 0.5)\nsolid(other, region, rest, 2, soil, 0.1)\n"
    assert advice(text.replace("region(floor", second + "region(floor")) == ""


def test_scenes_that_need_their_dimensions_are_told_nothing_of_them(advice):
    for script in ("in.footing", "in.vertical_bar"):
        assert "dimension(" not in advice(INPUTS / script), script
    assert "dimension(1, 0, 10, 0.625)" in advice(INPUTS / "in.column")  # rollers everywhere


def test_space_for_what_is_round(advice):
    rod = SPACE.format(region="cylinder, z, 3, 2.5, 2, 0, 2", v="0, 0, -1",
                       held="fix(f, body_force, all, 0, 0, sin(z))")  # fmt: skip
    said = advice(rod)
    assert "cylinders about one axis" in said and "13.6 times the points" in said
    assert "axisymmetric(true)" in said
    assert advice(rod.replace("sin(z)", "sin(x)")) == ""
    assert advice(rod.replace("0, 0, -1", "0.1, 0, -1")) == ""
    half = walls(half="-INF, 3, -INF, INF, -INF, INF") + "\n"
    part = rod.replace("fix(f, body_force, all", half + "fix(f, body_force, half")
    assert advice(part) == ""


BALL = """
method(ulmpm, FLIP, linear, 1)
dimension(3, -4, 4, -4, 4, -1, 4, 0.5)
material(rubber, neo-hookean, 1, 100, 0.3)
region(ball, sphere, 0, 0, 1.5, 1)
solid(ball, region, ball, 1, rubber, 0.5)
{more}
run(1)
"""
ON_A_PLATE = """region(plate, block, -3, 3, -3, 3, -1, 0)
solid(plate, region, plate, 1, rubber, 0.5)
group(ball, particles, region, ball, solid, ball)
region(low, block, INF, INF, INF, INF, INF, -0.5)
group(low, nodes, region, low, all)
fix(hold, velocity_nodes, low, 0, 0, 0)
fix(v, initial_velocity_particles, ball, {v})"""


def test_less_than_3d_for_a_ball(advice):
    """Under a pressure a line; thrown at a square plate that is wider, a half plane."""
    said = advice(BALL.format(more="fix(p, edge_pressure, all, ball, time)"))
    assert "spheres about one centre" in said and "spherical(true)" in said
    plate = ON_A_PLATE.format(v="0, 0, -1")
    said = advice(BALL.format(more=plate))
    assert "bodies about one axis" in said and "plate as a round plate" in said
    assert "axisymmetric(true)" in said
    oblique, narrow = (
        ON_A_PLATE.format(v="0.1, 0, -1"),
        plate.replace("-3, 3, -3, 3", "-1, 3, 0, 1"),
    )
    for other in (oblique, narrow, "fix(p, edge_pressure, all, ball, x*y)"):
        said = advice(BALL.format(more=other))
        assert "spherical" not in said and "axisymmetric" not in said


def test_uniaxial_stress_for_a_bar(advice):
    """Of any section, whole or a quarter of it between symmetry planes; but not when bent."""
    bar = PLATE.replace("box(", "(").format(box=12, thick=2, fixes="{fixes}")
    bar = bar.replace("1, 11, 1, 13, 0, 2", "1, 11, 1, 3, 0, 2").format(fixes="{fixes}")
    v = "fix(v, initial_velocity_particles, all, {})"
    said = advice(bar.replace("{fixes}", v.format("0.1*x0, 0, 0")))
    assert "a bar with free sides, and nothing acts along y and z: 4 times the points" in said
    assert "dimension(1, 0, 12, 1), and uniaxial_stress(true, area=4)" in said
    for other in ("0, 0.1*x0, 0", "0.1*y0, 0, 0"):
        assert "uniaxial_stress" not in advice(bar.replace("{fixes}", v.format(other)))


WOOD = "orthotropic, 1, 140, 9, 6, 0.3, 0.2, 0.4, 5, 4, 3"
HILL = (
    "linear, 1, 100, 0.3)\nstrength(y, plastic, 38, 1, 1)\nmaterial(m, hill, rubber, y, R=(2,1,1)"
)


@pytest.mark.parametrize(
    ("section", "law", "said"),
    [
        ("slab", WOOD, "plane strain"),
        ("slab", WOOD + ", axes=(90*x0)", "plane strain"),
        ("slab", WOOD + ", 0, 30", ""),
        ("slab", WOOD + ", axes=(1, 0, 1, 0, 1, 0)", ""),
        ("slab", WOOD + ", axes=(90*z0)", ""),
        ("slab", "jointed, 1, 100, 0.25, 1, 25, 0, 30", ""),
        ("13", WOOD + ", 30", "plane_stress"),
        ("13", WOOD + ", 0, 30", ""),
        ("13", WOOD + ", axes=(90*z0)", ""),
        ("3", "transverse, 1, 9, 0.3, 140, 0.3, 5, 90, 90", "uniaxial_stress"),
        ("3", WOOD, ""),
        ("3", HILL, ""),
        ("3", "jointed, 1, 100, 0.25, 1, 25, 30, 90", ""),
    ],
)
def test_directions_of_a_law_fit_the_lesser_model(advice, section, law, said):
    """As scenes refuse them, or warn of them."""
    if section == "slab":
        text = SPACE.format(region="block, 1, 4, 1, 3, 0, 2", v="0.1*x0, 0.2, 0", held=HELD)
    else:
        pull = "fix(v, initial_velocity_particles, all, 0.1*x0, 0, 0)"
        text = PLATE.format(box=12, thick=2, fixes=pull).replace("1, 13, 0", f"1, {section}, 0")
    text = text.replace("neo-hookean, 1, 100, 0.3", law)
    found = advice(text.replace("1, rubber", "1, m") if law is HILL else text)
    assert said in found if said else found == ""


def test_directions_across_a_line(advice):
    line = plane(more="fix(walls, velocity_nodes, all, NULL, 0)", side=8, law=WOOD + ", {}")
    assert "a line" in advice(line.format(0)) and advice(line.format(30)) == ""


TWIST = """
group(ends, nodes, region, box, all)
fix(turn, velocity_nodes, ends, {velocity})
"""


def test_twist_for_a_rod_in_torsion(advice):
    """Velocities of a rotation about the axis, whatever its time, and none other."""
    rod = SPACE.format(region="cylinder, z, 3, 2.5, 2, 0, 2", v="0, 0, 0", held=TWIST)
    said = advice(rod.replace("{velocity}", "-3*(y0 - 2.5), 3*(x0 - 3), 0"))
    assert "which rotate and twist about it" in said
    assert "axisymmetric(true, twist=true)" in said
    assert "fix(turn_around, angular_velocity_nodes, ends, 3)" in said
    xpic = rod.replace("ulmpm, FLIP, linear, 1", "ulmpm, XPIC, linear, 2")
    said = advice(xpic.replace("{velocity}", "-3*(y0 - 2.5), 3*(x0 - 3), 0"))
    assert "not with transfer XPIC (instead: APIC or FLIP)" in said
    ramp = "-time*z0*(y0 - 2.5), time*z0*(x0 - 3), 0"
    assert "angular_velocity_nodes, ends, omega)" in advice(rod.replace("{velocity}", ramp))
    for other in ("-3*(y0 - 2), 3*(x0 - 3), 0", "3*(x0 - 3), 3*(y0 - 2.5), 0", "-3*y0*(y0 - 2.5), "
                  "3*y0*(x0 - 3), 0"):  # fmt: skip
        assert "twist" not in advice(rod.replace("{velocity}", other))


LESSER = {
    "bar": "uniaxial_stress(true, area=0.00173611)",
    "impact": "uniaxial_stress(true, area=0.0005)",
    "along": "dimension(1",
    "across": "dimension(1",
    "shell": "spherical(true)",
    "cavity": "spherical(true)",
    "pressed": "spherical(true)",
    "blast": "spherical(true)",
    "pendulum": "twist=true",
    "torsion": "twist=true",
    "clutch": "twist=true",
    "spin_up": "twist=true",
}


@pytest.mark.parametrize("row", ROWS)
def test_check_finds_the_lesser_model(advice, row):
    script, variables = ROWS[row].script, ROWS[row].full
    said = advice(MODELS / f"in.{script}", **variables)
    assert LESSER.get(row, LESSER.get(script, "plane_stress(true")) in said


def test_wide_functions_where_no_point_crosses(advice):
    said = advice(plane(method="tlmpm, FLIP, cubic-spline, 1"))
    assert "cubic-spline uses 16 nodes per point" in said and "with 4 nodes" in said
    assert advice(plane(method="ulmpm, FLIP, cubic-spline, 1")) == ""


PULLED = "fix(pull, body_force, all, 0, -1)"


def test_a_scene_with_two_equal_sides(advice):
    """A square of 4 x 4 cells about x = 4, a plane of nodes; its weight acts along y."""
    said = advice(plane(more=PULLED))
    assert said.startswith("the scene is symmetric about x = 4: twice the points")
    assert said.endswith("half of it, and the nodes at x = 4 held in x")
    assert "y = 4" in advice(plane(more=PULLED.replace("0, -1", "-1, 0")))


@pytest.mark.parametrize(("hi", "mirrored"), [("INF", True), ("3", False)])
def test_a_box_with_two_equal_sides(advice, hi, mirrored):
    """A floor below all of it, or below its left half."""
    text = f"""
method(ulmpm, FLIP, linear, 1)
dimension(3, 0, 6, 0, 6, 0, 6, 1)
region(b, block, 1, 5, 1, 4, 0, 3)
material(m, neo-hookean, 1, 1000, 0.3)
solid(s, region, b, 1, m, 1, 0)
region(f, block, -INF, {hi}, -INF, INF, 0, 0)
group(floor, nodes, region, f, all)
fix(h, velocity_nodes, floor, 0, 0, 0)
fix(g, body_force, all, 0, 0, -0.1)
run(1)
"""
    assert ("symmetric about x = 3" in advice(text)) == mirrored


@pytest.mark.parametrize(
    "more",
    [
        PULLED.replace("0, -1", "1, -1"),
        PULLED.replace("-1)", "-x)"),
        "region(left, block, 2, 3, 2, 6)\ngroup(left, nodes, region, left, all)\n"
        + PULLED.replace("all", "left"),
    ],
)
def test_what_acts_on_one_side_more_is_no_mirror(advice, more):
    assert "both sides" not in advice(plane(more=more))


def test_half_of_a_scene_gives_the_results_of_the_whole(state_interpreted):
    """With linear functions, a falling square whose floor holds it: the points beyond x = 4."""
    floor = "region(floor, block, -INF, INF, -INF, 2)\ngroup(floor, nodes, region, floor, all)\n"
    more = floor + "fix(floor, velocity_nodes, floor, 0, 0)\nfix(w, body_force, all, 0, -3)"
    whole = plane(more=more, law="neo-hookean, 1, 100, 0.3").replace("run(1)", "run(12)")
    middle = "region(mid, block, -INF, 4, -INF, INF)\ngroup(mid, nodes, region, mid, all)\n"
    half = whole.replace("dimension(2, 0,", "dimension(2, 4,").replace(
        "run(12)", middle + "fix(mid, velocity_nodes, mid, 0, NULL)\nrun(12)"
    )
    all_of, right = (state_interpreted(text, "x", "y", "s22", "vx") for text in (whole, half))
    for name in right:
        beyond = np.sort(all_of[name][all_of["x"] > 4])
        assert np.ptp(beyond) > 0
        assert np.sort(right[name]) == pytest.approx(beyond, rel=1e-9, abs=1e-12)


def test_no_mirror_between_nodes(advice):
    assert "both sides" not in advice(plane(more=PULLED, n=3))


def test_output_that_takes_longer_than_the_steps(lowered):
    """35 000 steps of 416 points take 1.5 s; a line of the log 0.5 ms."""
    hub = lowered(INPUTS / "in.two_disks")
    step = SimpleNamespace(end_time=35.0)
    steps = SimpleNamespace(later_dt=0.001)
    simulation = SimpleNamespace(steps=steps, control=SimpleNamespace(step=[step]))
    assert not [*output(hub, simulation)]
    hub.output.log.every = 1
    ((said, _),) = output(hub, simulation)
    assert said.startswith("output takes about 2e+01 s on one core, and the steps 1 s: 35000 lines")
    assert said.endswith("140 tables of points, 1 picture")


def test_a_temperature_that_is_logged_is_not_left_out(advice):
    """It may be all that a scene is for, as in inputs/in.shear_heating."""
    assert "temperature" not in advice(INPUTS / "in.shear_heating")
    text = (INPUTS / "in.shear_heating").read_text(encoding="utf-8")
    text = re.sub(r"^temperature.*$", "", text, flags=re.MULTILINE).replace(", adiabatic)", ")")
    with pytest.raises(ScriptError, match="no material of the scene has a temperature"):
        advice(text)


def test_check_prints_what_could_be_left_out(tmp_path, monkeypatch, starts_are_cheap):
    """By the command itself, in words that can be written into the script."""
    monkeypatch.chdir(tmp_path)
    text = plane(more="set_dt(1e-4)\ncompute(Ek, kinetic_energy, all)").replace("run(1)", "")
    (tmp_path / "in.script").write_text(text + "run(1)\n", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "karamelo_py.app.cli", "check", "in.script"], text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, check=True,
    )  # fmt: skip
    part = done.stdout[done.stdout.index("could be left out") :]
    assert "compute Ek (kinetic_energy) is" in part and "instead: leave it out, or name Ek" in part
    assert re.search(r"^first dt +0.0001 .*\n.*\nown dt +0.0\d+", done.stdout, re.M)


def test_to_look_at_some_points_copies_no_others():
    """Dumps look at so many points at a time: of many points they would take ever longer."""
    array = rows_of_points((3, 200_000), np.float64)
    array[...] = np.arange(200_000)
    points = np.array([7, 3, 199_999])
    some_points(array, points)
    tracemalloc.start()
    found = some_points(array, points)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.tolist() == [points.tolist()] * 3 and found.flags.c_contiguous
    assert most < array.nbytes / 100
