"""Ground from rasters and profiles, and deposits as rasters."""

from math import cos, radians, sin, tan

import meshio
import numpy as np
import pytest

from karamelo_py.scene.meshes.inside import Skin
from karamelo_py.scene.terrain import faces_of, read_raster
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.terrain import _filled, _next_to

HEAD = "ncols 3\nnrows 2\nxllcorner {x}\nyllcorner 0\ncellsize 0.5\nNODATA_value -9999\n"
TILTED = HEAD.format(x=0) + "0.5 0.6 0.7\n0.3 0.4 0.5\n"


def test_the_first_row_is_the_northern_one(tmp_path):
    path = tmp_path / "dem.asc"
    path.write_text(TILTED.replace("0.7", "-9999"), encoding="utf-8")
    raster = read_raster(path)
    assert raster.heights[0].tolist() == [0.3, 0.4, 0.5]
    assert np.isnan(raster.heights[1, 2]) and raster.centres[0].tolist() == [0.25, 0.75, 1.25]


def test_a_geotiff_is_the_same_raster(tmp_path):
    """Written and read by rasterio: rows from the north, a hole, the corner and the cells."""
    rasterio = pytest.importorskip("rasterio")
    heights = np.array([[0.5, 0.6, -9999], [0.3, 0.4, 0.5]])
    for name, size in (("dem.tif", 0.5), ("oblong.tif", 0.4)):
        place = rasterio.transform.from_origin(10, 21, 0.5, size)
        how = {"height": 2, "width": 3, "count": 1, "dtype": "float64", "nodata": -9999}
        with rasterio.open(tmp_path / name, "w", driver="GTiff", transform=place, **how) as file:
            file.write(heights, 1)
    raster = read_raster(tmp_path / "dem.tif")
    assert raster.corner.tolist() == [10, 20] and raster.cell == 0.5
    assert raster.heights[0].tolist() == [0.3, 0.4, 0.5]
    assert np.isnan(raster.heights[1, 2]) and raster.heights[1, 1] == 0.6
    with pytest.raises(ScriptError, match=r"cells of 0\.5 by 0\.4"):
        read_raster(tmp_path / "oblong.tif")
    (tmp_path / "none.tif").write_bytes(b"no raster")
    with pytest.raises(ScriptError, match="cannot be read"):
        read_raster(tmp_path / "none.tif")


def cloud(plane=lambda x, y: 1 + 0.5 * x - 0.25 * y, count=60):
    """Scattered points of a plane, and the corners of a box of 4 by 3 at (10, 20)."""
    x, y = np.random.default_rng(1).random((2, count)) * [[4], [3]]
    x, y = np.append(x, [0, 4, 0, 4]), np.append(y, [0, 0, 3, 3])
    return np.column_stack([10 + x, 20 + y, plane(x, y)])


@pytest.mark.parametrize("name", ["cloud.xyz", "cloud.csv", "cloud.ply", "cloud.vtk"])
def test_a_cloud_of_points_is_interpolated(tmp_path, name):
    """Linear interpolation is exact on a plane; the raster covers the box."""
    points, path = cloud(), tmp_path / name
    if path.suffix in (".xyz", ".csv"):
        np.savetxt(path, points, delimiter="," if path.suffix == ".csv" else " ")
    else:
        meshio.Mesh(points, [("vertex", np.arange(len(points))[:, None])]).write(path)
    raster = read_raster(path)
    x, y = np.meshgrid(*raster.centres)
    exact = 1 + 0.5 * np.minimum(x - 10, 4) - 0.25 * np.minimum(y - 20, 3)
    assert np.abs(raster.heights - exact).max() < 1e-6
    assert raster.cell == pytest.approx((12 / 64) ** 0.5)
    ends = raster.corner + raster.cell * np.array(raster.heights.shape[::-1])
    assert (raster.corner <= (10, 20)).all() and (ends >= (14, 23)).all()


def test_heights_may_be_unknown_outside_the_domain():
    """The ground continues level from the centres next to the domain, here from 0.5 to 2.5."""
    at, z = np.arange(5.0), np.arange(25.0).reshape(5, 5)
    corners = np.ix_([0, -1], [0, -1])
    z[corners] = np.nan
    filled = _filled(z, [_next_to(at, 0.5, 2.5)] * 2)
    assert np.isnan(filled[0, 0])  # next to the domain
    assert filled[corners].ravel()[1:].tolist() == [3, 15, 18]


@pytest.mark.parametrize(
    ("rows", "says"), [("1 2\n3 4\n", "has 2 columns"), ("1 2 3\n2 3 4\n3 4 5\n", "on a line")]
)
def test_a_cloud_spans_an_area(tmp_path, rows, says):
    (tmp_path / "cloud.xyz").write_text(rows, encoding="utf-8")
    with pytest.raises(ScriptError, match=says):
        read_raster(tmp_path / "cloud.xyz")


