"""CPDI proper: parallelograms (R4) and parallelepipeds (R8) that deform with the point."""

from karamelo_py.compiler.symbols import Symbol, call, cofactor, determinant
from karamelo_py.points.basis import deformed, extent
from karamelo_py.points.basis.cpdi import CUBE, LEAST, SQUARE, ConvectedDomain, domain
from karamelo_py.points.basis.cpdi.corners import register, tags_of
from karamelo_py.points.kinematics import Axisymmetric, PlaneStrain, Space
from karamelo_py.points.kinematics.components import Number, Tensor, Vector, formula


class R4(ConvectedDomain):
    """Parallelograms: x and two half edges r, which turn and stretch with the point.

    Neighbouring domains may overlap or part a little where the strain is not uniform
    (Sadeghirad, Brannon & Burghardt 2011).

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, R4)
    """

    __slots__ = ()
    dimension = 2
    shape = ("half_edges",)


class R8(ConvectedDomain):
    """Parallelepipeds: x and three half edges r, which turn and stretch with the point.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, R8)
    """

    __slots__ = ()
    dimension = 3
    shape = ("half_edges",)


def _edges(d: int, place: Symbol) -> dict[tuple[int, int], Symbol]:
    """Component i of half edge e."""
    return {(e, i): place[d + d * e + i] for e in range(d) for i in range(d)}


def _combined(signs, vectors, i, start=0, factor=1):
    """start + s_0 factor (v_0 + s_0 s_1 v_1) + s_2 v_2, component i."""

    def signed(sign, item, total):
        return total + item if sign > 0 else total - item

    plane = factor * signed(signs[0] * signs[1], vectors[1, i], vectors[0, i])
    total = signed(signs[0], plane, start)
    for e in range(2, len(signs)):
        total = signed(signs[e], vectors[e, i], total)
    return total


@formula(PlaneStrain, Axisymmetric, Space)
def _domain(kin, place: Vector):
    """Corners, weights and gradients."""
    d = kin.dimension
    edges = _edges(d, place)
    weight = 0.5**d
    k = weight / determinant(edges, d)
    # Reciprocal vectors A, B (A . a = 1, A . b = 0 ...): N_c has the mean gradient (+-A +-B) / 4.
    # In space, nine products with k before the sums are fewer than twelve after them.
    first, last = (k, 1) if d == 3 else (1, k)
    reciprocal = {(e, i): first * cofactor(edges, d, e, i) for e, i in edges}
    around = SQUARE if d == 2 else CUBE
    corners = [[_combined(signs, edges, i, place[i]) for i in range(d)] for signs in around]
    slopes = [[_combined(signs, reciprocal, i, 0, last) for i in range(d)] for signs in around]
    return corners, (weight,) * len(around), slopes


@formula(PlaneStrain, Axisymmetric, Space)
def _deformed_edges(kin, place: Vector, dl: Tensor):
    """`place` with edges after the increment dl: r <- (I + dl) r."""
    d = kin.dimension
    edges = _edges(d, place)
    return kin.vector(lambda i: place[i]) + tuple(
        r + sum(dl[i, j] * edges[e, j] for j in range(d)) for (e, i), r in edges.items()
    )


@formula(PlaneStrain, Axisymmetric, Space)
def _extent(kin, grid: Number, place: Vector):
    """How far a corner is from the point in any direction, in cells; NaN if any component is."""
    edges = _edges(kin.dimension, place)
    away = kin.vector(lambda i: sum(abs(edges[e, i]) for e in kin.directions))
    far = away[0]
    for other in away[1:]:  # so written, NaN comes through
        far = far + call(max, other - far, 0.0)
    return call(max, far * grid.inv_h, LEAST[kin.dimension])


def domain_of(basis, kin, place):
    """Corners, weights and gradients."""
    return _domain(kin, place)


for _basis in (R4, R8):
    for _tag in tags_of(_basis.dimension):
        domain.on(_basis, _tag)(domain_of)

    @deformed.on(_basis)
    def _deformed_basis(basis, kin, place, dl):
        return _deformed_edges(kin, place, dl)

    @extent.on(_basis)
    def _extent_basis(basis, kin, grid, place):
        return _extent(kin, grid, place)

    register(_basis, _basis.dimension, 2**_basis.dimension)
