"""Meshes: volumes and centroids of elements, what is read and refused, inside tests."""

import builtins
import math
import re
from pathlib import Path

import meshio
import numpy as np
import pytest
from conftest import INPUTS, ROOT
from hubs import DENSITY, SmallHub
from meshed import CUTS, grid_mesh, write
from test_scene_script import message

from karamelo_py.app.cli import main
from karamelo_py.points.kinematics import Axisymmetric
from karamelo_py.run.lower.memory import common
from karamelo_py.scene.meshes.by_gmsh import begin
from karamelo_py.scene.meshes.elements import SHAPES, elements_of, measured
from karamelo_py.scene.meshes.reading import read
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.meshes import MeshRegion, MeshSolid

CANTILEVER = Path(__file__).parents[2] / "shared/reference/data/cantilever_1041_tets.msh"
COUNTS = {1: (7,), 2: (4, 3), 3: (3, 2, 4)}
GEOMETRY = """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 1, 1};
Disk(2) = {0.5, 0.5, 0, 0.25, 0.25};
BooleanFragments{ Surface{1}; Delete; }{ Surface{2}; Delete; }
Physical Surface("core") = {2};
Physical Surface("rest") = {3};
Physical Surface("both") = {2, 3};
Physical Curve("rim") = {5};
Mesh.MeshSizeMax = 0.1;
"""


def solid_of(path, dimension, h=0.25, lo=-1.0, hi=2.0, **options):
    hub = SmallHub(dimension, lo, hi, h)
    return hub, MeshSolid(hub, path, hub.materials["steel"], h, **options)


def affine(dimension):
    """A map with determinant 2 whatever the dimension, for volumes that are known."""
    matrix = np.eye(dimension) + np.triu(np.full((dimension, dimension), 0.3), 1)
    matrix[0] *= 2
    return lambda x: x @ matrix.T - 0.5


@pytest.mark.parametrize("flipped", [False, True])
@pytest.mark.parametrize("cell", CUTS)
def test_volumes_do_not_depend_on_the_shape_or_the_order_of_nodes(cell, flipped, tmp_path):
    """Exact: a parallelepiped of volume 2, and its centroid."""
    dimension = SHAPES[cell].dimension
    nodes, cells = grid_mesh(cell, COUNTS[dimension], affine(dimension))
    if flipped:
        cells = cells[:, list(SHAPES[cell].mirrored)]
    hub, solid = solid_of(write(tmp_path / "m.vtu", nodes, {cell: cells}), dimension, lo=-3, hi=3)
    assert not hub.warnings
    assert (solid.volume0 > 0).all()
    assert math.isclose(solid.volume0.sum(), 2, rel_tol=1e-13)
    assert math.isclose(solid.mass.sum(), 2 * DENSITY, rel_tol=1e-13)
    middle = affine(dimension)(np.full((1, dimension), 0.5))[0]
    np.testing.assert_allclose(solid.volume0 @ solid.x0 / 2, middle, atol=1e-13)
    assert solid.shape == cell
    assert solid.corners.shape == (solid.count, cells.shape[1], dimension)
    np.testing.assert_allclose(solid.half_size, np.ptp(solid.corners, axis=1) / 2)
    np.testing.assert_allclose(solid.lo, nodes.min(axis=0)[:dimension])
    np.testing.assert_allclose(solid.hi, nodes.max(axis=0)[:dimension])


@pytest.mark.parametrize("cell, size", [("triangle", 96), ("quad", 112), ("tetra", 160),
                                        ("hexahedron", 256)])  # fmt: skip
def test_what_each_process_knows_of_a_mesh(cell, size, tmp_path):
    """The bytes that docs/many-processes.md tells of, and one of each point."""
    dimension = SHAPES[cell].dimension
    nodes, cells = grid_mesh(cell, (8, 9, 7)[:dimension])
    hub, solid = solid_of(write(tmp_path / "m.vtu", nodes, {cell: cells}), dimension, lo=-3, hi=3)
    hub.solids.add("s", solid)
    assert solid.count * (size + 1) <= common(hub) < solid.count * (size + 1) + 200
    page = (ROOT / "docs" / "many-processes.md").read_text(encoding="utf-8")
    assert re.search(rf"{cell[:5]}\w* (\w+ )?{size}", page)


