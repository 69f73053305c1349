"""Laws in large steps: load steps of rate laws, logarithmic strain, modified Cam-clay."""

from math import exp, log, pi, sqrt

import numpy as np
import pytest
from laws import stress
from scipy.linalg import expm
from tensors import every_kinematics, flat, rotation

from comparisons.results import read_log
from karamelo_py.points.kinematics import Axisymmetric, PlaneStrain, Space, large, sym
from karamelo_py.points.laws import advance, energy_density, initial_state, jacobian, with_stress
from karamelo_py.points.laws.cam_clay import CamClayConstants
from karamelo_py.points.laws.eos import LinearPressure
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.hencky import Hencky
from karamelo_py.points.laws.linear import LinearElastic
from karamelo_py.points.laws.logarithmic import Logarithmic
from karamelo_py.points.laws.parameters import lame_parameters
from karamelo_py.points.laws.strengths.hardening import Plastic
from karamelo_py.points.laws.strengths.linear import Elastic

E, NU = 100.0, 0.3
LAM, G = lame_parameters(E, NU)
K = LAM + 2 / 3 * G
SPACE = Space()
LINEAR = LinearElastic(1e-3, LAM, G)
RATE = EosStrength(LinearPressure(1e-3, K), Elastic(G))
HENCKY = Hencky(1e-3, LAM, G)
ELASTIC = EosStrength(LinearPressure(1e-3, K), Elastic(G), strain=Logarithmic())
FLOWING = EosStrength(LinearPressure(1e-3, K), Plastic(G, 5.0), strain=Logarithmic())


def after(law, kin, state, full, *, far=True, dt=1.0):
    """The state after an increment, (3, 3)."""
    dl = flat(kin, np.asarray(full, float))
    return advance(law, kin, state, large(dl) if far else dl, dt)


# --- load steps of rate laws ----------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.1, 0.5, 1.0])
def test_a_turn_strains_nothing(angle):
    """R - I in one step: no strain, and stress that turns by R but for the rest of the series."""
    R = rotation(angle * np.array([2.0, 1, -2]) / 3)
    assert np.allclose(sym(large(flat(SPACE, R - np.eye(3)))), 0, atol=1e-14)
    before = after(LINEAR, SPACE, initial_state(LINEAR, SPACE, 1.0), np.diag([0.1, 0.02, 0]))
    turned = stress(LINEAR, SPACE, after(LINEAR, SPACE, before, R - np.eye(3)))
    exact = R @ stress(LINEAR, SPACE, before) @ R.T
    rest = (2 * np.tan(angle / 2)) ** 7 / 448
    assert np.allclose(turned, exact, rtol=0, atol=E * 0.1 * (2 * rest + 1e-14))


@every_kinematics
def test_a_step_by_a_constant_gradient_is_what_small_ones_add_up_to(kin):
    """exp(L) - I is the increment of a constant velocity gradient L: its strain is sym(L)."""
    rng = np.random.default_rng(2)
    L = np.array(flat(kin, rng.normal(0, 0.1, (3, 3))))
    full = np.zeros((3, 3))
    for value, place in zip(L, kin.Tensor.places, strict=True):
        full[place] = value
    increment = large(flat(kin, expm(full) - np.eye(3)))
    exact = sym(flat(kin, full))
    assert np.allclose(sym(increment), exact, atol=1e-8)


@pytest.mark.parametrize("law", [LINEAR, RATE], ids=["linear", "eos-strength"])
@pytest.mark.parametrize("kin", [PlaneStrain(), SPACE], ids=["plane", "space"])
def test_simple_shear_in_load_steps(law, kin):
    """Stress by Jaumann's rate: G sin(gamma), G (1 - cos(gamma)) (Dienes 1979); of order 2.

    What a step adds has turned by half of its angle, or 20 steps are wrong by a tenth of G.
    """
    gamma, errors = 4.0, []
    for steps in (20, 40):
        s = sheared(law, kin, gamma, steps, far=True)
        exact = G * np.sin(gamma), G * (1 - np.cos(gamma)), -G * (1 - np.cos(gamma))
        errors.append(np.abs([s[0, 1], s[0, 0], s[1, 1]] - np.array(exact)).max() / G)
    assert errors[0] < 4e-3 and errors[1] < 0.26 * errors[0]


