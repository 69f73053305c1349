"""Jointed rock against Jaeger's closed form, and the flow of its joints."""

from math import cos, inf, radians, sin, tan

import numpy as np
import pytest
from laws import lanes_are_the_point_function, leaning_is_reported
from tensors import every_kinematics, flat, matrix, rotation, symmetric_flat, symmetric_matrix

from comparisons.results import read_log
from karamelo_py.points.kinematics import PlaneStrain, Space
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    columns_of,
    dissipated_energy,
    energy_density,
    initial_state,
    with_stress,
)
from karamelo_py.points.laws.jointed import JointedConstants

RHO, E, NU, C, PHI = 2700, 20e9, 0.25, 1e6, 30.0
SPACE = Space()


def rock(beta, **more):
    """Joints whose normal is at `beta` degrees to y, in the xy plane."""
    return JointedConstants(RHO, E, NU, C, PHI, beta, 90.0, **more).checked()


def jaeger(beta, s3=0.0, c=C, phi=PHI):
    """s1 of slip, by the angle from the load to the normal (Jaeger 1960)."""
    b, mu = radians(beta), tan(radians(phi))
    if not 0 < b < np.pi / 2 or tan(b) <= mu:
        return inf
    return s3 + 2 * (c + s3 * mu) / ((1 - mu / tan(b)) * sin(2 * b))


FREE = (0, 0), (2, 2), (0, 1), (0, 2), (1, 2)


def excess(law, state, dl, s3):
    """Stresses other than s1 after an increment, over those of the pressure s3."""
    new = advance(law, SPACE, state, flat(SPACE, dl), 1.0)
    s = symmetric_matrix(SPACE, cauchy_stress(law, SPACE, new)) + s3 * np.eye(3)
    return np.array([s[place] for place in FREE])


def pressed(law, s3=0.0, steps=6, end=0.001):
    """Stress s1 of a body that is pressed along y at constant pressure s3 on its other sides."""
    state = initial_state(law, SPACE, 1.0)
    state = with_stress(law, SPACE, state, symmetric_flat(SPACE, -s3 * np.eye(3)))
    for _ in range(steps):
        dl = np.zeros((3, 3))
        dl[1, 1] = -end / steps
        for _ in range(8):
            r = excess(law, state, dl, s3)
            if abs(r).max() < 1e-3:
                break
            columns = []
            for place in FREE:
                dl[place] += 1e-9
                columns.append((excess(law, state, dl, s3) - r) / 1e-9)
                dl[place] -= 1e-9
            changes = np.linalg.lstsq(np.array(columns).T, -r)[0]
            for place, change in zip(FREE, changes, strict=True):
                dl[place] += change
        state = advance(law, SPACE, state, flat(SPACE, dl), 1.0)
    return -cauchy_stress(law, SPACE, state).yy


@pytest.mark.parametrize("beta", [40, 50, 60, 75])
@pytest.mark.parametrize("s3", [0, 2e6])
def test_joints_slip_at_jaegers_stress(beta, s3):
    s1 = jaeger(beta, s3)
    assert pressed(rock(beta), s3, end=1.1 * s1 / E) == pytest.approx(s1, rel=4e-3)


def test_the_rock_yields_where_the_joints_do_not_slip():
    """s1 = 2 c cos(phi)/(1 - sin(phi)) of the rock (Mohr & Coulomb)."""
    strength = 2 * 2e6 * cos(radians(40)) / (1 - sin(radians(40)))
    more = {"matrix_cohesion": 2e6, "matrix_phi": 40.0}
    assert pressed(rock(20, **more), steps=4) == pytest.approx(strength, rel=4e-3)
    assert pressed(rock(60, **more)) == pytest.approx(jaeger(60), rel=4e-3)
    assert set(columns_of(rock(60, **more))) == {"slip", "opening", "dissipated", "ep"}


@every_kinematics
def test_tractions_stay_within_both_limits(kin):
    """Whatever the step, joints sustain no more, gain no energy, and resist pressure."""
    random = np.random.default_rng(3)
    law = JointedConstants(RHO, E, NU, C, PHI, 35.0, 90.0 if kin.dimension > 1 else 0.0,
                        psi=10.0, tension=0.5e6).checked()  # fmt: skip
    n = np.array([law.nx, law.ny, law.nz])
    for _ in range(40):
        dl = random.normal(0, 2e-4, (3, 3))
        state = advance(law, kin, initial_state(law, kin, 1.0), flat(kin, dl), 1.0)
        s = symmetric_matrix(kin, cauchy_stress(law, kin, state))
        now = np.linalg.solve(matrix(kin, state.F, 1.0).T, n)
        t = s @ (now / np.linalg.norm(now))
        normal = t @ now / np.linalg.norm(now)
        tau = np.sqrt(max(t @ t - normal**2, 0))
        slack = 1e-9 * C
        assert normal <= 0.5e6 + slack
        assert tau <= C - normal * tan(radians(PHI)) + slack
        assert dissipated_energy(law, kin, state) >= 0
        assert (dissipated_energy(law, kin, state) > 0) == (state.slip > 0 or state.opening > 0)
        assert energy_density(law, kin, state) >= 0


