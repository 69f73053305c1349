"""Elastic laws with directions: closed forms of laminates and of waves in crystals."""

from math import cos, radians, sin, sqrt

import numpy as np
import pytest
from tensors import every_kinematics, flat, rotation

from karamelo_py.points.kinematics import PlaneStrain, Space
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    energy_density,
    initial_state,
    kirchhoff_stress,
    wave_speed_squared,
)
from karamelo_py.points.laws.elastic import State
from karamelo_py.points.laws.hyperelastic import SaintVenantKirchhoff
from karamelo_py.points.laws.orthotropic import Orthotropic, Transverse
from karamelo_py.points.laws.parameters import lame_parameters
from karamelo_py.points.laws.thin import ThinInLargeIncrements

PLY = (1600, 140e9, 9e9, 9e9, 0.3, 0.3, 0.4, 5e9, 5e9, 3e9)
SPACE = Space()


def deformed(kin, seed=0, size=0.2):
    return State(flat(kin, np.eye(3) + np.random.default_rng(seed).normal(0, size, (3, 3))))


@every_kinematics
@pytest.mark.parametrize("turns", [(0, 0, 0), (20, 50, -70)])
def test_equal_directions_are_hookes_law(kin, turns):
    """Saint-Venant and Kirchhoff's, however the axes are rotated."""
    E, nu = 1e6, 0.3
    lam, G = lame_parameters(E, nu)
    law = Orthotropic(1000, E, E, E, nu, nu, nu, G, G, G, *turns).checked()
    hooke, state = SaintVenantKirchhoff(1000, lam, G).checked(), deformed(kin)
    exact = kirchhoff_stress(hooke, kin, state)
    assert np.allclose(kirchhoff_stress(law, kin, state), exact, rtol=0, atol=1e-9 * E)
    assert energy_density(law, kin, state) == pytest.approx(energy_density(hooke, kin, state))


@pytest.mark.parametrize("angle", [0, 15, 30, 45, 90])
def test_a_lamina_is_pulled_off_its_axes(angle):
    """1/E = c^4/E1 + (1/G12 - 2 nu12/E1) s^2 c^2 + s^4/E2 (Jones 1999, equation 2.97)."""
    _, E1, E2, _, nu12, _, _, G12, *_ = PLY
    law, plane = ThinInLargeIncrements(Orthotropic(*PLY, angle).checked()), PlaneStrain()
    columns = []
    for dl in ((1, 0, 0, 0), (0, 0, 0, 1), (0, 0.5, 0.5, 0)):
        step = plane.Tensor._make([1e-7 * x for x in dl])
        s = cauchy_stress(
            law, plane, advance(law, plane, initial_state(law, plane, 1.0), step, 1.0)
        )
        columns.append((s.xx, s.yy, s.xy))
    strain = np.linalg.solve(np.array(columns).T / 1e-7, [1.0, 0, 0])
    c, s = cos(radians(angle)), sin(radians(angle))
    exact = c**4 / E1 + (1 / G12 - 2 * nu12 / E1) * s * s * c * c + s**4 / E2
    assert strain[0] == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize(("angle", "tilt"), [(0, 0), (30, 90), (10, 40)])
def test_bedded_rock_is_pressed_at_an_angle(angle, tilt):
    """1/E = c^4/E3 + (1/G3 - 2 nu3/E3) s^2 c^2 + s^4/E (Lekhnitskii 1963, section 9)."""
    E, nu, E3, nu3, G3 = 60e9, 0.25, 30e9, 0.15, 15e9
    law = Transverse(2700, E, nu, E3, nu3, G3, angle, tilt).checked()
    normal = np.array([sin(radians(angle)) * sin(radians(tilt)),
                       -cos(radians(angle)) * sin(radians(tilt)), cos(radians(tilt))])  # fmt: skip
    columns = []
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        dl = np.zeros((3, 3))
        dl[i, j] += 0.5e-7
        dl[j, i] += 0.5e-7
        state = advance(law, SPACE, initial_state(law, SPACE, 1.0), flat(SPACE, dl), 1.0)
        columns.append(tuple(cauchy_stress(law, SPACE, state)))
    strain = np.linalg.solve(np.array(columns).T / 1e-7, [1.0, 0, 0, 0, 0, 0])
    c = normal[0]
    s = sqrt(1 - c * c)
    exact = c**4 / E3 + (1 / G3 - 2 * nu3 / E3) * s * s * c * c + s**4 / E
    assert strain[0] == pytest.approx(exact, rel=1e-5)


