"""Files that are damaged, are no files, or are written in another code: said, and never a hang."""

import os
import random
import sys

import h5py
import meshio
import numpy as np
import pytest
from hubs import SmallHub, arguments
from scenes import block

from karamelo_py.app.live.folder import FolderPage
from karamelo_py.app.plot import read_log
from karamelo_py.output.hdf5_file import reading
from karamelo_py.output.snapshots import read
from karamelo_py.points.kinematics import Axisymmetric
from karamelo_py.scene.tables import FileColumns
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.dumps.hdf5 import _opened_to_append
from karamelo_py.styles.solids import PointsSolid

RUN = block(2, "fix(v, initial_velocity_particles, all, 0.1, 0)", "set_dt(0.001)", "run(2)")
DUMPS = RUN.replace(
    "run(2)",
    "dump(h, all, hdf5, 1, d.h5, x, y, seq)\ndump(v, all, vtk, 1, v.*.vtu, x, y, seq)\n"
    "dump(t, all, particle, 1, t.*.gz, x, y, seq)\nrun(2)",
)
needs_pipes = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pipes in folders")


@pytest.fixture
def dumped(run_interpreted):
    return run_interpreted(DUMPS).folder


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("name", ["d.h5", "v.2.vtu", "v.pvd", "t.2.gz"])
def test_a_dump_that_is_cut_or_damaged(dumped, name, closed):
    """HDF5 reads a file that no program has closed again and again, if it makes no sense."""
    path = dumped / name
    if not closed and name == "d.h5":  # as a killed program leaves it
        file = _opened_to_append(path)
        content = path.read_bytes()
        file.close()
        assert content[11] & 4
    else:
        content = path.read_bytes()
    places, random_ = range(1, len(content) - 1, len(content) // 9 + 1), random.Random(1)
    for place in places:
        path.write_bytes(content[:place])
        with pytest.raises(ScriptError, match=r"is not a dump of points, or it is damaged|read"):
            list(read(path))
    for _ in range(40):  # a damaged number cannot be seen, all else is said
        damaged = bytearray(content)
        for _ in range(20):
            damaged[random_.randrange(len(content))] = random_.randrange(256)
        path.write_bytes(damaged)
        try:
            list(read(path))
        except ScriptError as error:
            assert error.expected


def test_a_file_that_is_being_written(dumped):
    """What a plain reader of HDF5 refuses, and its reader of running writers knows, is the same."""
    path = dumped / "d.h5"
    with _opened_to_append(path) as root:
        root.flush()
        left = path.with_name("left.h5")  # as a killed program leaves it
        left.write_bytes(path.read_bytes())
    with pytest.raises(OSError, match="already open for write"):
        h5py.File(left, "r", locking=False)
    with h5py.File(left, "r", libver="latest", swmr=True, locking=False) as other:
        expected = other["seq"][()]
    with reading(left) as found:
        assert np.array_equal(found["seq"][()], expected)
        assert len(expected) == 3


@pytest.mark.parametrize("code", ["utf-8", "utf-8-sig", "utf-16", "utf-32", "latin-1"])
def test_a_script_in_any_code(run_interpreted, tmp_path, code):
    """Also where it is read again for advice, and where a table is meant."""
    folder = tmp_path / "run"
    folder.mkdir()
    table = 'solid(g, points, "größe.csv", rubber, 0.1)\n'
    (folder / "größe.csv").write_bytes("# Größe\nx, y, volume\n0.05, 0.05, 0.001\n".encode(code))
    text = "# Größe\n" + RUN.replace("fix(v,", table + "fix(v,")
    (folder / "in.code").write_bytes(text.encode(code))
    assert run_interpreted(folder / "in.code").log.Step.tolist() == [0, 1, 2]


@needs_pipes
def test_a_pipe_or_a_device_in_place_of_a_file(run_interpreted, tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    os.mkfifo(folder / "pipe")
    said = "is a pipe or a device, not a file"
    for name in ("pipe", "/dev/zero"):
        err = run_interpreted(f"include({name})\n", status=1).err
        assert f"include: {name if name[0] == '/' else folder / name} cannot be read" in err or (
            f"{name} cannot be read" in err
        )
        assert said in err and "in.script:1:9" in err
    mesh = "region(r, stl, pipe)\n"
    assert said in run_interpreted(RUN.replace("run(2)", mesh + "run(2)"), status=1).err
    assert said in run_interpreted(folder / "pipe", status=1).err
    with pytest.raises(ScriptError, match="is a pipe or a device"):
        list(read(folder / "pipe"))


@needs_pipes
def test_a_page_of_a_folder_with_pipes(dumped):
    for name in ("pipe", "more.h5", "more.gz"):
        os.mkfifo(dumped / name)
    page = FolderPage(dumped)
    page.server.close()
    assert len(page._states) == 3


def test_a_last_row_that_is_cut(tmp_path):
    """Of 2.4e+10 there may be 2.4: a row counts from its line end on."""
    (tmp_path / "log.mpm").write_text("Step       E\n0          2.456933215e+10\n50         2.4")
    assert read_log(tmp_path)["E"].tolist() == [2.456933215e10]
    (tmp_path / "log.csv").write_text("Step,E\n0,1.5\n50,2.5\n100,3")
    assert read_log(tmp_path, "log.csv")["E"].tolist() == [1.5, 2.5]


@pytest.mark.parametrize("value", ["-1e6", "-.5", "-5", "-(2+3)", "-c/2"])
def test_a_value_below_zero(run_interpreted, value):
    """What begins with a sign is no option, unless there is such an option."""
    out = run_interpreted("c = 4\nY0 = 1\nprint(Y0)\nquit\n", "-var", "Y0", value).out
    assert out.splitlines()[0].startswith("Y0 = -")
    err = run_interpreted("Y0 = 1\nquit\n", "-var", "Y0", "--quiet", status=1).err
    assert "-var: expected 2 arguments" in err


LAMMPS = """ITEM: TIMESTEP
7
ITEM: NUMBER OF ATOMS
2
ITEM: BOX BOUNDS {tilt}
0 0.4
0.1 0.3
-1 1
ITEM: ATOMS {columns}
{rows}
"""


@pytest.mark.parametrize(
    ("columns", "rows"),
    [
        ("id type x y", "1 1 0.1 0.2\n2 1 0.3 0.15"),
        ("element xs ys zs", "Cu 0.25 0.5 0.5\nCu 0.75 0.25 0.5"),
        ("id xu yu x y", "1 9 9 0.1 0.2\n2 9 9 0.3 0.15"),
        ("id xu ysu zs", "1 0.1 0.5 0.5\n2 0.3 0.25 0.5"),
    ],
)
def test_positions_in_dumps_of_lammps(tmp_path, columns, rows):
    """Plain, scaled by the box, or unwrapped."""
    path = tmp_path / "d.lammpstrj"
    path.write_text(LAMMPS.format(tilt="pp pp pp", columns=columns, rows=rows), "utf-8")
    (found,) = read(path)
    assert found.step == 7 and found.columns["id"].tolist() == [1, 2]
    np.testing.assert_allclose([found.columns[a] for a in "xyz"], [[0.1, 0.3], [0.2, 0.15], [0, 0]])


@pytest.mark.parametrize(
    ("tilt", "columns", "says"),
    [
        ("xy xz yz pp pp pp", "xs ys", "has no column x in a tilted box"),
        ("pp pp pp", "vx vy", "has no column x"),
    ],
)
def test_dumps_of_lammps_without_positions(tmp_path, tilt, columns, says):
    path = tmp_path / "d.lammpstrj"
    path.write_text(LAMMPS.format(tilt=tilt, columns=columns, rows="1 2\n3 4"), "utf-8")
    with pytest.raises(ScriptError, match=says):
        list(read(path))


def test_a_dump_begins_a_solid(tmp_path):
    """Its last snapshot: positions, velocities and volumes, these without the radius."""
    hub = SmallHub(dimension=2)
    hub.domain.kin = Axisymmetric()
    path = tmp_path / "d.lammpstrj"
    text = LAMMPS.format(tilt="pp pp pp", columns="id type x y vx s11 ep volume", rows="{}")
    rows = "1 1 0.1 0.2 3 0 1 0.5\n2 1 0.4 0.15 4 0 2 0.6"
    path.write_text(text.format("1 1 9 9 9 9 9 9\n" * 2)[:-1] + text.format(rows), "utf-8")
    (argument,) = arguments(path)
    columns = FileColumns.from_script(hub, argument).columns
    assert sorted(columns) == ["volume", "vx", "x", "y"]
    np.testing.assert_allclose(columns["volume"], [5, 1.5])
    assert columns["vx"].tolist() == [3, 4]


def made(hub, path, **options):
    (argument,) = arguments(f'"{path}"')
    table, steel = FileColumns.from_script(hub, argument), hub.materials["steel"]
    return PointsSolid(hub, table, steel, hub.domain.h, **options)


EXTENDED = 'Lattice="1 0 0 0 1 0 0 0 1" Properties=species:S:1:pos:R:3:forces:R:3:velo:R:3 Time=1'


@pytest.mark.parametrize(
    ("comment", "rest", "vx"), [("two atoms", "", None), (EXTENDED, " 0 0 0 5 6 0", 5)]
)
def test_the_last_frame_of_an_xyz_file(tmp_path, comment, rest, vx):
    frame = f"2\n{comment}\nCu {{}} 0.1 0{rest}\nC 0.3 0.2 0{rest}\n"
    (tmp_path / "a.xyz").write_text(frame.format(9) + frame.format(0.1) + "\n")
    solid = made(SmallHub(), tmp_path / "a.xyz", volume=0.02)
    np.testing.assert_allclose(solid.x0, [[0.1, 0.1], [0.3, 0.2]])
    np.testing.assert_allclose(solid.mass, 1000 * 0.02)
    assert solid.initial.get("vx", [None])[0] == vx


@pytest.mark.parametrize(
    ("text", "says"),
    [("2\n\nCu 0 0 0\n", "line 1"), ("1\n\nCu 0 a 0\n", "line 3"), ("x\n", "line 1")],
)
def test_an_xyz_file_that_is_wrong(tmp_path, text, says):
    (tmp_path / "a.xyz").write_text(text)
    with pytest.raises(ScriptError, match=says):
        made(SmallHub(), tmp_path / "a.xyz", volume=1)


def test_points_of_vtk_have_volumes_masses_or_neither(tmp_path):
    """Velocities in an array; mass over density; one volume for all points."""
    x = np.array([[0.1, 0.1, 0], [0.3, 0.1, 0]])
    cells = {"vertex": np.arange(2)[:, None]}
    data = {"velocity": 7 + x}
    for name, more in (("v", {"volume": [0.1, 0.2]}), ("m", {"mass": [100.0, 200.0]}), ("n", {})):
        arrays = data | {key: np.array(of) for key, of in more.items()}
        meshio.write(tmp_path / f"{name}.vtu", meshio.Mesh(x, cells, point_data=arrays))
    for name in "vm":
        solid = made(SmallHub(), tmp_path / f"{name}.vtu")
        np.testing.assert_allclose(solid.mass, [100, 200])
        np.testing.assert_allclose(solid.initial["vx"], [7.1, 7.3])
    assert made(SmallHub(), tmp_path / "n.vtu", volume=0.3).mass.tolist() == [300, 300]
    with pytest.raises(ScriptError) as caught:
        made(SmallHub(), tmp_path / "n.vtu")
    assert caught.value.hint == "volume=V, for all points, or a column mass"
    with pytest.raises(ScriptError, match=r"has a column volume$"):
        made(SmallHub(), tmp_path / "v.vtu", volume=0.3)
