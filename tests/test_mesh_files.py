"""Meshes as other programs write them: volumes that follow from the files by hand."""

import math
import re
import signal
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
from hubs import SmallHub
from scipy.io import netcdf_file

from karamelo_py.scene.meshes import reading
from karamelo_py.scene.meshes.abaqus import read_deck
from karamelo_py.scene.meshes.by_gmsh import begin
from karamelo_py.scene.meshes.elements import MIDDLES, SHAPES, elements_of, measured
from karamelo_py.scene.meshes.reading import read
from karamelo_py.scene.solid import words_of_volumes
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.meshes import MeshRegion, MeshSolid, near_set

SQUARES = """\
*NODE
1, 0, 0, 0
2, 1, 0, 0
3, 2, 0, 0
4, 0, 1, 0
5, 1, 1, 0
6, 2, 1, 0
"""
BOTH = "*ELEMENT, TYPE=CPS4, ELSET=A\n1, 1, 2, 5, 4\n*ELEMENT, TYPE=CPS4, ELSET=B\n2, 2, 3, 6, 5\n"
CUBE = """\
*NODE
1, 0, 0, 0
2, 1, 0, 0
3, 1, 1, 0
4, 0, 1, 0
5, 0, 0, 1
6, 1, 0, 1
7, 1, 1, 1
8, 0, 1, 1
*ELEMENT, TYPE=C3D8, ELSET=CUBE
1, 1, 2, 3, 4, 5, 6, 7, 8
"""
VTU = """<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">
<UnstructuredGrid><Piece NumberOfPoints="{n}" NumberOfCells="1">
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">{x}</DataArray></Points>
<Cells><DataArray type="Int64" Name="connectivity" format="ascii">{nodes}</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">{n}</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">{type}</DataArray></Cells>
<CellData><DataArray type="Int64" Name="mat" format="ascii">3</DataArray></CellData>
</Piece></UnstructuredGrid></VTKFile>
"""
PART = "*Part, name=P\n" + CUBE + "*Elset, elset=E, generate\n1, 1, 1\n*End Part\n"


def volume(path, dimension, group=None):
    parts = elements_of(read(path, dimension), dimension, group)
    return sum(measured(part)[1].sum() for part in parts)


@pytest.mark.parametrize(
    ("deck", "group", "area"),
    [
        (SQUARES + "*ELEMENT, TYPE=CPS4\n1, 1, 2, 5, 4\n** a comment\n2, 2, 3, 6, 5\n", None, 2),
        (SQUARES + BOTH + "*ELSET, ELSET=BOTH\nA, B\n", "BOTH", 2),
        (SQUARES + BOTH + "*ELSET, ELSET=T\n1\n*ELSET, ELSET=T\n2\n", "t", 2),
        (SQUARES + BOTH + "*ELSET, ELSET=G, GENERATE\n1, 2\n", "G", 2),
        (SQUARES.replace("0\n", "0,\n").lower() + BOTH.lower(), "a", 1),
        (SQUARES + "*ELEMENT, TYPE=CPS4\n1, 1, 2,\n5, 4\n2, 2, 3, 6, 5\n", None, 2),
        ("*NODE\n1, 0, 0\n5, 4, 0\n11, 0, 1\n15, 4, 1\n*NGEN\n1, 5, 1\n11, 15, 1\n"
         "*ELEMENT, TYPE=CPE4R\n1, 1, 2, 12, 11\n*ELGEN, ELSET=ROW\n1, 4, 1, 1\n", "ROW", 4),
        ("*NODE, NSET=LOW\n1, 0, 0\n2, 1, 0\n*NODE, NSET=HIGH\n31, 0, 3\n32, 1, 3\n*NFILL\n"
         "LOW, HIGH, 3, 10\n*ELEMENT, TYPE=CPS4\n1, 11, 12, 22, 21\n", None, 1),
        # shifted by 2 along y, then turned by 90 degrees about z
        ("*NODE, NSET=A\n1, 0, 0\n2, 0, -2\n*NCOPY, OLD SET=A, NEW SET=B, CHANGE NUMBER=10, SHIFT\n"
         "0, 2\n0, 0, 0, 0, 0, 1, 90\n*ELEMENT, TYPE=CPS3\n1, 1, 2, 11\n", None, 2),
        (  # a sector of 90 degrees between radii 1 and 2, by straight edges
            "*NODE, SYSTEM=C\n1, 1, 0\n2, 2, 0\n3, 2, 90\n4, 1, 90\n"
            "*ELEMENT, TYPE=CPS4\n1, 1, 2, 3, 4\n",
            None, 1.5,
        ),
        # as CalculiX writes refined meshes
        (SQUARES + BOTH.replace("*ELEMENT,", " *ELEMENT,PARENT=3,"), None, 2),
        # a line with more numbers than nodes, as C3D8I of CalculiX has
        (SQUARES + "*ELEMENT, TYPE=CPE4I\n1, 1, 2, 5, 4, 7, 8,\n2, 2, 3, 6, 5, 9, 10\n", None, 2),
        ("*SYSTEM\n5, 0, 0, 5, 1, 0\n" + SQUARES + BOTH, None, 2),
    ],
)  # fmt: skip
def test_decks_of_abaqus(deck, group, area, tmp_path):
    (tmp_path / "a.inp").write_text(deck)
    assert math.isclose(volume(tmp_path / "a.inp", 2, group), area, rel_tol=1e-14)


def test_instances_of_a_part_are_shifted_and_rotated(tmp_path):
    """Abaqus shifts, then rotates about the axis a-b: (0..1) + 2 turned by 90 degrees about z."""
    (tmp_path / "a.inp").write_text(
        PART + "*Assembly, name=A\n*Instance, name=P-1, part=P\n*End Instance\n"
        "*Instance, name=P-2, part=P\n2, 0, 0\n0, 0, 0, 0, 0, 1, 90\n*End Instance\n"
        "*Elset, elset=SECOND, instance=P-2\n1\n*Surface, type=ELEMENT, name=TOP\nP-1.E, S2\n"
        "*Elset, elset=EVERY\nP-1.E, P-2.E\n*End Assembly\n"
    )
    hub = SmallHub(3, -2, 4, 0.25)
    solid = MeshSolid(hub, tmp_path / "a.inp", hub.materials["steel"], 0.25)
    np.testing.assert_allclose(solid.volume0, 1)
    np.testing.assert_allclose(solid.x0, [[0.5, 0.5, 0.5], [-0.5, 2.5, 0.5]])
    solid = MeshSolid(hub, tmp_path / "a.inp", hub.materials["steel"], 0.25, group="P-1")
    hub.solids.add("s", solid)
    assert words_of_volumes(hub) == "s 1 of 1 in its file (1 of 2 hexahedra)"
    for group, count in (("E", 2), ("SECOND", 1), ("P-2", 1), ("p-1.e", 1), ("EVERY", 2)):
        assert volume(tmp_path / "a.inp", 3, group) == pytest.approx(count, rel=1e-14), group
    top = MeshRegion(hub, tmp_path / "a.inp", "TOP")
    inside = top.inside(np.array([[0.5, 0.5, 1], [0.5, 0.5, 0.9], [-0.5, 2.5, 1]]))
    np.testing.assert_array_equal(inside, [True, False, False])


