"""CPDI proper: parallelograms (R4) and parallelepipeds (R8) that deform with the point."""

from karamelo_py.compiler.compile import real
from karamelo_py.points.basis import deformed, extent
from karamelo_py.points.basis.cpdi import CUBE, LEAST, SQUARE, ConvectedDomain, domain
from karamelo_py.points.basis.cpdi.corners import register, tags_of
from karamelo_py.points.kinematics import vector
from karamelo_py.points.kinematics.tensors import cofactor, determinant, total


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


def half_edges(kin, place):
    """The half edges of a place, vectors."""
    d = kin.dimension
    return [vector(kin, place[d * e : d * e + d]) for e in range(1, d + 1)]


def reciprocals(kin, edges, factor):
    """Cofactors of the edges by rows, times a factor."""
    d = kin.dimension
    a = {(e, i): edges[e][i] for e in range(d) for i in range(d)}
    return [vector(kin, [factor * cofactor(a, d, e, i) for i in range(d)]) for e in range(d)]


def signed(sign, a, b):
    """a + b, or a - b."""
    return a + b if sign > 0 else a - b


def domain_of(basis, kin, place):
    """Find corners, weights and gradients."""
    d = kin.dimension
    x, edges = vector(kin, place[:d]), half_edges(kin, place)
    weight = real(0.5**d, place[0])
    k = weight / determinant({(e, i): edges[e][i] for e in range(d) for i in range(d)}, d)
    corners: list = []
    gradients: list = []
    # Reciprocal vectors A, B (A . a = 1, A . b = 0 ...): N_c has the mean gradient (+-A +-B) / 4.
    # In space, nine products with k before the sums are fewer than twelve after them.
    A = reciprocals(kin, edges, k if d == 3 else 1)
    for signs in SQUARE if d == 2 else CUBE:
        corner = signed(signs[0], x, signed(signs[0] * signs[1], edges[0], edges[1]))
        slope = signed(signs[0] * signs[1], A[0], A[1])
        if d == 2:
            slope = vector(kin, [k * a for a in slope])
        slope = slope if signs[0] > 0 else -slope
        if d == 3:
            corner, slope = signed(signs[2], corner, edges[2]), signed(signs[2], slope, A[2])
        corners, gradients = [*corners, corner], [*gradients, slope]
    return tuple(corners), (weight,) * len(corners), tuple(gradients)


def deformed_edges(basis, kin, place, dl):
    """Deform the edges of a place: r <- (I + dl) r."""
    dl = dl.planar()
    edges = [r + dl @ r for r in half_edges(kin, place)]
    return (*place[: kin.dimension], *[a for edge in edges for a in edge])


def extent_of_edges(basis, kin, grid, place):
    """Find how far a corner is from the point in any direction, in cells; NaN if any part is."""
    away = [total([abs(a) for a in parts]) for parts in zip(*half_edges(kin, place), strict=True)]
    far = away[0]
    for other in away[1:]:  # so written, NaN comes through
        far = far + max(other - far, 0)
    return max(far * grid.inv_h, LEAST[kin.dimension])


for _basis in (R4, R8):
    for _tag in tags_of(_basis.dimension):
        domain.on(_basis, _tag)(domain_of)
    deformed.on(_basis)(deformed_edges)
    extent.on(_basis)(extent_of_edges)
    register(_basis, _basis.dimension, 2**_basis.dimension)
