"""The chart of docs/field.md: its table is that of the data."""

from math import log
from pathlib import Path

import numpy as np
import pytest

from comparisons import field

PAGE = Path(__file__).parent.parent / "docs" / "field.md"


def test_table_is_of_the_data():
    """At equal cost, usual set-ups err by more than four times as much as all, over 12 scenes."""
    text, gains = PAGE.read_text("utf-8"), []
    for name, found in field.by_scene().items():
        line, gain = field.row(name, found, "cost")
        assert line in text
        gains.append(gain)
    assert len(gains) == 12
    assert f"{np.exp(np.mean(gains)):.1f} times the error" in text
    assert np.mean(gains) > log(4)


def test_least_error_at_a_cost():
    """A line between two runs in logarithms; nothing before the cheapest run."""
    runs = [{"cost": 10.0, "error": 0.1}, {"cost": 1000.0, "error": 0.001}]
    found = field.least(np.array([1.0, 100.0, 1e4]), [runs], "cost")
    assert found == pytest.approx([np.inf, 0.01, 0.001])
