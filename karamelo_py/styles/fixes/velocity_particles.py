"""fix velocity_particles: a given velocity of points."""

from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, point_hook
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes import conflicts
from karamelo_py.styles.fixes.formulas import per_direction


def start(mass, v, x_old, x, value, before, dt, kick):
    """The step starts from the value one step earlier."""
    return before, x, 0.0


def carry(mass, v, x_old, x, value, before, dt, kick):
    """The point moves with the value; the total is the force that makes it do so."""
    return value, x_old + dt * value, mass * (value - v) / kick


class VelocityParticles(Fix):
    """Prescribe the velocity of points: they move as told, and push what they meet on the grid.

    Parameters
    ----------
    velocity
        vx, vy, vz, as many as the domain has dimensions: numbers or formulas of x, y, z, x0, y0,
        z0, time and published values. NULL leaves a component free.

    Example
    -------
    fix(grip, velocity_particles, top, 0, 0.01*time)

    Notes
    -----
    Publishes the force that holds the points as ID_x, ID_y, ID_z. Where several such fixes lead a
    point in one direction, the last of them decides, and over initial velocities and held nodes,
    too; a run says so before its first step.

    See Also
    --------
    velocity_nodes, initial_velocity_particles
    """

    syntax = "group, vx[, vy[, vz]]"
    published = ("x", "y", "z")
    leads_points = True

    initial_integrate = point_hook(start, uses_before=True)
    post_advance_particles = point_hook(carry, publishes=True)

    def __init__(self, hub: Hub, group: ParticleGroup, *velocity: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "v", velocity)


conflicts.register(VelocityParticles)
