"""Commands that define what acts and what is measured: fix, compute."""

from typing import Any

from karamelo_py.language import registry, signature
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.signature import Argument
from karamelo_py.language.unknown import MEANINGS
from karamelo_py.scene.hub import Catalogue, Hub
from karamelo_py.scene.plugins import check_fix
from karamelo_py.script.errors import ScriptError, instead
from karamelo_py.script.expressions import SEEDS


def fix(hub: Hub, ID: str, style: StyleOf("fix"), *arguments: Argument) -> None:
    """Define something that acts on the run: a support, a load, an initial state.

    Parameters
    ----------
    ID
        Name of the fix. A name that is in use replaces the fix.
    style
        What it does.
    arguments
        What the style asks for, beginning with the group it acts on; see its page.

    Example
    -------
    fix(gravity, body_force, all, 0, -9.81)

    See Also
    --------
    delete_fix, group, compute
    """
    new = _define(hub, hub.fixes, hub.computes, ID, style, arguments)
    check_fix(hub, new)
    new.defined()


def delete_fix(hub: Hub, ID: str) -> None:
    """Remove a fix. Its published values stay as they are.

    Parameters
    ----------
    ID
        Name of the fix.

    Example
    -------
    delete_fix(gravity)

    See Also
    --------
    fix
    """
    hub.fixes.remove(ID)


def compute(hub: Hub, ID: str, style: StyleOf("compute"), *arguments: Argument) -> None:
    """Define something to measure whenever the log is written.

    Parameters
    ----------
    ID
        Name of the compute.
    style
        What it measures.
    arguments
        What the style asks for, beginning with the group it measures; see its page.

    Example
    -------
    compute(Ek, kinetic_energy, all)

    See Also
    --------
    delete_compute, log_modify, fix
    """
    _define(hub, hub.computes, hub.fixes, ID, style, arguments)


def delete_compute(hub: Hub, ID: str) -> None:
    """Remove a compute. Its published values stay as they are.

    Parameters
    ----------
    ID
        Name of the compute.

    Example
    -------
    delete_compute(Ek)

    See Also
    --------
    compute
    """
    hub.computes.remove(ID)


def _define(
    hub: Hub, own: Catalogue, others: Catalogue, ID: str, style: str, arguments: tuple
) -> Any:
    """Make a fix or a compute, and publish its values."""
    kind = own.kind
    _refuse_wrong_order(kind, ID, style, arguments)
    target = registry.called(kind, ID, style)
    if ID in others and set(others[ID].published) & set(target.published):
        raise ScriptError(
            f"'{ID}' is a {others.kind} already (line {others[ID].place.line})",
            argument="ID",
            expected=f"another ID: {ID}_x and the like would mean two things",
        )
    _check_names(hub, kind, ID, target)
    new = signature.call(target, hub, list(arguments), f"{kind} {style}")
    new.style = style
    replaces = own is hub.fixes
    if replaces and ID in own:
        hub.warn(
            f"fix '{ID}' replaces the one of line {own[ID].place.line}",
            hint="fixes that act at the same time need IDs of their own",
        )
    own.add(ID, new, replace=replaces)
    hub.values.publish_vector(ID, new.published)
    group = getattr(new, "group", None)
    if group is not None and not group.all and len(group) == 0:
        hub.warn(f"{kind} '{ID}' acts on the empty group '{group.id}': it will do nothing")
    return new


def _refuse_wrong_order(kind: str, ID: str, style: str, arguments: tuple[Argument, ...]) -> None:
    """Tell of a style behind the group, as in LAMMPS."""
    if registry.knows(kind, style) or registry.knows(kind, ID):
        return
    third = arguments[0].word() if arguments else None
    if third and registry.knows(kind, third):
        raise ScriptError(
            f"'{third}' is a style, and the style comes before the group",
            place=arguments[0].place,
            expected=f"{kind}({ID}, {third}, {style}, ...)",
        )
    if third and instead(kind, third):
        registry.find(kind, third)  # says what to write in its place


def _check_names(hub: Hub, kind: str, ID: str, style: type) -> None:
    """A value that is published must not hide what a name means already."""
    for suffix in style.published:
        name = f"{ID}_{suffix}" if suffix else ID
        if name in MEANINGS or name in SEEDS:
            raise ScriptError(
                f"{kind} '{ID}' would publish its value as '{name}', which is "
                + MEANINGS.get(name, "a coordinate of points"),
                argument="ID",
                expected="an ID that means nothing else",
                hint=f"choose another ID, such as {ID}_1",
            )
        if name in (getattr(hub.interpreter, "variables", None) or {}):
            hub.warn(
                f"{kind} '{ID}' publishes its value as '{name}', which is a variable, too: "
                "formulas will use the variable",
                hint=f"choose another ID, such as {ID}_1",
            )
