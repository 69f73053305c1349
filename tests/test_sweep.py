"""Sweeps: every combination, run and put into one table, whatever becomes of single runs."""

import contextlib
import io
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from textwrap import dedent
from types import SimpleNamespace

import numpy as np
import pandas
import pytest

from karamelo_py.app.cli import main
from karamelo_py.app.plot import read_log
from karamelo_py.app.studies import case, records, study, variables, warm
from karamelo_py.app.studies.case import Launch
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

# A block in free flight: its velocity is 3 times the word's factor, and it leaves where it is told.
SCRIPT = """
N = 2
speed = 3
kind = "linear"
steps = 4
never = 1
method(ulmpm, FLIP, kind, 1)
dimension(1, 0, 10, 1/N)
region(line, block, 1, 2)
material(rubber, linear, 2, 100, 0)
solid(body, region, line, 2, rubber, 1/N, 0)
fix(v, initial_velocity_particles, all, speed)
set_dt(0.01)
compute(v, average_velocity, all)
compute(c, center_of_mass, all)
log_modify(custom, step, time, v_x, c_x)
run(steps)
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the script, and interpreted runs: they need no compiling."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    (tmp_path / "in.flight").write_text(SCRIPT, encoding="utf-8")
    return tmp_path


@pytest.mark.usefixtures("starts_are_cheap")
@pytest.mark.parametrize("name", ["s0/settled.h5", "s0/settled.*.h5"])
def test_a_sweep_reads_a_state_that_lies_beside_its_script(folder, name):
    """Each run has its folder; the state has flown for 4 steps of 0.01 at a speed of 3."""
    (folder / "s0").mkdir()
    state = name.replace("*", "4")
    (folder / "in.first").write_text(SCRIPT + f"write_restart({state})\n", "utf-8")
    assert main(["in.first"]) == 0
    text = SCRIPT.replace("run(steps)", f"read_restart({name})\nrun(steps)")
    (folder / "in.flight").write_text(text, "utf-8")
    assert main(["sweep", "in.flight", "-var", "steps=1,6", "-record", "c_x"]) == 0
    table = pandas.read_csv(folder / "sweep.csv")
    assert list(table["c_x"]) == pytest.approx([1.5 + 3 * 0.05, 1.5 + 3 * 0.1])


@pytest.mark.usefixtures("starts_are_cheap")
def test_a_refused_variant_shows_its_error_without_earlier_warnings(folder):
    no_edge = "region(far, block, 7, 8)\nfix(p, edge_pressure, all, far, 1)\n"
    text = SCRIPT.replace("compute(c, center_of_mass", no_edge + "compute(c, kind_of_c")
    (folder / "in.flight").write_text('kind_of_c = ""\n' + text, "utf-8")
    wrong = {"kind_of_c": "center_of_mas"}
    outcome = Launch(folder / "in.flight").run(wrong, folder / "case")
    assert outcome.status == "refused" and "warning: no point of the group" in outcome.complaint
    assert outcome.reason.endswith("; did you mean 'center_of_mass'?")
    shown = case.Refused(wrong, outcome).render()
    assert "unknown compute style" in shown.splitlines()[0] and "warning" not in shown


@pytest.mark.usefixtures("starts_are_cheap")
def test_a_sweep_is_a_table_that_pandas_reads(folder, capsys):
    words = ["-var", "N=2,4", "-var", "kind=linear,cubic", "-var", "speed=3", "-jobs", "2"]
    recorded = "v_x,mean:c_x,min:c_x,max:Step,when:c_x:1.575,way=max(max:c_x - first:c_x, 0)/N"
    assert main(["sweep", "in.flight", *words, "-record", recorded]) == 1
    table = pandas.read_csv(folder / "sweep.csv")
    assert list(table["N"]) == [2, 2, 4, 4] and list(table["kind"]) == ["linear", "cubic"] * 2
    good, bad = table[table.kind == "linear"], table[table.kind == "cubic"]
    assert (good.status == "done").all() and (bad.status == "refused").all()
    # Free flight at speed 3 from a centre of 1.5: 5 lines, at 0, 0.01, ... 0.04.
    assert good["v_x"].to_numpy() == pytest.approx(3)
    assert good["mean:c_x"].to_numpy() == pytest.approx(1.5 + 3 * 0.02)
    assert good["min:c_x"].to_numpy() == pytest.approx(1.5)
    assert good["when:c_x:1.575"].to_numpy() == pytest.approx(0.075 / 3)
    assert good["way"].to_numpy() == pytest.approx(3 * 0.04 / np.array([2, 4]))
    assert list(good["max:Step"]) == list(good["steps"]) == [4, 4]
    assert list(good["points"]) == [4, 8]  # two in each of N cells, N a unit of length
    assert (good[["seconds", "particle_steps_per_s", "peak_memory_mib", "wall_s"]] > 0).all(
        axis=None
    )
    assert (good["bytes_per_particle"] > 8 * 5).all() and (good["dt"] == 0.01).all()
    assert bad["reason"].str.contains("unknown basis style 'cubic'; did you mean 'cubic-").all()
    assert (folder / good["folder"].iloc[0] / "log.mpm").exists()
    out = capsys.readouterr().out
    assert "2 of 4 runs are done, 2 refused; the table is sweep.csv" in out
    last = out.splitlines()[-1]
    assert last.startswith("refused before any step, by a mistake of the script: ")
    assert last.count("unknown basis style 'cubic'") == 1
    beside = json.loads((folder / "sweep.json").read_text())
    assert beside["threads"] == 1 and beside["versions"]["numba"] and beside["processor"]


@pytest.mark.usefixtures("starts_are_cheap")
def test_a_run_that_breaks_off_has_no_values(folder):
    words = ["-var", "speed=3,300", "-record", "v_x", "-record", "max:c_x"]
    assert main(["sweep", "in.flight", *words]) == 1
    good, bad = records.read(folder / "sweep.csv")
    assert good["v_x"] == "3" and bad["status"] == "failed" and "moves by 6 cells" in bad["reason"]
    assert read_log(folder / bad["folder"])["v_x"].size > 0  # though it has a log
    assert bad["v_x"] == bad["max:c_x"] == ""


@pytest.mark.usefixtures("starts_are_cheap")
def test_a_sweep_of_which_nothing_is_done_fails(folder, capsys):
    assert main(["sweep", "in.flight", "-var", "kind=linaer,lin"]) == 1
    assert "error: no run is done: method: unknown basis style 'linaer'" in capsys.readouterr().err
    assert [row["status"] for row in records.read(folder / "sweep.csv")] == ["refused"] * 2


@pytest.mark.usefixtures("starts_are_cheap")
def test_what_is_known_is_not_run_again(folder, capsys):
    command = ["sweep", "in.flight", "-var", "speed=3,4", "-record", "v_x", "-o", "s.csv"]
    assert main(command) == 0
    marked = folder / "s" / "speed=4" / "out.txt"
    marked.write_text("not run again", encoding="utf-8")
    command[3] = "speed=3,4,5"
    assert main(command) == 0
    assert marked.read_text() == "not run again"
    assert "; 2 were known" in capsys.readouterr().out
    assert [row["v_x"] for row in records.read(folder / "s.csv")] == ["3", "4", "5"]
    # Another script is another run.
    command[3] = "speed=4"
    (folder / "in.flight").write_text(SCRIPT.replace("steps = 4", "steps = 5"), encoding="utf-8")
    assert main(command) == 0
    assert marked.read_text() != "not run again"
    marked.write_text("not run again", encoding="utf-8")
    assert main([*command, "-again"]) == 0
    assert marked.read_text() != "not run again"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows interrupts otherwise")
@pytest.mark.usefixtures("starts_are_cheap")
def test_a_sweep_that_is_interrupted_amid_a_run_goes_on(folder, monkeypatch, capsys):
    """Ctrl-C in the second of two runs, which ends; in a process of its own if ``-m full``."""
    words = ["in.flight", "-var", "speed=3,4", "-var", "steps=4000000", "-jobs", "1"]
    (folder / "in.flight").write_text(
        SCRIPT.replace("run(steps)", "run(if(speed == 3, 4, steps))"), encoding="utf-8"
    )
    log = folder / "sweep" / "speed=4,steps=4000000" / "log.mpm"
    run, begun = Launch.run, []

    def press():
        until = time.monotonic() + 60
        while not log.exists() and time.monotonic() < until:
            time.sleep(0.01)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    def counted(launch, case, place):
        begun.append(case["speed"])
        if begun == ["3", "4"]:
            threading.Thread(target=press).start()
        return run(launch, case, place)

    monkeypatch.setattr(Launch, "run", counted)
    assert main(["sweep", *words]) == 130
    assert "1 of 2 runs are in sweep.csv; the same command continues" in capsys.readouterr().err
    assert main(["sweep", *words, "-limit", "0.3"]) == 1
    assert begun == ["3", "4", "4"]
    assert [row["status"] for row in records.read(folder / "sweep.csv")] == ["done", "too long"]


@pytest.mark.full
def test_an_interrupted_sweep_goes_on(folder, capsys):
    words = [
        "in.flight",
        "-var",
        "speed=0,1e-9,2e-9",
        "-var",
        "steps=4000000",
        "-where",
        "speed > 0",
    ]
    slow = [sys.executable, "-m", "karamelo_py.app.cli", "sweep", *words, "-jobs", "1"]
    (folder / "in.flight").write_text(
        SCRIPT.replace("run(steps)", "run(if(speed == 1e-9, 4, steps))"), encoding="utf-8"
    )
    process = subprocess.Popen(slow, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr.readline().startswith("1/2  speed=1e-9")
    second = folder / "sweep" / "speed=2e-9,steps=4000000" / "log.mpm"
    until = time.monotonic() + 60
    while not second.exists() and time.monotonic() < until:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "1 of 2 runs are in sweep.csv; the same command continues" in said
    # The run that was in progress has ended, too: its log does not grow any more.
    size = second.stat().st_size
    time.sleep(0.3)
    assert second.stat().st_size == size
    assert main(["sweep", *words, "-limit", "3"]) == 1
    rows = records.read(folder / "sweep.csv")
    assert [row["status"] for row in rows] == ["done", "too long"]
    assert rows[1]["reason"] == "given up after 3 s"


@pytest.mark.usefixtures("starts_are_cheap")
def test_times_are_medians_of_repetitions(folder):
    command = ["sweep", "in.flight", "-var", "N=2,4", "-time", "-repeat", "2", "-record", "v_x"]
    assert main(command) == 0
    table = pandas.read_csv(folder / "sweep.csv")
    assert (table.seconds > 0).all() and (table.seconds_spread >= 0).all()
    assert (table.seconds_spread <= 2 * table.seconds).all()
    assert json.loads((folder / "sweep.json").read_text())["timed"] is True


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-var", "n=1"], "did you mean 'N'?"),
        (["-var", "never=1"], "sets it and never reads it"),
        (["-var", "N"], "not a list of values"),
        (["-var", "N=1,,2"], "not a list of values"),
        (["-var", "N=1,1"], "has a value twice"),
        (["-var", "N=1,5e6"], "expected: 1.5e6, or 1.0,5e6 for two values"),
        (["-var", "N=1,1", "-var", "speed=2,2", "-zip", "N,speed"], "same combination twice"),
        (["-var", "N=1", "-var", "N=2"], "given twice"),
        (["-var", "N=1:2"], "not a range"),
        (["-var", "N=1:2:1"], "at least 2 values"),
        (["-var", "N=1,2", "-var", "speed=1,2,3", "-zip", "N,speed"], "speed has 3 values"),
        (["-var", "N=1,2", "-zip", "N,other"], "there is no -var other"),
        (["-var", "N=1,2", "-where", "N > 5"], "no combination fulfils"),
        (["-var", "N=1,2", "-where", "M > 5"], "unknown name 'M'"),
        (["-var", "N=1,2", "-where", "N >"], "error: "),
        (["-var", "N=1", "-record", "v_y"], "did you mean 'v_x'?"),
        (["-var", "N=1", "-record", "mx:v_x"], "did you mean 'max:v_x'?"),
        (["-var", "N=1", "-record", "when:v_x"], "'when:v_x' is not complete"),
        (["-var", "N=1", "-record", "a=2*max:v_y"], "did you mean 'v_x'?"),
        (["-var", "N=1", "-record", "a=2*speed"], "does not log 'speed'"),
        (["-var", "N=1", "-record", "a=2*"], "error: "),
        (["-var", "N=1", "-time", "-jobs", "2"], "one at a time"),
        (["-var", "N=1", "-o", "sweep.txt"], "unknown kind of file"),
        (["-var", "N=1", "-o", "none/sweep.csv"], "mkdir none"),
        (["-var", "N=1", "-jobs", "0"], "whole number of at least 1"),
        ([], "nothing varies"),
    ],
)
def test_mistakes_are_told_before_anything_runs(folder, capsys, words, said):
    assert main(["sweep", "in.flight", *words]) == 1
    assert said in capsys.readouterr().err
    assert not (folder / "sweep").exists() and not (folder / "sweep.csv").exists()


def test_a_script_that_is_not_there(folder, capsys):
    assert main(["sweep", "in.fligth", "-var", "N=1"]) == 1
    assert "did you mean in.flight?" in capsys.readouterr().err


def test_combinations():
    values = variables.choices(["a=1,2", "b=x,y-z", "c=0:1:3"])
    assert values["c"] == ["0", "0.5", "1"]
    assert len(variables.cases(values)) == 12
    some = variables.cases(values, where=['a < 2 || b == "y-z"', "abs(c) == 0.5"])
    assert [(c["a"], c["b"]) for c in some] == [("1", "x"), ("1", "y-z"), ("2", "y-z")]
    together = variables.cases({"a": ["1", "2"], "b": ["3", "4"], "c": ["5"]}, [["a", "b"]])
    assert together == [{"a": "1", "b": "3", "c": "5"}, {"a": "2", "b": "4", "c": "5"}]


def test_variables_of_included_scripts_count(tmp_path):
    (tmp_path / "in.main").write_text("include(part)\nN = 3\n", encoding="utf-8")
    (tmp_path / "part").write_text('print("speed")\nh = 1/N\nk = 2*h', encoding="utf-8")
    variables.ScriptFiles(tmp_path / "in.main").check(["N", "h"])
    with pytest.raises(ScriptError, match=r"-var k: .* never reads it"):
        variables.ScriptFiles(tmp_path / "in.main").check(["k"])
    with pytest.raises(ScriptError, match="has no such variable"):
        variables.ScriptFiles(tmp_path / "in.main").check(["speed"])


FORMULA = 'material(r, hyperelastic, rho=2, energy="mu/2*(I1 - 3) - mu*log(J)"{})'


@pytest.mark.parametrize(
    ("script", "names", "refused"),
    [
        (FORMULA.format(", mu=4e5"), [], ["mu", "rho"]),
        ("mu = 4e5\n" + FORMULA.format(""), ["mu"], []),
        ("mu = 4e5\n" + FORMULA.format(", mu=mu"), ["mu"], []),
        ("rho = 2\n" + FORMULA.format(", mu=rho").replace("rho=2", "rho=rho"), ["rho"], ["mu"]),
    ],
)
def test_names_of_arguments_are_no_variables(tmp_path, script, names, refused):
    (tmp_path / "in.a").write_text(script, encoding="utf-8")
    variables.ScriptFiles(tmp_path / "in.a").check(names)
    for name in refused:
        with pytest.raises(ScriptError, match="has no such variable") as caught:
            variables.ScriptFiles(tmp_path / "in.a").check([name])
        assert f"on a separate line, and {name}={name} in material" in caught.value.hint
        run = Interpreter(Hub(), {name: "1"}).run_text
        with pytest.raises(ScriptError, match="the script has no variable") as caught:
            run(script)
        assert f"on a separate line, and {name}={name} in material" in caught.value.hint


def test_the_time_that_remains_grows_as_the_runs_do():
    """Times 2^-6 N^3 of two kinds, one twice as slow: the guess for N = 64 is right to a third."""
    cases = [{"N": str(n), "basis": b} for n in (8, 16, 32) for b in ("fast", "slow")]
    times = [float(c["N"]) ** 3 / 64 * (2 if c["basis"] == "slow" else 1) for c in cases]
    guess = study.guessed_time(cases, times)
    assert guess({"N": "64", "basis": "slow"}) == pytest.approx(64**3 / 32, rel=0.33)


def test_variables_that_are_0_in_some_runs_have_a_time_as_well():
    """0 has no logarithm, and counts as a word; 2 takes eight times as long as 1."""
    cases = [{"cure": c, "n": n} for c in ("0", "1") for n in ("1", "2")]
    guess = study.guessed_time(cases, [1.0, 8.0, 1.0, 8.0])
    assert guess({"cure": "0", "n": "2"}) > 3 * guess({"cure": "1", "n": "1"})


@pytest.mark.skipif(os.name != "posix", reason="terminals of POSIX")
@pytest.mark.usefixtures("starts_are_cheap")
def test_a_terminal_shows_what_runs(folder, monkeypatch):
    """A line for each run that has ended, and below a bar with what goes on."""
    import pty

    import rich

    text = """
        import os, time
        def wait(points):
            for _ in range(250):
                if os.path.exists("seen"):
                    break
                time.sleep(0.02)
    """
    (folder / "seeing.py").write_text(dedent(text), encoding="utf-8")
    script = SCRIPT.replace("set_dt", "fix(w, python, all, seeing.wait)\nset_dt")
    (folder / "in.flight").write_text(script, encoding="utf-8")
    shown = {  # while a run goes on, which ends when it is seen
        "speed=1e-5": (b"0 of 2 runs, ", b"speed=1e-5: running, "),
        "speed=2e-5": (b"1 of 2 runs, ", b" left", b"speed=2e-5: running, "),
    }
    read, write = pty.openpty()
    said = bytearray()

    def see():
        with contextlib.suppress(OSError):  # which is how a terminal ends
            while piece := os.read(read, 1 << 16):
                said.extend(piece)
                for name, words in shown.items():
                    if all(word in said for word in words):
                        (folder / "sweep" / name / "seen").touch()

    seeing = threading.Thread(target=see)
    seeing.start()
    monkeypatch.setenv("TERM", "xterm")
    with open(write, "w", encoding="utf-8") as terminal, monkeypatch.context() as patch:
        patch.setattr(rich, "_console", None)  # which knows whether it is a terminal
        patch.setattr(sys, "stdout", terminal)
        patch.setattr(sys, "stderr", terminal)
        assert main(["sweep", "in.flight", "-var", "speed=1e-5,2e-5", "-jobs", "1"]) == 0
    seeing.join(60)
    os.close(read)
    assert all(word in said for words in shown.values() for word in words)
    assert b"1/2  speed=1e-5, " in said


@pytest.mark.parametrize("width", [60, 80, 200])
def test_a_narrow_table_cuts_no_value_off(width):
    from rich.console import Console

    names, values = ("factor", "transfer"), ("0.12345", "mechanical")
    at = dict(zip(names, values, strict=True))
    facts = {"seconds": 12.25, "points": 123456, "steps": 987654, "max:growth": 1.5e10}
    end = {"status": "failed", "reason": "turned inside out " * 3}
    console = Console(width=width, record=True, file=io.StringIO())
    items = [records.Recorded("max:growth")]
    row = {**at, **facts, **end}
    long = SimpleNamespace(names=names, items=items, title="in.long")
    console.print(study.results_table([row], long, console))
    text = console.export_text()
    for word in (*names, *values, "max:growth", "1.500e+10", "failed:", "inside"):
        assert word in text, (word, text)
    assert ("987654" in text) == (width == 200)
    rows = [row | {"factor": f"number {k}"} for k in range(25)]
    console.print(study.results_table(rows, SimpleNamespace(**vars(long), out="s.csv"), console))
    text = console.export_text()
    listed = [k for k in range(25) if f"number {k} " in text]
    assert listed == [*range(10), *range(15, 25)]
    assert re.search(r"⋮ .* 5 more[\s\S]*s\.csv", text)


def test_facts_and_logs_of_several_runs(tmp_path):
    """Steps and seconds are sums; what a scene is like is taken from its first run."""
    ended = {"processor_s_in_steps": 0.4, "path_cells": None, "steps": 252}
    first = {"points": 1234, "nodes_per_point": 4, "stable_dt": 0.02, "own_dt": None}
    second = {"points": 1300, "steps": 100, "path_cells": 0.0125, "processor_s_in_steps": 0.2}
    runs = [first | ended | {"seconds": {"steps": 0.5}}, second | {"seconds": {"steps": 0.25}}]
    facts = case.facts_of({"runs": runs})
    assert facts["points"] == 1234 and facts["stable_dt"] == 0.02 and "own_dt" not in facts
    assert facts["path"] == 0.0125
    assert facts["steps"] == 352 and facts["seconds"] == 0.75
    assert facts["particle_steps"] == 352 * 1234
    assert facts["particle_steps_per_s"] == pytest.approx(352 * 1234 / 0.75)
    assert facts["cpu_seconds"] == pytest.approx(0.6)
    (tmp_path / "log.mpm").write_text("Step a\n0 1\n1 2\n# Step b\n2 nan\n3 4\n3 ", "utf-8")
    log = read_log(tmp_path)
    assert list(log["Step"]) == [0, 1, 2, 3] and list(log["a"]) == [1, 2]
    assert np.isnan(log["b"][0]) and log["b"][1] == 4


def test_names_of_folders():
    assert case.folder_name({"N": "2", "basis": "cubic-spline"}) == "N=2,basis=cubic-spline"
    contacts, other = ({"kind": kind} for kind in ("ulmpm/contacts", "ulmpm:contacts"))
    assert case.folder_name(contacts) != case.folder_name(other)
    assert not set('/\\:*"<>|') & set(case.folder_name(contacts))
    assert len(case.folder_name({"a": "x" * 500})) < 100


def process_in(folder):
    """Find the process that works in a folder."""
    for pid in filter(str.isdigit, os.listdir("/proc")):
        with contextlib.suppress(OSError):
            if os.readlink(f"/proc/{pid}/cwd") == str(folder):
                return int(pid)
    raise LookupError


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_a_run_that_is_killed_is_recorded(folder):
    (folder / "in.flight").write_text(SCRIPT.replace("steps = 4", "steps = 9000000"), "utf-8")
    launch = case.Launch(folder / "in.flight")
    import threading

    def kill():
        log = folder / "run" / "log.mpm"
        until = time.monotonic() + 60
        while not log.exists() and time.monotonic() < until:
            time.sleep(0.05)
        os.kill(process_in(folder / "run"), signal.SIGKILL)

    threading.Thread(target=kill).start()
    outcome = launch.run({"speed": "3"}, folder / "run")
    assert (outcome.status, outcome.reason) == ("killed", "ended by signal 9")


def test_a_killed_run_sets_the_exit_status(folder, monkeypatch):
    """The other one is done."""
    ends = iter(["killed", "done"])

    def run(launch, values, folder):
        return case.CaseOutcome(next(ends), folder=folder)

    monkeypatch.setattr(case.Launch, "run", run)
    assert main(["sweep", "in.flight", "-var", "N=2,4", "-jobs", "1"]) == 1
    ends = iter(["done", "done"])
    assert main(["sweep", "in.flight", "-var", "N=2,4", "-jobs", "1"]) == 0


@pytest.mark.skipif(sys.platform != "linux", reason="runs are copies on Linux alone")
@pytest.mark.usefixtures("starts_are_cheap")
def test_runs_are_copies_of_warm_processes_and_write_what_others_do(folder):
    """A copy of what has run, one of what has only imported, and a process that starts cold."""
    launch = case.Launch(folder / "in.flight")
    cases = {name: {"speed": speed} for name, speed in (("a", "3"), ("b", "300"), ("c", "3"))}
    outcomes = {name: launch.run(values, folder / name) for name, values in cases.items()}
    assert [one.status for one in outcomes.values()] == ["done", "failed", "done"]
    assert set(launch.warm.keepers) == {(), ("kind",)}
    first, warm = (launch.warm.keepers[key].pid for key in ((), ("kind",)))
    launch.warm.tries = 0
    for name, values in cases.items():
        launch.run(values, folder / f"cold {name}")
        for file in ("log.mpm", "err.txt"):
            texts = [(folder / place / file).read_bytes() for place in (name, f"cold {name}")]
            assert texts[0] == texts[1]
    launch.warm.tries = 2
    for pid in (warm, first):  # each but hurts the next start, which takes another way
        os.kill(pid, signal.SIGKILL)
        assert launch.run(cases["a"], folder / "a").status == "done"
    pids = [keeper.pid for keeper in launch.warm.keepers.values() if keeper.is_ready()]
    launch.warm.finalizer()
    assert len(pids) == 2 and not any(os.path.exists(f"/proc/{pid}") for pid in pids)


@pytest.mark.skipif(sys.platform != "linux", reason="runs are copies on Linux alone")
def test_a_warm_process_that_hangs_is_killed_and_its_run_starts_from_nothing(folder, monkeypatch):
    monkeypatch.setattr(warm, "PATIENCE", 0.2)
    monkeypatch.setattr(warm, "BEGIN", "import os; os.kill(os.getpid(), 19)")  # SIGSTOP
    begun, popen = [], subprocess.Popen
    monkeypatch.setattr(
        warm.subprocess,
        "Popen",
        lambda *args, **more: begun.append(popen(*args, **more)) or begun[-1],
    )
    processes = warm.WarmProcesses(case.environment())
    with (folder / "out.txt").open("wb") as out:
        assert processes.start((), [], folder, (out, out)) is None
    assert len(begun) == warm.TRIES
    assert not any(os.path.exists(f"/proc/{process.pid}") for process in begun)


@pytest.mark.skipif(sys.platform != "linux", reason="runs are copies on Linux alone")
@pytest.mark.usefixtures("starts_are_cheap")
def test_functions_in_python_find_nothing_of_another_run(folder):
    """A module that counts its calls, and writes what it has counted, begins at 0 in each run."""
    text = "calls = [0]\ndef count(points):\n    calls[0] += 1\n    return calls[0]\n"
    (folder / "counting.py").write_text(text, encoding="utf-8")
    script = SCRIPT.replace("set_dt", "fix(n, python, all, counting.count)\nset_dt")
    (folder / "in.flight").write_text(script.replace("c_x)", "c_x, n)"), encoding="utf-8")
    assert main(["sweep", "in.flight", "-var", "speed=1,2,3", "-record", "n", "-jobs", "1"]) == 0
    assert [row["n"] for row in records.read(folder / "sweep.csv")] == ["4"] * 3


@pytest.mark.parametrize(
    ("code", "again"), [("internal", True), ("busy", True), ("left-domain", False)]
)
def test_what_was_not_the_fault_of_a_run_is_tried_again(folder, code, again):
    launch = case.Launch(folder / "in.flight")
    values, place = {"speed": "3"}, folder / "run"
    place.mkdir()
    known = {"key": launch.key(values), "status": "failed", "reason": "x", "code": code}
    known["facts"] = {}
    (place / case.KEPT).write_text(json.dumps(known), encoding="utf-8")
    assert (launch.kept(values, place) is None) == again
