"""Scenes made in Python: the same numbers, messages and files as those of the command line."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest
from scenes import block

from comparisons.results import read_dump, read_log
from karamelo_py import KarameloWarning, Simulation, SimulationError

FLY = "fix(v, initial_velocity_particles, all, sin(9*x0), 0.1)"
SET_UP = block(2, FLY, "compute(Ek, kinetic_energy, all)", "log_modify(custom, step, time, Ek)",
               "N = 4", law="neo-hookean")  # fmt: skip
HANGING = """
fix(g, body_force, all, 0, -1)
fix(pull, python, all, {module}.{function})
compute(v, average_velocity, all)
log_modify(custom, step, time, v_x, v_y, pull_x, pull_y)
set_dt(0.001)
run(4)
"""


@pytest.fixture
def interpreted(tmp_path, starts_are_cheap):
    """Run Python code that compiles nothing, in a folder; returns what it prints."""

    def run(code: str) -> str:
        head = f"SCENE = {SET_UP!r}\nfrom karamelo_py import Simulation, SimulationError\n"
        path = os.pathsep.join([str(Path(__file__).parent), os.environ["PYTHONPATH"]])
        done = subprocess.run(
            [sys.executable, "-W", "ignore:divide", "-W", "ignore:invalid", "-c",
             head + dedent(code)],
            cwd=tmp_path, capture_output=True, text=True, timeout=300,
            env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": path},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_pandas_takes_columns_as_they_are(interpreted):
    """Of a log, points and nodes; they are no dict that could be changed."""
    pytest.importorskip("pandas")
    interpreted("""
        import numpy as np, pandas
        sim = Simulation(SCENE + "run(3)\\n")
        sim.run()
        for columns in (sim.log, sim.points, sim.nodes):
            frame = pandas.DataFrame(columns)
            assert list(frame) == list(columns) == list(dict(columns)) == list({**columns})
            assert len(frame) > 3 and len(frame.columns) == len(columns)
            assert all(np.array_equal(frame[n], columns[n], equal_nan=True) for n in columns)
            some = pandas.DataFrame(columns, columns=list(columns)[:2])
            assert list(some) == list(columns)[:2] and len(some) == len(frame)
            changes = columns.clear, columns.popitem, lambda c=columns: c.update(new=1)
            for change in (*changes, lambda c=columns: c.__delitem__("x")):
                try:
                    change()
                except TypeError as error:
                    assert "cannot be added or removed" in str(error)
                else:
                    raise AssertionError(change)
        assert pandas.Series(sim.values)["Ek"] == sim.values["Ek"]
    """)


def test_it_waits_in_front_of_a_run(interpreted, run_interpreted, tmp_path):
    """In pieces, by the rest of the script, and two at the same time: the same bits."""
    said = interpreted("""
        import numpy as np
        script = SCENE + "run(N)\\nprint(Ek)\\nrun(3)\\n"
        one, other = Simulation(script), Simulation(script, out="files")
        print(one.step, other.step, one.variables["N"])
        one.run(2)
        other.run()
        one.run(5)
        assert one.step == other.step == 7
        for name in ("x", "vy", "s11"):
            assert one.points[name].tobytes() == other.points[name].tobytes()
        assert list(one.log) == ["Step", "Time", "Ek"]
        assert (one.log["Step"] == np.arange(8)).all()
        assert one.log.to_pandas()["Ek"].tolist() == one.log["Ek"].tolist()
        assert one.values["Ek"] == one.evaluate("Ek") == one.log["Ek"][-1]
        assert one.time == one.log["Time"][-1] == one.evaluate("time")
        assert repr(one).startswith("<a script: 24 points, step 7")
        long = Simulation(script, N=6)
        long.run()
        assert long.step == 9
    """)
    assert said == "0 0 4.0\n"
    assert [path.name for path in tmp_path.iterdir()] == ["files"]
    by_hand = run_interpreted(SET_UP + "run(N)\nrun(3)\n", folder="run").folder
    assert (by_hand / "log.mpm").read_bytes() == (tmp_path / "files/log.mpm").read_bytes()


def test_commands_as_methods(interpreted, run_interpreted, tmp_path):
    """Word for word the scene of a script; dumps and pictures go where `out` says."""
    interpreted("""
        sim = Simulation(out="files")
        sim.method("ulmpm", "FLIP", "linear", 1)
        sim.dimension(2, 0, 1.2, 0, 1.2, 0.1)
        sim.region("box", "block", 0.3, 0.6, 0.3, 0.5)
        sim.material("rubber", "neo-hookean", 2, 100, 0.3)
        sim.solid("body", "region", "box", 2, "rubber", 0.1, 0)
        sim.command("fix(v, initial_velocity_particles, all, sin(9*x0), 0.1)")
        sim.compute("Ek", "kinetic_energy", "all")
        sim.log_modify("custom", "step", "time", "Ek")
        sim.dump("d", "all", "particle", 2, "d.*.txt", "x", "vy")
        sim.run(4)
        sim.fix("g", "body_force", "all", None, -9.81)
        sim.run_time(0.01)
        sim.write_restart("state.h5")
        again = Simulation(SCENE)
        again.read_restart("files/state.h5")
        assert again.points["x"].tobytes() == sim.points["x"].tobytes()
        assert again.step == sim.step and again.time == sim.time
        picture = sim.show("vx", vmin=0, title="a block")
        assert picture.png == picture._repr_png_() and picture.png[1:4] == b"PNG"
        picture.save("shown.png")
        assert sim.show().png != picture.png
    """)
    text = SET_UP.replace("N = 4", "dump(d, all, particle, 2, d.*.txt, x, vy)")
    text += "run(4)\nfix(g, body_force, all, NULL, -9.81)\nrun_time(0.01)\n"
    by_hand = run_interpreted(text, folder="run").folder
    files = {path.name: path.read_bytes() for path in by_hand.iterdir() if path.suffix != ".script"}
    record = json.loads(files.pop("run.json"))
    assert [run["steps"] for run in record["runs"]] == [
        run["steps"] for run in json.loads((tmp_path / "files" / "run.json").read_text())["runs"]
    ]
    assert len(files) > 3
    for name, content in files.items():
        assert (tmp_path / "files" / name).read_bytes() == content


def test_commands_that_give_a_value(interpreted):
    """As in a script, where `value` and `xcm` stand in expressions."""
    interpreted("""
        sim = Simulation(SCENE)
        assert sim.value("1 + 1") == 2.0
        assert sim.xcm("all", "x") == sim.evaluate("xcm(all, x)") > 0.4
        sim.run(3)
        assert sim.value("2*Ek") == 2 * sim.values["Ek"] > 0
        assert sim.external_force("all", "x") == sim.internal_force("all", "y") * 0
        assert sim.set_output(5) is None
        try:
            sim.xcm("nobody", "x")
        except SimulationError as error:
            assert "Simulation.xcm:1:5: error: xcm: unknown group 'nobody'" in str(error)
        else:
            assert False
    """)


def test_values_of_a_statement_that_waited_are_forgotten(interpreted):
    """They would be given to another statement, where a script goes on from a file."""
    interpreted("""
        sim = Simulation(SCENE + "run(value(N + timestep) + 1)")
        kept = sim._interpreter.record
        assert kept.values == {}
        sim.run(2)
        sim.run()
        assert list(kept.values.values()) == [[6.0]]
        assert [kept.statements[k] for k in kept.values] == ["run(value(N+timestep)+1)"]
    """)


def test_a_run_does_not_end_by_what_went_wrong_in_one_before(interpreted):
    """Where Ctrl-C came before the run went back to its last good state."""
    interpreted("""
        sim = Simulation(SCENE)
        sim.run(1)
        sim.hub.simulation.control.motion[0].wrong = 1
        sim.run(2)
        assert sim.step == 3
    """)


def test_what_is_assigned_is_done_or_refused(interpreted, tmp_path):
    """Variables and columns of points; nothing is passed over in silence."""
    interpreted("""
        import numpy as np
        import pytest
        sim = Simulation(SCENE.replace("fix(v", "#"), N=3)
        sim.variables["q"] = 0
        sim.variables["w"] = "2*x"
        assert sim.variables["q"] == 0 and sim.evaluate("q + 1") == 1
        assert sim.variables == {"N": 3, "q": 0, "w": "2*x"}
        with pytest.raises(SimulationError, match="sets 'N', which"):
            sim.variables["N"] = 4
        with pytest.raises(SimulationError, match="'sin x'|name"):
            sim.variables["sin x"] = 4
        with pytest.raises(SimulationError, match="cannot be deleted"):
            del sim.variables["q"]

        x = sim.points["x"]
        with pytest.raises(ValueError, match="read-only"):
            x[:] = 0
        with pytest.raises(ValueError, match="read-only"):
            sim.points["x"][3] += 1
        sim.points["vx"] = np.sin(9 * x)
        sim.points["vy"] = 0.1
        assert (sim.points["vx"] == np.sin(9 * x)).all() and (sim.points["vy"] == 0.1).all()
        # As by the fix of the same formula.
        other = Simulation(SCENE)
        sim.run(3), other.run(3)
        assert sim.log["Step"].size == 4
        np.testing.assert_allclose(sim.points["s11"], other.points["s11"], rtol=1e-9, atol=1e-12)
        sim.points["x"] = sim.points["x"] + 0.2
        assert np.ptp(sim.points["x"] - other.points["x"]) < 1e-12
        sim.run(3), other.run(3)
        np.testing.assert_allclose(sim.points["x"], other.points["x"] + 0.2, rtol=1e-9)
        np.testing.assert_allclose(sim.points["s11"], other.points["s11"], rtol=1e-6, atol=1e-9)
        for name, values, says in (
            ("x", 9, "'x' is from 0 to 1.2"),
            ("vx", np.nan, "'vx' has numbers that are not finite"),
            ("vx", [1, 2], r"one for each of 24 points, not an array of the shape \\(2,\\)"),
            ("seq", 0, "'seq' cannot be set: it follows from other columns"),
            ("z", 0, "'z' cannot be set"),
            ("s11", 0, "'s11' follows from the deformation"),
        ):
            with pytest.raises(SimulationError, match=says):
                sim.points[name] = values
        linear = Simulation(SCENE.replace("neo-hookean", "linear").replace("fix(v", "#"))
        linear.points["s12"] = 3 * x
        np.testing.assert_allclose(linear.points["s12"], 3 * x)
        assert (linear.points["s11"] == 0).all()
        linear.show("s12", file="shown.png")
    """)
    assert (tmp_path / "shown.png").read_bytes()[1:4] == b"PNG"


def test_points_from_arrays_and_files(interpreted):
    """Those of a solid of a region, given one by one, with what they begin with: the same bits."""
    interpreted("""
        import numpy as np
        import pandas
        import pytest
        text = SCENE.replace("neo-hookean", "linear")
        region = Simulation(text)
        made = text.replace("solid(", "#").replace("fix(v", "#").replace("compute(", "#")
        made = made.replace("log_modify(", "#")
        columns = {name: region.points[name] for name in ("x", "y", "volume")}
        columns |= {"vx": np.sin(9 * columns["x"]), "vy": np.full(24, 0.1)}
        pandas.DataFrame(columns).to_csv("grains.csv", index=False, float_format="%.17g")
        region.run(5)
        for given in (columns, pandas.DataFrame(columns), "grains.csv"):
            sim = Simulation(made)
            sim.solid("body", "points", given, "rubber", 0.1)
            assert (sim.points["vx"] == columns["vx"]).all()
            sim.run(5)
            for name in ("x", "vy", "s11", "mass"):
                np.testing.assert_allclose(sim.points[name], region.points[name], rtol=1e-12,
                                           atol=1e-14)
        bent = Simulation(made)
        bent.solid("body", "points", columns | {"s12": columns["x"]}, "rubber", 0.1)
        np.testing.assert_allclose(bent.points["s12"], columns["x"])
        warm = Simulation(made.replace("FLIP, linear, 1", "FLIP, linear, 1, thermo-mechanical")
                          .replace("100, 0.3)", "100, 0.3, 7, 0)"))
        warm.solid("body", "points", columns | {"T": 300 + columns["x"]}, "rubber", 0.1, 300)
        np.testing.assert_array_equal(warm.points["T"], 300 + columns["x"])
        warm.run(3)
        np.testing.assert_allclose(warm.points["T"], 300 + columns["x"], rtol=1e-4)
        warm.points["T"] = 310
        assert (warm.points["T"] == 310).all()
        for wrong, says in (
            ({"T": np.ones(24)}, "a material of this scene has no temperature T"),
            ({"volume": np.zeros(24)}, "point 1 of the table has no position, or no volume above"),
            ({"volume": np.ones(3)}, "has columns of several lengths"),
            ({"x": np.full(24, 9.0)}, "all of them lie outside the domain"),
            ({"seq": np.ones(24)}, "'seq' cannot be set: it follows from other columns"),
        ):
            sim = Simulation(made)
            with pytest.raises(SimulationError, match=says):
                sim.solid("body", "points", columns | wrong, "rubber", 0.1)
                sim.run(1)
        with pytest.raises(SimulationError, match="has no column volume"):
            Simulation(made).solid("body", "points", {"x": [1.0], "y": [1.0]}, "rubber", 0.1)
    """)


def test_functions_in_python(interpreted):
    """A force of the weight is the weight; a velocity that nodes are given is kept."""
    interpreted("""
        import numpy as np
        text = SCENE.replace("initial_velocity_particles, all, sin(9*x0), 0.1",
                             "body_force, all, 0, -2")
        weight, ours = Simulation(text), Simulation(text.replace("fix(v", "#"))

        def pull(points):
            points.force[:, 1] -= 2*points.mass
            return points.force.sum(axis=0)

        ours.fix("pull", "python", "all", pull)
        for sim in (weight, ours):
            sim.set_dt(0.001)
            sim.run(5)
        assert np.allclose(weight.points["vy"], ours.points["vy"], rtol=1e-12, atol=1e-15)
        # rho 2, 0.3 by 0.2, g 2
        assert abs(ours.values["pull_y"] + 0.24) < 1e-14

        def hold(nodes):
            nodes.velocity_update[:] = [0.5, 0.0]
            return 3.0

        ours.fix("hold", "python", "all", hold, "post_update_grid_state")
        ours.run(1)
        nodes = ours.nodes["mass"] > 0
        assert (ours.nodes["vx_update"][nodes] == 0.5).all() and ours.values["hold"] == 3
    """)


def test_a_function_of_a_module(run_interpreted, tmp_path):
    """fix python in a script, whose module lies beside it."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "ropes.py").write_text(
        "def pull(points):\n    points.force[:, 1] += points.mass\n    return points.force.sum(0)\n"
    )
    script = block(2, HANGING.format(module="ropes", function="pull"))
    log = run_interpreted(script).log
    assert log.v_y == pytest.approx(np.zeros(5), abs=1e-15)
    assert log.pull_y[1:] == pytest.approx(np.full(4, 0.12), rel=1e-12)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("ropes.pul", "did you mean 'ropes.pull'?"),
        ("rops.pull", "the module rops cannot be imported"),
        ("rops.pull", "/run, nor installed"),
        ("pull", "'pull' names no module"),
        ("ropes.py, pull", "hint: a function f of the file ropes.py is ropes.f"),
        ("rops.py, pull", "hint: a function f of the file rops.py is rops.f"),
        ("ropes.pull, final", "one of post_particles_to_grid"),
        ("ropes.broken", "fix python: broken: ZeroDivisionError: division by zero (ropes.py:4)"),
        ("ropes.leaves", "fix python: leaves: SystemExit: 0 (ropes.py:6)"),
        ("ropes.two", "two cannot be called with one argument: missing a required argument: 'b'"),
        ("ropes.pull", "the method has to be thermo-mechanical"),
        ("ropes.column", "PointsView has no ['vy']: write .velocity[:, 1]"),
        ("ropes.column", "\n  ropes.py:12 in column: deeper(points)\n  ropes.py:10 in deeper: "),
        ("ropes.nothing", "its attributes are force, heat_supply, mass, position"),
        (
            "ropes.library",
            "hint: correct the function there:\n  ropes.py:16 in library: def library",
        ),
    ],
)
def test_functions_with_faults(run_interpreted, tmp_path, line, says):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "ropes.py").write_text(
        "def pull(points):\n    return points.heat_supply\n\ndef broken(points): return 1/0\n"
        "\ndef leaves(points): raise SystemExit(0)\n\ndef two(points, b): pass\n"
        "def deeper(points):\n    return points['vy']\ndef column(points):\n    deeper(points)\n"
        "def nothing(points):\n    points['nonsense'] = 1\n"
        "import json\ndef library(points): json.loads('{')\n"
    )
    result = run_interpreted(block(2, f"fix(p, python, all, {line})", "run(1)"), status=1)
    assert says in result.err


