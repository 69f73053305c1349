"""Names of consistent sets of units."""

import pytest

from karamelo_py.output.units import ENERGY, FORCE, STRESS, VELOCITY, Powers, Units


@pytest.mark.parametrize(
    ("units", "force", "stress", "energy"),
    [
        # The sets that manuals of other programs list (LS-DYNA, Abaqus).
        (Units("m", "kg", "s"), "N", "Pa", "J"),
        (Units("mm", "g", "ms"), "N", "MPa", "mJ"),
        (Units("mm", "t", "s"), "N", "MPa", "mJ"),
        (Units("mm", "kg", "ms"), "kN", "GPa", "J"),
        (Units("cm", "g", "us"), "cm g/us^2", "g/(cm us^2)", "cm^2 g/us^2"),
    ],
)
def test_units_of_consistent_sets(units, force, stress, energy):
    assert (units.name(FORCE), units.name(STRESS), units.name(ENERGY)) == (force, stress, energy)


def test_units_of_columns():
    units = Units("mm", "g", "ms")
    names = {"x0": "mm", "vy_update": "mm/ms", "s12": "MPa", "seq": "MPa", "e11": "", "ep": ""}
    names |= {"volume": "mm^3", "mass": "g", "T": "K", "epdot": "1/ms", "fx": "N", "id": ""}
    assert {name: units.of_column(name) for name in names} == names
    assert units.name(VELOCITY) == "mm/ms" and units.name(Powers()) == ""


GRAVITY = """
{units}
method(ulmpm, FLIP, linear, 0.99)
dimension(2, 0, 4, 0, 4, 1)
material(steel, linear, {rho}, {E}, 0.3)
region(b, block, 1, 3, 1, 3)
solid(b, region, b, 1, steel, 1)
fix(g, body_force, all, 0, {g})
run(1)
"""
SI, MM = (7850, 2.1e11), (7.85e-9, 2.1e5)


@pytest.mark.parametrize(
    ("units", "steel", "g", "right"),
    [
        ("units(mm, t, s)", MM, "-9.81", "9810"),
        ("units(mm, t, s)", MM, "-9.81*min(time, 1)", "9810"),
        ("units(mm, g, ms)", (7.85e-3, 2.1e5), "9.8", "0.00981"),
        ("", MM, "-9.81", "9810"),
        ("units(m, kg, s)", SI, "-9810", "9.81"),
        ("", SI, "-9810", "9.81"),
        ("", (1.0, 1e3), "-9810", None),
        ("units(mm, t, s)", MM, "-9810", None),
        ("units(m, kg, s)", SI, "-9.81", None),
        ("", SI, "-9.81*min(time, 1)", None),
        ("", MM, "-9810", None),
    ],
)
def test_gravity_in_other_units_is_told(run_interpreted, units, steel, g, right):
    """9.81 m/s^2 are 9810 mm/s^2 and 0.00981 mm/ms^2."""
    script = GRAVITY.format(units=units, rho=steel[0], E=steel[1], g=g)
    err = run_interpreted(script, command="check").err
    assert (f"fix: gravity is {right} there" in err) == (right is not None)
    assert ("an acceleration of 9" in err) == (right is not None)


def test_no_step_mends_units_that_were_doubted(run_interpreted):
    """A block of steel in MPa, m, kg, s flies apart: the error names the units once more."""
    script = GRAVITY.format(units="units(m, kg, s)", rho=7850, E=2.1e5, g="0")
    thrown = "fix(v, initial_velocity_particles, all, 3000*(x - 1.5), 0)\nrun(50)"
    result = run_interpreted(script.replace("run(1)", thrown), status=1)
    assert "warning: units of " in result.err
    error = result.err[result.err.index("error: ") :]
    assert "check the units of " in error and "a smaller dt_factor" not in error
