"""Constitutive laws of one point: stress against energy, speed against the acoustic tensor."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tensors import (
    deformations,
    every_kinematics,
    flat,
    matrix,
    rotation,
    symmetric_flat,
    symmetric_matrix,
    symmetric_tensors,
    tensors,
)

from karamelo_py.points.kinematics import Line, PlaneStrain, Space, inner
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    elastic_strain,
    energy_density,
    initial_state,
    jacobian,
    kirchhoff_stress,
    specific_volume,
    wave_speed_bound,
    wave_speed_squared,
    with_stress,
)
from karamelo_py.points.laws.hencky import Hencky
from karamelo_py.points.laws.linear import FixedFrame, LinearElastic
from karamelo_py.points.laws.neo_hookean import NeoHookean, NeoHookeanConstants
from karamelo_py.points.laws.parameters import lame_parameters

E, NU, RHO = 100.0, 0.3, 2.0
LAM, G = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
LAWS = [law(1 / RHO, LAM, G) for law in (LinearElastic, FixedFrame, NeoHookean, Hencky)]
NEO = LAWS[2]
SPACE = Space()


def deformed(kin, f):
    """The state of the neo-Hookean solid at the deformation gradient `f`."""
    return initial_state(NEO, kin, 1.0)._replace(F=f)


every_law = pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)


def test_lame_parameters():
    """Textbook formulas: G = E/(2(1+nu)), lambda = E nu/((1+nu)(1-2nu))."""
    assert lame_parameters(E, NU) == pytest.approx((LAM, G))


@every_kinematics
@every_law
def test_at_rest(law, kin):
    """No stress, no energy, and longitudinal waves at sqrt((lambda + 2 G)/rho)."""
    state = initial_state(law, kin, 1.0)
    assert cauchy_stress(law, kin, state) == pytest.approx((0.0,) * len(kin.symmetric_names))
    assert energy_density(law, kin, state) == pytest.approx(0)
    assert elastic_strain(law, kin, state) == pytest.approx((0.0,) * len(kin.symmetric_names))
    assert jacobian(law, kin, state) == 1
    assert wave_speed_squared(law, kin, state) == pytest.approx((LAM + 2 * G) / RHO)
    assert specific_volume(law) == 1 / RHO


@every_kinematics
@every_law
def test_small_uniaxial_strain_is_hookes_law(law, kin):
    """sigma_11 = (lambda + 2 G) e, sigma_22 = sigma_33 = lambda e; e = 1e-7 leaves e^2 out."""
    e = 1e-7
    dl = flat(kin, np.diag([e, 0.0, 0.0]))
    state = advance(law, kin, initial_state(law, kin, 1.0), dl, 1.0)
    expected = np.zeros(len(kin.symmetric_names))
    expected[:3] = LAM * e
    expected[0] += 2 * G * e
    assert cauchy_stress(law, kin, state) == pytest.approx(expected, rel=1e-6, abs=1e-12)
    assert elastic_strain(law, kin, state)[:3] == pytest.approx((e, 0, 0), rel=1e-6, abs=1e-12)
    # The difference of energies is rounded relative to the moduli.
    assert energy_density(law, kin, state) == pytest.approx((LAM / 2 + G) * e * e, abs=1e-13)


@pytest.mark.parametrize("law", LAWS[:2], ids=lambda law: type(law).__name__)
def test_large_uniaxial_strain_of_the_rate_law(law):
    """The rate law sums the increments: after many of them, logarithmic strain."""
    kin, steps, stretch = PlaneStrain(), 2000, 1.5
    ratio = stretch ** (1 / steps) - 1
    state = initial_state(law, kin, 1.0)
    for _ in range(steps):
        state = advance(law, kin, state, flat(kin, np.diag([ratio, 0.0, 0.0])), 1.0)
    assert jacobian(law, kin, state) == pytest.approx(stretch, rel=1e-9)
    # ln(1 + r) = r - r^2/2: relative error r/2 = 1e-4 of the sum of the r.
    strain = np.log(stretch)
    assert cauchy_stress(law, kin, state)[0] == pytest.approx((LAM + 2 * G) * strain, rel=2e-4)
    assert cauchy_stress(law, kin, state)[1] == pytest.approx(LAM * strain, rel=2e-4)


@every_kinematics
@given(data=st.data())
def test_neo_hookean_stress_is_the_published_one(kin, data):
    """P = G (F - F^-T) + lambda ln J F^-T (Bonet & Wood 2008, eq. 6.28), tau = P F^T."""
    f = data.draw(deformations(kin))
    full = matrix(kin, f, 1.0)
    inverse, j = np.linalg.inv(full).T, np.linalg.det(full)
    tau = (G * (full - inverse) + LAM * np.log(j) * inverse) @ full.T
    state = deformed(kin, f)
    assert kirchhoff_stress(NEO, kin, state) == pytest.approx(symmetric_flat(kin, tau), abs=1e-10)
    assert cauchy_stress(NEO, kin, state) == pytest.approx(symmetric_flat(kin, tau / j), abs=1e-10)
    strain = (full.T @ full - np.eye(3)) / 2
    assert elastic_strain(NEO, kin, state) == pytest.approx(symmetric_flat(kin, strain), abs=1e-12)


@every_kinematics
@given(data=st.data())
def test_neo_hookean_stress_is_the_derivative_of_its_energy(kin, data):
    """dW = tau : d for F -> (I + e d) F; central differences with e = 1e-5 err by 1e-8 of E."""
    f, direction = data.draw(deformations(kin)), data.draw(tensors(kin))
    e, state = 1e-5, deformed(kin, f)
    ahead = advance(NEO, kin, state, e * direction, 1.0)
    back = advance(NEO, kin, state, -e * direction, 1.0)
    slope = (energy_density(NEO, kin, ahead) - energy_density(NEO, kin, back)) / (2 * e)
    gradient = matrix(kin, direction)
    d = symmetric_flat(kin, (gradient + gradient.T) / 2)
    assert slope == pytest.approx(inner(kirchhoff_stress(NEO, kin, state), d), abs=1e-5)


@given(f=deformations(SPACE), angle=st.floats(-3, 3))
def test_neo_hookean_is_objective(f, angle):
    """A turned point has the turned stress and the same energy."""
    turn = rotation(angle * np.array([1, 2, 3]) / 14**0.5)
    turned = deformed(SPACE, flat(SPACE, turn @ matrix(SPACE, f, 1.0)))
    stress = symmetric_matrix(SPACE, cauchy_stress(NEO, SPACE, deformed(SPACE, f)))
    expected = symmetric_flat(SPACE, turn @ stress @ turn.T)
    assert cauchy_stress(NEO, SPACE, turned) == pytest.approx(expected, abs=1e-9)
    assert energy_density(NEO, SPACE, turned) == pytest.approx(
        energy_density(NEO, SPACE, deformed(SPACE, f))
    )


@pytest.mark.parametrize("kin, axis", [(PlaneStrain(), (0, 0, 1)), (SPACE, (1, 2, 3))])
def test_only_the_objective_rate_turns_the_stress(kin, axis):
    """A right angle in 200 increments: LinearElastic's stress turns, the other stays behind.

    Each increment has an angle of 0.008, whose error is 0.008^5/120; 200 of them err by 5e-11.
    An increment I + w also swells the volume by w^2/2, which the rate law sees as a strain of
    nothing: sym(w) = 0.
    """
    steps = 200
    angle = np.pi / 2
    axis = np.asarray(axis) / np.linalg.norm(axis)
    x, y, z = axis * angle / steps
    dl = flat(kin, np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]))
    stress = kin.Symmetric._make([1.0, 2.0, 3.0, 4.0, 5.0, 6.0][: len(kin.symmetric_names)])
    turn = rotation(angle * axis)
    expected = symmetric_flat(kin, turn @ symmetric_matrix(kin, stress) @ turn.T)
    results = []
    for law in LAWS[:2]:
        state = with_stress(law, kin, initial_state(law, kin, 1.0), stress)
        for _ in range(steps):
            state = advance(law, kin, state, dl, 1.0)
        results.append(cauchy_stress(law, kin, state))
    assert results[0] == pytest.approx(expected, abs=1e-9)
    assert results[1] == pytest.approx(stress, abs=1e-12)


@pytest.mark.parametrize("law", LAWS[:2], ids=lambda law: type(law).__name__)
@every_kinematics
@given(data=st.data())
def test_energy_of_the_rate_law_is_hookes(law, kin, data):
    """W = J sigma : e / 2 with Hooke's strain e of the stress."""
    stress = data.draw(symmetric_tensors(kin))
    state = with_stress(law, kin, initial_state(law, kin, 1.0), stress)
    full = symmetric_matrix(kin, stress)
    strain = ((1 + NU) * full - NU * np.trace(full) * np.eye(3)) / E
    assert elastic_strain(law, kin, state) == pytest.approx(symmetric_flat(kin, strain), abs=1e-12)
    assert energy_density(law, kin, state) == pytest.approx(np.sum(full * strain) / 2, abs=1e-12)


