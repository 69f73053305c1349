"""Region style union."""

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
        """Test which positions lie inside, see `Region.contains`."""
        return self.joined.reduce([part.inside(x) for part in self.parts])

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        """Return the depth of positions in it, see `Region.distance`."""
        return self.high.reduce([part.depth(x, reach) for part in self.parts])
