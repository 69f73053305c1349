"""compute strain_energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from karamelo_py.group import ParticleGroup
from karamelo_py.modify import Compute

if TYPE_CHECKING:
    from karamelo_py.hub import Hub


class StrainEnergy(Compute):
    """Measure the stored (elastic) energy of a group of points; published as ID.

    Parameters
    ----------
    group
        Group of points, or ``all``.

    Example
    -------
    compute(Es, strain_energy, all)
    log_modify(custom, step, time, Es)

    See Also
    --------
    kinetic_energy
    """

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub)
        self.group = group

    def refresh(self) -> None:
        """Measure and publish."""
        energy = self.hub.fields.strain_energy(self.group)
        self.publish("", energy)
        self.publish("s", energy)