def test_ground_is_closed_and_has_its_volume():
    x, y = np.arange(5.0), np.arange(4.0)
    z = 0.5 * x + 0.3 * y[:, None]
    assert Skin([faces_of(x, y, z, -1.0)], 1e-9).volume == pytest.approx((z.mean() + 1) * 12)


GROUND = """
method(ulmpm, FLIP, linear, 1)
dimension(3, 0, 1.5, 0, 1, 0, 1, 0.125)
region(ground, heights, dem.asc{more})
material(soil, linear, 2000, 1e7, 0.25)
solid(soil, region, ground, 2, soil, 0.125, 0)
{last}
"""


def ground(folder, raster, more="", last="run(0)"):
    (folder / "run").mkdir(exist_ok=True)
    (folder / "run" / "dem.asc").write_text(raster, encoding="utf-8")
    return GROUND.format(more=more, last=last)


@pytest.mark.full
def test_a_body_of_a_raster_and_its_depths(run_script, tmp_path):
    """The plane between centres, level beyond: volume; depths times cells have that of points."""
    last = """dump(d, all, heights, 1, depth.*.asc, 0.25)
        dump(t, all, heights, 1, top.*.asc, 0.25, top)
        dump(p, all, particle, 1, p.*.LAMMPS, volume)
        run(0)""".replace("        ", "")
    result = run_script(ground(tmp_path, TILTED, last=last))
    volume = result.snapshots("p")[0]["volume"].sum()
    depth, top = (read_raster(result.folder / f"{name}.0.asc") for name in ("depth", "top"))
    assert depth.heights.sum() * 0.25**2 == pytest.approx(volume, rel=1e-9)  # ten digits
    assert volume == pytest.approx(0.5 * 1.5, rel=1e-3)
    assert np.nanmax(np.abs(top.heights - depth.heights)) < 0.05


@pytest.mark.parametrize(
    ("raster", "more", "says"),
    [
        (TILTED.replace("0.6", "-9999"), "", "cells without a height in the domain"),
        (TILTED.replace(" 0.7", ""), "", "5 heights in 3 columns and 2 rows"),
        (TILTED.replace("cellsize 0.5\n", ""), "", "its header lacks cellsize"),
        (TILTED.replace("0.7", "high"), "", "'high' is not a height"),
        (HEAD.format(x=9) + "1 1 1 1 1 1", "", "is from x = 9 to 10.5, and the domain from 0"),
        (TILTED, ", y=0.25", "is from y = 0.25 to 1.25"),
    ],
)
def test_what_is_refused(run_interpreted, tmp_path, raster, more, says):
    err = run_interpreted(ground(tmp_path, raster, more), status=1).err
    assert says in err and "in.script:" in err and err.count("error:") == 1


def test_a_file_that_is_missing(run_interpreted, tmp_path):
    script = ground(tmp_path, TILTED).replace("dem.asc", "dam.asc")
    assert "did you mean 'dem.asc'" in run_interpreted(script, status=1).err


SLIDE = """
    method(ulmpm, FLIP, linear, 1)
    h = 0.2
    a = radians(20)
    dimension(2, 0, 10, 0, 6, h)
    region(ground, heights, slope.csv)
    region(low, plane, 2, 4 - 2*tan(a), sin(a), cos(a))
    region(high, plane, 2, 4 - 2*tan(a) + 1/cos(a), -sin(a), -cos(a))
    region(left, plane, 2, 4 - 2*tan(a), cos(a), -sin(a))
    region(right, plane, 2 + 2*cos(a), 4 - 2*tan(a) - 2*sin(a), -cos(a), sin(a))
    region(block, intersection, low, high, left, right)
    material(m, linear, 1000, 1e6, 0.3)
    solid(b, region, block, 2, m, h, 0, points=cut)
    fix(g, body_force, all, 0, -9.81)
    fix(ground, contact/surface, all, ground, 0.2)
    compute(v, average_velocity, all)
    log_modify(custom, time, v_x, v_y)
    set_output(time(0.1))
    run_time(2)
"""


def test_a_block_slides_down_a_profile(run_script, tmp_path):
    """Coulomb: the acceleration g (sin a - mu cos a), and mu times that of bounces."""
    (tmp_path / "run").mkdir()
    profile = f"x, y\n0, 4\n10, {4 - 10 * tan(radians(20))!r}\n"
    (tmp_path / "run" / "slope.csv").write_text(profile, encoding="utf-8")
    log = run_script(SLIDE).log
    a = radians(20)
    exact = 9.81 * (sin(a) - 0.2 * cos(a))
    across = log["v_x"] * sin(a) + log["v_y"] * cos(a)
    along = log["v_x"] * cos(a) - log["v_y"] * sin(a) + 0.2 * across
    time = log["Time"]
    assert (along[-1] - along[10]) / (time[-1] - time[10]) == pytest.approx(exact, rel=0.01)