# --- wave speed -------------------------------------------------------------------------------


def fastest_wave(law, f, direction):
    """Largest eigenvalue of the acoustic tensor, along n and per mass: the square of a speed.

    rho0 c^2 a = (d(P) F^T) n with d(P) the change of P = tau F^-T when F changes by (a (x) n) F
    (Ogden 1984, section 6.4); by central differences.
    """
    n = np.asarray(direction) / np.linalg.norm(direction)
    full = matrix(SPACE, f, 1.0)
    q = np.zeros((3, 3))
    e = 1e-6
    for k in range(3):
        gradient = np.outer(np.eye(3)[k], n)
        change = np.zeros((3, 3))
        for sign in (1, -1):
            moved = (np.eye(3) + sign * e * gradient) @ full
            tau = symmetric_matrix(
                SPACE, kirchhoff_stress(law, SPACE, deformed(SPACE, flat(SPACE, moved)))
            )
            change += sign * tau @ np.linalg.inv(moved).T / (2 * e)
        q[:, k] = change @ full.T @ n
    return np.linalg.eigvalsh((q + q.T) / 2).max() / RHO


@given(f=deformations(SPACE), n=st.tuples(*[st.floats(-1, 1)] * 3))
def test_neo_hookean_is_no_faster_than_its_bound(f, n):
    """The stable step relies on it: no wave, in any direction, outruns the bound."""
    if np.linalg.norm(n) < 0.1:
        n = (1.0, 0.0, 0.0)
    assert wave_speed_squared(NEO, SPACE, deformed(SPACE, f)) >= fastest_wave(NEO, f, n) * (
        1 - 1e-6
    )


