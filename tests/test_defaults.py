"""What the defaults do: each case is right, or is told (docs/defaults.md)."""

import pytest

from comparisons import defaults


@pytest.mark.parametrize("name", defaults.names())
def test_script_is_whole(run_interpreted, name):
    """The scene can be built, and logs what its case measures."""
    case = defaults.case(name)
    result = run_interpreted(defaults.INPUTS / f"in.{name}", command="check")
    assert "first step" in result.out or "dt" in result.out
    assert case.exact == case.exact and case.within > 0


@pytest.mark.full
@pytest.mark.parametrize("name", defaults.names())
def test_default_is_right_or_told(tmp_path, name):
    """The error of the finest run is within its share, or a warning has the word of the case."""
    case = defaults.case(name)
    result = defaults.run(name, tmp_path, case.refine[-1])
    assert result.status == 0 or case.advice
    told = case.advice and any(case.advice in line for line in defaults.said(result))
    assert told or abs(case.error(case.measure(result))) <= case.within