# --- logarithmic strain ---------------------------------------------------------------------------


def sheared(law, kin, gamma, steps, *, far=False):
    """Stress (3, 3) after simple shear in equal steps, which are exact for F."""
    state = initial_state(law, kin, 1.0)
    for _ in range(steps):
        state = after(law, kin, state, [[0, gamma / steps, 0], [0, 0, 0], [0, 0, 0]], far=far)
    return stress(law, kin, state)


@pytest.mark.parametrize("law", [HENCKY, ELASTIC], ids=["hencky", "eos-strength"])
@pytest.mark.parametrize("kin", [PlaneStrain(), SPACE], ids=["plane", "space"])
@pytest.mark.parametrize("steps", [1, 7])
def test_simple_shear(law, kin, steps):
    """ln V of simple shear: ln(stretch) arsinh(gamma/2), its axes by tan 2a = 2/gamma (Anand 1979).

    With g = gamma: sigma_xy = 2 G asinh(g/2)/sqrt(1 + g^2/4), sigma_xx = g/2 of it.
    """
    gamma = 3.0
    shear = 2 * G * np.arcsinh(gamma / 2) / sqrt(4 + gamma**2) * 2
    found = sheared(law, kin, gamma, steps)
    assert found[0, 1] == pytest.approx(shear, rel=1e-12)
    assert found[0, 0] == pytest.approx(gamma / 2 * shear, rel=1e-12)
    assert found[1, 1] == pytest.approx(-gamma / 2 * shear, rel=1e-12)


@pytest.mark.parametrize("law", [HENCKY, ELASTIC, FLOWING], ids=["hencky", "elastic", "plastic"])
def test_a_quarter_turn_in_one_step(law):
    """The stress turns with the point, exactly."""
    before = after(
        law, SPACE, initial_state(law, SPACE, 1.0), np.diag([0.2, -0.1, 0.05]), far=False
    )
    R = rotation(pi / 2 * np.array([2.0, 1, -2]) / 3)
    turned = after(law, SPACE, before, R - np.eye(3), far=False)
    exact = R @ stress(law, SPACE, before) @ R.T
    assert np.allclose(stress(law, SPACE, turned), exact, rtol=0, atol=1e-12 * E)


@pytest.mark.parametrize("steps", [1, 50])
def test_a_bar_that_yields(steps):
    """Uniaxial stretch by 1.5 at constant volume: sigma = Y, whatever the steps."""
    state = initial_state(FLOWING, SPACE, 1.0)
    one = 1.5 ** (1 / steps)
    for _ in range(steps):
        stretch = np.diag([one, one**-0.5, one**-0.5])
        state = after(FLOWING, SPACE, state, stretch - np.eye(3), far=False)
    found = stress(FLOWING, SPACE, state)
    assert found[0, 0] - found[1, 1] == pytest.approx(5.0, rel=1e-12)
    # All but the elastic part of ln(1.5) is plastic.
    assert state.m.strength.ep == pytest.approx(log(1.5) - 5.0 / (3 * G), rel=1e-10)


def test_a_closed_loop_gives_back_its_work():
    """Hencky's law has a potential: shear, stretch and back leave nothing."""
    state = initial_state(HENCKY, SPACE, 1.0)
    steps = [np.eye(3) + 0.4 * np.eye(3, k=1), np.diag([1.3, 0.8, 1.1])]
    for F in [*steps, np.linalg.inv(steps[0]), np.linalg.inv(steps[1])]:
        state = after(HENCKY, SPACE, state, F - np.eye(3), far=False)
    F = np.linalg.inv(steps[1]) @ np.linalg.inv(steps[0]) @ steps[1] @ steps[0]
    V2 = np.linalg.eigvalsh(F @ F.T)
    exact = G * np.sum(np.log(V2) ** 2) / 4 + LAM / 2 * (np.log(V2).sum() / 2) ** 2
    assert energy_density(HENCKY, SPACE, state) == pytest.approx(exact, rel=1e-10)


# --- modified Cam-clay ----------------------------------------------------------------------------

