"""Commands that fill the scene: solid and group."""

import copy
from collections.abc import Sequence
from typing import Literal

from karamelo_py.language import registry, signature
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.signature import Argument
from karamelo_py.language.unknown import SHAPES, filled, in_own_words
from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.group import ALL, KINDS, NOTHING_THERE
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.region import Region
from karamelo_py.scene.solid import Solid, own_grids, warn_of_coinciding
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.parser import parse_text


def solid(hub: Hub, ID: str, kind: StyleOf("solid"), *arguments: Argument) -> None:
    """Make a body of material points: fill a region with them, or put them into a mesh.

    Parameters
    ----------
    ID
        Name of the solid.
    kind
        Where the points come from.
    arguments
        What the style asks for, see the page of the style. For ``region``:
        ``regionID, ppc, material, h[, T0]``, the region to fill, the points per cell in each
        direction, the material, the cell size (that of the domain), and the initial temperature
        (that of the material when left out). For ``mesh``: ``file, material, h[, T0]``.

    Example
    -------
    solid(s1, region, disk, 2, steel, 0.05, 0)

    Notes
    -----
    The method, the domain, the region and the material come before.

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
    require_domain(hub)
    hub.solids.refuse(ID)
    if not registry.knows("solid", kind):
        # The forms of 2020: solid(ID, regionID, ppc, ...) and solid(ID, cylinder, regionID, ...).
        if kind in hub.regions:
            arguments = (Argument(parse_text(kind)[0], hub.interpreter), *arguments)
            kind = "region"
        elif kind in SHAPES and arguments and arguments[0].word() in hub.regions:
            _refuse_counts(hub, ID, arguments)
            kind = "region"
        elif hint := filled(hub.interpreter.statement):
            raise ScriptError(
                f"unknown solid style '{kind}'",
                argument="kind",
                expected="one of " + ", ".join(registry.names("solid")),
                hint=hint,
            )
    target = registry.called("solid", ID, kind)
    new = signature.call(target, hub, list(arguments), f"solid {kind}")
    warn_of_coinciding(hub, new, ID)
    hub.solids.add(ID, new)
    hub.update.method.welcome(hub, new)


solid.syntax = "ID, region, regionID, ppc, material, h[, T0] | ID, mesh, file, material, h[, T0]"


def _refuse_counts(hub: Hub, ID: str, arguments: Sequence[Argument]) -> None:
    """Tell of the form that gave the number of points along each direction of a region."""
    region, *counts, material, h = (argument.text for argument in arguments)
    if len(counts) == hub.domain.dimension > 1:
        raise ScriptError(
            f"{', '.join(counts)} points along the sides: points are counted in a cell here",
            place=arguments[1].place,
            expected=solid.syntax,
            hint=f"solid({ID}, region, {region}, 1, {material}, {h}), or more than 1 in each "
            "direction of a cell",
        )


def group(
    hub: Hub,
    ID: str,
    kind: Literal["particles", "nodes"],
    by: Literal["region"],
    region: Region,
    of: Literal["all", "solid"],
    *solids: Solid,
) -> None:
    """Name a set of points or of nodes.

    Which points belong to it is decided here, once, by their reference positions. Nodes belong to
    it by their positions; where solids have nodes of their own, those of solids that are made
    later do, too, unless solids are named. The group ``all`` of everything is always there.

    Parameters
    ----------
    ID
        Name of the group. A name that is in use gets the new members, too.
    kind
        ``particles`` or ``nodes``.
    by
        The word ``region``.
    region
        ID of the region, which says who belongs.
    of
        ``all``, or ``solid`` followed by the IDs of the solids whose points may belong.
    solids
        IDs of solids. Where these share one grid, for nodes it makes no difference which are
        named.

    Example
    -------
    group(left, nodes, region, wall, all)
    group(impactor, particles, region, box, solid, s1)

    See Also
    --------
    region, fix, compute
    """
    if ID == ALL:
        raise ScriptError(
            "'all' is the group of everything and cannot be changed",
            argument="ID",
            expected="another name",
        )
    if of == "solid" and not solids:
        raise ScriptError(
            "no solid is named",
            argument="of",
            expected=f"group({ID}, {kind}, region, {region.id}, solid, solidID, ...)",
        )
    if of == "all" and solids:
        raise ScriptError(
            "nothing can follow 'all'",
            argument="solids",
            expected=f"group({ID}, {kind}, region, {region.id}, all)",
        )
    if ID in hub.groups:
        members = hub.groups[ID]
        if members.kind != kind:
            raise ScriptError(
                f"group '{ID}' is a group of {members.kind}",
                argument="kind",
                expected=f"{members.kind}, or another ID",
            )
        if hub.rehearsing:  # The real group gets its members when the script comes here.
            members = copy.copy(members)
    else:
        members = hub.groups.add(ID, KINDS[kind](hub))
    found = members.add(region, solids or None)
    if found or region.unknown:
        return
    if kind == "nodes" and not solids and own_grids(hub):
        members.awaits_solids = True  # the run tells when none came
    else:
        none_yet = kind == "particles" and not hub.solids
        hub.warn(
            f"group '{ID}': region '{region.id}' holds no {kind}; {NOTHING_THERE}",
            hint="no solid is made yet: groups of particles come after the solids"
            if none_yet
            else None,
        )


group.syntax = "ID, particles|nodes, region, regionID, all | solid, solidID, ..."
