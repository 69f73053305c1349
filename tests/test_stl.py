"""Region stl: what closed surfaces enclose."""

import math
import re

import numpy as np
import pytest
from hubs import SmallHub
from meshed import cube_surface, enclosed_volume, sphere_surface, write
from test_scene_script import message

from karamelo_py.kernels import surfaces
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.scene.meshes.inside import skin_of
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.meshes import STL
from karamelo_py.styles.regions import BlockRegion, Difference, Union


@pytest.fixture(params=[True, False], ids=["binary", "text"])
def stl(request, tmp_path):
    """Writes a surface to a file."""

    def written(points, triangles):
        path = tmp_path / "body.stl"
        return write(path, points, {"triangle": triangles}, binary=request.param)

    return written


def test_a_cube(stl):
    """Nodes on its faces belong to it; the body has its volume, in the digits of the file."""
    hub = SmallHub(3, -0.5, 1.5, 0.1)
    region = STL(hub, stl(*cube_surface(0.1, 0.9)))
    nodes = hub.lattices[0].positions()
    want = ((nodes > 0.1 - 1e-6) & (nodes < 0.9 + 1e-6)).all(axis=1)
    np.testing.assert_array_equal(region.inside(nodes), want)
    assert math.isclose(hub.solid("s", region).volume0.sum(), 0.8**3, rel_tol=1e-7)
    np.testing.assert_allclose(region.box_hi, 0.9, rtol=1e-6)
    outside = STL(hub, stl(*cube_surface(0.1, 0.9)), "exterior")
    np.testing.assert_array_equal(outside.inside(nodes), ~want)


def test_a_sphere(tmp_path):
    """The volume of the polyhedron, by the divergence theorem, to within the lattice of points."""
    points, triangles = sphere_surface(0.4, 24, 12, (0.05, 0, 0))
    hub = SmallHub(3, -0.5, 0.5, 0.1)
    path = write(tmp_path / "body.stl", points, {"triangle": triangles}, binary=True)
    solid = hub.solid("s", STL(hub, path))
    assert math.isclose(solid.volume0.sum(), enclosed_volume(points, triangles), rel_tol=5e-4)
    assert not hub.warnings


def test_rays_through_edges_and_vertices_count_once():
    """Positions straight below vertices, edges and the poles, off the surface itself."""
    points, triangles = sphere_surface(1.0, 16, 8)
    surface = skin_of(points, triangles, 1e-9)
    edges = (points[triangles] + points[np.roll(triangles, 1, axis=1)]).reshape(-1, 3) / 2
    above = np.concatenate([points, edges])
    for height in (-2.0, -0.01, 0.0, 0.013, 2.0):
        x = above.copy()
        x[:, 2] = height
        radius = np.linalg.norm(x, axis=1)
        inside = surface.contains(x)
        assert inside[radius < 0.9].all()
        assert not inside[radius > 1 + 1e-9].any()


def test_neither_the_order_of_vertices_nor_a_rotation_changes_what_is_inside():
    rng = np.random.default_rng(3)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points, triangles = cube_surface(-1, 1)
    flipped = triangles.copy()
    flipped[::2] = flipped[::2, ::-1]
    local = rng.uniform(-1.3, 1.3, (20_000, 3))
    local[:5000] = rng.choice([-0.5, 0.0, 0.5], (5000, 3))
    local[5000:6000] = np.sign(local[5000:6000])  # vertices
    want = (np.abs(local) <= 1).all(axis=1)
    for faces in (triangles, flipped):
        straight = skin_of(points, faces, 1e-9).contains(local)
        turned = skin_of(points @ rotation, faces, 1e-9).contains(local @ rotation)
        np.testing.assert_array_equal(straight, want)
        np.testing.assert_array_equal(turned, want)


def test_a_part_inside_is_a_cavity():
    outer, faces = cube_surface(0, 1)
    inner, _ = cube_surface(0.25, 0.75)
    surface = skin_of(np.concatenate([outer, inner]), np.concatenate([faces, faces + 8]), 1e-9)
    x = np.array([[0.1, 0.1, 0.1], [0.5, 0.5, 0.5], [0.5, 0.5, 0.1], [0.5, 0.5, 1.1]])
    np.testing.assert_array_equal(surface.contains(x), [True, False, True, False])


def test_vertices_with_few_digits_are_joined():
    points, triangles = cube_surface()
    apart = points[triangles].reshape(-1, 3)
    apart += np.random.default_rng(4).uniform(-1e-8, 1e-8, apart.shape)
    surface = skin_of(apart, np.arange(len(apart)).reshape(-1, 3), 1e-6)
    np.testing.assert_array_equal(
        surface.contains(np.array([[0.5, 0.5, 0.5], [0.3, 0.3, -0.1]])), [True, False]
    )


