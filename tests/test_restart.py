"""A run that goes on from a file is the one that was never interrupted: the same bits.

Nothing here compares with a formula; the other tests do.
"""

import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from itertools import product
from pathlib import Path
from textwrap import dedent

import h5py
import numpy as np
import pytest
from combinations import BASES, MESHED, SCHEMES, TRANSFERS, fits, refused, scene, write_mesh
from scenes import H, block
from test_boundary import thrown
from test_columns_karamelo import sheared
from test_contact_grid import bars
from test_contact_points import bodies
from test_heat import HOT, slab
from test_laws_rigid import scene as pushed
from test_laws_scripts import ALL, pulled
from test_walls import scene as rubbed

from karamelo_py.language import registry
from karamelo_py.run.memory import memory_of, remember

EVERY = "restart(2, r.*.h5)\n"


def arrays(path: Path) -> dict[str, np.ndarray]:
    """All that a file in HDF5 holds, by name."""
    found = {}

    def keep(name, item):
        if isinstance(item, h5py.Dataset):
            found[name] = item[()]

    with h5py.File(path, swmr=True) as root:
        root.visititems(keep)
    return found


def same_files(one: Path, other: Path) -> None:
    """Two folders hold the same files, byte by byte."""
    names = {path.name for path in one.iterdir()} - {"out"}
    assert names == {path.name for path in other.iterdir()} - {"out"}
    for name in names:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


def with_files(script: str, line: str = EVERY) -> str:
    """A script that writes files to go on from, from its first run on."""
    text, count = re.subn("^run", f"{line}run", dedent(script), count=1, flags=re.M)
    assert count
    return text


