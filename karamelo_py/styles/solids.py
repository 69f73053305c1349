"""Solid styles region and points."""

from functools import partial
from typing import Annotated, Literal

import numpy as np

from karamelo_py.compiler.tuples import count_in
from karamelo_py.kernels.laws import law_on
from karamelo_py.language.signature import AtLeast, Positive
from karamelo_py.output.point_table import AXES
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.points.laws import initial_state, specific_volume
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.machine_memory import room_for_points
from karamelo_py.scene.material import Material
from karamelo_py.scene.placement import Placement, fill, lattice_of
from karamelo_py.scene.region import Region
from karamelo_py.scene.solid import Solid, own_grids
from karamelo_py.scene.tables import FileColumns
from karamelo_py.script.errors import ScriptError

MISSED = 0.01  # difference in volume, as a fraction, above which a warning is given
COARSE = 0.08  # MISSED for boxes and balls
MANY = 10  # points per cell and direction above which a warning is given


class RegionSolid(Solid):
    """A body that fills a region, with `ppc` points per cell and direction.

    Points are placed in the cells of the grid, within the region and the domain. Each point has the
    volume ``(h / ppc)^dimension`` (times x in axisymmetric domains).

    Parameters
    ----------
    region
        The region to fill.
    ppc
        Points per cell in each direction: 2 gives 4 points per cell in 2D, 8 in 3D.
    points
        ``regular``: equally spaced. ``gauss``: at the Gauss points of the cell, with their weights
        as volumes. ``cut``: equally spaced, with the boxes of points cut at the edge of the region.
        The default is ``cut`` for regions from files (mesh, stl), and in ulmpm/contacts for curved
        or inclined faces; otherwise ``regular``, but Gauss points with equal volumes for ``ppc`` 3,
        as in Karamelo. With cpdi, ugimp and cpgimp, the default is ``regular``.

    Example
    -------
    solid(s1, region, disk, 2, steel, 0.1, 0)
    solid(s2, region, disk, 3, steel, 0.1, points=gauss)
    solid(s3, region, disk, 2, steel, 0.1, points=cut)

    Notes
    -----
    Cells start at the lower corner of the domain, or, in methods with a grid for each solid, of the
    region's bounding box within the domain.

    A cut point has the volume and centroid of the part of its box inside the region; a part of less
    than 10 % of the box is merged with the nearest point. The volume of round bodies is exact to
    0.01 %, and bodies in contact do not lock on a stair-stepped surface. The mass of fins and slots
    as thin as 10 % of h/ppc is exact to 3 %; a warning names thinner ones, except in regions of
    plug-ins without `distance`. With ugimp and cpgimp, cut points have square domains, which do not
    tile the edge; cpdi refuses cut points.

    See Also
    --------
    mesh, region, material
    """

    region: Region
    syntax = "regionID, ppc, material, h[, T0][, points=regular|gauss|cut][, GlueToSolid=solidID]"

    def __init__(
        self,
        hub: Hub,
        region: Region,
        ppc: Annotated[int, AtLeast(1)],
        material: Material,
        h: Annotated[float, Positive],
        T0: float | None = None,
        *,
        points: Literal["regular", "gauss", "cut"] | None = None,
        GlueToSolid: Solid | None = None,
    ):
        domain = hub.require_domain()
        super().__init__(hub, material, h, T0, GlueToSolid)
        self.region = region
        self.ppc = ppc
        corners = {"corners", "half_edges"} & {*hub.update.method.basis.traits.shape}
        method = hub.update.method
        # Whole boxes would form stair-steps, and a shape from a file would have a wrong mass.
        stepped = method.fields_per_solid and not region.aligned
        drawn = region.from_file and not method.regular_points
        if points is None and (stepped or drawn) and not (corners or region.unknown):
            points = "cut"
        self.cut = points == "cut"
        lattice = lattice_of(region, domain, self.h, apart=own_grids(hub))
        if points is None and hub.update.method.regular_points:
            points = "regular"
        if self.cut and corners:
            message = "domains of cpdi tile a body, which cut points do not"
            hint = "points=regular, a solid from a mesh, or another basis"
            raise ScriptError(message, argument="points", hint=hint)
        if ppc > MANY:
            hub.warn(
                f"{ppc} points per cell and direction are {ppc**domain.dimension:.3g} in each cell",
                hint="usually 2 or 3; smaller cells also give more points",
            )
        kin = KINEMATICS[domain.dimension]()
        state = count_in(initial_state(law_on(material.law, self.h, T0 or 0.0), kin, 1.0))
        room = partial(room_for_points, hub, self.first_id, domain.dimension, state)
        placement = fill(region, domain, lattice, ppc, points, room)
        self.put(hub, placement, may_be_empty=region.unknown)
        volumes = self._volumes(placement)
        self.volumes = volumes if region.from_file else None
        missed = MISSED if region.from_file else COARSE
        if placement.missed:
            hub.warn(
                f"parts of {self.described()} are too thin for points=cut, "
                f"{placement.missed:.3g}: their mass may be wrong or missing",
                hint="smaller cells, or more points per cell",
            )
        elif volumes and abs(volumes[0] / volumes[1] - 1) > missed:
            self._warn_of_volume(hub, *volumes)
        self._warn_of_size(hub)

    def _volumes(self, placement: Placement) -> tuple[float, float] | None:
        whole = self.region.volume
        total = float(np.sum(np.broadcast_to(placement.volume, self.count)))
        return None if whole is None else (total, whole)

    def _warn_of_size(self, hub: Hub) -> None:
        size = float((self.hi - self.lo).max()) if self.count > 1 else np.inf
        if size < (1 - 1e-6) * self.h:
            hub.warn(
                f"the cells ({self.h:g}) are larger than {self.described()}, whose longest side is "
                f"{size:.3g}: the grid cannot resolve how it deforms",
                hint="cells of a quarter of its thinnest side or smaller",
            )

    def _warn_of_volume(self, hub: Hub, total: float, whole: float) -> None:
        hub.warn(
            f"the points have {abs(total / whole - 1):.2%} {'more' if total > whole else 'less'} "
            f"volume, and mass, than {self.described()}: {total:.4g} for {whole:.4g}",
            hint="smaller cells" if self.cut else "points=cut, or smaller cells",
        )

    def described(self) -> str:
        return f"region '{self.region.id}'"

    def why_empty(self) -> str:
        if (self.region.box_lo > self.region.box_hi)[slice(0, self.domain.dimension)].any():
            return f"{self.described()} is empty"
        return f"no point lies in {self.described()}"

    def wanted(self) -> str:
        return (
            f"a region that holds points of the grid with cell size {self.h:g} and "
            f"{self.ppc} per cell and direction, inside the domain"
        )