def test_hexahedra_with_faces_that_are_not_plane_have_exact_volumes(tmp_path):
    """The map (x, y, z) -> (x, y, z (1 + x y)) is trilinear; det = 1 + x y, so V = 1 + 1/4.

    Its moment about z = 0 is the integral of z (1 + x y)^2 = (1 + 1/2 + 1/9) / 2.
    """

    def warp(x):
        return np.column_stack([x[:, 0], x[:, 1], x[:, 2] * (1 + x[:, 0] * x[:, 1])])

    for counts in ((1, 1, 1), (2, 3, 2)):
        nodes, cells = grid_mesh("hexahedron", counts, warp)
        path = write(tmp_path / f"{counts[0]}.vtu", nodes, {"hexahedron": cells})
        _, solid = solid_of(path, 3, hi=3)
        assert math.isclose(solid.volume0.sum(), 1.25, rel_tol=1e-14)
        moment = solid.volume0 @ solid.x0[:, 2]
        assert math.isclose(moment, (1 + 1 / 2 + 1 / 9) / 2, rel_tol=1e-14)


def test_corners_are_counter_clockwise(tmp_path):
    nodes, cells = grid_mesh("quad", (2, 2))
    _, solid = solid_of(write(tmp_path / "m.vtu", nodes, {"quad": cells[:, ::-1]}), 2)
    a, b, c = (solid.corners[:, k] for k in range(3))
    assert (
        np.cross(np.pad(b - a, ((0, 0), (0, 1))), np.pad(c - b, ((0, 0), (0, 1))))[:, 2] > 0
    ).all()


def test_boundary_elements_are_left_out(tmp_path):
    nodes, cells = grid_mesh("tetra", (1, 1, 1))
    path = write(tmp_path / "m.vtu", nodes, {"triangle": cells[:, :3], "tetra": cells})
    assert solid_of(path, 3)[1].count == 6


def test_the_cantilever_of_gmsh():
    """1041 tetrahedra of a beam 4 x 1 x 1."""
    if not CANTILEVER.is_file():
        pytest.skip("the reference data beside the checkout are not here")
    _, solid = solid_of(CANTILEVER, 3, hi=5)
    assert solid.count == 1041
    assert math.isclose(solid.volume0.sum(), 4, rel_tol=1e-13)


def test_axisymmetric_volumes_are_those_of_rings(tmp_path):
    """Per radian a square of side 1 at x = 0.5 to 1.5 has (1.5^2 - 0.5^2) / 2 = 1."""
    nodes, cells = grid_mesh("triangle", (3, 5))
    path = write(tmp_path / "m.vtu", nodes + [0.5, 0, 0], {"triangle": cells})
    hub = SmallHub(2, 0, 2, 0.25)
    hub.domain.kin = Axisymmetric()
    solid = MeshSolid(hub, path, hub.materials["steel"], 0.25)
    assert math.isclose(solid.volume0.sum(), 1, rel_tol=1e-14)


def test_elements_outside_the_domain_are_left_out_with_a_warning(tmp_path):
    nodes, cells = grid_mesh("quad", (2, 1))
    path = write(tmp_path / "m.vtu", nodes + [0.5, 0, 0], {"quad": cells})
    hub, solid = solid_of(path, 2, lo=0, hi=1)
    assert solid.count == 1
    assert hub.warnings == ["1 point of mesh 'm.vtu' outside the domain left out of the solid"]
    with pytest.raises(ScriptError, match="all of them lie outside the domain"):
        solid_of(path, 2, lo=5, hi=6)


def test_shapes_may_be_mixed_and_of_higher_order(tmp_path):
    """What Gmsh makes by recombination; curved edges are parabolas (2/3 of chord times sagitta)."""
    nodes = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], float)
    middles = (nodes[[0, 1, 2, 3]] + nodes[[1, 2, 3, 0]]) / 2
    of_triangle = (nodes[[1, 4, 2]] + nodes[[4, 2, 1]]) / 2
    cells = {"quad8": [[0, 1, 2, 3, 5, 6, 7, 8]], "triangle6": [[1, 4, 2, 9, 10, 11]]}
    high = write(tmp_path / "high.vtu", np.concatenate([nodes, middles, of_triangle]), cells)
    plain = {"quad": [[0, 1, 2, 3]], "triangle": [[1, 4, 2]]}
    for path in (high, write(tmp_path / "m.vtu", nodes, plain)):
        hub, solid = solid_of(path, 2, lo=-1, hi=3)
        np.testing.assert_allclose(solid.volume0, [1, 0.5])
        np.testing.assert_allclose(solid.x0, [[0.5, 0.5], [4 / 3, 1 / 3]])
        np.testing.assert_allclose([solid.lo, solid.hi], [[0, 0], [2, 1]])
        np.testing.assert_allclose(solid.half_size, 0.5)
        assert not hub.warnings
    bent = np.concatenate([nodes, middles, of_triangle + [[0, 0, 0], [0.1, 0.1, 0], [0, 0, 0]]])
    hub, solid = solid_of(write(tmp_path / "bent.vtu", bent, cells), 2, lo=-1, hi=3)
    np.testing.assert_allclose(solid.volume0, [1, 0.5 + 2 / 3 * math.sqrt(2) * 0.1 * math.sqrt(2)])
    assert not hub.warnings
    region_hub = SmallHub(2, -1, 3, 0.25)
    MeshRegion(region_hub, tmp_path / "bent.vtu")
    assert "has edges curved by 0.14 of their length" in region_hub.warnings[0]


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])