def goes_on(run, script: str, *, files: int = 1) -> Path:
    """Run a script, and once more from some of the files that it wrote; all is the same."""
    whole = run(script, folder="whole").folder
    written = sorted(whole.glob("r.*.h5"), key=lambda path: int(path.name.split(".")[1]))
    assert len(written) > 1
    for file in written[: -1 : max(1, (len(written) - 1) // files)][:files]:
        again = whole.with_name("again")
        shutil.rmtree(again, ignore_errors=True)
        shutil.copytree(whole, again)
        said = run(script, "-restart", file.name, folder="again")
        assert "continued from step" in said.out
        same_files(whole, again)
    return whole


# --- every way to compute -----------------------------------------------------------------------

WAYS = list(product(TRANSFERS, SCHEMES))


def ways() -> list[tuple]:
    """Every base, transfer and scheme, each of them in some scene."""
    found = []
    for k, base in enumerate(BASES):
        possible = [way for way in WAYS if not refused(*base, *way)]
        kinematics = ("line", "plane", "axisymmetric", "space")
        those = [one for one in kinematics if fits(one, base[2])]
        found.append((those[k % len(those)], *base, *possible[5 * k % len(possible)]))
    return found


def test_the_ways_are_all_there():
    for place, names in ((4, TRANSFERS), (5, SCHEMES)):
        assert {way[place] for way in ways()} == set(names)


@pytest.mark.parametrize("way", ways(), ids=lambda way: " ".join(filter(None, way)))
def test_every_way(run_interpreted, tmp_path, way):
    """Methods, bases, transfers, schemes and kinematics."""
    option = way[3]
    mesh = write_mesh(tmp_path / "m.vtk", MESHED[option]) if option in MESHED else None
    goes_on(run_interpreted, with_files(scene(*way, mesh=mesh, steps=4)))


RUBBING = bars(
    0.0, "fix(rub, contact/friction, a, b, 0.3)", "log_modify(custom, step, rub_x, va_x)",
    "fix(slide, initial_velocity_particles, b, -0.1, 0.3)", "run(6)", d=2, scheme="usavg", v=2,
)  # fmt: skip
TOOLS = (
    "fix(F, indent/minimize_penetration, all, sphere, 0.1, 0.45, 0.55, 0, 3, 0, 0, 0.2)",
    "fix(W, contact/minimize_penetration/plane, body, 0.32, 0, 0, 1, 0, 0, 0.3)",
    "fix(I, indent, all, sphere, 500, 0.13, 0.45, 0.55, 0)",
    "fix(C, cuttingtool, all, 0.1, 0.35 + time, 0.36, 0, -1, 0, 0, 0.4, 0.5, 0.6, 0.36)",
    "log_modify(custom, step, F_x, W_x, I_y, C_x)", "set_dt(0.001)", "run(6)",
)  # fmt: skip
GROUPS = """\
region(low, block, 0.3, 0.3, 0.3, 0.5)
group(low, nodes, region, low, all)
group(half, particles, region, box, solid, body)
fix(hold, velocity_nodes, low, 0.1*time, 0)
fix(g, body_force, all, 0, -1)
fix(push, force_nodes, low, 1, 0)
fix(check, check_solution, all, 0.1*time*x0, 0)
fix(v, initial_velocity_particles, all, sin(9*x0), 0)
compute(R, reaction, low)
compute(L, angular_momentum, all)
compute(P, linear_momentum, all)
compute(E, energy_balance, all)
compute(err, error, all, ux, 0.1*time*x0, L2)
compute(p, probe, all, x, point=3)
pull = internal_force(half, x) + external_force(low, x)
log_modify(custom, step, dt, R_x, L_drift, P_drift, E_drift, err_history, err_max, p, check_z, pull)
set_output(time(0.004))
plot(e, 2, time, E)
save_plot(e.svg)
"""
LOADS = (
    "fix(F, force_particles, all, 2*time, -1)", "fix(T, edge_traction, all, box, xhi, 0.2, y*time)",
    "fix(P, edge_pressure, all, box, 5*time)", "fix(calm, local_damping, all, 0.8)",
    "fix(Ek, kinetic_energy, all)", "fix(Es, strain_energy, all)",
    "compute(E, energy_balance, all)", "set_output(1)",
    "log_modify(custom, step, dt, limit, F_y, T_x, P_x, E_drift, Ek, Es)", "run(6)",
)  # fmt: skip
PYTHON = """\
fix(v, initial_velocity_nodes, all, 0.2*sin(9*x0), 0)
fix(push, python, all, pumps.push)
region(everywhere, block, INF, INF, INF, INF)
group(nodes, nodes, region, everywhere, all)
fix(brake, python, nodes, pumps.brake)
log_modify(custom, step, push_x, push_y, brake)
"""
# Tools of Karamelo, of which one needs space, and computes of points: all in a few points.
BENCH = """\
region(face, block, 0.46, INF, INF, INF, INF, INF)
group(face, particles, region, face, all)
fix(s, initial_stress, all, 3*x0, 1, 0, 0, 0, -2*y0)
fix(v, initial_velocity_particles, all, sin(9*x0), 0, y0)
fix(M, meldtool, all, 0.1, y, 0.03, 0.4, 0.35, 10*time, 0.31, 2, 0.12)
fix(W, impenetrablesurface, all, 0.5, 0.42, 0.36, 0.35, 3, 4, time)
fix(T, neumann_bc_mech, face, -7*time, 1, NULL)
compute(s, average_stress, face)
compute(c, center_of_mass, face)
compute(q, position_quantile, all, 0.8)
compute(m, max_position, all)
compute(r, reference, all, ../curve.csv, vx)
compute(now, reference, c_x, ../curve.csv, vx, max, relative)
log_modify(custom, step, M_x, W_x, T_x, s_11, c_z, q_x, m_z, r, now)
set_dt(0.001)
run(4)
"""
CURVE = "x, vx\n0, 0\n0.4, 0.5\n2, 1\n"
FACE = """
    group(face, particles, region, end, all)
    region(other, block, 0.9, 1)
    group(other, particles, region, other, all)
    fix(hold, temperature_particles, face, 301 + time)
    fix(lamp, heat_flux_particles, other, 7*time)
    fix(air, convection_particles, other, 0.01, 200)
"""
FLUIDS = """
method(ulmpm, TFLIP, quadratic-spline, 0.98)
scheme(usl/unlimited)
dimension(1, 0, 1, 0.1)
region(left, block, 0.2, 0.4)
region(right, block, 0.6, 0.8)
eos(water, fluid, 2, 100, 7)
strength(thin, fluid, 0.1)
material(water, eos-strength, water, thin)
eos(air, ideal-gas, 1.2, 1.4, p=10)
material(air, eos-strength, air, thin)
solid(water, region, left, 2, water, 0.1)
solid(air, region, right, 2, air, 0.1)
fix(v, initial_velocity_particles, all, sin(9*x0))
run(6)
"""
FLOWS = {
    "a": "zerilli-armstrong, 80, 0.4, 0.2, 0, 0.0028, 0.000115, 0.3, 0.5",
    "b": "tabulated, 80, 0, 0.4, 1, 0.9",
    "c": "tabulated, 80, 0, 0.4, 0.5, 0.65, 1, 0.9",
    "d": "formula, 80, 0.4 + 0.5*ep + 0.01*epdot",
    "e": "mu-i, 80, 0.382, 0.643, 0.279, 1, 2",
    "f": "drucker-prager, 80, 0.1, 30, 5, fit=plane-strain",
    "g": "mohr-coulomb, 80, 0.1, 30, 5",
    "h": "swift, 80, 0.4, 0.5, 0.01, 0.5",
    "i": "linear, 80",
}


def flowing(method: str) -> str:
    """One point a law, pulled and sheared until all flow."""
    lines = [f"method({method})", f"dimension(2, 0, {len(FLOWS) / 10 + 0.1}, 0, 0.3, {H})",
             "eos(bulk, linear, 8, 160)"]  # fmt: skip
    for k, (name, law) in enumerate(FLOWS.items()):
        lines += [
            f"region({name}, block, {k / 10}, {(k + 1) / 10}, 0.1, 0.2)",
            f"strength({name}, {law})",
            f"material({name}, eos-strength, bulk, {name})",
            f"solid({name}, region, {name}, 1, {name}, {H})",
        ]
    lines += [
        "region(everywhere, block, INF, INF, INF, INF)",
        "group(nodes, nodes, region, everywhere, all)",
        "fix(pull, velocity_nodes, nodes, x0 + y0, -x0)",
        "dump(d, all, particle, 1, d.*.txt, ep, epdot, s11, s12)",
        "set_dt(0.003)",
        "run(6)",
    ]
    return "\n".join(lines)


SCENES = {
    "loads": block(2, *LOADS),
    "loads in the total frame": block(2, *LOADS).replace("ulmpm", "tlmpm"),
    "wall that rubs": rubbed().replace("run_time(0.2)", "run(6)"),
    "rigid": pushed().replace("run_time(3)", "set_dt(0.02)\nrun(40)"),
    "rigid by a formula": pushed("ulmpm/contacts").replace("initial_velocity_particles, tool, 0.5",
        "velocity_particles, tool, 0.2*time").replace("run_time(3)", "run(6)"),
    "flow": flowing("ulmpm, FLIP, linear, 1"),
    "flow in the total frame": flowing("tlmpm, APIC, linear"),
    "rate of plastic strain": sheared(", epdot"),
    "step that varies": block(
        2, "fix(v, initial_velocity_particles, all, 5*sin(9*x0), 3)", "set_output(1)",
        "fix(g, body_force, all, 100*time, 0)", "log_modify(custom, step, dt, time, limit)",
        "run(3)", "run_time(0.02)",
    ),
    "friction": RUBBING,
    "points that touch": bodies(
        -0.01, "contact/minimize_penetration, a, b, 0.2", "log_modify(custom, step, c_x)", "run(6)",
        d=2, n=2,
    ),
    "Hertz": bodies(
        -0.01, "contact/hertz, a, b", "log_modify(custom, step, c_x)", "run(6)", d=2, n=2
    ),
    "heat": slab(HOT.format("301 + time"), ", hot_s", "run(6)"),
    "heat in the total frame": slab(HOT.format(301), ", hot_s", "run(6)").replace(
        'kind = "ulmpm"', 'kind = "tlmpm"'
    ),
    "metal": pulled(ALL).replace("run(50)", "run(6)"),
    "anti locking": block(
        2, "anti_volumetric_locking(true)", "fix(v, initial_velocity_particles, all, sin(9*x0), 0)",
        "run(6)",
    ),
    "single": "precision(single)\n" + block(
        2, "fix(v, initial_velocity_particles, all, sin(9*x0), 0)", "run(6)"
    ),
    "deleted": thrown(2, "delete", "run(8)", "run(22)"),
    "reflected": thrown(2, "reflect", "run(8)", "run(22)"),
    "tools": block(2, *TOOLS),
    "groups": block(2, GROUPS, "run(7)"),
    "functions in Python": block(2, PYTHON, "run(5)"),
    "bench": block(3, BENCH, size=(0.2, 0.1, 0.1)),
    "faces with heat": slab(FACE, ", lamp_s, air_s", "run(6)"),
    "fluids": FLUIDS,
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_every_part(run_interpreted, tmp_path, name):
    """Contact, heat, damage, edges, tools, computes that look back."""
    (tmp_path / "curve.csv").write_text(CURVE, encoding="utf-8")
    goes_on(run_interpreted, with_files(SCENES[name]), files=3)


CHANGING = {
    **dict.fromkeys(["fix", "compute", "material", "eos", "strength"], r"{family}\(\s*\w+\s*,\s*"),
    **dict.fromkeys(["damage", "temperature"], r"{family}\(\s*\w+\s*,\s*"),
    **dict.fromkeys(["method", "scheme"], r"{family}\("),
    **dict.fromkeys(["transfer", "basis"], r"method\([^)]*\b"),
    "dump": r"dump\(\s*\w+\s*,\s*\w+\s*,\s*",
}


@pytest.mark.parametrize("family", CHANGING)
def test_every_style_is_in_some_scene(family):
    """What the program registers, and a step may change, goes on above."""
    meshes = ["m.vtk" if way[3] in MESHED else None for way in ways()]
    scenes = [scene(*way, mesh=mesh) for way, mesh in zip(ways(), meshes, strict=True)]
    text = "\n".join([*SCENES.values(), OUTPUTS, *scenes])
    begin = CHANGING[family].format(family=family)
    found = {
        style
        for style in registry.names(family)
        if registry.origin(family, style).startswith("karamelo-py ")
        and not re.search(rf"{begin}{re.escape(style)}\s*[,)]", text)
    }
    assert found == set()


def content(path: Path) -> dict:
    """What a file to go on from holds beside arrays."""
    return json.loads(arrays(path)["content"].tobytes())


def test_a_step_that_was_halved(run_interpreted):
    """Halvings, and the state that a run goes back to, are the same behind a file."""
    lines = ["fix(v, initial_velocity_particles, all, 0.05*sin(40*x0), 0.03*cos(30*y0))",
             "dt_factor(1.9)", "set_output(5)", "log_modify(custom, step, dt, limit)",
             "compute(E, energy_balance, all)", "dump(d, all, particle, 20, d.*.txt, x, vx)",
             "run(60, on_trouble=halve)"]  # fmt: skip
    script = with_files(block(2, *lines, size=(0.3, 0.3)), "restart(6, r.*.h5)\n")
    whole = goes_on(run_interpreted, script, files=9)
    halvings = {
        memory["halvings"]
        for file in whole.glob("r.*.h5")
        for kind, *_, memory in content(file)["parts"]
        if kind == "run"
    }
    assert max(halvings) > 0


def test_a_step_above_the_limit_from_a_file_on(run_interpreted):
    """It is what the user wants then, as at the start of a run: no reason to stop."""
    script = FLY.replace("run(4)", "restart(1, r.*.h5)\nrun(80)")
    still = script.replace("sin(9*x0), 0)", "0, 0)")
    run_interpreted(still.replace("run(80)", "run(2)"))
    result = run_interpreted(still.replace("set_dt(0.001)", "set_dt(0.05)"), "-restart", "r.1.h5")
    assert result.log.Step[-1] == 80 and result.log.dt[-1] == 0.05


# The clock is told that energy has grown: a scene in which it does takes hundreds of steps.
TOLD = """
import warnings
from pathlib import Path
from karamelo_py import Simulation
text = Path("scene").read_text()
def begun():
    sim = Simulation(text)
    sim.run(1)
    return sim
def grows(sim):
    sim.hub.simulation.setup.control.clock[0].windows = 2
def told(sim):
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        sim.run(1)
    return sum("energy comes from nowhere" in str(one.message) for one in found)
sim = begun()
grows(sim)
print(told(sim), told(sim))
sim.command("write_restart(w.h5)")
again = begun()
again.command("read_restart(w.h5)")
print(told(again))
fresh = begun()
grows(fresh)
fresh.command("read_restart(w.h5)")
fresh.command("dt_factor(0.3)")
print(told(fresh), fresh.hub.simulation.setup.control.clock[0].dt_factor)
fresh.command("fix(v, initial_velocity_particles, all, 1, 0)")
fresh.run(1)
grows(fresh)
print(told(fresh))
"""


def test_growth_of_energy_is_told_once(tmp_path):
    """In runs in pieces, too, and behind a file; anew where a balance begins anew."""
    (tmp_path / "scene").write_text(FLY.partition("set_dt")[0])
    said = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", TOLD], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert said.stdout.split("\n")[:-1] == ["1 0", "0", "0 0.3", "1"], said.stderr


OUTPUTS = """\
dump(d1, all, particle, 2, all.txt, x, y, s11)
dump(d2, all, particle/gz, 2, all.gz, x, y, s11)
dump(d3, all, particle/bin, 3, all.bin, x, y)
dump(d4, all, hdf5, time(0.01), points.h5, x, y, s11)
dump(d5, all, grid/hdf5, 3, nodes.h5, vx, mass, occupied=true)
dump(d6, all, vtk, 4, p.*.vtu, vx)
dump(d7, all, movie, 3, m.gif, 300, 300, vx)
dump(d8, all, grid, 3, g.*.txt, vx, fx, mass)
dump(d9, all, grid/gz, 3, g.*.gz, vx, mass)
dump(e1, all, grid/bin, 3, g.*.bin, vx, mass)
dump(e2, all, grid/vtk, 4, g.*.vtu, vx)
dump(e3, all, pyplot, 5, p.*.png, 1, 1, vx)
"""


def test_outputs_go_on_in_their_files(run_interpreted):
    """Also from a file of a run that was over, or between two runs; values are those read then."""
    fly = "fix(v, initial_velocity_particles, all, sin(9*x0), 0)"
    lines = ["compute(E, energy_balance, all)", "log_modify(custom, step, time, E)", "run(5)",
             "E0 = value(E_total)", "run_time(0.03*E0/E0)", "write_restart(w.h5)",
             "fix(g, body_force, all, E0, 0)", "run_while(time < 0.12)"]  # fmt: skip
    script = with_files(block(2, fly, OUTPUTS, *lines, size=(0.2, 0.1)))
    whole = goes_on(run_interpreted, script, files=3)
    again = whole.with_name("between")
    shutil.copytree(whole, again)
    run_interpreted(script, "-restart", "w.h5", folder="between")
    same_files(whole, again)


def test_another_number_of_threads(tmp_path):
    """One thread writes, two go on; compiled, with the loops of test_identical.py."""
    from test_identical import crossing

    script = tmp_path / "in.script"
    script.write_text(with_files(crossing(2, "run(60)"), "restart(25, r.*.h5)\n"))
    folders = []
    for threads in (1, 2):
        folder = tmp_path / f"with{threads}"
        if folders:
            shutil.copytree(folders[0], folder)
        else:
            folder.mkdir()
        folders.append(folder)
        restart = ["-restart", "r.25.h5"] if threads == 2 else []
        subprocess.run(
            [sys.executable, "-m", "karamelo_py.app.cli", "../in.script", "--threads",
             str(threads), *restart], cwd=folder, check=True, capture_output=True,
        )  # fmt: skip
    same_files(*folders)


test_another_number_of_threads = pytest.mark.xdist_group("identical")(
    test_another_number_of_threads
)


# --- scripts ------------------------------------------------------------------------------------

FLY = block(2, "fix(v, initial_velocity_particles, all, sin(9*x0), 0)", "set_dt(0.001)", "run(4)",
            size=(0.2, 0.1))  # fmt: skip


def test_what_a_function_forgets_is_told(run_interpreted, tmp_path):
    """Variables of its module and attributes of its object that it changes; once."""
    module = """
        total, list_of, gain = 0.0, [], 2
        def pull(points):
            global total
            total += 1
            list_of.append(gain)
        class Rope:
            remembers = "length"
            length, pulled = 1.0, 0
            def __call__(self, points):
                self.length += 1
                self.pulled += 1
        rope = Rope()
        rope.pulled = 3
        class Wrong:
            remembers = ("here", "there")
            here = 1
            def __call__(self, points):
                pass
        wrong = Wrong()
    """
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "ropes.py").write_text(dedent(module), encoding="utf-8")
    fixes = "fix(p, python, all, ropes.pull)\nfix(r, python, all, ropes.rope)\n"
    err = run_interpreted(with_files(FLY.replace("run(4)", fixes + "run(4)"))).err
    assert err.count("pull has changed total, list_of, and files to go on from") == 1
    assert "remembers = ('total', 'list_of') in the module ropes" in err
    assert err.count("Rope has changed pulled, and") == 1
    assert "remembers = ('length', 'pulled') in the class Rope" in err
    wrong = run_interpreted(FLY + "fix(p, python, all, ropes.wrong)\nrun(1)\n", status=1).err
    assert "the class Wrong remembers 'there', which it does not have" in wrong


def test_a_longer_run_with_other_steps(run_interpreted):
    """What may be another: the length of the last run, the step, outputs."""
    folder = run_interpreted(with_files(FLY)).folder
    text = FLY.replace("run(4)", "dump(d, all, particle, 1, d.*.txt, x)\nrun(6)")
    text = text.replace("set_dt(0.001)", "set_dt(0.0005)")
    result = run_interpreted(text, "-restart", "r.*.h5")
    assert result.log.Step.tolist() == [0, 1, 2, 3, 4, 5, 6]
    assert result.log.dt[-1] == 0.0005
    assert result.log.Time[-1] == pytest.approx(0.005, rel=1e-12)
    assert [path.name for path in sorted(folder.glob("d.*"))] == ["d.5.txt", "d.6.txt"]


@pytest.mark.parametrize(
    ("run", "says"),
    [
        ("run(3)", "r.4.h5 holds step 4, time 0.004, which is beyond the end of this run, step 3"),
        ("run_time(0.002)", "beyond the end of this run, time 0.002"),
        ("run_while(time < 0.003)", "r.4.h5 holds step 4, time 0.004, the end of this run"),
        ("run(4)", "the end of this run: it takes no further step"),
    ],
)
def test_no_step_is_left(run_interpreted, run, says):
    """The run of a file is over, or would have been: nothing happens, which is told."""
    run_interpreted(with_files(FLY))
    result = run_interpreted(with_files(FLY.replace("run(4)", run)), "-restart", "r.4.h5")
    assert says in result.out + result.err
    assert result.log.Step[-1] == 4


def test_variables_of_the_command_line(run_interpreted):
    """They are those of the file; others are an error."""
    text = with_files("n = 4\n" + FLY.replace("run(4)", "run(n)"))
    run_interpreted(text, "-var", "n", "6")
    assert run_interpreted(text, "-restart", "r.2.h5").log.Step[-1] == 6
    result = run_interpreted(text, "-restart", "r.2.h5", "-var", "n", "5", status=1)
    assert "was written with -var n 6; now it is -var n 5" in result.err


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("100, 0.3", "100, 0.2", "there this statement was material(rubber,linear,2,100,0.3)"),
        ("run(4)", "", "this one ends before"),
        ("run(4)", "region(r, block, 0, 1, 0, 1)", "there a run stood here"),
        ("FLIP, linear, 1", "FLIP, linear, 0.9", "there this statement was method("),
    ],
)
def test_another_script(run_interpreted, old, new, says):
    run_interpreted(with_files(FLY))
    text = FLY.replace(old, new)
    result = run_interpreted(text, "-restart", "r.2.h5", status=1)
    assert "r.2.h5 was written by another script" in result.err
    assert says in result.err
    assert result.err.count("error:") == 1


