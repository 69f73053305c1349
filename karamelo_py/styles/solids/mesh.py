"""Solid style mesh."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import Positive
from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material
from karamelo_py.scene.meshes.elements import elements_of, measured
from karamelo_py.scene.meshes.reading import MeshFile, read
from karamelo_py.scene.placement import Placement
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError


class MeshSolid(Solid):
    """A body with one point in each element of a mesh.

    The point stands at the centroid of its element and has its volume, which is exact for every
    shape (times x where the domain is axisymmetric).

    Parameters
    ----------
    file
        Name of a mesh file in a format that meshio reads, such as Gmsh's .msh, or of a .geo file,
        which Gmsh meshes. It is looked for in the current folder, then beside the script.
    material
        What the points are made of.
    h
        Cell size. With a grid shared by all solids (ulmpm) it must be that of the domain.
    T0
        Initial temperature; that of the material when left out.
    group
        Name or number of a physical group, whose elements are taken. Left out: the whole mesh.
    GlueToSolid
        A solid that came before, whose velocity field this one shares, in methods where each
        solid has its own.

    Example
    -------
    solid(s1, mesh, part.msh, steel, 0.1, 0)

    Notes
    -----
    Elements are lines in 1D, triangles or quadrilaterals in 2D, tetrahedra or hexahedra in 3D, of
    first order and of one shape; those of lower dimension are left out. In 2D the mesh lies in the
    plane z = 0. Elements whose centroid lies outside the domain are left out, with a warning.

    See Also
    --------
    region, region mesh, material
    """

    syntax = "file, material, h[, T0][, group=group][, GlueToSolid=solidID]"
    source = "file"

    def __init__(
        self,
        hub: Hub,
        file: MeshFile,
        material: Material,
        h: Annotated[float, Positive],
        T0: float | None = None,
        *,
        group: str | int | None = None,
        GlueToSolid: Solid | None = None,
    ):
        domain = require_domain(hub)
        super().__init__(hub, material, h, T0, GlueToSolid)
        self.file = file
        parts = elements_of(
            read(file, domain.dimension, hub.settings.trusts), domain.dimension, group
        )
        if len(parts) > 1:
            both = " and ".join(part.shape.words for part in parts)
            raise ScriptError(
                f"the mesh has {both}; the points of a solid have one shape",
                argument="file",
                expected="elements of one shape",
                hint="a physical group for each shape, and a solid for each group: group=...",
            )
        elements, volume, centroid = measured(parts[0])
        kept = domain.contains(centroid)
        corners = elements.corners[kept]
        reach = corners if len(corners) else elements.corners
        self.put(
            hub,
            Placement(
                x0=centroid[kept],
                volume=volume[kept],
                half_size=np.ptp(corners, axis=1) / 2,
                lo=reach.min(axis=(0, 1)),
                hi=reach.max(axis=(0, 1)),
                outside=int(np.count_nonzero(~kept)),
                shape=elements.shape.name,
                corners=corners,
            ),
        )

    def described(self) -> str:
        """See `Solid.described`."""
        return f"mesh '{self.file.name}'"

    def why_empty(self) -> str:
        """See `Solid.why_empty`."""
        return f"{self.described()} has no elements"

    def wanted(self) -> str:
        """See `Solid.wanted`."""
        return "a mesh with elements inside the domain, in the lengths of the script"
