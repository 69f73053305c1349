"""Failure of a lamina off its axes: closed form, and what is left of it."""

from math import cos, radians, sin, sqrt

import pytest

from comparisons.results import read_log

X, Y, S = 2000e6, 50e6, 80e6
PLY = """
    material(lamina, orthotropic, 1600, 140e9, 9e9, 9e9, 0.3, 0.3, 0.4, 5e9, 5e9, 3e9, {0})
    material(ply, tsai-hill, lamina, 2000e6, 50e6, 80e6, {0}, Xc=1200e6, Yc=170e6)
"""


def strength(angle, along=X, across=Y):
    """1/s^2 = c^4/X^2 + (1/S^2 - 1/X^2) s^2 c^2 + s^4/Y^2 (Jones 1999, equation 2.130)."""
    c, s = cos(radians(angle)), sin(radians(angle))
    return 1 / sqrt(c**4 / along**2 + (1 / S**2 - 1 / along**2) * (s * c) ** 2 + s**4 / across**2)


@pytest.mark.parametrize(("angle", "sign"), [(0, 1), (20, 1), (90, 1), (0, -1), (90, -1)])
def test_a_lamina_breaks_off_its_axes(run_interpreted, angle, sign):
    exact = strength(angle) if sign > 0 else strength(angle, 1200e6, 170e6)
    c, s = cos(radians(angle)), sin(radians(angle))
    compliance = c**4 / 140e9 + (1 / 5e9 - 0.6 / 140e9) * (s * c) ** 2 + s**4 / 9e9
    end = 1.1 * sign * exact * compliance
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


SCENE = f"""
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, 1, 0, 1, 0.25)
    plane_stress(true)
    region(box, block, 0, 1, 0, 1)
    {PLY.format(30)}
    solid(s, region, box, 2, ply, 0.25, 0)
    group(s, particles, region, box, solid, s)
    fix(v, initial_velocity_particles, s, 250*x, 100*x)
    set_dt(5e-6)
    compute(Es, strain_energy, s)
    compute(Ed, dissipated_energy, s)
    log_modify(custom, Es, Ed)
    log(5)
    run(20)
"""


def test_compiled_lanes_are_the_point_function(run_script, run_interpreted):
    slow, fast = run_interpreted(SCENE).log, run_script(SCENE, folder="compiled").log
    assert slow["Ed"][-1] > 0
    for name in ("Es", "Ed"):
        assert fast[name] == pytest.approx(slow[name], rel=1e-8)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("lamina, 1, 2, 1", "below twice the strength along axis 1"),
        ("lamina, 1, 1, 1, residual=1", "is no failure"),
        ("steel, 1, 1, 1", "has no directions"),
    ],
)
def test_strengths_that_no_lamina_has(run_interpreted, line, says):
    head = PLY.format(0) + "material(steel, linear, 1, 1, 0.3)\n"
    assert says in run_interpreted(f"{head}material(m, tsai-hill, {line})\n", status=1).err
