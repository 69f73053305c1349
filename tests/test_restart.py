"""A run that goes on from a file is the one that was never interrupted: the same bits.

Nothing here compares with a formula; the other tests do.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import zlib
from itertools import product
from pathlib import Path
from textwrap import dedent

import h5py
import numpy as np
import pytest
from combinations import BASES, MESHED, SCHEMES, TRANSFERS, fits, refused, scene, write_mesh
from going_on import CURVE, FLY, OUTPUTS, SCENES, SERIAL, arrays, goes_on, same_files, with_files
from scenes import block
from selection import covering, few
from test_rigid_body import HULL

from karamelo_py.language import registry
from karamelo_py.run.checkpoint.arrays import opened, reading
from karamelo_py.run.checkpoint.parts import give_state, state_of
from karamelo_py.run.checkpoint.restart_file import Restart, refuse_altered
from karamelo_py.script.errors import ScriptError

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


def some_ways() -> list:
    """Few with every choice; the others if ``-m full``."""
    chosen, rest = covering(ways())
    return [*chosen, *(pytest.param(way, marks=pytest.mark.full) for way in rest)]


@pytest.mark.parametrize("way", some_ways(), ids=lambda way: " ".join(filter(None, way)))
def test_every_way(run_interpreted, tmp_path, way):
    """Methods, bases, transfers, schemes and kinematics."""
    option = way[3]
    mesh = write_mesh(tmp_path / "m.vtk", MESHED[option]) if option in MESHED else None
    goes_on(run_interpreted, with_files(scene(*way, mesh=mesh, steps=4)))


# In the total frame or by a formula the same parts remember the same.
SHOWN = {f"{part} in the total frame" for part in ("loads", "flow", "heat")}
SHOWN |= {"flow with averaged volumes", "rigid by a formula"}
PARTS = [*SCENES, *SERIAL]


@pytest.mark.parametrize("name", few(PARTS, *(name for name in PARTS if name not in SHOWN)))
def test_every_part(run_interpreted, tmp_path, name):
    """Contact, heat, damage, edges, tools, computes that look back; implicit steps."""
    (tmp_path / "curve.csv").write_text(CURVE, encoding="utf-8")
    goes_on(run_interpreted, with_files((SCENES | SERIAL)[name]))


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
    text = "\n".join([*SCENES.values(), *SERIAL.values(), OUTPUTS, HULL, *scenes])
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


def test_a_step_that_was_halved(run_script):
    """Halvings, and the state that a run goes back to, are the same behind a file."""
    lines = ["fix(v, initial_velocity_particles, all, 0.05*sin(40*x0), 0.03*cos(30*y0))",
             "dt_factor(1.9)", "set_output(5)", "log_modify(custom, step, dt, limit)",
             "compute(E, energy_balance, all)", "dump(d, all, particle, 20, d.*.txt, x, vx)",
             "run(60, on_trouble=halve)"]  # fmt: skip
    script = with_files(block(2, *lines, size=(0.3, 0.3)), "restart(12, r.*.h5)\n")
    whole = goes_on(run_script, script, files=4)
    halvings = {content(file)["run"][0] for file in whole.glob("r.*.h5")}
    assert max(halvings) > 0


def test_a_step_above_the_limit_from_a_file_on(run_interpreted):
    """It is what the user wants then, as at the start of a run: no reason to stop."""
    script = FLY.replace("run(4)", "restart(1, r.*.h5)\nrun(12)")
    still = script.replace("sin(9*x0), 0)", "0, 0)")
    run_interpreted(still.replace("run(12)", "run(2)"))
    result = run_interpreted(still.replace("set_dt(0.001)", "set_dt(0.05)"), "-restart", "r.1.h5")
    assert result.log.Step[-1] == 12 and result.log.dt[-1] == 0.05


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
    sim.hub.simulation.setup.control.energy[0].windows = 2
def told(sim):
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        sim.run(1)
    return sum("energy balance: spurious gain" in str(one.message) for one in found)
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
print(told(fresh), fresh.hub.simulation.setup.control.step[0].dt_factor)
fresh.command("fix(v, initial_velocity_particles, all, 1, 0)")
fresh.run(1)
grows(fresh)
print(told(fresh))
"""


