"""The command line: what it says when it is not used as meant."""

import pytest

from karamelo_py.cli import main


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


@pytest.mark.parametrize("subcommand", ["bench", "help", "styles", "check"])
def test_help_of_subcommands(subcommand, capsys):
    assert main([subcommand, "-h"]) == 0
    assert "karamelo-py bench" in capsys.readouterr().out
