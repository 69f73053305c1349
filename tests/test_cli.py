"""The command line: what it says when it is not used as meant."""

import os
import subprocess
import sys
import warnings

import pytest
from scenes import block

from karamelo_py.app.bench.measure import WORKLOADS
from karamelo_py.app.cli import main
from karamelo_py.app.simulation import Simulation


@pytest.mark.parametrize("script", ["", "# nothing\n", "dimension(1, 0, 1, 0.1)\n"])
def test_a_script_without_a_run_says_so(run_script, script):
    assert "warning: in.script runs nothing" in run_script(script).err.replace(
        str(run_script(script).folder) + "/", ""
    )


BODY = """
method(ulmpm, FLIP, linear, 1)
dimension(1, 0, 1, 0.1)
region(line, block, 0, 0.5)
material(rubber, neo-hookean, 1, 1, 0)
solid(bar, region, line, 2, rubber, 0.1)
"""


def test_bodies_without_a_run_are_a_mistake(run_interpreted):
    """Who waits for what they do gets nothing; what is printed, or ends where it says, is meant."""
    forgotten = run_interpreted(BODY + "set_output(10)\n", status=1)
    assert "error: " in forgotten.err and "runs nothing" in forgotten.err
    assert "add run(n)" in forgotten.err
    for line in ("print(dt)", "quit", "run(1)"):
        run_interpreted(BODY + line + "\n")
    run_interpreted(BODY, command="check")


@pytest.mark.parametrize("command", ["run", "check"])
def test_parts_after_the_last_run_are_warned_of(run_interpreted, command):
    """Before the first one; what some run sees is none of that."""
    lines = ("dump(d, all, particle, 1, d.txt, x)", "fix(g, body_force, all, -1e-6)",
             "compute(E, kinetic_energy, all)", "plot(p, 1, time, E)")  # fmt: skip
    seen = "\n".join(["run(1)", *lines, "run(1)", "save_plot(p.png)", "print(E)"])
    assert run_interpreted(BODY + seen, command=command).err == ""
    late = run_interpreted(BODY + "\n".join(["run(1)", "run(1)", *lines]), command=command).err
    said = [line for line in late.splitlines() if "follows the last run" in line]
    assert [f"{kind} follows the last run" in line for kind, line in zip(
        ("fix 'g'", "dump 'd'", "plot 'p'"), said, strict=True)] == [True] * 3  # fmt: skip
    assert all(f"| {line}" in late for line in lines if "compute" not in line)


def test_a_program_may_go_on_behind_its_script():
    with Simulation(BODY) as sim, warnings.catch_warnings():
        warnings.simplefilter("error")
        sim.run(1)
        sim.command("fix(g, body_force, all, -1e-6)")
        sim.run(1)


def test_what_is_defined_further_down_is_told(run_interpreted):
    material = "material(rubber, neo-hookean, 1, 1, 0)\n"
    said = run_interpreted(BODY.replace(material, "") + material + "run(1)\n", status=1).err
    assert "unknown material 'rubber'" in said
    assert "hint: material 'rubber' is defined further down: move line 6 up" in said
    assert said.count("error: ") == 1


def test_an_id_that_is_given_twice_is_one_mistake(run_interpreted):
    """The one that the other was meant to have is not told to be unknown."""
    twice = BODY.replace("material(", "region(line, block, 0.5, 1)\nmaterial(")
    twice += "solid(other, region, right, 2, rubber, 0.1)\nrun(-1)\n"
    said = run_interpreted(twice, status=1).err
    assert "region: ID 'line' is already used (line 4)" in said and "'right'" not in said
    assert said.count("error: ") == 1


def test_calculations_need_no_run(run_script):
    assert run_script("a = 3\nprint(a)\n").err == ""


def test_who_builds_no_scene_does_not_wait_for_it():
    """Numba takes half a second to begin: not in what starts processes, or says its version."""
    text = "import sys, karamelo_py.app.cli as cli; cli.main(sys.argv[1:]); print(*sys.modules)"
    words = [sys.executable, "-c", text, "--version"]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert "karamelo-py" in said and "karamelo_py.app.launch" in said.split()
    assert "numba" not in said.split()


STARTED = """
import gc, runpy, sys
sys.argv = ["karamelo-py", "in.script"]
try:
    {}
except SystemExit:
    pass
print(gc.isenabled(), gc.get_freeze_count() > 100_000)
"""


