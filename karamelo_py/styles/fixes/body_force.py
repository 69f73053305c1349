"""fix body_force: a force proportional to mass."""

from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, node_hook
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import per_direction


def accelerate(mass, v, v_star, force, value, before, dt, share):
    """The force grows by mass times the value; so does the total."""
    return v, v_star, force + mass * value, mass * value


class BodyForce(Fix):
    """Accelerate nodes: gravity, centrifugal force, a manufactured solution's source.

    Parameters
    ----------
    acceleration
        bx, by, bz, as many as the domain has dimensions: force per mass, numbers or formulas of
        x0, y0, z0, time and published values. NULL leaves a component alone.

    Example
    -------
    fix(gravity, body_force, all, 0, -9.81)
    fix(ramp, body_force, all, NULL, -9.81*min(time/2, 1))

    Notes
    -----
    Publishes the total force as ID_x, ID_y, ID_z.

    See Also
    --------
    force_nodes
    """

    syntax = "group, bx[, by[, bz]]"
    published = ("x", "y", "z")
    accelerates = True

    post_particles_to_grid = node_hook(accelerate)

    def __init__(self, hub: Hub, group: NodeGroup, *acceleration: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "b", acceleration)
