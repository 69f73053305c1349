"""compute energy_balance: whether energy appears from nowhere or gets lost."""

from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.computes.drift import Drift


class EnergyBalance(Compute):
    """Measure kinetic + stored + dissipated energy less the work done, which should stay the same.

    Parameters
    ----------
    work
        Work that loads have done on the group since the start, as far as it is known: a formula of
        time and published values; 0 without it.

    Example
    -------
    compute(c, center_of_mass, all)
    compute(E, energy_balance, all, -9.81*1000*(c_y - 0.5))
    log_modify(custom, time, E, E_drift)

    Notes
    -----
    Publishes ID, the sum; ID_total, the energies without the work; and ID_drift, the change of ID
    since the first output, relative to the largest of kinetic, stored and dissipated energy and
    work so far. Velocities lie half a step beside positions, so that a drift of the order of dt is
    that of the way of counting (a third in a body of a few cells); the end of a run says by how
    much the energies of one time have changed. The energy that affine transfers keep within points
    is not in it.

    See Also
    --------
    kinetic_energy, strain_energy, dissipated_energy, center_of_mass
    """

    published = ("", "total", "drift")
    remembers = ("_drift",)

    def __init__(self, hub: Hub, group: ParticleGroup, work: Expression | None = None):
        super().__init__(hub, group)
        self.work = work
        self._drift = Drift()

    def refresh(self) -> None:
        """Measure and publish."""
        fields = self.hub.fields
        parts = [
            fields.kinetic_energy(self.group),
            fields.strain_energy(self.group),
            fields.dissipated_energy(self.group),
        ]
        work = self.work.evaluate(self.hub.values) if self.work is not None else 0.0
        total = sum(parts)
        self.publish("", total - work)
        self.publish("total", total)
        self.publish("drift", self._drift(total - work, max(abs(part) for part in (*parts, work))))
