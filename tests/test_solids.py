"""Solids: where the points are put, in which order, and what is refused."""

import math
import tracemalloc

import numpy as np
import pytest
from hubs import DENSITY, SmallHub
from hypothesis import given
from hypothesis import strategies as st
from meshed import cube_surface, write

from karamelo_py.commands import domain as commands
from karamelo_py.points.basis.cpdi.domains import R4
from karamelo_py.points.basis.gimp import UGIMP
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.kinematics import Axisymmetric
from karamelo_py.scene.placement import cell_pattern
from karamelo_py.scene.region import Region
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.meshes import STL, MeshRegion
from karamelo_py.styles.methods.base import Method
from karamelo_py.styles.methods.cpdi import ULCPDI
from karamelo_py.styles.methods.ulmpm import TLMPM
from karamelo_py.styles.regions import (
    BlockRegion,
    Cylinder,
    Difference,
    Intersection,
    Plane,
    Sphere,
    Union,
)


def whole(hub, ID="whole"):
    return hub.region(ID, BlockRegion, *["INF"] * (2 * hub.domain.dimension))


def karamelo_points(region, domain, ppc, dimension):
    """The same rule in plain loops: cells x outermost, then y, then z, then points in a cell."""
    along = [-0.3873, 0, 0.3873] if ppc == 3 else [(i + 0.5) / ppc - 0.5 for i in range(ppc)]
    pattern = {
        1: [(a,) for a in along],
        2: [(a, b) for a in along for b in along],
        3: [(a, b, c) for c in along for a in along for b in along],
    }[dimension]
    points = []
    for i in range(domain.lattice.cells[0]):
        for j in range(domain.lattice.cells[1]):
            for k in range(domain.lattice.cells[2]):
                for offset in pattern:
                    x = [
                        domain.lo[axis] + (cell + 0.5 + offset[axis]) * domain.h
                        for axis, cell in enumerate((i, j, k)[:dimension])
                    ]
                    if region.inside(np.array([x]))[0] and domain.contains(np.array([x]))[0]:
                        points.append(x)
    return np.array(points).reshape(-1, dimension)


def test_two_disks_have_208_points_each():
    """Karamelo's count for the 2020 paper's example (reference, section 4.5)."""
    hub = SmallHub(2, -0.5, 0.5, 0.05)
    for number, centre in enumerate((-0.3, 0.3), start=1):
        solid = hub.solid(f"s{number}", hub.region(f"d{number}", Cylinder, centre, centre, 0.2))
        assert solid.count == 208
        assert solid.first_id == 208 * (number - 1)
        assert solid.index == number - 1


def test_first_point_of_karamelos_dump():
    """Reference, section 4.1: (-0.4525, -0.4025), after moving by 0.01 in both directions."""
    hub = SmallHub(2, -0.5, 0.5, 0.05)
    solid = hub.solid("s", hub.region("d", Cylinder, -0.3, -0.3, 0.2))
    np.testing.assert_allclose(solid.x0[0] + 0.01, [-0.4525, -0.4025])


