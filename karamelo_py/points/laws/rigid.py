"""Material rigid: prescribed velocity, empty state."""

from typing import Annotated, NamedTuple

from karamelo_py.language.signature import Positive
from karamelo_py.points import laws
from karamelo_py.points.kinematics import nothing


class Rigid(NamedTuple):
    """A body with prescribed velocity that nothing can deform or deflect.

    Parameters
    ----------
    rho
        Density.

    Example
    -------
    material(tool, rigid, 1e6)

    Notes
    -----
    Each point retains the velocity set by fix initial_velocity_particles or fix velocity_particles.
    Forces, contact and nodal velocities do not change it. There is no stress. The time step is
    limited only in that a point must stay within a cell.

    In ulmpm and ulcpdi, nodes around points of the body have its velocity, whatever its density. In
    ulmpm/contacts, contact does not move it. These methods publish the force on the solid ID as
    ContactForce_ID_x, ContactForce_ID_y, ContactForce_ID_z, and the torque about the origin as
    ContactTorque_ID_x and so on.

    Point domains that deform with the grid (CPDI, cpgimp) would not stay rigid, and are refused.

    See Also
    --------
    material, fix velocity_particles, fix initial_velocity_particles
    """

    in_lanes = True

    specific_volume: float  # volume per mass

    @classmethod
    def given(cls, rho: Annotated[float, Positive]):
        return cls(1 / rho)


laws.initial_state.on(Rigid)(lambda law, kin, like: ())
laws.advance.on(Rigid)(lambda law, kin, state, dl, dt: ())
laws.constrained_velocity.on(Rigid)(lambda law, own, given: own)
laws.jacobian.on(Rigid)(lambda law, kin, state: 1)
for _stress in (laws.cauchy_stress, laws.kirchhoff_stress, laws.elastic_strain):
    _stress.on(Rigid)(lambda law, kin, state: nothing(kin))
for _number in (laws.wave_speed_squared, laws.energy_density):
    _number.on(Rigid)(lambda law, kin, state: 0)
