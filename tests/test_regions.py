"""Domain and regions: who is in, faces included, in 1D, 2D and 3D."""

import math

import numpy as np
import pytest
from hubs import SmallHub, arguments
from hypothesis import given
from hypothesis import strategies as st
from meshed import grid_mesh, sphere_surface, write

from karamelo_py.commands import domain as commands
from karamelo_py.commands import revolution
from karamelo_py.kernels import surfaces
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.scene.domain import Domain
from karamelo_py.scene.lattice import Lattice
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.meshes import STL, MeshRegion
from karamelo_py.styles.regions import (
    BlockRegion,
    Cylinder,
    Difference,
    Intersection,
    Plane,
    Sphere,
    Union,
)


def empty_hub():
    return SmallHub(dimension=0)


# --- dimension, create_domain, axisymmetric ---------------------------------------------------


def test_dimension_sets_box_and_grid():
    hub = empty_hub()
    commands.dimension(hub, *arguments(2, -0.5, 0.5, 0, 0.4, 0.1))
    domain = hub.domain
    assert domain.dimension == 2
    np.testing.assert_array_equal(domain.lo, [-0.5, 0, 0])
    np.testing.assert_array_equal(domain.hi, [0.5, 0.4, 0])
    assert domain.h == 0.1
    assert domain.lattice.cells == (10, 4, 1)
    assert domain.lattice.shape == (11, 5, 1)


def test_node_counts_of_the_reference():
    assert Lattice(2, [0, 0], [0.4, 0.4], 0.1).node_count == 25
    assert Lattice(3, [0, 0, 0], [0.4, 0.4, 0.4], 0.1).node_count == 125


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_node_positions_have_z_fastest(dimension):
    lattice = Lattice(dimension, [1.0] * dimension, [2.0, 1.5, 1.75][:dimension], 0.25)
    x = lattice.positions()
    assert x.shape == (lattice.node_count, 3)
    _, ny, nz = lattice.shape
    index = (3 * ny + min(1, ny - 1)) * nz + min(2, nz - 1)
    want = np.array([1.75, 1.25, 1.5])
    np.testing.assert_allclose(x[index][:dimension], want[:dimension])
    assert (x[:, dimension:] == 0).all()


@given(st.floats(0.1, 10), st.floats(0.01, 2))
def test_grid_covers_a_domain_whose_size_is_no_multiple_of_h(length, h):
    domain = Domain(1, [0.0], [length], h)
    end = domain.lattice.cells[0] * h
    assert end >= length - 1e-8 * h
    assert domain.lattice.cells[0] == 1 or end < length + h


@pytest.mark.parametrize(
    ("texts", "says", "form"),
    [
        ((2, 0, 1), "ymin, ymax, h are missing in 2D", "dimension(2, xmin, xmax, ymin, ymax, h)"),
        ((2, 0, 1, 0, 1), "h is missing in 2D", "dimension(2, xmin, xmax, ymin, ymax, h)"),
        ((1, 0, 1, 0.1, 3), "1 argument too many in 1D", "dimension(1, xmin, xmax, h)"),
        ((4, 0, 1, 0.1), "must be 1, 2 or 3, not 4", "dimension(1, xmin, xmax, h) or dimension(2"),
        ((1.5, 0, 1, 0.1), "must be 1, 2 or 3, not 1.5", "dimension(1, "),
        ((1, 0, 1, 0), "h = 0 must be above 0", "dimension(1, xmin, xmax, h)"),
        ((1, 0, 1, -0.1), "h = -0.1 must be above 0", "dimension(1, xmin, xmax, h)"),
        ((2, 0, 1, 1, 0, 0.1), "ymax = 0 must be above ymin = 1", "dimension(2, "),
        ((1, 0, "nan", 0.1), "xmax must be a finite number, not nan", None),
        ((1, 0, 1, "inf"), "h must be a finite number, not inf", None),
        ((1, 0, "time*2", 1), "xmax must be a constant number", "dimension(1, xmin, xmax, h)"),
        ((1, 0, 1, 1e-12), "cell size 1e-12 gives a grid of 1e+12 nodes", "a larger h"),
    ],
)
def test_wrong_dimensions(texts, says, form):
    with pytest.raises(ScriptError) as caught:
        commands.dimension(empty_hub(), *arguments(*texts))
    assert says in str(caught.value)
    if form:
        assert form in caught.value.expected


