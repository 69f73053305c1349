"""Commands about materials and the parts of composed ones: eos, strength, damage, temperature."""

from collections.abc import Callable, Sequence

from karamelo_py.language import registry, signature
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.signature import Argument
from karamelo_py.language.unknown import longer
from karamelo_py.scene.hub import Catalogue, Hub
from karamelo_py.scene.material import Material, MaterialPart
from karamelo_py.scene.plugins import check_columns
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.parser import parse_text


def material(hub: Hub, ID: str, style: StyleOf("material"), *arguments: Argument) -> None:
    """Define a material.

    Parameters
    ----------
    ID
        Name of the material.
    style
        The law.
    arguments
        What the style asks for; see its page.

    Example
    -------
    material(mat1, linear, 1000, 1000, 0.3)

    See Also
    --------
    solid
    """
    if style in hub.parts["eos"] and arguments and not registry.knows("material", style):
        # The form of 2020, material(ID, eosID, strengthID), has no style.
        arguments = (Argument(parse_text(style)[0], hub.interpreter), *arguments)
        style = "eos-strength"
    define(hub, hub.materials, ID, style, arguments)


def _part(kind: str, summary: str, example: str, others: str) -> Callable:
    """The command that defines a part of this kind."""

    def command(hub: Hub, ID: str, style: StyleOf(kind), *arguments: Argument) -> None:
        if (kind, style) == ("strength", "JC") and not registry.knows(kind, style):
            raise ScriptError(
                "unknown strength style 'JC'",
                argument="style",
                expected="the style johnson_cook, with G, A, B, n, epsdot0, C, m, Tr, Tm",
                hint=longer("strength johnson_cook", arguments),
            )
        define(hub, hub.parts[kind], ID, style, arguments)

    command.__doc__ = f"""{summary}

    Parameters
    ----------
    ID
        Name of the {"equation of state" if kind == "eos" else kind}.
    style
        The law.
    arguments
        What the style asks for; see its page.

    Example
    -------
    {example}

    See Also
    --------
    {others}, material, material eos-strength
    """
    return command


eos = _part(
    "eos",
    "Define an equation of state: the pressure of a material, and its density.",
    "eos(bulk, linear, 7850, 160e9)",
    "strength",
)
strength = _part(
    "strength",
    "Define a strength: the deviatoric stress of a material.",
    "strength(mild, plastic, 80e9, 400e6)",
    "eos, damage, temperature",
)
damage = _part(
    "damage",
    "Define a damage: how a material loses its strength.",
    "damage(ductile, damage_johnson_cook, 0.54, 4.89, -3.03, 0.014, 1.12, 1, 298, 1356)",
    "strength, temperature",
)
temperature = _part(
    "temperature",
    "Define a temperature: how a material heats, and what heat does to its pressure.",
    "temperature(warm, plastic_work, 0.9, 385, 0, 0, 298, 1356)",
    "strength, damage",
)


def define(hub: Hub, catalogue: Catalogue, ID: str, style: str, arguments: Sequence[Argument]):
    """File under `ID` what the style makes of the arguments; an ID in use is an error first."""
    kind = catalogue.kind
    target = registry.called(kind, ID, style)
    catalogue.refuse(ID)
    made = signature.call(target, hub, list(arguments), f"{kind} {style}")
    entry = (Material if kind == "material" else MaterialPart)(kind, style, made)
    check_columns(hub, f"{kind} {style}", entry.law)
    catalogue.add(ID, entry)
