"""Equations of state: one point against the Hugoniot relations, adiabats and Tait's curve."""

from math import log, sqrt

import numpy as np
import pytest
from laws import closed_to, pressure_of, stretched, worked
from tensors import ALL_KINEMATICS, every_kinematics

from karamelo_py.compiler.tuples import flat
from karamelo_py.points.kinematics import Line, PlaneStrain, Space
from karamelo_py.points.laws import (
    cauchy_stress,
    dissipated_energy,
    energy_density,
    initial_state,
    jacobian,
    wave_speed_squared,
    with_stress,
    with_temperature,
)
from karamelo_py.points.laws.eos import (
    LinearPressure,
    bulk_modulus,
    compression_energy,
    pressure,
    ratio_at_pressure,
)
from karamelo_py.points.laws.eos.fluid import IdealGas, Tait
from karamelo_py.points.laws.eos.shock import Shock
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.strengths.linear import Elastic, Viscous
from karamelo_py.points.laws.temperatures import PlasticWork, Warm
from karamelo_py.points.laws.viscosity import ArtificialViscosity

RHO, C0, S, GAMMA, CV, TR = 8.96, 0.394, 1.489, 2.02, 383e-8, 298.0  # copper: g/cm3, cm/us
COPPER = Shock(1 / RHO, RHO * C0**2, S, GAMMA * RHO * CV, TR)
WATER = Tait(1.0, 3.0, 7.0)
AIR = IdealGas(1 / 1.2, 1.4, 2.5)
LINEAR = LinearPressure(0.5, 160.0)
every_curve = pytest.mark.parametrize(
    "eos",
    [COPPER, COPPER._replace(S=0.0), COPPER._replace(S=0.5), WATER, Tait(1.0, 3.0, 1.0), LINEAR],
    ids=["shock", "shock S=0", "shock S=0.5", "Tait", "Tait gamma=1", "linear"],
)


def test_hugoniot():
    """Behind a shock U = c0 + S u: rho0 U = rho (U - u) and p = rho0 U u (Rankine & Hugoniot)."""
    for u in np.linspace(0.001, 0.35, 30):
        U = C0 + S * u
        j = (U - u) / U
        assert pressure(COPPER, j, (), ()) == pytest.approx(RHO * U * u, rel=1e-12)
        mu = 1 / j - 1  # the form of the manuals
        form = RHO * C0**2 * mu * (1 + mu) / (1 - (S - 1) * mu) ** 2
        assert pressure(COPPER, j, (), ()) == pytest.approx(form, rel=1e-12)


def test_heat_adds_to_the_hugoniot_above_the_reference_temperature():
    cold = pressure(COPPER, 0.9, (), ())
    assert pressure(COPPER, 0.9, (), Warm(200.0)) == cold
    hot = pressure(COPPER, 0.9, (), Warm(498.0))
    assert hot - cold == pytest.approx(GAMMA * RHO * CV * 200, rel=1e-12)


def test_beyond_the_pole_pressure_goes_on_rising():
    """The curve has a pole at S (1 - J) = 1; pressure and modulus stay positive and finite."""
    j = np.linspace(1e-3, 1, 2000)
    p = np.array([pressure(COPPER, x, (), ()) for x in j])
    K = np.array([bulk_modulus(COPPER, x, (), ()) for x in j])
    assert np.all(np.diff(p) < 0) and np.all(K > 0) and np.all(np.isfinite(p + K))
    assert np.abs(np.diff(p)).max() < 0.2 * p.max()


def test_tension():
    """rho0 c0^2 mu: it rises with volume up to rho0 c0^2, and never goes back."""
    j = np.linspace(1, 50, 2000)
    p = np.array([pressure(COPPER, x, (), ()) for x in j])
    assert np.all(np.diff(p) < 0) and p.min() > -RHO * C0**2
    assert pressure(COPPER, 2.0, (), ()) == pytest.approx(-RHO * C0**2 / 2)