CLAY = CamClayConstants(1800.0, 4e6, 1.2, 0.1, 0.02, 100e3).checked()
UNDRAINED = np.diag([-1.0, 0.5, 0.5])


def p_and_q(law, state):
    """Pressure, and von Mises stress, of Cauchy's stress."""
    s = np.array(stress(law, SPACE, state))
    p = -np.trace(s) / 3
    return p, sqrt(1.5 * np.sum((s + p * np.eye(3)) ** 2))


@pytest.mark.parametrize("kin", [SPACE, Axisymmetric()], ids=["space", "axis"])
@pytest.mark.parametrize("steps", [1, 10])
def test_isotropic_consolidation(kin, steps):
    """ln V = -kappa ln(p/p0) to pc, then -lam ln(p/pc), and -kappa ln p back; p times J."""
    law = CLAY._replace(pc=200e3)
    state = initial_state(law, kin, 1.0)
    for ratio, exact in (
        (exp(-0.02 * log(1.5)), 150e3),
        (exp(-0.02 * log(2 / 1.5) - 0.1 * log(4)), 800e3),
        (exp(0.02 * log(8)), 100e3),
    ):
        for _ in range(steps):
            grown = (ratio ** (1 / (3 * steps)) - 1) * np.eye(3)
            state = after(law, kin, state, grown, far=False)
        pressure = -np.trace(stress(law, kin, state)) / 3 * jacobian(law, kin, state)
        assert pressure == pytest.approx(exact, rel=1e-9)
    assert state.pc == pytest.approx(800e3, rel=1e-9)


def test_undrained_path():
    """p = p0 ((eta^2 + M^2)/M^2)^-(1 - kappa/lam) (Wood 1990, equation 5.30), exact in any step.

    Plastic strain from the flow rule, 2 eta/(M^2 - eta^2) of the plastic compression -kappa dp/p:
    2 kappa/M (1 - kappa/lam) (ln((M + eta)/(M - eta))/2 - atan(eta/M)), of first order in the step.
    """
    share, M = 1 - CLAY.kappa / CLAY.lam, CLAY.M
    errors = []
    for steps in (50, 100):
        state = initial_state(CLAY, SPACE, 1.0)
        for _ in range(steps):
            F = expm(0.02 / steps * UNDRAINED)
            state = after(CLAY, SPACE, state, F - np.eye(3), far=False)
            p, q = p_and_q(CLAY, state)
            assert p == pytest.approx(100e3 * (1 + (q / p / M) ** 2) ** -share, rel=1e-9)
        eta = q / p
        shape = log((M + eta) / (M - eta)) / 2 - np.arctan(eta / M)
        errors.append(state.ep / (2 * CLAY.kappa / M * share * shape) - 1)
    assert abs(errors[1]) < 0.02 and errors[0] / errors[1] == pytest.approx(2, rel=0.1)
    state = after(CLAY, SPACE, state, expm(UNDRAINED) - np.eye(3), far=False)
    p, q = p_and_q(CLAY, state)
    assert q == pytest.approx(M * p, rel=3e-3) and p == pytest.approx(100e3 * 2**-share, rel=3e-3)


def test_clay_takes_a_stress_that_it_is_given():
    """Stress as given; the surface goes through it where it was outside."""
    state = initial_state(CLAY, SPACE, 1.0)
    given = (-150e3, -300e3, -150e3, 0.0, 0.0, 0.0)
    state = with_stress(CLAY, SPACE, state, given)
    assert np.allclose(stress(CLAY, SPACE, state), np.diag(given[:3]), rtol=1e-12)
    assert state.pc == pytest.approx(200e3 + 150e3**2 / 1.2**2 / 200e3)


DRAINED = """
    material(clay, cam-clay, 1800, 4e6, 1.2, 0.1, 0.02, 100e3)
    load_path(squeeze, 300, ezz=-0.6, sxx=-100e3, syy=-100e3)
    element(drained, clay, squeeze)
"""


def test_drained_triaxial(run_interpreted):
    """dq = 3 dp from p0: q = M p at p = 3 p0/(3 - M), the critical state."""
    result = run_interpreted(DRAINED)
    table = read_log(result.folder / "element_drained.txt")
    assert table["p"][-1] == pytest.approx(3 * 100e3 / (3 - 1.2), rel=2e-3)
    assert table["q"][-1] == pytest.approx(1.2 * table["p"][-1], rel=2e-3)


