"""Strengths of soils: yield surfaces, edges and apex, triaxial strength, dilatancy, softening."""

from math import cos, log, radians, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import TURN, start, stress, stretched, worked
from selection import few
from tensors import every_kinematics, flat, symmetric_flat, symmetric_matrix, symmetric_tensors

from karamelo_py.compiler.tuples import flat as flattened
from karamelo_py.compiler.tuples import nested_as
from karamelo_py.points.kinematics import (
    Axisymmetric,
    PlaneStrain,
    Space,
)
from karamelo_py.points.kinematics.principal import from_principal, principal
from karamelo_py.points.laws import (
    advance,
    dissipated_energy,
    elastic_strain,
    energy_density,
    initial_state,
    jacobian,
    plastic_strain,
    with_stress,
)
from karamelo_py.points.laws.eos import LinearPressure
from karamelo_py.points.laws.eos.shock import Shock
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.strengths.drucker_prager import DruckerPrager
from karamelo_py.points.laws.strengths.mohr_coulomb import MohrCoulomb, returned_to_plane

RHO, K, G = 2.0, 100.0, 60.0
COHESION, PHI, PSI = 0.3, 30.0, 10.0
EOS = LinearPressure(1 / RHO, K)
FITS = ("compression", "extension", "plane-strain")


def mohr(c=COHESION, phi=PHI, psi=PSI, **options):
    return EosStrength(EOS, MohrCoulomb.given(G, c, phi, psi, **options))


def drucker(c=COHESION, phi=PHI, psi=PSI, **options):
    return EosStrength(EOS, DruckerPrager.given(G, c, phi, psi, **options))


LAWS = [mohr(), mohr(psi=0), mohr(phi=0, psi=0), mohr(c=0), drucker(), drucker(fit="plane-strain")]
every_law = pytest.mark.parametrize("law", LAWS, ids=range(len(LAWS)))


def mohr_excess(full, c=COHESION, phi=PHI):
    """s1 - s3 + (s1 + s3) sin(phi) - 2 c cos(phi)."""
    s = np.linalg.eigvalsh(full)
    a = radians(phi)
    return s[2] - s[0] + (s[2] + s[0]) * sin(a) - 2 * c * cos(a)


def drucker_excess(full, strength):
    p = -np.trace(full) / 3
    s = full + p * np.eye(3)
    return sqrt(np.sum(s * s) / 2) - strength.cohesion - strength.friction * p


def excess(law, full):
    if "Mohr" in type(law.strength).__name__:
        s = np.linalg.eigvalsh(full)
        return s[2] - s[0] + (s[2] + s[0]) * law.strength.friction - 2 * law.strength.cohesion
    return drucker_excess(full, law.strength)


@every_kinematics
@given(data=st.data())
def test_principal_values(kin, data):
    """Values are eigenvalues, and the tensor comes back; also where some are nearly equal."""
    s = data.draw(symmetric_tensors(kin))
    for factor, normal in ((1, s[:3]), (1, (1.0,) * 3), (1e-9, (1.0,) * 3)):
        t = s._make([*normal, *(factor * x for x in s[3:])])
        values, directions = principal(t)
        known = np.linalg.eigvalsh(symmetric_matrix(kin, t))
        assert np.sort(values) == pytest.approx(known, abs=4e-16 * 8)
        assert from_principal(t, values, directions) == pytest.approx(t, abs=2e-15)


@every_kinematics
@every_law
@given(data=st.data())
def test_stress_ends_within_the_surface(law, kin, data):
    """From any stress inside, by any increment: on the surface to 1e-11 of the stress, or inside.

    What is plastic is on it: nothing flows inside.
    """
    direction = np.array(data.draw(symmetric_tensors(kin)))
    state, e = start(law, kin), data.draw(st.floats(1e-4, 0.03))
    full = symmetric_matrix(kin, tuple(direction))
    if kin.dimension == 1:
        full = np.diag([full[0, 0], 0, 0])
    elif isinstance(kin, PlaneStrain):
        full[2, 2] = 0
    for sign in (1, -0.5, 1.5):
        before = plastic_strain(law, kin, state)
        state = stretched(law, kin, state, sign * e * full, 2)
        found = stress(law, kin, state)
        scale = max(1.0, np.abs(found).max())
        assert excess(law, found) < 1e-12 * scale * 10
        if plastic_strain(law, kin, state) > before + 1e-9:
            last = stretched(law, kin, state, sign * e * full, 1)
            if plastic_strain(law, kin, last) > plastic_strain(law, kin, state):
                found = stress(law, kin, last)
                scale = max(1.0, np.abs(found).max())
                assert abs(excess(law, found)) < 1e-12 * scale * 10


