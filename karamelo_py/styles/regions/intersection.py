"""Region style intersection."""

from __future__ import annotations

import numpy as np

from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.region import Region


class Intersection(Region):
    """All that lies in each of two or more regions.

    Parameters
    ----------
    first, second, more
        IDs of regions. Those made with ``exterior`` count as what is outside their shape.

    Example
    -------
    region(disk, cylinder, 0, 0, 0.2)
    region(above, block, INF, INF, 0, INF)
    region(half, intersection, disk, above)

    See Also
    --------
    union, difference
    """

    def __init__(self, hub: Hub, first: Region, second: Region, *more: Region):
        parts = (first, second, *more)
        used = slice(0, require_domain(hub).dimension)
        super().__init__(
            hub,
            np.max([part.box_lo[used] for part in parts], axis=0),
            np.min([part.box_hi[used] for part in parts], axis=0),
            parts=parts,
        )

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Which positions lie in all parts, see `Region.contains`."""
        inside = self.parts[0].inside(x)
        for part in self.parts[1:]:
            inside &= part.inside(x)
        return inside
