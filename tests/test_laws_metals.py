"""Strengths of metals and their heating: one point against closed forms and integrations."""

from math import log, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import (
    TURN,
    integrated,
    isochoric,
    mises,
    pressure_of,
    start,
    stress,
    stretched,
    worked,
)  # fmt: skip
from tensors import every_kinematics, symmetric_flat
from tensors import flat as matrix

from karamelo_py.compiler import on_numbers
from karamelo_py.compiler.slopes import seeded, slopes_of
from karamelo_py.compiler.tuples import flat
from karamelo_py.kernels.laws import law_in
from karamelo_py.points.kinematics import Axisymmetric, Line, PlaneStrain, Space
from karamelo_py.points.laws import (
    Absent,
    advance,
    cauchy_stress,
    dissipated_energy,
    energy_density,
    initial_state,
    kirchhoff_stress,
    plastic_strain,
    temperature,
    wave_speed_squared,
    with_stress,
    with_temperature,
)
from karamelo_py.points.laws.eos import LinearPressure
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.strengths import initial_memory
from karamelo_py.points.laws.strengths.hardening import LinearHardening, Plastic, plastic_increment
from karamelo_py.points.laws.strengths.metals import JohnsonCook, JohnsonCookConstants, Swift
from karamelo_py.points.laws.strengths.rates import Mts, Norton, Perzyna, SteinbergGuinan
from karamelo_py.points.laws.temperatures import PlasticWork

RHO, K, G = 8.0, 160.0, 80.0
EOS = LinearPressure(1 / RHO, K)
A, B, N, RATE0, C, M, TR, TM = 0.4, 0.3, 0.3, 1.0, 0.05, 1.1, 300.0, 1300.0
COOK = JohnsonCookConstants(G, A, B, N, RATE0, C, M, TR, TM).checked()
HARDENING = LinearHardening(G, 0.4, 2.0)
SWIFT = Swift(G, 0.4, 0.5, 0.002, 0.5)
HEAT = PlasticWork(0.9, 0.5, 0.0, 0.0, TR, TM)
every_strength = pytest.mark.parametrize(
    "strength", [Plastic(G, 0.4), HARDENING, SWIFT, COOK], ids=lambda s: type(s).__name__
)


def static_flow(strength, ep):
    """Flow stress at the reference rate and temperature, as published."""
    if isinstance(strength, Plastic):
        return strength.yield_stress
    if isinstance(strength, LinearHardening):
        return strength.yield_stress + strength.H * ep
    if isinstance(strength, Swift):
        return strength.A + strength.B * max(ep - strength.C, 0) ** strength.n
    return strength.A + strength.B * ep**strength.n


@every_kinematics
@every_strength
@pytest.mark.parametrize("steps", [1, 20])
def test_stress_ends_on_the_yield_surface(strength, kin, steps):
    """After increments of any size: q = Y(ep), and q + 3 G ep is what it were without yield."""
    law = EosStrength(EOS, strength)
    e = -0.03 / steps
    # Slower than the reference rate.
    state = stretched(law, kin, start(law, kin), np.diag([e, 0, 0]), steps, 1e3)
    ep = plastic_strain(law, kin, state)
    assert ep > 0.015
    assert mises(law, kin, state) == pytest.approx(static_flow(strength, ep), rel=1e-12)
    assert mises(law, kin, state) + 3 * G * ep == pytest.approx(2 * G * 0.03, rel=1e-12)


@pytest.mark.parametrize("kin", [PlaneStrain(), Axisymmetric(), Space()])
@every_strength
def test_simple_shear(strength, kin):
    """s_xy = Y(ep)/sqrt(3), ep = (gamma - s_xy/G)/sqrt(3), but for the turn, of order gamma."""
    law = EosStrength(EOS, strength)
    shear = np.zeros((3, 3))
    shear[0, 1] = 1e-4
    state = stretched(law, kin, start(law, kin), shear, 200, 1e3)
    ep = plastic_strain(law, kin, state)
    s = static_flow(strength, ep) / sqrt(3)
    assert ep == pytest.approx((0.02 - s / G) / sqrt(3), rel=1e-3)
    assert stress(law, kin, state)[0, 1] == pytest.approx(s, rel=1e-3)


