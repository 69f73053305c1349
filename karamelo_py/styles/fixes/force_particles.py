"""fix force_particles: a total force shared by points."""

from karamelo_py.kernels.p2g import Force
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, PointsView
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import per_direction, vector


class ForceParticles(Fix):
    """Apply a total force to points, split by their masses.

    Parameters
    ----------
    force
        fx, fy, fz, as many as the domain has dimensions: numbers or formulas of x, y, z, x0, y0,
        z0, time and published values. NULL leaves a component alone.

    Example
    -------
    fix(pull, force_particles, tip, 0, -100*min(time, 1))

    Notes
    -----
    A point of mass m gets m/M of the force, M the mass of the group: where the formula depends on
    the place, of the force there. The load goes with the points wherever they move, as that of
    fix force_nodes does not. In an axisymmetric scene forces belong to a radian. Publishes the sum
    as ID_x, ID_y, ID_z.

    See Also
    --------
    force_nodes, body_force, edge_traction, neumann_bc_mech
    """

    syntax = "group, fx[, fy[, fz]]"
    published = ("x", "y", "z")
    point_fields = (Force,)
    point_by_point = True

    def __init__(self, hub: Hub, group: ParticleGroup, *force: Expression | None):
        super().__init__(hub, group)
        self.force = per_direction(hub, "f", force)

    def initial_integrate(self, points: PointsView) -> None:
        """Give the points their share, and publish the sum."""
        mass, x = points.mass.astype(float), points.position
        share = mass / (points.total(mass) or 1.0)
        force = share[:, None] * vector(self.force, self.hub, x, lambda: points.reference_position)
        points.force = points.force + force
        self.publish_components(points.total(force))
