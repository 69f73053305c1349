"""The same body by 1D, axisymmetric, quarter and full models (inputs/models)."""

import pytest
from conftest import INPUTS

from comparisons.lesser import ROWS

MODELS = INPUTS / "models"


def last(run, script, column, model, *words):
    """The last value of a log column of a model."""
    result = run(MODELS / f"in.{script}", "-var", "model", model, *words, folder=model)
    return result.log[column][-1]


def test_a_ring_by_three_models(run_script, run_interpreted):
    """Lame 1852. On four cells the plane of radius and axis errs by less than 1 % of the
    displacement, the ring in the plane, whose inner surface is a staircase, by a fifth. The line
    has the same error as the plane of radius and axis, to the digits of the log."""
    words = ("-var", "refine", "0.5")
    error = last(run_script, "lame", "err", "axisymmetric", *words)
    assert error < 0.01
    line = last(run_interpreted, "lame", "err", "cylindrical", *words)
    assert line == pytest.approx(error, rel=1e-8)
    assert 0.1 < last(run_script, "lame", "err", "quarter", *words) < 0.25


def test_a_shell_on_a_line(run_interpreted):
    """Lame 1852, on four cells. The staircases of the other models err by ten times as much."""
    assert last(run_interpreted, "shell", "err", "spherical", "-var", "refine", "0.5") < 0.025


@pytest.mark.full
def test_a_shell_by_three_models(run_script):
    """Eight cells: the line errs by 0.6 %, the plane and an eighth of the shell by a fifth."""
    models = ("spherical", "axisymmetric", "eighth")
    line, plane, eighth = (last(run_script, "shell", "err", model) for model in models)
    assert line < 0.006 and 0.15 < eighth < plane < 0.22


@pytest.mark.full
def test_symmetry_costs_nothing(run_script):
    """A quarter of the ring has the error of the whole.

    The last digits differ with FLIP 0.99: rollers damp the noise in the velocities of points next
    to them (`test_walls.py`), and a symmetry plane inside the body does not.
    """
    quarter, full = (last(run_script, "lame", "err", model) for model in ("quarter", "full"))
    assert quarter == pytest.approx(full, rel=2e-3)


@pytest.mark.full
def test_the_taylor_bar_by_three_models(run_script):
    """Lengths and feet of the models agree within 1 %; the quarter is the whole, to all digits."""
    found = {
        name: [last(run_script, "taylor", name, m) for m in ("axisymmetric", "quarter", "full")]
        for name in ("length", "diameter")
    }
    ring, quarter, full = found["length"]
    assert quarter == pytest.approx(full, rel=1e-8)
    assert full == pytest.approx(ring, rel=0.01)
    ring, quarter, full = found["diameter"]
    assert quarter == pytest.approx(full, rel=1e-8)
    assert full == pytest.approx(ring, rel=0.01)


# Waves in a bar and along fibres, and fibres at an angle; the others are alike.
QUICK = "bar", "along", "lamina 30"


def found(run, name, twins, variables):
    words = [part for key, value in variables.items() for part in ("-var", key, str(value))]
    folder = name.replace(" ", "_")
    return twins.measure(run(MODELS / f"in.{twins.script}", *words, folder=folder))


def agrees(value, twins):
    if not twins.exact:
        return abs(value) < twins.within
    return value == pytest.approx(twins.exact, rel=twins.within)


@pytest.mark.parametrize("name", QUICK)
def test_a_lesser_model_has_the_exact_answer(run_interpreted, name):
    """The sources are in comparisons/lesser.py and the scenes."""
    twins = ROWS[name]
    assert agrees(found(run_interpreted, name, twins, twins.lesser), twins)


@pytest.mark.full
@pytest.mark.parametrize("name", sorted(set(ROWS) - set(QUICK)))
def test_every_lesser_model_has_the_exact_answer(run_script, name):
    twins = ROWS[name]
    assert agrees(found(run_script, name, twins, twins.lesser), twins)