def test_parts_with_the_same_numbers_stay_apart(tmp_path):
    second = PART.replace("name=P", "name=Q").replace(", 1, ", ", 3, ", 1)
    (tmp_path / "a.inp").write_text(
        PART + second + "*Assembly, name=A\n*Instance, name=P-1, part=P\n*End Instance\n"
        "*Instance, name=Q-1, part=Q\n4, 0, 0\n*End Instance\n*End Assembly\n"
    )
    assert volume(tmp_path / "a.inp", 3, "P-1") == pytest.approx(1)
    mesh = read(tmp_path / "a.inp", 3)
    assert len(mesh.points) == 16


def test_a_set_of_nodes_is_the_faces_that_it_has(tmp_path):
    (tmp_path / "a.inp").write_text(CUBE + "*NSET, NSET=BASE\n1, 2, 3, 4\n")
    region = MeshRegion(SmallHub(3, -1, 2, 0.25), tmp_path / "a.inp", "BASE")
    inside = region.inside(np.array([[0.5, 0.5, 0], [0.5, 0.5, 1], [0.5, 0.5, 0.5]]))
    np.testing.assert_array_equal(inside, [True, False, False])


@pytest.mark.parametrize(
    ("group", "count", "low", "high"),
    [
        ("BASE", 36, (-0.08, -0.08, -0.08), (1.07, 1.07, -0.08)),  # z = 0: the nearest layer
        ("TOP", 36, (-0.08, -0.08, 1.07), (1.07, 1.07, 1.07)),
        ("edge", 2, (-0.08, -0.08, 1.07), (-0.08, 1.07, 1.07)),  # no face has its nodes only
        ("a corner", 1, (1.07, 1.07, 1.07), (1.07, 1.07, 1.07)),
        ("CUBE", 64, (0.15, 0.15, 0.15), (0.84, 0.84, 0.84)),
    ],
)
def test_sets_of_a_mesh_are_groups(group, count, low, high, tmp_path):
    """Nodes of cells of 0.23 from -1 on, by hand: sets of faces and nodes have the nearest ones."""
    (tmp_path / "a.inp").write_text(
        CUBE + "*NSET, NSET=BASE\n1, 2, 3, 4\n*SURFACE, NAME=TOP\nCUBE, S2\n"
        '*NSET, NSET="a corner"\n7\n*NSET, NSET=EDGE\n5, 8\n'
    )
    hub = SmallHub(3, -1, 2, 0.23)
    region = near_set(hub, "g", tmp_path / "a.inp", group)
    axis = np.arange(-1, 2.3, 0.23)
    x = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    chosen = x[region.inside(x)]
    assert len(chosen) == count
    np.testing.assert_allclose([chosen.min(axis=0), chosen.max(axis=0)], [low, high], atol=1e-12)


@pytest.mark.parametrize("d", [1, 2])
def test_nodes_of_a_mesh_in_few_dimensions(d, tmp_path):
    kind, nodes = ("T2D2", "1,1,2") if d == 1 else ("CPS4", "1,1,2,5,4")
    text = SQUARES + f"*ELEMENT, TYPE={kind}\n{nodes}\n*NSET, NSET=V\n2\n"
    (tmp_path / "a.inp").write_text(text)
    hub = SmallHub(d, -1, 2, 0.25)
    region = near_set(hub, "g", tmp_path / "a.inp", "V")
    x = np.stack(np.meshgrid(*[np.arange(-1, 2, 0.25)] * d, indexing="ij"), axis=-1).reshape(-1, d)
    np.testing.assert_array_equal(x[region.inside(x)], [[1, 0][:d]])
    assert (MeshRegion(hub, tmp_path / "a.inp", "V").sheet is None) == (d == 2)


def test_a_group_from_a_mesh_holds_a_body(run_interpreted, tmp_path):
    """A block held at its base keeps its base; each mistake in a group ends in a message."""
    (tmp_path / "a.inp").write_text(CUBE + "*NSET, NSET=BASE\n1, 2, 3, 4\n")
    script = f"""
        method(tlmpm, FLIP, linear, 1)
        dimension(3, 0, 1, 0, 1, 0, 1, 0.5)
        region(body, mesh, {tmp_path}/a.inp)
        group(base, nodes, GROUP)
        material(m, linear, 1000, 1e6, 0.3)
        solid(s, region, body, 2, m, 0.5)
        fix(hold, velocity_nodes, base, 0, 0, 0)
        fix(pull, body_force, all, 0, 0, 1)
        log_modify(custom, step, hold_z)
        run(1)
    """
    log = run_interpreted(script.replace("GROUP", f"mesh, {tmp_path}/a.inp, BASE")).log
    assert log["hold_z"][-1] == pytest.approx(-1000 * 0.25, rel=1e-6)  # half of a cell's height
    for wrong, says in (
        (f"region, {tmp_path}/a.inp, all", "no region follows"),
        ("mesh, body, BASE", "no mesh follows"),
        (f"mesh, {tmp_path}/a.inp, BASS", "no physical group 'BASS'"),
        ("region, body, some", "'of' must be one of all, solid"),
        (f"mesh, {tmp_path}/a.inp, BASE, s", "unknown solid 's'"),
    ):
        assert says in run_interpreted(script.replace("GROUP", wrong), status=1).err


