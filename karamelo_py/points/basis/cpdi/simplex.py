"""CPDI on triangles (T3) and tetrahedra (Tet4) whose corners go with the velocity of the grid."""

from functools import reduce
from operator import sub

from karamelo_py.compiler.symbols import Symbol, cofactor, determinant
from karamelo_py.points.basis.cpdi import ConvectedDomain, Element, domain, upright
from karamelo_py.points.basis.cpdi.corners import register_carried, tags_of
from karamelo_py.points.kinematics import Axisymmetric, PlaneStrain, Space
from karamelo_py.points.kinematics.components import Vector, formula


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


def _edges(d: int, place: Symbol) -> dict[tuple[int, int], Symbol]:
    """Component i of the edge from the first corner to corner e + 1."""
    return {(e, i): place[d * (e + 2) + i] - place[d + i] for e in range(d) for i in range(d)}


@formula(PlaneStrain, Axisymmetric, Space)
def _domain(kin, place: Vector):
    """Corners, weights and gradients."""
    d = kin.dimension
    edges = _edges(d, place)
    k = 1 / determinant(edges, d)
    # Reciprocal vectors of the edges; the gradients add up to nothing.
    others = [[k * cofactor(edges, d, e, i) for i in range(d)] for e in range(d)]
    first = [reduce(sub, (g[i] for g in others[1:]), -others[0][i]) for i in range(d)]
    corners = [[place[d * (c + 1) + i] for i in range(d)] for c in range(d + 1)]
    return corners, (1 / (d + 1),) * (d + 1), (first, *others)


@formula(PlaneStrain, Axisymmetric, Space)
def _upright(kin, place: Vector):
    """Whether the volume is positive."""
    return determinant(_edges(kin.dimension, place), kin.dimension) > 0


def domain_of(basis, kin, place):
    """Corners, weights and gradients."""
    return _domain(kin, place)


for _basis in (T3, Tet4):
    for _tag in tags_of(_basis.dimension):
        domain.on(_basis, _tag)(domain_of)

    @upright.on(_basis)
    def _upright_basis(basis, kin, place):
        return _upright(kin, place)

    register_carried(_basis)