def test_a_wrong_value_marks_its_argument():
    with pytest.raises(ScriptError) as caught:
        commands.dimension(empty_hub(), *arguments(2, 0, 1, 3, 2, 0.1))
    assert caught.value.mark.column == len("f(2, 0, 1, 3, ") + 1
    with pytest.raises(ScriptError) as caught:
        commands.dimension(empty_hub(), *arguments(1, 0, 1, -1))
    assert caught.value.mark.column == len("f(1, 0, 1, ") + 1


def test_the_form_of_another_dimension_is_recognised():
    with pytest.raises(ScriptError) as caught:
        commands.dimension(empty_hub(), *arguments(3, 0, 1, 0, 1, 0.1))
    assert "2D" in caught.value.hint


def test_the_older_form():
    hub = empty_hub()
    commands.dimension(hub, *arguments(2))
    assert hub.domain is None
    with pytest.raises(ScriptError, match="no size yet"):
        BlockRegion(hub, *arguments(0, 1, 0, 1))
    commands.create_domain(hub, *arguments(-0.5, 0.5, -0.5, 0.5, 0.05))
    assert hub.domain.lattice.shape == (21, 21, 1)


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("with_h", [False, True])
def test_create_domain_alone(dimension, with_h):
    hub = empty_hub()
    commands.create_domain(hub, *arguments(*[0, 1] * dimension, *[0.25] * with_h))
    assert hub.domain.dimension == dimension
    assert hub.domain.h == (0.25 if with_h else None)


def test_create_domain_must_agree_with_the_dimension():
    hub = empty_hub()
    commands.dimension(hub, *arguments(2))
    with pytest.raises(ScriptError, match="missing in 2D"):
        commands.create_domain(hub, *arguments(0, 1, 0.1))
    with pytest.raises(ScriptError) as caught:
        commands.create_domain(hub, *arguments(0, 1, 0, 1, 0, 1))
    assert "1 argument too many in 2D" in str(caught.value)


def test_without_h_the_first_solid_lays_the_grid():
    hub = empty_hub()
    commands.create_domain(hub, *arguments(0, 1, 0, 1))
    hub.solid("s1", hub.region("r", BlockRegion, 0, 0.5, 0, 0.5), h=0.1)
    assert hub.domain.h == 0.1
    assert hub.domain.lattice.shape == (11, 11, 1)


def test_the_domain_comes_once():
    hub = SmallHub()
    with pytest.raises(ScriptError, match="already set"):
        commands.dimension(hub, *arguments(2, 0, 1, 0, 1, 0.1))
    hub.solid("s1", hub.region("r", BlockRegion, "INF", "INF", "INF", "INF"))
    with pytest.raises(ScriptError, match="once solid 's1' is in it"):
        commands.create_domain(hub, *arguments(0, 1, 0, 1, 0.1))


def test_axisymmetric():
    hub = SmallHub()
    revolution.axisymmetric(hub, False)
    assert not hub.domain.kin.hoops
    with pytest.raises(ScriptError, match="x is a radius"):
        revolution.axisymmetric(hub, True)
    hub = SmallHub(2, 0, 1, 0.1)
    revolution.axisymmetric(hub, True)
    assert hub.domain.kin.hoops
    with pytest.raises(ScriptError, match="3 dimensions, but must have two"):
        revolution.axisymmetric(SmallHub(3, 0, 1, 0.1), True)


def test_regions_need_a_domain():
    with pytest.raises(ScriptError) as caught:
        commands.region(empty_hub(), "r", "block", *arguments(0, 1))
    assert "no domain" in str(caught.value)
    assert "dimension(2, xmin, xmax, ymin, ymax, h)" in caught.value.expected


# --- shapes ------------------------------------------------------------------------------------


