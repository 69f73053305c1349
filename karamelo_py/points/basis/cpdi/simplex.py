"""CPDI on triangles (T3) and tetrahedra (Tet4) whose corners go with the velocity of the grid."""

from karamelo_py.compiler.compile import real
from karamelo_py.points.basis.cpdi import ConvectedDomain, Element, domain, upright
from karamelo_py.points.basis.cpdi.corners import register_carried, tags_of
from karamelo_py.points.kinematics import vector
from karamelo_py.points.kinematics.tensors import cofactor, determinant


class T3(ConvectedDomain):
    """Triangles of a mesh: three corners, each with a third of the weight.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, T3)
    """

    __slots__ = ()
    dimension = 2
    shape = ("corners",)
    element = Element("triangle", 3, ((0, 1), (0, 2)), (0, 2, 1))


class Tet4(ConvectedDomain):
    """Tetrahedra of a mesh: four corners, each with a quarter of the weight.

    The choice of Sinaie et al. 2017 for the cantilever.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, Tet4)
    """

    __slots__ = ()
    dimension = 3
    shape = ("corners",)
    element = Element("tetra", 4, ((0, 1), (0, 2), (0, 3)), (0, 2, 1, 3))


def corners_and_edges(kin, place):
    """The corners, vectors, and components of the edges from the first to the others."""
    d = kin.dimension
    corners = [vector(kin, place[d * c : d * c + d]) for c in range(1, d + 2)]
    edges = [corner - corners[0] for corner in corners[1:]]
    return corners, {(e, i): edges[e][i] for e in range(d) for i in range(d)}


def domain_of(basis, kin, place):
    """Find corners, weights and gradients."""
    d = kin.dimension
    corners, edges = corners_and_edges(kin, place)
    k = 1 / determinant(edges, d)
    # Reciprocal vectors of the edges; the gradients add up to nothing.
    others = [vector(kin, [k * cofactor(edges, d, e, i) for i in range(d)]) for e in range(d)]
    first = -others[0]
    for other in others[1:]:
        first = first - other
    weight = real(1 / (d + 1), k)
    return tuple(corners), (weight,) * (d + 1), (first, *others)


def upright_simplex(basis, kin, place):
    """Check that the volume is positive."""
    return determinant(corners_and_edges(kin, place)[1], kin.dimension) > 0


for _basis in (T3, Tet4):
    for _tag in tags_of(_basis.dimension):
        domain.on(_basis, _tag)(domain_of)
    upright.on(_basis)(upright_simplex)
    register_carried(_basis)
