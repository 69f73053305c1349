"""Commands fix, compute, and functions of groups."""

from typing import Annotated, Any, Literal

from karamelo_py.language import registry, signature
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.signature import Argument
from karamelo_py.language.unknown import MEANINGS
from karamelo_py.scene.group import AnyGroup, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.plugins import check_fix
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import SEEDS, Expression
from karamelo_py.styles.computes.means import CenterOfMass
from karamelo_py.styles.fixes.measuring import Measuring


def fix(hub: Hub, ID: str, style: Annotated[str, StyleOf("fix")], *arguments: Argument) -> None:
    """Define a support, a load or an initial state.

    Parameters
    ----------
    ID
        Name of the fix; a fix with the same name is replaced.
    style
        The kind of support, load or initial state.
    arguments
        The group on which the fix acts, then the arguments of the style (see its page).

    Example
    -------
    fix(gravity, body_force, all, 0, -9.81)

    See Also
    --------
    delete_fix, group, compute
    """
    new = _define(hub, "fix", ID, style, arguments)
    if registry.is_foreign(type(new)):
        check_fix(hub, new)
    new.defined()


def delete_fix(hub: Hub, ID: str) -> None:
    """Remove a fix. The published values of the fix stay available.

    Example
    -------
    delete_fix(gravity)

    See Also
    --------
    fix
    """
    hub.fixes[ID].deleted()
    hub.fixes.remove(ID)


def compute(
    hub: Hub, ID: str, style: Annotated[str, StyleOf("compute")], *arguments: Argument
) -> None:
    """Define a quantity to measure whenever the log is written.

    Parameters
    ----------
    style
        The quantity to measure.
    arguments
        The group that is measured, then the arguments of the style (see its page).

    Example
    -------
    compute(Ek, kinetic_energy, all)

    See Also
    --------
    delete_compute, log_modify, fix
    """
    _define(hub, "compute", ID, style, arguments)


def delete_compute(hub: Hub, ID: str) -> None:
    """Remove a compute. The published values of the compute stay available.

    Example
    -------
    delete_compute(Ek)

    See Also
    --------
    compute
    """
    hub.computes.remove(ID)


def _define(hub: Hub, kind: str, ID: str, style: str, arguments: tuple) -> Any:
    catalogue, others = (hub.fixes, hub.computes) if kind == "fix" else (hub.computes, hub.fixes)
    third = (arguments[0].word() if arguments else None) or ""
    with signature.in_new_words(kind, ID, style, arguments):
        target = registry.called(kind, ID, style, third)
    other = others[ID].published if ID in others else ()
    if set(other) & set(target.published):
        message = f"'{ID}' is a {others.kind} already (line {others[ID].mark.line})"
        expected = f"another ID: {ID}_x and similar names would be ambiguous"
        raise ScriptError(message, argument="ID", expected=expected)
    catalogue.refuse_unnameable(ID)
    _check_names(hub, kind, ID, target)
    if kind == "fix" and target.reads_itself and ID not in catalogue:
        hub.values.publish_vector(ID, target.published, *other)
    new = signature.call(target, hub, list(arguments), f"{kind} {style}")
    new.style = style
    if kind == "fix" and new.by_sizes and hub.domain.thickness != 1:
        raise ScriptError(
            "it computes sizes of points from their volumes, which contain the thickness",
            expected="plane_stress(true) with the thickness 1, and loads per thickness",
        )
    replaces = catalogue is hub.fixes
    if replaces and ID in catalogue and not (new.moves or new.touches):
        hub.warn(
            f"fix '{ID}' replaces the one of line {catalogue[ID].mark.line}",
            hint="fixes that act at the same time need different IDs",
        )
    catalogue.add(ID, new, replace=replaces)
    hub.asked.update(new.columns)
    hub.values.publish_vector(ID, new.published, *other)
    group = new.group
    if group is not None and not group.all and len(group) == 0:
        hub.warn(f"{kind} '{ID}' acts on the empty group '{group.id}': it will do nothing")
    return new


def _check_names(hub: Hub, kind: str, ID: str, style: type) -> None:
    for suffix in style.published:
        name = f"{ID}_{suffix}" if suffix else ID
        if name in MEANINGS or name in SEEDS:
            raise ScriptError(
                f"'{ID}' would publish its value as '{name}', which is "
                + MEANINGS.get(name, "a coordinate of points"),
                argument="ID",
                expected="an ID whose published names are not in use",
                hint=f"choose another ID, such as {ID}_1",
            )
        if name in hub.interpreter.variables:
            hub.warn(
                f"{kind} '{ID}' publishes its value as '{name}', which is a variable, too: "
                "formulas will use the variable",
                hint=f"choose another ID, such as {ID}_1",
            )


Direction = Literal["x", "y", "z"]


def xcm(hub: Hub, group: AnyGroup, direction: Direction) -> Expression:
    """Return the centre of mass of a group, evaluated again whenever it is used.

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
    The value is updated when the log is written or a condition uses it.

    See Also
    --------
    internal_force, external_force, compute center_of_mass
    """
    ID = f"xcm({group.id})"
    if ID not in hub.computes:
        _file(hub, hub.computes, ID, CenterOfMass(hub, group), "center_of_mass")
    return _component(hub, Expression.seed(f"{ID}_{direction}"), direction)


def internal_force(hub: Hub, group: AnyGroup, direction: Direction) -> Expression:
    """Return the internal force of a group, evaluated again whenever it is used.

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
    For nodes, the value is the sum of the forces due to the stress of points and to fixes on points
    (contact, tools, tractions). At held nodes, the value is the negative reaction, if accelerations
    are small. For points, it is the rate of change of their momentum in the last step, sum m a.
    Before the first step, the value is 0.

    See Also
    --------
    external_force, xcm, compute reaction
    """
    if isinstance(group, ParticleGroup):
        before = _total(hub, "momentum_before", group, direction)
        after = _total(hub, "momentum_after", group, direction)
        return _component(hub, after.minus(before), direction)
    force = _total(hub, "internal_force", group, direction)
    return _component(hub, force, direction)


def external_force(hub: Hub, group: AnyGroup, direction: Direction) -> Expression:
    """Return the force that fixes apply to a group, evaluated again whenever it is used.

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
    For nodes, the value is the force of fixes on nodes, such as body_force and force_nodes; for
    points, it is the force of fixes on points (contact, tools, tractions). Reactions of prescribed
    velocities are not included; their fixes publish them. Before the first step, the value is 0.
    (Karamelo returns internal forces.)

    See Also
    --------
    internal_force, xcm, fix body_force
    """
    if isinstance(group, ParticleGroup):
        force = _total(hub, "external_force", group, direction)
        return _component(hub, force, direction)
    total = _total(hub, "force", group, direction)
    inner = _total(hub, "internal_force", group, direction)
    return _component(hub, total.minus(inner), direction)


def _total(hub: Hub, name: str, group: AnyGroup, direction: str) -> Expression:
    ID = f"{name}({group.id})"
    if ID not in hub.fixes:
        _file(hub, hub.fixes, ID, Measuring(hub, group, name), name)
    return Expression.seed(f"{ID}_{direction}")


def _file(hub: Hub, catalogue: Any, ID: str, item: Any, style: str) -> None:
    item.style = style
    catalogue.add(ID, item)
    hub.values.publish_vector(ID, item.published)


def _component(hub: Hub, formula: Expression, direction: str) -> Expression:
    d = hub.require_domain().dimension
    return Expression(formula if "xyz".index(direction) < d else 0.0)
