"""Damage: failure strain as published, D to 1 and beyond, and what is left of the stress."""

from math import exp, log

import numpy as np
import pytest
from laws import TURN, isochoric, pressure_of, start, stress, stretched, worked
from tensors import every_kinematics, symmetric_flat

from karamelo_py.compiler.tuples import flat
from karamelo_py.points.kinematics import Axisymmetric, Space
from karamelo_py.points.laws import (
    damage,
    damage_initiation,
    dissipated_energy,
    elastic_strain,
    energy_density,
    plastic_strain,
    temperature,
    wave_speed_squared,
    with_stress,
    with_temperature,
)
from karamelo_py.points.laws.damages import JohnsonCookDamage
from karamelo_py.points.laws.eos import LinearPressure
from karamelo_py.points.laws.eos.shock import Shock
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.strengths.hardening import Plastic
from karamelo_py.points.laws.strengths.metals import JohnsonCookConstants
from karamelo_py.points.laws.temperatures import PlasticWork

K, G, Y = 160.0, 80.0, 0.4
D1, D2, D3, D4, D5, TR, TM = 0.05, 0.8, -1.5, 0.02, 0.6, 300.0, 1300.0
WEAR = JohnsonCookDamage(D1, D2, D3, D4, D5, 1.0, TR, TM)
HEAT = PlasticWork(0.0, 0.5, 0.0, 0.0, TR, TM)
INTACT = EosStrength(LinearPressure(0.125, K), Plastic(G, Y))
BREAKING = INTACT._replace(damage=WEAR)
COOK = JohnsonCookConstants(G, 0.4, 0.3, 0.3, 1.0, 0.05, 1.1, TR, TM).checked()
ALL_PARTS = EosStrength(
    Shock(0.125, K, 1.5, 0.05, TR), COOK, damage=WEAR, temperature=HEAT._replace(chi=0.9)
)


@pytest.mark.parametrize("mean", [-0.6, 0.0, 0.4])
def test_failure_strain(mean):
    """w = ep / (d1 + d2 exp(d3 t)) at a triaxiality t that stays, at low rates and Tr."""
    kin = Axisymmetric()
    state = with_stress(BREAKING, kin, start(BREAKING, kin), (mean, mean, mean, 0.0))
    state = stretched(BREAKING, kin, state, isochoric(1e-4), 400, 1.0)
    ep, w = plastic_strain(BREAKING, kin, state), damage_initiation(BREAKING, kin, state)
    assert 0 < w < 1 and damage(BREAKING, kin, state) == 0
    t = -pressure_of(BREAKING, kin, state) / (Y + 1e-3 * abs(mean))
    # The increments of isochoric strain shrink the volume by some 3/4 e^2 each.
    assert t == pytest.approx(mean / Y, abs=1e-2)
    assert w == pytest.approx(ep / (D1 + D2 * exp(D3 * t)), rel=5e-3)


@pytest.mark.parametrize("rate", [0.1, 1.0, 50.0])
def test_rate_and_temperature(rate):
    """(1 + d4 ln(rate)), 1 at and below the reference rate, and (1 + d5 T*)."""
    kin, law = Axisymmetric(), BREAKING._replace(temperature=HEAT)
    state = with_temperature(law, kin, start(law, kin), 800.0)
    state = stretched(law, kin, state, isochoric(Y / (3 * G)), 1)  # to yield
    assert damage_initiation(law, kin, state) == pytest.approx(0, abs=1e-12)
    before = plastic_strain(law, kin, state)
    state = stretched(law, kin, state, isochoric(1e-3), 1, 1e-3 / rate)
    ep = plastic_strain(law, kin, state) - before
    t = -pressure_of(law, kin, state) / Y
    failure = (D1 + D2 * exp(D3 * t)) * (1 + D4 * log(max(rate, 1))) * (1 + D5 / 2)
    assert damage_initiation(law, kin, state) == pytest.approx(ep / failure, rel=1e-3)


@every_kinematics
@pytest.mark.parametrize("law", [BREAKING, ALL_PARTS], ids=["plastic", "all parts"])
@pytest.mark.parametrize("e", [2e-3, 0.3])
def test_tension_to_the_end(law, kin, e):
    """D goes to 1 and stays, the stress to 0, without NaN, in small and in large increments."""
    state, last = start(law, kin), 0.0
    for _ in range(300 if e < 0.1 else 12):
        state = stretched(law, kin, state, np.diag([e, 0, 0]), 1, 1e-3)
        assert np.all(np.isfinite(flat(state)))
        now = damage(law, kin, state)
        assert last <= now <= 1
        last = now
    assert last == 1
    assert stress(law, kin, state) == pytest.approx(np.zeros((3, 3)), abs=1e-14)
    assert energy_density(law, kin, state) == pytest.approx(0, abs=1e-14)
    assert np.all(np.isfinite(tuple(elastic_strain(law, kin, state))))
    # Torn far apart, it counts with the waves of rubble at its first volume.
    K_at_first = wave_speed_squared(law, kin, start(law, kin))
    assert 0 < wave_speed_squared(law, kin, state) < K_at_first
    # Rubble bears pressure, and nothing else.
    closed = stretched(law, kin, state, np.diag([0.6 / state.J - 1, 0, 0]), 1, 1.0)
    full = stress(law, kin, closed)
    assert pressure_of(law, kin, closed) > 0.3 * K
    assert full == pytest.approx(full[0, 0] * np.eye(3), rel=1e-12)


