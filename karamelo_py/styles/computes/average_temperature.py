"""compute average_temperature."""

import numpy as np

from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.modify import Compute


class AverageTemperature(Compute):
    """Measure the mean temperature of a group of points; published as ID.

    All points count alike, and those of materials without a temperature as 0.

    Example
    -------
    compute(warmth, average_temperature, all)
    log_modify(custom, time, warmth)

    See Also
    --------
    max_plastic_strain, temperature plastic_work
    """

    published = ("",)

    def refresh(self) -> None:
        """Measure and publish."""
        count, total = self.hub.fields.added_up(self)
        self.publish("", total / max(count, 1))

    def terms(self, points: PointTable) -> list[np.ndarray]:
        """One, and the temperature, of each point."""
        return [np.ones(points.count), points.particle("T")]