@every_strength
def test_unloading_is_elastic(strength):
    law, kin = EosStrength(EOS, strength), Axisymmetric()
    state = stretched(law, kin, start(law, kin), isochoric(1e-3), 20, 1e3)
    ep, q = plastic_strain(law, kin, state), mises(law, kin, state)
    back = stretched(law, kin, state, isochoric(-q / G / 6), 1, 1e3)  # q falls by 3 G e
    assert plastic_strain(law, kin, back) == ep
    assert mises(law, kin, back) == pytest.approx(q / 2, rel=1e-9)
    further = stretched(law, kin, back, isochoric(-q / G), 1, 1e3)
    assert plastic_strain(law, kin, further) > ep


def test_swift_has_a_plateau():
    law, kin = EosStrength(EOS, SWIFT), Axisymmetric()
    state = stretched(law, kin, start(law, kin), isochoric(1e-4), 30)
    assert 0 < plastic_strain(law, kin, state) < 0.002
    assert mises(law, kin, state) == pytest.approx(0.4, rel=1e-12)
    prestrained = EosStrength(EOS, SWIFT._replace(C=-0.01))
    state = stretched(prestrained, kin, start(law, kin), isochoric(1e-2), 1)
    assert mises(prestrained, kin, state) > 0.4 + 0.5 * 0.01**0.5


@pytest.mark.parametrize("rate", [1e-6, 0.5, 1.0])
def test_up_to_the_reference_rate_the_factor_is_one(rate):
    """In rigid-plastic flow the plastic rate is the strain rate, here with a long yielded past."""
    law, kin = EosStrength(EOS, COOK._replace(B=0.0)), Axisymmetric()
    state = stretched(law, kin, start(law, kin), isochoric(1e-2), 10, 1e-2 / rate)
    assert mises(law, kin, state) == pytest.approx(A, rel=1e-12)


@pytest.mark.parametrize("rate", [10.0, 1e4])
def test_factor_of_the_rate(rate):
    """1 + C ln(rate/epsdot0) (Johnson & Cook 1983) where flow is steady."""
    law, kin = EosStrength(EOS, COOK._replace(B=0.0)), Axisymmetric()
    state = stretched(law, kin, start(law, kin), isochoric(1e-2), 10, 1e-2 / rate)
    assert mises(law, kin, state) == pytest.approx(A * (1 + C * log(rate)), rel=1e-12)


def test_factor_of_the_temperature():
    """1 - T*^m above Tr, 1 below, 0 from Tm on; without temperature 1."""
    law, kin = EosStrength(EOS, COOK, temperature=HEAT._replace(chi=0.0)), Axisymmetric()
    flow = []
    for T in (0.0, 300.0, 800.0, 1300.0, 2000.0):
        state = with_temperature(law, kin, start(law, kin), T)
        state = stretched(law, kin, state, isochoric(1e-2), 1, 1e3)
        ep = plastic_strain(law, kin, state)
        flow.append(mises(law, kin, state) / static_flow(COOK, ep))
        assert temperature(law, kin, state) == T
    assert flow == pytest.approx([1, 1, 1 - 0.5**M, 0, 0], rel=1e-12, abs=1e-12)
    assert JohnsonCookConstants(G, A, B, N, RATE0, C, 0.0, TR, TM).checked().softening == Absent()
    never = EosStrength(EOS, COOK._replace(softening=Absent()), temperature=HEAT)
    state = with_temperature(never, kin, start(never, kin), 800.0)
    state = stretched(never, kin, state, isochoric(1e-2), 1, 1e3)
    ep = plastic_strain(never, kin, state)
    assert mises(never, kin, state) == pytest.approx(static_flow(COOK, ep), rel=1e-12)


def cook_in_time(rate, end):
    """q, ep and T of uniaxial isochoric strain at a rate, integrated in time.

    While q is above the flow stress at the reference rate, the overstress gives the plastic rate:
    q = Y exp... solved for it: rate_p = epsdot0 exp((q/Y0 - 1)/C); below the reference rate flow is
    rate independent, which the strain rate of this test is far above.
    """

    def slope(t, y):
        q, ep, T = y
        star = min(max((T - TR) / (TM - TR), 0), 1)
        Y = (A + B * max(ep, 1e-30) ** N) * (1 - star**M)
        flow = RATE0 * np.exp((q / Y - 1) / C) if q > Y else 0.0
        return np.array([3 * G * (rate - flow), flow, HEAT.chi * q * flow / (RHO * HEAT.cp)])

    return integrated(slope, (0.0, 0.0, TR), end, 40_000)


