"""What every material and every part of a composed law has: parameters of point functions."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument
from karamelo_py.scene.region import look_up
from karamelo_py.script.errors import ScriptError


class Part:
    """Base of the styles of materials and of parts of a law: equations of state, and so on.

    Attributes
    ----------
    catalogue
        The attribute of the hub that holds parts of this kind.
    style
        The style that made it.
    law
        The NamedTuple of numbers; its class selects the point functions
        (:mod:`karamelo_py.points.laws`).
    """

    catalogue: ClassVar[str]
    id: str = ""
    style: str = ""
    place: Any = None
    law: NamedTuple

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Part:
        """The part that `argument` names."""
        return look_up(getattr(hub, cls.catalogue), argument)


def check_temperatures(Tr: float, Tm: float) -> None:
    """Refuse a melting temperature that is not above the reference temperature."""
    if not Tm > Tr:
        raise ScriptError(
            f"the melting temperature Tm = {Tm:g} is not above Tr = {Tr:g}",
            argument="Tm",
            expected=f"a number above {Tr:g}",
        )


def reference_rate(epsdot0: float, factor: float, name: str) -> float:
    """The reference rate of a factor 1 + `factor` ln(rate/epsdot0), any where that is 1.

    Raises
    ------
    ScriptError
        For a rate of 0 that takes part.
    """
    if epsdot0 > 0:
        return epsdot0
    if factor:
        raise ScriptError(
            f"there is no rate to compare with, and {name} = {factor:g} is not 0",
            argument="epsdot0",
            expected=f"a number above 0, or {name} = 0",
        )
    return 1.0