SQUEEZED = """
    method(tlmpm, FLIP, linear, 1)
    scheme(quasi-static)
    dimension(2, 0, 1.5, 0, 1, 0.5)
    region(box, block, 0, 1, 0, 1)
    material(clay, cam-clay, 1, 40, 1.2, 0.1, 0.02, 1, pc=2)
    solid(s, region, box, 1, clay, 0.5, 0)
    region(left, block, -INF, 1e-6, -INF, INF)
    region(right, block, 1-1e-6, INF, -INF, INF)
    region(everywhere, block, -INF, INF, -INF, INF)
    group(left, nodes, region, left, all)
    group(right, nodes, region, right, all)
    group(everywhere, nodes, region, everywhere, all)
    fix(flat, velocity_nodes, everywhere, NULL, 0)
    fix(hold, velocity_nodes, left, 0, NULL)
    fix(push, velocity_nodes, right, -0.02, NULL)
    set_output(1)
    log_modify(custom, step, time, iterations, push_x)
    run(5)
"""


def test_clay_in_load_steps(run_interpreted):
    """Oedometer: the force is that of the law at one point, P = tau/F, found in few corrections."""
    log_of = run_interpreted(SQUEEZED).log
    law = CamClayConstants(1.0, 40.0, 1.2, 0.1, 0.02, 1.0, pc=2.0).checked()
    kin, F = PlaneStrain(), 1.0
    state = initial_state(law, kin, 1.0)
    for step in range(1, 6):
        state = after(law, kin, state, np.diag([-0.02 / F, 0, 0]), far=False)
        F -= 0.02
        force = stress(law, kin, state)[0, 0] * jacobian(law, kin, state) / F
        assert log_of["push_x"][step] == pytest.approx(force, rel=1e-7)
    assert state.ep > 0.02 and max(log_of["iterations"]) <= 6


LAYER = """
    method(ulmpm, FLIP, quadratic-spline, 1)
    scheme(quasi-static)
    dimension(2, 0, 0.25, 0, 1.5, 0.125)
    region(b, block, 0, 0.25, 0, 1)
    material(clay, cam-clay, 1800, 4e6, 1.0, 0.1, 0.02, 100e3)
    solid(b, region, b, 2, clay, 0.125, 0)
    region(left, block, -INF, 0, -INF, INF)
    region(right, block, 0.25, INF, -INF, INF)
    region(sides, union, left, right)
    region(base, block, -INF, INF, -INF, 0)
    group(sides, nodes, region, sides, all)
    group(base, nodes, region, base, all)
    fix(sides, velocity_nodes, sides, 0, NULL)
    fix(base, velocity_nodes, base, 0, 0)
    fix(cover, edge_traction, all, b, yhi, 0, -100e3)
    compute(deep, probe, all, s11, s22, x=0.125, y=0.3)
    log_modify(custom, step, deep_s11, deep_s22)
    set_output(1)
    run(1)
"""


def test_a_cover_balances_the_first_pressure(run_interpreted):
    """As docs/materials.md says: p0 stays below a cover of p0, and goes without one."""
    log_of = run_interpreted(LAYER).log
    assert log_of.deep_s22[-1] == pytest.approx(-100e3, rel=0.01)
    assert log_of.deep_s11[-1] == pytest.approx(-100e3, rel=0.01)
    bare = run_interpreted(LAYER.replace("0, -100e3)", "0, 0)"), folder="bare").log
    assert abs(bare.deep_s22[-1]) < 10e3


WRONG = [
    ("1800, 4e6, 1.2, 0.1, 0.2, 100e3", "swelling is as soft"),
    ("1800, 4e6, 1.2, 0.1, 0.02, 100e3, pc=50e3", "below the pressure"),
]


@pytest.mark.parametrize(("numbers", "message"), WRONG)
def test_impossible_clay(run_script, numbers, message):
    result = run_script(f"material(clay, cam-clay, {numbers})", status=1)
    assert message in result.err and "Traceback" not in result.err
