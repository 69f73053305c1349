"""Command populate_cylindrical_coordinates: points of a solid in rings about an axis."""

import math

import numpy as np

from karamelo_py.commands.points import refuse_chosen, replace_points
from karamelo_py.language.by_dimension import Forms, place_of
from karamelo_py.language.signature import Argument
from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.placement import MAX_POINTS, Placement
from karamelo_py.scene.region import Region, check_radius
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError

FORMS = Forms(
    "populate_cylindrical_coordinates(solidID, regionID, {names})",
    {
        2: ("c1", "c2", "R", "Ndr", "Ndtheta", "T0"),
        3: ("axis", "c1", "c2", "R", "lo", "hi", "Ndx", "Ndr", "Ndtheta", "T0"),
    },
    words={"axis": ("x", "y", "z")},
)


def populate_cylindrical_coordinates(
    hub: Hub, solid: Solid, region: Region, *lattice: Argument
) -> None:
    """Replace the points of a solid by points in rings about a centre or an axis.

    Parameters
    ----------
    solid
        ID of the solid. It keeps its material and its cell size.
    region
        ID of the region that keeps the points that lie in it; the others are dropped.
    lattice
        In 2D ``c1, c2, R, Ndr, Ndtheta, T0``: the centre, the outer radius, the number of rings,
        the number of points in each ring, and the initial temperature. In 3D
        ``axis, c1, c2, R, lo, hi, Ndx, Ndr, Ndtheta, T0``: the word x, y or z, the centre in the
        other two directions (in the order x, y, z), the outer radius, the ends along the axis, the
        number of slices along it, and the rest as in 2D.

    Example
    -------
    populate_cylindrical_coordinates(s1, disk, 0, 0, 0.3, 6, 24, 0)

    Notes
    -----
    Ring j = 0, 1, ... has the radius ``r = (j + 1/2) dr`` with ``dr = R / Ndr``, its points stand
    at the angles ``k dtheta`` with ``dtheta = 2 pi / Ndtheta``, and slice i in the middle of its
    length, ``lo + (i + 1/2) dx`` with ``dx = (hi - lo) / Ndx``. Every point has the volume of its
    polar cell, ``r dr dtheta dx``, and all of them together have ``pi R^2 (hi - lo)`` (in 2D
    ``pi R^2``). Karamelo puts the rings at ``j dr`` with a point in the centre, and slices at
    ``lo + i dx``, whose volumes do not add up to that.

    Comes before the first run, and before the groups that choose from these points. T0 replaces
    the temperature of the solid.

    See Also
    --------
    solid, region
    """
    if hub.has_run:
        raise ScriptError(
            f"the points of solid '{solid.id}' have been in a run",
            argument="solid",
            expected="populate_cylindrical_coordinates before the first run",
        )
    refuse_chosen(hub, solid, "populate_cylindrical_coordinates")
    dimension = require_domain(hub).dimension
    values = FORMS.read(hub, lattice, dimension)
    placed = _polar(values, FORMS.names[dimension], lattice)
    if not region.unknown:
        placed = _kept(hub, region, placed)
    T0, solid.T0 = solid.T0, values["T0"]
    try:
        replace_points(hub, solid, placed, may_be_empty=region.unknown)
    except ScriptError as error:
        solid.T0 = T0
        error.argument = "region"
        raise


populate_cylindrical_coordinates.syntax = (
    "solidID, regionID[, axis], c1, c2, R[, lo, hi, Ndx], Ndr, Ndtheta, T0"
)


def _polar(values: dict, names: tuple[str, ...], given: tuple[Argument, ...]) -> Placement:
    """The points of all polar cells, slices outermost, then rings, then angles."""
    check_radius(values["R"], place_of(names, given, "R"))
    counts = [
        _count(values[name], name, place_of(names, given, name)) if name in names else 1
        for name in ("Ndx", "Ndr", "Ndtheta")
    ]
    total = math.prod(counts)
    if total > MAX_POINTS:
        raise ScriptError(
            f"about {total:.3g} points would be needed", expected=f"at most {MAX_POINTS}"
        )
    slices, rings, angles = (np.arange(n) for n in counts)
    dr, dtheta = values["R"] / counts[1], 2 * math.pi / counts[2]
    r = np.repeat((rings + 0.5) * dr, counts[2])
    theta = np.tile(angles * dtheta, counts[1])
    cosine, sine = np.cos(theta), np.sin(theta)
    # The box around a cell taken as a rectangle of r dtheta by dr.
    along_r, along_theta = dr / 2, r * dtheta / 2
    columns = [values["c1"] + r * cosine, values["c2"] + r * sine]
    halves = [
        np.abs(cosine) * along_r + np.abs(sine) * along_theta,
        np.abs(sine) * along_r + np.abs(cosine) * along_theta,
    ]
    volume = r * (dr * dtheta)
    centre = np.array([values["c1"], values["c2"]])
    lo, hi = centre - values["R"], centre + values["R"]
    if "axis" in values:
        axis = "xyz".index(values["axis"])
        if values["hi"] <= values["lo"]:
            raise ScriptError(
                f"hi = {values['hi']:g} must be above lo = {values['lo']:g}",
                place=place_of(names, given, "hi"),
            )
        dx = (values["hi"] - values["lo"]) / counts[0]
        ring = len(r)
        columns = [np.tile(column, counts[0]) for column in columns]
        halves = [np.tile(half, counts[0]) for half in halves]
        columns.insert(axis, np.repeat(values["lo"] + (slices + 0.5) * dx, ring))
        halves.insert(axis, np.full(len(columns[axis]), dx / 2))
        volume = np.tile(volume * dx, counts[0])
        lo, hi = np.insert(lo, axis, values["lo"]), np.insert(hi, axis, values["hi"])
    return Placement(np.column_stack(columns), volume, np.column_stack(halves), lo, hi)


def _count(value: float, name: str, place) -> int:
    if math.isnan(value):
        return 1  # A result that a rehearsal does not have.
    if value < 1 or value != math.floor(value):
        raise ScriptError(
            f"{name} must be a whole number of at least 1, not {value:g}", place=place
        )
    return int(value)


def _kept(hub: Hub, region: Region, placed: Placement) -> Placement:
    """The points that lie in the region and in the domain, and how many lie outside of it."""
    domain = require_domain(hub)
    wanted = region.inside(placed.x0)
    in_domain = domain.contains(placed.x0)
    kept = wanted & in_domain
    used = slice(0, domain.dimension)
    return placed._replace(
        x0=placed.x0[kept],
        volume=placed.volume[kept],
        half_size=placed.half_size[kept],
        lo=np.maximum(placed.lo, region.lo[used]),
        hi=np.minimum(placed.hi, region.hi[used]),
        outside=int(np.count_nonzero(wanted & ~in_domain)),
    )