def test_growth_of_energy_is_told_once(tmp_path, starts_are_cheap):
    """In runs in pieces, too, and behind a file; anew where a balance begins anew."""
    (tmp_path / "scene").write_text(FLY.partition("set_dt")[0])
    said = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", TOLD], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert said.stdout.split("\n")[:-1] == ["1 0", "0", "0 0.3", "1"], said.stderr


def test_outputs_go_on_in_their_files(run_interpreted):
    """Also from a file of a run that was over, or between two runs; values are those read then."""
    fly = "fix(v, initial_velocity_particles, all, sin(9*x0), 0)"
    lines = ["compute(E, energy_balance, all)", "log_modify(custom, step, time, E)", "run(5)",
             "E0 = value(E_total)", "run_time(0.03*E0/E0)", "write_restart(w.h5)",
             "fix(g, body_force, all, E0, 0)", "run_while(time < 0.07)"]  # fmt: skip
    script = with_files(block(2, fly, OUTPUTS, *lines, size=(0.2, 0.1)))
    whole = goes_on(run_interpreted, script, files=2)
    again = whole.with_name("between")
    shutil.copytree(whole, again)
    run_interpreted(script, "-restart", "w.h5", folder="between")
    same_files(whole, again)


@pytest.mark.full
def test_another_number_of_threads(tmp_path):
    """One thread writes, two go on; compiled. Threads alone: test_identical.py."""
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


# --- scripts ------------------------------------------------------------------------------------


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
    assert err.count("pull has changed total, list_of, and restart files") == 1
    assert "remembers = ('total', 'list_of') in the module ropes" in err
    assert err.count("Rope has changed pulled, and") == 1
    assert "remembers = ('length', 'pulled') in the class Rope" in err
    wrong = run_interpreted(FLY + "fix(p, python, all, ropes.wrong)\nrun(1)\n", status=1).err
    assert "the class Wrong lists 'there' in remembers, but does not have it" in wrong


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


def test_a_longer_run_time(run_interpreted):
    """Its last two steps are shortened: bits are the same from files of the steps before them."""
    text = with_files(FLY.replace("run(4)", "run_time({})"), "restart(1, r.*.h5)\n")
    longer = arrays(run_interpreted(text.format(0.008), folder="longer").folder / "r.6.h5")
    run_interpreted(text.format(0.0045))  # steps 4 and 5 are shortened
    position = next(name for name in longer if name.endswith("/x"))
    for step, same in ((4, False), (3, True)):  # each writes the files behind it again
        folder = run_interpreted(text.format(0.008), "-restart", f"r.{step}.h5").folder
        again = arrays(folder / "r.6.h5")
        assert np.array_equal(longer[position], again[position]) == same


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
    result = run_interpreted(text, "-restart", "r.2.h5")
    assert result.log.Step[-1] == 6
    assert result.out.startswith("n = 6 taken from r.2.h5, as -var had it\n")
    result = run_interpreted(text, "-restart", "r.2.h5", "-var", "n", "6")
    assert "taken from" not in result.out
    result = run_interpreted(text, "-restart", "r.2.h5", "-var", "n", "5", status=1)
    assert "was written with -var n 6; now it is -var n 5" in result.err


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("100, 0.3", "100, 0.2", "that script has material(rubber,linear,2,100,0.3) here"),
        ("run(4)", "", "this script ends earlier"),
        ("run(4)", "region(r, block, 0, 1, 0, 1)", "that script has a run here"),
        ("FLIP, linear, 1", "FLIP, linear, 0.9", "that script has method("),
    ],
)
def test_another_script(run_interpreted, old, new, says):
    run_interpreted(with_files(FLY))
    text = FLY.replace(old, new)
    result = run_interpreted(text, "-restart", "r.2.h5", status=1)
    assert "r.2.h5 was written by another script" in result.err
    assert says in result.err
    assert result.err.count("error:") == 1


