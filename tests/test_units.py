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
