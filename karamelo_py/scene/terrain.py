"""Rasters of heights (ESRI ASCII grids, GeoTIFF, clouds of points), and profiles."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from karamelo_py.language.kinds import InputFile
from karamelo_py.scene.tables import read_table
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.reading import read_text
from karamelo_py.script.terms import number_of

GEOTIFF = (".tif", ".tiff")
TABLES = (".csv", ".xyz")
CLOUDS = (*TABLES, ".ply", ".vtk", ".vtu", ".vtp")
NO_DATA = -9999.0
FORM = "ncols, nrows, xllcorner, yllcorner, cellsize (and NODATA_value), then rows from the north"


class HeightsFile(InputFile):
    endings = (".asc", ".txt", ".grd", *GEOTIFF, *CLOUDS)


class Raster(NamedTuple):
    """Heights (ny, nx) at the centres of square cells, rows from the south; NaN where unknown."""

    corner: np.ndarray  # (2,) position of the lower corner
    cell: float
    heights: np.ndarray

    @property
    def centres(self) -> tuple[np.ndarray, np.ndarray]:
        ny, nx = self.heights.shape
        x, y = (self.corner[k] + (np.arange(n) + 0.5) * self.cell for k, n in enumerate((nx, ny)))
        return x, y


def read_raster(path: Path) -> Raster:
    """Read a raster; raises ScriptError for a wrong header, size or number."""
    if path.suffix.lower() in GEOTIFF:
        return _of_geotiff(path)
    if path.suffix.lower() in CLOUDS:
        return _of_cloud(path)
    words, head = read_text(path).split(), {}
    while len(words) > 1 and number_of(words[0]) is None:
        number = number_of(words[1])
        if number is None:
            raise _wrong(path, f"'{words[0]} {words[1]}' in its header")
        head[words[0].lower()], words = number, words[2:]
    corners = [{f"{c}llcorner", f"{c}llcenter"} & head.keys() for c in "xy"]
    if not ({"ncols", "nrows", "cellsize"} <= head.keys() and all(corners)):
        raise _wrong(path, "its header lacks " + ", ".join(
            sorted({"ncols", "nrows", "cellsize", "xllcorner", "yllcorner"} - head.keys())
        ))  # fmt: skip
    nx, ny, cell = int(head["ncols"]), int(head["nrows"]), float(head["cellsize"])
    numbers = [number_of(word) for word in words]
    if None in numbers:
        raise _wrong(path, f"'{words[numbers.index(None)]}' is not a height")
    if len(numbers) != nx * ny or cell <= 0 or not numbers:
        raise _wrong(path, f"{len(numbers)} heights in {nx} columns and {ny} rows")
    heights = np.array(numbers, float).reshape(ny, nx)[::-1].copy()
    heights[heights == head.get("nodata_value", NO_DATA)] = np.nan
    corner = [head.get(f"{c}llcorner", head.get(f"{c}llcenter", 0) - cell / 2) for c in "xy"]
    return Raster(np.array(corner, float), cell, heights)


def _wrong(path: Path, what: str) -> ScriptError:
    return ScriptError(f"{path} is not an ESRI ASCII grid: {what}", argument="file", expected=FORM)


def _needs(path: Path, form: str, package: str, tool: str) -> ScriptError:
    hint = f"pip install {package}, or {tool} -of AAIGrid, which writes an ESRI grid"
    message = f"{path}: {form} needs the package {package}"
    return ScriptError(message, argument="file", hint=hint)


def _of_geotiff(path: Path) -> Raster:
    try:
        import rasterio
    except ImportError:
        raise _needs(path, "GeoTIFF", "rasterio", "gdal_translate") from None
    try:
        with rasterio.open(path) as file:
            heights, transform = (
                file.read(1, masked=True).astype(float).filled(np.nan),
                file.transform,
            )
    except rasterio.errors.RasterioError as error:
        raise ScriptError(f"{path} cannot be read: {error}", argument="file") from None
    if transform.b or transform.d or not np.isclose(transform.a, -transform.e):
        message = f"{path} has cells of {transform.a:g} by {-transform.e:g}, or is rotated"
        raise ScriptError(message, argument="file", expected="square cells along the axes")
    corner = np.array([transform.c, transform.f + heights.shape[0] * transform.e])
    return Raster(corner, transform.a, heights[::-1])


def _of_cloud(path: Path) -> Raster:
    """Interpolate points linearly (Delaunay triangles); cells have the points' mean spacing."""
    try:
        from scipy.interpolate import LinearNDInterpolator
        from scipy.spatial import QhullError
    except ImportError:
        raise _needs(path, "a cloud of points", "scipy", "gdal_grid") from None
    if path.suffix.lower() in TABLES:
        points = np.column_stack([*read_table(path).values()])
    else:
        from karamelo_py.scene.meshes.reading import points_of

        points = points_of(path)
    form = "rows of x, y and z that span an area"
    if points.shape[1] != 3:
        message = f"{path} has {points.shape[1]} columns"
        raise ScriptError(message, argument="file", expected=form)
    lo, hi = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    try:
        height = LinearNDInterpolator(points[:, :2] - lo, points[:, 2])
    except (QhullError, ValueError):
        message = f"the points of {path} are on a line, or too few"
        raise ScriptError(message, argument="file", expected=form) from None
    cell = float(np.sqrt(np.prod(hi - lo) / len(points)))
    x, y = (np.arange(np.ceil(side / cell - 1e-9) + 1) * cell for side in hi - lo)
    inside = np.meshgrid(np.minimum(x, hi[0] - lo[0]), np.minimum(y, hi[1] - lo[1]))
    return Raster(lo - cell / 2, cell, height(*inside))