def inside(region, *positions):
    return region.inside(np.array(positions, dtype=float)).tolist()


def test_block_holds_its_faces_whatever_the_rounding():
    hub = SmallHub(h=0.1)
    block = hub.region("b", BlockRegion, -0.3, 0.3, 0, 0.3)
    assert inside(block, (0.1 + 0.2, 0.1 * 3, 0), (-0.3, 0, 0), (0.30001, 0.1, 0)) == [
        True,
        True,
        False,
    ]


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_block_in_every_dimension(dimension):
    hub = SmallHub(dimension)
    block = hub.region("b", BlockRegion, *[-0.1, 0.2] * dimension)
    assert inside(block, [0.2] * dimension, [0.21] + [0] * (dimension - 1)) == [True, False]
    used = [1] * dimension + [0] * (3 - dimension)
    np.testing.assert_allclose(block.lo, np.multiply(used, -0.1))
    np.testing.assert_allclose(block.hi, np.multiply(used, 0.2))


def test_open_ends_reach_as_far_as_the_domain():
    hub = SmallHub()
    for k, (lo, hi) in enumerate([("INF", "INF"), ("-INF", "+INF"), ("EDGE", "EDGE")]):
        block = hub.region(f"b{k}", BlockRegion, 0, 0.1, lo, hi)
        np.testing.assert_allclose(block.lo, [0, -0.5, 0])
        np.testing.assert_allclose(block.hi, [0.1, 0.5, 0])
        assert inside(block, (0.05, 7), (0.2, 0)) == [True, False]
    far = hub.region("far", BlockRegion, -1e20, 1e20, 0, 1)
    assert np.isinf(far.box_lo[0]) and np.isinf(far.box_hi[0])


def test_a_plane_is_a_block_with_equal_ends():
    hub = SmallHub()
    assert inside(hub.region("b", BlockRegion, 0, 0, "INF", "INF"), (0, 0.3), (0.01, 0.3)) == [
        True,
        False,
    ]


@pytest.mark.parametrize(
    ("dimension", "style", "texts", "says"),
    [
        (2, BlockRegion, (0, 1), "ylo, yhi are missing in 2D"),
        (2, BlockRegion, (0, 1, 0, 1, 2), "1 argument too many"),
        (2, BlockRegion, (1, 0, 0, 1), "xlo = 1 is above xhi = 0"),
        (2, BlockRegion, ("+INF", 0, 0, 1), "xlo cannot be +INF"),
        (2, BlockRegion, (0, "-INF", 0, 1), "xhi cannot be -INF"),
        (2, BlockRegion, (0, "nan", 0, 1), "xhi must be a finite number"),
        (2, BlockRegion, (0, "x0*2", 0, 1), "xhi must be a constant number"),
        (2, Cylinder, (0, 0, 0), "R = 0 must be above 0"),
        (2, Cylinder, (0, 0), "R is missing"),
        (2, Cylinder, ("INF", 0, 1), "INF is not a number"),
        (1, Cylinder, (0, 1), "no form for 1D"),
        (3, Cylinder, ("w", 0, 0, 1, 0, 1), "axis must be one of x, y, z"),
        (3, Cylinder, ("z", 0, 0, 1, 2, 1), "lo = 2 is above hi = 1"),
        (3, Cylinder, ("z", 0, 0, -1, 0, 1), "R = -1 must be above 0"),
        (3, Sphere, (0, 0, 0, -1), "R = -1 must be above 0"),
        (3, Sphere, (0, 0, 1), "R is missing in 3D"),
    ],
)
def test_wrong_shapes(dimension, style, texts, says):
    with pytest.raises(ScriptError) as caught:
        style(SmallHub(dimension), *arguments(*texts))
    assert says in str(caught.value)


def test_a_wrong_block_shows_the_form_for_the_dimension():
    with pytest.raises(ScriptError) as caught:
        BlockRegion(SmallHub(3), *arguments(0, 1, 0, 1))
    assert caught.value.expected == ("region(ID, block, xlo, xhi, ylo, yhi, zlo, zhi[, exterior])")
    assert caught.value.hint == "4 arguments are the form for 2D"