@pytest.mark.parametrize(
    ("nodes", "cells", "says"),
    [
        (SQUARE, {"polygon": [[0, 1, 2, 3]]}, "elements of type polygon"),
        (SQUARE, {"line": [[0, 1]]}, "does not fit 2D: it has elements of type line"),
        (SQUARE, {"tetra": [[0, 1, 2, 3]]}, "does not fit 2D: it has elements of type tetra"),
        (SQUARE, {"triangle": [[0, 1, 2], [0, 1, 1]]}, "element 2 of the 2 triangles with 3 nodes"),
        (SQUARE + [0, 0, 0.1], {"triangle": [[0, 1, 2]]}, "not lie at z = 0"),
        (SQUARE[[0, 1, 3, 2]], {"quad": [[0, 1, 2, 3]]}, "has no volume"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 1, 0]], {"quad": [[0, 1, 2, 3]]}, "is twisted"),
        (SQUARE * [1, np.nan, 1], {"triangle": [[0, 1, 2]]}, "not a number"),
    ],
)
def test_wrong_meshes(nodes, cells, says, tmp_path):
    path = write(tmp_path / "m.vtu", np.array(nodes, float), cells)
    with pytest.raises(ScriptError, match=says) as caught:
        solid_of(path, 2)
    assert caught.value.argument == "file"


SCENE = """
dimension(2, 0, 1, 0, 1, 0.1)
"""


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("none.msh", None, "the file none.msh does not exist"),
        ("empty.msh", "", "the file empty.msh is empty"),
        ("text.msh", "hello", "cannot be read as a mesh: its content does not fit its ending"),
        ("words.inp", "hello", "cannot be read as a mesh: its content does not fit its ending"),
        ("lfs.vtu", "version https://git-lfs.github.com/spec/v1\n", "it is a pointer of Git LFS"),
        ("body.foo", "hello", "cannot be read as a mesh: its ending identifies no format"),
        ("part.step", "hello", "part.step cannot be read as a mesh: its content does not fit"),
        ("wrong.geo", "Rectangle(1 = ;", "Gmsh cannot mesh wrong.geo: 'wrong.geo', line"),
        ("void.geo", "a = 1;", "void.geo has nothing to mesh"),
    ],
)
def test_files_that_are_no_meshes(name, content, says, tmp_path, monkeypatch, capfd):
    if name.endswith(".geo"):
        pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    monkeypatch.chdir(tmp_path)
    if content is not None:
        Path(name).write_text(content)
    for line in (f"solid(s, mesh, {name}, steel, 0.1)", f"region(r, mesh, {name})"):
        text = message(SCENE + line)
        assert says in text
        assert f"{' ' * line.index(name)}{'^' * len(name)}" in text
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("line", "beside", "meant"),
    [
        ("solid(s, mesh, nofile.msh, steel, 0.1)", "o.fixless", None),
        ("solid(s, mesh, nofile.msh, steel, 0.1)", "o.file.geo", "o.file.geo"),
        ("region(r, mesh, body.msh)", "body.csv", None),
        ("region(r, mesh, body.msh)", "body.VTU", "body.VTU"),
        ("strength(s, tabulated, 80, body.crv)", "body.msh", None),
        ("strength(s, tabulated, 80, body.crv)", "body.txt", "body.txt"),
    ],
)
def test_files_that_may_be_meant(line, beside, meant, tmp_path, monkeypatch):
    """Those that can be read, by their endings."""
    monkeypatch.chdir(tmp_path)
    Path(beside).write_text("")
    text = message(SCENE + line)
    assert "does not exist" in text
    assert ("did you mean" in text) == bool(meant)
    assert not meant or f"did you mean '{meant}'?" in text