def test_errors_carry_message_and_place(tmp_path, capsys):
    """The same text as on the command line, and its parts."""
    from karamelo_py.app.cli import main

    text = "dimension(2, 0, 1, 0, 1, 0.1)\nregion(box, blok, 0, 1, 0, 1)\n"
    path = tmp_path / "in.wrong"
    path.write_text(text)
    assert main([str(path)]) == 1
    said = capsys.readouterr().err.strip()
    with pytest.raises(SimulationError) as caught:
        Simulation(path)
    assert str(caught.value) == said
    assert (caught.value.mark.line, caught.value.mark.column) == (2, 13)
    sim = Simulation("method(ulmpm, PIC, linear)\ndimension(2, 0, 1, 0, 1, 0.1)\n")
    with pytest.raises(SimulationError, match="unknown region 'box'") as caught:
        sim.solid("s", "region", "box", 2, "m", 0.1)
    assert caught.value.mark.text == "solid(s, region, box, 2, m, 0.1)"
    with pytest.raises(SimulationError, match="there is no solid to move"):
        sim.run(3)
    with pytest.raises(SimulationError, match="no script is left"):
        sim.run()
    with pytest.raises(SimulationError, match=r"there is no file .*in\.wrnog.*\n.*\n.*in\.wrong"):
        Simulation(tmp_path / "in.wrnog")
    with pytest.raises(AttributeError, match="did you mean 'solid'"):
        sim.solidd()
    with pytest.raises(AttributeError, match=r"no command .gravity.; fix.ID, body_force, all"):
        sim.gravity(3)
    for name, says in (
        ("s1", "did you mean 's1"),
        ("vonmises", "did you mean seq"),
        ("nonsense", "there is no 'nonsense'; there are"),
    ):
        with pytest.raises(KeyError, match=says) as missing:
            sim.points[name]
        assert str(missing.value).startswith("there is no")
    with pytest.raises(TypeError, match="is not a number"):
        sim.region("box", "block", [0, 1])
    with pytest.warns(KarameloWarning, match="has no effect"):
        sim.command("dt_factor(0.5)\nset_dt(0.1)")