def triaxial(law, radial, steps=400, rate=-2e-4):
    """Axial stress at failure in a triaxial test: constant radial stress, by axial strain.

    The radial strain that keeps the radial stress is found by the secant method in each step.
    """
    kin = Axisymmetric()
    state = with_stress(law, kin, start(law, kin), (-radial, -radial, -radial, 0.0))

    def tried(r):
        new = stretched(law, kin, state, np.diag([r, rate, r]), 1)
        return new, stress(law, kin, new)[0, 0] + radial

    b = -rate / 2
    for _ in range(steps):
        a = 0.9 * b
        fa, (new, fb) = tried(a)[1], tried(b)
        for _ in range(60):
            if abs(fb) < 1e-13 or fb == fa:
                break
            a, fa, b = b, fb, b - fb * (b - a) / (fb - fa)
            new, fb = tried(b)
        state = new
    return stress(law, kin, state)[1, 1], state


@pytest.mark.parametrize("radial", few((0.0, 0.5, 2.0), 0.0, 2.0))
def test_triaxial_compression(radial):
    """Fails at N sigma3 + 2 c sqrt(N), N = (1 + sin)/(1 - sin); the compression cone agrees."""
    N = (1 + sin(radians(PHI))) / (1 - sin(radians(PHI)))
    strength = N * radial + 2 * COHESION * sqrt(N)
    for law in (mohr(psi=0), mohr(), drucker(), mohr(psi=PHI)):
        axial, state = triaxial(law, radial)
        assert plastic_strain(law, Axisymmetric(), state) > 0
        assert -axial == pytest.approx(strength, rel=1e-9)


@pytest.mark.parametrize("radial", few((2.0, 3.0), 2.0))
def test_triaxial_extension(radial):
    """Fails where the axial stress falls to (sigma3 - 2 c sqrt(N))/N; the extension cone agrees."""
    N = (1 + sin(radians(PHI))) / (1 - sin(radians(PHI)))
    strength = (radial - 2 * COHESION * sqrt(N)) / N
    for law in (mohr(psi=0), mohr(), drucker(fit="extension", psi=0)):
        axial, _ = triaxial(law, radial, rate=2e-4)
        assert -axial == pytest.approx(strength, rel=1e-9)


@pytest.mark.parametrize("psi", few((0.0, 12.0, PHI), 0.0, PHI))
def test_plane_strain_cone(psi):
    """Flow in plane strain ends where Mohr-Coulomb ends, for any psi.

    Drucker & Prager 1952 for psi = phi; with s_zz by the flow rule for others.
    """
    kin, ends = PlaneStrain(), []
    for law in (mohr(psi=psi), drucker(fit="plane-strain", psi=psi)):
        state = with_stress(law, kin, start(law, kin), (-2.0, -2.0, -2.0, 0.0))
        # Pure shear at a constant mean stress in the plane: dilate as flow does.
        for _ in range(600):
            a, b = 0.0, 1e-5

            def mean(v, state=state, law=law):
                new = stretched(law, kin, state, np.diag([2e-4 + v, -2e-4 + v, 0]), 1)
                full = stress(law, kin, new)
                return (full[0, 0] + full[1, 1]) / 2 + 2.0

            fa, fb = mean(a), mean(b)
            for _ in range(50):
                if fa == fb or abs(fb) < 1e-13:
                    break
                a, fa, b = b, fb, b - fb * (b - a) / (fb - fa)
                fb = mean(b)
            state = stretched(law, kin, state, np.diag([2e-4 + b, -2e-4 + b, 0]), 1)
        full = stress(law, kin, state)
        ends.append(full[0, 0] - full[1, 1])
    limit = 2 * (COHESION * cos(radians(PHI)) + 2.0 * sin(radians(PHI)))
    assert ends == pytest.approx([limit, limit], rel=5e-5)  # s_zz gets there by flow


def test_tension_ends_at_the_apex():
    """p = -c cot(phi), without shear; Mohr-Coulomb's apex and that of every cone."""
    apex = COHESION / tan(radians(PHI))
    for law in (
        mohr(),
        mohr(psi=0),
        *(drucker(fit=fit, psi=psi) for fit in FITS for psi in (0, 5)),
    ):
        for kin in (Axisymmetric(), Space()):
            loading = np.diag([0.02, 0.015, 0.018])
            state = stretched(law, kin, start(law, kin), loading, 3)
            assert stress(law, kin, state) == pytest.approx(apex * np.eye(3), abs=1e-12)
            # A little compression unloads it at once.
            back = stretched(law, kin, state, -1e-3 * np.eye(3), 1)
            assert np.trace(stress(law, kin, back)) / 3 < apex - 0.9 * 3 * K * 1e-3 * 0.9


