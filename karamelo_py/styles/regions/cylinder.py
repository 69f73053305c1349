"""Region style cylinder."""

import math

import numpy as np

from karamelo_py.language.by_dimension import Forms, place_of
from karamelo_py.language.signature import Argument
from karamelo_py.scene import region
from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.hub import Hub

FORMS = Forms(
    "region(ID, cylinder, {names}[, exterior])",
    {2: ("xc", "yc", "R"), 3: ("axis", "c1", "c2", "R", "lo", "hi")},
    words={"axis": ("x", "y", "z")},
    open_ends={"lo": -math.inf, "hi": math.inf},
)


class Cylinder(region.Region):
    """A disk in 2D, a cylinder along one of the axes in 3D; its surface belongs to it.

    Parameters
    ----------
    shape
        In 2D ``xc, yc, R``: centre and radius. In 3D ``axis, c1, c2, R, lo, hi``: the word x, y
        or z, the centre in the other two directions (in the order x, y, z), the radius, and the
        ends along the axis, which may be ``INF`` (or ``EDGE``). A last word ``exterior`` makes
        the region all that is outside.

    Example
    -------
    region(disk, cylinder, -0.3, -0.3, 0.2)

    Notes
    -----
    In 3D: ``region(rod, cylinder, z, 0, 0, 0.1, INF, 0.5)``.

    See Also
    --------
    block, sphere
    """

    syntax = "xc, yc, R | axis, c1, c2, R, lo, hi[, exterior]"

    def __init__(self, hub: Hub, *shape: Argument):
        given, exterior = region.split_exterior(shape)
        dimension = require_domain(hub).dimension
        values = FORMS.read(hub, given, dimension)
        names = FORMS.names[dimension]
        self.radius = values["R"]
        region.check_radius(self.radius, place_of(names, given, "R"))
        if dimension == 2:
            self.along = None
            self.across = (0, 1)
            self.centre = (values["xc"], values["yc"])
            self.ends = (-math.inf, math.inf)
        else:
            self.along = "xyz".index(values["axis"])
            self.across = tuple(axis for axis in range(3) if axis != self.along)
            self.centre = (values["c1"], values["c2"])
            self.axis = self.along, self.centre
            self.ends = (values["lo"], values["hi"])
            region.check_order(*self.ends, ("lo", "hi"), place_of(names, given, "lo"))
        lo, hi = np.empty(dimension), np.empty(dimension)
        for axis, middle in zip(self.across, self.centre, strict=True):
            lo[axis], hi[axis] = middle - self.radius, middle + self.radius
        if self.along is not None:
            lo[self.along], hi[self.along] = self.ends
        super().__init__(hub, lo, hi, exterior=exterior)

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Which positions lie in the cylinder, see `Region.contains`."""
        inside = region.within(x, self.centre, self.across, self.radius + self.tolerance)
        if self.along is not None:
            inside &= x[:, self.along] >= self.ends[0] - self.tolerance
            inside &= x[:, self.along] <= self.ends[1] + self.tolerance
        return inside

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        """How far positions lie below the surface, see `Region.distance`."""
        depth = region.below(x, self.centre, self.across, self.radius)
        if self.along is not None:
            depth = np.minimum(depth, x[:, self.along] - self.ends[0])
            depth = np.minimum(depth, self.ends[1] - x[:, self.along])
        return depth
