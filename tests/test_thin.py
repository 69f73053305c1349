"""Thin bodies: plane stress in 2D, uniaxial stress in 1D, against closed forms."""

from math import log, sqrt

import numpy as np
import pytest
from conftest import INPUTS
from scipy.optimize import brentq

from karamelo_py.compiler import on_numbers
from karamelo_py.kernels.implicit import IncrementAt, nominal_stress, stress_and_tangent
from karamelo_py.points.kinematics import Axisymmetric, Line, PlaneStrain, large
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    initial_state,
    kirchhoff_stress,
    wave_speed_squared,
)
from karamelo_py.points.laws.eos import LinearPressure
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.linear import LinearElastic
from karamelo_py.points.laws.neo_hookean import NeoHookean
from karamelo_py.points.laws.parameters import lame_parameters
from karamelo_py.points.laws.strengths.hardening import Plastic
from karamelo_py.points.laws.thin import Thin, ThinInLargeIncrements

E, NU, RHO = 1e6, 0.3, 1000.0
LAM, G = lame_parameters(E, NU)
LINEAR = LinearElastic(1 / RHO, LAM, G)
PLASTIC = EosStrength(LinearPressure(1 / RHO, LAM + 2 / 3 * G), Plastic(G, 400.0))
PLANE = PlaneStrain()


def strained(law, kin, dl, steps=1):
    state = initial_state(law, kin, 1.0)
    for _ in range(steps):
        state = advance(law, kin, state, kin.Tensor._make(dl), 1.0)
    return state


def test_a_plate_has_the_modulus_of_plane_stress():
    """E/(1 - nu^2) (exx + nu eyy); Timoshenko & Goodier 1970, section 7."""
    state = strained(Thin(LINEAR), PLANE, (2e-4, 1e-4, 0.0, 1e-4))
    s = cauchy_stress(Thin(LINEAR), PLANE, state)
    stiffness = E / (1 - NU**2)
    exact = (stiffness * (2 + NU) * 1e-4, stiffness * (1 + 2 * NU) * 1e-4, 0, G * 1e-4)
    assert s == pytest.approx(exact, rel=1e-3, abs=1e-9)  # the shear also rotates the stress
    assert state.across == pytest.approx(1 - NU / (1 - NU) * 3e-4, rel=1e-7)


def test_a_bar_has_youngs_modulus():
    state = strained(Thin(LINEAR), Line(), (1e-4,))
    assert cauchy_stress(Thin(LINEAR), Line(), state) == pytest.approx((100.0, 0, 0), abs=1e-9)
    assert state.across == pytest.approx(1 - NU * 1e-4, rel=1e-12)


@pytest.mark.parametrize(("kin", "squared"), [(Line(), E / RHO), (PLANE, E / RHO / (1 - NU**2))])
@pytest.mark.parametrize("law", [LINEAR, NeoHookean(1 / RHO, LAM, G), PLASTIC])
def test_waves_of_thin_bodies(law, kin, squared):
    """sqrt(E/rho) in a bar, sqrt(E/(1 - nu^2)/rho) in a plate (Kolsky 1963, chapters 3 and 4)."""
    law = Thin(law)
    found = wave_speed_squared(law, kin, initial_state(law, kin, 1.0))
    assert found == pytest.approx(squared, rel=1e-12)


@pytest.mark.parametrize("nu", [0.3, 0.49])
def test_a_sheet_of_rubber_is_stretched(nu):
    """A neo-Hookean sheet under biaxial stretch a: the thickness solves G (c^2 - 1) + lam ln J = 0.

    In small steps, where the stress left across is taken up by the next ones, and in large ones.
    """
    lam, shear = lame_parameters(E, nu)
    a = 1.5
    c = brentq(lambda c: shear * (c * c - 1) + lam * log(a * a * c), 0.1, 1)
    exact = shear * (a * a - 1) + lam * log(a * a * c)
    law, n = NeoHookean(1 / RHO, lam, shear), 400
    step = a ** (1 / n) - 1
    state = strained(Thin(law), PLANE, (step, 0.0, 0.0, step), n)
    tau = kirchhoff_stress(Thin(law), PLANE, state)
    # A step of 1e-3 leaves 1e-5 of the stress.
    assert tau[:2] == pytest.approx((exact, exact), rel=1e-5)
    assert state.across == pytest.approx(c, rel=1e-5)
    law = ThinInLargeIncrements(law)
    state = strained(law, PLANE, (a - 1, 0.0, 0.0, a - 1))
    assert kirchhoff_stress(law, PLANE, state)[0] == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.0, 2.0, 2.8])