def test_the_state_alone(run_interpreted):
    """read_restart in a script of its own: the same bits as a run in two pieces."""
    set_up, _, _ = FLY.partition("run(4)")
    run_interpreted(set_up + "run(2)\nwrite_restart(w.h5)\nrun(2)\nwrite_restart(end.h5)\n")
    text = set_up + "read_restart(w.h5)\nrun(2)\nwrite_restart(again.h5)\n"
    result = run_interpreted(text)
    assert result.log.Step.tolist() == [2, 3, 4]
    one, other = arrays(result.folder / "end.h5"), arrays(result.folder / "again.h5")
    for name, array in one.items():
        if name.startswith("state/"):
            assert array.tobytes() == other[name].tobytes(), name


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("method(ulmpm", "method(tlmpm", "FLIP (alpha 1) linear musl; here it is tlmpm"),
        ("box, 2, rubber", "box, 1, rubber", "solid 'body' 8 points of LinearElastic"),
        ("0, 1.2, 0.1)", "0, 1.3, 0.1)", "domain 2"),
        ("block, 0.3, 0.5,", "block, 0.35, 0.55,", "other points in solid 'body'"),
        ("solid(body", "solid(other", "solid 'body', which is not here"),
        ("rubber, linear, 2, 100", "rubber, neo-hookean, 2, 100", "points of LinearElastic"),
    ],
)  # fmt: skip
def test_another_scene(run_interpreted, old, new, says):
    set_up, _, _ = FLY.partition("run(4)")
    run_interpreted(set_up + "run(2)\nwrite_restart(w.h5)\n")
    assert old in set_up
    text = set_up.replace(old, new) + "read_restart(w.h5)\nrun(2)\n"
    result = run_interpreted(text, status=1)
    assert "w.h5 was written by another scene" in result.err
    assert says in result.err
    assert "read_restart(w.h5)" in result.err


