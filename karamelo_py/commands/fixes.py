"""Commands that define what acts and what is measured: fix, compute."""

from karamelo_py.language import registry, signature
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.signature import Argument
from karamelo_py.language.unknown import MEANINGS
from karamelo_py.scene.hub import Catalogue, Hub
from karamelo_py.scene.plugins import check_fix
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import SEEDS
from karamelo_py.script.other_programs import instead


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
    _refuse_wrong_order("fix", ID, style, arguments)
    target = registry.called("fix", ID, style)
    _refuse_shared_id(ID, target, "compute", hub.computes)
    _check_names(hub, "fix", ID, target)
    new = signature.call(target, hub, list(arguments), f"fix {style}")
    new.style = style
    if ID in hub.fixes:
        hub.warn(
            f"fix '{ID}' replaces the one of line {hub.fixes[ID].place.line}",
            hint="fixes that act at the same time need IDs of their own",
        )
    hub.fixes.add(ID, new, replace=True)
    hub.values.publish_vector(ID, new.published)
    _warn_if_empty(hub, "fix", ID, new)
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
    _refuse_wrong_order("compute", ID, style, arguments)
    target = registry.called("compute", ID, style)
    _refuse_shared_id(ID, target, "fix", hub.fixes)
    _check_names(hub, "compute", ID, target)
    new = signature.call(target, hub, list(arguments), f"compute {style}")
    new.style = style
    hub.computes.add(ID, new)
    hub.values.publish_vector(ID, new.published)
    _warn_if_empty(hub, "compute", ID, new)


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


def _refuse_shared_id(ID: str, style: type, other: str, catalogue: Catalogue) -> None:
    """A fix and a compute of one ID must not publish values of the same names."""
    if ID in catalogue and set(catalogue[ID].published) & set(style.published):
        raise ScriptError(
            f"'{ID}' is a {other} already (line {catalogue[ID].place.line})",
            argument="ID",
            expected=f"another ID: {ID}_x and the like would mean two things",
        )


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


def _warn_if_empty(hub: Hub, kind: str, ID: str, item: object) -> None:
    group = getattr(item, "group", None)
    if group is not None and not group.all and len(group) == 0:
        hub.warn(f"{kind} '{ID}' acts on the empty group '{group.id}': it will do nothing")