@pytest.mark.parametrize("make", [mohr, drucker])
@pytest.mark.parametrize("psi", [0, PSI])
def test_what_comes_apart_closes_before_it_bears_pressure(make, psi):
    """Sand that has opened by 3 % bears nothing until that is given back, then K (1 - J) again.

    When the volume of opening was plastic, it bore the pressure of 3 % at its first volume.
    """
    law, kin = make(c=0, psi=psi), Space()
    state = stretched(law, kin, start(law, kin), 0.001 * np.eye(3), 12)
    opened = jacobian(law, kin, state)
    assert opened > 1.03
    back = -0.001 * np.eye(3)
    while jacobian(law, kin, state) > 1.004:
        assert np.abs(stress(law, kin, state)).max() < 1e-12
        state = stretched(law, kin, state, back, 1)
    state = stretched(law, kin, state, 3 * back, 1)
    j = jacobian(law, kin, state)
    assert j < 1
    assert stress(law, kin, state) == pytest.approx(-K * (1 - j) * np.eye(3), abs=1e-12)


@pytest.mark.parametrize("make", [mohr, drucker])
def test_cohesion_is_not_given_back_twice(make):
    """A cycle of opening and closing dissipates what opening does, -p ln J at the apex, once."""
    law, kin = make(), Space()
    apex = COHESION / tan(radians(PHI))
    state = stretched(law, kin, start(law, kin), 1e-4 * np.eye(3), 100)
    elastic = 1 + apex / K
    spent = dissipated_energy(law, kin, state)
    assert spent == pytest.approx(apex * np.log(jacobian(law, kin, state) / elastic), rel=0.03)
    closed = stretched(law, kin, state, -1.2e-4 * np.eye(3), 100)
    assert np.trace(stress(law, kin, closed)) < 0
    assert dissipated_energy(law, kin, closed) == pytest.approx(spent, rel=1e-6)


def test_tension_cut_off():
    """With shear as much as the cone has there."""
    law, kin = drucker(tension=0.1), Space()
    state = stretched(law, kin, start(law, kin), np.diag([0.02, 0.001, -0.003]), 5)
    full = stress(law, kin, state)
    assert np.trace(full) / 3 == pytest.approx(0.1, rel=1e-12)
    assert drucker_excess(full, law.strength) == pytest.approx(0, abs=1e-12)
    small = stretched(law, kin, start(law, kin), np.diag([0.02, 0.02, 0.0201]), 5)
    assert np.trace(stress(law, kin, small)) / 3 == pytest.approx(0.1, rel=1e-12)
    assert drucker_excess(stress(law, kin, small), law.strength) < -0.05


@given(
    s=st.tuples(*[st.floats(-5, 5, allow_subnormal=False)] * 3),
    phi=st.floats(0, 60),
    share=st.floats(0, 1),
    c=st.floats(0.01, 2),
)
def test_the_return_is_the_closest_point(s, phi, share, c):
    """On the surface, in order, and by a flow of nonnegative multiples (Koiter 1953).

    The plastic strain D^-1 (trial - new) is a sum of the normals of the planes that are active,
    with factors that are not negative; at the apex the sum is over all six.
    """
    a, b = radians(phi), radians(phi * share)
    k, sa, sb = c * cos(a), sin(a), sin(b)
    trial = tuple(sorted(s, reverse=True))
    if trial[0] - trial[2] + (trial[0] + trial[2]) * sa - 2 * k <= 1e-9:
        return
    t = np.array(returned_to_plane(trial, (k, sa, sb), G, K))
    assert t[0] >= t[1] - 1e-12 and t[1] >= t[2] - 1e-12
    assert t[0] - t[2] + (t[0] + t[2]) * sa - 2 * k == pytest.approx(0, abs=1e-11)
    gap = np.array(trial) - t
    mean = gap.mean()
    flow = (gap - mean) / (2 * G) + mean / (3 * K)
    if t[0] - t[2] < 1e-9:
        return  # the apex; which flow leads there has no rule for psi below phi
    m13 = np.array([1 + sb, 0, sb - 1])
    m23, m12 = np.array([0, 1 + sb, sb - 1]), np.array([1 + sb, sb - 1, 0])
    planes = [m13]
    if t[0] - t[1] < 1e-9:
        planes.append(m23)
    if t[1] - t[2] < 1e-9:
        planes.append(m12)
    factors, *_ = np.linalg.lstsq(np.array(planes).T, flow, rcond=None)
    assert np.array(planes).T @ factors == pytest.approx(flow, abs=1e-11)
    assert factors.min() > -1e-11


