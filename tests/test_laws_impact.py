"""Laws of impact: crushed pores, ceramics, spall; each against its formulas, and a plate impact."""

import numpy as np
import pytest
from conftest import INPUTS
from laws import isochoric, mises, pressure_of, start, stress, stretched, worked

from karamelo_py.points.kinematics import Space
from karamelo_py.points.laws import (
    damage,
    dissipated_energy,
    energy_density,
    jacobian,
    with_temperature,
)
from karamelo_py.points.laws.damages import integrity
from karamelo_py.points.laws.eos import LinearPressure, VolumeStep, compressed
from karamelo_py.points.laws.eos.p_alpha import PAlpha
from karamelo_py.points.laws.eos_strength import EosStrength, volume_energy
from karamelo_py.points.laws.spall import TulerButcher
from karamelo_py.points.laws.strengths.ceramics import JohnsonHolmquist2
from karamelo_py.points.laws.strengths.linear import Elastic
from karamelo_py.points.laws.temperatures import PlasticWork

SPACE = Space()
K, ALPHA, PE, PS = 37.0, 1.25, 0.05, 1.2
ROCK = EosStrength(
    PAlpha(ALPHA / 2.65, LinearPressure(1 / 2.65, K), ALPHA, PE, PS, 2.0), Elastic(8.0)
)
SHRINK = -np.eye(3)


def on_crush_curve(p):
    """alpha and J at the pressure p: Herrmann (1969), with p alpha = K (1 - J alpha0/alpha)."""
    alpha = 1 + (ALPHA - 1) * ((PS - p) / (PS - PE)) ** 2
    return alpha, (1 - p * alpha / K) * alpha / ALPHA


@pytest.mark.parametrize("p", [0.06, 0.3, 0.9, 1.19])
@pytest.mark.parametrize("steps", [1, 20])
def test_pores_are_crushed_along_the_curve(p, steps):
    alpha, J = on_crush_curve(p)
    each = J ** (1 / (3 * steps)) - 1
    state = stretched(ROCK, SPACE, start(ROCK, SPACE), each * np.eye(3), steps)
    assert pressure_of(ROCK, SPACE, state) == pytest.approx(p, rel=1e-9)
    assert state.m.energy.alpha == pytest.approx(alpha, rel=1e-10)


def test_unloading_leaves_pores_closed():
    """Elastic at constant alpha: J = alpha/alpha0 at no pressure; work = stored + dissipated."""
    _, J = on_crush_curve(0.6)
    state, work = worked(ROCK, SPACE, start(ROCK, SPACE), (J ** (1 / 3000) - 1) * np.eye(3), 1000)
    lost, stored = (f(ROCK, SPACE, state) for f in (dissipated_energy, energy_density))
    assert stored + lost == pytest.approx(work, rel=2e-3)
    alpha = state.m.energy.alpha
    ratio = (alpha / ALPHA / jacobian(ROCK, SPACE, state)) ** (1 / 3) - 1
    state = stretched(ROCK, SPACE, state, ratio * np.eye(3), 1)
    assert pressure_of(ROCK, SPACE, state) == pytest.approx(0, abs=1e-9)
    assert state.m.energy.alpha == alpha
    assert dissipated_energy(ROCK, SPACE, state) == lost


def test_beyond_full_compaction_it_is_the_solid():
    memory = compressed(ROCK.eos, start(ROCK, SPACE).m.energy, VolumeStep(1.0, 0.75, 1.0), 0.0)
    assert memory.alpha == 1
    state = stretched(ROCK, SPACE, start(ROCK, SPACE), (0.75 ** (1 / 3) - 1) * np.eye(3), 1)
    assert pressure_of(ROCK, SPACE, state) == pytest.approx(K * (1 - 0.75 * ALPHA), rel=1e-9)


# Alumina AD-995: Johnson & Holmquist 1993; Cronin et al. 2003, table 1.
ALUMINA = JohnsonHolmquist2(90.16, 0.93, 0.6, 0.31, 0.6, 0.0, 1.0, 0.2, 2.79, 1.46, 0.005, 1.0)
BULK = 130.95
CERAMIC = EosStrength(LinearPressure(1 / 3.7, BULK), ALUMINA)


def test_a_plane_wave_yields_at_the_hugoniot_elastic_limit():
    """The published constants agree with each other: sHEL (A (1 + T*)^N) is 3/2 (HEL - PHEL)."""
    state, before = start(CERAMIC, SPACE), None
    while state.m.strength.ep == 0:
        before, state = state, stretched(CERAMIC, SPACE, state, np.diag([-1e-5, 0, 0]), 1)
    assert -stress(CERAMIC, SPACE, before)[0, 0] == pytest.approx(2.79, rel=0.02)
    assert pressure_of(CERAMIC, SPACE, before) == pytest.approx(1.46, rel=0.02)


