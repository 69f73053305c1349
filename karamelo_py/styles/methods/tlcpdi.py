"""method tlcpdi: convected domains, weights in the reference configuration."""

from karamelo_py.points.frames import Total
from karamelo_py.styles.methods.base import OwnGrids
from karamelo_py.styles.methods.cpdi import Convected


class TLCPDI(Convected, OwnGrids):
    """Total Lagrangian CPDI: the initial domain of every point on a grid of its solid's own.

    Domains keep their initial shape, so that none tangles; weights never change. Solids do not see
    each other on the grid. The variants are those of ulcpdi.

    Parameters
    ----------
    variant
        The shape of the domains.

    Example
    -------
    method(tlcpdi, FLIP, linear, 1, Q4)
    """

    frame = Total()
