"""Region style stl."""

from functools import cached_property
from typing import Literal

import numpy as np

from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.meshes.inside import Skin, Surface
from karamelo_py.scene.meshes.reading import MeshFile, read
from karamelo_py.scene.region import EXTERIOR, Region
from karamelo_py.script.errors import ScriptError

# Binary STL files, and most programs that write the others, have single precision.
_SINGLE = float(np.finfo(np.float32).eps)


class STL(Region):
    """All that a closed surface of triangles encloses, the surface included; in 3D.

    Parameters
    ----------
    file
        Name of a file with triangles: STL (text or binary), or any format that meshio reads. In
        the lengths of the script: the file is not scaled.
    exterior
        The word ``exterior`` makes the region all that is outside of the surface.

    Example
    -------
    region(part, stl, body.stl)

    Notes
    -----
    The surface must be closed: every edge belongs to two triangles. A part inside of another one
    is a cavity. A position is inside if a ray from it along z crosses the surface an odd number of
    times; edges and vertices on the ray make no difference.

    See Also
    --------
    mesh, difference
    """

    def __init__(self, hub: Hub, file: MeshFile, exterior: Literal["exterior"] | None = None):
        if require_domain(hub).dimension != 3:
            raise ScriptError(
                "a surface encloses space in 3D only",
                expected="dimension(3, ...)",
                hint="in 2D, region(ID, mesh, file) takes a mesh of triangles or quadrilaterals",
            )
        mesh = read(file, 2, hub.settings.trusts)
        triangles = mesh.get_cells_type("triangle")
        if not len(triangles):
            raise ScriptError(
                f"{file.name} has no triangles", argument="file", expected="a surface of triangles"
            )
        points = np.asarray(mesh.points, float)
        used = points[np.unique(triangles)]
        lo, hi = used.min(axis=0), used.max(axis=0)
        super().__init__(hub, lo, hi, exterior=exterior == EXTERIOR)
        tolerance = max(self.tolerance, 2 * _SINGLE * float(np.abs(used).max()))
        self.surface = Surface(points, triangles.astype(np.int64), tolerance)

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Test which positions the surface encloses, see `Region.contains`."""
        return self.surface.encloses(np.asarray(x)[:, :3])

    @cached_property
    def skin(self) -> Skin:
        """Its surface."""
        return Skin(self.surface.corners)

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        """Return the depth of positions below the surface, see `Region.distance`."""
        distance = self.skin.distance(x[:, :3], reach)
        return np.where(self.contains(x), distance, -distance)