def test_included_decks_and_elements_that_no_solid_has(tmp_path):
    (tmp_path / "cube.inp").write_text(CUBE)
    (tmp_path / "a.inp").write_text(
        "*INCLUDE, INPUT=cube.inp\n*ELEMENT, TYPE=SPRINGA, ELSET=S\n2, 1, 7\n3, 1, 8\n"
        "*ELEMENT, TYPE=S4R\n4, 1, 2, 3, 4\n"
    )
    hub = SmallHub(3, -1, 2, 0.25)
    solid = MeshSolid(hub, tmp_path / "a.inp", hub.materials["steel"], 0.25)
    assert solid.count == 1
    assert hub.warnings == [
        "elements of a.inp that belong to no solid are left out: 2 SPRINGA, 1 S4R"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.inp", SQUARES + "*ELEMENT, TYPE=CPS4\n1, 1, 2, 5, 9\n", "element 1 has the node 9"),
        ("a.inp", SQUARES + "*ELEMENT, TYPE=CPS4\n1, 1, 2, 5\n", "line 8: *ELEMENT has lines"),
        ("a.inp", "*NODE\n1, zero, 0\n", "a.inp, line 1: *NODE has a line that is not numbers"),
        ("a.inp", "*NCOPY, CHANGE NUMBER=1\n", "line 1: *NCOPY without SHIFT"),
        ("a.inp", "*NCOPY, OLD SET=A, SHIFT\n1, 0, 0\n", "line 1: *NCOPY needs CHANGE NUMBER"),
        ("a.inp", "*ELCOPY\n", "line 1: *ELCOPY"),
        ("a.inp", "*INCLUDE, INPUT=none.inp\n", "*INCLUDE of 'none.inp', which cannot be read"),
        ("a.inp", "*INCLUDE, INPUT=a.inp\n", "*INCLUDE of 'a.inp', which cannot be read"),
        ("a.inp", "*Assembly\n*Instance, name=I, part=N\n", "of the part 'N', which is not"),
        ("a.inp", "*HEADING\nnothing\n", "the mesh a.inp is empty"),
        ("a.inp", SQUARES + "*ELEMENT, TYPE=B31\n1, 1, 2\n", "a.inp is empty but for 1 B31"),
        ("a.su2", "NZONE= 2\nIZONE= 1\nNDIME= 2\n", "a file of several zones (NZONE)"),
        ("a.msh", b'(0 "Fluent")\n(2 3)\n(3010 (1 1 1 1 3)(\n' + bytes(24), "within brackets"),
        ("a.vtu", VTU.format(n=3, x="0 " * 9, nodes="0 1 7", type=5), "a node that does not exist"),
        ("a.med", b"\x89HDF\r\n\x1a\n" + bytes(200), "the file is damaged"),
        ("a.mesh", "MFEM NURBS mesh v1.0\n", "it has MFEM's kind 'MFEM NURBS mesh v1.0'"),
        ("a.mesh", "MFEM mesh v1.0\nvertices\n4\nnodes\n", "its edges are curved ('nodes'"),
        ("a.msh", "MESH dimension 2 ElemType Triangle Nnode 3\n", "it is a mesh of GiD"),
        ("a.inp", "$ by LS-PrePost\n*KEYWORD\n*NODE\n", "the mesh a.inp is empty"),
        ("a.k", "*KEYWORD\n*NODE\n1,&x,0,0\n", "a.k, line 2: *NODE has parameters (&)"),
        ("a.k", "*NODE\n       1     one\n", "*NODE has a line that is not numbers: 1     one"),
        ("a.k", "*INCLUDE_TRANSFORM\nb.k\n", "line 1: *INCLUDE_TRANSFORM is not read"),
        ("a.k", "*ELEMENT_SOLID\n1,1\n1,2,3,4\n2,1\n", "ends in the middle of an element"),
        ("a.bdf", "GRID,1,7,0.,0.,0.\n", "line 1: *GRID is in the coordinate system 7, which"),
        ("a.bdf", "GRID,1,,1.\nBEGIN SUPER=1\nGRID,1,,2.\n", "line 3: *GRID is defined twice"),
        ("a.bdf", "\nGRID,1,,x,0.,0.\n", "line 2: *GRID has 'x' instead of a number"),
        ("a.bdf", "GRID,1\nCORD2R,7\nGRID,2,7\n", "line 2: *CORD2R has three points on a line"),
    ],
)  # fmt: skip
def test_decks_that_are_refused_name_the_line(name, text, says, tmp_path):
    (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ScriptError) as caught:
        volume(tmp_path / name, 2)
    assert says in str(caught.value)
    assert caught.value.argument == "file"


DYNA = """\
$ a cube of two wedges, a tetrahedron, a pyramid and a shell
*KEYWORD
*NODE
       1             0.0             0.0             0.0       0       0
       2             1.0             0.0             0.0
       3             1.0             1.0             0.0
       4             0.0             1.0             0.0
       5             0.0             0.0             1.0
       6             1.0             0.0             1.0
       7             1.0             1.0             1.0
       8             0.0             1.0             1.0
*NODE
9,2.,.5,.5
*PART
lower half
         1         1         1
*ELEMENT_SOLID
       1       1       1       2       3       4       5       5       8       8
$ the other half, with an edge of the upper face for two
       2       2       5       6       7       8       2       2       3       3
*ELEMENT_SOLID
       3       3
       2       3       7       9       9       9       9       9
*ELEMENT_SOLID
       4       4       2       3       7       6       9       9       9       9
*ELEMENT_SHELL
       5       5       1       2       3       3
*ELEMENT_MASS
       6       1       1.0
*SET_NODE_LIST_TITLE
base
         1
         1         2         3         4
*SET_SOLID_GENERATE
         2
         1         2
*SET_PART_LIST
         3
         1         4
*SET_SEGMENT
         4
         1         4         8         5
         1         2        77        77
*END
nothing
"""


def test_decks_of_lsdyna(tmp_path):
    """Collapsed hexahedra by hand: half a cube, the pyramid 1/3, the tetrahedron half of that."""
    (tmp_path / "a.k").write_text(DYNA)
    (tmp_path / "b.key").write_text("*KEYWORD\n*INCLUDE\na.k\n*END\n")
    (tmp_path / "c.inp").write_text(DYNA)
    for group, right in (
        (None, 3 / 2), ("1", 1 / 2), ("lower half", 1 / 2), ("2", 1 / 2), ("3", 1 / 6),
        ("4", 1 / 3), ("solid:2", 1), ("part:3", 5 / 6),
    ):  # fmt: skip
        for name in ("a.k", "b.key", "c.inp"):
            assert volume(tmp_path / name, 3, group) == pytest.approx(right, rel=1e-14), group
    hub = SmallHub(3, -1, 3, 0.25)
    solid = MeshSolid(hub, tmp_path / "a.k", hub.materials["steel"], 0.25, group="1")
    np.testing.assert_allclose(solid.x0, [[1 / 3, 1 / 2, 1 / 3]], rtol=1e-14)
    assert "left out: 1 ELEMENT_MASS, 1 ELEMENT_SHELL" in hub.warnings[0]
    for group, inside in (("BASE", [True, False]), ("segment:4", [False, True])):
        region = MeshRegion(hub, tmp_path / "a.k", group)
        assert region.inside(np.array([[0.5, 0.5, 0], [0, 0.5, 0.5]])).tolist() == inside


