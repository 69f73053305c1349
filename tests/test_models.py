"""The same body by axisymmetric, quarter and full models (inputs/models)."""

import pytest
from conftest import INPUTS

MODELS = INPUTS / "models"


def last(run, script, column, model, *words):
    """The last value of a log column of a model."""
    result = run(MODELS / f"in.{script}", "-var", "model", model, *words, folder=model)
    return result.log[column][-1]


def test_a_ring_by_two_models(run_script):
    """Lame 1852. On four cells the plane of radius and axis errs by less than 1 % of the
    displacement, the ring in the plane, whose inner surface is a staircase, by a fifth."""
    words = ("-var", "refine", "0.5")
    assert last(run_script, "lame", "err", "axisymmetric", *words) < 0.01
    assert 0.1 < last(run_script, "lame", "err", "quarter", *words) < 0.25


@pytest.mark.full
def test_symmetry_costs_nothing(run_script):
    """The quarter and the whole ring have the same error, to the digits of the log."""
    quarter, full = (last(run_script, "lame", "err", model) for model in ("quarter", "full"))
    assert quarter == pytest.approx(full, rel=1e-6)


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
