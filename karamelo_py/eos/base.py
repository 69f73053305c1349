"""What every equation of state has: the parameters of its point functions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from karamelo_py.regions.base import look_up

if TYPE_CHECKING:
    from karamelo_py.hub import Hub
    from karamelo_py.signature import Argument


class Eos:
    """Base of the styles of equations of state.

    Attributes
    ----------
    law
        The NamedTuple of numbers; its class selects the point functions
        (:mod:`karamelo_py.points.materials.eos`).
    """

    script_kind = "the ID of an equation of state"
    id: str = ""
    place: Any = None
    law: NamedTuple

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Eos:
        """The equation of state that `argument` names."""
        return look_up(hub.eos, argument)