@pytest.mark.parametrize("ppc", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_places_and_order(dimension, ppc):
    hub = SmallHub(dimension, 0.1, 0.75, 0.2)  # 4 cells per side, the last one cut by the domain
    ball = hub.region("r", Sphere, *[0.45] * dimension, 0.28)
    solid = hub.solid("s", ball, ppc=ppc)
    want = karamelo_points(ball, hub.domain, ppc, dimension)
    assert solid.x0.shape == want.shape
    np.testing.assert_allclose(solid.x0, want, atol=1e-14)
    assert solid.x0.flags["C_CONTIGUOUS"]


def test_order_within_a_cell():
    """Reference, section 3.2: 2D (-,-),(-,+),(+,-),(+,+); in 3D the lower z quad first."""
    quad = [(-0.25, -0.25), (-0.25, 0.25), (0.25, -0.25), (0.25, 0.25)]
    np.testing.assert_array_equal(cell_pattern(2, 2)[0], quad)
    np.testing.assert_array_equal(
        cell_pattern(2, 3)[0], [(*xy, z) for z in (-0.25, 0.25) for xy in quad]
    )
    np.testing.assert_array_equal(cell_pattern(2, 1)[0], [[-0.25], [0.25]])


def test_points_do_not_depend_on_chunks(monkeypatch):
    def points():
        hub = SmallHub(3, 0, 1, 0.1)
        return hub.solid("s", hub.region("r", Sphere, 0.5, 0.5, 0.5, 0.4)).x0

    whole_at_once = points()
    monkeypatch.setattr("karamelo_py.scene.lattice.CHUNK", 100)
    np.testing.assert_array_equal(points(), whole_at_once)


def test_volume_and_mass():
    hub = SmallHub(2, 0, 1, 0.1)
    solid = hub.solid("s", whole(hub), ppc=3, T0=293.0)
    assert solid.count == 900
    assert solid.T0 == 293.0
    assert solid.volume0.shape == solid.mass.shape == (900,)
    assert math.isclose(solid.volume0.sum(), 1.0)
    assert math.isclose(solid.mass.sum(), DENSITY)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_boxes_that_a_ball_cuts_have_its_volume(dimension):
    """Volume and middle of a ball, as far as parts of a box tell. What is not cut stays."""
    hub = SmallHub(dimension, -1, 1, 0.1)
    middle = np.array([0.013, 0.021, 0.007])[:dimension]
    ball = hub.region("ball", Sphere, *middle, 0.61)
    cut = hub.solid("cut", ball, ppc=2, points="cut")
    regular = hub.solid("regular", ball, ppc=2)
    exact = {1: 1.22, 2: np.pi * 0.61**2, 3: 4 / 3 * np.pi * 0.61**3}[dimension]
    assert cut.volume0.sum() == pytest.approx(exact, rel=1e-3)
    assert not hub.warnings
    centre = np.average(cut.x0, axis=0, weights=cut.volume0)
    np.testing.assert_allclose(centre, middle, atol=2e-4)
    inner = np.abs(regular.x0 - middle).max(axis=1) < 0.3
    same = (cut.x0[:, None, :] == regular.x0[inner]).all(axis=2)
    assert (same.sum(axis=0) == 1).all()
    assert np.prod(2 * cut.half_size, axis=1) == pytest.approx(cut.volume0)


def test_nothing_is_cut_of_whole_boxes():
    hub = SmallHub(2, 0, 1, 0.1)
    block = hub.region("b", BlockRegion, 0.2, 0.7, 0.1, 0.55)
    cut, regular = (hub.solid(p, block, ppc=2, points=p) for p in ("cut", "regular"))
    np.testing.assert_array_equal(cut.x0, regular.x0)
    np.testing.assert_array_equal(cut.mass, regular.mass)


def thin(hub, style, part, *ends):
    """A block of 4 x 2 with a part joined to it or taken from it."""
    whole = hub.region("whole", BlockRegion, 0, 4, 0, 2)
    return hub.combine("thin", style, whole, hub.region("part", part, *ends))


CUT = {
    "disk": (lambda hub: hub.region("r", Cylinder, 0.013, 0.021, 2.5), np.pi * 2.5**2, 1e-3),
    "block": (lambda hub: hub.region("r", BlockRegion, 0, 4.1, 0, 1.03), 4.1 * 1.03, 1e-9),
    "strip": (lambda hub: hub.region("r", BlockRegion, 0, 4.1, 0.2, 0.24), 4.1 * 0.04, 1e-9),
    "slot": (
        lambda hub: thin(hub, Difference, BlockRegion, 1.013, 5, 1.014, 1.245),
        8 - 2.987 * 0.231,
        5e-3,
    ),
    "fin": (lambda hub: thin(hub, Union, BlockRegion, 3, 6, 1.014, 1.245), 8 + 2 * 0.231, 5e-3),
    "hole": (lambda hub: thin(hub, Difference, Cylinder, 2, 1, 0.3), 8 - np.pi * 0.3**2, 2e-3),
}


@pytest.mark.parametrize("ppc", [1, 2, 3])
@pytest.mark.parametrize("shape", CUT)
def test_what_a_region_cuts_has_its_area(shape, ppc):
    """Lengths in cells."""
    hub = SmallHub(2, -10, 10, 1.0)
    region, exact, tolerance = CUT[shape]
    solid = hub.solid("s", region(hub), ppc=ppc, points="cut")
    assert solid.volume0.sum() == pytest.approx(exact, rel=tolerance)
    assert not hub.warnings
    if shape != "strip":  # which is thinner than a tenth of a box everywhere
        assert solid.volume0.min() >= 0.1 / ppc**2


def test_a_part_that_bounds_the_region_may_be_thin():
    """A strip of a disk, along its middle: exact across, arcs as far as parts of a box tell."""
    hub = SmallHub(2, -10, 10, 1.0)
    disk = hub.region("disk", Cylinder, 0, 0, 2.5)
    strip = hub.region("strip", BlockRegion, -5, 5, 0.2, 0.24)
    solid = hub.solid("s", hub.combine("r", Intersection, disk, strip), points="cut")
    assert solid.volume0.sum() == pytest.approx(2 * 0.04 * np.sqrt(2.5**2 - 0.22**2), rel=5e-3)
    assert not hub.warnings


def slanted(hub, tmp_path, width, thickness):
    """A plate of this size that leans, in the plane."""
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * (width, thickness)
    nodes = np.zeros((4, 3))
    nodes[:, :2] = corners @ turn + (0.31, 0.17)
    path = write(tmp_path / "plate.vtu", nodes, {"quad": np.array([[0, 1, 2, 3]])})
    return hub.regions.add("plate", MeshRegion(hub, path))


@pytest.mark.parametrize(("thickness", "tolerance"), [(0.08, 0.03), (0.3, 0.01)])
def test_a_thin_part_that_leans_has_its_area(tmp_path, thickness, tolerance):
    """Lengths in boxes of points; tolerances are those that the documentation says."""
    hub = SmallHub(2, -10, 10, 1.0)
    plate = slanted(hub, tmp_path, 5, thickness)
    solid = hub.solid("s", plate, ppc=1, points="cut")
    assert solid.volume0.sum() == pytest.approx(5 * thickness, rel=tolerance)
    assert not [said for said in hub.warnings if "thinner" in said]


@pytest.mark.parametrize("style", [Union, Difference])
def test_parts_too_thin_to_be_seen_are_told(style, tmp_path):
    hub = SmallHub(2, -10, 10, 1.0)
    thin = slanted(hub, tmp_path, 5, 0.01)
    block = hub.region("block", BlockRegion, 0, 4, 0, 2)
    hub.solid("s", hub.combine("r", style, block, thin), ppc=1, points="cut")
    assert "too thin for points=cut, 0.0312" in hub.warnings[0]


def test_a_thin_sheet_in_space_is_told(tmp_path):
    """A surface of triangles, of which the mass would be missing."""
    hub = SmallHub(3, -2, 2, 1.0)
    nodes, triangles = cube_surface(-0.5, 0.5)
    turn = np.linalg.qr(np.array([(1, 2, 3), (4, 1, -1), (0.3, -1, 2.0)]))[0]
    path = write(tmp_path / "s.stl", (nodes * (0.9, 0.9, 0.004)) @ turn, {"triangle": triangles})
    hub.solid("s", hub.regions.add("sheet", STL(hub, path)), ppc=1, points="cut")
    assert "too thin for points=cut, 0.0312" in hub.warnings[0]


def test_a_thin_ring_has_its_area():
    hub = SmallHub(2, -10, 10, 1.0)
    disks = [hub.region(f"d{k}", Cylinder, 0.1, 0.1, r) for k, r in enumerate((2.5, 2.4))]
    solid = hub.solid("s", hub.combine("ring", Difference, *disks), ppc=1, points="cut")
    assert solid.volume0.sum() == pytest.approx(np.pi * (2.5**2 - 2.4**2), rel=0.03)


def test_a_region_that_knows_no_distance_is_cut():
    """As those of plug-ins, which only say what they contain."""

    class Plain(Cylinder):
        distance = Region.distance

        def contains(self, x: np.ndarray) -> np.ndarray:
            return Cylinder.distance(self, x, np.inf) >= 0

    hub = SmallHub(2, -1, 1, 0.1)
    solid = hub.solid("s", hub.region("r", Plain, 0.013, 0.021, 0.61), points="cut")
    assert solid.volume0.sum() == pytest.approx(np.pi * 0.61**2, rel=1e-3)


def test_domains_with_corners_are_not_cut():
    hub = SmallHub(2, 0, 1, 0.1)
    hub.use(ULCPDI, R4())
    with pytest.raises(ScriptError, match="tile a body"):
        hub.solid("s", hub.region("d", Cylinder, 0.5, 0.5, 0.3), points="cut")


@given(st.floats(0.3, 1.0), st.floats(0.02, 0.2), st.integers(1, 4))
def test_a_region_of_any_size_is_filled_to_within_a_layer_of_points(width, h, ppc):
    hub = SmallHub(1, 0.0, 1.0, h)
    solid = hub.solid("s", hub.region("r", BlockRegion, 0, width), ppc=ppc)
    gap = 0.3873 * h if ppc == 3 else h / ppc
    assert abs(solid.volume0.sum() - width) <= 2 * gap
    assert solid.x0.min() >= 0 and solid.x0.max() <= width + 1e-8


def test_exterior_fills_the_rest_of_the_domain():
    hub = SmallHub(2, 0, 1, 0.05)
    hole = hub.region("hole", Cylinder, 0.5, 0.5, 0.2)
    rest = hub.region("rest", Cylinder, 0.5, 0.5, 0.2, "exterior")
    inner, outer = hub.solid("a", hole), hub.solid("b", rest)
    assert inner.count + outer.count == 1600
    assert not hub.warnings


def test_points_outside_the_domain_are_left_out_with_a_warning():
    hub = SmallHub(2, 0, 1, 0.1)
    solid = hub.solid("s", hub.region("r", BlockRegion, 0.8, 1.3, -0.3, 0.2))
    assert solid.count == 16
    assert solid.x0.max() < 1
    assert hub.warnings == ["84 points of region 'r' outside the domain left out of the solid"]


def test_a_huge_region_is_not_walked_through():
    hub = SmallHub(2, 0, 1, 0.1)
    solid = hub.solid("s", hub.region("r", BlockRegion, -1e15, 1e15, -1e15, 1e15))
    assert solid.count == 400
    assert hub.warnings == ["points of region 'r' outside the domain left out of the solid"]


def test_a_domain_that_is_no_multiple_of_h_loses_no_points_silently():
    hub = SmallHub(2, 0, 1, 0.3)
    solid = hub.solid("s", whole(hub), ppc=2)
    assert solid.x0.max() <= 1
    # 49 points of 0.15 x 0.15.
    assert [one.split(" volume")[0] for one in hub.warnings] == ["the points have 10.25% more"]


def test_open_ends_of_a_part_do_not_warn():
    hub = SmallHub(2, 0, 1, 0.3)
    strip = hub.region("strip", BlockRegion, "INF", "INF", 0, 0.3)
    ball = hub.region("ball", Sphere, 0.5, 0.5, 0.1)
    hub.solid("s", hub.combine("u", Union, strip, ball))
    assert not hub.warnings


@pytest.mark.parametrize(
    ("region", "options", "says", "argument"),
    [
        ((0.2, 0.8, 0.2, 0.8), {"h": 0.2}, "differs from the domain's, 0.1", "h"),
        ((0.2, 0.8, 0.2, 0.8), {"T0": math.inf}, "T0 must be a finite number", "T0"),
        ((0.21, 0.22, 0.21, 0.22), {}, "no point lies in region 'r'", "region"),
        ((1.2, 1.8, 0.2, 0.8), {}, "all of them lie outside the domain", "region"),
        ((0.2, 0.8, 0.2, 0.8), {"ppc": 10**9}, "points would be needed", None),
    ],
)
def test_wrong_solids(region, options, says, argument):
    hub = SmallHub(2, 0, 1, 0.1)
    with pytest.raises(ScriptError) as caught:
        hub.solid("s", hub.region("r", BlockRegion, *region), **options)
    assert says in str(caught.value)
    assert caught.value.argument == argument


def test_a_solid_needs_a_method_and_a_domain():
    hub = SmallHub()
    hub.update.method = None
    with pytest.raises(ScriptError) as caught:
        commands.solid(hub, "s", "region")
    assert "method(" in caught.value.expected
    hub = SmallHub(dimension=0)
    with pytest.raises(ScriptError, match="no domain"):
        commands.solid(hub, "s", "region")


@pytest.mark.parametrize("kind", ["file", "regoin"])
def test_other_kinds_of_solids(kind):
    with pytest.raises(ScriptError, match="unknown solid style") as caught:
        commands.solid(SmallHub(), "s", kind)
    assert caught.value.expected == "one of mesh, points, region"


def test_gauss_points_carry_the_weights_of_the_quadrature():
    """Legendre points of order 3: +-sqrt(3/5) and 0 with weights 5/18, 8/18, 5/18."""
    hub = SmallHub(2, 0, 1, 0.5)
    solid = hub.solid("s", whole(hub), ppc=3, points="gauss")
    assert math.isclose(solid.volume0.sum(), 1, rel_tol=1e-14)
    place = 0.25 * math.sqrt(0.6)
    np.testing.assert_allclose(solid.x0[0], 0.25 - place)
    np.testing.assert_allclose(solid.x0[4], 0.25)
    np.testing.assert_allclose(solid.volume0[[0, 1, 4]] * 4, np.array([25, 40, 64]) / 324)
    np.testing.assert_allclose((2 * solid.half_size).prod(axis=1), solid.volume0)
    # Of the fifth degree in each direction, exactly.
    assert math.isclose(solid.volume0 @ solid.x0.prod(axis=1) ** 5, 1 / 36, rel_tol=1e-14)


def test_gauss_points_at_the_edge_of_a_region_keep_their_own_weights():
    hub = SmallHub(2, 0, 1, 0.5)
    solid = hub.solid("s", hub.region("r", BlockRegion, 0, 0.3, 0, 1), ppc=3, points="gauss")
    full = SmallHub(2, 0, 1, 0.5)
    every = full.solid("s", whole(full), ppc=3, points="gauss")
    kept = every.x0[:, 0] < 0.3
    np.testing.assert_array_equal(solid.x0, every.x0[kept])
    np.testing.assert_array_equal(solid.volume0, every.volume0[kept])


def test_three_points_are_those_of_karamelo_unless_said_otherwise():
    """Reference, section 3.2: offsets 0.3873 h with equal volumes."""
    hub = SmallHub(1, 0, 1, 1)
    solid = hub.solid("s", whole(hub), ppc=3)
    np.testing.assert_allclose(solid.x0[:, 0], [0.1127, 0.5, 0.8873])
    np.testing.assert_allclose(solid.volume0, 1 / 3)
    regular = hub.solid("t", whole(hub, "w2"), ppc=3, points="regular")
    np.testing.assert_allclose(regular.x0[:, 0], [1 / 6, 1 / 2, 5 / 6])


@pytest.mark.parametrize("method, basis", [(Method, UGIMP()), (ULCPDI, R4())])
def test_three_points_with_domains_stand_so_that_these_tile_the_cell(method, basis):
    hub = SmallHub(2, 0, 1, 1)
    hub.use(method, basis)
    solid = hub.solid("s", whole(hub), ppc=3)
    np.testing.assert_allclose(np.unique(solid.x0), [1 / 6, 1 / 2, 5 / 6])
    np.testing.assert_allclose(solid.half_size, 1 / 6)


def test_domains_of_points_are_boxes():
    hub = SmallHub(3, 0, 1, 0.1)
    solid = hub.solid("s", hub.region("r", BlockRegion, 0.2, 0.61, 0.3, 2, "INF", 0.5))
    assert solid.shape == "box" and solid.corners is None
    assert solid.half_size.shape == (solid.count, 3)
    assert (solid.half_size == 0.025).all()
    np.testing.assert_array_equal(solid.lo, [0.2, 0.3, 0])
    np.testing.assert_array_equal(solid.hi, [0.61, 1, 0.5])


def test_axisymmetric_volumes_are_times_the_radius():
    """Per radian, from x = 0 to 1 and y = 0 to 1: 1/2, by the midpoint rule exactly."""
    hub = SmallHub(2, 0, 1, 0.1)
    hub.domain.kin = Axisymmetric()
    solid = hub.solid("s", whole(hub))
    np.testing.assert_allclose(solid.volume0, 0.05**2 * solid.x0[:, 0])
    assert math.isclose(solid.mass.sum(), DENSITY / 2)
    hub = SmallHub(2, -1, 1, 0.1)
    hub.domain.kin = Axisymmetric()
    with pytest.raises(ScriptError, match="x is the radius") as caught:
        hub.solid("s", whole(hub))
    assert caught.value.argument == "region"


def own_grids(hub, **attributes):
    """Let the method lay a grid for each solid, as total Lagrangian ones do."""
    hub.use(TLMPM, Linear())
    hub.update.method.__dict__.update(attributes)
    return hub


def test_a_grid_of_its_own_begins_at_the_lower_corner_of_the_solid():
    """Reference, sections 3.1, 4.5: region 0.3..0.65 x 0.3..0.5, points up to x = 0.625."""
    hub = own_grids(SmallHub(2, 0, 1, 0.25))
    solid = hub.solid("s", hub.region("r", BlockRegion, 0.3, 0.65, 0.3, 0.5), h=0.1)
    assert solid.h == 0.1 and hub.domain.h == 0.25
    np.testing.assert_allclose(solid.x0[0], [0.325, 0.325])
    np.testing.assert_allclose(solid.x0.max(axis=0), [0.625, 0.475])
    assert solid.count == 28
    np.testing.assert_array_equal(solid.lo, [0.3, 0.3])
    np.testing.assert_array_equal(solid.hi, [0.65, 0.5])


def test_a_grid_of_its_own_ends_at_the_domain():
    hub = own_grids(SmallHub(2, 0, 1, 0.25))
    strip = hub.region("strip", BlockRegion, "INF", "INF", 0.5, 1.3)
    solid = hub.solid("s", strip, h=0.1, ppc=1)
    np.testing.assert_allclose(solid.x0[0], [0.05, 0.55])
    assert solid.count == 50
    assert hub.warnings == ["30 points of region 'strip' outside the domain left out of the solid"]
    assert (hub.solid("t", hub.region("u", BlockRegion, 0, 1, 0, 0.3), h=0.3).h) == 0.3


def test_glue():
    hub = SmallHub(2, 0, 1, 0.1)
    first = hub.solid("a", hub.region("l", BlockRegion, 0, 0.5, 0, 1))
    assert first.glued_to is None
    second = hub.solid("b", hub.region("r", BlockRegion, 0.5, 1, 0, 1), GlueToSolid=first)
    assert second.glued_to is first
    assert len(hub.warnings) == 1 and "no effect" in hub.warnings[0]
    own_grids(hub, fields_per_solid=True)
    hub.solid("c", hub.region("m", BlockRegion, 0.5, 0.7, 0, 1), h=0.07, GlueToSolid=first)
    assert len(hub.warnings) == 1


def test_placing_a_million_points_is_quick_and_lean():
    hub = SmallHub(2, 0, 1, 1 / 500)
    region = whole(hub)
    tracemalloc.start()
    solid = hub.solid("s", region)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert solid.count == 1_000_000
    # The points once in chunks and once in one piece, and some chunks of work.
    assert peak < 3 * solid.x0.nbytes + 40e6


def test_the_mirror_image_beyond_a_side_is_not_missed():
    """A quarter of a disk about the corner of the domain, and a half one about a side."""
    hub = SmallHub(2, 0, 1, 0.1)
    hub.solid("a", hub.region("r", Cylinder, 0, 0, 0.4))
    hub.solid("b", hub.region("s", Cylinder, 0.6, 1, 0.3))
    assert not hub.warnings
    hub.solid("c", hub.region("t", Cylinder, 0.9, 0.5, 0.2))
    assert len(hub.warnings) == 1


def test_solids_in_contact_have_smooth_faces_where_these_lean():
    """Nothing said: whole boxes in a method with one grid, and of a block; cut of what leans."""
    for method, leaning in (("ulmpm", False), ("ulmpm/contacts", True)):
        hub = SmallHub(2)
        hub.interpreter.run_text(f"method({method}, FLIP, linear, 1)")
        block = hub.region("block", BlockRegion, -0.3, 0.3, -0.3, 0.3)
        disk = hub.region("disk", Cylinder, 0, 0, 0.3)
        slope = hub.region("slope", Plane, 0, 0, 1, 2)
        level = hub.region("level", Plane, 0, 0, 0, -2)
        wedge = hub.combine("wedge", Intersection, block, slope)
        slab = hub.combine("slab", Intersection, block, level)
        for region, leans in ((disk, True), (wedge, True), (block, False), (slab, False)):
            assert hub.solid(region.id, region).cut == (leaning and leans)
        assert hub.solid("whole", disk, points="regular").cut is False


def test_a_half_space_has_no_volume_to_be_compared_with(run_interpreted):
    """A leaning plane fills a part of the domain."""
    result = run_interpreted(
        """
        method(ulmpm, FLIP, linear, 1)
        dimension(2, 0, 4, 0, 4, 0.5)
        region(slope, plane, 0, 2, -0.5, -0.8)
        material(rock, linear, 1000, 1e6, 0.3)
        solid(base, region, slope, 2, rock, 0.5)
        fix(g, body_force, all, 0, -1)
        """,
        command="check",
    )
    assert "volume, and mass" not in result.err