def test_lsdyna_in_long_columns_and_second_order(tmp_path):
    x = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    x += [np.add(x[a], x[b]) / 2 for a, b in ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))]
    nodes = "".join(f"{k:20}" + "".join(f"{c:20g}" for c in p) + "\n" for k, p in enumerate(x, 1))
    text = f"*KEYWORD LONG=Y\n*NODE\n{nodes}*ELEMENT_SOLID\n{1:20}{7:20}\n"
    (tmp_path / "a.k").write_text(text + "".join(f"{k:20}" for k in range(1, 11)) + "\n")
    (part,) = elements_of(read(tmp_path / "a.k", 3), 3, "7")
    assert measured(part)[1].sum() == pytest.approx(1 / 6, rel=1e-14)
    assert part.nodes is not None and part.bulge < 1e-14


def test_a_deck_that_another_library_reads(tmp_path):
    """A bird striking bricks: the deck and its reader are lsdyna-mesh-reader's, volumes VTK's."""
    library = pytest.importorskip("lsdyna_mesh_reader")
    vtk = pytest.importorskip("vtk")
    path = Path(library.__file__).parent / "examples" / "birdball.k"
    deck = library.Deck(path)
    (nodes,), (solids,) = deck.node_sections, deck.element_solid_sections
    grid, points = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    for x in nodes.coordinates:
        points.InsertNextPoint(*x)
    grid.SetPoints(points)
    numbers, first, kinds = solids.to_vtk()
    place = np.searchsorted(nodes.nid, numbers)
    for a, b, kind in zip(first[:-1], first[1:], kinds, strict=True):
        grid.InsertNextCell(int(kind), b - a, place[a:b].tolist())
    sizes = vtk.vtkCellSizeFilter()
    sizes.SetInputData(grid)
    sizes.Update()
    array = sizes.GetOutput().GetCellData().GetArray("Volume")
    right = sum(array.GetValue(k) for k in range(array.GetNumberOfTuples()))
    assert len(kinds) == 816 and volume(path, 3) == pytest.approx(right, rel=2e-6)


CUBE_IN_NASTRAN = """\
GRID           1       7     0.0     0.0     0.0
GRID           2       7     1.0     0.0     0.0
GRID,3,7,1.,1.,0.
GRID,4,7,0.,1.,0.
GRID*                  5               7             0.0             0.0
*                    1.0
GRID           6       7     1.0     0.0     1.0
GRID           7       7     1.0     1.0   10.-1
GRID           8       7     0.0     1.0     1.0
CHEXA          1      11       1       2       3       4       5       6+
+              7       8
CBAR           2      12       1       2
"""


@pytest.mark.parametrize(
    ("system", "right"),
    [
        ("CORD2R,7,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n", 1),
        ("CORD2R         7       0      5.      5.      5.      5.      6.      5.        \n"
         "              6.      5.      5.\n", 1),
        # degrees in the plane and along: a prism with the base of a triangle, of sin(1) / 2
        ("CORD2C,7,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n", math.sin(math.pi / 180) / 2),
        ("CORD1R,7,21,22,23\nGRID,21,,1.,1.,1.\nGRID,22,,1.,1.,3.\nGRID,23,8,4.,0.,0.\n"
         "CORD2R,8,,0.,1.,1.,1.,1.,1.\n,0.,1.,2.\n", 1),
    ],
)  # fmt: skip
def test_nastran_in_systems_of_coordinates(system, right, tmp_path):
    """Bulk data only, in all kinds of fields; with BEGIN BULK and other sections, too."""
    (tmp_path / "a.bdf").write_text(CUBE_IN_NASTRAN + system)
    (tmp_path / "b.nas").write_text(
        f"SOL 101\nCEND\nBEGIN BULK\n{system}{CUBE_IN_NASTRAN}ENDDATA\nGRID,1,5\n"
    )
    (tmp_path / "c.dat").write_text((tmp_path / "b.nas").read_text())
    for name in ("a.bdf", "b.nas", "c.dat"):
        for group in (None, 11):
            assert volume(tmp_path / name, 3, group) == pytest.approx(right, rel=1e-12)
    assert read(tmp_path / "a.bdf", 3).left_out == {"CBAR": 1}


def test_nastran_in_spheres(tmp_path):
    """Radius, angle from z and longitude: the corners of a cube of 2 around the origin."""
    r, down = math.sqrt(3), math.degrees(math.acos(1 / math.sqrt(3)))
    turns = [225, 315, 45, 135]
    grids = [f"GRID,{k + 1},7,{r},{180 - down},{t}\n" for k, t in enumerate(turns)]
    grids += [f"GRID,{k + 5},7,{r},{down},{t}\n" for k, t in enumerate(turns)]
    text = "CORD2S,7,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nCHEXA,1,1,1,2,3,4,5,6\n,7,8\n"
    (tmp_path / "a.bdf").write_text("GRDSET,,\n" + text + "".join(grids))
    assert volume(tmp_path / "a.bdf", 3) == pytest.approx(8, rel=1e-12)


