"""Scripts with --gpu on an emulated card, interpreted: logs and dumps as of the processor."""

import re
import shutil
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from going_on import SCENES, SERIAL, goes_on, with_files
from numba import config
from scenes import block
from selection import few
from test_gpu import DISKS, begun
from test_ranks import FAILING, HALVED

from karamelo_py import Simulation, SimulationError
from karamelo_py.compiler import gpu
from karamelo_py.kernels.arrays import Nodes, NoHooks
from karamelo_py.language import registry
from karamelo_py.run.gpu import arrays_in, there
from karamelo_py.run.on_card import SimulationOnCard
from karamelo_py.run.on_card import alike as same_hooks

# Two squares that meet; of 2 x 2 points each.
SQUARES = """
precision({precision})
method({method})
scheme({scheme})
dimension(2, 0, 0.4, 0, 0.4, 0.1)
region(lower, block, 0.1, 0.2, 0.1, 0.2)
region(upper, block, 0.2, 0.3, 0.2, 0.3)
material(rubber, neo-hookean, 1000, 1000, 0.3)
solid(a, region, lower, 2, rubber, 0.1, 0)
solid(b, region, upper, 2, rubber, 0.1, 0)
group(a, particles, region, lower, solid, a)
group(b, particles, region, upper, solid, b)
fix(v1, initial_velocity_particles, a, {v}, {v})
fix(v2, initial_velocity_particles, b, -0.1, -0.1)
compute(Ek, kinetic_energy, all)
compute(Es, strain_energy, all)
log_modify(custom, step, dt, time, Ek, Es)
set_output(2)
dump(points, all, particle, 5, d.*.LAMMPS, x, y, vx, vy, s11, s22, s12)
dump(nodes, all, grid, 5, g.*.LAMMPS, mass, vx, vy)
"""
USUAL = {"method": "ulmpm, FLIP, linear, 0.99", "scheme": "musl", "precision": "double", "v": 0.1}


def squares(*lines, **changes):
    return SQUARES.format(**(USUAL | changes)) + "\n".join(lines)


def nowhere(said):
    """Messages without the folder of their script."""
    return re.sub(r"\S*in.script", "", said)


def alike(one, other, error=1e-12):
    """Sums have another order: some round-off errors of the largest number of a column."""
    assert sorted(f.name for f in one.folder.iterdir()) == sorted(
        f.name for f in other.folder.iterdir()
    )
    tables = [one.log, *one.snapshots("d"), *one.snapshots("g")]
    others = [other.log, *other.snapshots("d"), *other.snapshots("g")]
    for mine, theirs in zip(tables, others, strict=True):
        assert list(mine) == list(theirs)
        for name, column in mine.items():
            # Components count together: s12 may be round-off of s11.
            largest = max(np.abs(of).max() for other, of in mine.items() if other[0] == name[0])
            assert np.abs(column - theirs[name]).max() <= error * largest, name


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({}, 1e-12),
        ({"method": "ulmpm, MLS, quadratic-spline", "scheme": "usl"}, 1e-12),
        ({"method": "tlmpm, PolyPIC, linear", "scheme": "usl"}, 1e-12),
        ({"method": "tlmpm, FLIP, linear, 0.99", "scheme": "usf", "precision": "single"}, 2e-4),
    ],
)
def test_same_as_processor(run_interpreted, changes, error):
    script = squares("run(7)", "run(3)", **changes)
    here = run_interpreted(script, folder="here")
    there = run_interpreted(script, "--gpu", folder="there")
    assert "gpu                 emulated" in there.out
    alike(here, there, error)


def test_in_pieces(run_interpreted):
    """The bits of a run do not depend on where it is cut: neither by runs nor by outputs."""
    whole = run_interpreted(squares("run(10)"), "--gpu", folder="whole")
    pieces = run_interpreted(squares("run(3)", "run(1)", "run(6)"), "--gpu", folder="pieces")
    for name in ("d.5.LAMMPS", "d.10.LAMMPS", "g.10.LAMMPS"):
        assert (whole.folder / name).read_bytes() == (pieces.folder / name).read_bytes(), name


@pytest.mark.parametrize(
    "scene",
    few(["flow in the total frame", "deleted", "points that go", "wall that rubs", "stages",
         "inflow", "water in pores"], "deleted", "wall that rubs"),
)  # fmt: skip
def test_goes_on_from_a_file(run_interpreted, scene):
    """Also with a file of the other: what a card does not know of, such as tiles, is made anew."""
    script = with_files((SCENES | SERIAL)[scene])
    whole = goes_on(lambda *given, **named: run_interpreted(*given, "--gpu", **named), script)
    file = sorted(whole.glob("r.*.h5"))[0].name
    mixed = whole.with_name("mixed")
    shutil.copytree(whole, mixed)
    run_interpreted(script, "-restart", file, folder="mixed")
    for path in whole.glob("*.LAMMPS"):
        here, other = (np.loadtxt(of / path.name, skiprows=11) for of in (whole, mixed))
        assert np.abs(here - other).max() <= 1e-9 * np.abs(here).max(), path.name


