"""Region style intersection."""

import numpy as np

from karamelo_py.styles.regions.union import Union


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
