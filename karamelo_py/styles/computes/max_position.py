"""compute max_position."""

import numpy as np

from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.modify import Compute


class MaxPosition(Compute):
    """Measure the largest coordinates among points, each on its own; published as ID_x, ID_y, ID_z.

    Example
    -------
    compute(front, max_position, water)
    log_modify(custom, time, front_x)
    """

    published = ("x", "y", "z")

    def refresh(self) -> None:
        """Measure and publish."""
        found = self.hub.fields.each(self, "largest")
        # Without points, 0, as the sums of other computes.
        self.publish_components(np.max(found, axis=0) if found else np.zeros(3))

    def largest(self, points: PointTable) -> np.ndarray | None:
        """The largest coordinates of points."""
        return points.position.max(axis=0) if points.count else None