@pytest.mark.parametrize("make", [mohr, drucker])
def test_dilatancy(make):
    """Plastic volume grows by sin(psi) (Mohr-Coulomb, plane strain) of the plastic shear.

    In shear of a constant volume the pressure that this makes is K times it, and J stays: the
    elastic J takes it.
    """
    law, kin = make(c=0.3, phi=0.001, psi=0.001), PlaneStrain()
    state = stretched(law, kin, start(law, kin), np.diag([1e-4, -1e-4, 0]), 100)
    assert stress(law, kin, state).trace() == pytest.approx(0, abs=3e-3)
    law = make(psi=PSI)
    state = with_stress(law, kin, start(law, kin), (-1.0, -1.0, -1.0, 0.0))
    j = jacobian(law, kin, state)
    new = stretched(law, kin, state, np.diag([1e-5, -1e-5, 0]), 1000)
    assert jacobian(law, kin, new) == pytest.approx(j, rel=1e-6)
    p = -stress(law, kin, new).trace() / 3
    elastic = sum(elastic_strain(law, kin, new)[:3])
    assert p == pytest.approx(K * (1 - np.exp(elastic)), rel=1e-9)
    plastic_volume = log(j) - elastic
    assert plastic_volume > 0
    if make is mohr:
        full = stress(law, kin, new)
        shear = (2e-2 - (full[0, 0] - full[1, 1]) / (2 * G)) / 2 * 2
        assert plastic_volume == pytest.approx(sin(radians(PSI)) * shear, rel=2e-3)
    none = make(psi=0)
    state = with_stress(none, kin, start(none, kin), (-1.0, -1.0, -1.0, 0.0))
    new = stretched(none, kin, state, np.diag([1e-5, -1e-5, 0]), 1000)
    assert stress(none, kin, new).trace() / 3 == pytest.approx(-1.0, rel=1e-4)


@pytest.mark.parametrize("make", [mohr, drucker])
def test_softening_to_the_residual_strength(make):
    """Half way the mean of peak and residual, in the end the residual."""
    law = make(psi=0, residual_cohesion=0.1, residual_phi=20, softening=0.05)
    peak, rest = make(psi=0), make(c=0.1, phi=20, psi=0)
    kin = PlaneStrain()
    state = with_stress(law, kin, start(law, kin), (-1.0, -1.0, -1.0, 0.0))
    e = 2e-5
    while plastic_strain(law, kin, state) < 0.025:
        state = stretched(law, kin, state, np.diag([e, -e, 0]), 1)
    half = stress(law, kin, state)
    assert excess(peak, half) < 0 < excess(rest, half)
    mean = law._replace(
        strength=peak.strength._replace(
            cohesion=(peak.strength.cohesion + rest.strength.cohesion) / 2,
            friction=(peak.strength.friction + rest.strength.friction) / 2,
        )
    )
    assert excess(mean, half) == pytest.approx(0, abs=1e-3)
    state = stretched(law, kin, state, np.diag([e, -e, 0]), 4000)
    assert plastic_strain(law, kin, state) > 0.06
    assert excess(rest, stress(law, kin, state)) == pytest.approx(0, abs=1e-12)


def test_softening_converges_with_the_step():
    law, kin, found = mohr(residual_cohesion=0.05, softening=0.02), PlaneStrain(), []
    for steps in (50, 100, 200, 1600):
        state = with_stress(law, kin, start(law, kin), (-1.0, -1.0, -1.0, 0.0))
        state = stretched(law, kin, state, np.diag([0.01, -0.01, 0]) / steps, steps)
        found.append(stress(law, kin, state)[0, 0])
    errors = np.abs(np.array(found[:-1]) - found[-1])
    assert errors[2] < 0.6 * errors[1] < 0.4 * errors[0]


@every_law
def test_work_is_stored_or_dissipated(law):
    """Stored + dissipated = work, to the order of the step; nothing is dissipated below 0."""
    kin, errors = Space(), []
    loading = np.diag([0.012, -0.015, 0.001]) + 0.004 * np.eye(3, k=1)
    for steps in (100, 400):
        begin = with_stress(law, kin, start(law, kin), (-0.5, -0.5, -0.5, 0.0, 0.0, 0.0))
        state, work = worked(law, kin, begin, loading / steps, steps)
        stored = energy_density(law, kin, state) - energy_density(law, kin, begin)
        lost = dissipated_energy(law, kin, state)
        assert lost > 0
        errors.append(abs(stored + lost - work) / work)
    # J and the sum of the strain increments differ by squares of strain: 4e-4 stay.
    assert errors[1] < 1e-3 and errors[0] < 3e-3