def cracked(law, steps):
    """Uniaxial strain of -0.05 by the formulas of Johnson & Holmquist (1993), explicitly."""
    part, e = law.strength, -0.05 / steps
    s, D, extra, J, path = 0.0, 0.0, 0.0, 1.0, []
    for _ in range(steps):
        J *= 1 + e
        mu_p = BULK * (1 - J)
        p = mu_p + extra
        intact = 1.995 * 0.93 * ((p + 0.2) / 1.46) ** 0.6
        broken = 1.995 * min(0.31 * (p / 1.46) ** 0.6, intact / 1.995)
        flow = intact - D * (intact - broken)
        s = s - 2 * part.G * e
        if s > flow:
            failure = 0.005 * (p + 0.2) / 1.46
            D = min(D + (s - flow) / (3 * part.G) / failure, 1)
            new = intact - D * (intact - broken)
            lost = (flow**2 - new**2) / (6 * part.G)
            extra = -mu_p + np.sqrt(p**2 + 2 * part.beta * BULK * lost)
            s = new
        path.append((mu_p + extra, s, D, extra))
    return path[-1]


@pytest.mark.parametrize("beta", [0.0, 1.0])
def test_a_ceramic_breaks_and_swells(beta):
    """Pressure, strength, damage and bulking at an axial strain of 5 %."""
    law = CERAMIC._replace(strength=ALUMINA._replace(beta=beta))
    state, work = worked(law, SPACE, start(law, SPACE), np.diag([-5e-6, 0, 0]), 10_000)
    p, q, D, extra = cracked(law, 100_000)
    assert pressure_of(law, SPACE, state) == pytest.approx(p, rel=1e-3)
    assert mises(law, SPACE, state) == pytest.approx(q, rel=1e-3)
    assert state.m.strength.damage == D == 1
    assert state.m.strength.bulking == pytest.approx(extra, rel=2e-3, abs=1e-12)
    assert (extra > 0.3) == (beta > 0)
    lost, stored = (f(law, SPACE, state) for f in (dissipated_energy, energy_density))
    assert stored + lost == pytest.approx(work, rel=5e-3)


def test_broken_ceramic_opens_without_tension_and_closes_before_it_presses():
    law, state = CERAMIC, start(CERAMIC, SPACE)
    state = stretched(law, SPACE, state, isochoric(2e-3), 40)
    assert state.m.strength.damage == 1
    state = stretched(law, SPACE, state, 1e-3 * np.eye(3), 50)
    assert pressure_of(law, SPACE, state) == pytest.approx(0, abs=1e-9)
    assert state.m.strength.opened > 1.1
    state = stretched(law, SPACE, state, -1e-3 * np.eye(3), 30)
    assert pressure_of(law, SPACE, state) == pytest.approx(0, abs=1e-9)
    state = stretched(law, SPACE, state, -1e-3 * np.eye(3), 40)
    assert state.m.strength.opened == 1
    assert pressure_of(law, SPACE, state) > 1


def test_broken_warm_ceramic_opens_at_no_pressure_and_stores_nothing():
    """Thermal pressure acts on the elastic part of the volume; the gaps store no energy."""
    law = CERAMIC._replace(temperature=PlasticWork(0.0, 1.0, 0.0, 0.01, 300.0, 2000.0))
    state = stretched(law, SPACE, start(law, SPACE), isochoric(2e-3), 40)
    state = with_temperature(law, SPACE, state, 350.0)
    for n in (50, 100):
        state = stretched(law, SPACE, state, 1e-3 * np.eye(3), n)
        assert pressure_of(law, SPACE, state) == pytest.approx(0, abs=1e-9)
        volume = volume_energy(law, state.J, state.m)
        assert volume == pytest.approx(-0.5 * 0.5**2 / BULK, rel=1e-6)


