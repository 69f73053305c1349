"""fix velocity_nodes: a given velocity at nodes."""

from __future__ import annotations

from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, node_hook
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import per_direction


def prescribe(mass, v, v_star, force, value, before, dt, share):
    """v* is the value now, v the value one step earlier; the total is the reaction."""
    return before, value, force, mass * (value - v_star) / dt


def hold(mass, v, v_star, force, value, before, dt, share):
    """The re-mapped velocity is the value now."""
    return value, value, force, 0.0


class VelocityNodes(Fix):
    """Prescribe the velocity of nodes: walls, supports, grips, pistons.

    Parameters
    ----------
    group
        Group of nodes.
    velocity
        vx, vy, vz, as many as the domain has dimensions: numbers or formulas of x0, y0, z0, time
        and published values. NULL leaves a component free.

    Example
    -------
    fix(base, velocity_nodes, bottom, 0, 0)
    fix(roller, velocity_nodes, left, 0, NULL)
    fix(piston, velocity_nodes, top, NULL, -0.1*sin(2*PI*time))

    Notes
    -----
    Publishes the reaction, the force that holds the nodes, as ID_x, ID_y, ID_z.

    See Also
    --------
    velocity_particles, initial_velocity_nodes
    """

    syntax = "group, vx[, vy[, vz]]"
    published = ("x", "y", "z")
    holds_nodes = True

    post_update_grid_state = node_hook(prescribe, uses_before=True)
    post_velocities_to_grid = node_hook(hold, publishes=False)

    def __init__(self, hub: Hub, group: NodeGroup, *velocity: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "v", velocity)
