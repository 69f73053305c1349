"""compute max_plastic_strain."""

from __future__ import annotations

from karamelo_py.modify import Compute


class MaxPlasticStrain(Compute):
    """Measure the largest equivalent plastic strain of a group of points; published as ID_Epmax.

    It is 0 where nothing can yield.

    Parameters
    ----------
    group
        Group of points, or ``all``.

    Example
    -------
    compute(worst, max_plastic_strain, all)
    log_modify(custom, time, worst_Epmax)

    See Also
    --------
    strength plastic
    """

    published = ("Epmax",)

    def refresh(self) -> None:
        """Measure and publish."""
        strain = self.hub.fields.particle("ep")[self.hub.fields.members(self.group)]
        if len(strain):
            self.publish("Epmax", float(strain.max()))