@pytest.mark.parametrize(("kind", "family"), [("CHEXA", "hexahedron"), ("CPENTA", "wedge")])
def test_second_order_of_nastran_may_lack_nodes(kind, family, tmp_path):
    """Straight edges; one element with all nodes in the middle of its edges, one without any."""
    shape = SHAPES[family]
    corners = np.array(shape.corners, float)
    n = len(corners)
    edges = [of for of in MIDDLES[family] if len(of) == 2]
    upright = [of for of in edges if of[1] - of[0] == n // 2]
    flat = [of for of in edges if of not in upright]
    order = [*flat[: n // 2], *upright, *flat[n // 2 :]]  # as Nastran numbers them
    x = [*corners, *(corners[list(of)].mean(axis=0) for of in order)]
    grids = [f"GRID,{k},,{a:.3f},{b:.3f},{c:.3f}\n" for k, (a, b, c) in enumerate(x, 1)]
    fields = [kind, 1, 1, *range(1, len(x) + 1)]
    lines = [",".join(map(str, fields[:9]))]
    lines += ["," + ",".join(map(str, fields[k : k + 8])) for k in range(9, len(fields), 8)]
    without = [lines[0], "," + ",".join(map(str, fields[9 : 3 + n]))]
    for last in (lines, without):
        (tmp_path / "a.bdf").write_text("".join(grids) + "\n".join(last) + "\n")
        right = {"hexahedron": 8, "wedge": 1}[family]
        assert volume(tmp_path / "a.bdf", 3) == pytest.approx(right, rel=1e-12)


MFEM = """MFEM mesh v1.3
# two squares and a triangle
dimension
2
elements
3
1 3 0 1 4 3
2 3 1 2 5 4
2 2 2 6 5
attribute_sets
1
"right" 1 2
boundary
1
4 1 0 3
bdr_attribute_sets
1
"left" 1 4
vertices
7
2
0 0
1 0
2 0
0 1
1 1
2 1
3 0
"""


def test_meshes_of_mfem(tmp_path):
    (tmp_path / "a.mesh").write_text(MFEM)
    (tmp_path / "b.mesh").write_text(MFEM.replace("v1.3", "v1.0"))
    for group, right in ((None, 2.5), (1, 1), ("2", 1.5), ("right", 1.5)):
        assert volume(tmp_path / "a.mesh", 2, group) == pytest.approx(right, rel=1e-14)
    assert volume(tmp_path / "b.mesh", 2) == 2.5
    assert [lines(tmp_path / "a.mesh", group) for group in ("left", "boundary:4")] == [1, 1]


@pytest.mark.parametrize("ordering", [0, 1])
@pytest.mark.parametrize(
    ("kind", "dent", "right"),
    [
        (3, 4, 1 + 2 / 3 * 0.1),  # the first edge, of a square: below a parabola
        (5, 8 + 12 + 5, 1 + 4 / 9 * 0.1),  # the last face, of a cube: below a bubble
    ],
)
def test_second_order_of_mfem(kind, dent, right, ordering, tmp_path):
    """Corners, edges in the order of MFEM (mfem/fem/geom.cpp), faces, the centre: by hand."""
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    edges = [(0, 1), (1, 2), (2, 3), (3, 0)]
    if kind == 3:
        d, x, middles = 2, np.array(square, float), [*edges, range(4)]
    else:
        d, x = 3, np.array([(*p, z) for z in (0, 1) for p in square], float)
        across = [(0, 4), (1, 5), (2, 6), (3, 7)]
        faces = [(0, 1, 2, 3), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)]
        middles = [*edges, *((a + 4, b + 4) for a, b in edges), *across, *faces, range(8)]
    nodes = np.concatenate([x, [x[list(of)].mean(axis=0) for of in middles]])
    nodes[dent, d - 1] += 0.1 if d == 3 else -0.1
    values = nodes if ordering else nodes.T
    (tmp_path / "a.mesh").write_text(
        f"MFEM mesh v1.0\ndimension\n{d}\nelements\n1\n1 {kind} {' '.join(map(str, range(2**d)))}"
        f"\nboundary\n0\nvertices\n{2**d}\nnodes\nFiniteElementSpace\nFiniteElementCollection: "
        f"H1_{d}D_P2\nVDim: {d}\nOrdering: {ordering}\n\n" + " ".join(map(str, values.ravel()))
    )
    assert volume(tmp_path / "a.mesh", d) == pytest.approx(right, rel=1e-12)


GMSH = """\
$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
2 5 "left"
2 6 "none"
$EndPhysicalNames
$Nodes
6
1 0 0 0
2 1 0 0
3 2 0 0
4 0 1 0
5 1 1 0
6 2 1 0
$EndNodes
$Elements
2
1 3 2 5 1 1 2 5 4
2 3 3 0 1 7 2 3 6 5
$EndElements
"""


def test_files_of_gmsh_as_gmsh_reads_them(tmp_path):
    """Tags of differing number, elements without a group, a group without elements, version 1."""
    pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    (tmp_path / "a.msh").write_text(GMSH)
    assert volume(tmp_path / "a.msh", 2) == 2
    assert volume(tmp_path / "a.msh", 2, "left") == volume(tmp_path / "a.msh", 2, 5) == 1
    with pytest.raises(ScriptError, match="group 'none' of the mesh is empty"):
        volume(tmp_path / "a.msh", 2, "none")
    (tmp_path / "b.msh").write_text(
        "$NOD\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$ENDNOD\n$ELM\n1\n1 2 1 1 3 1 2 3\n$ENDELM\n"
    )
    assert volume(tmp_path / "b.msh", 2) == 0.5
    zero = GMSH.replace("$Nodes\n6\n", "$Nodes\n7\n0 3 3 0\n")
    zero = zero.replace("7 2 3 6 5", "7 2 3 6 0")
    (tmp_path / "c.msh").write_text(zero)
    with pytest.raises(ScriptError, match="has the number 0"):
        volume(tmp_path / "c.msh", 2)
    (tmp_path / "a.msh.opt").write_text(f'SystemCall "touch {tmp_path}/ran";\n')
    assert volume(tmp_path / "a.msh", 2) == 2
    assert not (tmp_path / "ran").exists()


def test_a_closed_socket_ends_no_run_after_gmsh(tmp_path):
    """Gmsh resets SIGPIPE, which then killed a run whose live page was closed."""
    pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    status = Path("/proc/self/status")
    if not status.exists():
        pytest.skip("only Linux tells which signals are ignored")
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    (tmp_path / "a.msh").write_text(GMSH)
    volume(tmp_path / "a.msh", 2)
    ignored = re.search(r"^SigIgn:\s*(\w+)", status.read_text(), re.M)[1]
    assert int(ignored, 16) & 1 << signal.SIGPIPE - 1


@pytest.mark.parametrize("ending", ["step", "brep"])
def test_options_next_to_a_cad_file_run_nothing(ending, tmp_path):
    gmsh = pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    begin(gmsh)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / f"box.{ending}"))
    finally:
        gmsh.finalize()
    (tmp_path / f"box.{ending}.opt").write_text(f'SystemCall "touch {tmp_path}/ran";\n')
    assert volume(tmp_path / f"box.{ending}", 3) == pytest.approx(1, rel=1e-9)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("hull", ["triangle", "quad", "tetra", "hexahedron", "wedge"])
