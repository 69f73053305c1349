"""compute dissipated_energy."""

from karamelo_py.scene.modify import Compute


class DissipatedEnergy(Compute):
    """Measure the energy that a group of points has dissipated; published as ID.

    Plastic and viscous work, and what damage sets free. It is 0 of materials that dissipate
    nothing.

    Example
    -------
    compute(Ed, dissipated_energy, all)
    log_modify(custom, step, time, Ed)

    See Also
    --------
    strain_energy, kinetic_energy
    """

    published = ("",)

    def refresh(self) -> None:
        """Measure and publish."""
        self.publish("", self.hub.fields.dissipated_energy(self.group))
