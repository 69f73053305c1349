"""Dumps for other programs: what h5py, xarray, meshio and VTK read back."""

import re
import subprocess
import sys
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
from fakes import FakeHub
from PIL import Image

from karamelo_py.output.vtu import Vtu, arrays_of
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.dumps.hdf5 import GridHdf5, Hdf5, Hdf5Dump
from karamelo_py.styles.dumps.vtk import GridVtk, Vtk


@pytest.fixture(params=[1, 2, 3])
def hub(request, tmp_path):
    return FakeHub(tmp_path, dimension=request.param)


@pytest.fixture
def plane(tmp_path):
    return FakeHub(tmp_path, dimension=2)


def lose(hub, count):
    """The last points are deleted, and there is one more in front of them."""
    for name, values in hub.fields.points.items():
        hub.fields.points[name] = values[:-count]


def test_hdf5_is_arrays_over_time_and_id(hub):
    hub.dumps["d"] = Hdf5(hub, 5, "p.h5", "vx", "seq")
    hub.run(10)
    lose(hub, 3)
    hub.run(1)
    with h5py.File(hub.folder / "p.h5") as file:
        assert file["time"][:] == pytest.approx([0, 0.5, 1.0, 1.1])
        assert file["step"][:].tolist() == [0, 5, 10, 11]
        assert file["id"][:].tolist() == list(range(1, 41))
        assert file["type"][:].tolist() == [1] * 20 + [2] * 20
        for name in ("x", "y", "z", "vx", "seq"):
            assert file[name].shape == (4, 40)
            values = hub.fields.particle(name)
            np.testing.assert_array_equal(file[name][:, :37], np.tile(values, (4, 1)))
            assert np.isnan(file[name][3, 37:]).all() and not np.isnan(file[name][:3]).any()


def test_xarray_opens_hdf5(plane):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    plane.dumps["d"] = Hdf5(plane, 5, "p.h5", "seq")
    plane.run(10)
    with xarray.open_dataset(plane.folder / "p.h5", engine="h5netcdf") as data:
        assert data.seq.dims == ("time", "id")
        seventh = data.seq.sel(id=7).sel(time=0.52, method="nearest")
        assert float(seventh) == plane.fields.points["seq"][6]
        assert int(data.type.sel(id=40)) == 2


def test_vtk_opens_hdf5(hub):
    """Every state: positions, columns and vectors; a deleted point is nowhere."""
    module = pytest.importorskip("vtkmodules.vtkIOHDF", exc_type=ImportError)
    from vtkmodules.util.numpy_support import vtk_to_numpy

    velocities = ["vx", "vy", "vz"][: hub.domain.dimension]
    hub.dumps["d"] = Hdf5(hub, 5, "p.h5", *velocities, "seq")
    hub.run(10)
    expected = {name: hub.fields.particle(name) for name in (*"xyz", *velocities, "seq", "type")}
    lose(hub, 3)
    hub.run(1)
    reader = module.vtkHDFReader()
    reader.SetFileName(str(hub.folder / "p.vtkhdf"))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(reader.GetExecutive().TIME_STEPS())
    assert times == pytest.approx([0, 0.5, 1, 1.1])
    for time in times:
        reader.UpdateTimeStep(time)
        found, here = reader.GetOutput(), slice(37 if time > 1.05 else 40)
        assert found.GetNumberOfVerts() == 40
        x = vtk_to_numpy(found.GetPoints().GetData())
        np.testing.assert_array_equal(x[here].T, [expected[a][here] for a in "xyz"])
        assert np.isnan(x[here.stop :]).all()
        assert np.isfinite(found.GetBounds()).all()
        for name in ("seq", "type"):
            array = vtk_to_numpy(found.GetPointData().GetArray(name))
            np.testing.assert_array_equal(array[here], expected[name][here])
        velocity = vtk_to_numpy(found.GetPointData().GetArray("velocity"))[here]
        for k in range(3):
            wanted = expected[velocities[k]][here] if k < len(velocities) else 0
            np.testing.assert_array_equal(velocity[:, k], wanted)


def test_hdf5_of_nodes(plane):
    GridHdf5(plane, 1, "g.*.h5", "mass", occupied=True).write()
    with h5py.File(plane.folder / "g.0.h5") as file:
        occupied = plane.fields.nodes["mass"] > 0
        assert file["id"][:].tolist() == list(range(25))
        np.testing.assert_array_equal(file["mass"][0], np.where(occupied, 1, np.nan))


def test_a_new_run_of_the_program_replaces_the_file(tmp_path):
    for _ in range(2):
        hub = FakeHub(tmp_path)
        hub.dumps["d"] = Hdf5(hub, 4, "p.h5")
        hub.run(4)
    with h5py.File(tmp_path / "p.h5") as file:
        assert file["step"][:].tolist() == [0, 4]


