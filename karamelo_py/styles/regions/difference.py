"""Region style difference."""

import numpy as np

from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.region import Region


class Difference(Region):
    """All that lies in the first region and not in the second.

    Parameters
    ----------
    first
        ID of the region to cut from.
    second
        ID of the region that is cut off, its surface included.

    Example
    -------
    region(plate, block, -1, 1, -1, 1)
    region(hole, cylinder, 0, 0, 0.2)
    region(sheet, difference, plate, hole)

    See Also
    --------
    union, intersection
    """

    def __init__(self, hub: Hub, first: Region, second: Region):
        used = slice(0, require_domain(hub).dimension)
        super().__init__(hub, first.box_lo[used], first.box_hi[used], parts=(first, second))

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Test which positions lie in the first region only, see `Region.contains`."""
        first, second = self.parts
        inside = first.inside(x)
        inside &= ~second.inside(x)
        return inside

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        """Return the depth of positions in it, see `Region.distance`."""
        first, second = (part.depth(x, reach) for part in self.parts)
        return np.minimum(first, -second)