def test_johnson_cook_against_an_integration_in_time():
    """Rate, hardening and heat together; the error of 400 steps is half that of 200."""
    law, kin, rate, end = EosStrength(EOS, COOK, temperature=HEAT), Axisymmetric(), 100.0, 3e-3
    q, ep, T = cook_in_time(rate, end)
    errors = []
    for steps in (200, 400):
        dt = end / steps
        # ln(1 + e) of the increments would shrink the volume: deviators only count here.
        state = stretched(law, kin, start(law, kin), isochoric(rate * dt), steps, dt)
        assert mises(law, kin, state) == pytest.approx(q, rel=2e-3)
        assert plastic_strain(law, kin, state) == pytest.approx(ep, rel=2e-3)
        errors.append(abs(plastic_strain(law, kin, state) - ep))
        found = temperature(law, kin, state)
    assert found == pytest.approx(T, rel=2e-3)
    assert errors[1] < 0.65 * errors[0]


def test_adiabatic_heating():
    """T = T0 + chi/(rho cp) times the integral of the flow stress: closed for linear hardening."""
    law, kin = EosStrength(EOS, HARDENING, temperature=HEAT), Axisymmetric()
    steps = 2000
    state = stretched(law, kin, start(law, kin), isochoric(0.5 / steps), steps)
    ep = plastic_strain(law, kin, state)
    plastic_work = 0.4 * ep + 2.0 * ep**2 / 2
    expected = TR + HEAT.chi / (RHO * HEAT.cp) * plastic_work
    assert temperature(law, kin, state) - TR == pytest.approx(expected - TR, rel=1e-3)
    assert dissipated_energy(law, kin, state) == pytest.approx(plastic_work, rel=1e-3)


def test_no_heating_from_the_melting_temperature_on():
    law, kin = EosStrength(EOS, HARDENING, temperature=HEAT), Axisymmetric()
    state = with_temperature(law, kin, start(law, kin), TM)
    state = stretched(law, kin, state, isochoric(0.01), 10)
    assert temperature(law, kin, state) == TM


@every_strength
@pytest.mark.parametrize("heat", [False, True])
def test_a_quarter_turn(strength, heat):
    """The stress turns with the point, and nothing flows or heats."""
    law = EosStrength(EOS, strength, temperature=HEAT) if heat else EosStrength(EOS, strength)
    kin, steps = Space(), 200
    loading = isochoric(1e-3) + 1e-3 * (np.eye(3, k=1) + np.eye(3, k=-1))
    state = stretched(law, kin, start(law, kin), loading, 5, 1e3)
    full = stress(law, kin, state)
    mean = np.trace(full) / 3 * np.eye(3)
    inside = mean + 0.999 * (full - mean)
    state = with_stress(law, kin, state, symmetric_flat(kin, inside))
    w = np.zeros((3, 3))
    w[1, 0] = np.pi / 2 / steps
    turned = stretched(law, kin, state, w - w.T, steps, 1e3)
    assert plastic_strain(law, kin, turned) == plastic_strain(law, kin, state) > 0
    found = stress(law, kin, turned)
    apart = found - np.trace(found) / 3 * np.eye(3)
    assert apart == pytest.approx(TURN @ (inside - mean) @ TURN.T, abs=1e-6)


@every_strength
def test_work_is_stored_or_dissipated(strength):
    """Stored + dissipated = work, to the order of the step: twice the steps, half the error."""
    law, kin, errors = EosStrength(EOS, strength), Space(), []
    loading = np.diag([0.01, -0.004, -0.003]) + 0.004 * np.eye(3, k=1)
    for steps in (50, 100, 200):
        state, work = worked(law, kin, start(law, kin), loading / steps, steps, 1e3)
        stored, lost = energy_density(law, kin, state), dissipated_energy(law, kin, state)
        assert lost > stored > 0
        errors.append(abs(stored + lost - work) / work)
    # J and the sum of the strain increments differ by squares of strain: 4e-4 stay.
    assert errors[2] < 6e-4 and errors[2] < 0.6 * errors[0] < 1e-3


