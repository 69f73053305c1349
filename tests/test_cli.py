"""The command line: what it says when it is not used as meant."""

import pytest

from karamelo_py.app.bench.workloads import WORKLOADS
from karamelo_py.app.cli import main


@pytest.mark.parametrize("script", ["", "# nothing\n", "dimension(1, 0, 1, 0.1)\n"])
def test_a_script_without_a_run_says_so(run_script, script):
    assert "warning: in.script runs nothing" in run_script(script).err.replace(
        str(run_script(script).folder) + "/", ""
    )


def test_calculations_need_no_run(run_script):
    assert run_script("a = 3\nprint(a)\n").err == ""


def test_an_unknown_subcommand(capsys):
    assert main(["chek", "x.in"]) == 1
    assert "did you mean 'karamelo-py check'?" in capsys.readouterr().err


SUBCOMMANDS = ("bench", "help", "styles", "check", "run", "sweep", "chart", "advise", "stability")


@pytest.mark.parametrize("subcommand", SUBCOMMANDS)
def test_help_of_subcommands(subcommand, capsys):
    assert main([subcommand, "-h"]) == 0
    explained = capsys.readouterr().out
    assert f"karamelo-py {subcommand} " in explained
    assert main(["help", subcommand]) == 0
    command_of_scripts = subcommand == "run"
    assert (capsys.readouterr().out == explained) is not command_of_scripts


def test_help_of_bench_lists_what_it_measures(capsys):
    assert main(["bench", "--help"]) == 0
    explained = capsys.readouterr().out
    for name, workload in WORKLOADS.items():
        assert f"  {name} " in explained and workload.title in explained


@pytest.mark.parametrize("option", ["-var", "--var", "-v"])
def test_variables(run_script, option):
    assert "a = 4" in run_script("a = 3\nprint(a)\n", option, "a", "4").out
