"""CPDI2 in space: hexahedra (H8) whose corners go with the velocity of the grid."""

from karamelo_py.points.basis.cpdi import CUBE, ConvectedDomain, Element, domain, upright
from karamelo_py.points.basis.cpdi.corners import register_carried
from karamelo_py.points.kinematics import Space

# Weights of the ends of an edge at the nearer and the farther of its two Gauss points.
NEAR, FAR = (1 + 3**-0.5) / 2, (1 - 3**-0.5) / 2


class H8(ConvectedDomain):
    """Trilinear hexahedra of eight corners, which neighbouring points move alike.

    Weights and gradients are the exact means over the hexahedron: 2 x 2 x 2 Gauss points integrate
    up to the third power along each direction, and N det J is one, grad N det J less.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, H8)
    """

    __slots__ = ()
    dimension = 3
    shape = ("corners",)
    element = Element("hexahedron", 8, ((0, 1), (0, 3), (0, 4)), (4, 5, 6, 7, 0, 1, 2, 3), CUBE)


def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _at_gauss(a, b, c, d):
    """Interpolate values at (-,-), (+,-), (-,+), (+,+) to the Gauss points, bilinearly.

    Also, since the weights are symmetric, what values at the Gauss points give to the corners.
    """
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
    """Signs of a corner: `s` in direction e, `a` and `b` in the others."""
    others = (a, b)
    return (*others[:e], s, *others[e:])


def _edges(place):
    """Half of the edges along each direction; the other two directions go as in `_at_gauss`."""
    at = {signs: [place[3 * c + 3 + i] for i in range(3)] for c, signs in enumerate(CUBE)}

    def half(e, a, b):
        lower, upper = at[_across(e, a, b, -1)], at[_across(e, a, b, 1)]
        return [0.5 * (upper[i] - lower[i]) for i in range(3)]

    return [[half(e, a, b) for b in (-1, 1) for a in (-1, 1)] for e in range(3)]


@domain.on(H8, Space)
def _domain_h8_space(basis, kin, place):
    along = _edges(place)
    # Rows of the Jacobian at the Gauss points: u does not depend on xi, v not on eta, w not on
    # zeta; numbers say at which points of the other two directions.
    u00, u10, u01, u11 = _at_gauss(along[0][0], along[0][1], along[0][2], along[0][3])
    v00, v10, v01, v11 = _at_gauss(along[1][0], along[1][1], along[1][2], along[1][3])
    w00, w10, w01, w11 = _at_gauss(along[2][0], along[2][1], along[2][2], along[2][3])
    # Cofactors; those along xi are summed over the Gauss points of xi, and so on. The points of v
    # are (xi, zeta), those of w (xi, eta), those of u (eta, zeta).
    c000, c100 = _cross(v00, w00), _cross(v10, w10)
    c010, c110 = _cross(v00, w01), _cross(v10, w11)
    c001, c101 = _cross(v01, w00), _cross(v11, w10)
    c011, c111 = _cross(v01, w01), _cross(v11, w11)
    p = _at_gauss(_add(c000, c100), _add(c010, c110), _add(c001, c101), _add(c011, c111))
    q = _at_gauss(
        _add(_cross(w00, u00), _cross(w01, u10)),
        _add(_cross(w10, u00), _cross(w11, u10)),
        _add(_cross(w00, u01), _cross(w01, u11)),
        _add(_cross(w10, u01), _cross(w11, u11)),
    )
    r = _at_gauss(
        _add(_cross(u00, v00), _cross(u01, v01)),
        _add(_cross(u00, v10), _cross(u01, v11)),
        _add(_cross(u10, v00), _cross(u11, v01)),
        _add(_cross(u10, v10), _cross(u11, v11)),
    )
    # det J, two Gauss points of xi in each tuple; spread over the corners.
    d00, d10, d01, d11 = _at_gauss(
        (_dot(u00, c000), _dot(u00, c100)),
        (_dot(u10, c010), _dot(u10, c110)),
        (_dot(u01, c001), _dot(u01, c101)),
        (_dot(u11, c011), _dot(u11, c111)),
    )
    return _means(place, (d00, d10, d01, d11), p, q, r)


def _at(a: int, b: int) -> int:
    """Return the index of one of the four in the order of `_at_gauss`."""
    return (a > 0) + 2 * (b > 0)


def _means(place, d, p, q, r):
    """Corners, weights and gradients, from what det J and its cofactors give to the corners."""
    sums = [(d[0][n] + d[1][n]) + (d[2][n] + d[3][n]) for n in range(2)]
    k = 1 / (sums[0] + sums[1])
    near, far, half = k * NEAR, k * FAR, k * 0.5
    corners, weights, gradients = [], [], []
    for c, (x, y, z) in enumerate(CUBE):
        corners.append(Space.Vector._make(place[3 * c + 3 : 3 * c + 6]))
        first, second = (near, far) if x < 0 else (far, near)
        at = d[_at(y, z)]
        weights.append(first * at[0] + second * at[1])
        share = [-half if sign < 0 else half for sign in (x, y, z)]
        u, v, w = p[_at(y, z)], q[_at(x, z)], r[_at(x, y)]
        slope = [share[0] * u[i] + share[1] * v[i] + share[2] * w[i] for i in range(3)]
        gradients.append(Space.Vector._make(slope))
    return tuple(corners), tuple(weights), tuple(gradients)


@upright.on(H8)
def _upright_h8(basis, kin, place):
    # The least of the corners' Jacobians, from the half edges that meet there.
    u, v, w = _edges(place)
    met = [(u[_at(y, z)], v[_at(x, z)], w[_at(x, y)]) for x, y, z in CUBE]
    return min(*[_dot(a, _cross(b, c)) for a, b, c in met]) > 0


register_carried(H8)
