"""Scenes of the papers that need kernels of their own, tiny and interpreted.

At full size they are compared in comparisons/ (``pytest -m full``, docs/comparison.md).
"""

import numpy as np
import pytest
from conftest import INPUTS

from comparisons.billet import energy, loads, sticking, uniform
from comparisons.elastic_gate import beam
from comparisons.plate_penetration import MASS, PRESSURE, V


def tiny(run_interpreted, scene, **variables):
    """Run inputs/in.`scene` interpreted with these variables."""
    options = [part for name, value in variables.items() for part in ("-var", name, str(value))]
    return run_interpreted(INPUTS / f"in.{scene}", *options)


def test_billet(run_interpreted):
    """The load lies between that of a cylinder and the bound with ends that stick."""
    log = tiny(run_interpreted, "billet_axisymmetric", refine="3/11", v=100, squeeze=0.1, ppc=1).log
    assert log.press[-1] == pytest.approx(0.1, rel=1e-6)
    press = 0.08
    # Inertia adds rho v^2, a tenth of the yield stress, and three cells in the radius swing.
    assert 0.9 < loads(log, press) / uniform(press) < 1.1 * sticking(press)
    # By the same tenth the platen pushes harder than the middle, whose reaction is the load.
    assert energy(log, 2 * np.pi) == pytest.approx(1, abs=0.2)
    # What is pressed away goes sideways: more in the middle than V/h asks for, less at the platen.
    assert 10 / np.sqrt(0.9) < log.radius[-1] < 1.1 * 10 / np.sqrt(0.9)


@pytest.mark.full
def test_cold_spray(run_script):
    """As a Taylor bar and sheared metal do (test_comparisons.py).

    All energy is kinetic, stored or spent; the ball is flattened, warm, and stops.
    """
    result = tiny(run_script, "cold_spray_axisymmetric", refine=0.3, ppc=1, T=16e-9)
    log = result.log
    total = log.kinetic + log.spent + log.stored
    # FLIP 0.99 takes a hundredth of what differs between points and grid in each step.
    assert 0.88 < total[-1] / total[0] < 1.02
    assert log.kinetic[-1] < 0.75 * log.kinetic[0]
    assert log.drift_y[-1] > -420
    assert 310 < log.flat_Tmax[-1] < 600
    # Adiabatic: cp times the rise is 0.9 of the plastic work; viscous work makes no heat.
    last = result.snapshots("cold_spray_axisymmetric")[-1]
    heat = 2 * np.pi * 1e9 * (last.mass * 385 * (last["T"] - 298)).sum()
    assert 0.7 * 0.9 < heat / log.spent[-1] < 0.9


@pytest.mark.full
def test_machining(run_script):
    """The tool pushes the piece back, by no more than Merchant's force of what has hardened."""
    log = tiny(run_script, "machining", refine=1 / 20, T=1e-6).log
    assert -6 < log.force.min() < -0.3
    work = np.trapezoid(-log.force * 1e9 * 0.15e-3 * 50, log.Time)
    assert (log.Ek + log.Es + log.lost)[-1] == pytest.approx(work, rel=0.15)


def test_plate_penetration(run_interpreted):
    """Momentum stays, energy too; behind the shock there is its pressure, by order of magnitude."""
    log = tiny(run_interpreted, "plate_penetration", refine=1 / 6, T=1.2e-6).log
    assert -log.P_z == pytest.approx(MASS * V, rel=0.05)
    assert log.P_z[-1] == pytest.approx(log.P_z[0], rel=1e-6)
    total = log.Ek + log.Es + log.lost
    # The plate is thinner than a cell.
    assert total[-1] == pytest.approx(total[0], rel=0.15)
    assert 0.2 * PRESSURE < log.p.max() < 1.5 * PRESSURE


@pytest.mark.full
def test_elastic_gate(run_script):
    """Water begins to push its gate open, and not faster than its weight allows."""
    # The sum by hand: 598 Pa and 775 Pa on 79 mm, E I = 12.4 N m.
    assert beam(1e9) == pytest.approx(0.459, rel=0.01)
    log = tiny(run_script, "elastic_gate", refine=1 / 2, ppc=1, T=4e-4, E=12e6).log
    # The pressure at its end alone, without the water that has to move with it.
    fastest = 1000 * 9.81 * 0.14 / (1100 * 5e-3)
    assert 0.02 < log.ux[-1] / (1000 * fastest * 4e-4**2 / 2) < 1
    assert log.Ek[-1] > 0 and np.all(np.isfinite(log.clamp_x))