def test_a_disk():
    hub = SmallHub()
    disk = hub.region("d", Cylinder, 0.1, 0.1, 0.2)
    assert inside(disk, (0.3, 0.1), (0.1, -0.1), (0.25, 0.25), (0.3, 0.3)) == [
        True,
        True,
        False,
        False,
    ]
    np.testing.assert_allclose(disk.lo, [-0.1, -0.1, 0])
    np.testing.assert_allclose(disk.hi, [0.3, 0.3, 0])


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_cylinders_along_each_axis(axis):
    hub = SmallHub(3)
    along = "xyz".index(axis)
    rod = hub.region("rod", Cylinder, axis, 0.1, -0.2, 0.15, -0.3, "INF")
    centre = np.insert([0.1, -0.2], along, 0.0)
    points = np.tile(centre, (4, 1))
    points[1, along] = -0.3  # on the end
    points[2, along] = -0.31  # beyond it
    points[3, (along + 1) % 3] += 0.16  # aside
    assert rod.inside(points).tolist() == [True, True, False, False]
    assert rod.lo[along] == -0.3
    assert rod.hi[along] == 0.5
    np.testing.assert_allclose(np.delete(rod.hi, along), [0.25, -0.05])


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_spheres(dimension):
    hub = SmallHub(dimension)
    ball = hub.region("s", Sphere, *[0.1] * dimension, 0.2)
    axis = np.eye(dimension)[0]
    assert ball.inside(0.1 + np.outer([0.2, -0.2, 0.2001, 0], axis)).tolist() == [
        True,
        True,
        False,
        True,
    ]
    np.testing.assert_allclose(ball.lo[:dimension], -0.1)


@pytest.mark.parametrize(
    ("style", "texts"),
    [(BlockRegion, (-0.1, 0.1, -0.1, 0.1)), (Cylinder, (0, 0, 0.1)), (Sphere, (0, 0, 0.1))],
)
def test_exterior_inverts(style, texts):
    hub = SmallHub()
    plain = hub.region("p", style, *texts)
    outside = hub.region("o", style, *texts, "exterior")
    x = np.random.default_rng(1).uniform(-0.5, 0.5, (500, 3))
    np.testing.assert_array_equal(outside.inside(x), ~plain.inside(x))
    np.testing.assert_array_equal(outside.lo, hub.domain.lo)
    np.testing.assert_array_equal(outside.hi, hub.domain.hi)


def test_union_intersection_difference():
    hub = SmallHub()
    a = hub.region("a", BlockRegion, -0.2, 0.1, -0.2, 0.2)
    b = hub.region("b", Cylinder, 0.1, 0, 0.2)
    c = hub.region("c", Sphere, 0, 0, 0.15, "exterior")
    x = np.random.default_rng(2).uniform(-0.5, 0.5, (2000, 2))
    A, B, C = (part.inside(x) for part in (a, b, c))
    union = hub.combine("u", Union, a, b, c)
    both = hub.combine("i", Intersection, a, b, c)
    cut = hub.combine("d", Difference, a, b)
    nested = hub.combine("n", Difference, union, both)
    thrice = hub.combine("t", Difference, a, b, c)
    np.testing.assert_array_equal(thrice.inside(x), A & ~B & ~C)
    np.testing.assert_array_equal(thrice.distance(x, 0.02) > 0, A & ~B & ~C)
    np.testing.assert_array_equal(union.inside(x), A | B | C)
    np.testing.assert_array_equal(both.inside(x), A & B & C)
    np.testing.assert_array_equal(cut.inside(x), A & ~B)
    np.testing.assert_array_equal(nested.inside(x), (A | B | C) & ~(A & B & C))
    np.testing.assert_allclose(both.lo, [-0.1, -0.2, 0])
    np.testing.assert_allclose(both.hi, [0.1, 0.2, 0])
    np.testing.assert_allclose(cut.hi, a.hi)
    np.testing.assert_allclose(hub.combine("u2", Union, a, b).hi, [0.3, 0.2, 0])
    assert math.isinf(union.box_hi[0])


