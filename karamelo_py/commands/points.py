"""Commands that delete, move or replace points."""

import math
from typing import Literal

import numpy as np

from karamelo_py.language.by_dimension import Forms
from karamelo_py.language.signature import Argument
from karamelo_py.output.fields import ColumnFormula
from karamelo_py.scene.boundary import take_away
from karamelo_py.scene.group import ALL
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import per_direction
from karamelo_py.scene.placement import MAX_POINTS, Placement
from karamelo_py.scene.region import Region, check_radius
from karamelo_py.scene.replacing import chosen_of, refuse_chosen, replace_points
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError, render_message
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import vector


class Solids(tuple):
    script_kind = "the ID of a solid, or all"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> "Solids":
        if ALL in (argument.text, argument.word()):
            return cls(hub.solids.values())
        return cls((Solid.from_script(hub, argument),))


def delete_particles(
    hub: Hub, solids: Solids, by: Literal["region", "where"], chosen: Argument
) -> None:
    """Delete points of a solid: holes and notches, or parts removed between runs.

    Parameters
    ----------
    solids
        ID of the solid, or ``all``.
    by
        The word ``region`` or ``where``.
    chosen
        After ``region``: the ID of a region, whose points are selected by reference position. After
        ``where``: a formula of columns of dump particle; points for which it is not 0 are deleted.

    Example
    -------
    delete_particles(s1, region, hole)
    delete_particles(all, where, damage >= 1)

    Notes
    -----
    Between runs, the mass and energy of the deleted points are printed, and ids do not change.
    Before the first run, the remaining points are renumbered, so the command must precede particle
    groups and contact fixes of these solids; a solid must retain a point.

    See Also
    --------
    fix erosion, translate_particles, boundary, region
    """
    if by == "where":
        _delete_where(hub, solids, ColumnFormula.from_script(hub, chosen))
        return
    region = Region.from_script(hub, chosen)
    members = {solid: region.inside(solid.x0) for solid in solids}
    members = {solid: inside for solid, inside in members.items() if inside.any()}
    if not members and not region.unknown:
        hub.warn(f"region '{region.id}' holds no points: nothing is deleted")
        return
    if hub.has_run:
        if not hub.rehearsing and hub.interpreter.replay is None:
            ids = [np.flatnonzero(inside) + solid.first_id for solid, inside in members.items()]
            present = hub.simulation.present
            _take_away(hub, np.concatenate([some[present[some]] for some in ids]))
        return
    for solid, inside in members.items():
        refuse_chosen(hub, solid, "delete_particles")
        if inside.all():
            message = f"no point of solid '{solid.id}' would be left"
            hint = "leave out the solid, and delete_particles"
            raise ScriptError(message, argument="chosen", hint=hint)
    for solid, inside in members.items():
        replace_points(hub, solid, chosen_of(solid, ~inside))


def _delete_where(hub: Hub, solids: Solids, condition: ColumnFormula) -> None:
    if not hub.has_run:
        message = "points have no such columns before the first run"
        expected = "delete_particles(solids, region, regionID), or a run before"
        raise ScriptError(message, argument="by", expected=expected)
    if hub.rehearsing or hub.interpreter.replay is not None:
        return
    numbers, fields = {solid.index for solid in solids}, hub.fields
    meet = np.zeros(fields.count, np.bool_)
    meet[fields.present] = condition.holds(fields)
    _take_away(hub, np.flatnonzero(meet & np.isin(fields.solid, list(numbers))))


def _take_away(hub: Hub, ids: np.ndarray) -> None:
    if not len(ids):
        hub.warn("no point is chosen: nothing is deleted")
        return
    mass, energy = take_away(hub, ids, hub.mark)
    words = (
        f"{len(ids)} points are deleted, with a mass of {mass:.6g} and an energy of {energy:.6g}"
    )
    hub.console.say(render_message("note", words))


def translate_particles(
    hub: Hub, solids: Solids, by: Literal["region"], region: Region, *shift: Expression | None
) -> None:
    """Move points of a solid before the first run.

    Parameters
    ----------
    solids
        ID of the solid, or ``all``.
    by
        The word ``region``.
    region
        ID of the region whose points move.
    shift
        dx, dy, dz, one per dimension: formulas of x, y and z. NULL leaves a component unchanged.

    Example
    -------
    translate_particles(s1, region, disk, 0.01*sin(2*PI*x), NULL)

    Notes
    -----
    The reference positions change, too. Volumes do not change, except in proportion to the radius
    in axisymmetry. A solid's separate grid is adapted. Groups retain their points.

    See Also
    --------
    delete_particles, solid
    """
    formulas = per_direction(hub, "d", shift)
    if hub.has_run:
        message = "the points have already been in a run"
        expected = "translate_particles before the first run"
        hint = "fix(ID, velocity_particles, ...) moves points in a run"
        raise ScriptError(message, argument="solids", expected=expected, hint=hint, code="too-late")
    for solid in solids:
        inside = region.inside(solid.x0)
        x = solid.x0[inside]
        step = np.zeros_like(solid.x0)
        step[inside] = vector(formulas, hub, x, x)
        _move(hub, solid, step)