def test_a_text_of_one_line(tmp_path, monkeypatch):
    """A file of that name comes first; what is neither a file nor a statement is told so."""
    monkeypatch.chdir(tmp_path)
    assert Simulation("a = 2*3").variables == {"a": 6}
    assert Simulation("dimension(1, 0, 1, 0.1)" + " " * 5000).command("2") is None
    (tmp_path / "in (1)").write_text("a = 7")
    assert Simulation("in (1)").variables == {"a": 7}
    expected = "there is no file in.two_diks\nexpected: the name of a script, or its text"
    with pytest.raises(SimulationError, match=expected):
        Simulation("in.two_diks")
    with pytest.raises(SimulationError, match=r"'dimensio'"):
        Simulation("dimensio(1, 0, 1, 0.1)")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"threads": 0}, "threads=0 is not a number of threads\nexpected: 1, 2, ..., or None"),
        ({"threads": -3}, "threads=-3 is not a number"),
        ({"threads": "x"}, "threads='x' is not a number"),
        ({"threads": True}, "threads=True is not a number"),
        ({"out": "taken"}, 'cannot write to .*taken: .*\nexpected: a folder, .*\n.*out="files" is'),
        ({"out": "taken/files"}, "cannot write to .*files: "),
        ({"out": 3}, "out=3 is not the name of a folder"),
        ({"script": 3}, "3 is not a script\nexpected: the name of a script, or its text"),
    ],
)
def test_what_it_is_given_wrongly(tmp_path, monkeypatch, given, message):
    monkeypatch.chdir(tmp_path)
    Path("taken").write_text("")
    with pytest.raises(SimulationError, match=message):
        Simulation(**({"script": "a = 1"} | given))


