"""compute position_quantile."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import In
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute


class PositionQuantile(Compute):
    """Measure the coordinates below which a share of the mass lies, each on its own.

    Published as ID_x, ID_y, ID_z. A front measured so does not jump after a few points that fly
    ahead, as the largest position does.

    Parameters
    ----------
    share
        Share of the mass, from 0 (the lowest point) to 1 (the highest).

    Example
    -------
    compute(front, position_quantile, all, 0.99)
    log_modify(custom, time, front_x)

    Notes
    -----
    The first coordinate at which the mass of the points up to there reaches the share.

    See Also
    --------
    max_position, center_of_mass
    """

    published = ("x", "y", "z")

    def __init__(self, hub: Hub, group: ParticleGroup, share: Annotated[float, In(0, 1)]):
        super().__init__(hub, group)
        self.share = share

    def refresh(self) -> None:
        """Measure and publish."""
        fields = self.hub.fields
        ids = fields.members(self.group)
        mass, position = fields.mass[ids].astype(float), fields.position[ids]
        if not len(ids):
            self.publish_components(np.zeros(position.shape[1]))
            return
        quantiles = []
        for column in position.T:
            order = np.argsort(column, kind="stable")
            below = np.cumsum(mass[order])
            # Shares such as 0.1 of ten equal points must not fail by rounding.
            reached = below >= self.share * below[-1] * (1 - 1e-12)
            quantiles.append(column[order[np.argmax(reached)]])
        self.publish_components(np.array(quantiles))