def _move(hub: Hub, solid: Solid, step: np.ndarray) -> None:
    moved = chosen_of(solid, np.ones(solid.count, np.bool_))
    x0 = moved.x0 + step
    if not hub.domain.contains(x0).all():
        message = f"points of solid '{solid.id}' would leave the domain"
        expected = "a shift that leaves the points inside the domain"
        raise ScriptError(message, argument="shift", expected=expected)
    if len(step) and (step == step[0]).all():
        lo, hi = moved.lo + step[0], moved.hi + step[0]
    else:
        lo = np.minimum(moved.lo, (x0 - moved.half_size).min(axis=0))
        hi = np.maximum(moved.hi, (x0 + moved.half_size).max(axis=0))
    corners = None if moved.corners is None else moved.corners + step[:, None, :]
    replace_points(hub, solid, moved._replace(x0=x0, lo=lo, hi=hi, corners=corners))


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
        The solid; its material and cell size do not change.
    region
        Points outside this region are omitted.
    lattice
        In 2D ``c1, c2, R, Ndr, Ndtheta, T0``: centre, outer radius, number of rings, points per
        ring, initial temperature. In 3D ``axis, c1, c2, R, lo, hi, Ndx, Ndr, Ndtheta, T0``: the
        word x, y or z, the centre in the other two directions (in the order x, y, z), outer radius,
        ends along the axis, number of slices along it, then as in 2D.

    Example
    -------
    populate_cylindrical_coordinates(s1, disk, 0, 0, 0.3, 6, 24, 0)

    Notes
    -----
    Ring j = 0, 1, ... has the radius ``r = (j + 1/2) dr`` with ``dr = R / Ndr``, and points at the
    angles ``k dtheta`` with ``dtheta = 2 pi / Ndtheta``. Slice i lies at ``lo + (i + 1/2) dx`` with
    ``dx = (hi - lo) / Ndx``. Every point has the volume of its polar cell, ``r dr dtheta dx``.
    Karamelo's rings lie at ``j dr``, with a point in the centre, and its slices at ``lo + i dx``.

    Use this command before the first run and before groups of these points. T0 replaces the initial
    temperature of the solid.

    See Also
    --------
    solid, region
    """
    if hub.has_run:
        message = f"the points of solid '{solid.id}' have been in a run"
        expected = "populate_cylindrical_coordinates before the first run"
        raise ScriptError(message, argument="solid", expected=expected, code="too-late")
    refuse_chosen(hub, solid, "populate_cylindrical_coordinates")
    values = FORMS.read(hub, lattice, hub.require_domain().dimension)
    placed = _polar(values, dict(zip(values, (a.mark for a in lattice), strict=True)))
    if not region.unknown:
        placed = _kept(hub, region, placed)
    T0, solid.T0 = solid.T0, float(values["T0"])
    try:
        replace_points(hub, solid, placed, may_be_empty=region.unknown)
    except ScriptError as error:
        solid.T0 = T0
        error.argument = "region"
        raise


populate_cylindrical_coordinates.syntax = (
    "solidID, regionID[, axis], c1, c2, R[, lo, hi, Ndx], Ndr, Ndtheta, T0"
)


def _polar(values: dict, places: dict) -> Placement:
    """Order points by slice, then ring, then angle."""
    check_radius(values["R"], mark=places["R"])
    counts = [
        _count(values[name], name, places[name]) if name in values else 1
        for name in ("Ndx", "Ndr", "Ndtheta")
    ]
    total = math.prod(counts)
    if total > MAX_POINTS:
        raise ScriptError(
            f"about {total:.3g} points would be needed", expected=f"at most {MAX_POINTS}"
        )
    slices, rings, angles = np.indices(counts).reshape(3, -1)
    dr, dtheta = values["R"] / counts[1], 2 * math.pi / counts[2]
    r, theta = (rings + 0.5) * dr, angles * dtheta
    cosine, sine = np.cos(theta), np.sin(theta)
    # The polar cell is approximated by a rectangle of r dtheta by dr, and its bounding box used.
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
                f"hi = {values['hi']:g} must be above lo = {values['lo']:g}", mark=places["hi"]
            )
        dx = (values["hi"] - values["lo"]) / counts[0]
        columns.insert(axis, values["lo"] + (slices + 0.5) * dx)
        halves.insert(axis, np.full(len(r), dx / 2))
        volume = volume * dx
        lo, hi = np.insert(lo, axis, values["lo"]), np.insert(hi, axis, values["hi"])
    return Placement(np.column_stack(columns), volume, np.column_stack(halves), lo, hi)


def _count(value: float, name: str, mark) -> int:
    if math.isnan(value):
        return 1  # in a rehearsal the value is unknown
    if value < 1 or value != math.floor(value):
        raise ScriptError(f"{name} must be a whole number of at least 1, not {value:g}", mark=mark)
    return int(value)


def _kept(hub: Hub, region: Region, placed: Placement) -> Placement:
    domain = hub.require_domain()
    wanted = region.inside(placed.x0)
    in_domain = domain.contains(placed.x0)
    kept = wanted & in_domain
    used = slice(0, domain.dimension)
    return placed._replace(
        x0=placed.x0[kept],
        volume=np.asarray(placed.volume)[kept],
        half_size=placed.half_size[kept],
        lo=np.maximum(placed.lo, region.lo[used]),
        hi=np.minimum(placed.hi, region.hi[used]),
        outside=int(np.count_nonzero(wanted & ~in_domain)),
    )
