"""Commands dimension, boundary, region, solid, group."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from karamelo_py.commands.thin import refuse_late
from karamelo_py.kernels.equations.periodic import InUse
from karamelo_py.language import registry
from karamelo_py.language.by_dimension import Forms, number
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.signature import Argument, style_of
from karamelo_py.language.unknown import SHAPES, filled, in_own_words
from karamelo_py.scene.domain import Domain, require_grid
from karamelo_py.scene.group import ALL, KINDS, NOTHING_THERE
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import RELATIVE_TOLERANCE
from karamelo_py.scene.region import Region
from karamelo_py.scene.solid import Solid, own_grids, warn_of_coinciding
from karamelo_py.script.errors import ScriptError, meant
from karamelo_py.script.parser import parse_text
from karamelo_py.styles.meshes import MeshFile, near_set

_BOUNDS = ("xmin", "xmax", "ymin", "ymax", "zmin", "zmax")
_WITH_H = {d: (*_BOUNDS[: 2 * d], "h") for d in (1, 2, 3)}
DIMENSION = Forms("dimension({dimension}, {names})", _WITH_H)
CREATE_DOMAIN = Forms("create_domain({names})", _WITH_H)
CREATE_DOMAIN_WITHOUT_H = Forms(
    "create_domain({names}[, h])", {d: _BOUNDS[: 2 * d] for d in (1, 2, 3)}
)


def dimension(hub: Hub, dimensions: Argument, *bounds: Argument) -> None:
    """Set the number of dimensions, the domain and the cell size of its grid.

    A point that leaves the domain ends the run (see boundary). Strain is uniaxial in 1D and plane
    (unit thickness) in 2D. The grid starts at the lower corner. If a side is not a multiple of the
    cell size, the last nodes, and a wall at them, lie outside the domain.

    Parameters
    ----------
    dimensions
        1, 2 or 3.
    bounds
        ``xmin, xmax, h`` in 1D; ``xmin, xmax, ymin, ymax, h`` in 2D; ``xmin, xmax, ymin, ymax,
        zmin, zmax, h`` in 3D; h is the cell size. Omit them in scripts with create_domain.

    Example
    -------
    dimension(2, -0.5, 0.5, -0.5, 0.5, 0.05)

    Notes
    -----
    Use this command once, before regions and solids.

    See Also
    --------
    region, create_domain
    """
    _refuse_second(hub)
    count = number(hub, dimensions, "the number of dimensions")
    if count not in DIMENSION.names:
        message = f"the number of dimensions must be 1, 2 or 3, not {count:g}"
        expected = " or ".join(DIMENSION.line(d) for d in DIMENSION.names)
        raise ScriptError(message, mark=dimensions.mark, expected=expected)
    if bounds:
        hub.domain = _domain(hub, DIMENSION, bounds, int(count))
    else:
        hub.announced_dimension = int(count)


dimension.syntax = "1|2|3, xmin, xmax[, ymin, ymax[, zmin, zmax]], h"


def create_domain(hub: Hub, *bounds: Argument) -> None:
    """Set the domain (older form; see dimension).

    Parameters
    ----------
    bounds
        ``xmin, xmax``, then ``ymin, ymax`` and ``zmin, zmax`` in 2D and 3D; optionally the cell
        size h. Without h, the cell size of the first solid is used.

    Example
    -------
    dimension(2)
    create_domain(-0.5, 0.5, -0.5, 0.5, 0.05)

    Notes
    -----
    Without an earlier ``dimension(1|2|3)``, the number of arguments sets the number of dimensions.

    See Also
    --------
    dimension
    """
    _refuse_second(hub)
    count = min(max(hub.announced_dimension or len(bounds) // 2, 1), 3)
    forms = CREATE_DOMAIN_WITHOUT_H if len(bounds) == 2 * count else CREATE_DOMAIN
    hub.domain = _domain(hub, forms, bounds, count)


create_domain.syntax = "xmin, xmax[, ymin, ymax[, zmin, zmax]][, h]"


def boundary(
    hub: Hub,
    style: Literal["error", "delete", "reflect", "periodic"],
    *directions: Literal["x", "y", "z"],
    shear: float = 0.0,
) -> None:
    """Set what happens to points that reach the edge of the domain.

    Parameters
    ----------
    style
        ``error`` (the default): the run ends with an explanation. ``delete``: the point is removed,
        with its mass and momentum. ``reflect``: the point is mirrored back inside, and its normal
        velocity reversed. ``periodic``: the point returns at the other end.
    directions
        The periodic directions (``periodic`` only).
    shear
        Prescribed velocity gradient dvx/dy, if x and y are periodic (Lees & Edwards 1972).

    Example
    -------
    boundary(delete)
    boundary(periodic, x)
    boundary(periodic, x, y, shear=0.1)

    Notes
    -----
    ``delete`` and ``reflect`` are for splashes; for a body against a wall, use fix velocity_nodes.
    A warning names the first point deleted or reflected; the end of the run gives their number.

    A point is deleted before the step in which it would leave: the run returns to its last stored
    state, at most a hundred steps earlier, and repeats these steps, with their Python hooks. If
    points leave in every step, the run takes about six times as long.

    A reflected point retains its stress and tangential velocity. If a whole body hits the edge, it
    loses most of its normal velocity.

    In a periodic direction, bodies at opposite ends of the domain are in contact. The length of the
    domain must be a multiple of the cell size, and formulas that fixes evaluate at nodes should be
    periodic. Points return to the domain every 10 steps. Dumps may show them outside before, and
    compute center_of_mass jumps when they return. Periodic directions need method ulmpm with a
    linear basis or splines, scheme musl, any transfer except XPIC, and one process without a GPU.
    Periodic directions cannot be combined with other styles of boundary, axisymmetry, heat, contact
    of points, tools that end in a periodic direction or free rigid bodies.

    With `shear`, bodies should fill the domain and start with the mean velocity vx = `shear` y (fix
    initial_velocity_particles), without F-bar or pore_water. Momentum is conserved to round-off.
    The energy balance is not monitored.

    In tlmpm and tlcpdi, the command has no effect: the separate grids of solids have no edge.

    See Also
    --------
    dimension, fix velocity_nodes
    """
    if style == "periodic":
        set_periodic(hub, ["xyz".index(name) for name in directions], shear)
        return
    if shear:
        raise ScriptError(f"boundary({style}) has no shear", argument="shear", expected="periodic")
    if directions:
        message = f"boundary({style}) applies to all directions"
        raise ScriptError(message, argument="directions", expected=f"boundary({style})")
    hub.update.boundary = style
    hub.update.boundary_mark = hub.mark


def set_periodic(hub: Hub, directions: list[int], shear: float) -> None:
    domain = require_grid(hub)
    h = domain.lattice.h
    if not directions or max(directions) >= domain.dimension:
        raise ScriptError(
            "the scene has no such direction" if directions else "no direction is named",
            argument="directions" if directions else "style",
            expected=f"boundary(periodic, {', '.join('xyz'[: domain.dimension])}), or some of them",
        )
    for k in directions:
        length = domain.hi[k] - domain.lo[k]
        if abs(domain.cells_of_period(k) * h - length) > 1e-6 * h:
            raise ScriptError(
                f"the length of the domain, {length:g}, is not a multiple of the cells ({h:g})",
                argument="directions",
                expected="dimension(...) with whole cells in periodic directions",
            )
    if hub.solids:
        raise ScriptError(
            "the scene already has solids",
            argument="style",
            expected="boundary(periodic, ...) after dimension and before the first solid",
            code="too-late",
        )
    if shear and not {0, 1} <= {*directions}:
        message = "a sheared cell is periodic in x and y"
        raise ScriptError(message, argument="shear", expected="boundary(periodic, x, y, shear=...)")
    domain.shear = shear
    domain.periodic, domain.node_fields = tuple(sorted(set(directions))), (InUse,)


registry.may_differ(boundary)  # a run that points have left can be resumed with boundary(delete)


def region(
    hub: Hub, ID: str, style: Annotated[str, StyleOf("region")], *arguments: Argument
) -> None:
    """Name a part of the domain, to fill with a solid or to select the members of a group.

    Parameters
    ----------
    style
        The shape, or how other regions are combined.

    Example
    -------
    region(disk, cylinder, -0.3, -0.3, 0.2)

    Notes
    -----
    A region includes its surface. With ``exterior`` as the last argument, block, cylinder and
    sphere include everything outside the shape.

    See Also
    --------
    dimension, group, solid
    """
    hub.require_domain()
    hub.regions.add(ID, style_of(hub, "region", ID, style, arguments))


def _refuse_second(hub: Hub) -> None:
    if hub.domain is None:
        return
    if hub.solids:
        first = next(iter(hub.solids))
        raise ScriptError(
            f"the domain cannot change once solid '{first}' is in it",
            expected="the domain before all regions, solids and groups",
            code="too-late",
        )
    expected = "one dimension(...) or create_domain(...) in a scene"
    raise ScriptError("the domain is already set", expected=expected, code="too-late")


def _domain(hub: Hub, forms: Forms, bounds: tuple[Argument, ...], count: int) -> Domain:
    values = forms.read(hub, bounds, count)
    places = {name: argument.mark for name, argument in zip(values, bounds, strict=True)}
    names = _BOUNDS[0 : 2 * count : 2], _BOUNDS[1 : 2 * count : 2]
    lo, hi = ([float(values[name]) for name in ends] for ends in names)
    for low, high, a, b in zip(*names, lo, hi, strict=True):
        if b <= a:
            message = f"{high} = {b:g} must be above {low} = {a:g}"
            raise ScriptError(message, mark=places[high], expected=forms.line(count))
    h = float(values["h"]) if "h" in values else None
    if h is not None and h <= 0:
        message = f"the cell size h = {h:g} must be above 0"
        raise ScriptError(message, mark=places["h"], expected=forms.line(count))
    try:
        domain = Domain(count, lo, hi, h)
    except ScriptError as error:
        error.argument, error.mark = None, places.get("h")
        raise
    domain.mark = hub.mark
    longest = max(b - a for a, b in zip(lo, hi, strict=True))
    # A domain may be a single cell, for an element test.
    if h is not None and h > longest * (1 + RELATIVE_TOLERANCE) and not own_grids(hub):
        hub.warn(
            f"cells of {h:g} are larger than the domain, whose longest side is {longest:g}: the "
            "grid is one cell, and its nodes at the upper ends lie outside",
            mark=places["h"],
            hint="smaller cells, or the same unit of length for both",
        )
    return domain


def solid(hub: Hub, ID: str, kind: Annotated[str, StyleOf("solid")], *arguments: Argument) -> None:
    """Create a body of material points from a region or a mesh.

    Parameters
    ----------
    kind
        Source of the points.
    arguments
        For ``region``: ``regionID, ppc, material, h[, T0]``: the region, the points per cell in
        each direction, the material, the cell size, and the initial temperature (default: the
        material's). For ``mesh``: ``file, material, h[, T0]``. For other styles, see their pages.

    Example
    -------
    solid(s1, region, disk, 2, steel, 0.05, 0)

    Notes
    -----
    The method, domain, region and material must be defined before the solid.

    See Also
    --------
    region, material, dimension, group
    """
    if hub.update.method is None:
        raise ScriptError(
            "there is no method yet",
            expected="method(...) before the first solid, such as method(ulmpm, FLIP, linear, 1)",
            hint=in_own_words(hub.interpreter, "method_modify"),
        )
    hub.require_domain()
    hub.solids.refuse(ID)
    refuse_late(hub)
    if not registry.knows("solid", kind):
        # In scripts of 2020: solid(ID, regionID, ppc, ...) and solid(ID, cylinder, regionID, ...).
        if kind in hub.regions:
            arguments = (Argument(parse_text(kind)[0], hub.interpreter), *arguments)
            kind = "region"
        elif kind in SHAPES and arguments and arguments[0].word() in hub.regions:
            _refuse_counts(hub, ID, arguments)
            kind = "region"
        elif hint := filled(hub.interpreter.statement):
            message = f"unknown solid style '{kind}'"
            expected = "one of " + ", ".join(registry.names("solid"))
            raise ScriptError(message, argument="kind", expected=expected, hint=hint)
    new = style_of(hub, "solid", ID, kind, arguments)
    warn_of_coinciding(hub, new, ID)
    hub.solids.add(ID, new)
    hub.update.method.welcome(hub, new)


solid.syntax = "ID, region, regionID, ppc, material, h[, T0] | ID, mesh, file, material, h[, T0]"


def _refuse_counts(hub: Hub, ID: str, arguments: Sequence[Argument]) -> None:
    region, *counts, material, h = (argument.text for argument in arguments)
    if len(counts) == hub.domain.dimension > 1:
        raise ScriptError(
            f"{', '.join(counts)} points along the sides: here ppc counts points in a cell",
            mark=arguments[1].mark,
            expected=solid.syntax,
            hint=f"solid({ID}, region, {region}, 1, {material}, {h}), or more than 1 in each "
            "direction of a cell",
        )


class RegionOrFile:
    script_kind = "the ID of a region, or the name of a mesh file"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Region | Path:
        name = argument.word() or argument.text.strip("\"'")
        is_file = name not in hub.regions and Path(name).suffix.lower() in MeshFile.endings
        return (MeshFile if is_file else Region).from_script(hub, argument)


def group(
    hub: Hub,
    ID: str,
    kind: Literal["particles", "nodes"],
    by: Literal["region", "mesh"],
    region: Annotated[Region | Path, RegionOrFile],
    of: Literal["all", "solid"] | str | int,
    *solids: Solid,
) -> None:
    """Name a set of points or of nodes.

    Points are selected by their reference positions. Unless `solids` are named, a group of nodes
    also includes nodes of the separate grids of solids defined later. A set of a mesh (faces, edges
    or nodes) selects points or nodes within half a cell of it. The group ``all`` always exists.

    Parameters
    ----------
    ID
        Name of the group; if it exists, members are added to it.
    kind
        ``particles`` or ``nodes``.
    by
        ``region`` or ``mesh``.
    region
        ID of the region that selects the members, or name of the mesh file.
    of
        ``all``, or ``solid`` followed by IDs of solids. For a mesh: name or number of a set in it,
        as in region mesh.
    solids
        Select only points of these solids, or nodes of their grids.

    Example
    -------
    group(left, nodes, region, wall, all)
    group(impactor, particles, region, box, solid, s1)
    group(base, nodes, mesh, deck.inp, BASE)

    See Also
    --------
    region, fix, compute
    """
    if ID == ALL:
        message, expected = "'all' is the group of everything and cannot be changed", "another name"
        raise ScriptError(message, argument="ID", expected=expected)
    if isinstance(region, Region) != (by == "region"):
        expected = "the ID of a region" if by == "region" else "the name of a mesh file"
        raise ScriptError(f"no {by} follows", argument="region", expected=expected)
    if not isinstance(region, Region):
        if solids:
            raise ScriptError("nothing can follow the set of a mesh", argument="solids")
        region, of = near_set(hub, ID, region, of), "all"
    form = f"group({ID}, {kind}, region, {region.id}"
    if of not in ("all", "solid"):
        message, hint = (
            f"'of' must be one of all, solid, not '{of}'",
            meant(str(of), (ALL, "solid")),
        )
        raise ScriptError(message, argument="of", expected="one of all, solid", hint=hint)
    if of == "solid" and not solids:
        expected = f"{form}, solid, solidID, ...)"
        raise ScriptError("no solid is named", argument="of", expected=expected)
    if of == "all" and solids:
        raise ScriptError("nothing can follow 'all'", argument="solids", expected=f"{form}, all)")
    if ID in hub.groups:
        members = hub.groups[ID]
        if members.kind != kind:
            raise ScriptError(
                f"group '{ID}' is a group of {members.kind}",
                argument="kind",
                expected=f"{members.kind}, or another ID",
            )
    else:
        members = hub.groups.add(ID, KINDS[kind](hub))
    count = members.add(region, solids or None)
    if count or region.unknown:
        return
    if kind == "nodes" and not solids and own_grids(hub):
        members.awaits_solids = True  # the run warns if the group is then still empty
    else:
        none_yet = "no solid is made yet: groups of particles come after the solids"
        hub.warn(
            f"group '{ID}': region '{region.id}' holds no {kind}; {NOTHING_THERE}",
            hint=none_yet if kind == "particles" and not hub.solids else None,
        )


group.syntax = (
    "ID, particles|nodes, region, regionID, all | solid, solidID, ... | mesh, file, set of the file"
)
