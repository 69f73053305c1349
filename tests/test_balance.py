"""Balances of energy and momentum of the scenes of inputs/ (docs/balance.md)."""

import os
import subprocess
import sys

import pytest
from conftest import INPUTS

from comparisons import balance

HEAVY = """
method(ulmpm/contacts, FLIP, linear, 1)
dimension(2, 0, 3, 0, 1.5, 0.5)
region(block, block, 1, 2, 0.5, 1)
region(base, block, 0, 3, 0, 0.5)
material(rubber, linear, 1, 100, 0.3)
material(rock, rigid, 1)
solid(block, region, block, 2, rubber, 0.5)
solid(base, region, base, 1, rock, 0.5)
group(block, particles, region, block, solid, block)
fix(rub, contact/friction, block, base, 0.3)
fix(g, body_force, all, 0, -1)
fix(v, initial_velocity_particles, block, 0.5, 0)
run(32)
"""


INTERPRETED = """
import sys
from pathlib import Path
from comparisons.balance import measure
print(*measure(Path(sys.argv[1]))[:3])
"""


def test_a_block_on_a_base(tmp_path, starts_are_cheap):
    """Weight, contact and friction give it all its momentum and energy."""
    script = tmp_path / "in.scene"
    script.write_text(HEAVY, encoding="utf-8")
    run = subprocess.run(
        [sys.executable, "-c", INTERPRETED, str(script)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    steps, energy, momentum = map(float, run.stdout.split())
    assert steps == 32 and momentum < 1e-9 and abs(energy) < 2


@pytest.mark.full
@pytest.mark.parametrize("name", sorted(path.name for path in INPUTS.glob("in.*")))
def test_a_scene_closes_or_says_why(name):
    if name not in ("in.element", "in.ishigami"):  # without a step
        found = balance.measure(INPUTS / name)
        unknown = found.energy != found.energy or abs(found.energy) > balance.CLOSES
        assert found.why or not unknown
        assert not found.momentum > balance.CLOSES
