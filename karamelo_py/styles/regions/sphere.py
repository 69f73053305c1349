"""Region style sphere."""

import numpy as np

from karamelo_py.language.by_dimension import Forms, place_of
from karamelo_py.language.signature import Argument
from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.region import Region, below, check_radius, split_exterior, within

FORMS = Forms(
    "region(ID, sphere, {names}[, exterior])",
    {1: ("x", "R"), 2: ("x", "y", "R"), 3: ("x", "y", "z", "R")},
)


class Sphere(Region):
    """A sphere in 3D, a disk in 2D, an interval in 1D; its surface belongs to it.

    Parameters
    ----------
    shape
        Centre and radius: in 1D ``x, R``; in 2D ``x, y, R``; in 3D ``x, y, z, R``. A last word
        ``exterior`` makes the region all that is outside.

    Example
    -------
    region(ball, sphere, 0.1, 0.1, 0.05)

    See Also
    --------
    block, cylinder
    """

    syntax = "x[, y[, z]], R[, exterior]"

    def __init__(self, hub: Hub, *shape: Argument):
        given, exterior = split_exterior(shape)
        dimension = require_domain(hub).dimension
        *centre, self.radius = FORMS.read(hub, given, dimension).values()
        check_radius(self.radius, place_of(FORMS.names[dimension], given, "R"))
        self.centre = np.array(centre)
        super().__init__(
            hub, self.centre - self.radius, self.centre + self.radius, exterior=exterior
        )

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Test which positions lie in the sphere, see `Region.contains`."""
        return within(x, self.centre, range(self.dimension), self.radius + self.tolerance)

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        """Return the depth of positions below the surface, see `Region.distance`."""
        return below(x, self.centre, range(self.dimension), self.radius)