def test_curved_elements_of_every_order_have_their_exact_volume(hull, order, tmp_path):
    """The shear (x + c y^p, y, z) has det = 1 and lies in the functions of order p: volume 1."""
    gmsh = pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    if hull == "wedge" and order > 2:
        pytest.skip("Gmsh cannot read prisms of order 3 that it has written")
    begin(gmsh)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        d = SHAPES[hull].dimension
        base = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        if hull in ("quad", "hexahedron"):
            gmsh.option.setNumber("Mesh.RecombineAll", 1)
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
        if hull in ("hexahedron", "wedge"):
            gmsh.model.occ.extrude([(2, base)], 0, 0, 1, [2], recombine=True)
        elif hull == "tetra":
            gmsh.model.occ.addBox(2, 0, 0, 1, 1, 1)
            gmsh.model.occ.remove([(2, base)], recursive=True)
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(d)
        gmsh.model.mesh.setOrder(order)
        tags, places, _ = gmsh.model.mesh.getNodes()
        for tag, x in zip(tags, places.reshape(-1, 3), strict=True):
            gmsh.model.mesh.setNode(tag, [x[0] + 0.2 * x[1] ** order, x[1], x[2]], [])
        gmsh.write(str(tmp_path / "a.msh"))
    finally:
        gmsh.finalize()
    parts = elements_of(read(tmp_path / "a.msh", d), d)
    volumes = [measured(part) for part in parts]
    assert {part.shape.name for part in parts} == {hull}
    assert sum(v.sum() for _, v, _ in volumes) == pytest.approx(1, rel=1e-12)
    at = sum(v @ x for _, v, x in volumes)
    shift = 2.0 if hull == "tetra" else 0.0
    assert at[0] == pytest.approx(shift + 0.5 + 0.2 / (order + 1), rel=1e-12)
    np.testing.assert_allclose(at[1:], 0.5, rtol=1e-12)


@pytest.mark.parametrize(
    ("kind", "nodes", "right"),
    [
        ("wedge", [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], 1 / 2),
        ("pyramid", [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.3, 0.6, 1]], 1 / 3),
    ],
)
def test_wedges_and_pyramids(kind, nodes, right, tmp_path):
    """A third or the whole of base times height; the centroid of a pyramid at 1/4 of it."""
    path = tmp_path / "a.vtu"
    meshio.write(path, meshio.Mesh(np.array(nodes, float), {kind: [range(len(nodes))]}))
    assert volume(path, 3) == pytest.approx(right, rel=1e-14)
    _, _, centroid = measured(elements_of(read(path, 3), 3)[0])
    assert centroid[0, 2] == pytest.approx(1 / 4 if kind == "pyramid" else 1 / 2, rel=1e-14)
    region = MeshRegion(SmallHub(3, -1, 2, 0.25), path)
    x = np.random.default_rng(3).random((40_000, 3))
    assert region.inside(x).mean() == pytest.approx(right, abs=0.01)  # 4 deviations of the count


@pytest.mark.parametrize(("type_", "d"), [(8, 2), (11, 3)])
def test_pixels_voxels_and_numbers_of_elements(type_, d, tmp_path):
    """Squares and cubes whose nodes go row by row, as ParaView makes of images."""
    n = 2**d
    x = " ".join(f"{i & 1} {i >> 1 & 1} {i >> 2}" for i in range(n))
    text = VTU.format(n=n, x=x, nodes=" ".join(map(str, range(n))), type=type_)
    (tmp_path / "a.vtu").write_text(text)
    for group in (3, "mat:3"):
        assert volume(tmp_path / "a.vtu", d, group) == pytest.approx(1, rel=1e-14)


def test_prisms_with_six_sides(tmp_path):
    """Of edges of length 1 and height 1: 3 sqrt(3) / 2."""
    turn = np.arange(6) * np.pi / 3
    x = " ".join(f"{np.cos(t):.17g} {np.sin(t):.17g} {z}" for z in (0, 1) for t in turn)
    text = VTU.format(n=12, x=x, nodes=" ".join(map(str, range(12))), type=16)
    (tmp_path / "a.vtu").write_text(text)
    assert volume(tmp_path / "a.vtu", 3) == pytest.approx(1.5 * math.sqrt(3), rel=1e-14)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.inp", CUBE + "*Assembly\n*SURFACE, TYPE=NODE, NAME=S\nI.NOPE, 1\n*End Assembly\n"),
        ("a.inp", CUBE + "*ADD, SET=1\n1, 2\n*NUMBERS\n"),
        ("a.inp", CUBE + "*ELEMENT, TYPE=U1\n7, 1, 2\n*ELGEN, ELSET=E\n7, 3\n"),
    ],
)
def test_keywords_that_mean_nothing_here_are_passed_over(name, text, tmp_path):
    (tmp_path / name).write_text(text)
    assert volume(tmp_path / name, 3) == pytest.approx(1, rel=1e-14)


def test_a_line_that_is_cut_ends_in_a_message(tmp_path):
    (tmp_path / "a.bdf").write_text("BEGIN BULK\nGRID,1\n")
    with pytest.raises(ScriptError):
        volume(tmp_path / "a.bdf", 3)


NODES = np.array([[x, y, 0] for y in (0, 1) for x in (0, 1, 2)], float)
PAIR = [("quad", np.array([[0, 1, 4, 3], [1, 2, 5, 4]]))]
SU2 = (
    "NDIME= 2\nNELEM= 2\n9 0 1 4 3 0\n9 1 2 5 4 1\nNPOIN= 6\n"
    + "".join(f"{x:g} {y:g} {k}\n" for k, (x, y, _) in enumerate(NODES))
    + "NMARK= 2\nMARKER_TAG= low\nMARKER_ELEMS= 2\n3 0 1\n3 1 2\n"
    "MARKER_TAG= left\nMARKER_ELEMS= 1\n3 0 3\n"
)


def lines(path, group):
    """Number of lines in a group on the boundary."""
    (part,) = elements_of(read(path, 2), 2, group, lower=True)
    assert part.shape.name == "line"
    return len(part.corners)


@pytest.mark.parametrize(
    ("name", "key", "group"),
    [
        ("a.vtu", "mat_id", "mat_id:4"), ("a.vtk", "mat_id", "4"), ("a.xdmf", "mat_id", "4"),
        ("a.mesh", "medit:ref", "4"), ("a.bdf", "nastran:ref", "4"), ("a.avs", "mat", "4"),
        ("a.med", "cell_tags", "4"),
    ],
)  # fmt: skip
def test_groups_by_number(name, key, group, tmp_path):
    """Of two squares with the numbers 3 and 4, in cell data, references and properties."""
    path = tmp_path / name
    meshio.write(path, meshio.Mesh(NODES, PAIR, cell_data={key: [np.array([3, 4])]}))
    for chosen, area in ((None, 2), (group, 1)):
        assert volume(path, 2, chosen) == pytest.approx(area, rel=1e-14)
    with pytest.raises(ScriptError) as caught:
        volume(path, 2, "5")
    assert "3, 4" in caught.value.expected


