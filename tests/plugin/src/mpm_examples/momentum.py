"""compute momentum."""

from karamelo_py.scene.modify import Compute


class Momentum(Compute):
    """Measure the momentum sum m v of points; published as ID_x, ID_y, ID_z.

    Parameters
    ----------
    group
        Group of points, or ``all``.

    Example
    -------
    compute(p, momentum, all)
    log_modify(custom, time, p_x)
    """

    published = ("x", "y", "z")

    def refresh(self) -> None:
        """Measure and publish."""
        fields = self.hub.fields
        ids = fields.members(self.group)
        self.publish_components(fields.mass[ids] @ fields.velocity[ids])
