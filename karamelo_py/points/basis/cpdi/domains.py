"""CPDI domains: parallelograms that deform with the point, and elements whose corners move."""

from karamelo_py.compiler import real
from karamelo_py.points import basis as bases
from karamelo_py.points.basis import cpdi
from karamelo_py.points.kinematics import Space, cofactor, determinant, dot, total, vector


class _Parallel(cpdi.ConvectedDomain):
    __slots__ = ()
    traits = cpdi.ConvectedDomain.traits._replace(shape=("half_edges",))


class R4(_Parallel):
    """Parallelograms, given by x and two half edges, which rotate and stretch with the point.

    In non-uniform strain, neighbours may overlap or separate (Sadeghirad, Brannon & Burghardt
    2011).

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, R4)
    """

    __slots__ = ()
    dimension = 2


class R8(_Parallel):
    """Parallelepipeds, given by x and three half edges, which rotate and stretch with the point.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, R8)
    """

    __slots__ = ()
    dimension = 3


def half_edges(kin, location):
    d = kin.dimension
    return [vector(kin, location[d * e : d * e + d]) for e in range(1, d + 1)]


def reciprocals(kin, edges, factor):
    d = kin.dimension
    a = {(e, i): edges[e][i] for e in range(d) for i in range(d)}
    return [vector(kin, [factor * cofactor(a, d, e, i) for i in range(d)]) for e in range(d)]


def signed(sign, a, b):
    return a + b if sign > 0 else a - b


@cpdi.domain.on(_Parallel)
def _domain_parallel(basis, kin, location):
    d = kin.dimension
    x, edges = vector(kin, location[:d]), half_edges(kin, location)
    weight = real(0.5**d, location[0])
    k = weight / determinant({(e, i): edges[e][i] for e in range(d) for i in range(d)}, d)
    corners: list = []
    gradients: list = []
    # In 2D, the mean gradient of N_c is (+-A +- B) / 4. A and B are the reciprocal vectors of the
    # half edges a and b: A . a = B . b = 1, A . b = B . a = 0. In 3D, multiplying them by k before
    # the sums takes nine products, and after the sums twelve.
    A = reciprocals(kin, edges, k if d == 3 else 1)
    for signs in cpdi.SQUARE if d == 2 else cpdi.CUBE:
        corner = signed(signs[0], x, signed(signs[0] * signs[1], edges[0], edges[1]))
        slope = signed(signs[0] * signs[1], A[0], A[1])
        if d == 2:
            slope = vector(kin, [k * a for a in slope])
        slope = slope if signs[0] > 0 else -slope
        if d == 3:
            corner, slope = signed(signs[2], corner, edges[2]), signed(signs[2], slope, A[2])
        corners, gradients = [*corners, corner], [*gradients, slope]
    return tuple(corners), (weight,) * len(corners), tuple(gradients)


@bases.deformed.on(_Parallel)
def _deformed_parallel(basis, kin, location, dl):
    dl = dl.planar()  # r <- (I + dl) r
    edges = [r + dl @ r for r in half_edges(kin, location)]
    return (*location[: kin.dimension], *[a for edge in edges for a in edge])


@bases.extent.on(_Parallel)
def _extent_parallel(basis, kin, grid, location):
    away = [
        total([abs(a) for a in parts]) for parts in zip(*half_edges(kin, location), strict=True)
    ]
    far = away[0]
    for other in away[1:]:  # NaN remains NaN
        far = far + max(other - far, 0)
    return max(far * grid.inv_h, cpdi.LEAST[kin.dimension])


class _Simplex(cpdi.CarriedDomain):
    __slots__ = ()


class T3(_Simplex):
    """Triangles of a mesh: three corners of weight 1/3.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, T3)
    """

    __slots__ = ()
    dimension = 2
    element = cpdi.Element("triangle", 3, ((0, 1), (0, 2)), (0, 2, 1))


class Tet4(_Simplex):
    """Tetrahedra of a mesh: four corners of weight 1/4 (Sinaie et al. 2017).

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, Tet4)
    """

    __slots__ = ()
    dimension = 3
    element = cpdi.Element("tetra", 4, ((0, 1), (0, 2), (0, 3)), (0, 2, 1, 3))