@pytest.mark.parametrize("module", ["start", "cli", None])
def test_modules_are_not_searched_for_what_to_throw_away(tmp_path, module):
    """A program that was started looks for cycles among what is new; a host is let alone."""
    (tmp_path / "in.script").write_text("a = 3\nprint(a)\n")
    run = f'runpy.run_module("karamelo_py.app.{module}", run_name="__main__")'
    text = STARTED.format(run if module else "import karamelo_py.app.cli as cli; cli.main()")
    words = [sys.executable, "-c", text]
    said = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert "a = 3" in said
    assert said.splitlines()[-1] == f"True {module is not None}"


def test_an_unknown_subcommand(capsys):
    assert main(["chek", "x.in"]) == 1
    assert "did you mean 'karamelo-py check'?" in capsys.readouterr().err


def test_a_check_needs_no_folder_that_the_run_would_make(run_interpreted):
    words = "-out", "later", "-log", "b.csv"
    dumped = f"{BODY}dump(d, all, particle, 10, d.*.txt, x)\nrun(1)\n"
    checked = run_interpreted(dumped, *words, command="check")
    assert not (checked.folder / "later").exists()
    said = run_interpreted(dumped.replace("d.*", "none/d.*"), *words, command="check", status=1).err
    assert "the folder none does not exist" in said
    said = run_interpreted(dumped, "-out", "in.script", command="check", status=1).err
    assert "it is a file" in said


@pytest.mark.parametrize(
    ("option", "meant"), [("-o", "-out"), ("-l", "-log"), ("-res", "-restart")]
)
def test_options_are_not_shortened(capsys, option, meant):
    assert main(["run", "in.none", option, "x"]) == 1
    said = capsys.readouterr().err
    assert f"there is no option {option}\n" in said and f"did you mean {meant}" in said


SUBCOMMANDS = ("bench", "help", "styles", "check", "run", "sweep", "chart", "advise", "stability")


@pytest.mark.parametrize("subcommand", SUBCOMMANDS)
def test_help_of_subcommands(subcommand, capsys):
    assert main([subcommand, "-h"]) == 0
    explained = capsys.readouterr().out
    assert f"karamelo-py {subcommand} " in explained
    assert main(["help", subcommand]) == 0
    command_of_scripts = subcommand == "run"
    assert (capsys.readouterr().out == explained) is not command_of_scripts


def test_help_finds_options_of_runs(capsys):
    assert main(["help", "gpu"]) == 0
    assert "--gpu" in capsys.readouterr().out


def test_help_of_bench_lists_what_it_measures(capsys):
    assert main(["bench", "--help"]) == 0
    explained = capsys.readouterr().out
    for name, workload in WORKLOADS.items():
        assert f"  {name} " in explained and workload.title in explained


@pytest.mark.parametrize("option", ["-var", "--var", "-v"])
def test_variables(run_script, option):
    assert "a = 4" in run_script("a = 3\nprint(a)\n", option, "a", "4").out


def test_a_text_in_the_place_of_a_number_is_told_once(run_script):
    script = "n = 3\nm = n + 1\nk = 2*n\nj = o + 1\n"
    said = run_script(script, "-var", "n", "ten", status=1).err
    assert said.count("'ten' is text") == 1
    assert "unknown name 'o'" in said  # which is another mistake


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("dimension(2, 0, 1, 0, 1, h)", "hint: h comes from -var L 2, -var N -5\n"),
        ("dimension(2, 0, 1, 0, N, 0.1)", "hint: N comes from -var N -5\n"),
        ("dimension(2, 0, 1, 0, 1, k)", None),
        # Found before the run, in a rehearsal of what follows it.
        (f"{block(2, 'run(1)')}set_dt(h)", "hint: h comes from -var L 2, -var N -5\n"),
        ("dimension(2, 0, 1, 0, 1, -1)  # h", None),
    ],
)
def test_mistakes_of_variables(run_interpreted, line, says):
    """What is marked is of the script; the number is of the command line."""
    script = f"L = 1\nN = 10\nh = L/N\nk = h\nk = -1\nw = N*1\nprint(w)\n{line}\n"
    said = run_interpreted(script, "-var", "N", "-5", "-var", "L", "2", status=1).err
    assert (says or "error: dimension: ") in said
    assert ("comes from" in said) == bool(says)