def test_without_the_libraries_of_gmsh(tmp_path, monkeypatch):
    (tmp_path / "a.geo").write_text("Point(1) = {0, 0, 0};")
    original = builtins.__import__

    def failing(name, *arguments, **options):
        if name == "gmsh":
            raise OSError("libGLU.so.1: cannot open shared object file")
        return original(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", failing)
    with pytest.raises(ScriptError, match=r"libGLU\.so\.1") as caught:
        read(tmp_path / "a.geo", 2)
    packages = caught.value.expected.partition("apt install ")[2]
    assert packages == "libglu1-mesa libxrender1 libxcursor1 libxft2 libxinerama1"
    assert f"`apt install {packages}`" in (ROOT / "README.md").read_text("utf-8")
    assert "gmsh -2 a.geo -o a.msh" in caught.value.hint


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """A square with a disk in it, as a geometry and in two formats of Gmsh."""
    gmsh = pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    folder = tmp_path_factory.mktemp("plate")
    (folder / "plate.geo").write_text(GEOMETRY)
    begin(gmsh)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(str(folder / "plate.geo"))
    gmsh.model.mesh.generate(2)
    for version in (2.2, 4.1):
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.write(str(folder / f"plate{version}.msh"))
    gmsh.finalize()
    return folder


@pytest.mark.parametrize("name", ["plate.geo", "plate2.2.msh", "plate4.1.msh"])
def test_a_geometry_and_its_groups(plate, name, capfd):
    """The disk is a polygon inside of the circle of radius 1/4, the rest is what is left of 1."""
    area = {}
    for group in (None, "core", "rest", "both"):
        area[group] = solid_of(plate / name, 2, group=group)[1].volume0.sum()
    assert math.isclose(area[None], 1, rel_tol=1e-12)
    assert math.isclose(area["both"], 1, rel_tol=1e-12)
    assert math.isclose(area["core"] + area["rest"], 1, rel_tol=1e-12)
    assert 0.9 * math.pi / 16 < area["core"] < math.pi / 16
    with pytest.raises(ScriptError, match="no physical group 'cor'") as caught:
        solid_of(plate / name, 2, group="cor")
    assert set(caught.value.expected.removeprefix("one of ").split(", ")) == {
        "core", "rest", "both", "rim",
    }  # fmt: skip
    with pytest.raises(ScriptError, match="group 'rim' does not fit 2D"):
        solid_of(plate / name, 2, group="rim")
    assert capfd.readouterr() == ("", "")


def test_a_geometry_in_space_does_not_fit_a_plane():
    """Its only physical group is a volume: Gmsh would write a mesh of nothing."""
    pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    with pytest.raises(
        ScriptError, match="does not fit 2D: its physical groups have 3 dim"
    ) as told:
        solid_of(INPUTS / "cantilever.geo", 2)
    assert told.value.argument == "file"


def test_the_beam_of_tetrahedra_runs_as_it_is(capsys):
    pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    assert main(["check", str(INPUTS / "in.cantilever_tets")]) == 0
    assert re.search("^points +[0-9]+ in 1 solid", capsys.readouterr().out, re.M)


def test_groups_are_regions(plate):
    hub = SmallHub(2, 0, 1, 0.01)
    core = MeshRegion(hub, plate / "plate4.1.msh", "core")
    rest = MeshRegion(hub, plate / "plate4.1.msh", "rest")
    x = np.random.default_rng(0).random((20_000, 2))
    distance = np.linalg.norm(x - 0.5, axis=1)
    inside, outside = core.inside(x), rest.inside(x)
    assert (inside ^ outside).all()
    assert not inside[distance > 0.25].any()
    assert inside[distance < 0.24].all()
    np.testing.assert_allclose(core.box_lo[:2], 0.25, atol=2e-3)
    area = MeshSolid(hub, plate / "plate4.1.msh", hub.materials["steel"], 0.01, group="core")
    filled = hub.solid("s", core)
    assert math.isclose(filled.volume0.sum(), area.volume0.sum(), rel_tol=5e-3)
    exterior = MeshRegion(hub, plate / "plate4.1.msh", "core", "exterior")
    np.testing.assert_array_equal(exterior.inside(x), ~inside)


def test_a_boundary_holds_the_nodes_on_it(tmp_path):
    lines = np.array([[0, 1], [1, 2]])
    mesh = meshio.Mesh(
        SQUARE,
        [("line", lines), ("quad", [[0, 1, 2, 3]])],
        cell_data={"gmsh:physical": [np.array([7, 7]), np.array([1])],
                   "gmsh:geometrical": [np.array([1, 1]), np.array([1])]},
    )  # fmt: skip
    meshio.write(tmp_path / "m.msh", mesh, file_format="gmsh22", binary=False)
    hub = SmallHub(2, 0, 1, 0.1)
    edge = MeshRegion(hub, tmp_path / "m.msh", 7)
    nodes = hub.lattices[0].positions()[:, :2]
    want = (nodes[:, 1] == 0) | np.isclose(nodes[:, 0], 1)
    np.testing.assert_array_equal(edge.inside(nodes), want)
    with pytest.raises(ScriptError, match="no physical group '8'") as caught:
        MeshRegion(hub, tmp_path / "m.msh", 8)
    assert caught.value.expected == "one of 1, 7"


@pytest.mark.parametrize("cell", CUTS)
def test_inside_of_meshes(cell, tmp_path):
    """A sheared box is what its edges span, faces included."""
    dimension = SHAPES[cell].dimension
    move = affine(dimension)
    nodes, cells = grid_mesh(cell, COUNTS[dimension], move)
    path = write(tmp_path / "m.vtu", nodes, {cell: cells})
    hub = SmallHub(dimension, -3, 3, 0.25)
    region = MeshRegion(hub, path)
    rng = np.random.default_rng(1)
    natural = rng.random((1500, dimension)) * 1.4 - 0.2
    natural[:100] = rng.integers(0, 2, (100, dimension))  # corners
    natural[100:300, 0] = 1  # on a face, and beyond its ends
    want = ((natural >= 0) & (natural <= 1)).all(axis=1)
    np.testing.assert_array_equal(region.inside(move(natural)), want)
    filled = hub.solid("s", region, ppc=4)
    assert math.isclose(filled.volume0.sum(), 2, rel_tol=0.1)


def test_warped_hexahedra_leave_no_gaps(tmp_path):
    rng = np.random.default_rng(2)
    nodes, cells = grid_mesh("hexahedron", (4, 4, 4))
    inner = ((nodes > 0) & (nodes < 1)).all(axis=1)
    nodes[inner] += rng.uniform(-0.05, 0.05, (inner.sum(), 3))
    hub = SmallHub(3, 0, 1, 0.1)
    region = MeshRegion(hub, write(tmp_path / "m.vtu", nodes, {"hexahedron": cells}))
    assert region.inside(rng.random((20_000, 3))).all()
    _, volume, _ = measured(elements_of(read(tmp_path / "m.vtu", 3), 3)[0])
    assert math.isclose(volume.sum(), 1, rel_tol=1e-13)


def test_a_quadrilateral_with_a_reflex_corner(tmp_path):
    kite = np.array([[0, 0, 0], [1, 0, 0], [0.45, 0.45, 0], [0, 1, 0]])
    path = write(tmp_path / "m.vtu", kite, {"quad": [[1, 2, 3, 0]]})
    region = MeshRegion(SmallHub(2, 0, 1, 0.1), path)
    x = np.array([[0.4, 0.4], [0.6, 0.1], [0.1, 0.6], [0.49, 0.49], [0.75, 0.22]])
    np.testing.assert_array_equal(region.inside(x), [True, True, True, False, False])


def test_meshes_run(run_interpreted, tmp_path):
    """A free body keeps its energy; its points are those of the mesh."""
    nodes, cells = grid_mesh("triangle", (3, 3))
    (tmp_path / "run").mkdir()
    write(tmp_path / "run" / "body.vtu", nodes, {"triangle": cells})
    result = run_interpreted(
        """
        method(ulmpm, FLIP, linear, 1)
        dimension(2, -0.5, 1.5, -0.5, 1.5, 0.25)
        region(lower, block, INF, INF, INF, 0.5)
        material(rubber, neo-hookean, 1000, 1e5, 0.3)
        solid(s, mesh, body.vtu, rubber, 0.25)
        group(g, particles, region, lower, solid, s)
        fix(v, initial_velocity_particles, all, 1, 0)
        compute(Ek, kinetic_energy, all)
        compute(El, kinetic_energy, g)
        set_dt(1e-4)
        set_output(1)
        log_modify(custom, step, Ek, El)
        run(3)
        """
    )
    np.testing.assert_allclose(result.log.Ek, 500, rtol=1e-5)
    assert 0.3 * 500 < result.log.El[0] < 0.7 * 500
