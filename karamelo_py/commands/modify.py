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
from karamelo_py.script.errors import ScriptError, blaming, unknown


def modify(hub: Hub, kind: str, ID: str, *numbers: Argument) -> None:
    """Change constants of a material between runs; its points retain their state.

    Parameters
    ----------
    kind
        ``material``, ``viscosity``, ``eos``, ``strength``, ``damage`` or ``temperature``.
    ID
        Name of the material or part. A viscosity has the name of its material.
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
    The next run uses the new constants, without compilation. A stress outside the new yield surface
    is returned to it in the first step. If an elastic modulus changes, incremental laws retain
    their stress; with laws of the total deformation, the stress changes at once. The density cannot
    change, since points have masses; nor can constants of the initial state, such as pc of
    cam-clay.

    ``material`` also changes constants of parts of eos-strength, if only one part has that name.

    See Also
    --------
    material, strength, run
    """
    if kind not in (kinds := ("material", "viscosity", *hub.parts)):
        raise unknown(f"unknown kind '{kind}'", kind, kinds, argument="kind")
    catalogue = hub.parts.get(kind, hub.materials)
    with blaming(argument="ID"):
        entry = catalogue[ID]
    if not numbers:
        raise ScriptError("no number changes", argument="ID", expected="name=value, ...")
    if isinstance(entry, Material):
        entry = _owner(entry, kind, numbers)
    changed = {entry: _changed(hub, entry, entry.arguments, numbers)}
    for material in hub.materials.values():
        _now(hub, material, changed)
    # Skip entries from before a viscosity was added; their material has the same name.
    changed = {old: new for old, new in changed.items() if _catalogue(hub, old)[old.id] is old}
    for before, after in changed.items():
        if isinstance(after, Material):
            _check(hub, before, after, numbers)
            judge(hub, after)
    for after in changed.values():
        _catalogue(hub, after)[after.id] = after
    for solid in hub.solids.values():
        solid.material = changed.get(solid.material, solid.material)


def _owner(material: Material, kind: str, numbers: tuple[Argument, ...]) -> MaterialPart:
    names = {(argument.keyword() or ("",))[0] for argument in numbers}
    viscous = [part for part in material.parts() if part.kind == "viscosity"]
    able = [part for part in viscous if names <= _names(part)]
    if kind == "viscosity":
        if not able:
            constants = sorted({name for part in viscous for name in _names(part)} - {"material"})
            message = f"material '{material.id}' has no viscosity"
            if viscous:
                message = f"{message} with {' and '.join(sorted(names))}"
            expected = ", ".join(f"{name}=..." for name in constants) or "viscosity(STYLE, ID, ...)"
            raise ScriptError(message, mark=numbers[0].mark, expected=expected)
        return able[0]
    whole = next(part for part in material.parts() if part.kind == "material")
    if names <= set(whole.arguments):
        return whole
    owners = [part for part in whole.parts() if part is not whole and names <= _names(part)]
    if len(owners) > 1:
        lines = " or ".join(f"modify({entry.kind}, {entry.id}, ...)" for entry in owners)
        several = " and ".join(f"'{name}'" for name in sorted(names))
        message = f"several parts of material '{material.id}' have {several}"
        raise ScriptError(message, argument="ID", expected=lines)
    if able and not owners:
        line = f"modify(viscosity, {material.id}, ...)"
        named = " and ".join(sorted(names))
        message = f"{named} can change only in the viscosity of material '{material.id}'"
        raise ScriptError(message, mark=numbers[0].mark, expected=line)
    return owners[0] if owners else whole


def _catalogue(hub: Hub, entry: MaterialPart) -> Any:
    return hub.materials if isinstance(entry, Material) else hub.parts[entry.kind]


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


def _now(hub: Hub, value: Any, changed: dict) -> Any:
    if isinstance(value, tuple):
        now = tuple([_now(hub, one, changed) for one in value])
        same = all(a is b for a, b in zip(value, now, strict=True))
        return value if same else now
    if isinstance(value, MaterialPart) and value not in changed:
        values = {name: _now(hub, one, changed) for name, one in value.arguments.items()}
        if any(one is not value.arguments[name] for name, one in values.items()):
            changed[value] = _changed(hub, value, values, ())
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
