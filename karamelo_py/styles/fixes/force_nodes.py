"""fix force_nodes: a total force shared by nodes."""

from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, node_hook
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.formulas import per_direction


def push(mass, v, v_star, force, value, before, dt, share):
    """Each member takes its share of the value."""
    return v, v_star, force + value * share, value * share


class ForceNodes(Fix):
    """Apply a total force, split equally among the nodes of the group that carry mass.

    Parameters
    ----------
    force
        fx, fy, fz: numbers or formulas of time and published values. NULL leaves a component
        alone; in fewer dimensions the last ones may be left out, NULL or 0.

    Example
    -------
    fix(pull, force_nodes, tip, 0, -100*min(time, 1), NULL)

    Notes
    -----
    Publishes the applied force as ID_x, ID_y, ID_z.

    See Also
    --------
    body_force
    """

    syntax = "group, fx[, fy[, fz]]"
    published = ("x", "y", "z")

    post_particles_to_grid = node_hook(push, shares=True)

    def __init__(self, hub: Hub, group: NodeGroup, *force: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "f", force)