def corners_and_edges(kin, location):
    d = kin.dimension
    corners = [vector(kin, location[d * c : d * c + d]) for c in range(1, d + 2)]
    edges = [corner - corners[0] for corner in corners[1:]]
    return corners, {(e, i): edges[e][i] for e in range(d) for i in range(d)}


@cpdi.domain.on(_Simplex)
def _domain_simplex(basis, kin, location):
    d = kin.dimension
    corners, edges = corners_and_edges(kin, location)
    k = 1 / determinant(edges, d)
    others = [vector(kin, [k * cofactor(edges, d, e, i) for i in range(d)]) for e in range(d)]
    first = -others[0]
    for other in others[1:]:
        first = first - other
    weight = real(1 / (d + 1), k)
    return tuple(corners), (weight,) * (d + 1), (first, *others)


@cpdi.upright.on(_Simplex)
def _upright_simplex(basis, kin, location):
    return determinant(corners_and_edges(kin, location)[1], kin.dimension) > 0


class Q4(cpdi.CarriedDomain):
    """Quadrilaterals whose corners move with the grid.

    Domains tile the body without gaps (Sadeghirad, Brannon & Guilkey 2013). In strong shear they
    tangle, which ends the run; R4 parallelograms cannot tangle.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, Q4)
    """

    __slots__ = ()
    dimension = 2
    element = cpdi.Element("quad", 4, ((0, 2), (1, 3)), (0, 3, 2, 1), cpdi.SQUARE)


@cpdi.domain.on(Q4)
def _domain_q4(basis, kin, location):
    x1, y1, x2, y2, x3, y3, x4, y4 = location[2:]
    # Products of the diagonals, whose cross product is 2 V.
    px, py = x3 - x1, y3 - y1
    qx, qy = x4 - x2, y4 - y2
    double = px * qy - qx * py
    k = 1 / double
    # Sadeghirad et al. 2013: w = (6 V -+ a -+ b) / (24 V)
    a = (x4 - x1) * (y2 - y3) - (x2 - x3) * (y4 - y1)
    b = (x3 - x4) * (y1 - y2) - (x1 - x2) * (y3 - y4)
    m = k * (1 / 12)
    p, q = m * (a + b), m * (a - b)
    gx, gy, hx, hy = k * qy, k * qx, k * py, k * px
    return (
        ((x1, y1), (x2, y2), (x3, y3), (x4, y4)),
        (0.25 - p, 0.25 - q, 0.25 + p, 0.25 + q),
        ((-gx, gy), (hx, -hy), (gx, -gy), (-hx, hy)),
    )


@cpdi.upright.on(Q4)
def _upright_q4(basis, kin, location):
    x1, y1, x2, y2, x3, y3, x4, y4 = location[2:]
    ax, ay, bx, by = x2 - x1, y2 - y1, x3 - x2, y3 - y2
    cx, cy, dx, dy = x4 - x3, y4 - y3, x1 - x4, y1 - y4
    least = min(
        min(ax * by - bx * ay, bx * cy - cx * by), min(cx * dy - dx * cy, dx * ay - ax * dy)
    )
    return least > 0


# Weights of an end of an edge at the near and the far Gauss point.
NEAR, FAR = (1 + 3**-0.5) / 2, (1 - 3**-0.5) / 2
PAIRS = (0, 0), (1, 0), (0, 1), (1, 1)


class H8(cpdi.CarriedDomain):
    """Trilinear hexahedra whose corners move with the grid.

    Weights and gradients are exact means: 2 x 2 x 2 Gauss points integrate N det J, a cubic in each
    direction, and grad N det J, of lower order.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, H8)
    """

    __slots__ = ()
    dimension = 3
    element = cpdi.Element(
        "hexahedron", 8, ((0, 1), (0, 3), (0, 4)), (4, 5, 6, 7, 0, 1, 2, 3), cpdi.CUBE
    )