def test_joints_turn_with_the_body():
    """F to Q F: sigma to Q sigma Q^T."""
    law, Q = rock(55), rotation(np.array([0.4, -0.9, 0.6]))
    dl = np.random.default_rng(1).normal(0, 3e-4, (3, 3))
    state = advance(law, SPACE, initial_state(law, SPACE, 1.0), flat(SPACE, dl), 1.0)
    turned = initial_state(law, SPACE, 1.0)._replace(F=flat(SPACE, Q))
    turned = advance(law, SPACE, turned, flat(SPACE, Q @ dl @ Q.T), 1.0)
    s, t = (symmetric_matrix(SPACE, cauchy_stress(law, SPACE, one)) for one in (state, turned))
    assert state.slip > 0
    assert np.allclose(t, Q @ s @ Q.T, rtol=1e-9, atol=1e-6 * C)


def test_slip_follows_the_plane_of_the_joints():
    """Shear along a plane by any amount leaves it a plane: tau = c, by 100 % of shear."""
    kin, law = PlaneStrain(), rock(0)  # normal -y
    state = initial_state(law, kin, 1.0)
    for _ in range(400):
        state = advance(law, kin, state, kin.Tensor._make([0, 0.0025, 0, 0]), 1.0)
    assert cauchy_stress(law, kin, state).xy == pytest.approx(C, rel=0.02)
    assert state.slip == pytest.approx(1, rel=1e-3)


def test_open_joints_sustain_no_more_tension():
    """A pull along the normal, at rest in the other directions: t = tension, the rest opens."""
    law, kin = rock(0, tension=0.3e6), PlaneStrain()
    state = advance(law, kin, initial_state(law, kin, 1.0), kin.Tensor._make([0, 0, 0, 1e-3]), 1.0)
    assert cauchy_stress(law, kin, state).yy == pytest.approx(0.3e6)
    across = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
    assert state.opening == pytest.approx(1e-3 - 0.3e6 / across)


SPECIMEN = """
    load_path(press, 16, eyy=-1e-3, sxx=0, sxy=0)
    material(slate, jointed, 2700, 20e9, 0.25, 1e6, 30, 60, 90)
    material(shale, jointed, 2700, 20e9, 0.25, 1e6, 30, 10, 90, matrix_cohesion=2e6, matrix_phi=40)
    element(slate, slate, press, kinematics=plane-stress)
    element(shale, shale, press, kinematics=plane-stress)
"""


def test_a_thin_specimen(run_interpreted):
    folder = run_interpreted(SPECIMEN).folder
    slate, shale = (read_log(folder / f"element_{name}.txt") for name in ("slate", "shale"))
    assert -slate.syy.min() == pytest.approx(jaeger(60), rel=1e-3)
    assert slate.slip[-1] > 0
    strength = 2 * 2e6 * cos(radians(40)) / (1 - sin(radians(40)))
    assert -shale.syy.min() == pytest.approx(strength, rel=2e-3)
    assert shale.ep[-1] > 0
    assert shale.slip[-1] == 0
    for t in (slate, shale):
        assert t.work[-1] == pytest.approx(t.stored[-1] + t.dissipated[-1], rel=0.1)


SLIDE = """
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 1, 0, 1, 0.5)
    region(box, block, 0, 1, 0, 1)
    material(slate, jointed, 1000, 1e6, 0.25, 1e3, 30, 60, 90, psi=5)
    solid(s, region, box, 2, slate, 0.5, 0)
    group(s, particles, region, box, solid, s)
    fix(v, initial_velocity_particles, s, x*y, -y)
    set_dt(2e-3)
    compute(Es, strain_energy, s)
    compute(Ed, dissipated_energy, s)
    log_modify(custom, Es, Ed)
    log(5)
    run(10)
"""


def test_compiled_lanes_are_the_point_function(run_script, run_interpreted):
    lanes_are_the_point_function(run_script, run_interpreted, SLIDE)


def test_joints_by_formulas_of_place(state_interpreted):
    """Joints of angle 60 beside axes of 40 degrees in which their angle is 20."""
    names, found = ("s11", "s22", "s12", "slip"), []
    for angle in ("60, 90", "20, 90, axes=(40 + 0*x0)"):
        script = SLIDE.replace("30, 60, 90", f"30, {angle}").replace("run(10)", "run(4)")
        found.append(state_interpreted(script, *names))
    assert found[0]["slip"].max() > 0
    for name in names:
        assert np.allclose(found[1][name], found[0][name], rtol=1e-9, atol=1e-9)


def test_joints_that_lean_out_of_the_plane_are_reported(run_interpreted):
    leaning_is_reported(run_interpreted, SLIDE, "60, 90, psi", "60, 45, psi")


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("1, 2, 0.5, 1, 30", "Poisson's ratio 0.5 is impossible"),
        ("1, 2, 0.2, 1, 90", "phi = 90 is impossible"),
        ("1, 2, 0.2, 1, 30, psi=31", "psi = 31 is impossible"),
        ("1, 2, 0.2, 1, 45, tension=2", "at most cohesion/tan(phi), 1"),
        ("1, 2, 0.2, 1, 30, matrix_psi=3", "does not dilate"),
        ("1, 2, 0.2, 1, 30, matrix_phi=95", "matrix_phi"),
        ("1, 2, 0.2, 1, 30, axes=(1, 0)", "does not define axes"),
    ],
)
def test_joints_that_no_rock_has(run_interpreted, line, says):
    assert says in run_interpreted(f"material(m, jointed, {line})\n", status=1).err
