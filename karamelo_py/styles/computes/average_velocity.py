"""compute average_velocity."""

from karamelo_py.scene.modify import Compute


class AverageVelocity(Compute):
    """Measure the plain mean of the velocities of points; published as ID_x, ID_y, ID_z.

    Example
    -------
    compute(v, average_velocity, all)
    log_modify(custom, time, v_x)
    """

    published = ("x", "y", "z")

    def refresh(self) -> None:
        """Measure and publish."""
        velocity = self.hub.fields.velocity[self.hub.fields.members(self.group)]
        # Without points, 0, as the sums of other computes.
        self.publish_components(velocity.sum(axis=0) / max(len(velocity), 1))