def test_a_file_from_behind_the_last_run(run_interpreted):
    """Nothing is left to do; another length of that run is refused, a further run works."""
    text = FLY + "write_restart(end.h5)\n"
    run_interpreted(text)
    said = run_interpreted(text, "-restart", "end.h5").out
    assert "note: end.h5 holds the end of the last run" in said and "read_restart(end.h5)" in said
    longer = run_interpreted(text.replace("run(4)", "run(9)"), "-restart", "end.h5", status=1).err
    assert "end.h5 was written after this run, by run(4)" in longer
    assert "run(4) as it was, another run command after write_restart(end.h5)" in longer
    further = run_interpreted(text + "run(5)\n", "-restart", "end.h5")
    assert further.log.Step[-1] == 9 and "note:" not in further.out


def test_a_longer_run_by_a_variable(run_interpreted):
    """The number stands in the last run; the message says what to write, and that works."""
    text = with_files("n = 4\n" + FLY.replace("run(4)", "run(2*n)"))
    run_interpreted(text)
    result = run_interpreted(text.replace("n = 4", "n = 6"), "-restart", "r.4.h5", status=1)
    assert "hint: leave n=4 as it was here, and write run(2*6) instead of run(2*n)" in (result.err)
    longer = text.replace("run(2*n)", "run(2*6)")
    assert run_interpreted(longer, "-restart", "r.4.h5").log.Step[-1] == 12


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


def test_a_file_from_before_the_first_step(run_interpreted):
    """No node shows anything yet."""
    set_up, _, _ = FLY.partition("run(4)")
    script = set_up + "write_restart(w.h5)\nrun(2)\nwrite_restart(end.h5)\n"
    whole = run_interpreted(script, folder="a")
    before = (whole.folder / "end.h5").read_bytes()
    again = run_interpreted(script, "-restart", "w.h5", folder="a")
    assert again.log.Step.tolist() == [0, 1, 2]
    assert (again.folder / "end.h5").read_bytes() == before


def test_colours_go_into_another_script(run_interpreted):
    """Pictures of the same field have the range of those before; of another one, their own."""
    picture = "dump(p, all, pyplot, 2, p.*.png, 1, 1, vx)\n"
    stop = "fix(s, velocity_particles, all, 0, 0)\n"
    set_up = FLY.partition("run(4)")[0] + picture
    # What was fast at first has left the range to what is slow, before the file is written.
    first = f"run(2)\n{stop}run(2)\nwrite_restart(w.h5)\nrun(2)\n"
    whole = run_interpreted(set_up + first)

    def last(script: str) -> bytes:
        found = run_interpreted(f"{script}{stop}read_restart(w.h5)\nrun(2)\n")
        return (found.folder / "p.6.png").read_bytes()

    expected = (whole.folder / "p.6.png").read_bytes()
    assert last(set_up) == expected
    assert last(set_up.replace("dump(p,", "dump(q,")) != expected
    for other in (picture.replace("vx", "vy"), picture.replace("vx", "vx, vmax=3")):
        there = set_up.replace(picture, other)
        assert last(there) == last(there.replace("dump(p,", "dump(q,"))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("method(ulmpm", "method(tlmpm", "FLIP (alpha 1) linear; here it is tlmpm"),
        ("box, 2, rubber", "box, 1, rubber", "solid 'body' 8 points of LinearElastic"),
        ("0, 1.2, 0.1)", "0, 1.3, 0.1)", "domain 2"),
        ("block, 0.3, 0.5,", "block, 0.35, 0.55,", "other points in solid 'body'"),
        ("solid(body", "solid(other", "solid 'body', which only that scene has"),
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


@pytest.mark.parametrize("content", [None, b"", b"no HDF5", "other HDF5", 4, 99, "half"])
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
    elif content is not None:
        shutil.copy(folder / "r.2.h5", path)
        with h5py.File(path, "r+") as file:
            file.attrs["version"] = content
    result = run_interpreted(FLY, "-restart", "bad.h5", status=1)
    says = {
        None: "there is no file bad.h5",
        4: "bad.h5 has format 4, of an older karamelo-py",
        99: "without this file, or with the newer karamelo-py that wrote it",
    }
    assert says.get(content, "is not a restart file of this program") in result.err
    assert result.err.count("error:") == 1
    assert (folder / "log.mpm").read_text().count("\n") == 6  # nothing was begun anew


