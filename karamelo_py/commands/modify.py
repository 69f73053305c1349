"""Command modify: change material constants between runs."""

from typing import Any

from karamelo_py.commands.materials import judge
from karamelo_py.commands.thin import fit_to_domain
from karamelo_py.language import registry
from karamelo_py.language.signature import Argument, parameters, remade
from karamelo_py.points.kinematics import Space
from karamelo_py.points.laws import initial_state, law_kind, specific_volume
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material, MaterialPart
from karamelo_py.script.errors import ScriptError, unknown


def modify(hub: Hub, kind: str, ID: str, *numbers: Argument) -> None:
    """Change constants of a material between runs; its points retain their state.

    Parameters
    ----------
    kind
        ``material``, ``eos``, ``strength``, ``damage`` or ``temperature``.
    ID
        Name of the material or of the part.
    numbers
        ``name=value`` for each changed constant, named as on the page of the style.

    Example
    -------
    eos(ground, linear, 2000, 1e8)
    strength(soil, mohr-coulomb, 4e7, 10e3, 20)
    material(soil, eos-strength, ground, soil)
    modify(strength, soil, cohesion=8e3, phi=16)

    Notes
    -----
    The next run uses them, without compilation. A stress outside the new yield surface returns to
    it in the first step. If an elastic modulus changes, an incremental law retains its stress; with
    a law of the total deformation it changes at once. The density (points have masses) and
    constants of the initial state, such as pc of cam-clay, cannot be changed.

    ``material`` also changes constants of the parts of eos-strength, if only one part has that
    name.

    See Also
    --------
    material, strength, run
    """
    if kind not in ("material", *hub.parts):
        raise unknown(f"unknown kind '{kind}'", kind, ("material", *hub.parts), argument="kind")
    catalogue = hub.materials if kind == "material" else hub.parts[kind]
    try:
        entry = catalogue[ID]
    except ScriptError as error:
        error.argument = "ID"
        raise
    if not numbers:
        raise ScriptError("no number changes", argument="ID", expected="name=value, ...")
    if kind == "material":
        entry = _owner(entry, numbers)
    changed = {entry: _changed(hub, entry, entry.arguments, numbers)}
    for material in hub.materials.values():
        if entry in _parts(material):
            values = {name: _now(value, changed) for name, value in material.arguments.items()}
            changed[material] = _changed(hub, material, values, ())
    for before, after in changed.items():
        if isinstance(after, Material):
            _check(hub, before, after, numbers)
            judge(hub, after)
    for after in changed.values():
        catalogue = hub.materials if isinstance(after, Material) else hub.parts[after.kind]
        catalogue[after.id] = after
    for solid in hub.solids.values():
        solid.material = changed.get(solid.material, solid.material)


def _parts(material: Material) -> list[MaterialPart]:
    values: list[Any] = []
    for value in material.arguments.values():
        values += value if isinstance(value, tuple) else [value]
    return [entry for entry in values if isinstance(entry, MaterialPart)]


def _owner(material: Material, numbers: tuple[Argument, ...]) -> MaterialPart:
    names = {(argument.keyword() or ("",))[0] for argument in numbers}
    if names <= set(material.arguments):
        return material
    owners = [entry for entry in _parts(material) if names <= _names(entry)]
    if len(owners) > 1:
        lines = " or ".join(f"modify({entry.kind}, {entry.id}, ...)" for entry in owners)
        raise ScriptError(
            f"several parts of material '{material.id}' have "
            + " and ".join(f"'{name}'" for name in sorted(names)),
            argument="ID",
            expected=lines,
        )
    return owners[0] if owners else material


def _names(entry: MaterialPart) -> set[str]:
    return {p.name for p in parameters(registry.find(entry.kind, entry.style))}


def _changed(hub: Hub, entry: MaterialPart, values: dict, numbers: tuple) -> MaterialPart:
    made, values = remade(hub, entry.kind, entry.style, values, numbers)
    after = type(entry)(entry.kind, entry.style, made, values)
    if isinstance(after, Material) and isinstance(entry, Material):
        fit_to_domain(hub, after)
        after.fluid = entry.fluid
    after.id, after.mark = entry.id, entry.mark
    return after


def _now(value: Any, changed: dict) -> Any:
    if isinstance(value, tuple):
        return tuple(_now(one, changed) for one in value)
    return changed.get(value, value) if isinstance(value, MaterialPart) else value


def _check(hub: Hub, before: Material, after: Material, numbers: tuple[Argument, ...]) -> None:
    if any(solid.material is before for solid in hub.solids.values()):
        names = ", ".join((argument.keyword() or ("",))[0] for argument in numbers)
        if specific_volume(after.law) != specific_volume(before.law):
            raise ScriptError(
                f"the density of material '{after.id}' cannot change: its points have their masses",
                mark=numbers[0].mark,
                expected="a density before the first solid of the material",
                code="too-late",
            )
        kin = Space()
        if law_kind(after.law) != law_kind(before.law):
            message = f"{names} would change the law of the points of material '{after.id}'"
            raise ScriptError(message, mark=numbers[0].mark, expected="numbers of the same law")
        if initial_state(after.law, kin, 1.0) != initial_state(before.law, kin, 1.0):
            raise ScriptError(
                f"the initial state of the points of material '{after.id}' depends on {names}, "
                "which can no longer change",
                mark=numbers[0].mark,
                expected="the number before the first solid of the material",
                code="too-late",
            )
