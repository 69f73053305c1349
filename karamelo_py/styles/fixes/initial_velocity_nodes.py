"""fix initial_velocity_nodes: velocity of nodes in the first step."""

import numpy as np

from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, NodesView
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import evaluated, per_direction


class InitialVelocityNodes(Fix):
    """Give nodes a velocity in the first step after this line, and never again.

    Parameters
    ----------
    velocity
        vx, vy, vz, as many as the domain has dimensions: numbers or formulas of x0, y0, z0.
        NULL leaves a component alone.

    Example
    -------
    fix(kick, initial_velocity_nodes, all, 0.1*sin(x0), NULL)

    See Also
    --------
    initial_velocity_particles
    """

    syntax = "group, vx[, vy[, vz]]"
    published = ()

    first_step_only = True
    point_by_point = True

    def __init__(self, hub: Hub, group: NodeGroup, *velocity: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "v", velocity)

    def _impose(self, v: np.ndarray, nodes: NodesView) -> None:
        x = nodes.position[:, : v.shape[1]]
        for k, formula in enumerate(self.formulas):
            if formula is not None:
                v[:, k] = evaluated(formula, self.hub, x, x)

    def post_update_grid_state(self, nodes: NodesView) -> None:
        """v* is the given velocity."""
        self._impose(nodes.velocity_update, nodes)

    def post_velocities_to_grid(self, nodes: NodesView) -> None:
        """The re-mapped velocity is the given one."""
        self._impose(nodes.velocity, nodes)