def test_what_has_been_altered_is_refused(tmp_path, run_interpreted):
    """Wherever a bit of a file is turned: nothing is read, or what was written."""
    path = run_interpreted(with_files(FLY)).folder / "r.2.h5"
    written, content = path.read_bytes(), read(path)
    altered, refused, places = tmp_path / "altered.h5", 0, range(5, len(written), 997)
    for place in places:
        bits = bytearray(written)
        bits[place] ^= 1 << place % 8
        altered.write_bytes(bits)
        try:
            found = read(altered)
        except ScriptError:
            refused += 1
            continue
        assert found.keys() == content.keys(), place
        for name, array in content.items():
            np.testing.assert_array_equal(found[name], array, f"{name} {place}")
    # What is free in a file may change.
    assert refused > len(places) / 4


def read(path: Path) -> dict[str, np.ndarray]:
    """All of a file to go on from, as the program reads it."""
    restart = Restart(path)
    with reading():
        refuse_altered(path, large=True)
    with opened(path) as state:
        found = {name: array[()] for name, array in state.items()}
    return found | {"content": np.array(json.dumps(restart.content))}


@pytest.mark.parametrize(
    ("name", "number"), [("material", 1_000_000), ("grid", -1), ("id", 999), ("grid", 7)]
)
def test_numbers_that_the_scene_does_not_have(run_interpreted, name, number):
    """Somebody has changed an array with a tool for HDF5, and its checksum."""
    folder = run_interpreted(with_files(FLY)).folder
    with h5py.File(folder / "r.2.h5", "r+") as file:
        array = file[f"state/points/0/{name}"]
        array[3] = number
        array.attrs["crc32"] = zlib.crc32(array[:].tobytes())
    result = run_interpreted(FLY, "-restart", "r.2.h5", status=1)
    assert f"its state does not fit this scene: points/0/{name} has" in result.err
    assert str(number) in result.err


def test_a_state_is_looked_for_where_other_input_files_are(run_interpreted):
    """In the output folder, then in the current one, then next to the script."""
    folder = run_interpreted(with_files(FLY)).folder
    first, *_, last = sorted(folder.glob("r.*.h5"))
    (folder / "out").mkdir()
    shutil.copy(first, folder / "out" / "r.h5")
    shutil.copy(last, folder / "r.h5")
    script = FLY.partition("run(")[0] + 'read_restart(r.h5)\nprint("step", timestep)\nquit\n'
    steps = [run_interpreted(script, *words).out for words in (("-out", "out"), ())]
    assert [f"step = {file.suffixes[0][1:]}" in said
            for file, said in zip((first, last), steps, strict=True)] == [True, True]  # fmt: skip


def test_a_file_in_a_folder_below_is_shown(run_interpreted):
    """Who has written it with -out looks for it by the name that stands in the script."""
    folder = run_interpreted(with_files(FLY)).folder
    for name in ("r.2.h5", "none.*.h5"):
        said = run_interpreted(f"{FLY}read_restart({name})", status=1, folder="other").err
        assert "there is no file" in said and "a file that restart or write_restart" in said
    below = folder.parent / "other" / "out"
    below.mkdir()
    shutil.copy(folder / "r.2.h5", below)
    said = run_interpreted(f"{FLY}read_restart(r.2.h5)", status=1, folder="other").err
    assert "hint: there is out/r.2.h5" in said
    (below.parent / "z").mkdir()
    shutil.copy(folder / "r.2.h5", below.parent / "z")
    said = run_interpreted(FLY, "-out", "out", "-restart", "r.2.h5", status=1, folder="other").err
    assert "hint: there is out/r.2.h5" in said


def test_files_that_are_gone_begin_anew(run_interpreted):
    """Where the files of the run before are not, those of this one begin, and it is said."""
    text = FLY.replace("run(4)", OUTPUTS + "run(4)")
    folder = run_interpreted(with_files(text)).folder
    (folder.parent / "elsewhere").mkdir()
    shutil.copy(folder / "r.2.h5", folder.parent / "elsewhere")
    result = run_interpreted(text, "-restart", "r.2.h5", folder="elsewhere")
    assert result.err.count("the file starts empty") == 6
    assert result.log.Step.tolist() == [3, 4]
    assert h5py.File(result.folder / "nodes.h5")["step"][:].tolist() == [3, 4]