def test_ctrl_c_in_a_snapshot_takes_it_back(plane, monkeypatch):
    dump = Hdf5(plane, 1, "p.h5", "seq")
    dump.write()
    plane.update.step = 1
    append = Hdf5Dump._append

    def interrupted(self, *arguments):
        append(self, *arguments)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Hdf5Dump, "_append", interrupted)
        dump.write()
    with h5py.File(plane.folder / "p.h5") as file:
        assert file["seq"].shape == (1, 40)
    dump.write()
    with h5py.File(plane.folder / "p.h5") as file:
        assert file["step"][:].tolist() == [0, 1] and not np.isnan(file["seq"][:]).any()


KILLED = """
import os, sys
sys.path.insert(0, sys.argv[1])
import h5py
from fakes import FakeHub
from karamelo_py.styles.dumps.hdf5 import Hdf5
write = h5py.Dataset.__setitem__
for left in map(int, sys.argv[2:]):
    os.mkdir(str(left))
    if os.fork() > 0:
        assert os.WEXITSTATUS(os.wait()[1]) == 9
        continue
    dump = Hdf5(FakeHub(str(left)), 1, "p.h5", "seq")
    dump.write()
    dump.write()
    def until(self, *arguments):
        global left
        left -= 1
        if left == 0:
            self.file.flush()
            os._exit(9)
        write(self, *arguments)
    h5py.Dataset.__setitem__ = until
    dump.write()
    os._exit(0)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not fork")
def test_a_killed_program_leaves_a_file_that_can_be_read(tmp_path):
    """Killed at a write within the third snapshot: the two before are there."""
    writes = ["2", "4", "6"]
    command = [sys.executable, "-c", KILLED, str(Path(__file__).parent), *writes]
    assert subprocess.run(command, cwd=tmp_path).returncode == 0
    expected = FakeHub(tmp_path).fields.points["seq"]
    for number in writes:
        with h5py.File(tmp_path / number / "p.h5", swmr=True) as file:
            np.testing.assert_array_equal(file["seq"][:2], [expected, expected])


def test_vtk_of_points(hub):
    hub.dumps["d"] = Vtk(hub, 5, "points.*.vtu", "vx", "seq")
    hub.run(10)
    index = (hub.folder / "points.pvd").read_text()
    times = [float(time) for time in re.findall('timestep="(.*?)"', index)]
    assert times == pytest.approx([0, 0.5, 1])
    for step in (0, 5, 10):
        assert f'file="points.{step}.vtu"/>' in index
        mesh = meshio.read(hub.folder / f"points.{step}.vtu")
        xyz = np.column_stack([hub.fields.points[name] for name in "xyz"])
        np.testing.assert_array_equal(mesh.points, xyz)
        assert [block.type for block in mesh.cells] == ["vertex"]
        for name in ("id", "type", "vx", "seq"):
            np.testing.assert_array_equal(mesh.point_data[name], hub.fields.points[name])


@pytest.mark.parametrize(
    ("dimension", "names", "arrays"),
    [
        (3, "vx vy vz", ["velocity"]),
        (3, "vx vy", []),
        (2, "vx vy s11 s22 s12", ["velocity"]),
        (2, "s11 s22 s33 s12 fx", ["stress"]),
        (1, "vx s11 s22 s33", ["velocity", "stress"]),
        (1, "vy", []),
    ],
)
def test_components_that_make_arrays(dimension, names, arrays):
    assert list(arrays_of(names.split(), dimension)) == arrays


def test_vectors_and_tensors_in_vtk(plane):
    """Next to their columns; a tensor in the order xx, yy, zz, xy, yz, xz."""
    names = ("vx", "vy", "s11", "s22", "s33", "s12")
    points = plane.fields.points
    points |= {name: k + points["x"] for k, name in enumerate(names)}
    Vtk(plane, 1, "p.*.vtu", *names).write()
    data = meshio.read(plane.folder / "p.0.vtu").point_data
    zero = 0 * points["x"]
    velocity = [*(points[name] for name in names[:2]), zero]
    np.testing.assert_array_equal(data["velocity"].T, velocity)
    np.testing.assert_array_equal(data["stress"].T, [*(points[n] for n in names[2:]), zero, zero])


@pytest.mark.parametrize("occupied", [False, True])
def test_vtk_of_the_grid(hub, occupied):
    """The cells fill the domain, or the half of it whose nodes have mass (x > 0)."""
    GridVtk(hub, 1, "g_*.vtu", "mass", occupied=occupied).write()
    assert (hub.folder / "g.pvd").exists()
    mesh = meshio.read(hub.folder / "g_0.vtu")
    d = hub.domain.dimension
    (block,) = mesh.cells
    assert block.type == {1: "line", 2: "quad", 3: "hexahedron"}[d]
    assert len(block.data) == 4**d // (4 if occupied else 1)
    x = mesh.points[block.data][..., :d]
    np.testing.assert_allclose(np.ptp(x, axis=1), 0.25)
    assert (mesh.point_data["mass"] == (mesh.points[:, 0] > 0)).all()
    # Neighbours in the list of corners are one edge apart, so that no cell is twisted.
    edges = np.linalg.norm(np.diff(x[:, : 2 ** min(d, 2)], axis=1), axis=2)
    np.testing.assert_allclose(edges, 0.25)


def test_vtk_opens_both(plane):
    xml = pytest.importorskip("vtkmodules.vtkIOXML", exc_type=ImportError)
    Vtk(plane, 1, "p.*.vtu", "seq").write()
    GridVtk(plane, 1, "g.*.vtu").write()
    for name, count in (("p.0.vtu", 40), ("g.0.vtu", 16)):
        reader = xml.vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(plane.folder / name))
        reader.Update()
        assert reader.GetErrorCode() == 0
        assert reader.GetOutput().GetNumberOfCells() == count


@pytest.mark.parametrize("count", [8192, 8193])
def test_vtk_in_pieces(tmp_path, count):
    """8192 doubles are two whole blocks; VTK and meshio read what was written."""
    x = np.random.default_rng(1).uniform(size=(count, 3))
    for pieces in (1, 3):
        vtu = Vtu(["id"], tmp_path)
        for ids in np.array_split(np.arange(count), pieces):
            vtu.add_points(x[ids], [ids])
            vtu.add_cells("vertex", ids[:, None])
        with (tmp_path / f"{pieces}.vtu").open("wb") as file:
            vtu.write(file)
    assert (tmp_path / "1.vtu").read_bytes() == (tmp_path / "3.vtu").read_bytes()
    mesh = meshio.read(tmp_path / "3.vtu")
    np.testing.assert_array_equal(mesh.points, x)
    np.testing.assert_array_equal(mesh.cells[0].data[:, 0], mesh.point_data["id"])
    xml = pytest.importorskip("vtkmodules.vtkIOXML", exc_type=ImportError)
    reader = xml.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "3.vtu"))
    reader.Update()
    found = reader.GetOutput()
    assert found.GetPoint(count - 1) == tuple(x[-1]) and found.GetNumberOfCells() == count
    assert found.GetPointData().GetArray("id").GetTuple1(count - 1) == count - 1


@pytest.mark.parametrize("name", ["p.vtu", "p.*.vtk", "p"])
def test_a_series_needs_a_name_for_a_series(plane, name):
    with pytest.raises(ScriptError) as caught:
        Vtk(plane, 1, name)
    assert caught.value.hint == "p.*.vtu"


@pytest.mark.parametrize("method", ["ulmpm", "tlmpm", "ulmpm/contacts"])
def test_all_styles_on_a_scene(run_interpreted, method):
    """An axisymmetric scene of two solids, of one grid or several, in every form."""
    run = run_interpreted(
        f"""
        units(mm, g, ms)
        method({method}, FLIP, linear, 1)
        dimension(2, 0, 1, 0, 1, 0.1)
        axisymmetric(true)
        region(a, block, 0.2, 0.5, 0.1, 0.4)
        region(b, block, 0.2, 0.5, 0.6, 0.9)
        material(m, linear, 1, 100, 0.3)
        solid(lower, region, a, 2, m, 0.1)
        solid(upper, region, b, 2, m, 0.1)
        dump(h, all, hdf5, 1, p.h5, mass, seq)
        dump(v, all, vtk, 1, p.*.vtu, mass, seq)
        dump(gh, all, grid/hdf5, 1, g.h5, mass, occupied=true)
        dump(gv, all, grid/vtk, 1, g.*.vtu, mass, occupied=true)
        dump(g, all, grid, 1, g.dump, mass, occupied=true)
        dump(p, all, pyplot, 1, p.png, 300, 300)
        dump(m, all, movie, 1, p.gif, 300, 300, vy)
        run(2)
        """
    )
    assert "mm g ms K" in run.out
    mass = run.dump("g.dump").mass
    with h5py.File(run.folder / "g.h5") as file:
        assert file["mass"].attrs["units"] == "g"
        stored = file["mass"][-1]
        assert stored[np.isfinite(stored)] == pytest.approx(mass)
    grid = meshio.read(run.folder / "g.2.vtu")
    assert grid.point_data["mass"] == pytest.approx(mass)
    # The cells with points in them: 3 x 3 in each solid, whatever grid they belong to.
    assert len(grid.cells[0].data) == 18
    points = meshio.read(run.folder / "p.2.vtu")
    with h5py.File(run.folder / "p.h5") as file:
        assert file["step"][:].tolist() == [0, 1, 2]
        np.testing.assert_array_equal(file["mass"][-1], points.point_data["mass"])
    assert points.point_data["mass"].sum() == pytest.approx(mass.sum())
    # The points fill the solids in the picture: 0.18 of the domain, whose height they take 0.8 of.
    image = np.asarray(Image.open(run.folder / "p.png").convert("RGB")).astype(int)
    inked = np.ptp(image[:, :200], axis=2) > 60  # the legend is at the right
    frame = (np.ptp(np.nonzero(inked)[0]) / 0.8) ** 2
    assert inked.sum() / frame == pytest.approx(0.18, rel=0.2)
