"""Principal values and directions of symmetric tensors, and back."""

from math import sqrt

from karamelo_py.compiler.compile import round_off, shared, where
from karamelo_py.points.kinematics import Space


def principal(s):
    """Find principal values (3,) of a symmetric tensor, in no order, and their directions."""
    if s.kin.dimension == 1:
        return (s.xx, s.yy, s.zz), ()
    return principal_in_plane(s) if s.kin.dimension == 2 else principal_in_space(s)


def from_principal(s, values, directions):
    """Make the symmetric tensor with principal values in directions; of the class of `s`."""
    if s.kin.dimension == 1:
        return s._make(values)
    if s.kin.dimension == 2:
        a, b, c = values
        mean = 0.5 * (a + b)
        radius = 0.5 * (a - b)
        cosine, sine = directions  # of twice the angle to the first
        change = radius * cosine
        return s._make([mean + change, mean - change, c, radius * sine])

    def component(i, j):
        a, b, c = [p * u[i] * u[j] for p, u in zip(values, directions, strict=True)]
        return a + b + c

    return s._make([component(i, j) for i, j in s.places])


def principal_in_plane(s):
    """See `principal`."""
    apart = 0.5 * (s.xx - s.yy)
    mean = 0.5 * (s.xx + s.yy)
    radius = sqrt(apart * apart + s.xy * s.xy)
    turned = radius > 0
    over = where(turned, radius, 1)
    # Cosine and sine of twice the angle to the first direction.
    angle = where(turned, apart / over, 1), s.xy / over
    return (mean + radius, mean - radius, s.zz), angle


@shared
def jacobi_rotation(a, b, c):
    """Find cosine, sine and tangent of the rotation that makes c vanish in [[a, c], [c, b]]."""
    cotangent = (b - a) / where(c == 0, 1, c + c)
    t = 1 / (abs(cotangent) + sqrt(cotangent * cotangent + 1))
    t = where(c == 0, 0, where(cotangent < 0, -t, t))
    cosine = 1 / sqrt(t * t + 1)
    return cosine, t * cosine, t


# Each sweep squares what is left off the diagonal.
_SWEEPS = 8


@shared
def principal_in_space(s):
    """See `principal`."""
    # Jacobi's rotations (Golub & Van Loan 2013, section 8.5): directions are right to round-off
    # whether or not principal values are equal, which closed forms are not.
    a, b, c, d, e, f = s
    u, v, w = Space.Vector(1, 0, 0), Space.Vector(0, 1, 0), Space.Vector(0, 0, 1)
    enough = 1e-3 * round_off(a)
    for _ in range(_SWEEPS):
        if abs(d) + abs(e) + abs(f) <= enough * (abs(a) + abs(b) + abs(c)):
            break
        k, g, t = jacobi_rotation(a, b, d)
        a, b, d = a - t * d, b + t * d, 0
        e, f = k * e - g * f, g * e + k * f
        u, v = rotated(k, g, u, v)
        k, g, t = jacobi_rotation(a, c, e)
        a, c, e = a - t * e, c + t * e, 0
        d, f = k * d - g * f, g * d + k * f
        u, w = rotated(k, g, u, w)
        k, g, t = jacobi_rotation(b, c, f)
        b, c, f = b - t * f, c + t * f, 0
        d, e = k * d - g * e, g * d + k * e
        v, w = rotated(k, g, v, w)
    return (a, b, c), (u, v, w)


def rotated(k, g, u, v):
    """Turn two directions in their plane by the angle with the cosine k and the sine g."""
    return k * u - g * v, k * v - (-g) * u  # differences: a sum would be rounded once
