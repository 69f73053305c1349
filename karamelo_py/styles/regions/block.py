"""Region style block."""

import math

import numpy as np

from karamelo_py.language.by_dimension import Forms, place_of
from karamelo_py.language.signature import Argument
from karamelo_py.scene.domain import require_domain
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.region import Region, check_order, split_exterior

_NAMES = ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")
FORMS = Forms(
    "region(ID, block, {names}[, exterior])",
    {dimension: _NAMES[: 2 * dimension] for dimension in (1, 2, 3)},
    open_ends={name: -math.inf if name.endswith("lo") else math.inf for name in _NAMES},
)


class BlockRegion(Region):
    """A box with faces along the axes; its faces belong to it.

    Parameters
    ----------
    bounds
        In 1D ``xlo, xhi``; in 2D ``xlo, xhi, ylo, yhi``; in 3D
        ``xlo, xhi, ylo, yhi, zlo, zhi``. Each is a number, or ``INF`` (or ``EDGE``) where the
        block reaches as far as the domain does. Equal numbers make a plane, a line or a point,
        which is useful for groups of nodes. A last word ``exterior`` makes the region all that
        is outside the block.

    Example
    -------
    region(bar, block, 0, 1, 0, 0.2)
    region(left, block, 0, 0, INF, INF)
    region(rest, block, 0.2, 0.8, 0.2, 0.8, exterior)

    See Also
    --------
    cylinder, sphere
    """

    syntax = "xlo, xhi[, ylo, yhi[, zlo, zhi]][, exterior]"

    def __init__(self, hub: Hub, *bounds: Argument):
        given, exterior = split_exterior(bounds)
        dimension = require_domain(hub).dimension
        values = FORMS.read(hub, given, dimension)
        for axis in range(dimension):
            names = _NAMES[2 * axis : 2 * axis + 2]
            place = place_of(FORMS.names[dimension], given, names[0])
            check_order(values[names[0]], values[names[1]], names, place)
        self.corner_lo = np.array([values[name] for name in _NAMES[0 : 2 * dimension : 2]])
        self.corner_hi = np.array([values[name] for name in _NAMES[1 : 2 * dimension : 2]])
        super().__init__(hub, self.corner_lo, self.corner_hi, exterior=exterior)

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Which positions lie between the faces, see `Region.contains`."""
        inside = np.ones(len(x), dtype=bool)
        for axis, (lo, hi) in enumerate(zip(self.corner_lo, self.corner_hi, strict=True)):
            if lo > -np.inf:
                inside &= x[:, axis] >= lo - self.tolerance
            if hi < np.inf:
                inside &= x[:, axis] <= hi + self.tolerance
        return inside

    def distance(self, x: np.ndarray, reach: float) -> np.ndarray:
        """How far positions lie between the faces, see `Region.distance`."""
        depth = np.full(len(x), reach)
        for axis, (lo, hi) in enumerate(zip(self.corner_lo, self.corner_hi, strict=True)):
            if lo > -np.inf:
                np.minimum(depth, x[:, axis] - lo, out=depth)
            if hi < np.inf:
                np.minimum(depth, hi - x[:, axis], out=depth)
        return depth