SCENE = "dimension(3, 0, 1, 0, 1, 0, 1, 0.1)\n"


def test_an_open_surface_is_refused(stl, monkeypatch):
    points, triangles = cube_surface()
    path = stl(points, triangles[:-1])
    monkeypatch.chdir(path.parent)
    text = message(SCENE + "region(r, stl, body.stl)")
    assert "the surface is not closed: 3 edges belong to one triangle only" in text
    assert re.search(r"^ +\| +\^{8}$", text, re.M)


def test_what_is_no_surface(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    points, triangles = cube_surface()
    write("body.stl", points, {"triangle": triangles})
    write("box.vtu", points, {"hexahedron": [range(8)]})
    assert "in 3D only" in message("dimension(2, 0, 1, 0, 1, 0.1)\nregion(r, stl, body.stl)")
    assert "box.vtu has no triangles" in message(SCENE + "region(r, stl, box.vtu)")
    assert "outside" in message(SCENE + "region(r, stl, body.stl, outside)")
    (tmp_path / "cut.stl").write_bytes((tmp_path / "body.stl").read_bytes()[:150])
    assert "cut.stl cannot be read as a mesh" in message(SCENE + "region(r, stl, cut.stl)")
    with pytest.raises(ScriptError, match="not exist"):
        from karamelo_py.language.interpreter import Interpreter

        Interpreter(SmallHub(3)).run_text("region(r, stl, bdy.stl)")


def boxes(*ends):
    """Points and triangles of cubes from `lo` to `hi` along each axis."""
    made = [cube_surface(*end) for end in ends]
    points = np.concatenate([points for points, _ in made])
    faces = np.concatenate([triangles + 8 * k for k, (_, triangles) in enumerate(made)])
    return points, faces


def test_shells_that_overlap_are_one_body(stl):
    """Two cubes of 0.6, shifted by 0.3: 2 x 0.216 - 0.027, at each of three ways to fill it."""
    hub = SmallHub(3, -0.1, 1.1, 0.1)
    region = STL(hub, stl(*boxes((0, 0.6), (0.3, 0.9))))
    x = np.array([[0.45, 0.45, 0.45], [0.2, 0.2, 0.2], [0.8, 0.8, 0.8], [0.2, 0.2, 0.8]])
    np.testing.assert_array_equal(region.contains(x), [True, True, True, False])
    # In the middle of both the surface is 0.15 away in space, though faces are as near.
    assert region.distance(x, 1.0) == pytest.approx([0.15, 0.2, 0.1, -0.1 * math.sqrt(2)])
    for k, points in enumerate(("regular", "gauss", "cut")):
        volume = hub.solid(f"s{k}", region, points=points).volume0.sum()
        assert volume == pytest.approx(0.405, rel=1e-6)


def test_shells_that_meet_in_a_face_leave_no_gap_and_no_wall():
    points, triangles = boxes((0, 1), (0, 1))
    points[8:, 0] = 2 - points[8:, 0]
    skin = skin_of(points, triangles, 1e-9)
    x = np.array([[0.5, 0.5, 0.5], [1.0, 0.5, 0.5], [1.5, 0.5, 0.5], [2.1, 0.5, 0.5]])
    np.testing.assert_array_equal(skin.contains(x), [True, True, True, False])
    assert skin.depth(x[1:2], 1.0) == pytest.approx(0.5)
    assert skin.volume == pytest.approx(2)


def test_every_shell_in_another_changes_what_is_inside():
    """A ball in a cavity in a body, however their triangles are turned; one that is twice there."""
    points, triangles = boxes((0, 1), (0.2, 0.8), (0.4, 0.6))
    x = np.array([[0.1, 0.5, 0.5], [0.3, 0.5, 0.5], [0.5, 0.5, 0.5]])
    for turned in (slice(0), slice(12), slice(12, 24), slice(0, None, 5)):
        faces = triangles.copy()
        faces[turned] = faces[turned][:, ::-1]
        skin = skin_of(points, faces, 1e-9)
        np.testing.assert_array_equal(skin.contains(x), [True, False, True])
        assert skin.volume == pytest.approx(1 - 0.6**3 + 0.2**3)
    skin = skin_of(points, np.concatenate([triangles[:12], triangles[:12]]), 1e-9)
    assert skin.contains(x).all() and skin.volume == pytest.approx(1)


def test_a_part_between_two_prongs_is_no_cavity():
    """All corners of the bar lie in the prongs, and its middle in the gap between them."""
    points, triangles = boxes((0, 1), (0, 1), (0, 1))
    points[:8] *= [0.4, 1, 1]
    points[8:16] *= [0.4, 1, 1]
    points[8:16, 0] += 0.6
    points[16:] = points[16:] * [0.6, 0.2, 0.2] + [0.2, 0.4, 0.4]
    base = cube_surface(0, 1)[0] * [1, 1, 0.2] + [0, 0, -0.1]
    points = np.concatenate([points, base])
    triangles = np.concatenate([triangles, cube_surface(0, 1)[1] + 24])
    skin = skin_of(points, triangles, 1e-9)
    x = np.array([[0.3, 0.5, 0.5], [0.5, 0.5, 0.5], [0.5, 0.5, 0.8], [0.5, 0.5, 0.05]])
    np.testing.assert_array_equal(skin.contains(x), [True, True, False, True])


@pytest.mark.parametrize("seed", range(3))
def test_distances_are_those_of_the_nearest_triangle(seed):
    """Against all triangles one by one, by SciPy's bounded least squares over a face."""
    optimize = pytest.importorskip("scipy.optimize")
    points, triangles = sphere_surface(1.0, 6, 4)
    rng = np.random.default_rng(seed)
    points = points * rng.uniform(0.6, 1.4, (len(points), 1))
    x = rng.uniform(-1.5, 1.5, (4, 3))
    found = skin_of(points, triangles, 1e-9).depth(x, 10.0)
    for place, depth in zip(x, found, strict=True):
        least = math.inf
        for a, b, c in points[triangles]:
            for origin, *ways in ((a, b - a, c - a), (a, b - a), (b, c - b), (c, a - c)):
                fit = optimize.lsq_linear(np.array(ways).T, place - origin, (0, 1))
                if fit.x.sum() <= 1:  # of a face, within it
                    least = min(least, math.sqrt(2 * fit.cost))
        assert abs(depth) == pytest.approx(least, rel=1e-6)


CUBE_OF_QUADS = """# a cube of six faces
mtllib none.mtl
o body
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
vt 0 0
vn 0 0 -1
"""


@pytest.mark.parametrize(
    "faces",
    [
        "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n",
        "f 1/1 4/1 3/1 2/1\nf 5//1 6//1 7//1\nf 5/1/1 7/1/1 8/1/1\nf 1 2 6 \\\n5\nf 2 3 7 6\n"
        "g side # the last two\nf 3 4 8 7\nf 4 1 5 8\n",
        "f -8 -5 -6 -7\nf -4 -3 -2 -1\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n",
    ],
    ids=["quads", "textured", "counted from the end"],
)
def test_faces_of_obj_files(tmp_path, faces):
    (tmp_path / "cube.obj").write_text(CUBE_OF_QUADS + faces)
    region = STL(SmallHub(3, -1, 2, 0.25), tmp_path / "cube.obj")
    assert region.skin.volume == pytest.approx(1)


def test_polygons_of_obj_files_that_turn_inwards(tmp_path):
    """A bar with an L for its ends, of area 3, and one of an arrowhead, of area 1."""
    outlines = {3: [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
                1: [(0, 0), (2, 1), (0, 2), (1, 1)]}  # fmt: skip
    for area, outline in outlines.items():
        n = len(outline)
        lines = [f"v {x} {y} {z}" for z in (0, 1) for x, y in outline]
        lines += [
            f"f {k + 1} {(k + 1) % n + 1} {(k + 1) % n + n + 1} {k + n + 1}" for k in range(n)
        ]
        lines += ["f " + " ".join(str(k) for k in range(n, 0, -1))]
        lines += ["f " + " ".join(str(n + k) for k in range(1, n + 1))]
        (tmp_path / "bar.obj").write_text("\n".join(lines))
        region = STL(SmallHub(3, -1, 3, 0.25), tmp_path / "bar.obj")
        assert region.skin.volume == pytest.approx(area)
        # Nothing is near beyond the reentrant corner, 0.5 from both of its faces.
        x = np.array([[1.5, 1.5, 1.0]]) if area == 3 else np.array([[0.25, 1.0, 1.0]])
        assert -region.distance(x, 1.0)[0] == pytest.approx(0.5 if area == 3 else 0.53, abs=0.01)


def test_a_wrong_line_of_an_obj_file_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wrong = {
        "f 1 2 9": "a vertex that does not exist",
        "f 1 2": "three corners or more",
        "v 1 2": "not enough values",
        "v 1 2 x": "could not convert",
    }
    for line, why in wrong.items():
        (tmp_path / "cube.obj").write_text(CUBE_OF_QUADS + line + "\n")
        said = message(SCENE + "region(r, stl, cube.obj)")
        assert "cube.obj cannot be read as a mesh: line 14: " in said and why in said


def box(tmp_path, *lengths, corner=0.05):
    """A file with a box of these lengths."""
    points, triangles = cube_surface(0, 1)
    points = points * lengths + corner
    return write(tmp_path / "box.stl", points, {"triangle": triangles}, binary=True)


def test_a_shape_from_a_file_has_its_mass(tmp_path):
    """Of 0.7 x 0.65 x 0.8 = 0.364; regular points have a third more, which is told."""
    hub = SmallHub(3, -1, 2, 0.25)
    region = hub.regions.add("r", STL(hub, box(tmp_path, 0.7, 0.65, 0.8)))
    solid = hub.solid("s", region)
    assert solid.volume0.sum() == pytest.approx(0.364, rel=1e-4)
    assert solid.volumes == pytest.approx((0.364, 0.364), rel=1e-4)
    assert not hub.warnings
    solid = hub.solid("t", region, points="regular")
    assert solid.volumes[0] == pytest.approx(solid.volume0.sum())
    assert solid.volumes[0] > 1.1 * 0.364
    assert "more volume, and mass, than region 'r': " in hub.warnings[-1]
    hub.region("other", BlockRegion, -0.5, -0.25, 0, 0.3, 0, 0.3)
    for style in (Union, Difference):
        whole = hub.combine(style.__name__, style, region, hub.regions["other"])
        assert hub.solid(f"of {style.__name__}", whole).cut


@pytest.mark.parametrize(
    ("length", "told"),
    [
        (800, "scaled by 0.001 it would fit (a file in millimetres, a script in metres)"),
        (0.02, "scaled by 25.4 it would fit (a file in inches, a script in millimetres)"),
        (0.3, ""),
        (20, ""),
    ],
)
def test_other_units_are_named(tmp_path, length, told):
    """A box in a domain of 2 with cells of 0.1: what may be meant is told, and no more."""
    hub = SmallHub(3, -1, 1, 0.1)
    STL(hub, box(tmp_path, length, length / 2, length / 2, corner=length / 100))
    assert told in "".join(hub.warnings) and bool(told) == bool(hub.warnings)


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("count", [0, 1, 2, 5, 37])
def test_the_nearest_face_does_not_depend_on_the_known_one(d, count):
    """The search in the tree, from any face, finds what a search of all faces finds."""
    rng, kin = np.random.default_rng(count + d), KINEMATICS[d]()
    corners = rng.random((count, d, d)) if count < 37 else rng.integers(0, 3, (count, d, d)) / 2
    surface = surfaces.surface_of(corners, 1e-9)
    assert sorted(surface.faces.tolist()) == sorted(corners.tolist())
    for reach in (0.2, 2.0):
        for x in (kin.Vector(*place) for place in rng.random((6, d))):
            near = [surfaces._squared(kin, surface, i, x) for i in range(count)]
            best = min([*near, reach * reach])
            face = near.index(best) if best in near else -1
            for known in range(-1, count, 6):
                assert surfaces.closest(kin, surface, x, reach, known) == (best, face)


def test_the_way_out_of_a_surface_is_that_to_the_nearest_face():
    """Of a cube, out of its faces and away from its edges; nowhere deeper than it is known."""
    points, triangles = cube_surface(0, 1)
    surface, kin = skin_of(points, triangles, 1e-9).surfaces[0], KINEMATICS[3]()
    slanted = np.array([1.0, 2.0, 2.0]) / 3
    ways = {
        (0.5, 0.4, 1.1): (0, 0, 1), (0.5, 0.4, 0.9): (0, 0, 1), (0.5, 0.4, 0.999): (0, 0, 1),
        (0.5, 1.1, 1.1): (0, 0.5**0.5, 0.5**0.5), tuple(1 + 0.1 * slanted): slanted,
        (0.5, 0.5, 0.5): (0, 0, 0),
    }  # fmt: skip
    for place, wanted in ways.items():
        x, reach = kin.Vector(*place), 0.3
        within = surfaces.depth(surface, kin, x, reach)
        found = surfaces.slopes(surface, kin, x, reach, (within, 0.01))
        assert np.array(found) / 0.02 == pytest.approx(np.array(wanted), abs=1e-9), place
