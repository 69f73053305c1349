"""What every strength has: the parameters of its point functions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from karamelo_py.regions.base import look_up

if TYPE_CHECKING:
    from karamelo_py.hub import Hub
    from karamelo_py.signature import Argument


class Strength:
    """Base of the styles of strength.

    Attributes
    ----------
    law
        The NamedTuple of numbers; its class selects the point functions
        (:mod:`karamelo_py.points.materials.strength`).
    """

    script_kind = "the ID of a strength"
    id: str = ""
    place: Any = None
    law: NamedTuple

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Strength:
        """The strength that `argument` names."""
        return look_up(hub.strengths, argument)