WRONG = [
    "fix g gets NaN from sqrt(0.02 - time)", "leaves the domain at (1.2", "is turned inside out",
    'last_good.5.h5" -out "of 1"\n',
]  # fmt: skip


@pytest.mark.parametrize("says", WRONG)
def test_what_went_wrong(run_interpreted, says):
    """Message, log and last good state as of the processor, which may name another point."""
    here, there = (
        run_interpreted(FAILING[says] + "\n", *option, folder=folder, status=1)
        for option, folder in (((), "here"), (("--gpu",), "there"))
    )
    assert says.replace(' -out "of 1"', "").replace('"', "") in there.err
    said, other = (re.sub(r"point \d+ of.*?\)", "", nowhere(run.err)) for run in (here, there))
    assert said == other
    alike(here, there)


def test_the_first_by_number_that_goes_wrong_is_named(run_interpreted):
    script = squares("run(30)", v=-0.4).replace("-0.1, -0.1", "0, 0")
    said = run_interpreted(script, "--gpu", status=1).err
    assert "point 1 of solid 'a' leaves the domain" in said


def test_a_step_above_the_limit(run_interpreted):
    lines = (
        "fix(v, initial_velocity_particles, all, 4.2)", "fix(g, body_force, all, 12)",
        "set_dt(0.008)", "set_output(1000)", "run(60)",
    )  # fmt: skip
    script = block(1, *lines, size=(0.1,)).replace("0, 1.2", "0, 4")
    said = run_interpreted(script, "--gpu", status=1).err
    assert "is above the stability limit, which has fallen to" in said
    assert "-restart last_good." in said


def test_a_step_that_is_halved(run_interpreted):
    script = block(2, *HALVED, size=(0.3, 0.2)).replace("run(60", "run(24")
    here = run_interpreted(script, folder="here")
    there = run_interpreted(script, "--gpu", folder="there")
    assert nowhere(here.err) == nowhere(there.err) and "1/2 of the step" in there.err
    alike(here, there)


def test_fixes_of_the_first_step(run_interpreted):
    """What acts in it from Python, or sets the state before it, acts on the processor."""
    lines = (
        "region(everywhere, block, INF, INF, INF, INF)",
        "group(nodes, nodes, region, everywhere, all)",
        "fix(kick, initial_velocity_nodes, nodes, 0.3*x, NULL)",
        "fix(s, initial_stress, a, 3, 1, 0, 0, 0, -2*y0)",
        "run(5)",
    )
    script = squares(*lines).replace("rubber, neo-hookean", "rubber, linear")
    here = run_interpreted(script, folder="here")
    there = run_interpreted(script, "--gpu", folder="there")
    alike(here, there)
    assert abs(there.log.Ek[1] - run_interpreted(squares("run(5)")).log.Ek[1]) > 1e-3


# Whatever fixes with compiled hooks publish. Bodies reach new nodes of the walls in each step, and
# some nodes are held by two fixes.
PUBLISHING = """
region(low, block, INF, 0.15, INF, INF)
region(floor, block, INF, INF, INF, 0.15)
region(roof, block, INF, INF, 0.25, INF)
group(low, nodes, region, low, all)
group(floor, nodes, region, floor, all)
group(roof, nodes, region, roof, all)
fix(weight, body_force, all, 0.3, -0.2*time)
fix(push, force_nodes, roof, 0.01*x, 0.02)
fix(calm, local_damping, all, 0.1)
fix(side, velocity_nodes, low, 0.1, NULL)
fix(rough, velocity_nodes, floor, NULL, geq0, mu=0.3)
fix(lead, velocity_nodes, roof, -0.1, 0.2*time)
fix(grip, velocity_particles, a, 0.02*time, NULL)
inner = internal_force(low, x)
outer = external_force(low, x)
rate = internal_force(b, y)
log_modify(custom, step, weight_x, weight_y, push_x, push_y, calm_x, calm_y, side_x, rough_x, rough_y, lead_x, lead_y, grip_x, inner, outer, rate{more})
set_output(1)
run(3)
run(2)
"""  # noqa: E501
HEATED = """
fix(hot, temperature_nodes, floor, 400)
fix(laser, heat_flux_particles, b, 5)
fix(air, convection_particles, a, 2, 293)
"""


