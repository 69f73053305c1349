"""Computes of energies, momenta, and their drift."""

import numpy as np

from karamelo_py.language.rules import Restrictions, known_failure
from karamelo_py.output.point_table import PointTable
from karamelo_py.output.units import ENERGY, Powers
from karamelo_py.points.kinematics import total
from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.points.transfers import NodalMass
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute, Fix
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression


class Energy(Compute):
    published: tuple[str, ...] = ("", "s")
    unit = ENERGY
    measured = ""

    def refresh(self) -> None:
        self.publish_all(*[self.hub.fields.total(self.measured, self.group)] * len(self.published))


class KineticEnergy(Energy):
    """Measure the kinetic energy sum m v^2 / 2 of a group of points; published as ID.

    Example
    -------
    compute(Ek, kinetic_energy, all)
    log_modify(custom, step, time, Ek)

    Notes
    -----
    The value is half a step earlier than the logged time (see `scheme`).

    See Also
    --------
    strain_energy
    """

    measured = "kinetic"


class FixKineticEnergy(KineticEnergy, Fix):
    """Measure the kinetic energy sum m v^2 / 2 of a group of points; published as ID_s and ID.

    Example
    -------
    fix(Ek, kinetic_energy, all)
    log_modify(custom, step, time, Ek_s)

    See Also
    --------
    strain_energy, compute kinetic_energy
    """


class StrainEnergy(Energy):
    """Measure the stored (elastic) energy of a group of points; published as ID.

    Example
    -------
    compute(Es, strain_energy, all)
    log_modify(custom, step, time, Es)

    See Also
    --------
    kinetic_energy
    """

    measured = "stored"


class FixStrainEnergy(StrainEnergy, Fix):
    """Measure the stored (elastic) energy of a group of points; published as ID_s and ID.

    Example
    -------
    fix(Es, strain_energy, all)
    log_modify(custom, step, time, Es_s)

    See Also
    --------
    kinetic_energy, compute strain_energy
    """


class DissipatedEnergy(Energy):
    """Measure the energy that a group of points has dissipated; published as ID.

    Dissipated energy is plastic and viscous work, and energy released by damage.

    Example
    -------
    compute(Ed, dissipated_energy, all)
    log_modify(custom, step, time, Ed)

    See Also
    --------
    strain_energy, kinetic_energy
    """

    published = ("",)
    measured = "dissipated"


class LostByContact(Compute):
    """Measure the energy that contact has dissipated since the start; published as ID.

    Example
    -------
    compute(Ec, contact_loss, all)
    log_modify(custom, step, time, Ec)

    Notes
    -----
    Contact at nodes (ulmpm/contacts) is inelastic. A normal impulse dissipates the impulse times
    the mean of the approach velocities before and after the step; friction dissipates the
    tangential impulse times the mean sliding velocity. The sum is the work done by free rigid
    bodies and by bodies that contact does not move, minus the work done on points. The sum is exact
    with FLIP 1 in musl and usavg. Damping and friction of contact/surface and contact/rigid_body
    are included; contact between points and load steps are not. The group must be all points.

    See Also
    --------
    dissipated_energy, energy_balance
    """

    published = ("",)
    unit = ENERGY
    restrictions = Restrictions("contact_loss", "no compute contact_loss", without=("implicit",))

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub, group)
        if not group.all:
            raise ScriptError(
                "contact at nodes acts between solids, not between groups of points",
                argument="group",
                expected="the group all",
            )

    def refresh(self) -> None:
        self.publish_all(self.hub.fields.lost_by_contact())


def _has_contact(hub: Hub) -> bool:
    if hub.update.method.fields_per_solid and len(hub.solids) > 1:
        return True
    return any(fix.presses or fix.touches for fix in hub.fixes.values())


known_failure(
    LostByContact,
    "compute contact_loss '{part.id}'",
    when=lambda compute, scene: not _has_contact(scene.hub),
    reason="it stays 0, because the scene has no contact at nodes or surfaces",
    cure="method(ulmpm/contacts, ...), fix contact/surface or contact/rigid_body",
)


class LostByTransfer(Energy):
    """Measure the kinetic energy that points lose in the transfer of velocity; published as ID.

    Example
    -------
    compute(Et, transfer_loss, all)
    log_modify(custom, step, time, Et)

    Notes
    -----
    Nodal impulses do work on a point, with the mean of its velocities before and after a step. The
    loss is this work minus the change of m v^2 / 2. It is negative while points get energy back
    from the moments that they store (APIC): m v^2 / 2 does not include the energy of moments. With
    usl it includes the damping of the scheme. Points of gases, which take this energy up as heat,
    and of soil with pore water are not counted. The loss of deleted points is counted in group all.

    PIC and FLIP below 1 with musl or usavg are always counted. Otherwise this compute makes steps
    10 to 20 % slower.

    See Also
    --------
    contact_loss, energy_balance
    """

    published = ("",)
    measured = "transfer loss"

    def refresh(self) -> None:
        fields = self.hub.fields
        lost = fields.lost_by_transfer() if self.group.all else None
        self.publish_all(fields.total(self.measured, self.group) if lost is None else lost)

    @property
    def point_fields(self) -> tuple[type, ...]:  # type: ignore[override]
        loss = self.hub.scheme_of_steps.traits.loss
        return () if loss is None else (loss,)

    @property
    def node_fields(self) -> tuple[type, ...]:  # type: ignore[override]
        return (NodalMass,) * any(loss.work_with_update for loss in self.point_fields)

    @property
    def restrictions(self) -> Restrictions:  # type: ignore[override]
        # Passes of other schemes already scatter to the sums whose old values XPIC needs.
        schemes: dict[str, tuple[str, ...]] = {}
        if self.hub.update.transfer.traits.series:
            schemes["scheme"] = "musl", "usavg"
        elif self.hub.update.scheme.traits.loss is None:  # the scheme of a plug-in
            schemes["scheme"] = "musl", "usavg", "usf", "usl"
        instead = "no compute transfer_loss"
        return Restrictions("transfer_loss", instead, only=schemes, without=("implicit",))


