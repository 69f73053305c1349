"""Commands about the parts of composed materials: eos, strength."""

from __future__ import annotations

from typing import TYPE_CHECKING

from karamelo_py import registry, signature
from karamelo_py.signature import Argument

if TYPE_CHECKING:
    from karamelo_py.hub import Catalogue, Hub


def eos(hub: Hub, ID: str, style: str, *arguments: Argument) -> None:
    """Define an equation of state: the pressure of a material, and its density.

    Parameters
    ----------
    ID
        Name of the equation of state.
    style
        ``linear``, or the style of a plug-in.
    arguments
        What the style asks for; see its page.

    Example
    -------
    eos(bulk, linear, 7850, 160e9)

    See Also
    --------
    strength, material, material eos-strength
    """
    _define(hub, hub.eos, ID, style, arguments)


def strength(hub: Hub, ID: str, style: str, *arguments: Argument) -> None:
    """Define a strength: the deviatoric stress of a material.

    Parameters
    ----------
    ID
        Name of the strength.
    style
        ``linear``, ``plastic``, or the style of a plug-in.
    arguments
        What the style asks for; see its page.

    Example
    -------
    strength(mild, plastic, 80e9, 400e6)

    See Also
    --------
    eos, material, material eos-strength
    """
    _define(hub, hub.strengths, ID, style, arguments)


def _define(
    hub: Hub, catalogue: Catalogue, ID: str, style: str, arguments: tuple[Argument, ...]
) -> None:
    family = catalogue.kind
    target = registry.find(family, style)
    catalogue.add(ID, signature.call(target, hub, list(arguments), f"{family} {style}"))
