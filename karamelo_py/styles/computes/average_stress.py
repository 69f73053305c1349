"""compute average_stress."""

from karamelo_py.output.point_table import COMPONENTS, PointTable
from karamelo_py.scene.modify import Compute


class AverageStress(Compute):
    """Measure the mean Cauchy stress, published as ID_11, ID_22, ID_33, ID_12, ID_13, ID_23.

    Example
    -------
    compute(s, average_stress, all)
    log_modify(custom, time, s_11, s_12)

    Notes
    -----
    The mean is over the present volume: sum V sigma / sum V, which for a body at rest follows from
    the forces on its surface alone. 0 for a group without points.

    See Also
    --------
    strain_energy, average_velocity
    """

    published = COMPONENTS

    def refresh(self) -> None:
        """Measure and publish."""
        volume, *total = self.hub.fields.added_up(self)
        for component, of_all in zip(COMPONENTS, total, strict=True):
            self.publish(component, of_all / volume if volume > 0 else 0.0)

    def terms(self, points: PointTable) -> list:
        """Volumes of points, and these times their stress."""
        volume = points.particle("volume")
        return [volume, *(volume * points.particle("s" + c) for c in COMPONENTS)]