def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _at_gauss(a, b, c, d):
    """Interpolate bilinearly from (-,-), (+,-), (-,+), (+,+) to the Gauss points, or back."""
    e, f = _mix(NEAR, a, FAR, b), _mix(FAR, a, NEAR, b)
    g, h = _mix(NEAR, c, FAR, d), _mix(FAR, c, NEAR, d)
    return (
        _mix(NEAR, e, FAR, g),
        _mix(NEAR, f, FAR, h),
        _mix(FAR, e, NEAR, g),
        _mix(FAR, f, NEAR, h),
    )


def _mix(p, a, q, b):
    return tuple([p * x + q * y for x, y in zip(a, b, strict=True)])


def _add(a, b):
    return tuple([x + y for x, y in zip(a, b, strict=True)])


def _across(e: int, a: int, b: int, s: int) -> tuple[int, ...]:
    others = (a, b)
    return (*others[:e], s, *others[e:])


def _edges(location):
    """Return half edges along each axis, ordered in the other two as in `_at_gauss`."""
    at = {signs: [location[3 * c + 3 + i] for i in range(3)] for c, signs in enumerate(cpdi.CUBE)}

    def half(e, a, b):
        lower, upper = at[_across(e, a, b, -1)], at[_across(e, a, b, 1)]
        return [0.5 * (upper[i] - lower[i]) for i in range(3)]

    return [[half(e, a, b) for b in (-1, 1) for a in (-1, 1)] for e in range(3)]


@cpdi.domain.on(H8)
def _domain_h8(basis, kin, location):
    # Rows of the Jacobian: u is independent of xi, v of eta, w of zeta; keys are Gauss points of
    # the other two coordinates.
    u, v, w = [dict(zip(PAIRS, _at_gauss(*along), strict=True)) for along in _edges(location)]
    # Cofactors along xi by xi, eta, zeta, summed over the Gauss points of xi, and so on.
    first = {(a, b, c): _cross(v[a, c], w[a, b]) for a in (0, 1) for b, c in PAIRS}
    p = _at_gauss(*[_add(first[0, b, c], first[1, b, c]) for b, c in PAIRS])
    q = _at_gauss(*[_add(_cross(w[a, 0], u[0, c]), _cross(w[a, 1], u[1, c])) for a, c in PAIRS])
    r = _at_gauss(*[_add(_cross(u[b, 0], v[a, 0]), _cross(u[b, 1], v[a, 1])) for a, b in PAIRS])
    # det J, two Gauss points of xi per tuple, distributed to the corners
    d = _at_gauss(*[tuple([dot(u[b, c], first[a, b, c]) for a in (0, 1)]) for b, c in PAIRS])
    return _means(location, d, p, q, r)


def _at(a: int, b: int) -> int:
    return (a > 0) + 2 * (b > 0)


def _means(location, d, p, q, r):
    sums = [(d[0][n] + d[1][n]) + (d[2][n] + d[3][n]) for n in range(2)]
    k = 1 / (sums[0] + sums[1])
    near, far, half = k * NEAR, k * FAR, k * 0.5
    corners, weights, gradients = [], [], []
    for c, (x, y, z) in enumerate(cpdi.CUBE):
        corners.append(Space.Vector._make(location[3 * c + 3 : 3 * c + 6]))
        first, second = (near, far) if x < 0 else (far, near)
        at = d[_at(y, z)]
        weights.append(first * at[0] + second * at[1])
        halves = [-half if sign < 0 else half for sign in (x, y, z)]
        u, v, w = p[_at(y, z)], q[_at(x, z)], r[_at(x, y)]
        slope = [halves[0] * u[i] + halves[1] * v[i] + halves[2] * w[i] for i in range(3)]
        gradients.append(Space.Vector._make(slope))
    return tuple(corners), tuple(weights), tuple(gradients)


@cpdi.upright.on(H8)
def _upright_h8(basis, kin, location):
    u, v, w = _edges(location)
    met = [(u[_at(y, z)], v[_at(x, z)], w[_at(x, y)]) for x, y, z in cpdi.CUBE]
    return min(*[dot(a, _cross(b, c)) for a, b, c in met]) > 0
