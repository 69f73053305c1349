"""compute average_velocity."""

import numpy as np

from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.modify import Compute


class AverageVelocity(Compute):
    """Measure the plain mean of the velocities of points; published as ID_x, ID_y, ID_z.

    Example
    -------
    compute(v, average_velocity, all)
    log_modify(custom, time, v_x)
    """

    published = ("x", "y", "z")

    def refresh(self) -> None:
        """Measure and publish."""
        count, *total = self.hub.fields.added_up(self)
        # Without points, 0, as the sums of other computes.
        self.publish_components(np.array(total) / max(count, 1))

    def terms(self, points: PointTable) -> list[np.ndarray]:
        """One, and the velocity, of each point."""
        return [np.ones(points.count), *points.velocity.T]