def test_two_in_one_folder(tmp_path):
    """They are told; when the first is closed, or gone, the second may."""
    first = Simulation(out=tmp_path / "files")
    with pytest.raises(SimulationError, match="another simulation writes to"):
        Simulation(out=tmp_path / "files")
    first.close()
    with Simulation(out=tmp_path / "files"):
        pass
    Simulation(out=tmp_path / "files")
    Simulation(out=tmp_path / "files")


@pytest.mark.xdist_group("neo-hookean")
def test_compiled(tmp_path, monkeypatch, capsys):
    """As by the command line, with the loops that other tests compile."""
    from karamelo_py.app.cli import main

    monkeypatch.chdir(tmp_path)
    text = SET_UP + "dump(d, all, particle, 20, d.*.txt, x, vy)\nrun(20)\n"
    Path("in.block").write_text(text)
    assert main(["in.block"]) == 0
    sim = Simulation("in.block")
    sim.run()
    assert sim.log["Ek"] == pytest.approx(read_log(Path("log.mpm")).Ek, rel=1e-9)
    [last] = read_dump(Path("d.20.txt"))
    assert sim.points["vy"] == pytest.approx(last.vy, rel=1e-5)
    assert capsys.readouterr().err == ""


@pytest.mark.xdist_group("disks")
def test_the_lines_of_the_readme(monkeypatch):
    """They run as they stand, in the folder of README, and leave no file."""
    root = Path(__file__).parents[1]
    monkeypatch.chdir(root)
    before = set(root.iterdir())
    (lines,) = re.findall(r"```python\n(.*?)```", (root / "README.md").read_text("utf-8"), re.S)
    said = {}
    exec(lines, said)
    assert said["sim"].log["Time"][-1] == 3.5
    assert set(root.iterdir()) == before
