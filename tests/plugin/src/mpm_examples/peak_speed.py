"""fix peak_speed: a field that nodes have because of the fix, and its column."""

import numpy as np

from karamelo_py.compiler.fields import Field
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.modify import Fix, NodesView


class Peak(Field):
    """The largest speed that a node has had."""

    columns = ("peak",)


class PeakSpeed(Fix):
    """Keep the largest speed that each node has had.

    Example
    -------
    fix(p, peak_speed, all)
    dump(d, all, grid, 100, grid.*.LAMMPS, peak)
    """

    published = ()
    conserves = True  # it only measures: the energy of the scene stays watched
    node_fields = (Peak,)

    def __init__(self, hub, group: NodeGroup):
        super().__init__(hub, group)

    def post_update_grid_state(self, nodes: NodesView) -> None:
        """Compare with the velocity after the momentum update, (n, d)."""
        speed = np.linalg.norm(nodes.velocity_update, axis=1)
        nodes[Peak] = np.maximum(nodes[Peak], speed[:, None])
