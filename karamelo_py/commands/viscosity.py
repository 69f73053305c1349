"""Command viscosity."""

from typing import Annotated

from karamelo_py.commands.materials import judge
from karamelo_py.commands.thin import fit_to_domain
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.signature import Argument, style_of
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material
from karamelo_py.scene.plugins import check_law
from karamelo_py.script.errors import ScriptError


def viscosity(hub: Hub, style: Annotated[str, StyleOf("viscosity")], *arguments: Argument) -> None:
    """Add viscosity to a material, before its first solid.

    Parameters
    ----------
    style
        ``prony``: stress relaxation; ``newtonian``: a stress proportional to the strain rate.

    Example
    -------
    material(rubber, neo-hookean, 1000, 1e6, 0.4)
    viscosity(prony, rubber, g=(0.2, 0.1), tau=(0.01, 1))

    Notes
    -----
    The material retains its ID. A material may have both styles, prony first. Constants can be
    changed between runs: ``modify(viscosity, rubber, tau=(0.02, 1))``.

    See Also
    --------
    material, modify, strength
    """
    values: dict = {}
    made = style_of(hub, "viscosity", "", style, arguments, values=values)
    before: Material = values["material"]
    for solid in hub.solids.values():
        if solid.material is before:
            message = f"solid '{solid.id}' has material '{before.id}' already"
            raise ScriptError(message, expected="viscosity before the solid", code="too-late")
    after = Material("viscosity", style, made, values)
    after.fluid = before.fluid
    fit_to_domain(hub, after)
    check_law(hub, f"viscosity {style}", after.law)
    hub.materials.add(before.id, after, replace=True)
    judge(hub, after)
