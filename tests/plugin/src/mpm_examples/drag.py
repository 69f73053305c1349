"""fix drag: points slow down."""

from math import exp
from typing import Annotated

from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.modify import Fix, PointsView


class Drag(Fix):
    """Slow points down in proportion to their velocity: dv/dt = -rate v.

    Parameters
    ----------
    group
        Group of points, or ``all``.
    rate
        Inverse of the time in which the velocity falls to 1/e.

    Example
    -------
    fix(air, drag, all, 0.5)

    Notes
    -----
    Publishes the momentum that the points of the group lost in the last step as ID_x, ID_y, ID_z.
    """

    published = ("x", "y", "z")

    def __init__(self, hub, group: ParticleGroup, rate: Annotated[float, NonNegative]):
        super().__init__(hub, group)
        self.rate = rate

    def initial_integrate(self, points: PointsView) -> None:
        """Let a step's worth of drag act, before anything else in the step."""
        lost = (1 - exp(-self.rate * points.dt)) * points.velocity
        points.velocity = points.velocity - lost
        self.publish_components(points.mass @ lost)
