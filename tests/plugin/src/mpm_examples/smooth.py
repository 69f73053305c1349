"""basis smooth: hats with rounded slopes, a product of one function per direction."""

from typing import Annotated, NamedTuple

from karamelo_py.language.signature import In
from karamelo_py.points.basis import BasisTraits
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.basis.product import Along, along, register


class Smooth(NamedTuple):
    """Hats, the more rounded the larger the share of the cubic r^2 (3 - 2 r) in them.

    Parameters
    ----------
    share
        That of the cubic.

    Example
    -------
    method(ulmpm, FLIP, smooth, 1, 0.5)
    """

    share: Annotated[float, In(0, 1)] = 0.5

    traits = BasisTraits(cells=1, least_nodes=2, steady_moment=False, steep_edge=True)


@along.on(Smooth)
def _along_smooth(basis, kin, grid, location, direction):
    hat = along(Linear(), kin, grid, location, direction)
    r = hat.r
    right = r + basis.share * r * (1 - r) * (2 * r - 1)
    slope = 1 + basis.share * (6 * r * (1 - r) - 1)
    gradients = tuple([slope * g for g in hat.gradients])
    return Along(hat.first, r, (1 - right, right), gradients, hat.affine)


register(Smooth, 2)
