"""The command line: what it says when it is not used as meant."""

import pytest


@pytest.mark.parametrize("script", ["", "# nothing\n", "dimension(1, 0, 1, 0.1)\n"])
def test_a_script_without_a_run_says_so(run_script, script):
    assert "warning: in.script runs nothing" in run_script(script).err.replace(
        str(run_script(script).folder) + "/", ""
    )


def test_calculations_need_no_run(run_script):
    assert run_script("a = 3\nprint(a)\n").err == ""
