"""Averaged volumes (F-bar) in implicit steps: exact derivatives, and no locking."""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from karamelo_py.run.implicit.newton import Newton

INPUTS = Path(__file__).parent.parent / "inputs"
BLOCK = """
    kind = "ulmpm"
    method(kind, FLIP, linear, 1)
    scheme({scheme})
    anti_volumetric_locking({averaged})
    dimension(2, 0, 1.25, 0, 1.25, 0.25)
    axisymmetric({axis})
    region(box, block, 0, 1, 0, 1)
    material(m, neo-hookean, 1, 1000, 0.499)
    solid(s, region, box, 2, m, 0.25, 0)
    region(left, block, -INF, 0, -INF, INF)
    region(floor, block, -INF, INF, -INF, 0)
    region(top, block, -INF, INF, 1, INF)
    group(left, nodes, region, left, all)
    group(floor, nodes, region, floor, all)
    group(top, nodes, region, top, all)
    fix(left, velocity_nodes, left, 0, NULL)
    fix(floor, velocity_nodes, floor, 0, 0)
    fix(press, velocity_nodes, top, 0, -0.02)
    set_dt(1)
    set_output(1)
    log_modify(custom, step, iterations, residual, press_y)
    run(3)
"""


def block(averaged="true", axis="false", scheme="quasi-static") -> str:
    return BLOCK.format(averaged=averaged, axis=axis, scheme=scheme)


def coarse(text: str) -> str:
    """The block of four cells, to be interpreted."""
    return text.replace("1.25", "1.5").replace("0.25", "0.5")


@pytest.mark.parametrize(
    ("axis", "kind"),
    [("false", "ulmpm"), pytest.param("true", "tlmpm", marks=pytest.mark.full)],
    ids=["plane", "axis"],
)
def test_derivatives_are_exact(run_script, monkeypatch, axis, kind):
    """Against central differences of the forces, whose error is of order h^2, in all directions."""
    errors = []
    correction, balance = Newton._correction, Newton.balance

    def noting(self, u):
        self.at = u.copy()
        return balance(self, u)

    def compared(self, left, jump, residual):
        equations = self.equations
        equations.linearise(self.dt)
        du = np.random.default_rng(1).standard_normal(jump.shape)
        h = 1e-6 * self.spacing
        forward, back = (equations.respond(self.at + h * s * du, self.dt) for s in (1, -1))
        exact = (equations.whole @ du.ravel()).reshape(du.shape)
        errors.append(np.abs((forward - back) / (2 * h) - exact).max() / np.abs(exact).max())
        equations.respond(self.at, self.dt)
        return correction(self, left, jump, residual)

    monkeypatch.setattr(Newton, "balance", noting)
    monkeypatch.setattr(Newton, "_correction", compared)
    run_script(block(axis=axis), "-var", "kind", kind)
    assert len(errors) > 6 and max(errors) < 1e-7


@pytest.mark.parametrize(
    ("scheme", "axis"), [("quasi-static", "false"), ("newmark", "false"), ("quasi-static", "true")]
)
def test_nearly_incompressible(run_interpreted, scheme, axis):
    """Newton's method squares the error; the block yields to a fraction of the force."""
    kind = "-var", "kind", "ulmpm" if axis == "false" else "tlmpm"
    log_of = run_interpreted(coarse(block(axis=axis, scheme=scheme)), *kind).log
    assert max(log_of["iterations"]) <= 4 and max(log_of["residual"]) < 1e-10
    locked = coarse(block("false", axis, scheme))
    locked = run_interpreted(locked, *kind, folder="locked").log
    assert abs(log_of["press_y"][-1]) < 0.7 * abs(locked["press_y"][-1])


@pytest.mark.full
def test_a_footing_does_not_lock(run_script):
    """(2 + pi) c (Prandtl 1920): 6.3 and rising with linear functions that lock.

    The largest load, within 5 %, is that of comparisons/static_footing.py, too.
    """
    words = ("-var", "basis", "linear", "-var", "bar", "true")
    words += ("-var", "steps", "15", "-var", "v", "0.03")
    load = run_script(INPUTS / "in.static_footing", *words).log["load"]
    assert max(load) == pytest.approx(2 + pi, rel=0.04)
    assert load[-1] < 1.01 * max(load[:-3])  # a plateau


def test_laws_of_logarithms_run_interpreted(run_interpreted):
    """What numbers with slopes implement is found there, too."""
    text = block().replace("neo-hookean", "hencky").replace("run(3)", "run(1)")
    log_of = run_interpreted(coarse(text)).log
    assert log_of["residual"][-1] < 1e-10 and log_of["press_y"][-1] < 0