@pytest.mark.parametrize("content", [None, b"", b"no HDF5", "other HDF5", "version 4", "half"])
def test_no_file_to_go_on_from(run_interpreted, content):
    folder = run_interpreted(with_files(FLY)).folder
    path = folder / "bad.h5"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content == "other HDF5":
        h5py.File(path, "w").close()
    elif content == "half":
        whole = (folder / "r.2.h5").read_bytes()
        path.write_bytes(whole[: len(whole) // 2])
    elif content:
        shutil.copy(folder / "r.2.h5", path)
        with h5py.File(path, "r+") as file:
            file.attrs["version"] = 4
    result = run_interpreted(FLY, "-restart", "bad.h5", status=1)
    says = {None: "there is no file bad.h5", "version 4": "has version 4"}
    assert says.get(content, "is no file that this program can go on") in result.err
    assert result.err.count("error:") == 1
    assert (folder / "log.mpm").read_text().count("\n") == 6  # nothing was begun anew


def test_files_that_are_gone_begin_anew(run_interpreted):
    """Where the files of the run before are not, those of this one begin, and it is said."""
    text = FLY.replace("run(4)", OUTPUTS + "run(4)")
    folder = run_interpreted(with_files(text)).folder
    (folder.parent / "elsewhere").mkdir()
    shutil.copy(folder / "r.2.h5", folder.parent / "elsewhere")
    result = run_interpreted(text, "-restart", "r.2.h5", folder="elsewhere")
    assert result.err.count("it begins anew") == 6
    assert result.log.Step.tolist() == [3, 4]
    assert h5py.File(result.folder / "nodes.h5")["step"][:].tolist() == [3, 4]


def test_what_cannot_be_written_is_told(run_interpreted):
    says = "there is nothing to write yet"
    assert says in run_interpreted("write_restart(w.h5)\n", status=1).err
    assert "a file is missing" in run_interpreted("restart(5)\n", status=1).err
    assert "there is no scene yet" in run_interpreted("read_restart(w.h5)\n", status=1).err
    assert not list(run_interpreted(FLY.replace("run", "restart(0)\nrun")).folder.glob("*.h5"))


# --- parts of other packages --------------------------------------------------------------------


# Prints what is forgotten: in an interpreter of its own, which compiles nothing.
WATCH = """
from pathlib import Path
import numpy as np
from test_restart import CURVE, OUTPUTS, SCENES, block
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.memory import remembered
from karamelo_py.scene.hub import Hub

PLAIN = (int, float, str, bool, list, dict, np.ndarray, type(None))
fly = "fix(v, initial_velocity_particles, all, sin(9*x0), 0)"
Path("curve.csv").write_text(CURVE)
scenes = {**SCENES, "outputs": block(2, fly, OUTPUTS, "run(5)", size=(0.2, 0.1))}
for name, script in scenes.items():
    hub = Hub(Console(quiet=True))
    Interpreter(hub)
    before = []
    rehearse = hub.rehearse

    def look():
        if not hub.rehearsed:
            parts = [*hub.fixes.values(), *hub.computes.values(), *hub.dumps.values()]
            before.extend((part, {k: repr(v) for k, v in vars(part).items()}) for part in parts)
        rehearse()

    hub.rehearse = look
    hub.interpreter.run_text(script.replace("../curve", "curve"))
    assert before
    for part, old in before:
        for key, value in vars(part).items():
            if isinstance(value, PLAIN) and key not in remembered(part):
                if repr(value) != old.get(key):
                    print("forgotten", name, type(part).__name__, key)
print("done")
"""


def test_all_that_changes_is_remembered(tmp_path):
    """What parts keep in plain attributes, and a run changes, they name in `remembers`."""
    path = os.pathsep.join([str(Path(__file__).parent), os.environ["PYTHONPATH"]])
    said = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", WATCH], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": path},
    )  # fmt: skip
    *found, last = said.stdout.splitlines() or [""]
    assert last == "done", said.stderr
    forgotten = {tuple(line.split()[-2:]) for line in found}
    # What is made anew whenever it is needed.
    assert forgotten <= {("GridHdf5", "_rows"), ("ContactHertz", "_total")}, found