def read_profile(path: Path) -> np.ndarray:
    """Read positions and heights (n, 2), sorted by position."""
    profile = np.column_stack([*read_table(path).values()][:2])
    if profile.shape[1] < 2 or len(profile) < 2 or (np.diff(profile[:, 0]) <= 0).any():
        raise ScriptError(
            f"{path} is not a profile",
            argument="file",
            expected="rows of position and height, of which the positions increase",
        )
    return profile


def outline_of(x: np.ndarray, z: np.ndarray, ends: tuple, bottom: float) -> np.ndarray:
    """Return segments (m, 2, 2) around the ground below a profile, counter-clockwise."""
    x, z = np.concatenate([ends[:1], x, ends[1:]]), np.concatenate([z[:1], z, z[-1:]])
    corners = np.column_stack([np.append(x, ends)[::-1], np.append(z, [bottom] * 2)[::-1]])
    corners[:2] = corners[1::-1]  # bottom corners from left to right
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def faces_of(x: np.ndarray, y: np.ndarray, z: np.ndarray, bottom: float) -> np.ndarray:
    """Return triangles (m, 3, 3) around the ground below heights (ny, nx), facing outwards."""
    ny, nx = z.shape
    top = np.stack([*np.meshgrid(x, y), z], axis=2)
    low = top.copy()
    low[:, :, 2] = bottom
    faces = [*_halves(top[:-1, :-1], top[:-1, 1:], top[1:, 1:], top[1:, :-1])]
    rim = [(0, k) for k in range(nx)] + [(k, nx - 1) for k in range(1, ny)]
    rim += [(ny - 1, k) for k in range(nx - 2, -1, -1)] + [(k, 0) for k in range(ny - 2, 0, -1)]
    i, j = np.array(rim).T
    a, b = low[i, j], top[i, j]
    faces += [*_halves(a, np.roll(a, -1, 0), np.roll(b, -1, 0), b)]
    ring, middle = a[::-1], np.broadcast_to(a[:1] * 0 + low.mean(axis=(0, 1)), a.shape)
    faces.append(np.stack([ring, np.roll(ring, -1, 0), middle], axis=1))
    return np.concatenate(faces)


def _halves(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> list[np.ndarray]:
    """Divide quadrilaterals (..., 3) along the diagonal a-c."""
    flat = [corner.reshape(-1, 3) for corner in (a, b, c, d)]
    return [np.stack([flat[k] for k in of], axis=1) for of in ((0, 1, 2), (0, 2, 3))]
