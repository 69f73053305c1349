"""compute max_position."""

from karamelo_py.scene.modify import Compute


class MaxPosition(Compute):
    """Measure the largest coordinates among points, each on its own; published as ID_x, ID_y, ID_z.

    Example
    -------
    compute(front, max_position, water)
    log_modify(custom, time, front_x)
    """

    published = ("x", "y", "z")

    def refresh(self) -> None:
        """Measure and publish."""
        position = self.hub.fields.position[self.hub.fields.members(self.group)]
        # Without points, 0, as the sums of other computes.
        self.publish_components(position.max(axis=0) if len(position) else position.sum(axis=0))
