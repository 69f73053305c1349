"""Failure of laminae off their axes: closed forms, and what is left."""

from math import cos, inf, radians, sin, sqrt

import numpy as np
import pytest
from laws import lanes_are_the_point_function
from selection import parameters

from comparisons.results import read_log

X, Y, S = 2000e6, 50e6, 80e6
PLY = """
    material(lamina, orthotropic, 1600, 140e9, 9e9, 9e9, 0.3, 0.3, 0.4, 5e9, 5e9, 3e9, {0})
    material(ply, tsai-hill, lamina, 2000e6, 50e6, 80e6, {0}, Xc=1200e6, Yc=170e6)
    material(apart, hashin, lamina, 2000e6, 1200e6, 50e6, 170e6, 80e6, 60e6, {0})
"""


ALONG, ACROSS, SHEAR, NU12 = 140e9, 9e9, 5e9, 0.3


def compliance(angle):
    """1/E = c^4/E1 + (1/G12 - 2 nu12/E1) s^2 c^2 + s^4/E2 (Jones 1999, equation 2.97)."""
    c, s = cos(radians(angle)), sin(radians(angle))
    return c**4 / ALONG + (1 / SHEAR - 2 * NU12 / ALONG) * (s * c) ** 2 + s**4 / ACROSS


def strength(angle, along=X, across=Y):
    """1/s^2 = c^4/X^2 + (1/S^2 - 1/X^2) s^2 c^2 + s^4/Y^2 (Jones 1999, equation 2.130)."""
    c, s = cos(radians(angle)), sin(radians(angle))
    return 1 / sqrt(c**4 / along**2 + (1 / S**2 - 1 / along**2) * (s * c) ** 2 + s**4 / across**2)


@pytest.mark.parametrize(("angle", "sign"), [(0, 1), (20, 1), (90, 1), (0, -1), (90, -1)])
def test_a_lamina_breaks_off_its_axes(run_interpreted, angle, sign):
    exact = strength(angle) if sign > 0 else strength(angle, 1200e6, 170e6)
    end = 1.1 * sign * exact * compliance(angle)
    folder = run_interpreted(
        PLY.format(angle)
        + f"""
        load_path(pull, 40, exx={end}, syy=0, sxy=0)
        element(strip, ply, pull, kinematics=plane-stress)
    """
    ).folder
    t = read_log(folder / "element_strip.txt")
    whole = t.damage == 0
    assert abs(t.sxx[whole][-1]) == pytest.approx(exact, rel=0.04)  # a step is 1/36
    assert t.damage_init[-1] > 1 >= t.damage_init[whole][-1]
    assert t.sxx[-1] == pytest.approx(0.01 * t.sxx[whole][-1] * 40 / (whole.sum() - 1), rel=0.05)
    assert t.work[-1] == pytest.approx(t.stored[-1] + t.dissipated[-1], rel=0.06)


def first_mode(angle, sign):
    """The stress at which one of Hashin's criteria is met first, and its column."""
    c2, s2 = cos(radians(angle)) ** 2, sin(radians(angle)) ** 2
    shear, Xc, Yc, St = s2 * c2 / S**2, 1200e6, 170e6, 60e6
    if sign > 0:
        both = {"fibre_t": c2 * c2 / X**2 + shear, "matrix_t": s2 * s2 / Y**2 + shear}
        return min((1 / sqrt(x), name) for name, x in both.items() if x)
    a, b = s2 * s2 / (4 * St**2) + shear, -((Yc / (2 * St)) ** 2 - 1) / Yc * s2
    matrix = (sqrt(b * b + 4 * a) - b) / (2 * a) if a else inf
    return min((matrix, "matrix_c"), (Xc / c2 if angle < 90 else inf, "fibre_c"))


