"""CPDI2 in space: hexahedra (H8) whose corners go with the velocity of the grid."""

from __future__ import annotations

from karamelo_py.compiler.compile import real, shared
from karamelo_py.compiler.tuples import add, scale, subtract
from karamelo_py.points.basis.cpdi import CUBE, Domain, Element, domain, upright
from karamelo_py.points.basis.cpdi.corners import register_carried
from karamelo_py.points.kinematics import Space

# Weights of the ends of an edge at the nearer and the farther of its two Gauss points.
NEAR, FAR = (1 + 3**-0.5) / 2, (1 - 3**-0.5) / 2


class H8(Domain):
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


@shared
def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@shared
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@shared
def _at_gauss(a, b, c, d):
    """What a bilinear function with these values at (-,-), (+,-), (-,+), (+,+) is at Gauss points.

    Also, since the weights are symmetric, what values at the Gauss points give to the corners.
    """
    near, far = real(NEAR, a[0]), real(FAR, a[0])
    e, f = _mix(near, a, far, b), _mix(far, a, near, b)
    g, h = _mix(near, c, far, d), _mix(far, c, near, d)
    return (
        _mix(near, e, far, g),
        _mix(near, f, far, h),
        _mix(far, e, near, g),
        _mix(far, f, near, h),
    )


@shared
def _mix(p, a, q, b):
    return add(scale(p, a), scale(q, b))


@shared
def _edges(place):
    """Half of the edges along each direction; the other two directions go as in `_at_gauss`."""
    a, b, c, d = place[3:6], place[6:9], place[9:12], place[12:15]
    e, f, g, h = place[15:18], place[18:21], place[21:24], place[24:27]
    half = real(0.5, place[0])
    return (
        (_half(half, b, a), _half(half, c, d), _half(half, f, e), _half(half, g, h)),
        (_half(half, d, a), _half(half, c, b), _half(half, h, e), _half(half, g, f)),
        (_half(half, e, a), _half(half, f, b), _half(half, h, d), _half(half, g, c)),
    )


@shared
def _half(half, b, a):
    return scale(half, subtract(b, a))


@domain.on(H8, Space)
def _(basis, kin, place):
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
    p = _at_gauss(add(c000, c100), add(c010, c110), add(c001, c101), add(c011, c111))
    q = _at_gauss(
        add(_cross(w00, u00), _cross(w01, u10)),
        add(_cross(w10, u00), _cross(w11, u10)),
        add(_cross(w00, u01), _cross(w01, u11)),
        add(_cross(w10, u01), _cross(w11, u11)),
    )
    r = _at_gauss(
        add(_cross(u00, v00), _cross(u01, v01)),
        add(_cross(u00, v10), _cross(u01, v11)),
        add(_cross(u10, v00), _cross(u11, v01)),
        add(_cross(u10, v10), _cross(u11, v11)),
    )
    # det J, two Gauss points of xi in each tuple; spread over the corners.
    d00, d10, d01, d11 = _at_gauss(
        (_dot(u00, c000), _dot(u00, c100)),
        (_dot(u10, c010), _dot(u10, c110)),
        (_dot(u01, c001), _dot(u01, c101)),
        (_dot(u11, c011), _dot(u11, c111)),
    )
    volume = add(add(d00, d10), add(d01, d11))
    k = real(1, place[0]) / (volume[0] + volume[1])
    near, far = k * real(NEAR, k), k * real(FAR, k)
    half = k * real(0.5, k)
    weights = (
        near * d00[0] + far * d00[1],
        far * d00[0] + near * d00[1],
        far * d10[0] + near * d10[1],
        near * d10[0] + far * d10[1],
        near * d01[0] + far * d01[1],
        far * d01[0] + near * d01[1],
        far * d11[0] + near * d11[1],
        near * d11[0] + far * d11[1],
    )
    gradients = (
        _slope(-half, p[0], -half, q[0], -half, r[0]),
        _slope(half, p[0], -half, q[1], -half, r[1]),
        _slope(half, p[1], half, q[1], -half, r[3]),
        _slope(-half, p[1], half, q[0], -half, r[2]),
        _slope(-half, p[2], -half, q[2], half, r[0]),
        _slope(half, p[2], -half, q[3], half, r[1]),
        _slope(half, p[3], half, q[3], half, r[3]),
        _slope(-half, p[3], half, q[2], half, r[2]),
    )
    corners = (
        place[3:6], place[6:9], place[9:12], place[12:15],
        place[15:18], place[18:21], place[21:24], place[24:27],
    )  # fmt: skip
    return corners, weights, gradients


@shared
def _slope(a, p, b, q, c, r):
    return add(_mix(a, p, b, q), scale(c, r))


@shared
def _corner(u, v, w):
    return _dot(u, _cross(v, w))


@upright.on(H8)
def _(basis, kin, place):
    u, v, w = _edges(place)
    lower = min(
        min(_corner(u[0], v[0], w[0]), _corner(u[0], v[1], w[1])),
        min(_corner(u[1], v[1], w[3]), _corner(u[1], v[0], w[2])),
    )
    upper = min(
        min(_corner(u[2], v[2], w[0]), _corner(u[2], v[3], w[1])),
        min(_corner(u[3], v[3], w[3]), _corner(u[3], v[2], w[2])),
    )
    return min(lower, upper) > 0


register_carried(H8)
