"""plot and save_plot: what is collected and that it is drawn."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fakes import FakeHub

from karamelo_py.output.plots import PlottedCurve
from karamelo_py.output.quantity import Quantity
from karamelo_py.output.units import ENERGY, Units


@pytest.fixture
def hub(tmp_path):
    hub = FakeHub(tmp_path)
    hub.output.log.every = 1000
    add(hub, "Ek", 2, "time", "Ek_s")
    return hub


def add(hub, ID, every, x, y):
    hub.output.plots.add(ID, PlottedCurve(every, Quantity(hub, x), Quantity(hub, y)))


def test_points_of_both_runs_are_collected_once(hub):
    hub.run(5)
    hub.run(2)
    (curve,) = hub.output.plots.values()
    time, energy = np.array(curve.points).T
    np.testing.assert_allclose(time, [0, 0.2, 0.4, 0.5, 0.6, 0.7])
    np.testing.assert_allclose(energy, np.cos(time) ** 2)


def test_without_a_file_nothing_is_drawn(hub):
    hub.run(5)
    assert [p.name for p in hub.folder.iterdir()] == ["log.mpm"]


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_is_drawn_at_the_end_of_a_run(hub, ending):
    hub.output.plots.file = Path(f"energies.{ending}")
    add(hub, "Es", 2, "time", "Es_s")
    add(hub, "phase", 3, "Es_s", "Ek_s")
    hub.run(5)
    first = (hub.folder / f"energies.{ending}").read_bytes()
    assert len(first) > 1000
    if ending == "svg":
        # Text is drawn as shapes with the text in a comment.
        for word in ("<!-- Ek -->", "<!-- Es -->", "<!-- time -->", "<!-- Ek_s, Es_s -->"):
            assert word.encode() in first
    hub.run(5)
    assert (hub.folder / f"energies.{ending}").read_bytes() != first


def test_two_axes_and_units(hub):
    """A curve over a logarithmic axis at the right, and units of what a compute publishes."""
    hub.output.plots.file = Path("energies.svg")
    hub.output.units = Units("mm", "g", "ms")
    hub.computes["Ek"] = SimpleNamespace(unit=ENERGY, published=("s",))
    quantities = Quantity(hub, "time"), Quantity(hub, "Es_s")
    axis = {"side": "right", "scale": "log", "label": "stored (mJ)"}
    hub.output.plots.add("stored", PlottedCurve(1, *quantities, **axis))
    hub.run(5)
    svg = (hub.folder / "energies.svg").read_text()
    for word in ("time (ms)", "Ek_s (mJ)", "stored (mJ)", "Ek", "stored (right)"):
        assert f"<!-- {word} -->" in svg
    # Powers of ten are written as formulas.
    assert re.search(r"<!-- \$\\mathdefault\{10\^\{", svg)


def test_is_drawn_when_a_run_breaks_off(hub):
    hub.output.plots.file = Path("energies.png")
    hub.output.begin()
    hub.output.abort()
    assert (hub.folder / "energies.png").exists()
