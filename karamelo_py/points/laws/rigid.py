"""Material rigid."""

from typing import NamedTuple

from karamelo_py.points import laws
from karamelo_py.points.kinematics import nothing
from karamelo_py.points.laws.parameters import AboveZero


class Rigid(NamedTuple):
    """Rigid body that moves as prescribed or by the forces on it.

    Parameters
    ----------
    rho
        Density.

    Example
    -------
    material(tool, rigid, 1e6)

    Notes
    -----
    Forces do not change the velocity of points, which is set by fix initial_velocity_particles or
    fix velocity_particles, unless fix rigid_body moves the body. The points have no stress; they
    limit the step only by their speed, to less than a cell per step.

    In ulmpm and ulcpdi, nodes around the points have the velocity of the rigid body, for any
    density; in ulmpm/contacts, contact does not move it. These methods publish the force on the
    solid ID as ContactForce_ID_x, ContactForce_ID_y, ContactForce_ID_z, and the torque about the
    origin as ContactTorque_ID_x and so on.

    Bases with domains that deform with the grid (CPDI, cpgimp) are refused.

    See Also
    --------
    material, fix rigid_body, fix velocity_particles, fix initial_velocity_particles
    """

    in_lanes = True

    specific_volume: float

    @classmethod
    def given(cls, rho: AboveZero):
        return cls(1 / rho)


laws.answers(
    Rigid,
    {
        laws.initial_state: (),
        laws.advance: (),
        laws.jacobian: 1,
        laws.wave_speed_squared: 0,
        laws.energy_density: 0,
    },
)


@laws.constrained_velocity.on(Rigid)
def _constrained_velocity_rigid(law, v, v_grid):
    return v


@laws.cauchy_stress.on(Rigid)
@laws.kirchhoff_stress.on(Rigid)
@laws.elastic_strain.on(Rigid)
def _no_stress(law, kin, state):
    return nothing(kin)
