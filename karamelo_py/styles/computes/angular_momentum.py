"""compute angular_momentum."""

import numpy as np

from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.styles.computes.drift import Drift


class AngularMomentum(Compute):
    """Measure sum m (x - c) x v of points about a centre c, and how far it has drifted.

    Parameters
    ----------
    cx, cy, cz
        The centre.

    Example
    -------
    compute(L, angular_momentum, disk, 0.5, 0.5)
    log_modify(custom, time, L_z)

    Notes
    -----
    Publishes ID_x, ID_y, ID_z, and ID_drift, the length of the change since the first output
    relative to the largest sum m |x - c| |v| so far.

    With an affine transfer (APIC) points carry angular momentum in their moment of velocity too:
    it is part of the sum, which the transfer then conserves.

    See Also
    --------
    linear_momentum
    """

    published = ("x", "y", "z", "drift")
    remembers = ("_drift",)

    def __init__(
        self, hub: Hub, group: ParticleGroup, cx: float = 0.0, cy: float = 0.0, cz: float = 0.0
    ):
        super().__init__(hub, group)
        self.centre = np.array([cx, cy, cz])
        self._drift = Drift()

    def refresh(self) -> None:
        """Measure and publish."""
        *total, scale = self.hub.fields.added_up(self)
        self.publish_components(np.array(total))
        self.publish("drift", self._drift(np.array(total), scale))

    def terms(self, points: PointTable) -> np.ndarray:
        """Angular momenta of points, and what they are without their direction."""
        d = self.hub.domain.dimension
        arm, v = np.zeros((2, points.count, 3))
        arm[:, :d], v[:, :d] = points.position, points.velocity
        arm -= self.centre
        angular = np.cross(arm, v)
        moment = points.velocity_moment
        if moment is not None and d > 1:
            # B_ij = sum N v_i (X - x)_j: the part of v x arm within a point's surroundings.
            b = np.zeros((points.count, 3, 3))
            b[:, :d, :d] = moment.reshape(-1, d, d)
            angular += np.stack(
                [b[:, 2, 1] - b[:, 1, 2], b[:, 0, 2] - b[:, 2, 0], b[:, 1, 0] - b[:, 0, 1]], axis=1
            )
        scale = np.linalg.norm(arm, axis=1) * np.linalg.norm(v, axis=1)
        return points.mass * np.vstack([angular.T, scale])
