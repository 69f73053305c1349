"""Shapes from mesh files."""

from collections import Counter
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from karamelo_py.kernels.surfaces import Joined, Surface, offsets
from karamelo_py.language.signature import Positive
from karamelo_py.scene.domain import RELATIVE_TOLERANCE, require_grid
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material
from karamelo_py.scene.meshes.data import Mesh
from karamelo_py.scene.meshes.elements import elements_of, in_order, measured
from karamelo_py.scene.meshes.inside import Skin, flat_faces, outer_faces, skin_of, triangles_of
from karamelo_py.scene.meshes.reading import MeshFile, read
from karamelo_py.scene.placement import Placement
from karamelo_py.scene.region import EXTERIOR, Region
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError

# A shape smaller than CELLS cells, or OUT times as long as the domain, is probably in other units.
CELLS, OUT = 3, 20
UNITS = {
    1e-3: "a file in millimetres, a script in metres",
    1e3: "a file in metres, a script in millimetres",
    0.0254: "a file in inches, a script in metres",
    25.4: "a file in inches, a script in millimetres",
    1 / 0.0254: "a file in metres, a script in inches",
    1 / 25.4: "a file in millimetres, a script in inches",
}
CURVED = 0.01  # distance from the straight edge / its length, as in a circle of 80 elements


def _tell_of_curved_edges(hub: Hub, file: MeshFile, bulge: float) -> None:
    if bulge > CURVED:
        hub.warn(
            f"{file.name} has edges curved by {bulge:.2g} of their length, and elements are taken "
            "with straight edges: the volume beyond them is missing",
            hint="a finer mesh",
        )


def _tell_of_units(hub: Hub, file: MeshFile, lo: np.ndarray, hi: np.ndarray) -> None:
    """Warn of a shape that is probably in other units than the domain."""
    domain, used = hub.require_domain(), slice(len(lo))
    size, room = float((hi - lo).max()), float((domain.hi - domain.lo)[used].max())
    if CELLS * (domain.h or 0.0) < size < OUT * room:
        return
    for factor, units in UNITS.items():
        fits = domain.contains(np.array([lo, hi]) * factor).all()
        if fits and size * factor > max(room / OUT, CELLS * (domain.h or 0.0)):
            hub.warn(
                f"{file.name} is {size:.4g} long, the domain {room:.4g}: "
                f"scaled by {factor:.4g} it would fit ({units})",
                hint="one unit of length: scale the file, or write the script in its units",
            )
            return


class Enclosed(Region):
    skin: Skin
    from_file = True

    @property
    def volume(self) -> float | None:
        whole = (self.lo == self.box_lo).all() and (self.hi == self.box_hi).all()
        return self.skin.volume if whole else None

    @property
    def aligned(self) -> bool:
        return bool((np.ptp(self.skin.faces, axis=1).min(axis=1) <= self.domain.tolerance).all())

    def contains(self, x: np.ndarray) -> np.ndarray:
        return self.skin.contains(x)

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        return self.skin.depth(x, reach)

    def shape(self) -> Surface | Joined | None:
        first, *others = self.skin.surfaces
        return None if self.flat else Joined((first, *others)) if others else first


