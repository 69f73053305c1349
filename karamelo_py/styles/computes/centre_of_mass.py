"""compute centre_of_mass."""

from __future__ import annotations

from karamelo_py.scene.modify import Compute


class CentreOfMass(Compute):
    """Measure the centre of mass of points; published as ID_x, ID_y, ID_z.

    Parameters
    ----------
    group
        Group of points, or ``all``.

    Example
    -------
    compute(c, centre_of_mass, all)
    log_modify(custom, time, c_x)

    See Also
    --------
    position_quantile, max_position, average_velocity
    """

    published = ("x", "y", "z")

    def refresh(self) -> None:
        """Measure and publish."""
        fields = self.hub.fields
        ids = fields.members(self.group)
        mass = fields.mass[ids].astype(float)
        # Without points, 0, as the sums of other computes.
        self.publish_components(mass @ fields.position[ids] / (mass.sum() or 1.0))
