"""compute average_temperature."""

from __future__ import annotations

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
        values = self.hub.fields.particle("T")[self.hub.fields.members(self.group)]
        self.publish("", float(values.sum() / max(len(values), 1)))
