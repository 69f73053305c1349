"""fix damp_nodes: nodes are held back by a force, inside the compiled loop."""

from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.modify import Fix, node_hook, per_direction
from karamelo_py.script.expressions import Expression


def damp(node):
    """A force against the velocity; its total is published."""
    drag = -node.mass * node.value * node.v
    return node.v, node.v_star, node.force + drag, drag


class DampNodes(Fix):
    """Hold nodes back with a force -rate m v in each direction.

    Parameters
    ----------
    group
        Group of nodes, or ``all``.
    rate
        cx, cy, cz, as many as the domain has dimensions: numbers or formulas. NULL leaves a
        direction alone.

    Example
    -------
    fix(settle, damp_nodes, all, 0.5, 0.5)

    Notes
    -----
    Publishes the total force as ID_x, ID_y, ID_z.
    """

    syntax = "group, cx[, cy[, cz]]"  # says it better than the signature: group[, rate, ...]
    published = ("x", "y", "z")

    post_particles_to_grid = node_hook(damp)

    def __init__(self, hub, group: NodeGroup, *rate: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "c", rate)
