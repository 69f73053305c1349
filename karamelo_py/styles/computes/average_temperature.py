"""compute average_temperature."""

from karamelo_py.scene.modify import Compute
from karamelo_py.styles.computes.columns import of_group


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
        values = of_group(self.hub, self.group, "T")
        self.publish("", float(values.sum() / max(len(values), 1)))