@every_curve
def test_modulus_and_energy_are_derivative_and_integral(eos):
    """-J dp/dJ by central differences, and the integral of p by Simpson's rule."""
    for j in (0.45, 0.62, 0.8, 0.95, 0.9999, 1.0001, 1.05, 1.4, 3.0):
        e = 1e-6 * j
        slope = (pressure(eos, j + e, (), ()) - pressure(eos, j - e, (), ())) / (2 * e)
        assert bulk_modulus(eos, j, (), ()) == pytest.approx(-j * slope, rel=1e-6)
        x = np.linspace(j, 1, 2001)
        p = np.array([pressure(eos, y, (), ()) for y in x])
        weights = np.r_[1, np.tile([4, 2], 999), 4, 1] * (x[1] - x[0]) / 3
        assert compression_energy(eos, j, ()) == pytest.approx(weights @ p, rel=1e-7)


def test_tension_that_copper_bears():
    """The pressure stays there; the energy is its integral, exactly; heat lowers the volume."""
    bears = COPPER._replace(tension=0.1 * COPPER.modulus)
    torn = 1 / 0.9  # rho0 c0^2 (1/J - 1) is the tension
    for j in (0.8, 1.0, 1.05, 1.11):
        assert pressure(bears, j, (), ()) == pressure(COPPER, j, (), ())
        assert compression_energy(bears, j, ()) == compression_energy(COPPER, j, ())
    before = compression_energy(COPPER, torn, ())
    for j in (1.2, 3.0):
        assert pressure(bears, j, (), Warm(TR)) == -bears.tension
        further = bears.tension * (j - torn)
        assert compression_energy(bears, j, ()) == pytest.approx(before + further, rel=1e-12)
    assert ratio_at_pressure(bears, -0.5 * COPPER.modulus, ()) == pytest.approx(torn, rel=1e-12)


@every_curve
def test_volume_at_a_pressure(eos):
    for j in (0.3, 0.5, 0.8, 0.999999, 1.0, 1.0001, 1.3):
        p = pressure(eos, j, (), ())
        assert ratio_at_pressure(eos, p, ()) == pytest.approx(j, rel=1e-12)


def test_tait():
    """p = K ((rho/rho0)^gamma - 1), and rho c^2 = K gamma (rho/rho0)^gamma."""
    law = EosStrength(WATER, Viscous(0.0, 1.0))
    for kin in ALL_KINEMATICS:
        state = initial_state(law, kin, 1.0)
        assert wave_speed_squared(law, kin, state) == pytest.approx(3.0 * 7)
        state = closed_to(law, kin, state, 0.9)
        assert pressure_of(law, kin, state) == pytest.approx(3 * (0.9**-7 - 1), rel=1e-12)
        c2 = wave_speed_squared(law, kin, state)
        assert c2 == pytest.approx(3 * 7 * 0.9**-7 * 0.9, rel=1e-12)
        assert pressure_of(law, kin, closed_to(law, kin, state, 100.0)) > -3


@every_kinematics
@pytest.mark.parametrize("steps", [1, 7, 100])
def test_adiabat_of_a_gas(kin, steps):
    """p V^gamma stays, whatever the size of the steps; c^2 = gamma p / rho; energy is the work."""
    law = EosStrength(AIR, Viscous(0.0, 1.0))
    state = initial_state(law, kin, 1.0)
    assert pressure_of(law, kin, state) == pytest.approx(1.0)
    for j in (0.25, 4.0):
        new = closed_to(law, kin, state, j, steps)
        p = j**-1.4
        assert pressure_of(law, kin, new) == pytest.approx(p, rel=1e-12)
        assert wave_speed_squared(law, kin, new) == pytest.approx(1.4 * p * j / 1.2, rel=1e-12)
        assert energy_density(law, kin, new) == pytest.approx((j**-0.4 - 1) * 2.5, rel=1e-12)


def test_imposed_pressure_of_a_gas():
    """fix initial_stress: the volume stays, the energy follows; a gas bears no tension."""
    law, kin = EosStrength(AIR, Viscous(0.0, 1.0)), PlaneStrain()
    state = initial_state(law, kin, 1.0)
    new = with_stress(law, kin, state, (-3.0, -3.0, -3.0, 0.0))
    assert jacobian(law, kin, new) == 1
    assert cauchy_stress(law, kin, new) == pytest.approx((-3, -3, -3, 0))
    assert pressure_of(law, kin, with_stress(law, kin, state, (1.0, 1.0, 1.0, 0.0))) == 0


