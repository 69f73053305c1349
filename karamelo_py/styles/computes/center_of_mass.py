"""compute center_of_mass."""

import numpy as np

from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import AnyGroup, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute


class CenterOfMass(Compute):
    """Measure the centre of mass, published as ID_x, ID_y, ID_z.

    Parameters
    ----------
    group
        Group of points or of nodes, or ``all`` points. Nodes have the mass that the points bring.

    Example
    -------
    compute(middle, center_of_mass, ball)
    log_modify(custom, time, middle_x, middle_y)

    Notes
    -----
    0 for a group without mass.

    See Also
    --------
    xcm, max_position, average_velocity
    """

    published = ("x", "y", "z")

    def __init__(self, hub: Hub, group: AnyGroup):
        super().__init__(hub, group)

    def refresh(self) -> None:
        """Measure and publish."""
        fields, on_points = self.hub.fields, isinstance(self.group, ParticleGroup)
        total, *moments = fields.added_up(self) if on_points else fields.mass_at_nodes(self.group)
        self.publish_components(np.array(moments) / total if total > 0 else np.zeros(3))

    def terms(self, points: PointTable) -> list[np.ndarray]:
        """Masses of points, and these times where they are."""
        mass = points.mass.astype(float)
        return [mass, *(mass * points.position.T)]
