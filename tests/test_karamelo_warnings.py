"""What may be meant, and is said: temperatures, plots of nothing, numbers that are none."""

import pytest
from scenes import block

WARM = "\n".join([
    "eos(e, linear, 2, 100)", "strength(s, johnson_cook, 40, 1, 1, 0.5, 1, 0, 1, 300, 1000)",
    "temperature(t, plastic_work, 0.9, 1, 0, 0, 300, 1000)",
    "material(rubber, eos-strength, e, s, t)",
])  # fmt: skip


@pytest.mark.parametrize(
    ("T0", "says"),
    [
        ("-20", "T0 = -20 is below absolute zero"),
        ("1000", "T0 = 1000 is not below the melting temperature 1000"),
        ("300", None),
        ("0", None),
    ],
)
def test_temperatures_of_solids(run_interpreted, T0, says):
    text = block(2, "quit").replace("material(rubber, linear, 2, 100, 0.3)", WARM)
    err = run_interpreted(text.replace("rubber, 0.1, 0)", f"rubber, 0.1, {T0})")).err
    assert (says or "T0 =") in err if says else "T0 =" not in err


def test_a_law_without_temperature_has_no_opinion(run_interpreted):
    """Scripts of Karamelo give T0 in mechanical runs, too."""
    text = block(2, "quit").replace("rubber, 0.1, 0)", "rubber, 0.1, -20)")
    assert "T0" not in run_interpreted(text).err


def test_a_plot_of_nothing(run_interpreted):
    result = run_interpreted(block(2, "save_plot(p.png)", "set_dt(0.001)", "run(1)"))
    assert "in.script:7:1: warning: p.png will not be drawn: there is nothing to plot" in result.err


def test_a_number_that_is_none_is_told_of_once(run_interpreted):
    result = run_interpreted(
        block(
            2, "a = 0*time/time", "b = sqrt(0.0015 - time)", "log_modify(custom, step, a, b)",
            "set_dt(0.001)", "run(4)",
        )
    )  # fmt: skip
    assert result.err.count("a is NaN, which is not a number, from step 0 on") == 1
    assert result.err.count("b is NaN, which is not a number, from step 2 on") == 1