@every_kinematics
def test_artificial_viscosity(kin):
    """q = rho h (Q1 h d^2 - Q2 c d) where d < 0 (von Neumann & Richtmyer, Landshoff), else 0."""
    Q1, Q2, h, dt = 1.5, 0.3, 0.2, 0.1
    plain = EosStrength(COPPER, Elastic(0.4))
    law = plain._replace(viscosity=ArtificialViscosity(Q1, Q2, h))
    e = -1e-3
    state = stretched(law, kin, initial_state(law, kin, 1.0), np.diag([e, 0, 0]), 1, dt)
    same = stretched(plain, kin, initial_state(plain, kin, 1.0), np.diag([e, 0, 0]), 1, dt)
    rho, d = RHO / (1 + e), e / dt
    c = sqrt(bulk_modulus(COPPER, 1 + e, (), ()) / rho)
    q = rho * h * (Q1 * h * d * d - Q2 * c * d)
    excess = pressure_of(law, kin, state) - pressure_of(plain, kin, same)
    assert excess == pytest.approx(q, rel=1e-9)
    assert dissipated_energy(law, kin, state) == pytest.approx(-q * e, rel=1e-9)
    # Damped waves take shorter steps: c' = sqrt(c^2 + a^2) + a with a = nu/h of this rate.
    a = q / (rho * h * -d)
    c2 = wave_speed_squared(plain, kin, same)
    assert wave_speed_squared(law, kin, state) >= (sqrt(c2 + a * a) + a) ** 2 * (1 - 1e-12)
    apart = stretched(law, kin, state, np.diag([-e, 0, 0]), 1, dt)
    again = stretched(plain, kin, same, np.diag([-e, 0, 0]), 1, dt)
    assert pressure_of(law, kin, apart) == pytest.approx(pressure_of(plain, kin, again), abs=1e-15)


def test_no_viscosity_has_no_number():
    plain = EosStrength(COPPER, Elastic(0.4))
    law = plain._replace(viscosity=ArtificialViscosity(1.5, 0.3, 0.2))
    assert len(flat(initial_state(plain, Space(), 1.0))) == 7  # J and s
    assert len(flat(initial_state(law, Space(), 1.0))) == 9


@pytest.mark.parametrize("steps", [400, 800])
def test_a_shocked_gas_heats_as_energy_says(steps):
    """Quick compression: stored and dissipated energy are the work, to the order of the step."""
    law = EosStrength(AIR, Viscous(0.0, 1.0), ArtificialViscosity(2.0, 0.2, 0.5))
    kin, e = Line(), log(0.4) / steps
    state, work = worked(
        law, kin, initial_state(law, kin, 1.0), np.diag([np.expm1(e), 0, 0]), steps, 0.5 / steps
    )
    stored, lost = energy_density(law, kin, state), dissipated_energy(law, kin, state)
    assert lost > 0.3 * stored
    # The viscous pressure jumps up in the first step, whose mean has half of it.
    assert stored + lost == pytest.approx(work, rel=3 / steps)
    p = (1.4 - 1) * (2.5 + stored + lost) / jacobian(law, kin, state)
    (q,) = state.m.viscous
    assert pressure_of(law, kin, state) == pytest.approx(p + q, rel=1e-12)


