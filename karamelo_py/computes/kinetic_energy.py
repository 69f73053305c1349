"""compute kinetic_energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from karamelo_py.group import ParticleGroup
from karamelo_py.modify import Compute

if TYPE_CHECKING:
    from karamelo_py.hub import Hub


class KineticEnergy(Compute):
    """Measure the kinetic energy sum m v^2 / 2 of a group of points; published as ID.

    Parameters
    ----------
    group
        Group of points, or ``all``.

    Example
    -------
    compute(Ek, kinetic_energy, all)
    log_modify(custom, step, time, Ek)

    See Also
    --------
    strain_energy
    """

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub)
        self.group = group

    def refresh(self) -> None:
        """Measure and publish."""
        energy = self.hub.fields.kinetic_energy(self.group)
        self.publish("", energy)
        self.publish("s", energy)