def test_metal_yields_on_the_ellipse_of_von_mises(angle):
    """sxx^2 - sxx syy + syy^2 + 3 sxy^2 = Y^2 in plane stress (Hill 1950, chapter 2)."""
    law = Thin(PLASTIC)
    dl = (1e-5 * np.cos(angle), 1e-5 * np.sin(angle), 0.0, 2e-5 * np.sin(angle))
    x, y, z, xy = cauchy_stress(law, PLANE, strained(law, PLANE, dl, 500))
    # A step that flows leaves 1e-4 of the stress across.
    assert sqrt(x * x - x * y + y * y + 3 * xy * xy) == pytest.approx(400, rel=1e-4)
    assert abs(z) < 0.04


def test_a_load_step_of_any_size_leaves_no_stress_across():
    """As the same law in 3D whose strain across is found by a root finder."""
    law, whole = Thin(PLASTIC), Axisymmetric()
    dl = PLANE.Tensor._make((0.05, 0.02, 0.0, -0.01))
    state = advance(law, PLANE, initial_state(law, PLANE, 1.0), large(dl), 1.0)

    def across(q):
        step = large(whole.Tensor._make((*dl, q)))
        return advance(PLASTIC, whole, initial_state(PLASTIC, whole, 1.0), step, 1.0)

    q = brentq(lambda q: cauchy_stress(PLASTIC, whole, across(q))[2], -0.1, 0.1, xtol=1e-15)
    exact = cauchy_stress(PLASTIC, whole, across(q))
    assert cauchy_stress(law, PLANE, state) == pytest.approx(exact, abs=1e-6)


# --- scenes ---------------------------------------------------------------------------------------

BAR = """
    method(tlmpm, FLIP, linear, 1)
    dimension(1, 0, 1, 1/32)
    uniaxial_stress(true, area=0.01)
    material(m, linear, 1000, 1e6, 0.45)
    region(all, block, 0, 1)
    solid(bar, region, all, 2, m, 1/32, 0)
    group(bar, particles, region, all, solid, bar)
    fix(v, initial_velocity_particles, bar, 0.01*cos(PI*x))
    compute(Ek, kinetic_energy, bar)
    compute(Es, strain_energy, bar)
    log_modify(custom, time, Ek, Es)
    log(1000)
    run_time(1/2/sqrt(1000))
"""


def test_a_free_bar_vibrates_at_its_period(run_interpreted):
    """Its first period is 2 L/sqrt(E/rho) (Rayleigh 1894, section 150): after a quarter of it all
    energy, rho A L v^2/4, is stored. Poisson's ratio of 0.45 would make it half in 1D strain."""
    log = run_interpreted(BAR).log
    whole = 1000 * 0.01 * 0.01**2 / 4
    assert log["Ek"][0] == pytest.approx(whole, rel=1e-3)
    assert log["Es"][-1] == pytest.approx(whole, rel=2e-3)
    assert log["Ek"][-1] < 2e-3 * whole


def test_a_thin_disk_spins(run_script):
    """(3 + nu)/8 rho w^2 R^2 at its centre (Timoshenko & Goodier 1970, section 32)."""
    result = run_script(INPUTS / "models" / "in.disk", "-var", "n", "8")
    assert result.log["err"][-1] < 0.005


SHEET = """
    method(tlmpm, FLIP, linear, 1)
    scheme(quasi-static)
    dimension(2, 0, 1, 0, 1, 0.5)
    plane_stress(true)
    region(all, block, 0, 1, 0, 1)
    material(m, neo-hookean, 1000, 1e6, 0.49)
    solid(s, region, all, 2, m, 0.5, 0)
    group(s, particles, region, all, solid, s)
    group(nodes, nodes, region, all, all)
    fix(pull, velocity_nodes, nodes, 0.2*x0, 0.2*y0)
    set_dt(1)
    compute(Es, strain_energy, s)
    compute(a, average_stress, s)
    log_modify(custom, Es, a_11, a_33)
    run(1)
"""


