"""Functions of groups in expressions: centre of mass and forces, as Karamelo calls them."""

from typing import Any, Literal

from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.group import AnyGroup, Group, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.computes.center_of_mass import CenterOfMass
from karamelo_py.styles.fixes import measuring

Direction = Literal["x", "y", "z"]


def xcm(hub: Hub, group: AnyGroup, direction: Direction) -> Expression:
    """Give the centre of mass of a group, as a formula that follows it.

    Parameters
    ----------
    group
        Group of points or of nodes, or ``all`` points.
    direction
        x, y or z.

    Example
    -------
    height = xcm(body, y)
    log_modify(custom, time, height, xcm(body, x))

    Notes
    -----
    It is measured when the log is written and where a condition asks for it, as a compute is.

    See Also
    --------
    internal_force, external_force, compute center_of_mass
    """
    ID = f"xcm({group.id})"
    if ID not in hub.computes:
        _file(hub, hub.computes, ID, CenterOfMass(hub, group), "center_of_mass")
    return _component(hub, Expression.seed(f"{ID}_{direction}"), direction)


def internal_force(hub: Hub, group: AnyGroup, direction: Direction) -> Expression:
    """Give the force that acts in a group, as a formula that follows it.

    Parameters
    ----------
    group
        Group of points or of nodes, or ``all`` points.
    direction
        x, y or z.

    Example
    -------
    pull = internal_force(grip, y)
    log_modify(custom, time, pull)

    Notes
    -----
    Of nodes: the sum of what points bring to them, which is the divergence of stress and what
    fixes put on the points (contact, tools, tractions). At nodes that are held and hardly
    accelerate it is the opposite of the reaction. Of points: the rate of their momentum in the
    last step, sum m a. Before the first step it is 0.

    See Also
    --------
    external_force, xcm, compute reaction
    """
    if isinstance(group, ParticleGroup):
        before = _total(hub, "momentum_before", measuring.MomentumBefore, group, direction)
        after = _total(hub, "momentum_after", measuring.MomentumAfter, group, direction)
        return _component(hub, after.minus(before), direction)
    force = _total(hub, "internal_force", measuring.ForceBeforeFixes, group, direction)
    return _component(hub, force, direction)


def external_force(hub: Hub, group: AnyGroup, direction: Direction) -> Expression:
    """Give the force that fixes apply to a group, as a formula that follows it.

    Parameters
    ----------
    group
        Group of points or of nodes, or ``all`` points.
    direction
        x, y or z.

    Example
    -------
    weight = external_force(nodes, y)
    log_modify(custom, time, weight)

    Notes
    -----
    Of nodes: what fixes such as body_force and force_nodes add to the force of the nodes. Of
    points: what fixes put on the points (contact, tools, tractions). Velocities that are
    prescribed are no forces: the fixes publish their reactions. Before the first step it is 0.
    Karamelo gives the internal force here.

    See Also
    --------
    internal_force, xcm, fix body_force
    """
    if isinstance(group, ParticleGroup):
        force = _total(hub, "external_force", measuring.PointForce, group, direction)
        return _component(hub, force, direction)
    total = _total(hub, "force", measuring.TotalForce, group, direction)
    inner = _total(hub, "internal_force", measuring.ForceBeforeFixes, group, direction)
    return _component(hub, total.minus(inner), direction)


def _total(hub: Hub, name: str, style: type, group: Group, direction: str) -> Expression:
    """The value of the fix that measures it, which is made when first asked for."""
    ID = f"{name}({group.id})"
    if ID not in hub.fixes:
        others = dict(hub.fixes)
        if style.comes_first:
            hub.fixes.clear()
        _file(hub, hub.fixes, ID, style(hub, group), name)
        hub.fixes.update(others)
    return Expression.seed(f"{ID}_{direction}")


def _file(hub: Hub, catalogue: Any, ID: str, item: Any, style: str) -> None:
    item.style = style
    catalogue.add(ID, item)
    hub.values.publish_vector(ID, item.published)


def _component(hub: Hub, formula: Expression, direction: str) -> Expression:
    """`formula`, or 0 in a direction that the domain does not have."""
    d = require_domain(hub).dimension
    return Expression(formula if "xyz".index(direction) < d else 0.0)
