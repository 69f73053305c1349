"""Replace the points of a solid before the first run."""

import numpy as np

from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.placement import Placement
from karamelo_py.scene.solid import Solid, warn_of_coinciding
from karamelo_py.script.errors import ScriptError


def chosen_of(solid: Solid, kept: np.ndarray) -> Placement:
    """Return the placement of selected points; `kept` is a mask, or numbers that may repeat."""
    volume = solid.volume0 / solid.domain.depth(solid.x0[:])
    return Placement(
        x0=solid.x0[kept],
        volume=volume[kept],
        half_size=solid.half_size[kept],
        lo=solid.lo,
        hi=solid.hi,
        shape=solid.shape,
        corners=None if solid.corners is None else solid.corners[kept],
    )


def refuse_chosen(hub: Hub, solid: Solid, command: str) -> None:
    """Raise ScriptError if groups or contacts have stored point numbers that would change."""
    later = [one for one in hub.solids.values() if one.index >= solid.index]
    affected = [("fix", "made for", fix) for fix in hub.fixes.values() if fix.point_fields]
    for group in hub.groups.values():
        if isinstance(group, ParticleGroup) and any(map(group.touches, later)):
            affected.append(("group", "chosen from", group))
    if len(hub.waiting) and np.isin(hub.waiting - solid.first_id, np.arange(solid.count)).any():
        message = f"{command} would renumber points that are inactive"
        expected = f"{command} before deactivate and fix inflow"
        raise ScriptError(message, argument="solid", expected=expected)
    if affected:
        kind, made, item = affected[0]
        message = f"{kind} '{item.id}' was {made} points that would be replaced or renumbered"
        expected = f"{kind}({item.id}, ...) after {command}"
        raise ScriptError(message, argument="solid", expected=expected)


def replace_points(
    hub: Hub, solid: Solid, placement: Placement, *, may_be_empty: bool = False
) -> None:
    before = solid.count
    solid.put(hub, placement, may_be_empty=may_be_empty)
    behind = hub.waiting >= solid.first_id + before
    hub.waiting = hub.waiting + (solid.count - before) * behind
    for other in hub.solids.values():
        if other.index > solid.index:
            other.first_id += solid.count - before
    hub.forget_simulation()
    warn_of_coinciding(hub, solid, solid.id)
