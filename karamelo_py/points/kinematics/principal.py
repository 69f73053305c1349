"""Principal values and directions of symmetric tensors, and tensors from them."""

from math import sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler import implements, round_off, shared, where
from karamelo_py.compiler.powers import exponential, logarithm
from karamelo_py.compiler.slopes import Dual, size_of, slopes_of, value_of
from karamelo_py.points.kinematics import Space, dot


@shared
def principal(s):
    """Return the principal values (3,) of a symmetric tensor, in any order, and its directions."""
    if s.kin.dimension == 1:
        return (s.xx, s.yy, s.zz), ()
    return principal_in_plane(s) if s.kin.dimension == 2 else principal_in_space(s)


@shared
def from_principal(s, values, directions, slopes=None):
    """Build a tensor of the class of `s` from principal values and principal directions.

    `slopes` (3,), for equal values: derivatives with respect to another tensor's principal values.
    """
    if s.kin.dimension == 1:
        return s._make(values)
    if s.kin.dimension == 2:
        a, b, c = values
        mean = 0.5 * (a + b)
        radius = 0.5 * (a - b)
        cosine, sine = directions  # cosine and sine of twice the angle of the first direction
        change = radius * cosine
        return s._make([mean + change, mean - change, c, radius * sine])

    def component(i, j):
        a, b, c = [p * u[i] * u[j] for p, u in zip(values, directions, strict=True)]
        return a + b + c

    return s._make([component(i, j) for i, j in s.places])


def principal_in_plane(s):
    apart = 0.5 * (s.xx - s.yy)
    mean = 0.5 * (s.xx + s.yy)
    radius = sqrt(apart * apart + s.xy * s.xy)
    turned = radius > 0
    over = where(turned, radius, 1)
    angle = where(turned, apart / over, 1), s.xy / over
    return (mean + radius, mean - radius, s.zz), angle


def jacobi_rotation(a, b, c):
    """Return cosine, sine and tangent of the rotation that diagonalises [[a, c], [c, b]]."""
    cotangent = (b - a) / where(c == 0, 1, c + c)
    t = 1 / (abs(cotangent) + sqrt(cotangent * cotangent + 1))
    t = where(c == 0, 0, where(cotangent < 0, -t, t))
    cosine = 1 / sqrt(t * t + 1)
    return cosine, t * cosine, t


# Each sweep squares the off-diagonal part.
_SWEEPS = 8


def principal_in_space(s):
    # Unlike closed forms, Jacobi rotations are accurate to round-off for equal values (Golub & Van
    # Loan 2013, section 8.5).
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
    return k * u - g * v, k * v - (-g) * u  # differences, as a sum is rounded once


def real_principal(s):
    values, directions = principal(s)
    return [1.0 * x for x in values], directions


def logarithm_of(s):
    values, directions = real_principal(s)
    logarithms = tuple([logarithm(x) for x in values])
    return from_principal(s, logarithms, directions, tuple([1 / x for x in values]))


def exponential_of(s):
    values, directions = real_principal(s)
    exponentials = tuple([exponential(x) for x in values])
    return from_principal(s, exponentials, directions, exponentials)


# Jacobi rotations end with a diagonal tensor, whose derivative may not be diagonal. With S' in the
# frame of principal directions n, f(S)' = sum_a f_a' n_a n_a + sum_ab (f_a - f_b) / (s_a - s_b)
# (n_a . S' n_b) (n_a n_b + n_b n_a), a < b (Ogden 1997, "Non-linear elastic deformations", section
# 6.1).

PAIRS = (0, 1), (0, 2), (1, 2)


class TurningFrame(NamedTuple):
    directions: Any
    shears: tuple  # n_a . S' n_b of each pair, per slope
    apart: tuple  # s_a - s_b of each pair


def in_frame(s, directions):
    """Return components in a frame: diagonal (3,), and one off-diagonal number per pair."""
    if s.kin.dimension == 2:
        k, g = directions
        apart, mean = 0.5 * (s.xx - s.yy), 0.5 * (s.xx + s.yy)
        radius = apart * k + s.xy * g
        return (mean + radius, mean - radius, s.zz), (s.xy * k - apart * g,)
    a = s.at()
    along = [tuple([dot([a[i, j] for j in range(3)], n) for i in range(3)]) for n in directions]
    shears = tuple([dot(directions[a], along[b]) for a, b in PAIRS])
    return tuple([dot(n, t) for n, t in zip(directions, along, strict=True)]), shears


def out_of_frame(s, diagonal, shears, directions):
    if s.kin.dimension == 2:
        a, b, c = diagonal
        k, g = directions
        radius, mean = 0.5 * (a - b), 0.5 * (a + b)
        apart = radius * k - shears[0] * g
        return s._make([mean + apart, mean - apart, c, radius * g + shears[0] * k])

    def component(i, j):
        n = directions
        normal = dot(diagonal, [m[i] * m[j] for m in n])
        return normal + dot(shears, [n[a][i] * n[b][j] + n[b][i] * n[a][j] for a, b in PAIRS])

    return s._make([component(i, j) for i, j in s.places])


def columns(numbers, n):
    return list(zip(*[slopes_of(x, n) for x in numbers], strict=True))


@implements(principal, Dual)
def _principal_slopes(s):
    if s.kin.dimension == 1:
        return (s.xx, s.yy, s.zz), ()
    values, directions = principal(value_of(s))
    turned = [in_frame(s._make(slopes), directions) for slopes in columns(s, size_of(*s))]
    along = zip(*[diagonal for diagonal, _ in turned], strict=True)
    made = [Dual(value, tuple(slopes)) for value, slopes in zip(values, along, strict=True)]
    apart = [values[a] - values[b] for a, b in PAIRS[: len(turned[0][1])]]
    return tuple(made), TurningFrame(directions, tuple([t[1] for t in turned]), tuple(apart))


class PairLimits(NamedTuple):
    """Limits of (f_a - f_b) / (s_a - s_b) for equal principal values."""

    first: Any
    second: Any
    third: Any


# Relative difference below which mean slopes are more accurate than difference quotients.
ALIKE = 1e-5


def turning_ratios(values, directions, slopes):
    ratios = []
    for k, ((a, b), apart) in enumerate(zip(PAIRS, directions.apart, strict=False)):
        if isinstance(slopes, PairLimits):
            limit = slopes[k]
            alike = abs(apart) < ALIKE
        elif slopes is None:  # at an edge or the apex, equal principal values remain equal
            alike, limit = apart == 0, 0
        else:
            limit = 0.5 * (slopes[a] + slopes[b])
            alike = abs(apart) * limit < ALIKE
        ratios.append(where(alike, limit, (values[a] - values[b]) / where(alike, 1, apart)))
    return ratios


@implements(from_principal, Dual)
def _from_principal_slopes(s, values, directions, slopes=None):
    if not isinstance(directions, TurningFrame):
        return s._make(values)
    plain, frame = value_of(values), directions.directions
    ratios = turning_ratios(plain, directions, value_of(slopes))
    each = zip(columns(values, len(directions.shears)), directions.shears, strict=True)
    tensors = [
        out_of_frame(s, slopes, tuple([r * c for r, c in zip(ratios, shears, strict=True)]), frame)
        for slopes, shears in each
    ]
    made = zip(from_principal(value_of(s), plain, frame), zip(*tensors, strict=True), strict=True)
    return s._make([Dual(value, tuple(slopes)) for value, slopes in made])