def _is_counted(compute: LostByTransfer) -> bool:
    group = compute.group
    some = [s for s in compute.hub.solids.values() if group.all or group.touches(s)]
    return any(solid.counts_transfer for solid in some)


known_failure(
    LostByTransfer,
    "compute transfer_loss '{part.id}'",
    when=lambda compute, scene: not _is_counted(compute),
    reason="it stays 0, because its points are gas, rigid or soil with pore water, whose loss is "
    "not counted",
    cure="remove this compute",
)


class Drift:
    """Change of a value since the first call, relative to the largest scale so far."""

    remembers = ("_first", "_scale")

    def __init__(self) -> None:
        self._first: np.ndarray | None = None
        self._scale = 0.0

    def __call__(self, value: np.ndarray | float, scale: float) -> float:
        """Return the relative change up to `value`; `scale` > 0 bounds the magnitude of values."""
        value = np.atleast_1d(np.asarray(value, float))
        if self._first is None:
            self._first = value
        self._scale = max(self._scale, scale)
        distance = float(np.linalg.norm(value - self._first))
        return distance / self._scale if self._scale > 0 else distance


class EnergyBalance(Compute):
    """Measure kinetic + stored + dissipated energy minus the work done, which should be constant.

    Parameters
    ----------
    work
        Work of loads on the group since the start, a function of time and published values.

    Example
    -------
    compute(c, center_of_mass, all)
    compute(E, energy_balance, all, -9.81*1000*(c_y - 0.5))
    log_modify(custom, time, E, E_drift)

    Notes
    -----
    Publishes ID, kinetic + stored + dissipated energy - work; ID_total, kinetic + stored +
    dissipated energy; and ID_drift, the change of ID since the first output, divided by the largest
    energy or work so far. Velocities lag positions by half a step, so ID_drift has an error of
    order dt (up to 33 % in a body of a few cells). The energy line at the end of a run has no such
    error. Energy stored within points by affine transfers is not included.

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
        kinds = "kinetic", "stored", "dissipated"
        parts = [self.hub.fields.total(kind, self.group) for kind in kinds]
        work = self.work.evaluate(self.hub.values) if self.work is not None else 0.0
        energies = total(parts)
        drift = self._drift(energies - work, max(abs(energy) for energy in (*parts, work)))
        self.publish_all(energies - work, energies, drift)


class Momentum(Compute):
    """Base of momenta; `terms` returns components and magnitudes."""

    published = ("x", "y", "z", "drift")
    remembers = ("_drift",)

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub, group)
        self._drift = Drift()

    def refresh(self) -> None:
        total = self.hub.fields.added_up(self)
        self.publish_components(total[:-1])
        self.publish("drift", self._drift(total[:-1], total[-1]))


class LinearMomentum(Momentum):
    """Measure the momentum sum m v of points, and how far it has drifted.

    Example
    -------
    compute(p, linear_momentum, all)
    log_modify(custom, time, p_x, p_drift)

    Notes
    -----
    Publishes ID_x, ID_y, ID_z, and ID_drift: the magnitude of the change since the first output,
    divided by the largest sum m |v| so far.

    See Also
    --------
    angular_momentum, average_velocity
    """

    def terms(self, points: PointTable) -> np.ndarray:
        mass, v = points.mass.astype(float), points.velocity.astype(float)
        return mass * np.vstack([v.T, np.linalg.norm(v, axis=1)])


class AngularMomentum(Momentum):
    """Measure sum m (x - c) x v of points about a centre c, and how far it has drifted.

    Parameters
    ----------
    cx, cy, cz
        Position of the centre c.

    Example
    -------
    compute(L, angular_momentum, disk, 0.5, 0.5)
    log_modify(custom, time, L_z)

    Notes
    -----
    Publishes ID_x, ID_y, ID_z, and ID_drift: the magnitude of the change since the first output,
    divided by the largest sum m |x - c| |v| so far. The affine velocity of points (APIC) is
    included.

    See Also
    --------
    linear_momentum
    """

    unit = Powers(2, 1, -1)

    def __init__(
        self, hub: Hub, group: ParticleGroup, cx: float = 0.0, cy: float = 0.0, cz: float = 0.0
    ):
        super().__init__(hub, group)
        self.centre = np.array([cx, cy, cz])

    def terms(self, points: PointTable) -> np.ndarray:
        d = self.hub.domain.dimension
        arm, v = np.zeros((2, points.count, 3))
        arm[:, :d], v[:, :d] = points.position, points.velocity
        arm -= self.centre
        twists = isinstance(self.hub.domain.kin, Twisted)
        if twists:
            v[:, 2] = points.particle("vtheta")
        angular = np.cross(arm, v)
        if twists:  # the sums of all other components over a revolution are 0
            angular *= (0, 1, 0)
        moment = points.velocity_moment
        if moment is not None and d > 1 and not twists:
            # B_ij = sum N v_i (X - x)_j has the angular momentum of a point about its position.
            b = np.zeros((points.count, 3, 3))
            b[:, :d, :d] = moment.reshape(-1, d, d)
            angular += np.stack(
                [b[:, 2, 1] - b[:, 1, 2], b[:, 0, 2] - b[:, 2, 0], b[:, 1, 0] - b[:, 0, 1]], axis=1
            )
        scale = np.linalg.norm(arm, axis=1) * np.linalg.norm(v, axis=1)
        return points.mass * np.vstack([angular.T, scale])