def test_a_number_that_a_transfer_does_not_take_is_taken_away(run_interpreted):
    """As docs/script.md has it."""
    script = 'transfer = "FLIP"\nalpha = 1\nmethod(ulmpm, transfer, linear, alpha)\n'
    chosen = "-var", "transfer", "APIC"
    hint = "hint: -var alpha mechanical removes it"
    assert hint in run_interpreted(script, *chosen, status=1).err
    assert "error" not in run_interpreted(script, *chosen, "-var", "alpha", "mechanical").err


def test_threads_that_are_not_there_are_told_of_the_option(run_interpreted):
    err = run_interpreted(block(2, "run(1)"), "--threads", "10000").err
    assert err.startswith("warning: --threads 10000: only ")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("in.a --thread 2", "there is no option --thread\n"),
        ("in.a --thread 2", "did you mean --threads?"),
        ("in.a --treads=2", "did you mean --threads?"),
        ("sweep in.a -var n=1,2 --job 2", "did you mean -jobs?"),
        ("in.a -var n=10", "hint: -var n 10"),
        ("in.a -var n 5*", "-var n:1:2: error: the expression ends after '*'"),
        ("in.a -var n 10 -v n 20", "-var n is given twice, 10 and 20"),
        ("in.a -var n ten", "-var n ten is a text, but the script has a number"),
        ("in.a -np 4", "did you mean --ranks N?"),
        ("in.a -j4", "did you mean --threads N?"),
        ("in.a --threads abc", "1, 2, ... or auto)\nexpected: --threads N\n"),
        ("in.a --ranks -1", "'-1' is not a whole number of at least 1\nexpected: --ranks N\n"),
        ("in.a --quiet=3", "'3'\nexpected: --quiet\n"),
        ("in.a -var E", "-var: expected 2 arguments\nexpected: -var NAME VALUE\n"),
        ("in.a -out in.b", "cannot write to in.b: it is a file\n"),
        ("in.a in.b", "unexpected word: in.b"),
        ("in.a --ranks 100000", "--ranks 100000: this machine has"),
        ("check", "expected: karamelo-py check SCRIPT"),
        ("run", "expected: karamelo-py SCRIPT"),
        ("in.a -out in.b/x", "hint: -out x is a folder in this one"),
        ("in.aa", "did you mean in.a?"),
        ("sweep in.aa -var n=1", "did you mean in.a?"),
        ("sweep in.abxyaa -var n=1", "expected: the name of a script\n"),
        ("in.a -treads 1", "hint: did you mean --threads?"),
        ("in.a -speed 1", "hint: -var speed 1 sets a variable"),
        ("advise in.a -accuracy e -targt 1", "hint: did you mean -target?"),
        ("view p.dump --slice 1", "hint: did you mean --only?"),
        ("help hepl", "hint: did you mean 'help'?"),
        ("view q.*.txt", "no file matches q.*.txt"),
        ("plot Ek", "hint: karamelo-py plot log.mpm Ek"),
        ("plot log.mpm E", "did you mean 'Es' or 'Ek'?"),
        ("chart runs.csv", "hint: karamelo-py chart runs.csv -accuracy error -o chart.png"),
        ("plot . Ez", "one of Step, Time, Ek, Es"),
        ("view .", "hint: view './*.dump', or view --live .\n"),
        ("live in.a", "did you mean 'karamelo-py SCRIPT --live'?"),
        ("help vonmises", "hint: the column seq of dumps and pictures"),
        ("in.a -restart r.2.h5 r.10.h5 r.7.h5", "there is no file r.10.h5"),
        ("in.a -restart r.2.h5 in.b", "unexpected word: in.b"),
        ("in.a -in in.b", "two scripts: in.a and in.b"),
    ],
)  # fmt: skip
def test_what_a_slip_of_the_pen_says(tmp_path, monkeypatch, capsys, words, says):
    """Options and names that are nearly right; pictures are no scripts."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.a").write_text("n = 3\nprint(n + 1)\n")
    (tmp_path / "in.b").write_text("print(1)\n")
    (tmp_path / "in.aa.png").write_text("a picture")
    (tmp_path / "log.mpm").write_text("Step Time Ek Es\n0 0 1 2\n")
    assert main(words.split()) == 1
    assert says in capsys.readouterr().err


def test_nobody_reads_what_is_written():
    """As with ``karamelo-py help run | true``: no word of it."""
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "karamelo_py.app.cli", "help", "run"]
    ended = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, check=False)
    os.close(write)
    assert (ended.returncode, ended.stderr) == (1, b"")
