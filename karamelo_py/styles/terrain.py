"""Region style heights."""

from typing import Any, Literal

import numpy as np

from karamelo_py.scene.hub import Hub
from karamelo_py.scene.meshes.inside import Skin
from karamelo_py.scene.terrain import HeightsFile, faces_of, outline_of, read_profile, read_raster
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.meshes import Enclosed

AROUND = 4  # cells of ground beyond the domain


class Heights(Enclosed):
    """All positions below the surface of the ground, from a raster of heights.

    Parameters
    ----------
    file
        In 3D a raster of z against x and y: an ESRI ASCII grid (.asc), or GeoTIFF (.tif, with the
        package rasterio); or a cloud of points (with SciPy): a table of x, y and z (.xyz, .csv), or
        a file that meshio reads (.ply, .vtk, .vtu). In 2D a profile: a file with two columns, x
        and height y.
    x, y
        Position in the scene of the lower corner of the raster (in 2D of the first row, x only).
        Default: the coordinates in the file.
    exterior
        The word ``exterior`` selects everything above the surface.

    Example
    -------
    region(ground, heights, dem.asc)
    region(moved, heights, dem.asc, x=-50, y=-50)

    Notes
    -----
    A cloud is interpolated linearly on a raster with the mean spacing of its points.

    Heights are at the centres of raster cells. Between four centres the surface consists of two
    triangles; beyond the outer centres it is level. The raster must cover the domain. A landslide
    is the difference of two such regions, the initial surface and the slip surface. fix
    contact/surface makes the ground a wall with friction.

    See Also
    --------
    difference, stl, fix contact/surface, dump heights
    """

    def __init__(
        self,
        hub: Hub,
        file: HeightsFile,
        exterior: Literal["exterior"] | None = None,
        *,
        x: float | None = None,
        y: float | None = None,
    ):
        domain, shift = hub.require_domain(), (x, y)
        if domain.dimension == 1:
            raise ScriptError(
                "heights need a horizontal direction", expected="dimension(2 or 3, ...)"
            )
        lo, hi = domain.lo, domain.hi
        if domain.dimension == 2:
            profile = read_profile(file)
            at, z = [profile[:, 0]], profile[:, 1]
            at[0] = at[0] if x is None else at[0] - at[0][0] + x
            spacing, begin, end = np.diff(at[0]).max(), [at[0][0]], [at[0][-1]]
        else:
            raster = read_raster(file)
            corner = [c if s is None else s for c, s in zip(raster.corner, shift, strict=True)]
            raster = raster._replace(corner=np.array(corner, float))
            at, z, spacing = [*raster.centres], raster.heights, raster.cell
            begin, end = raster.corner, raster.corner + raster.cell * np.array(z.shape[::-1])
        for k, axis in enumerate("xy"[: domain.dimension - 1]):
            slack = 1e-6 * (hi[k] - lo[k])
            if begin[k] > lo[k] + slack or end[k] < hi[k] - slack:
                raise ScriptError(
                    f"{file.name} is from {axis} = {begin[k]:g} to {end[k]:g}, and the domain from "
                    f"{lo[k]:g} to {hi[k]:g}",
                    argument="file",
                    expected=f"heights over the whole domain, or {axis}=... for its lower corner",
                )
        up, far = domain.dimension - 1, AROUND * max(spacing, domain.h or 0.0)
        bottom = lo[up] - max(far, hi[up] - lo[up])
        if up == 1:
            faces = outline_of(at[0], z, (min(at[0][0], lo[0]) - far, max(at[0][-1], hi[0]) + far),
                               bottom)  # fmt: skip
        else:
            at[0], z = _cut(at[0], z, lo[0] - far, hi[0] + far)
            at[1], turned = _cut(at[1], z.T, lo[1] - far, hi[1] + far)
            z = _filled(turned.T, [_next_to(at[k], lo[k], hi[k]) for k in (1, 0)])
            self._refuse_holes(file.name, at, z)
            faces = faces_of(at[0], at[1], z, min(bottom, z.min() - far))
        super().__init__(
            hub, faces.min(axis=(0, 1)), faces.max(axis=(0, 1)), exterior=exterior is not None
        )
        self.skin = Skin([faces], self.tolerance)
        self.at, self.heights = at, z

    def coincides(self, other: Any, x: np.ndarray) -> np.ndarray | None:
        if not isinstance(other, Heights) or self.exterior or other.exterior:
            return None
        if self.heights.shape != other.heights.shape or any(
            (a != b).any() for a, b in zip(self.at, other.at, strict=True)
        ):
            return None
        apart = np.abs(self.heights - other.heights) > self.tolerance
        for axis in range(apart.ndim):  # a cell is apart from the ground if one of its corners is
            ends = np.moveaxis(apart, axis, 0)
            apart = np.moveaxis(ends[1:] | ends[:-1], 0, axis)
        cells = (
            np.clip(np.searchsorted(at, along) - 1, 0, len(at) - 2)
            for at, along in zip(self.at, x.T, strict=False)
        )
        return np.logical_not(apart[tuple(cells)[::-1]])

    def _refuse_holes(self, name: str, at: list[np.ndarray], z: np.ndarray) -> None:
        rows, columns = np.nonzero(np.isnan(z))
        if len(rows):
            raise ScriptError(
                f"{name} has cells without a height in the domain, such as at "
                f"({at[0][columns[0]]:g}, {at[1][rows[0]]:g})",
                argument="file",
                expected="a raster without holes (gdal_fillnodata), or a smaller domain",
            )


def _next_to(at: np.ndarray, lo: float, hi: float) -> np.ndarray:
    """Return, for each centre, the index of the nearest centre in or next to the domain."""
    first, last = int(np.searchsorted(at, lo, "right")) - 1, int(np.searchsorted(at, hi))
    return np.clip(np.arange(len(at)), max(first, 0), min(last, len(at) - 1))


def _filled(z: np.ndarray, nearest: list[np.ndarray]) -> np.ndarray:
    return np.where(np.isnan(z), z[np.ix_(*nearest)], z)


def _cut(at: np.ndarray, z: np.ndarray, lo: float, hi: float) -> tuple[np.ndarray, np.ndarray]:
    """Cut the columns of `z` (m, n) to positions (n,) from lo to hi; the ends are level."""
    first = max(int(np.searchsorted(at, lo)) - 1, 0)
    last = min(int(np.searchsorted(at, hi)) + 1, len(at))
    at, z = at[first:last], z[:, first:last]
    if at[0] > lo:
        at, z = np.append(lo, at), np.concatenate([z[:, :1], z], axis=1)
    if at[-1] < hi:
        at, z = np.append(at, hi), np.concatenate([z, z[:, -1:]], axis=1)
    return at, z