class MeshRegion(Enclosed):
    """All positions in the elements of a mesh, or of one of its physical groups.

    Parameters
    ----------
    file
        A mesh file: Gmsh (.msh), Abaqus or CalculiX (.inp), LS-DYNA (.k), Nastran (.bdf), Exodus
        (.e), MED, CGNS, MFEM, VTK and any other format that meshio reads; or a geometry (.geo,
        .step, .brep), which Gmsh meshes.
    group
        Name or number of a physical group (Gmsh), or of a set, an instance, a block, a property or
        a surface in other formats; in VTK, ``name:number`` of cell data. Default: the whole mesh. A
        group of lower dimension, such as a boundary, can be used to select nodes and to load faces.
    exterior
        The word ``exterior`` selects everything outside.

    Example
    -------
    region(core, mesh, part.msh, inside)
    region(body, mesh, part.msh)

    Notes
    -----
    Elements are lines in 1D, triangles and quadrilaterals in 2D, tetrahedra, hexahedra, wedges and
    pyramids in 3D. Edges are taken as straight, and a non-planar face with four corners as two
    triangles. Faces belong to the region. In 2D the mesh must have z = 0.

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
        domain = hub.require_domain()
        dimension = domain.dimension
        mesh = read(file, dimension, hub.settings.trusts, domain.h and domain.h / 2)
        parts = elements_of(mesh, dimension, group, lower=group is not None)
        _tell_of_curved_edges(hub, file, max(elements.bulge for elements in parts))
        flat = parts[0].shape.dimension < dimension
        self.has_faces = parts[0].shape.dimension == dimension - 1
        faces = flat_faces(parts) if flat else outer_faces(parts)
        lo, hi = faces.min(axis=(0, 1)), faces.max(axis=(0, 1))
        _tell_of_units(hub, file, lo, hi)
        super().__init__(hub, lo, hi, exterior=exterior == EXTERIOR)
        # Coordinates in mesh files have few digits.
        tolerance = max(self.tolerance, RELATIVE_TOLERANCE * float((hi - lo).max()))
        self.skin = Skin([faces], tolerance, odd=dimension == 1, open=flat)

    @property
    def aligned(self) -> bool:
        return self.flat or super().aligned

    @property
    def flat(self) -> bool:
        return self.skin.open

    @property
    def sheet(self) -> np.ndarray | None:
        return self.skin.faces if self.flat and self.has_faces else None


class Near(Region):
    """Positions within half a cell of a set of faces, edges or nodes."""

    def __init__(self, region: MeshRegion):
        d = region.dimension
        self.reach = require_grid(region.hub).lattice.h / 2 - region.tolerance
        lo, hi = region.box_lo[:d] - self.reach, region.box_hi[:d] + self.reach
        super().__init__(region.hub, lo, hi, parts=(region,))
        (self.surface,) = region.skin.surfaces

    def contains(self, x: np.ndarray) -> np.ndarray:
        return offsets(self.surface, x, self.reach) < self.reach


def near_set(hub: Hub, name: str, file: Path, group: str | int) -> Region:
    """Return the region of a set of elements, or positions within half a cell of other sets."""
    region = MeshRegion(hub, file, group)
    chosen = Near(region) if region.flat else region
    chosen.id = f"{name} ({file.name})"
    return chosen


# Binary STL files, and most writers of other formats, have single precision.
_SINGLE = float(np.finfo(np.float32).eps)


class STL(Enclosed):
    """All positions in or on a closed triangulated surface, in 3D.

    Parameters
    ----------
    file
        File of triangles or quadrilaterals: STL (text or binary), OBJ, or any format that region
        mesh reads, in the length unit of the script.
    exterior
        The word ``exterior`` selects everything outside the surface.

    Example
    -------
    region(part, stl, body.stl)

    Notes
    -----
    The surface must be closed: every edge belongs to two triangles. Shells inside other shells are
    cavities, whatever their orientation; overlapping shells are one body.

    See Also
    --------
    mesh, difference
    """

    def __init__(self, hub: Hub, file: MeshFile, exterior: Literal["exterior"] | None = None):
        if hub.require_domain().dimension != 3:
            message = "a surface encloses space in 3D only"
            hint = "in 2D, region(ID, mesh, file) takes a mesh of triangles or quadrilaterals"
            raise ScriptError(message, expected="dimension(3, ...)", hint=hint)
        mesh = read(file, 2, hub.settings.trusts)
        triangles = triangles_of(mesh)
        if not len(triangles):
            raise ScriptError(
                f"{file.name} has no triangles", argument="file", expected="a surface of triangles"
            )
        points = np.asarray(mesh.points, float)
        used = points[np.unique(triangles)]
        lo, hi = used.min(axis=0), used.max(axis=0)
        _tell_of_units(hub, file, lo, hi)
        super().__init__(hub, lo, hi, exterior=exterior == EXTERIOR)
        tolerance = max(self.tolerance, 2 * _SINGLE * float(np.abs(used).max()))
        self.skin = skin_of(points, triangles.astype(np.int64), tolerance)


class MeshSolid(Solid):
    """A body with one point in each element of a mesh, at the centroid.

    The volume of each point is the volume of its element (times x in axisymmetric domains).

    Parameters
    ----------
    file
        Mesh or geometry, as in region mesh, in the current folder or next to the script.
    group
        Name or number of a physical group (in other formats a set of elements, a part or an
        instance). Default: the whole mesh.

    Example
    -------
    solid(s1, mesh, part.msh, steel, 0.1, 0)

    Notes
    -----
    Elements are as in region mesh. Elements of lower dimension are ignored; elements with their
    centroid outside the domain are, too, with a warning. Volumes of higher-order elements include
    their curved edges. The cpdi methods need elements of one shape, with straight edges. In 2D the
    mesh must have z = 0.

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
        domain = hub.require_domain()
        super().__init__(hub, material, h, T0, GlueToSolid)
        self.file = file
        mesh = read(file, domain.dimension, hub.settings.trusts, h / 2)
        parts = elements_of(mesh, domain.dimension, group)
        self._tell_of_left_out(hub, mesh)
        measures = [measured(elements) for elements in parts]
        inside = [domain.contains(centroid) for _, _, centroid in measures]
        corners = [
            elements.corners[kept] for (elements, _, _), kept in zip(measures, inside, strict=True)
        ]
        volume, centroid = (np.concatenate(of) for of in list(zip(*measures, strict=True))[1:])
        kept = np.concatenate(inside)
        reach = np.concatenate(
            [x.reshape(-1, domain.dimension) for x in corners if len(x)]
            or [elements.corners[:, 0] for elements, _, _ in measures]
        )
        _tell_of_units(hub, file, reach.min(axis=0), reach.max(axis=0))
        self.volumes = float(volume[kept].sum()), float(volume.sum())
        in_file = Counter[str]()
        for cells in map(in_order, mesh.cells):
            in_file[cells.family] += len(cells.nodes)
        counts = ", ".join(
            f"{np.count_nonzero(taken)} of {in_file[elements.shape.name]} {elements.shape.words}"
            for elements, taken in zip(parts, inside, strict=True)
        )
        self.elements = f" ({counts})"
        mixed = len(measures) > 1
        self.put(
            hub,
            Placement(
                x0=centroid[kept],
                volume=volume[kept],
                half_size=np.concatenate([np.ptp(x, axis=1) for x in corners]) / 2,
                lo=reach.min(axis=0),
                hi=reach.max(axis=0),
                outside=int(np.count_nonzero(~kept)),
                shape="several shapes" if mixed else measures[0][0].shape.name,
                corners=None if mixed else corners[0],
            ),
        )

    def _tell_of_left_out(self, hub: Hub, mesh: Mesh) -> None:
        highest = max(cells.dimension for cells in mesh.cells)
        left_out = Counter(mesh.left_out)
        for cells in mesh.cells:
            if cells.label and cells.dimension < highest:
                left_out[cells.label] += len(cells.nodes)
        counts = ", ".join(f"{n} {kind}" for kind, n in left_out.items())
        if counts:
            hub.warn(f"elements of {self.file.name} that belong to no solid are left out: {counts}")

    def described(self) -> str:
        return f"mesh '{self.file.name}'"

    def why_empty(self) -> str:
        return f"{self.described()} has no elements"

    def wanted(self) -> str:
        return "a mesh with elements inside the domain, in the length unit of the script"