@given(
    ep=st.sampled_from([0.0]) | st.floats(-12, 0.5).map(lambda k: 10**k),
    x=st.floats(-14, 0).map(lambda k: 10**k),
    n=st.floats(0.02, 2),
    plateau=st.sampled_from([None, 0.0, 0.002, -0.01]),
)
def test_the_return_finds_the_strain_to_round_off(ep, x, n, plateau):
    """The stress is made from the published formula of the flow stress and a known increment.

    What is left are some roundings of the stress, in strain: 2.3 at most of 30 000 random cases.
    """
    if plateau is None:
        strength = JohnsonCookConstants(G, A, B, n, 0.0, 0.0, 0.0, TR, TM).checked()
    else:
        strength = Swift(G, A, B, plateau, n)
    q = 3 * G * x + static_flow(strength, ep + x)
    found = plastic_increment(strength, q, memory_of(strength, ep), (), 1.0)
    assert found == pytest.approx(x, rel=0, abs=8 * 2.0**-52 * q / (3 * G))


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("plateau", [None, 0.0, -1e-30])
def test_the_return_near_virgin_strain(real, plateau):
    """The slope of a power law overflows there; an elastic point stays as it is, others flow.

    So near its start, where Newton's estimates of what is left fail, the excess is only known to be
    below the root of round-off.
    """
    numbers = (G, A, B) if plateau is None else (G, A, B, plateau)
    kind = JohnsonCook if plateau is None else Swift
    rest = (Absent(), Absent()) if plateau is None else ()
    strength = kind(*(real(number) for number in (*numbers, 0.2)), *rest)
    strains = [0, *(10.0**-k for k in range(3, 300 if real is np.float64 else 44, 3))]
    with np.errstate(all="ignore"):
        for ep in map(real, strains):
            flow = static_flow(strength, ep)
            for q in map(real, (0, flow / 2, flow * 0.999, flow * 1.00001, flow * 1.01)):
                x = plastic_increment(strength, q, memory_of(strength, ep), (), real(1))
                assert (x > 0) == (q > flow)
                if x > 0:
                    left = q - 3 * G * x - static_flow(strength, ep + x)
                    assert abs(left) <= np.sqrt(np.finfo(real).eps) * q


def memory_of(strength, ep):
    """What a point remembers after a plastic strain."""
    return initial_memory(strength, 1.0)._replace(ep=ep)


@every_strength
def test_large_increments_converge(strength):
    """1, 10, 100 increments to 10 % strain at once end alike: at once is within 5 % of ep."""
    law, kin, found = EosStrength(EOS, strength), Axisymmetric(), []
    for steps in (1, 10, 100, 1000):
        state = stretched(law, kin, start(law, kin), isochoric(0.1 / steps), steps, 1e3 / steps)
        found.append((plastic_strain(law, kin, state), mises(law, kin, state)))
    # Radial loading: the return to a hardening surface has no error of the step at all.
    for ep, q in found:
        assert ep == pytest.approx(found[-1][0], rel=1e-9)
        assert q == pytest.approx(found[-1][1], rel=1e-9)


def test_line_has_the_same_numbers():
    law = EosStrength(EOS, COOK)
    one, three = (
        stretched(law, kin, start(law, kin), np.diag([-1e-3, 0, 0]), 30, 1e-3)
        for kin in (Line(), Space())
    )
    assert kirchhoff_stress(law, Line(), one) == pytest.approx(
        kirchhoff_stress(law, Space(), three)[:3], rel=1e-14
    )
    assert plastic_strain(law, Line(), one) == pytest.approx(plastic_strain(law, Space(), three))


def test_single_precision():
    """Newton's method ends in single precision, too, and the numbers stay in it."""
    law = EosStrength(EOS, COOK)
    single = law_in(law, np.float32)
    kin = Axisymmetric()
    state = initial_state(single, kin, np.float32(1))
    dl = kin.Tensor._make([np.float32(x) for x in (1e-2, 0, 0, -0.5e-2, -0.5e-2)])
    for _ in range(10):
        state = advance(single, kin, state, dl, np.float32(1e-3))
    assert all(isinstance(x, np.float32) for x in flat(state))
    double = stretched(law, kin, start(law, kin), np.diag([1e-2, -5e-3, -5e-3]), 10, 1e-3)
    assert float(plastic_strain(single, kin, state)) == pytest.approx(
        plastic_strain(law, kin, double), rel=1e-4
    )