@given(f=deformations(SPACE), nu=st.floats(-0.9, 0.49), size=st.floats(0.3, 4))
def test_the_quick_bound_of_neo_hookean_is_not_below_its_speed(f, nu, size):
    """Points are passed over by it: 1 - ln J <= 1 / J, and ln J - 1 <= J / e^2 where lambda < 0."""
    law = NeoHookeanConstants(RHO, E, nu).checked()
    state = deformed(SPACE, size * f)
    squared = wave_speed_squared(law, SPACE, state)
    assert wave_speed_bound(law, SPACE, state) >= squared * (1 - 1e-14)


@pytest.mark.parametrize("a", [0.5, 1.0, 1.7])
def test_neo_hookean_speed_is_exact_under_uniaxial_stretch(a):
    """rho c^2 = G (1 + a^2) + lambda (1 - ln a), the derivative of a P_11 with respect to a."""
    f = flat(SPACE, np.diag([a, 1.0, 1.0]))
    along = (1, 0, 0) if a >= 1 else (0, 1, 0)  # the direction of the largest stretch
    bound = wave_speed_squared(NEO, SPACE, deformed(SPACE, f))
    assert bound * RHO == pytest.approx(G * (1 + max(a, 1) ** 2) + LAM * (1 - np.log(a)))
    assert bound == pytest.approx(fastest_wave(NEO, f, along), rel=1e-6)


def test_rate_law_speed_follows_the_density():
    """Constant moduli, and a volume per mass that has grown by J: c^2 = (lambda + 2 G) J / rho."""
    law = LAWS[0]
    state = initial_state(law, Line(), 1.0)._replace(J=1.25)
    assert wave_speed_squared(law, Line(), state) == pytest.approx((LAM + 2 * G) * 1.25 / RHO)
