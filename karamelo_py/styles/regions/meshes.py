"""Region styles mesh and stl."""

from functools import cached_property
from typing import Literal

import numpy as np

from karamelo_py.scene.domain import RELATIVE_TOLERANCE, require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.meshes.elements import elements_of
from karamelo_py.scene.meshes.reading import MeshFile, read
from karamelo_py.scene.meshes.simplices import Simplices, split
from karamelo_py.scene.meshes.skin import Skin, outer_faces
from karamelo_py.scene.meshes.surface import Surface
from karamelo_py.scene.region import EXTERIOR, Region
from karamelo_py.script.errors import ScriptError


class MeshRegion(Region):
    """All that lies in an element of a mesh, or of one of its physical groups.

    Parameters
    ----------
    file
        Name of a mesh file in a format that meshio reads, such as Gmsh's .msh, or of a .geo file,
        which Gmsh meshes.
    group
        Name or number of a physical group (a set of elements in other formats). Left out: the
        whole mesh. A group of lower dimension, such as a boundary, holds the positions that lie
        on it, which is useful for groups of nodes.
    exterior
        The word ``exterior`` makes the region all that is outside.

    Example
    -------
    region(core, mesh, part.msh, inside)
    region(body, mesh, part.msh)

    Notes
    -----
    Elements are lines in 1D, triangles and quadrilaterals in 2D, tetrahedra and hexahedra in 3D,
    of first order; their faces belong to them. Faces of hexahedra that are not plane count as two
    triangles. In 2D the mesh lies in the plane z = 0.

    See Also
    --------
    stl, solid mesh
    """

    def __init__(
        self,
        hub: Hub,
        file: MeshFile,
        group: str | int | None = None,
        exterior: Literal["exterior"] | None = None,
    ):
        if group == EXTERIOR and exterior is None:
            group, exterior = None, EXTERIOR
        dimension = require_domain(hub).dimension
        parts = elements_of(
            read(file, dimension, hub.settings.trusts), dimension, group, lower=group is not None
        )
        corners = np.concatenate([split(elements) for elements in parts])
        lo, hi = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        super().__init__(hub, lo, hi, exterior=exterior == EXTERIOR)
        # Meshes are written with fewer digits than numbers have.
        tolerance = max(self.tolerance, RELATIVE_TOLERANCE * float((hi - lo).max()))
        self.corners = corners
        self.simplices = Simplices(corners, tolerance)

    def contains(self, x: np.ndarray) -> np.ndarray:
        return self.simplices.contain(np.asarray(x)[:, : self.dimension])

    @cached_property
    def skin(self) -> Skin:
        return Skin(outer_faces(self.corners))

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        if self.simplices.flat:
            return np.full(len(x), -reach)  # nothing lies in a surface or a line
        distance = self.skin.distance(x[:, : self.dimension], reach)
        return np.where(self.contains(x), distance, -distance)


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
        return self.surface.encloses(np.asarray(x)[:, :3])

    @cached_property
    def skin(self) -> Skin:
        return Skin(self.surface.corners)

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        distance = self.skin.distance(x[:, :3], reach)
        return np.where(self.contains(x), distance, -distance)