@every_law
def test_a_quarter_turn(law):
    """The stress turns with the point, and nothing flows.

    The increments I + w swell the volume by w^2, 1 % in all, which takes a pressure of 1.2.
    """
    kin, steps = Space(), 200
    inside = np.array([[-9.2, 0.1, 0.05], [0.1, -9.0, 0.02], [0.05, 0.02, -8.9]])
    state = with_stress(law, kin, start(law, kin), symmetric_flat(kin, inside))
    w = np.zeros((3, 3))
    w[1, 0] = np.pi / 2 / steps
    turned = stretched(law, kin, state, w - w.T, steps)
    assert plastic_strain(law, kin, turned) == 0
    found = stress(law, kin, turned)
    apart = found - np.trace(found) / 3 * np.eye(3)
    expected = TURN @ (inside - np.trace(inside) / 3 * np.eye(3)) @ TURN.T
    assert apart == pytest.approx(expected, abs=1e-6)


def test_with_a_nonlinear_equation_of_state():
    """The return lands on the surface with the pressure that the curve gives its elastic J."""
    eos = Shock(1 / RHO, K, 1.5, 0.0, 0.0)
    law, kin = EosStrength(eos, mohr().strength), Space()
    state = stretched(law, kin, start(law, kin), np.diag([-0.03, 0.02, 0.002]), 4)
    assert plastic_strain(law, kin, state) > 0
    full = stress(law, kin, state)
    assert mohr_excess(full) == pytest.approx(0, abs=1e-12 * np.abs(full).max() * 4)


def test_single_precision():
    kin = Space()
    for law in LAWS:
        eos, strength = (type(p)(*(np.float32(x) for x in p)) for p in law[:2])
        single = EosStrength(eos, strength)
        begun = initial_state(single, kin, np.float32(1))
        state = nested_as(begun, [np.float32(x) for x in flattened(begun)])  # as arrays hold it
        full = np.diag([1e-3, -2e-3, 1e-4]) + 1e-3 * np.eye(3, k=1)
        dl = kin.Tensor._make([np.float32(x) for x in flat(kin, full)])
        for _ in range(10):
            state = advance(single, kin, state, dl, np.float32(1))
        assert all(isinstance(x, np.float32) for x in flattened(state))
        double = stretched(law, kin, start(law, kin), full, 10)
        assert float(plastic_strain(single, kin, state)) == pytest.approx(
            plastic_strain(law, kin, double), rel=1e-2
        )


@pytest.mark.parametrize("seed", range(4))
def test_opening_is_told_by_the_elastic_volume(seed):
    """Beside the return of Tampubolon et al. 2017 (section 4.3.4), on a path at random.

    Their logarithmic elastic strain takes part in the increment, and what the tip takes of its
    trace is added to it in the next step, until it is used up. Strains are small, so that their
    stress and ours differ by strains squared.
    """
    law, kin = drucker(c=0, psi=0), Space()
    rng = np.random.default_rng(seed)
    state, elastic, apart = start(law, kin), np.zeros((3, 3)), 0.0
    opened, most = 0, 0.0
    for _ in range(300):
        shear = rng.normal(size=(3, 3))
        step = 1e-5 * (shear + shear.T - np.trace(shear + shear.T) / 3 * np.eye(3))
        step += rng.choice((1e-4, -1e-4)) / 3 * np.eye(3) - 1e-7 * opened * np.eye(3)
        state = stretched(law, kin, state, step, 1)
        trial = elastic + step + apart / 3 * np.eye(3)
        volume = np.trace(trial)
        if volume >= 0:
            elastic, apart = np.zeros((3, 3)), volume
        else:
            s = trial - volume / 3 * np.eye(3)
            size = 2 * G * sqrt(np.sum(s * s) / 2)
            borne = -law.strength.friction * K * volume
            elastic, apart = s * min(1, borne / max(size, 1e-300)) + volume / 3 * np.eye(3), 0.0
        wanted = 2 * G * elastic + (K - 2 * G / 3) * np.trace(elastic) * np.eye(3)
        opened += apart > 0
        most = max(most, np.abs(wanted).max())
        assert np.abs(stress(law, kin, state) - wanted).max() < 2e-3 * max(most, 1e-4 * K)
    assert 20 < opened < 280
    assert most > 3e-4 * K
