"""compute strain_energy."""

from karamelo_py.scene.modify import Compute


class StrainEnergy(Compute):
    """Measure the stored (elastic) energy of a group of points; published as ID.

    Example
    -------
    compute(Es, strain_energy, all)
    log_modify(custom, step, time, Es)

    See Also
    --------
    kinetic_energy
    """

    published = ("", "s")

    def refresh(self) -> None:
        """Measure and publish."""
        energy = self.hub.fields.strain_energy(self.group)
        self.publish("", energy)
        self.publish("s", energy)
