"""compute max_position."""

from __future__ import annotations

from typing import TYPE_CHECKING

from karamelo_py.group import ParticleGroup
from karamelo_py.modify import Compute

if TYPE_CHECKING:
    from karamelo_py.hub import Hub


class MaxPosition(Compute):
    """Measure the largest coordinates among points, each on its own; published as ID_x, ID_y, ID_z.

    Parameters
    ----------
    group
        Group of points, or ``all``.

    Example
    -------
    compute(front, max_position, water)
    log_modify(custom, time, front_x)
    """

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub)
        self.group = group

    def refresh(self) -> None:
        """Measure and publish."""
        position = self.hub.fields.position[self.hub.fields.members(self.group)]
        if len(position):
            self.publish_components(position.max(axis=0))
