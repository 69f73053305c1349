"""Region styles union, intersection and difference."""

import numpy as np

from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.region import Region


class Union(Region):
    """All that lies in at least one of two or more regions.

    Parameters
    ----------
    first, second, more
        IDs of regions. Those made with ``exterior`` count as what is outside their shape.

    Example
    -------
    region(a, block, 0, 1, 0, 0.2)
    region(b, block, 0, 0.2, 0, 1)
    region(angle, union, a, b)

    See Also
    --------
    intersection, difference
    """

    # How the insides and the corners of the boxes of the parts are put together.
    joined, low, high = np.logical_or, np.minimum, np.maximum

    def __init__(self, hub: Hub, first: Region, second: Region, *more: Region):
        parts = (first, second, *more)
        used = slice(0, require_domain(hub).dimension)
        super().__init__(
            hub,
            self.low.reduce([part.box_lo[used] for part in parts]),
            self.high.reduce([part.box_hi[used] for part in parts]),
            parts=parts,
        )

    def contains(self, x: np.ndarray) -> np.ndarray:
        return self.joined.reduce([part.inside(x) for part in self.parts])

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        return self.high.reduce([part.depth(x, reach) for part in self.parts])


class Intersection(Union):
    """All that lies in each of two or more regions.

    Example
    -------
    region(disk, cylinder, 0, 0, 0.2)
    region(above, block, INF, INF, 0, INF)
    region(half, intersection, disk, above)

    See Also
    --------
    union, difference
    """

    joined, low, high = np.logical_and, np.maximum, np.minimum


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
        first, second = self.parts
        return first.inside(x) & ~second.inside(x)

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        first, second = (part.depth(x, reach) for part in self.parts)
        return np.minimum(first, -second)