def test_spall_takes_the_time_of_tuler_and_butcher():
    """At the tension s fails after K/(s - sigma0)^n; then only pressure is left."""
    law = EosStrength(
        LinearPressure(1 / 8.9, 140.0), Elastic(48.0), damage=TulerButcher(1.2, 2.0, 0.01)
    )
    e = 0.02
    state = stretched(law, SPACE, start(law, SPACE), np.diag([e, 0, 0]), 1, 1e-9)
    tension = stress(law, SPACE, state)[0, 0]
    time, n = 0.01 / (tension - 1.2) ** 2, 100
    for part, broken in ((0.98, 0), (0.04, 1)):
        state = stretched(law, SPACE, state, np.zeros((3, 3)), n, part * time / n)
        assert damage(law, SPACE, state) == broken
        left = integrity(law.damage, state.m.damage)
        assert left == 1 - broken and isinstance(left, float)  # an integer cannot be taken in lanes
    assert np.allclose(stress(law, SPACE, state), 0)
    state = stretched(law, SPACE, state, 0.03 * SHRINK, 1, 1e-9)
    assert pressure_of(law, SPACE, state) > 1


SCENE = """
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 4, 0, 1, 0.25)
    eos(solid, linear, 2.65, 37)
    eos(rock, p-alpha, solid, 1.25, 0.05, 1.2)
    eos(hard, linear, 3.7, 131)
    strength(soft, plastic, 8, 0.05)
    strength(hard, johnson-holmquist-2, 90, 1, 0.6, 0.3, 0.6, 0.01, 1, 0.2, 2.79, 1.46, 0.005, 1)
    strength(metal, linear, 48)
    damage(spall, tuler-butcher, 0.5, 1, 0.001)
    material(a, eos-strength, rock, soft)
    material(b, eos-strength, hard, hard)
    material(c, eos-strength, hard, metal, spall)
    region(a, block, 0, 1, 0, 1)
    region(b, block, 1.25, 2.25, 0, 1)
    region(c, block, 2.5, 3.5, 0, 1)
    solid(a, region, a, 1, a, 0.25)
    solid(b, region, b, 1, b, 0.25)
    solid(c, region, c, 1, c, 0.25)
    fix(v, initial_velocity_particles, all, 2*sin(2*y0) - 2*(x0 - 0.5), -y0)
    dump(d, all, particle, 10, d.*.txt, p, s11, damage, alpha, dissipated, opened)
    log_modify(custom, step, time)
    set_dt(1e-2)
    run(10)
"""


def test_compiled_they_have_the_same_numbers(run_script, run_interpreted):
    found = []
    for name, run in (("compiled", run_script), ("interpreted", run_interpreted)):
        folder = run(SCENE, folder=name).folder
        found.append(np.loadtxt(folder / "d.10.txt", skiprows=11))
    assert np.allclose(found[0], found[1], rtol=1e-9, atol=1e-9)
    assert 0 < found[0][found[0][:, 8] > 0, 8].min() < 1.25 and found[0].shape == (48, 11)


def test_a_flyer_spalls_a_plate(run_script):
    """in.flyer: Rankine-Hugoniot pressure, and pull-back 2 tension/(rho0 c0) (Antoun 2003)."""
    done = run_script((INPUTS / "in.flyer").read_text("utf-8"))
    log, rho, c0, S, v = done.log, 8.93, 3.94, 1.489, 0.4
    flat = log.u_x[(log.Time > 1.1) & (log.Time < 1.5)].mean()
    low = log.u_x[log.Time > 1.95].mean()
    assert flat == pytest.approx(v, rel=0.01)
    assert flat - low == pytest.approx(2 * 1.2 / (rho * c0), rel=0.04)
    x, _, _, _, p = np.loadtxt(done.folder / "flyer.200.LAMMPS", skiprows=11)[:, 2:].T
    behind = p[(x > 0.2) & (x < 2)].mean()
    assert behind == pytest.approx(0.5 * rho * (c0 + 0.5 * S * v) * v, rel=0.01)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("eos(r, p-alpha, solid, 0.9, 1, 2)", "a distension of 0.9 leaves no pores"),
        ("eos(r, p-alpha, solid, 1.2, 3, 2)", "pores are gone at 2 before they are crushed at 3"),
        ("eos(r, p-alpha, gas, 1.2, 1, 2)", "eos 'gas' is no equation of state of a solid"),
        ("strength(c, johnson-holmquist-2, 9, 1, 1, 1, 1, 0, 1, 1, 2, 3, 1, 1)",
         "the elastic limit 2 is not above its pressure 3"),
        ("strength(c, johnson-holmquist-2, 9, 1, 1, 1, 1, 0, 1, 1, 3, 2, 1, 1, 2)",
         "a fraction of 2 is not possible"),
    ],
)  # fmt: skip
def test_constants_that_are_not_possible(run_interpreted, line, says):
    start = "eos(solid, linear, 1, 9)\neos(gas, ideal-gas, 1, 1.4, p=1)\n"
    assert says in run_interpreted(start + line, status=1).err
