"""CPDI2: quadrilaterals (Q4) whose corners go with the velocity of the grid."""

from karamelo_py.compiler.compile import real
from karamelo_py.points.basis.cpdi import SQUARE, ConvectedDomain, Element, domain, upright
from karamelo_py.points.basis.cpdi.corners import register_carried
from karamelo_py.points.kinematics import Axisymmetric, PlaneStrain


class Q4(ConvectedDomain):
    """Quadrilaterals of four corners, which neighbouring points move alike.

    Domains go on tiling the body without gaps (Sadeghirad, Brannon & Guilkey 2013). In strong shear
    they tangle, which ends the run; the parallelograms of R4 cannot.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, Q4)
    """

    __slots__ = ()
    dimension = 2
    shape = ("corners",)
    element = Element("quad", 4, ((0, 2), (1, 3)), (0, 3, 2, 1), SQUARE)


@domain.on(Q4, PlaneStrain)
@domain.on(Q4, Axisymmetric)
def _domain_q4_axisymmetric(basis, kin, place):
    x1, y1, x2, y2, x3, y3, x4, y4 = place[2:]
    # Diagonals; their cross product is twice the area V.
    px, py = x3 - x1, y3 - y1
    qx, qy = x4 - x2, y4 - y2
    double = px * qy - qx * py
    k = real(1, px) / double
    # Sadeghirad et al. 2013: w = (6 V -+ a -+ b) / (24 V)
    a = (x4 - x1) * (y2 - y3) - (x2 - x3) * (y4 - y1)
    b = (x3 - x4) * (y1 - y2) - (x1 - x2) * (y3 - y4)
    quarter, m = real(0.25, px), k * real(1 / 12, px)
    p, q = m * (a + b), m * (a - b)
    gx, gy, hx, hy = k * qy, k * qx, k * py, k * px
    return (
        ((x1, y1), (x2, y2), (x3, y3), (x4, y4)),
        (quarter - p, quarter - q, quarter + p, quarter + q),
        ((-gx, gy), (hx, -hy), (gx, -gy), (-hx, hy)),
    )


@upright.on(Q4)
def _upright_q4(basis, kin, place):
    x1, y1, x2, y2, x3, y3, x4, y4 = place[2:]
    ax, ay, bx, by = x2 - x1, y2 - y1, x3 - x2, y3 - y2
    cx, cy, dx, dy = x4 - x3, y4 - y3, x1 - x4, y1 - y4
    # Jacobians at the corners, from the edges that meet there.
    least = min(
        min(ax * by - bx * ay, bx * cy - cx * by), min(cx * dy - dx * cy, dx * ay - ax * dy)
    )
    return least > 0


register_carried(Q4)