def test_markers_of_su2_have_names(tmp_path):
    (tmp_path / "a.su2").write_text(SU2)
    assert volume(tmp_path / "a.su2", 2) == 2
    assert [lines(tmp_path / "a.su2", group) for group in ("low", "left", "1")] == [2, 1, 2]


def test_a_column_of_numbers_is_one_array(tmp_path):
    """As in VTK's old format: SCALARS of one component."""
    data = {"mat": [np.array([[3], [4]], np.int32)]}
    meshio.write(tmp_path / "a.vtk", meshio.Mesh(NODES, PAIR, cell_data=data))
    assert volume(tmp_path / "a.vtk", 2, "mat:3") == 1


def exodus(path, blocks, points, more):
    """Write netCDF-3 (.e), or the same variables as HDF5 (.exo), as netCDF-4 does."""
    words = {name: np.array(of, "S9").view("S1").reshape(len(of), -1) for name, of in more.items()
             if name.endswith("names")}  # fmt: skip
    arrays = {f"coord{axis}": points[:, k] for k, axis in enumerate("xyz")} | more | words
    connect = {f"connect{k + 1}": np.array(of) + 1 for k, (_, of) in enumerate(blocks)}
    kinds = {f"connect{k + 1}": kind for k, (kind, _) in enumerate(blocks)}
    opened = netcdf_file(path, "w") if path.suffix == ".e" else h5py.File(path, "w")
    with opened as file:
        for name, array in (arrays | connect).items():
            array = np.asarray(array)
            if isinstance(file, h5py.File):
                file[name] = array
                file[name].attrs["elem_type"] = kinds.get(name, "")
                continue
            of = array.astype(np.int32) if array.dtype.kind == "i" else array
            sizes = [f"{name}_{k}" for k in range(of.ndim)]
            for size, count in zip(sizes, of.shape, strict=True):
                file.createDimension(size, count)
            variable = file.createVariable(name, of.dtype, sizes)
            variable[:] = of
            variable.elem_type = kinds.get(name, "")


@pytest.mark.parametrize("name", ["a.e", "a.exo"])
def test_blocks_and_sets_of_exodus(name, tmp_path):
    x = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1, 2)], float)
    one = [0, 1, 4, 3, 6, 7, 10, 9]
    blocks = [("HEX8", [one]), ("HEX8", [[k + 1 for k in one]])]
    more = {
        "eb_prop1": [10, 20], "eb_names": ["left", "right"], "ss_prop1": [5],
        "ss_names": ["bottom"], "elem_ss1": [1, 2], "side_ss1": [5, 5], "ns_prop1": [7],
        "ns_names": ["base"], "node_ns1": [1, 2, 4, 5],
    }  # fmt: skip
    exodus(tmp_path / name, blocks, x, more)
    for group, right in ((None, 2), ("left", 1), ("20", 1)):
        assert volume(tmp_path / name, 3, group) == pytest.approx(right, rel=1e-14)
    hub = SmallHub(3, -1, 3, 0.25)
    for group, right in (("bottom", 2), ("5", 2), ("base", 1), ("7", 1)):
        region = MeshRegion(hub, tmp_path / name, group)
        inside = region.inside(np.array([[0.5, 0.5, 0], [1.5, 0.5, 0], [0.5, 0.5, 1]]))
        assert inside.tolist() == [True, right == 2, False]


@pytest.mark.parametrize(
    ("kind", "family", "order"),
    [
        ("HEX20", "hexahedron20", [*range(12), *range(16, 20), *range(12, 16)]),
        ("WEDGE15", "wedge15", [*range(9), *range(12, 15), *range(9, 12)]),
    ],
)
def test_edges_of_exodus_are_in_their_order(kind, family, order, tmp_path):
    """Straight edges have their nodes in the middle: others would change the volume."""
    shape = SHAPES[family.rstrip("0123456789")]
    corners = np.array(shape.corners, float)
    middles = [corners[list(of)].mean(axis=0) for of in MIDDLES[shape.name] if len(of) == 2]
    x = np.concatenate([corners, middles])
    straight = np.arange(len(corners))
    exodus(tmp_path / "a.e", [(kind, [order])], x, {})
    solid, whole, _ = measured(elements_of(read(tmp_path / "a.e", 3), 3)[0])
    assert whole[0] == pytest.approx({"hexahedron": 8, "wedge": 1}[shape.name], rel=1e-12)
    assert solid.bulge < 1e-12 and len(straight) == solid.corners.shape[1]


def test_sides_of_shells_and_lines_in_exodus(tmp_path):
    """Sides 1 and 2 of a shell are its faces, those from 3 on its edges."""
    x = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    more = {"ss_prop1": [5, 6], "elem_ss1": [1], "side_ss1": [4], "elem_ss2": [1], "side_ss2": [9]}
    exodus(tmp_path / "a.e", [("SHELL4", [[0, 1, 2, 3]])], x, more)
    assert volume(tmp_path / "a.e", 2) == 1
    assert lines(tmp_path / "a.e", "5") == 1
    more = {"ss_prop1": [5], "elem_ss1": [1], "side_ss1": [2]}
    exodus(tmp_path / "b.e", [("EDGE2", [[0, 1]])], x[:2], more)
    assert volume(tmp_path / "b.e", 1) == 1


def test_the_second_node_of_a_truss_is_in_the_middle(tmp_path):
    (tmp_path / "a.inp").write_text("*NODE\n1, 0\n2, 1\n3, 2\n*ELEMENT, TYPE=T3D3\n1, 1, 2, 3\n")
    assert volume(tmp_path / "a.inp", 1) == pytest.approx(2, rel=1e-14)


