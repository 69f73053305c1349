"""populate_cylindrical_coordinates: points in rings."""

import math

import numpy as np
import pytest

from karamelo_py.language.interpreter import Interpreter
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

PLANE = """
method(ulmpm, FLIP, linear, 1)
dimension(2, -1, 1, -1, 1, 0.1)
region(disk, cylinder, 0.1, 0, 0.5)
region(left, block, INF, 0.1, INF, INF)
region(far, block, 0.8, 0.9, 0.8, 0.9)
material(steel, linear, 1000, 1000, 0.3)
solid(s1, region, disk, 2, steel, 0.1, 0)
solid(s2, region, far, 2, steel, 0.1, 0)
"""
SPACE = """
method(ulmpm, FLIP, linear, 1)
dimension(3, -1, 1, -1, 1, -1, 1, 0.25)
region(rod, cylinder, y, 0, 0, 0.5, -0.5, 0.5)
material(steel, linear, 1000, 1000, 0.3)
solid(s1, region, rod, 2, steel, 0.25, 0)
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Runs a script; returns the hub."""
    monkeypatch.chdir(tmp_path)

    def run(text):
        hub = Hub()
        hub.console.quiet = True
        hub.interpreter = Interpreter(hub)
        hub.interpreter.run_text(text)
        return hub

    return run


def test_a_disk(run):
    """pi R^2 in all, the moment of inertia pi R^4 / 2 to the order of the rings."""
    hub = run(PLANE + "populate_cylindrical_coordinates(s1, disk, 0.1, 0, 0.5, 10, 36, 7)")
    s1, s2 = hub.solids.values()
    assert s1.count == 360 and s1.T0 == 7
    assert math.isclose(s1.volume0.sum(), math.pi * 0.25, rel_tol=1e-13)
    assert math.isclose(s1.mass.sum(), 1000 * math.pi * 0.25, rel_tol=1e-13)
    radius = np.linalg.norm(s1.x0 - [0.1, 0], axis=1).reshape(10, 36)
    np.testing.assert_allclose(radius, np.repeat(0.05 * np.arange(0.5, 10)[:, None], 36, axis=1))
    np.testing.assert_allclose(s1.x0[0], [0.125, 0])
    np.testing.assert_allclose(s1.half_size[0], [0.025, 0.025 * math.pi / 36])
    assert math.isclose(s1.volume0 @ radius.ravel() ** 2, math.pi / 32, rel_tol=0.01)
    assert s2.first_id == 360
    assert hub.simulation.count == 360 + s2.count


@pytest.mark.parametrize("axis", "xyz")
def test_a_rod(run, axis):
    """pi R^2 (hi - lo), about each axis; slices stand in the middle of their lengths."""
    shape = f"{axis}, 0, 0, 0.5, -0.5, 0.5"
    hub = run(
        SPACE.replace("y, 0, 0, 0.5, -0.5, 0.5", shape)
        + f"populate_cylindrical_coordinates(s1, rod, {shape}, 4, 5, 12, 0)"
    )
    (solid,) = hub.solids.values()
    assert solid.count == 4 * 5 * 12
    assert math.isclose(solid.volume0.sum(), math.pi / 4, rel_tol=1e-13)
    along = "xyz".index(axis)
    np.testing.assert_allclose(np.unique(solid.x0[:, along]), [-0.375, -0.125, 0.125, 0.375])
    np.testing.assert_allclose(np.delete(solid.x0[0], along), [0.05, 0], atol=1e-15)
    assert (solid.half_size[:, along] == 0.125).all()
    np.testing.assert_allclose([solid.lo, solid.hi], [[-0.5] * 3, [0.5] * 3])


def test_points_outside_the_region_are_dropped(run):
    hub = run(PLANE + "populate_cylindrical_coordinates(s1, left, 0.1, 0, 0.5, 10, 36, 0)")
    assert hub.solids["s1"].count == 10 * 19  # two of 36 angles lie on the edge of the region
    assert hub.solids["s1"].x0[:, 0].max() <= 0.1 + 1e-9


def test_arrays_that_were_made_before_are_made_anew(run):
    hub = run(
        PLANE
        + """
compute(m, average_velocity, all)
before = value(m_x)
populate_cylindrical_coordinates(s1, disk, 0.1, 0, 0.5, 10, 36, 0)
"""
    )
    assert len(hub.fields.position) == 360 + hub.solids["s2"].count
    np.testing.assert_array_equal(hub.fields.position[:360], hub.solids["s1"].x0)


LINE = "populate_cylindrical_coordinates(s1, disk, 0, 0, 0.5, 4, 12, 0)"


@pytest.mark.parametrize(
    ("lines", "mark", "says"),
    [
        (LINE.replace("0.5", "-0.5"), "-0.5", "R = -0.5 must be above 0"),
        (LINE.replace("12", "1.5"), "1.5", "Ndtheta must be a whole number of at least 1"),
        (LINE.replace(", 12", ""), None, "T0 is missing in 2D"),
        (LINE.replace("s1", "s3"), "s3", "unknown solid 's3'"),
        (LINE.replace("disk", "far"), "far", "the solid has no points"),
        ("group(g, particles, region, disk, all)\n" + LINE, "s1", "group 'g' was chosen"),
        ("set_dt(1e-4)\nrun(1)\n" + LINE, "s1", "have been in a run"),
    ],
)
def test_mistakes(run, lines, mark, says):
    with pytest.raises(ScriptError) as caught:
        run(PLANE + lines)
    text = caught.value.render()
    assert says in text
    place = caught.value.mark
    assert place.line == (PLANE + lines).count("\n") + 1
    if mark:
        assert place.text[place.column - 1 : place.column - 1 + place.length] == mark


def test_ends_in_the_wrong_order(run):
    with pytest.raises(ScriptError, match="hi = -1 must be above lo = 1"):
        run(SPACE + "populate_cylindrical_coordinates(s1, rod, y, 0, 0, 0.5, 1, -1, 4, 5, 12, 0)")


def test_a_group_of_points_that_keep_their_numbers_stays(run):
    run(
        PLANE
        + """
group(g, particles, region, disk, solid, s1)
populate_cylindrical_coordinates(s2, disk, 0, 0, 0.1, 2, 6, 0)
"""
    )


def test_groups_of_nodes_follow_the_grid_of_the_solid(run):
    """In tlmpm a grid begins at the box of its points; a group made before goes along."""
    script = PLANE.replace("ulmpm", "tlmpm") + "group(low, nodes, region, left, solid, s1)\n"
    hub = run(script + "populate_cylindrical_coordinates(s1, disk, -0.2, 0, 0.3, 6, 24, 0)")
    grid = hub.lattices[0]
    assert grid.lo[:2] == pytest.approx([-0.4, -0.3])  # the box of the points within the region
    wanted = np.flatnonzero(hub.regions["left"].inside(grid.positions()))
    np.testing.assert_array_equal(hub.groups["low"].nodes, wanted)