@every_kinematics
def test_newtonian_fluid(kin):
    """s = 2 mu dev(D), whose work 2 mu dev(D):dev(D) is lost; no memory of strain."""
    mu, rate, dt = 0.7, 0.3, 1e-4
    law = EosStrength(WATER, Viscous(mu, 0.1))
    state = stretched(law, kin, initial_state(law, kin, 1.0), np.diag([rate * dt, 0, 0]), 3, dt)
    s = np.array(cauchy_stress(law, kin, state))[:3] + pressure_of(law, kin, state)
    assert s == pytest.approx(2 * mu * rate * np.array([2, -1, -1]) / 3, rel=1e-9)
    lost = 3 * dt * 4 / 3 * mu * rate**2
    assert dissipated_energy(law, kin, state) == pytest.approx(lost, rel=1e-3)
    at_rest = stretched(law, kin, state, np.zeros((3, 3)), 1, dt)
    assert np.array(cauchy_stress(law, kin, at_rest))[:3] == pytest.approx(
        -pressure_of(law, kin, at_rest)
    )
    # nu/h = 4/3 mu/(rho h) slows the step as damping xi = nu/(c h) does.
    a = 4 / 3 * mu / 0.1
    start = initial_state(law, kin, 1.0)
    assert wave_speed_squared(law, kin, start) == pytest.approx((sqrt(21 + a * a) + a) ** 2)


def test_thermal_pressure():
    """A warm body presses: p = alpha (T - T0); it is at rest at T0."""
    heat = PlasticWork(0.9, 385.0, 0.0, 0.02, 298.0, 1356.0)
    law, kin = EosStrength(LINEAR, Elastic(80.0), temperature=heat), PlaneStrain()
    state = initial_state(law, kin, 1.0)
    assert pressure_of(law, kin, state) == 0
    assert pressure_of(law, kin, with_temperature(law, kin, state, 398.0)) == pytest.approx(2.0)
    # Free of stress at the volume that expansion gives: J = 1 + alpha (T - T0)/K.
    warm = with_temperature(law, kin, state, 398.0)
    free = with_stress(law, kin, warm, (0.0, 0.0, 0.0, 0.0))
    assert jacobian(law, kin, free) == pytest.approx(1 + 2 / 160)


@pytest.mark.parametrize("alpha", [0.0, 2e-5])
def test_energy_of_a_warm_body_is_the_integral_of_its_pressure(alpha):
    """W' = -p at a temperature, with heat by Gamma, by alpha, or both (central differences).

    Without that of Gamma a body that begins warm seemed to gain energy as it expanded.
    """
    heat = PlasticWork(0.9, CV, 0.0, alpha, TR, 1356.0)
    law, kin = EosStrength(COPPER, Viscous(0.0, 0.0), temperature=heat), Line()
    for j in (0.8, 1.0, 1.02):
        ways = [closed_to(law, kin, initial_state(law, kin, 1.0), j + e) for e in (-1e-5, 0, 1e-5)]
        at = [with_temperature(law, kin, state, 800.0) for state in ways]
        W = [energy_density(law, kin, state) for state in at]
        p = pressure_of(law, kin, at[1])
        assert (W[2] - W[0]) / 2e-5 == pytest.approx(-p, rel=1e-6)


def test_tension_of_a_liquid():
    """tension cuts Tait's curve: pressure stays, energy grows with the volume."""
    whole, torn = Tait(1e-3, 2.0, 7.0), Tait(1e-3, 2.0, 7.0, 0.5)
    start = ratio_at_pressure(torn, -0.5, ())
    assert pressure(whole, start, (), ()) == pytest.approx(-0.5)
    assert ratio_at_pressure(torn, -1.0, ()) == start
    for j in (0.95, 1.0, 1.01):
        assert pressure(torn, j, (), ()) == pressure(whole, j, (), ())
        assert compression_energy(torn, j, ()) == pytest.approx(compression_energy(whole, j, ()))
    assert pressure(torn, 1.5, (), ()) == -0.5
    grown = compression_energy(torn, 1.5, ()) - compression_energy(torn, 1.2, ())
    assert grown == pytest.approx(0.5 * 0.3)
    none = Tait(1e-3, 2.0, 7.0, 0.0)
    assert pressure(none, 1.2, (), ()) == 0 and compression_energy(none, 1.2, ()) == 0
    # Where nothing is torn the formula holds at any volume, in single precision, too.
    assert compression_energy(whole, 200.0, ()) == pytest.approx(2 * (199 - 1 / 6), rel=1e-9)
    real = np.float32
    single = Tait(real(1e-3), real(2), real(7), real(np.inf))
    assert compression_energy(single, real(20), ()) == pytest.approx(2 * (19 - 1 / 6), rel=1e-5)