# --- killed -------------------------------------------------------------------------------------

LONG = block(
    2, "fix(v, initial_velocity_particles, all, 0.1*sin(9*x0), 0)", "set_output(20)",
    "compute(E, energy_balance, all)", "log_modify(custom, step, time, E, E_drift)",
    "dump(d1, all, particle, 50, all.txt, x, y, s11)", "dump(d2, all, hdf5, 50, p.h5, x, s11)",
    "dump(d3, all, particle/gz, 100, d.*.gz, x)", "set_dt(0.0001)", "restart(40, r.h5)", "run({})",
    law="neo-hookean", size=(0.2, 0.1),
)  # fmt: skip
STEPS = 6000


def started(folder: Path, *options: str) -> subprocess.Popen:
    folder.mkdir(exist_ok=True)
    (folder / "in.script").write_text(LONG.format(STEPS), encoding="utf-8")
    return subprocess.Popen(
        [sys.executable, "-m", "karamelo_py.app.cli", "in.script", *options],
        cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="Windows ends processes otherwise")
@pytest.mark.xdist_group("neo-hookean")
@pytest.mark.parametrize("kills", [3, pytest.param(100, marks=pytest.mark.full)])
def test_killed_at_any_moment(tmp_path, kills):
    """SIGKILL: every file is readable, and what goes on is as if nothing had happened."""
    whole = tmp_path / "whole"
    assert started(whole).wait(timeout=300) == 0
    folder = tmp_path / "killed"
    restart: list[str] = []
    chance = random.Random(kills)
    killed = 0
    while True:
        process = started(folder, *restart)
        if killed < kills:
            begun = (folder / "log.mpm").stat().st_mtime_ns if (folder / "log.mpm").exists() else 0
            for _ in range(3000):
                log = folder / "log.mpm"
                if (log.exists() and log.stat().st_mtime_ns != begun) or process.poll() is not None:
                    break
                time.sleep(0.01)
            time.sleep(chance.uniform(0, 0.6))
            process.kill()
            killed += 1
        process.wait(timeout=300)
        process.communicate()
        if (folder / "r.h5").exists():
            restart = ["-restart", "r.h5"]
            json.loads(arrays(folder / "r.h5")["content"].tobytes())
        if (folder / "log.mpm").exists():
            lines = (folder / "log.mpm").read_text().splitlines()
            assert all(len(line.split()) == 4 for line in lines)
        if (folder / "p.h5").exists():
            assert len(arrays(folder / "p.h5")["step"]) > 0
        if process.returncode == 0:
            break
        assert process.returncode == -signal.SIGKILL
    for rest in folder.glob("*.part"):
        rest.unlink()
    same_files(whole, folder)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
