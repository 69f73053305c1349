"""Every scene that has a published number meets it, at a small size (``-m full``: at its own)."""

import matplotlib.pyplot as plt
import pytest
from verification import run_scene

from comparisons.__main__ import scene, scenes
from comparisons.row import Row


def found(run_script, name: str, full: bool) -> list[Row]:
    """The rows of a scene, run in this process."""
    comparison = scene(name)
    size = {} if full else comparison.SMALL

    def run(scene=name, **variables):
        return run_scene(run_script, scene, None, **{**size, **variables})

    figure, axes = plt.subplots()
    rows = list(comparison.compare(run, axes, full))
    plt.close(figure)
    return rows


# Scenes that share compiled loops with each other or with other tests.
SHARED = {
    "two_disks": "disks", "axis_aligned": "neo-hookean", "vibrating_bar": "bar",
    "incline": "contact", "hertz": "contact", "collapse": "soil", "slump": "soil",
    "dam_break": "water", "dam_ritter": "water",
}  # fmt: skip
SMALL = [
    pytest.param(name, marks=pytest.mark.xdist_group(SHARED.get(name, name)))
    for name in scenes()
    if scene(name).SMALL is not None
]


@pytest.mark.parametrize("name", SMALL)
def test_scene(run_script, name):
    """Each row says what is allowed."""
    rows = found(run_script, name, full=False)
    assert rows
    assert not [row for row in rows if not row.agrees]


@pytest.mark.full
@pytest.mark.parametrize("name", scenes())
def test_scene_full(run_script, name):
    """At the published size."""
    assert not [row for row in found(run_script, name, full=True) if not row.agrees]


def test_differences():
    """Differences are relative, to the nearer end of a range, absolute where zero is published."""
    assert Row("", 2.0, 2.1, 0.06, "").agrees
    assert not Row("", 2.0, 2.1, 0.04, "").agrees
    assert Row("", (2.0, 3.0), 2.7, 0.0, "").agrees
    assert Row("", (2.0, 3.0), 3.3, 0.2, "").difference == pytest.approx(0.1)
    assert Row("", 0.0, 0.01, 0.02, "").agrees
    assert not Row("", 1.0, float("nan"), 1e9, "").agrees
