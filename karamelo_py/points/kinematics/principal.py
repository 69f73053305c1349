"""Principal values and directions of symmetric tensors, and back."""

from math import sqrt

from karamelo_py.compiler.compile import point_function, real, round_off, shared, where
from karamelo_py.compiler.tuples import add, scale, subtract
from karamelo_py.points.kinematics.components import Number, formula
from karamelo_py.points.kinematics.tags import Axisymmetric, Line, PlaneStrain, Space


@point_function()
def principal(kin, s):
    """Principal values (3,) of a symmetric tensor, in no order, and what `from_principal` needs."""


@point_function()
def from_principal(kin, values, frame):
    """The symmetric tensor with these principal values in the directions of `frame`."""


@principal.on(Line)
def _principal_line(kin, s):
    return s, ()


@from_principal.on(Line)
def _from_principal_line(kin, values, frame):
    return values


@principal.on(PlaneStrain)
@principal.on(Axisymmetric)
def _principal_axisymmetric(kin, s):
    half = real(0.5, s[0])
    apart = half * (s[0] - s[1])
    mean = half * (s[0] + s[1])
    radius = sqrt(apart * apart + s[3] * s[3])
    values = (mean + radius, mean - radius, s[2])
    one = real(1, s[0])
    turned = radius > 0
    over = where(turned, radius, one)
    return values, (where(turned, apart / over, one), s[3] / over)


@from_principal.on(PlaneStrain)
@from_principal.on(Axisymmetric)
def _from_principal_axisymmetric(kin, values, frame):
    # frame: cosine and sine of twice the angle to the first principal direction
    half = real(0.5, values[0])
    mean = half * (values[0] + values[1])
    radius = half * (values[0] - values[1])
    change = radius * frame[0]
    return (mean + change, mean - change, values[2], radius * frame[1])


@shared
def _rotation(a, b, c):
    """Cosine, sine and tangent of the rotation that makes c vanish in [[a, c], [c, b]]."""
    one = real(1, a)
    cotangent = (b - a) / where(c == 0, one, c + c)
    t = one / (abs(cotangent) + sqrt(cotangent * cotangent + one))
    t = where(c == 0, real(0, a), where(cotangent < 0, -t, t))
    cosine = one / sqrt(t * t + one)
    return cosine, t * cosine, t


# Each sweep squares what is left off the diagonal.
_SWEEPS = 8


@principal.on(Space)
def _principal_space(kin, s):
    # Jacobi's rotations (Golub & Van Loan 2013, section 8.5): directions are right to round-off
    # whether or not principal values are equal, which closed forms are not.
    a, b, c, d, e, f = s
    one = real(1, a)
    zero = real(0, a)
    u = (one, zero, zero)
    v = (zero, one, zero)
    w = (zero, zero, one)
    enough = real(1e-3, a) * round_off(a)
    for _ in range(_SWEEPS):
        if abs(d) + abs(e) + abs(f) <= enough * (abs(a) + abs(b) + abs(c)):
            break
        k, g, t = _rotation(a, b, d)
        a, b, d = a - t * d, b + t * d, zero
        e, f = k * e - g * f, g * e + k * f
        u, v = _turned(k, g, u, v)
        k, g, t = _rotation(a, c, e)
        a, c, e = a - t * e, c + t * e, zero
        d, f = k * d - g * f, g * d + k * f
        u, w = _turned(k, g, u, w)
        k, g, t = _rotation(b, c, f)
        b, c, f = b - t * f, c + t * f, zero
        d, e = k * d - g * e, g * d + k * e
        v, w = _turned(k, g, v, w)
    return (a, b, c), (u, v, w)


@shared
def _turned(k, g, u, v):
    return subtract(scale(k, u), scale(g, v)), add(scale(g, u), scale(k, v))


@formula(Space)
def _composed(kin, values: Number, frame: Number):
    return kin.symmetric(lambda i, j: sum(values[m] * frame[m][i] * frame[m][j] for m in range(3)))


@from_principal.on(Space)
def _from_principal_space(kin, values, frame):
    return _composed(kin, values, frame)