@pytest.mark.xdist_group("neo-hookean")
def test_signals_of_batch_systems(tmp_path, name):
    """As Ctrl-C: the last state, whole files, 128 + the number; and the run can go on."""
    number = getattr(signal, name)
    process = started(tmp_path / "run")
    for _ in range(3000):
        if (tmp_path / "run" / "d.100.gz").exists() or process.poll() is not None:
            break
        time.sleep(0.02)
    process.send_signal(number)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 128 + number, err
    assert "Traceback" not in err
    assert "interrupted: the log and the dumps are complete" in err
    folder = tmp_path / "run"
    last = h5py.File(folder / "r.h5").attrs["step"]
    assert (folder / "log.mpm").read_text().splitlines()[-1].split()[0] == str(last)
    assert (folder / f"d.{last}.gz").exists()


def test_what_a_halved_step_takes_back_is_written_once(run_interpreted):
    """Rows of log and dumps that were written behind the last good state are written again."""
    lines = ["fix(v, initial_velocity_particles, all, 0.05*sin(40*x0), 0.03*cos(30*y0))",
             "dt_factor(1.9)", "set_output(5)", "log_modify(custom, step, dt, time)",
             "compute(E, energy_balance, all)", "dump(d, all, particle, 5, d.txt, x, vx)",
             "plot(E, 5, timestep, E)", "run(60, on_trouble=halve)"]  # fmt: skip
    result = run_interpreted(block(2, *lines, size=(0.3, 0.3)))
    assert "Back to step" in result.out + result.err
    assert result.log.Step.tolist() == list(range(0, 61, 5))
    text = (result.folder / "d.txt").read_text(encoding="utf-8").splitlines()
    steps = [int(text[k + 1]) for k, line in enumerate(text) if line == "ITEM: TIMESTEP"]
    assert steps == list(range(0, 61, 5))


def test_what_was_foreseen_is_not_told_again(run_interpreted):
    lines = ["restart(3, r.*.h5)", "run(6)"]
    script = block(2, *lines, size=(0.2, 0.2), transfer="TPIC")
    script = script.replace("quadratic-spline", "linear")
    assert "affine noise" in run_interpreted(script).err
    assert "affine noise" not in run_interpreted(script, "-restart", "r.3.h5").err


def test_generators_and_sets_are_kept():
    """What NumPy draws behind a file is what it would have drawn; all kinds of plain data."""

    class Part:
        remembers = ("rng", "old", "seen", "z", "raw")

        def __init__(self):
            self.rng = np.random.default_rng(3)
            self.old = np.random.RandomState(4)
            self.seen, self.z, self.raw = {1, 2}, 1 + 2j, bytearray(b"ab")

    held: list = []
    part, other = Part(), Part()
    part.rng.normal(size=3), part.old.normal(size=3), part.seen.add(5)
    kept = json.loads(json.dumps(memory_of(part, held)))
    remember(other, kept, held)
    assert other.rng.normal() == part.rng.normal() and other.old.normal() == part.old.normal()
    assert (other.seen, other.z, other.raw) == (part.seen, part.z, part.raw)