# ---- high pressures, and creep ------------------------------------------------------------------


def test_strength_of_steinberg_and_guinan():
    """Y0 (1 + beta ep)^n (1 + A p J^(1/3) - B (T - 300)), bounded by Ymax (1980)."""
    part = SteinbergGuinan(48.0, 0.12, 36.0, 0.45, 0.2, 0.028, 3.77e-4, initial_temperature=400.0)
    law = EosStrength(EOS, part)
    for steps in (20, 1):
        state = stretched(law, Space(), start(law, Space()), np.diag([-0.01, 0, 0]), steps)
        p, ep = K * (1 - state.J), plastic_strain(law, Space(), state)
        hard = min(0.12 * (1 + 36 * ep) ** 0.45, 0.2)
        exact = hard * (1 + 0.028 * p * state.J ** (1 / 3) - 3.77e-2)
        assert mises(law, Space(), state) == pytest.approx(exact, rel=1e-10)
        assert (hard == 0.2) == (steps == 20)


def test_shear_modulus_of_steinberg_and_guinan():
    """G = G0 (1 + A p J^(1/3) - B (T - 300)), also in waves, and energy is conserved."""
    part = SteinbergGuinan(48.0, 1.2, 36.0, 0.45, 6.0, 0.028, 3.77e-4, initial_temperature=400.0)
    law, kin = EosStrength(EOS, part), Space()
    state, work = worked(law, kin, start(law, kin), -1e-3 * np.eye(3), 50)
    p, J = pressure_of(law, kin, state), state.J
    modulus = 48 * (1 + 0.028 * p * J ** (1 / 3) - 3.77e-2)
    assert wave_speed_squared(law, kin, state) * RHO / J == pytest.approx(
        K * J + 4 / 3 * modulus, rel=1e-10
    )
    state, more = worked(law, kin, state, isochoric(1e-4), 1)
    assert mises(law, kin, state) == pytest.approx(3 * modulus * 1e-4, rel=1e-3)
    state, last = worked(law, kin, state, np.diag([-1e-3, 1e-3, -5e-4]), 50)
    stored, lost = (f(law, kin, state) for f in (energy_density, dissipated_energy))
    assert stored + lost == pytest.approx(work + more + last, rel=1e-3)


@pytest.mark.parametrize("n", [1.0, 3.0, 8.0])
def test_stress_relaxes_by_creep(n):
    """q^(1-n) = q0^(1-n) + (n - 1) 3 G A t (Norton 1929), exactly exponential for n = 1."""
    rate = 3 * G * 0.1  # per time, at q = 0.3
    law = EosStrength(EOS, Norton.given(G, 0.1 * 0.3 ** (1 - n), n))
    state = stretched(law, Space(), start(law, Space()), isochoric(0.3 / (3 * G)), 1, 1e-12)
    for dt, steps, rel in ((1e-4, 400, 2e-2), (1e9, 1, None)):
        end = stretched(law, Space(), state, np.zeros((3, 3)), steps, dt)
        t = dt * steps * rate
        exact = np.exp(-t) if n == 1 else (1 + (n - 1) * t) ** (1 / (1 - n))
        if rel:
            assert mises(law, Space(), end) == pytest.approx(0.3 * exact, rel=rel)
        else:
            assert mises(law, Space(), end) < 0.3 * 0.1


def test_slow_creep_in_single_precision():
    """Rates of 1e-50 q^5 are below the least number; q^(1-n) = q0^(1-n) + (n - 1) 3 G A t."""
    double = EosStrength(
        LinearPressure(1 / 8e3, 1e11), Norton.given(6e10, 1e-35, 5.0, Q=3e4, T=900.0)
    )
    law, kin = law_in(double, np.float32), Space()
    state, steps = initial_state(law, kin, np.float32(1)), 40
    e = 1e8 / 1.8e11
    for dl, dt in [((e, -e / 2, -e / 2), 1e-3), *[((0.0, 0.0, 0.0), 1e5)] * steps]:
        dl = kin.Tensor._make(np.float32(x) for x in np.diag(dl).ravel())
        state = advance(law, kin, state, dl, np.float32(dt))
    rate = 1.8e11 * 1e-35 * np.exp(-3e4 / 900)
    exact = (1e8**-4 + 4 * rate * 1e5 * steps) ** -0.25
    assert mises(law, kin, state) == pytest.approx(exact, rel=1e-2)


