"""compute max_plastic_strain."""

import numpy as np

from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.modify import Compute


class MaxPlasticStrain(Compute):
    """Measure the largest equivalent plastic strain and temperature of a group of points.

    Published as ID_Epmax and ID_Tmax; 0 where nothing can yield, or has a temperature.

    Example
    -------
    compute(worst, max_plastic_strain, all)
    log_modify(custom, time, worst_Epmax)

    See Also
    --------
    strength plastic
    """

    published = ("Epmax", "Tmax")

    def refresh(self) -> None:
        """Measure and publish."""
        found = np.max(self.hub.fields.each(self, "largest"), axis=0)
        for published, value in zip(self.published, found, strict=True):
            self.publish(published, float(value))

    def largest(self, points: PointTable) -> list[float]:
        """The largest strain and temperature of points."""
        return [points.particle(name).max(initial=0) for name in ("ep", "T")]