ON_GPUS = [
    scheme
    for scheme in registry.names("scheme")
    if not (traits := registry.find("scheme", scheme).traits).restrictions
    or "gpu" not in traits.restrictions.without
]


@pytest.mark.parametrize("scheme", ON_GPUS)
@pytest.mark.parametrize("heat", few([False, True], True))
def test_all_published_values_are_those_of_the_processor(run_interpreted, scheme, heat):
    more = ", hot_s, laser_s, air_s" if heat else ""
    lines = PUBLISHING.replace("{more}", more).replace("log_modify", HEATED * heat + "log_modify")
    script = squares(lines, scheme=scheme)
    if heat:
        script = script.replace("0.99", "0.99, thermo-mechanical")
        script = script.replace("neo-hookean, 1000, 1000, 0.3", "linear, 1000, 1000, 0.3, 10, 1")
    one = run_interpreted(script, folder="here").log
    other = run_interpreted(script, "--gpu", folder="there").log
    assert len(one.weight_x) == 6
    for name, column in one.items():
        assert np.abs(column).max() > 0 or name == "rough_x", name  # nothing may slide there
        np.testing.assert_allclose(other[name], column, rtol=1e-8, atol=1e-12, err_msg=name)


# --- what a GPU refuses ---------------------------------------------------------------------------


def test_what_is_refused_is_said_before_the_run(run_interpreted):
    """Each part with its line; also of later runs; by check, too."""
    lines = ("fix(F, force_particles, all, 1, 0)", "fix(G, force_particles, all, 1, 0)", "run(1)")
    for command in ("run", "check"):
        said = run_interpreted(squares(*lines), "--gpu", status=1, command=command).err
        assert said.count("calls Python in each step (initial_integrate)") == 2
        assert "in.script:21:1: error: run: fix force_particles 'F'" in said
        assert "hint: a fix whose hooks are compiled, or leave out --gpu" in said
    later = run_interpreted(squares("run(1)", *lines), "--gpu", folder="later", status=1)
    assert "fix force_particles 'F'" in later.err and not (later.folder / "log.mpm").exists()
    said = run_interpreted(SERIAL["load steps"], "--gpu", status=1).err
    assert "scheme quasi-static does not support --gpu" in said
    assert "    7 | scheme(quasi-static)" in said
    said = run_interpreted(squares("run(1)"), "--gpu", "--ranks", "2", status=1).err
    assert said.startswith("error: --gpu: one GPU computes the whole scene, and 2 processes")


def test_check_says_what_a_scene_takes_there(run_interpreted):
    out = run_interpreted(squares("run(1)"), "--gpu", command="check").out
    found = re.search(r"^gpu            emulated, .* free\n *([\d.]+) MiB in a run$", out, re.M)
    assert 1 < float(found[1]) < 100


def test_no_gpu(run_script, monkeypatch):
    """Messages of ours without card, driver or packages."""
    monkeypatch.delenv("KARAMELO_PY_GPU")
    monkeypatch.setitem(sys.modules, "cuda", ModuleType("cuda"))
    monkeypatch.setitem(sys.modules, "cuda.bindings", SimpleNamespace(driver=None))
    monkeypatch.setattr(gpu.Card, "_do", lambda self, name, *rest: 1 / 0)
    said = run_script(squares("run(1)"), "--gpu", status=1).err
    assert said.startswith("error: there is no NVIDIA GPU with a driver on this machine\n")
    assert "hint: leave out --gpu: processors run the same script" in said
    monkeypatch.setitem(sys.modules, "cuda.bindings", None)
    said = run_script(squares("run(1)"), "--gpu", status=1).err
    assert "error: --gpu needs the packages for NVIDIA GPUs" in said
    assert "hint: pip install '.[gpu]' in the folder of karamelo-py, or leave out --gpu" in said
    wrong = run_script(squares("run(1)", "fix(a, nothing, all)"), "--gpu", status=1).err
    assert "fix style 'nothing'" in wrong and "GPU" not in wrong
    with pytest.raises(SimulationError, match="--gpu needs the packages"):
        Simulation(squares(), gpu=True)