def test_few_curved_elements_may_be_folded(tmp_path):
    """Nodes in the middle of edges that lie too near to a corner: areas stay 1."""
    x = [(i, j) for j in (0, 1) for i in range(201)]
    rows = [(i + 1, i + 2, i + 203, i + 202) for i in range(200)]
    middles = [np.mean([x[n - 1] for n in pair], axis=0)
               for row in rows for pair in zip(row, [*row[1:], row[0]], strict=True)]  # fmt: skip
    nodes = [*x, *middles]
    for dent, ok in ((range(1), True), (range(40), False)):
        moved = [np.array(p, float) for p in nodes]
        for k in dent:
            moved[402 + 4 * k] = np.array([k + 0.9, 0.0])
        text = "*NODE\n" + "".join(f"{n},{p[0]},{p[1]}\n" for n, p in enumerate(moved, 1))
        text += "*ELEMENT, TYPE=CPS8\n" + "".join(
            ",".join(map(str, [k + 1, *row, *range(403 + 4 * k, 407 + 4 * k)])) + "\n"
            for k, row in enumerate(rows)
        )
        (tmp_path / f"{ok}.inp").write_text(text)
        if ok:
            assert volume(tmp_path / f"{ok}.inp", 2) == pytest.approx(200, rel=1e-12)
        else:
            with pytest.raises(ScriptError, match="is twisted"):
                volume(tmp_path / f"{ok}.inp", 2)


def test_a_file_that_grows_while_it_is_read(tmp_path, monkeypatch):
    path = tmp_path / "a.inp"
    path.write_text(CUBE)

    def read_and_write(path):
        mesh = read_deck(path)
        path.write_text(CUBE + "*ELEMENT, TYPE=C3D8\n")
        return mesh

    monkeypatch.setattr(reading, "read_deck", read_and_write)
    with pytest.raises(ScriptError, match="changed while it was read"):
        volume(path, 3)


def test_many_sets_and_names_of_all_kinds(tmp_path):
    sets = "".join(f'*ELSET, ELSET="S\u00e4t {k}"\n1\n' for k in range(5000))
    (tmp_path / "a.inp").write_text(CUBE + sets, "utf-8")
    assert volume(tmp_path / "a.inp", 3, "s\u00e4t 4999") == pytest.approx(1)
    with pytest.raises(ScriptError) as caught:
        volume(tmp_path / "a.inp", 3, "none")
    assert caught.value.expected.startswith("one of 5001 groups: CUBE, S\u00c4T 0")


def test_gmsh_entities_are_groups_where_there_are_no_others(tmp_path):
    """Two squares of two entities; none of them in a physical group."""
    text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n6\n"
    text += "".join(f"{k + 1} {x:g} {y:g} 0\n" for k, (x, y, _) in enumerate(NODES))
    text += "$EndNodes\n$Elements\n2\n1 3 2 0 8 1 2 5 4\n2 3 2 0 9 2 3 6 5\n$EndElements\n"
    (tmp_path / "a.msh").write_text(text)
    assert [volume(tmp_path / "a.msh", 2, group) for group in (None, "8", "9")] == [2, 1, 1]


SHEET = """*NODE
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,2
8,0,1,2
*ELEMENT, TYPE=C3D8, ELSET=BODY
1,1,2,3,4,5,6,7,8
*SURFACE, NAME=ROOF
1,S2
"""


def test_named_faces_are_loaded_with_their_whole_area(run_interpreted, tmp_path):
    """A slanted roof of sqrt(2), two triangles: sums of area, and of area times y = 1/2."""
    (tmp_path / "deck.inp").write_text(SHEET, "utf-8")
    script = f"""
        method(tlmpm, FLIP, linear, 1, thermo-mechanical)
        dimension(3, -1, 2, -1, 2, -1, 3, 1)
        region(body, block, 0, 1, 0, 1, 0, 1)
        region(roof, mesh, {tmp_path}/deck.inp, ROOF)
        material(m, linear, 1000, 1e6, 0.3, 500, 1)
        solid(s, region, body, 2, m, 1, 300)
        fix(q, edge_traction, all, roof, SIDE, 2, NULL, -3*y)
        fix(sun, edge_heat_flux, all, roof, 5)
        log_modify(custom, step, q_x, q_z, sun_s, sun_area)
        run(1)
    """
    log = run_interpreted(script.replace("SIDE", "all")).log
    area = np.sqrt(2)
    assert log["q_x"][-1] == pytest.approx(2 * area, rel=1e-9)
    assert log["q_z"][-1] == pytest.approx(-1.5 * area, rel=1e-9)
    assert (log["sun_area"][-1], log["sun_s"][-1]) == pytest.approx((area, 5 * area), rel=1e-9)
    said = run_interpreted(script.replace("SIDE", "zhi"), status=1).err
    assert "region 'roof' is a set of faces" in said and "expected: all" in said
    wrong = script.replace(
        "edge_traction, all, roof, SIDE, 2, NULL, -3*y", "edge_pressure, all, roof, 5"
    )
    assert "edge_traction, ..., all, tx, ty" in run_interpreted(wrong, status=1).err
    wrong = script.replace("all, roof, SIDE", "all, body, all")
    assert "region 'body' is not a set of faces" in run_interpreted(wrong, status=1).err


def test_a_large_face_loads_all_points_behind_it(run_interpreted, tmp_path):
    """One element, 64 points: each of the 16 at the roof takes a sixteenth, within its parts."""
    (tmp_path / "deck.inp").write_text(SHEET.replace("1,1,2", "1,1,1").replace("0,1,2", "0,1,1"))
    script = f"""
        method(tlmpm, FLIP, linear, 1)
        dimension(3, -1, 2, -1, 2, -1, 3, 0.5)
        region(body, block, 0, 1, 0, 1, 0, 1)
        region(roof, mesh, {tmp_path}/deck.inp, ROOF)
        material(m, linear, 1000, 1e6, 0.3)
        solid(s, region, body, 2, m, 0.5)
        fix(q, edge_traction, all, roof, all, 0, 0, 16)
        log_modify(custom, step, q_z)
        dump(d, all, particle, 1, d.*.txt, z, vz)
        set_dt(1e-3)
        run(1)
    """
    done = run_interpreted(script)
    assert done.log["q_z"][-1] == pytest.approx(16, rel=1e-9)
    *_, z, vz = np.loadtxt(done.folder / "d.1.txt", skiprows=11).T
    top = vz[z > 0.8]
    assert len(top) == 16 and top.min() > 0.5 * top.mean() and top.max() < 2 * top.mean()


def test_elements_larger_than_cells_are_reported(run_interpreted, tmp_path):
    (tmp_path / "deck.inp").write_text(SHEET, "utf-8")
    script = f"""
        method(ulmpm, FLIP, linear, 1)
        dimension(3, -1, 2, -1, 2, -1, 3, H)
        material(m, linear, 1000, 1e6, 0.3)
        solid(s, mesh, {tmp_path}/deck.inp, m, H)
        run(0)
    """
    said = run_interpreted(script.replace("H", "0.5")).err
    assert "points far apart: points of solid 's' are 2 cells apart" in said
    assert "far apart" not in run_interpreted(script.replace("H", "1")).err