def test_what_cannot_be_written_is_told(run_interpreted):
    says = "there is nothing to write yet"
    assert says in run_interpreted("write_restart(w.h5)\n", status=1).err
    assert "there is no scene yet" in run_interpreted("read_restart(w.h5)\n", status=1).err
    for every, files in ((0, []), (2, ["restart.h5"])):
        folder = run_interpreted(FLY.replace("run", f"restart({every})\nrun")).folder
        assert [file.name for file in folder.glob("*.h5")] == files


# Prints what is forgotten: in an interpreter of its own, which compiles nothing.
WATCH = r"""
import re
from pathlib import Path
import numpy as np
from going_on import CURVE, OUTPUTS, SCENES, block
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.checkpoint.parts import named
from karamelo_py.scene.hub import Hub

SHOWN = $SHOWN
PLAIN = (int, float, str, bool, list, dict, np.ndarray, type(None))
fly = "fix(v, initial_velocity_particles, all, sin(9*x0), 0)"
Path("curve.csv").write_text(CURVE)
scenes = {name: one for name, one in SCENES.items() if name not in SHOWN}
scenes |= {"outputs": block(2, fly, OUTPUTS, "run(3)", size=(0.2, 0.1))}
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
    script = re.sub(r"run\(\d+\)", "run(3)", script.replace("../curve", "curve"))
    hub.interpreter.run_text(script)
    assert before
    for part, old in before:
        for key, value in vars(part).items():
            if isinstance(value, PLAIN) and key not in named(part):
                if repr(value) != old.get(key):
                    print("forgotten", name, type(part).__name__, key)
print("done")
"""


def test_all_that_changes_is_remembered(tmp_path, starts_are_cheap):
    """What parts keep in plain attributes, and a run changes, they name in `remembers`."""
    path = os.pathsep.join([str(Path(__file__).parent), os.environ["PYTHONPATH"]])
    watch = WATCH.replace("$SHOWN", repr(SHOWN))
    said = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", watch], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": path},
    )  # fmt: skip
    *found, last = said.stdout.splitlines() or [""]
    assert last == "done", said.stderr
    forgotten = {tuple(line.split()[-2:]) for line in found}
    forgotten = {(part, name) for part, name in forgotten if name != "has_published"}
    # What is made anew whenever it is needed.
    anew = {("GridHdf5", "_rows"), ("ContactHertz", "_total"), ("ContactSurface", "_address")}
    anew |= {(fix, name) for fix in ("EdgePressure", "EdgeTraction") for name in ("_ids", "_rows")}
    assert forgotten <= anew, found


def test_what_a_halved_step_takes_back_is_written_once(run_script):
    """Rows of log and dumps that were written behind the last good state are written again."""
    lines = ["fix(v, initial_velocity_particles, all, 0.05*sin(40*x0), 0.03*cos(30*y0))",
             "dt_factor(1.9)", "set_output(5)", "log_modify(custom, step, dt, time)",
             "compute(E, energy_balance, all)", "dump(d, all, particle, 5, d.txt, x, vx)",
             "plot(E, 5, timestep, E)", "run(60, on_trouble=halve)"]  # fmt: skip
    result = run_script(block(2, *lines, size=(0.3, 0.3)))
    assert "Back to step" in result.out + result.err
    assert result.log.Step.tolist() == list(range(0, 61, 5))
    text = (result.folder / "d.txt").read_text(encoding="utf-8").splitlines()
    steps = [int(text[k + 1]) for k, line in enumerate(text) if line == "ITEM: TIMESTEP"]
    assert steps == list(range(0, 61, 5))


def test_no_more_files_by_a_variable(run_interpreted):
    lines = ["restart(2, r.*.h5)", "run(4)", "n = 0", "restart(n)", "run(4)"]
    folder = run_interpreted(block(2, *lines, size=(0.2, 0.2))).folder
    assert sorted(path.name for path in folder.glob("*.h5")) == ["r.2.h5", "r.4.h5"]


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
    kept = json.loads(json.dumps(state_of(part, held)))
    give_state(other, kept, held)
    assert other.rng.normal() == part.rng.normal() and other.old.normal() == part.old.normal()
    assert (other.seen, other.z, other.raw) == (part.seen, part.z, part.raw)
