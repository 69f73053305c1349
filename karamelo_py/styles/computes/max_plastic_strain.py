"""compute max_plastic_strain."""

from karamelo_py.scene.modify import Compute
from karamelo_py.styles.computes.columns import of_group


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
        for published, field in (("Epmax", "ep"), ("Tmax", "T")):
            values = of_group(self.hub, self.group, field)
            self.publish(published, float(values.max(initial=0)))
