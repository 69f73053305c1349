"""fix irradiate: a field that points have because of the fix, and its column."""

from typing import Annotated

import numpy as np

from karamelo_py.compiler.fields import Field
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.modify import Fix, PointsView


class Dose(Field):
    """Radiation that a point has taken up."""

    columns = ("dose",)


class Irradiate(Fix):
    """Shine on points from x = 0 on, through what absorbs: d(dose)/dt = intensity exp(-x / depth).

    Parameters
    ----------
    group
        Group of points, or ``all``.
    intensity
        Dose rate at x = 0.
    depth
        Where the intensity has fallen to 1/e.

    Example
    -------
    fix(sun, irradiate, all, 2, 0.5)
    compute(mean, probe, all, dose)

    Notes
    -----
    The column dose of dumps shows what each point has taken up.
    """

    published = ()
    conserves = True
    point_fields = (Dose,)

    def __init__(
        self,
        hub,
        group: ParticleGroup,
        intensity: Annotated[float, NonNegative],
        depth: Annotated[float, Positive],
    ):
        super().__init__(hub, group)
        self.intensity, self.depth = intensity, depth

    def initial_integrate(self, points: PointsView) -> None:
        """Add a step's worth of dose, (n, 1)."""
        rate = self.intensity * np.exp(-points.position[:, :1] / self.depth)
        points[Dose] += rate * points.dt
