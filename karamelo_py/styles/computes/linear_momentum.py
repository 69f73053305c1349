"""compute linear_momentum."""

import numpy as np

from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.styles.computes.drift import Drift


class LinearMomentum(Compute):
    """Measure the momentum sum m v of points, and how far it has drifted.

    Example
    -------
    compute(p, linear_momentum, all)
    log_modify(custom, time, p_x, p_drift)

    Notes
    -----
    Publishes ID_x, ID_y, ID_z, and ID_drift, the length of the change since the first output
    relative to the largest sum m |v| so far.

    See Also
    --------
    angular_momentum, average_velocity
    """

    published = ("x", "y", "z", "drift")
    remembers = ("_drift",)

    def __init__(self, hub: Hub, group: ParticleGroup):
        super().__init__(hub, group)
        self._drift = Drift()

    def refresh(self) -> None:
        """Measure and publish."""
        *total, scale = self.hub.fields.added_up(self)
        self.publish_components(np.array(total))
        self.publish("drift", self._drift(np.array(total), scale))

    def terms(self, points: PointTable) -> np.ndarray:
        """Momenta of points, and what they are without their direction."""
        mass, v = points.mass.astype(float), points.velocity.astype(float)
        return mass * np.vstack([v.T, np.linalg.norm(v, axis=1)])