def test_the_share_of_damage_is_taken_once():
    """Half way: stress is 1 - D times that of the same history without damage; heat likewise."""
    kin = Axisymmetric()
    heat = HEAT._replace(chi=0.9)
    law, intact = BREAKING._replace(temperature=heat), INTACT._replace(temperature=heat)
    state = start(law, kin)
    same = start(intact, kin)
    loading = np.diag([0.0005, -0.0002, -0.0002])
    while damage(law, kin, state) < 0.4:
        warmth = temperature(law, kin, state)
        begin = 1 - damage(law, kin, state)
        known = temperature(intact, kin, same)
        state = stretched(law, kin, state, loading, 1)
        same = stretched(intact, kin, same, loading, 1)
    D = damage(law, kin, state)
    assert 0.4 < D < 0.6
    assert stress(law, kin, state) == pytest.approx((1 - D) * stress(intact, kin, same), rel=1e-12)
    stored = energy_density(law, kin, state)
    assert stored == pytest.approx((1 - D) * energy_density(intact, kin, same), rel=1e-12)
    gain = temperature(law, kin, state) - warmth
    assert gain == pytest.approx(begin * (temperature(intact, kin, same) - known), rel=1e-9)


def test_nothing_fails_under_high_pressure():
    kin = Axisymmetric()
    state = with_stress(BREAKING, kin, start(BREAKING, kin), (-20.0, -20.0, -20.0, 0.0))
    state = stretched(BREAKING, kin, state, isochoric(-1e-2), 20)
    assert plastic_strain(BREAKING, kin, state) > 0.1
    assert damage_initiation(BREAKING, kin, state) == 0


def test_negative_d1():
    """A failure strain below 0 (Armco iron has d1 = -2.2) fails at once, and goes on."""
    kin, law = Space(), INTACT._replace(damage=WEAR._replace(d1=-0.7))
    state = stretched(law, kin, start(law, kin), np.diag([0.02, 0.015, 0.01]), 5)
    assert damage(law, kin, state) == 1 and np.all(np.isfinite(flat(state)))


def test_work_is_stored_or_dissipated():
    """What damage frees counts as dissipated; the error falls with the step."""
    kin, errors = Axisymmetric(), []
    loading = np.diag([0.4, -0.16, -0.16])
    for steps in (200, 400, 800):
        state, work = worked(BREAKING, kin, start(BREAKING, kin), loading / steps, steps)
        stored, lost = energy_density(BREAKING, kin, state), dissipated_energy(BREAKING, kin, state)
        assert damage(BREAKING, kin, state) == 1
        errors.append(abs(stored + lost - work) / work)
    assert errors[2] < 0.55 * errors[1] < 0.3 * errors[0] < 0.01


def test_a_quarter_turn():
    """Half broken, the stress turns with the point, and D stays."""
    kin, steps = Space(), 400
    state = start(BREAKING, kin)
    while damage(BREAKING, kin, state) < 0.3:
        state = stretched(BREAKING, kin, state, np.diag([0.002, -0.001, -0.0009]), 1)
    at_rest = 0.9 * np.diag([0.1, -0.05, -0.05])
    state = with_stress(BREAKING, kin, state, symmetric_flat(kin, at_rest))
    before = stress(BREAKING, kin, state)
    D = damage(BREAKING, kin, state)
    w = np.zeros((3, 3))
    w[1, 0] = np.pi / 2 / steps
    turned = stretched(BREAKING, kin, state, w - w.T, steps)
    found = stress(BREAKING, kin, turned)
    apart = found - np.trace(found) / 3 * np.eye(3)
    assert damage(BREAKING, kin, turned) == D
    assert apart == pytest.approx(TURN @ before @ TURN.T, abs=1e-9)


def test_absent_parts_have_no_numbers():
    """J and s; dissipation and ep; w; T: one number each, and no others."""
    counts = [len(flat(start(law, Space()))) for law in (INTACT, BREAKING, ALL_PARTS)]
    assert counts == [9, 10, 11]