def test_steady_creep_and_flow():
    """q = (rate/A)^(1/n), and (Y + H ep)(1 + (eta rate)^(1/n)) (Perzyna 1966), for any step."""
    creep = EosStrength(EOS, Norton.given(G, 0.2, 4.0, Q=1000.0, T=500.0))
    state = stretched(creep, Space(), start(creep, Space()), isochoric(1e-2), 20, 0.1)
    exact = (0.1 / (0.2 * np.exp(-2))) ** 0.25
    assert mises(creep, Space(), state) == pytest.approx(exact, rel=1e-2)
    flow = EosStrength(EOS, Perzyna(G, 0.4, 0.5, 0.03, 5.0))
    state = stretched(flow, Space(), start(flow, Space()), isochoric(1e-2), 20, 1e-4)
    after = stretched(flow, Space(), state, isochoric(1e-2), 1, 1e-4)
    ep, before = plastic_strain(flow, Space(), after), plastic_strain(flow, Space(), state)
    exact = (0.4 + 0.5 * ep) * (1 + (0.03 * (ep - before) / 1e-4) ** 0.2)
    assert mises(flow, Space(), after) == pytest.approx(exact, rel=1e-10)


def test_threshold_of_copper():
    """The differential equation of Follansbee & Kocks (1988) at a constant rate."""
    part = Mts(45.8, 0.04, 0.823e-3, 1.6, 1e7, 2 / 3, 1.0, 2.39, 0.9, 0.35, 1e8, 0.01)
    law, rate, T = EosStrength(EOS, part), 1e3, 293.0
    state = stretched(law, Space(), start(law, Space()), isochoric(1e-3), 200, 1e-3 / rate)
    ep = plastic_strain(law, Space(), state)
    ss = 0.9 * (rate / 1e8) ** (part.k * T / (0.35 * 45.8))
    s = integrated(lambda t, s: 2.39 * (1 - np.tanh(2 * s / ss) / np.tanh(2)), 0.01, ep, 2000)
    assert state.m.strength.threshold == pytest.approx(s, rel=3e-3)
    S = (1 - part.k * T / (1.6 * 45.8) * log(1e7 / rate)) ** 1.5
    assert mises(law, Space(), state) == pytest.approx(0.04 + S * s, rel=3e-3)


@pytest.mark.parametrize(
    "strength",
    [
        SteinbergGuinan(48.0, 0.12, 36.0, 0.45, 0.64, 0.028),
        Norton.given(G, 0.2, 4.0),
        Perzyna(G, 0.4, 0.5, 0.03, 5.0),
        Mts(45.8, 0.04, 0.823e-3, 1.6, 1e7, 2 / 3, 1.0, 2.39, 0.9, 0.35, 1e8, 0.01),
    ],
    ids=lambda s: type(s).__name__,
)
def test_tangents_of_rates(strength):
    """Against differences of fourth order."""
    law, space, h = EosStrength(EOS, strength), Space(), 1e-4
    state = stretched(law, space, start(law, space), isochoric(0.01), 3, 1e-3)

    def after(e):
        dl = matrix(space, np.diag([-0.01 + e, 0.004, 0.0]))
        return np.array(stress(law, space, advance(law, space, state, dl, 1e-3)))

    def stress_of(dl):
        return cauchy_stress(law, space, advance(law, space, state, dl, 1e-3))

    slope = (8 * (after(h) - after(-h)) - after(2 * h) + after(-2 * h)) / (12 * h)
    dl = matrix(space, np.diag([-0.01, 0.004, 0.0]))
    exact = [slopes_of(x, 9)[0] for x in on_numbers(stress_of)(seeded(dl))]
    assert exact[:3] == pytest.approx(np.diag(slope), abs=1e-8 * 200 + 1e-6)