def test_a_scene_that_is_too_large_for_the_gpu(run_script, monkeypatch):
    """By its points alone, before there are arrays; by all that it takes, before it runs."""
    monkeypatch.setattr(gpu.Emulator, "memory", lambda self: (500, 1000))
    said = run_script(squares("run(1)"), "--gpu", status=1).err
    assert (
        ":9:1: error: solid: the scene does not fit into the memory of the GPU: 8 points," in said
    )
    assert "emulated has 4.66e-07 GiB of 9.31e-07 GiB free" in said
    monkeypatch.undo()

    def refuse(self, size):
        raise MemoryError

    monkeypatch.setenv("KARAMELO_PY_GPU", "emulated")
    monkeypatch.setattr(gpu.Emulator, "allocate", refuse)
    said = run_script(squares("run(1)"), "--gpu", status=1).err
    assert "the scene does not fit into the memory of the GPU: 8 points; emulated has" in said
    assert (
        "hint: larger cells, or fewer points per cell; precision(single); leave out --gpu" in said
    )


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="the disks of test_gpu.py are compiled")
@pytest.mark.xdist_group("disks on a GPU")
def test_what_is_not_sent_again_has_not_changed(monkeypatch):
    """Outputs bring arrays back; only what has changed them says so, and so has them sent again."""
    advance, compared = SimulationOnCard._advance_to, []

    def compare(simulation, target):
        steps, setup = simulation._steps, simulation._setup
        if simulation._sent and not simulation._ahead:
            nodes = Nodes(*[array[:0] for array in setup.nodes[:3]], ())  # no step needs them
            rest = there(setup)._replace(control=(), nodes=nodes)
            for array in arrays_in((rest._replace(buffers=()), simulation.hooks)):
                assert np.array_equal(array, steps.images.of(array), equal_nan=array.dtype != bool)
            compared.append(simulation.step)
        return advance(simulation, target)

    monkeypatch.setattr(SimulationOnCard, "_advance_to", compare)
    script = DISKS.format(method="ulmpm, FLIP, linear, 0.99", scheme="musl", precision="double")
    one, other = (Simulation(script + OUTPUTS, gpu=gpu) for gpu in (True, False))
    for sim in (one, other):
        sim.run(24)
        sim.points["vx"] = sim.points["vx"] * 0.5
        sim.run(6)
        assert sim.log["Ek"][-1] > 0
    assert len(compared) > 8
    for name in ("x", "vy", "s11"):
        assert np.abs(one.points[name] - other.points[name]).max() <= (
            1e-12 * np.abs(other.points[name]).max()
        )


def test_hooks_of_runs_that_follow_each_other():
    """Those of a run before serve, where they do the same: nothing is made anew."""
    lines = "fix(g, body_force, all, 0, {})\nfix(v, velocity_particles, a, {}*time, NULL)"
    hooks = []
    for numbers in ((-1, 2), (-1, 2), (-2, 2), (-1, 3)):
        hub = begun(squares(lines.format(*numbers)))[0]
        hooks.append(hub.simulation.hooks)
    assert hooks[0].members.size and hooks[0].code.size
    assert [same_hooks(hooks[0], other) for other in hooks] == [True, True, False, False]
    assert same_hooks(NoHooks(), NoHooks()) and not same_hooks(NoHooks(), hooks[0])


OUTPUTS = """
compute(Ek, kinetic_energy, all)
compute(Es, strain_energy, all)
compute(E, energy_balance, all)
log_modify(custom, step, Ek, Es, E_drift)
set_output(3)
"""


@pytest.fixture
def real_card(monkeypatch):
    """A GPU in the place of the emulated one; without one there is nothing to test."""
    monkeypatch.delenv("KARAMELO_PY_GPU")
    try:
        return gpu.card()
    except gpu.NoCard as error:
        pytest.skip(str(error))


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="threads of a GPU are compiled")
@pytest.mark.parametrize(
    "method",
    ["ulmpm, FLIP, linear, 0.99", "tlmpm, FLIP, linear, 0.99", "ulmpm/contacts, APIC, linear"],
)
def test_on_a_real_card(run_script, real_card, method):
    """The numbers of the processor but for round-off; the same bits in each run, and in pieces."""
    changes = {"method": method}
    here = run_script(squares("run(6)", "run(4)", **changes), folder="here")
    there, again = (
        run_script(squares("run(6)", "run(4)", **changes), "--gpu", folder=folder)
        for folder in ("there", "again")
    )
    whole = run_script(squares("run(10)", **changes), "--gpu", folder="whole")
    assert real_card.name in there.out
    alike(here, there, 1e-11)  # products and sums are contracted there
    for path in there.folder.glob("*.LAMMPS"):
        assert path.read_bytes() == (again.folder / path.name).read_bytes(), path.name
    for name in ("d.5.LAMMPS", "d.10.LAMMPS", "g.10.LAMMPS"):
        assert (whole.folder / name).read_bytes() == (there.folder / name).read_bytes(), name
