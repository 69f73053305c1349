"""compute kinetic_energy."""

from karamelo_py.scene.modify import Compute


class KineticEnergy(Compute):
    """Measure the kinetic energy sum m v^2 / 2 of a group of points; published as ID.

    Example
    -------
    compute(Ek, kinetic_energy, all)
    log_modify(custom, step, time, Ek)

    See Also
    --------
    strain_energy
    """

    published = ("", "s")

    def refresh(self) -> None:
        """Measure and publish."""
        energy = self.hub.fields.kinetic_energy(self.group)
        self.publish("", energy)
        self.publish("s", energy)