def test_stress_rotates_with_the_body():
    """F to Q F: tau to Q tau Q^T, and the same energy."""
    law, state = Orthotropic(*PLY, 25, 40, 10).checked(), deformed(SPACE, 4)
    F, Q = np.array(state.F).reshape(3, 3), rotation(np.array([0.4, -0.9, 0.6]))
    turned = State(flat(SPACE, Q @ F))

    def full(state):
        a = kirchhoff_stress(law, SPACE, state).at()
        return np.array([[a[i, j] for j in range(3)] for i in range(3)])

    assert np.allclose(full(turned), Q @ full(state) @ Q.T, rtol=1e-9, atol=1.0)
    assert energy_density(law, SPACE, turned) == pytest.approx(energy_density(law, SPACE, state))


@pytest.mark.parametrize("turns", [(0, 0, 0), (33, 21, 5)])
def test_the_fastest_wave_goes_along_the_fibres(turns):
    """rho c^2 = C11 of the stiffness there (Christoffel 1877), within its bound."""
    rho, E1, E2, E3, n12, n13, n23, *_ = PLY
    law = Orthotropic(*PLY, *turns).checked()
    compliance = np.array([[1 / E1, -n12 / E1, -n13 / E1], [-n12 / E1, 1 / E2, -n23 / E2],
                           [-n13 / E1, -n23 / E2, 1 / E3]])  # fmt: skip
    exact = np.linalg.inv(compliance)[0, 0] / rho
    found = wave_speed_squared(law, SPACE, initial_state(law, SPACE, 1.0))
    assert exact * 0.999 < found < exact * 1.005


BEAM = """
    angle = 0
    method(tlmpm, FLIP, linear, 1)
    dimension(1, 0, 1, 1/16)
    uniaxial_stress(true)
    region(all, block, 0, 1)
    material(m, orthotropic, 1600, 140e9, 9e9, 9e9, 0.3, 0.3, 0.4, 5e9, 5e9, 3e9, angle)
    solid(bar, region, all, 2, m, 1/16, 0)
    group(bar, particles, region, all, solid, bar)
    fix(v, initial_velocity_particles, bar, 0.01*cos(PI*x))
    compute(Ek, kinetic_energy, bar)
    log_modify(custom, time, Ek)
    log(1000)
    run_time(1/2/sqrt(E/1600))
"""


def test_a_bar_along_its_fibres(run_interpreted):
    """After a quarter of its period 2 L/sqrt(E1/rho) a free bar has no velocity (Rayleigh 1894)."""
    log = run_interpreted(BEAM.replace("sqrt(E/1600)", "sqrt(140e9/1600)")).log
    assert log["Ek"][-1] < 0.01 * log["Ek"].max()


RING = """
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 1, 0, 1, 0.25)
    plane_stress(true)
    region(box, block, 0.25, 0.75, 0.25, 0.75)
    material(log, orthotropic, 1000, 1e6, 1e5, 1e5, 0.3, 0.3, 0.3, 4e4, 4e4, 4e4, axes=({axes}))
    solid(log, region, box, 2, log, 0.25, 0)
    fix(v, initial_velocity_particles, all, x0, y0)
    fix(n, velocity_nodes, all, x0, y0)
    set_dt(1e-5)
    run(1)
"""