# Each angle, each sign and each of the four modes; a little off the fibres shear matters.
@pytest.mark.parametrize(
    ("angle", "sign"),
    parameters(
        [(0, 1), (0, -1), (1, 1), (20, -1), (60, 1), (90, -1)],
        [(1, -1), (20, 1), (60, -1), (90, 1)],
    ),
)
def test_fibres_and_matrix_break_apart(run_interpreted, angle, sign):
    """Hashin 1980, J. Appl. Mech. 47, for a stress at an angle to the fibres."""
    exact, mode = first_mode(angle, sign)
    free = "syy=0, szz=0, sxy=0, sxz=0, syz=0"
    path = f"load_path(pull, 40, exx={1.1 * sign * exact * compliance(angle)}, {free})"
    script = f"{PLY.format(angle)}    {path}\n    element(strip, apart, pull)\n"
    folder = run_interpreted(script).folder
    t = read_log(folder / "element_strip.txt")
    breaks = np.flatnonzero(t.damage_init > 1)[0]
    before, after = abs(t.sxx[breaks - 1 : breaks + 1])
    assert 0.97 * before < exact < 1.03 * after  # strains of 1 % rotate the fibres
    modes = ("fibre_t", "fibre_c", "matrix_t", "matrix_c")
    assert [name for name in modes if t[name][breaks] > 1] == [mode]
    assert t.damage[breaks + 1] == 1
    assert 0.75 < t.dissipated[-1] / t.stored[breaks] < 1.0001


def test_fibres_carry_when_the_matrix_is_broken(run_interpreted):
    """E1 along the fibres, and a hundredth of E2 across."""
    folder = run_interpreted(
        PLY.format(0)
        + """
        load_path(across, 20, eyy=0.007, sxx=0)
        load_path(back, 1, sxx=0, syy=0)
        load_path(along, 10, exx=0.001, syy=0)
        element(strip, apart, across, back, along, kinematics=plane-stress)
    """
    ).folder
    t = read_log(folder / "element_strip.txt")
    assert t.syy[20] / t.eyy[20] == pytest.approx(ACROSS / 100, rel=0.02)
    assert (t.sxx[-1] - t.sxx[21]) / (t.exx[-1] - t.exx[21]) == pytest.approx(ALONG, rel=5e-3)


def test_a_broken_ply_has_no_stress_across(run_interpreted):
    """The stiffness across is 6e-5 of the largest modulus; the reference is the element in 3D."""
    loads = """
        load_path(cube, 40, exx=0.02, syy=0, szz=0)
        load_path(plate, 40, exx=0.02, syy=0)
        element(three, apart, cube)
        element(two, apart, plate, kinematics=plane-stress)
    """
    script = PLY.format(90).replace("60e6, 90)", "60e6, 90, residual=1e-3)")
    folder = run_interpreted(script + loads).folder
    three, two = (read_log(folder / f"element_{name}.txt") for name in ("three", "two"))
    assert two.sxx[-1] == pytest.approx(three.sxx[-1], rel=1e-3)
    assert two.ezz[-1] == pytest.approx(three.ezz[-1], rel=1e-3)
    assert abs(two.szz[-1]) < 1e-6 * two.sxx[-1]


SCENE = f"""
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 1, 0, 1, 0.5)
    plane_stress(true)
    region(s, block, 0, 1, 0, 0.5)
    region(t, block, 0, 1, 0.5, 1)
    {PLY.format(30)}
    solid(s, region, s, 2, ply, 0.5, 0)
    solid(t, region, t, 2, apart, 0.5, 0)
    group(t, particles, region, t, solid, t)
    fix(v, initial_velocity_particles, all, 500*x, 200*x)
    set_dt(5e-6)
    compute(Es, strain_energy, all)
    compute(Ed, dissipated_energy, all)
    compute(Et, dissipated_energy, t)
    log_modify(custom, Es, Ed, Et)
    log(5)
    run(20)
"""


def test_compiled_lanes_are_the_point_function(run_script, run_interpreted):
    log = lanes_are_the_point_function(run_script, run_interpreted, SCENE)
    assert 0.1 * log["Ed"][-1] < log["Et"][-1] < 0.9 * log["Ed"][-1]


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("tsai-hill, lamina, 1, 2, 1", "below twice the strength along it"),
        ("tsai-hill, lamina, 1, 1, 1, residual=1", "means no failure"),
        ("tsai-hill, steel, 1, 1, 1", "has no directions"),
        ("hashin, lamina, 3, 3, 2, 3, 2, 1", "above half of Y"),
        ("hashin, lamina, 3, 3, 2, 3, 2, 2, residual=2", "means no failure"),
        ("hashin, lamina, 3, 3, 0, 3, 2, 2", "above 0"),
    ],
)
def test_strengths_that_no_lamina_has(run_interpreted, line, says):
    head = PLY.format(0) + "material(steel, linear, 1, 1, 0.3)\n"
    assert says in run_interpreted(f"{head}material(m, {line})\n", status=1).err