@given(st.integers(0, 2**32 - 1))
def test_a_region_lies_in_its_box(seed):
    rng = np.random.default_rng(seed)
    hub = SmallHub()
    lo, hi = np.sort(rng.uniform(-0.5, 0.5, (2, 2)), axis=0)
    a = hub.region("a", BlockRegion, lo[0], hi[0], lo[1], hi[1])
    b = hub.region("b", Cylinder, *rng.uniform(-0.3, 0.3, 2), 0.2)
    x = rng.uniform(-0.5, 0.5, (300, 2))
    regions = [a, b]
    for k, style in enumerate((Union, Intersection, Difference)):
        regions.append(hub.combine(f"r{k}", style, a, b))
    for region in regions:
        found = x[region.inside(x)]
        if len(found):
            assert (found >= region.lo[:2] - 1e-9).all()
            assert (found <= region.hi[:2] + 1e-9).all()


@pytest.mark.parametrize("exterior", [(), ("exterior",)])
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_distances_tell_inside_from_outside_and_are_none_too_long(dimension, exterior, tmp_path):
    """No function that changes by at most the way gone is more than the distance of its zeros."""
    hub = SmallHub(dimension)
    block = hub.region("b", BlockRegion, *[-0.2, 0.13] * dimension, *exterior)
    ball = hub.region("s", Sphere, *[0.1] * dimension, 0.2)
    regions = [block, ball]
    if dimension == 3:
        regions.append(hub.region("c", Cylinder, "z", 0.1, 0, 0.2, -0.1, "INF", *exterior))
        points, triangles = sphere_surface(0.25, 8, 6)
        path = write(tmp_path / "ball.stl", points, {"triangle": triangles}, binary=True)
        regions.append(hub.regions.add("stl", STL(hub, path)))
    nodes, cells = grid_mesh(("line", "quad", "tetra")[dimension - 1], (2,) * dimension)
    nodes[:, :dimension] -= 0.7
    path = write(tmp_path / "m.vtu", nodes, {("line", "quad", "tetra")[dimension - 1]: cells})
    regions.append(hub.regions.add("mesh", MeshRegion(hub, path)))
    if dimension == 2:
        regions.append(hub.region("c", Cylinder, 0.1, 0, 0.2, *exterior))
    for k, style in enumerate((Union, Intersection, Difference)):
        regions.append(hub.combine(f"r{k}", style, *regions[-2:]))
    rng = np.random.default_rng(3)
    x = rng.uniform(-0.4, 0.4, (300, dimension))
    y = x + rng.normal(0, 0.02, x.shape)
    for region in regions:
        depth, beside = region.depth(x, 0.3), region.depth(y, 0.3)
        np.testing.assert_array_equal(depth > 0, region.inside(x))
        assert (np.abs(depth - beside) <= np.linalg.norm(x - y, axis=1) * (1 + 1e-9)).all()
        # Kernels, which look at one place at a time, know the same, as far as they look.
        outline, kin = region.outline(), KINEMATICS[dimension]()
        known = [surfaces.depth(outline, kin, kin.Vector(*place), 0.3) for place in x[:40]]
        np.testing.assert_allclose(np.minimum(known, 0.3), np.minimum(depth[:40], 0.3), atol=1e-12)


def test_a_plane_has_two_sides():
    hub = SmallHub(2)
    slope = hub.region("slope", Plane, 0, 0.1, 3, 4)
    x = np.array([[0.0, 0.1], [0.04, 0.07], [0.3, 0.5], [-0.3, -0.3]])
    assert slope.inside(x).tolist() == [True, True, True, False]
    assert slope.depth(x, 1) == pytest.approx([0, 0, (0.9 + 1.6) / 5, (-0.9 - 1.6) / 5], abs=1e-12)
    other = hub.region("other", Plane, 0, 0.1, 3, 4, "exterior")
    assert other.inside(x[2:]).tolist() == [False, True]
    with pytest.raises(ScriptError, match="the normal of the plane is zero"):
        hub.region("none", Plane, 0, 0, 0, 0)