@pytest.mark.parametrize("axes", ["-y0, x0, 0, -x0, -y0, 0", "90 + 180/PI*atan2(y0, x0)"])
def test_axes_by_formulas_of_place(state_interpreted, axes):
    """A log that is stretched evenly: E1 (1 + nu21)/(1 - nu12 nu21) along its rings, E2 (1 + nu12)/
    (1 - nu12 nu21) along the radius (Jones 1999, section 2.4)."""
    state = state_interpreted(RING.format(axes=axes), "x", "y", "s11", "s22", "s12", "axis_x")
    nu21 = 0.3 * 0.1
    rings, radial = (1e-5 * x / (1 - 0.3 * nu21) for x in (1e6 * (1 + nu21), 1e5 * 1.3))
    c, s = (state[name] / np.hypot(state["x"], state["y"]) for name in ("x", "y"))
    assert state["s11"] == pytest.approx(rings * s * s + radial * c * c, rel=1e-4)
    assert state["s22"] == pytest.approx(rings * c * c + radial * s * s, rel=1e-4)
    assert state["s12"] == pytest.approx((radial - rings) * s * c, rel=1e-4)
    assert state["axis_x"] == pytest.approx(-s, rel=1e-9)


@pytest.mark.parametrize(
    ("axes", "says"),
    [
        ("x0, y0, 0, 2*x0, 2*y0, 0", "parallel or zero"),
        ("1, 0, 0, 2, 0, 0", "parallel or zero"),
        ("1, 0, 0, 0, 0, 1", "inclined to the plane"),
        ("1, 0", "does not define axes"),
        ("30*time", "cannot depend on time"),
        ("30*z0", "depends on z0, which a scene in 2D does not have"),
    ],
)
def test_axes_that_are_none(run_interpreted, axes, says):
    assert says in run_interpreted(RING.format(axes=axes), status=1).err


def test_a_bar_that_would_flatten_is_refused(run_interpreted):
    """Across the fibres y and z differ; at an angle it would also shear."""
    for angle in (45, 90):
        script = BEAM.replace("angle = 0", f"angle = {angle}").replace("sqrt(E/1600)", "1")
        assert "not the same in y and z" in run_interpreted(script, status=1).err


def test_compiled_lanes_are_hookes_law(run_script, run_interpreted):
    script = """
        law = "built"
        method(tlmpm, FLIP, linear, 1)
        dimension(2, 0, 1, 0, 1, 0.5)
        region(box, block, 0, 1, 0, 1)
        material(built, saint-venant-kirchhoff, 1000, 1e6*0.3/1.3/0.4, 1e6/2.6)
        G = 1e6/2.6
        material(axes, orthotropic, 1000, 1e6, 1e6, 1e6, 0.3, 0.3, 0.3, G, G, G, 30)
        solid(s, region, box, 2, law, 0.5, 0)
        group(s, particles, region, box, solid, s)
        fix(v, initial_velocity_particles, s, x*y, -y)
        set_dt(2e-3)
        compute(Es, strain_energy, s)
        log_modify(custom, Es)
        log(5)
        run(5)
    """
    found = [
        run(script, "-var", "law", name, folder=name).log["Es"][-1]
        for run, name in ((run_interpreted, "built"), (run_script, "axes"))
    ]
    assert found[1] == pytest.approx(found[0], rel=1e-8)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("orthotropic, 1, 1, 9, 9, 0.9, 0.1, 0.1, 1, 1, 1", "release energy"),
        ("orthotropic, 1, 1, 1, 1, 0.3, 0.3, 0.3, 1, 0, 1", "above 0"),
        ("transverse, 1, 60, 0.25, 30, 0.9, 15", "nu3^2 < E3/E"),
        ("transverse, 1, 60, 1.25, 30, 0.1, 15", "above -1 and below 1"),
    ],
)
def test_constants_that_no_body_has(run_interpreted, line, says):
    assert says in run_interpreted(f"material(m, {line})\n", status=1).err


def test_directions_out_of_a_plane_are_reported(run_interpreted):
    script = """
        method(tlmpm, FLIP, linear, 1)
        dimension(2, 0, 1, 0, 1, 0.5)
        region(box, block, 0, 1, 0, 1)
        material(m, transverse, 1000, 6e6, 0.25, 3e6, 0.15, 1e6, 0, 45)
        solid(s, region, box, 1, m, 0.5, 0)
        run(1)
    """
    assert "shear out of its plane" in run_interpreted(script, status=None).err
    assert (
        "shear out of its plane"
        not in run_interpreted(script.replace("0, 45)", "30, 90)"), status=None).err
    )
