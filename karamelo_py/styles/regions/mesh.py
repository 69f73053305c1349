"""Region style mesh."""

from functools import cached_property
from typing import Literal

import numpy as np

from karamelo_py.scene.domain import RELATIVE_TOLERANCE, require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.meshes.elements import elements_of
from karamelo_py.scene.meshes.inside import Simplices, Skin, outer_faces, split
from karamelo_py.scene.meshes.reading import MeshFile, read
from karamelo_py.scene.region import EXTERIOR, Region


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
        """Test which positions lie in an element, see `Region.contains`."""
        return self.simplices.contain(np.asarray(x)[:, : self.dimension])

    @cached_property
    def skin(self) -> Skin:
        """Its surface."""
        return Skin(outer_faces(self.corners))

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        """Return the depth of positions below the surface, see `Region.distance`."""
        if self.simplices.flat:
            return np.full(len(x), -reach)  # nothing lies in a surface or a line
        distance = self.skin.distance(x[:, : self.dimension], reach)
        return np.where(self.contains(x), distance, -distance)
