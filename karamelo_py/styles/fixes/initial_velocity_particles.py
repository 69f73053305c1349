"""fix initial_velocity_particles: velocity of points before the first step."""

from functools import partial

from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, PointsView
from karamelo_py.script.expressions import FIRST, Expression
from karamelo_py.styles.fixes import conflicts
from karamelo_py.styles.fixes.formulas import evaluated, gradient, per_direction


class InitialVelocityParticles(Fix):
    """Give points a velocity before the first step after this line, and never again.

    Parameters
    ----------
    velocity
        vx, vy, vz: numbers or formulas of x, y, z, x0, y0, z0. NULL leaves a component alone; in
        fewer dimensions the last ones may be left out, NULL or 0.

    Example
    -------
    fix(v1, initial_velocity_particles, ball, 0.1, 0.1, NULL)
    fix(mode, initial_velocity_particles, all, 0.1*sin(PI*x0/50))

    Notes
    -----
    Points of transfers that keep a gradient or moment of velocity (APIC, TPIC and their kin) get
    that of the formulas, too, so that the first step changes nothing in an affine motion.

    See Also
    --------
    initial_velocity_nodes, velocity_particles
    """

    syntax = "group, vx[, vy[, vz]]"
    published = ()

    first_step_only = True
    point_by_point = True

    def __init__(self, hub: Hub, group: ParticleGroup, *velocity: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "v", velocity)

    def initial_integrate(self, points: PointsView) -> None:
        """Set the velocities."""
        v = points.velocity
        x = x0 = points.position
        if any(formula is not None and formula.names & FIRST for formula in self.formulas):
            x0 = points.reference_position
        for k, formula in enumerate(self.formulas):
            if formula is not None:
                v[:, k] = evaluated(formula, self.hub, x, x0)
                points.set_velocity_gradient(k, partial(gradient, formula, self.hub, x, x0))
        points.velocity = v


conflicts.register(InitialVelocityParticles)