def test_one_load_step_stretches_a_sheet_exactly(run_interpreted):
    """As in `test_a_sheet_of_rubber_is_stretched`: a law of F in a load step of any size."""
    lam, shear = lame_parameters(1e6, 0.49)
    c = brentq(lambda c: shear * (c * c - 1) + lam * log(1.44 * c), 0.1, 1)
    J = 1.44 * c
    table = run_interpreted(SHEET).log
    stress = (shear * (1.44 - 1) + lam * log(J)) / J
    assert table["a_11"][-1] == pytest.approx(stress, rel=1e-8)
    assert abs(table["a_33"][-1]) < 1e-6 * stress
    energy = shear / 2 * (2.88 + c * c - 3) - shear * log(J) + lam / 2 * log(J) ** 2
    assert table["Es"][-1] == pytest.approx(energy, rel=1e-8)


@pytest.mark.parametrize("law", [LINEAR, PLASTIC, NeoHookean(1 / RHO, LAM, G)])
@pytest.mark.parametrize("kin", [Line(), PLANE])
def test_tangents_of_thin_laws(law, kin):
    """Against central differences, at rest and after a step."""
    law = Thin(law)
    state = initial_state(law, kin, 1.0)
    for size in (0.0, 2e-4):
        H = kin.Tensor._make([size] * kin.tensor_size)
        _, C = on_numbers(stress_and_tangent)(law, kin, state, IncrementAt(H), 1.0)
        for k in range(kin.tensor_size):
            ends = []
            for h in (1e-7, -1e-7):
                moved = kin.Tensor._make([x + h * (j == k) for j, x in enumerate(H)])
                ends.append(nominal_stress(law, kin, state, IncrementAt(moved), 1.0))
            slopes = [(a - b) / 2e-7 for a, b in zip(*ends, strict=True)]
            assert [row[k] for row in C] == pytest.approx(slopes, abs=2e-4 * E)


def test_loads_by_sizes_of_points_are_refused_with_a_thickness(run_interpreted):
    script = PLATE.replace("restart(", "fix(w, contact/surface, plate, box)\n    restart(")
    assert "sizes of points" in run_interpreted(script, status=1).err


PLATE = """
    method(ulmpm, FLIP, linear, 0.99)
    dimension(2, 0, 2, 0, 2, 0.25)
    plane_stress(true, thickness=0.1)
    eos(b, linear, 1000, 1e6)
    strength(s, plastic, 4e5, 1e3)
    material(m, eos-strength, b, s)
    region(box, block, 0.5, 1.5, 0.5, 1.5)
    solid(plate, region, box, 2, m, 0.25, 0)
    group(plate, particles, region, box, solid, plate)
    fix(v, initial_velocity_particles, plate, 0.3*(x - 1), -0.1*(y - 1))
    restart(2, state.*.h5)
    run(5)
"""


def test_threads_and_restarts_have_the_same_bits(state_interpreted):
    whole = state_interpreted(PLATE, "x", "v", "thickness")
    assert np.abs(whole["thickness"] - 1).max() > 1e-4
    for how in ({"boxes": True}, {"ranks": 2}):
        other = state_interpreted(PLATE, "x", "v", "thickness", **how)
        assert all(np.array_equal(whole[name], other[name]) for name in whole)


def test_a_plate_has_the_mass_of_its_thickness(run_interpreted):
    """With 16 x 16 points of a plate of 1 x 1 x 0.1: m vx^2/2 + m vy^2/2."""
    record = "compute(Ek, kinetic_energy, plate)\n    log_modify(custom, Ek)"
    log = run_interpreted(PLATE.replace("restart(2, state.*.h5)", record)).log
    square = np.mean(((np.arange(8) + 0.5) / 8 - 0.5) ** 2)
    assert log["Ek"][0] == pytest.approx(0.5 * 100 * (0.09 + 0.01) * square, rel=1e-9)


