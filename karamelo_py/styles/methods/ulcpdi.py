"""method ulcpdi: convected domains on one grid for the whole scene."""

from karamelo_py.styles.methods.cpdi import Convected
from karamelo_py.styles.methods.ulmpm import ULMPM


class ULCPDI(Convected, ULMPM):
    """CPDI: every point has a domain that deforms with it, and sees the nodes around its corners.

    All solids share one grid. A body does not break between points, however far it stretches, and
    no force jumps when a point crosses a cell face (Sadeghirad et al. 2011, 2013).

    ``R4`` and ``R8``
        parallelograms and parallelepipeds that follow the deformation of their point: robust;
    ``Q4`` and ``H8``
        quadrilaterals and hexahedra whose corners move with the grid: no gaps nor overlaps;
    ``T3`` and ``Tet4``
        the triangles and tetrahedra of a mesh, whose corners move with the grid.

    Parameters
    ----------
    variant
        The shape of the domains.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, R4)
    method(ulcpdi, FLIP, linear, 1, mechanical, Q4)
    """