class PointsSolid(Solid):
    """A body of points whose positions and initial state come from a file or from Python.

    Parameters
    ----------
    table
        A file with columns of numbers and a row of names. Required are ``x``, ``y``, ``z`` (one per
        dimension), and ``volume`` (in 2D for a thickness of 1, in axisymmetric domains the area in
        the xy plane) or ``mass``. Velocities (``vx`` ...), temperatures (``T``) and Cauchy stresses
        (``s11`` ..., for materials in rate form) are optional. The file may also be a dump of
        points (dump particle, vtk or hdf5, or of LAMMPS), of which the last snapshot is read, a
        .vtu or an .xyz file. In Python, use a dictionary of arrays or a DataFrame.
    volume
        Volume of each point, if the file has none.
    GlueToSolid
        As in solid region.

    Example
    -------
    solid(grains, points, grains.csv, steel, 0.1)
    solid(atoms, points, packing.xyz, steel, 0.1, volume=1e-3)

    Notes
    -----
    If the basis needs domains, each is a square or cube with the volume of its point. The cpdi
    methods refuse this style, since their domains must tile a body.

    Materials start without a history: other columns of a dump (``ep``, ``damage`` ...) are ignored.
    To continue a run with its complete state, use ``read_restart``.

    See Also
    --------
    region, mesh, fix initial_velocity_particles
    """

    syntax = "file, material, h[, T0][, volume=V][, GlueToSolid=solidID]"
    source = "table"

    def __init__(
        self,
        hub: Hub,
        table: FileColumns,
        material: Material,
        h: Annotated[float, Positive],
        T0: float | None = None,
        *,
        volume: Annotated[float, Positive] | None = None,
        GlueToSolid: Solid | None = None,
    ):
        domain = hub.require_domain()
        self.warm = "T" in table.columns
        super().__init__(hub, material, h, T0, GlueToSolid)
        self.table, d = table.name, domain.dimension
        columns, lengths = dict(table.columns), {np.shape(of) for of in table.columns.values()}
        mass = columns.pop("mass", None)
        if "volume" in columns and volume is not None:
            message = f"{self.table} has a column volume"
            raise ScriptError(message, argument="volume", expected="no volume=V, or no such column")
        if volume is not None:
            columns["volume"] = np.full(np.shape(next(iter(columns.values()))), volume)
        elif "volume" not in columns and mass is not None and {*AXES[:d]} <= {*columns}:
            depth = domain.depth(np.column_stack([columns[axis] for axis in AXES[:d]]))
            columns["volume"] = mass * float(specific_volume(material.law)) / depth
        missing = [name for name in (*AXES[:d], "volume") if name not in columns]
        if missing or len(lengths) > 1 or len(next(iter(lengths), ())) != 1:
            problem = f"has no column {missing[0]}" if missing else "has columns of several lengths"
            message = f"{self.table} {problem}"
            expected = f"columns {', '.join(AXES[:d])}, volume, and perhaps vx ..., T, s11 ..."
            hint = "volume=V, for all points, or a column mass" if missing == ["volume"] else None
            raise ScriptError(message, argument="table", expected=expected, hint=hint)
        x = np.column_stack([columns.pop(axis) for axis in AXES[:d]])
        volumes = columns.pop("volume")
        wrong = ~(np.isfinite(x).all(axis=1) & (volumes > 0) & np.isfinite(volumes))
        if wrong.any():
            raise ScriptError(
                f"point {np.argmax(wrong) + 1} of {self.table} has no position, or no volume "
                "above 0",
                argument="table",
            )
        half = volumes[:, None] ** (1 / d) / 2 * np.ones(d)
        kept = domain.contains(x)
        # T comes first, as the stress depends on the temperature of the point.
        order = sorted(columns, key=lambda name: name != "T")
        self.initial = {name: columns[name][kept] for name in order}
        near, size = (x[kept], half[kept]) if kept.any() else (x, half)
        self.put(
            hub,
            Placement(
                x[kept],
                volumes[kept],
                half[kept],
                (near - size).min(axis=0, initial=np.inf),
                (near + size).max(axis=0, initial=-np.inf),
                int(np.count_nonzero(~kept)),
                "points",
            ),
        )

    def described(self) -> str:
        return f"table '{self.table}'"

    def why_empty(self) -> str:
        return f"{self.described()} has no rows"

    def wanted(self) -> str:
        return "points inside the domain, in the length unit of the script"