@pytest.mark.parametrize(
    ("line", "before", "says"),
    [
        ("dimension(3, 0, 2, 0, 2, 0, 2, 0.25)", "", "3 dimensions, not 2"),
        ("dimension(1, 0, 2, 0.25)", "", "uniaxial_stress"),
        ("axisymmetric(true)", "dimension(2, 0, 2, 0, 2, 0.25)\n", "axisymmetric"),
        ("material(m, neo-hookean, 1, 1, 0)", "dimension(2, 0, 2, 0, 2, 0.25)\n",
         "before the first"),
    ],
)  # fmt: skip
def test_what_cannot_be_thin_is_refused(run_interpreted, line, before, says):
    script = f"method(ulmpm, FLIP, linear, 1)\n{before}{line}\nplane_stress(true)\n"
    assert says in run_interpreted(script, status=1).err


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ("plane_stress(true, thickness=0)", "thickness"),
        ("plane_stress(false, thickness=3)", "plane_stress(false) does not use thickness=3"),
        ("plane_stress(true, thickness=2)\nplane_stress(true)", "already set, with 2 across"),
        ("plane_stress(true)\neos(w, fluid, 1000, 2e6, 7)\nstrength(s, fluid, 1e-3)\n"
         "material(water, eos-strength, w, s)", "eos fluid is for fluids or loose grains"),
        ("plane_stress(true)\neos(w, ideal-gas, 1, 1.4, p=1)\nstrength(s, linear, 1)\n"
         "material(gas, eos-strength, w, s)", "eos ideal-gas is for fluids"),
        ("plane_stress(true)\neos(w, linear, 1, 1)\nstrength(s, mu-i, 1, 0.4, 0.6, 0.3, 1, 1)\n"
         "material(sand, eos-strength, w, s)", "strength mu-i is for fluids or loose grains"),
        ("plane_stress(true)\nmaterial(m, linear, 1000, 1e6, 0.3)\nanti_volumetric_locking(true)\n"
         "region(r, block, 0.5, 1, 0.5, 1)\nsolid(s, region, r, 1, m, 0.25, 0)\nrun(1)",
         "thin bodies do not lock"),
    ],
)  # fmt: skip
def test_what_thin_bodies_cannot_be_is_refused(run_interpreted, lines, says):
    script = f"method(ulmpm, FLIP, linear, 1)\ndimension(2, 0, 2, 0, 2, 0.25)\n{lines}\n"
    assert says in run_interpreted(script, status=1).err


def test_an_element_in_plane_stress(run_interpreted):
    script = """
        material(m, linear, 1000, 1e6, 0.3)
        load_path(in_x, 10, exx=0.001, syy=0)
        load_path(along, 10, exx=0.001)
        element(plate, m, in_x, kinematics=plane-stress)
        element(bar, m, along, kinematics=uniaxial-stress)
    """
    folder = run_interpreted(script).folder
    for name in ("plate", "bar"):
        table = np.genfromtxt(folder / f"element_{name}.txt", names=True)
        assert table["sxx"][-1] == pytest.approx(1000.0, rel=1e-9)
        assert table["szz"][-1] == pytest.approx(0, abs=1e-7)


@pytest.mark.full
@pytest.mark.parametrize("law", ["neo-hookean, 1, 100, 0.3", "linear, 1, 100, 0.3"])
def test_load_steps_in_plane_stress_compile(run_script, law):
    """A pulled plate, compiled: its trials of the strain across are code, or a loop."""
    done = run_script(f"""
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 1.2, 0, 1, 0.25)
    plane_stress(true)
    scheme(quasi-static)
    region(plate, block, 0, 1, 0, 0.5)
    material(m, {law})
    solid(plate, region, plate, 2, m, 0.25)
    region(left, block, -INF, 0, -INF, INF)
    region(right, block, 1, 1, -INF, INF)
    group(left, nodes, region, left, all)
    group(right, nodes, region, right, all)
    region(below, block, -INF, INF, -INF, 0)
    group(below, nodes, region, below, all)
    fix(left, velocity_nodes, left, 0, NULL)
    fix(below, velocity_nodes, below, NULL, 0)
    fix(right, velocity_nodes, right, 0.01, NULL)
    set_dt(1)
    log_modify(custom, step, right_x)
    run(1)
    """)
    assert done.log.right_x[-1] == pytest.approx(0.5, rel=0.02)  # E, strain 0.01, height 0.5


CERAMIC = """
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 2, 0, 1, 0.5)
    plane_stress(true)
    eos(e, linear, 3.7, 131)
    strength(s, johnson-holmquist-2, 90, 0.93, 0.6, 0.31, 0.6, 0.0, 1.0, 0.2, 2.79, 1.46, 0.005, 1)
    material(alumina, eos-strength, e, s)
    region(all, block, 0, 1, 0, 0.5)
    solid(plate, region, all, 2, alumina, 0.5)
    fix(v, initial_velocity_particles, all, {v}*x0, 0)
    run(10)
"""


def test_stress_that_trials_leave_across_is_told(run_interpreted):
    """A ceramic that breaks within a step; not one that stays elastic."""
    said = run_interpreted(CERAMIC.format(v=-0.5)).err
    assert "the stress across the plate is not 0: up to step" in said
    assert "at a point of solid 'plate' (material alumina; thickness" in said
    assert "damage 1" in said
    assert "is not 0" not in run_interpreted(CERAMIC.format(v=-0.01)).err
