"""Tensors such as the deformation gradient F and the increment dl = dt grad v."""

from __future__ import annotations

from math import sqrt

from karamelo_py.compiler.compile import point_function, real, shared
from karamelo_py.compiler.tuples import scale
from karamelo_py.points.kinematics.tags import Axisymmetric, Line, PlaneStrain, Space


@point_function()
def identity(kin, like):
    """The unit tensor, in the number type of `like`."""


@identity.on(Line)
def _(kin, like):
    return (real(1, like),)


@identity.on(PlaneStrain)
def _(kin, like):
    one = real(1, like)
    zero = real(0, like)
    return (one, zero, zero, one)


@identity.on(Axisymmetric)
def _(kin, like):
    one = real(1, like)
    zero = real(0, like)
    return (one, zero, zero, one, one)


@identity.on(Space)
def _(kin, like):
    one = real(1, like)
    zero = real(0, like)
    return (one, zero, zero, zero, one, zero, zero, zero, one)


@shared
def zero_tensor(kin, like):
    """The zero of tensors such as grad v, in the number type of `like`."""
    return scale(real(0, like), identity(kin, like))


@point_function()
def multiply(kin, a, b):
    """a_ik b_kj of two tensors."""


@multiply.on(Line)
def _(kin, a, b):
    return (a[0] * b[0],)


@multiply.on(PlaneStrain)
def _(kin, a, b):
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )


@multiply.on(Axisymmetric)
def _(kin, a, b):
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
        a[4] * b[4],
    )


@multiply.on(Space)
def _(kin, a, b):
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@point_function()
def inverse(kin, f):
    """F^-1, of a tensor with det F other than 0."""


@inverse.on(Line)
def _(kin, f):
    return (real(1, f[0]) / f[0],)


@inverse.on(PlaneStrain)
def _(kin, f):
    k = real(1, f[0]) / (f[0] * f[3] - f[1] * f[2])
    return (k * f[3], -(k * f[1]), -(k * f[2]), k * f[0])


@inverse.on(Axisymmetric)
def _(kin, f):
    one = real(1, f[0])
    k = one / (f[0] * f[3] - f[1] * f[2])
    return (k * f[3], -(k * f[1]), -(k * f[2]), k * f[0], one / f[4])


@inverse.on(Space)
def _(kin, f):
    # The transposed cofactors over the determinant (Cramer).
    a = f[4] * f[8] - f[5] * f[7]
    d = f[5] * f[6] - f[3] * f[8]
    g = f[3] * f[7] - f[4] * f[6]
    k = real(1, f[0]) / (f[0] * a + f[1] * d + f[2] * g)
    return (
        k * a,
        k * (f[2] * f[7] - f[1] * f[8]),
        k * (f[1] * f[5] - f[2] * f[4]),
        k * d,
        k * (f[0] * f[8] - f[2] * f[6]),
        k * (f[2] * f[3] - f[0] * f[5]),
        k * g,
        k * (f[1] * f[6] - f[0] * f[7]),
        k * (f[0] * f[4] - f[1] * f[3]),
    )


@point_function()
def deform(kin, dl, f):
    """(I + dl) F: the deformation gradient after the increment dl = dt grad v."""


@deform.on(Line)
def _(kin, dl, f):
    return (f[0] + dl[0] * f[0],)


@deform.on(PlaneStrain)
def _(kin, dl, f):
    return (
        f[0] + dl[0] * f[0] + dl[1] * f[2],
        f[1] + dl[0] * f[1] + dl[1] * f[3],
        f[2] + dl[2] * f[0] + dl[3] * f[2],
        f[3] + dl[2] * f[1] + dl[3] * f[3],
    )


@deform.on(Axisymmetric)
def _(kin, dl, f):
    return (
        f[0] + dl[0] * f[0] + dl[1] * f[2],
        f[1] + dl[0] * f[1] + dl[1] * f[3],
        f[2] + dl[2] * f[0] + dl[3] * f[2],
        f[3] + dl[2] * f[1] + dl[3] * f[3],
        f[4] + dl[4] * f[4],
    )


@deform.on(Space)
def _(kin, dl, f):
    return (
        f[0] + dl[0] * f[0] + dl[1] * f[3] + dl[2] * f[6],
        f[1] + dl[0] * f[1] + dl[1] * f[4] + dl[2] * f[7],
        f[2] + dl[0] * f[2] + dl[1] * f[5] + dl[2] * f[8],
        f[3] + dl[3] * f[0] + dl[4] * f[3] + dl[5] * f[6],
        f[4] + dl[3] * f[1] + dl[4] * f[4] + dl[5] * f[7],
        f[5] + dl[3] * f[2] + dl[4] * f[5] + dl[5] * f[8],
        f[6] + dl[6] * f[0] + dl[7] * f[3] + dl[8] * f[6],
        f[7] + dl[6] * f[1] + dl[7] * f[4] + dl[8] * f[7],
        f[8] + dl[6] * f[2] + dl[7] * f[5] + dl[8] * f[8],
    )


@shared
def increment_of(kin, change, f):
    """dl = (dt Fdot) F^-1, the increment that takes F to F + dt Fdot: deform(kin, dl, f) is that.

    `change` is dt Fdot, the step times the gradient of velocity by reference positions.
    """
    return multiply(kin, change, inverse(kin, f))


@point_function()
def volume_ratio(kin, dl):
    """det(I + dl): by what factor the increment changes the volume."""


@volume_ratio.on(Line)
def _(kin, dl):
    return real(1, dl[0]) + dl[0]


@volume_ratio.on(PlaneStrain)
def _(kin, dl):
    one = real(1, dl[0])
    return (one + dl[0]) * (one + dl[3]) - dl[1] * dl[2]


@volume_ratio.on(Axisymmetric)
def _(kin, dl):
    one = real(1, dl[0])
    return ((one + dl[0]) * (one + dl[3]) - dl[1] * dl[2]) * (one + dl[4])


@volume_ratio.on(Space)
def _(kin, dl):
    one = real(1, dl[0])
    a = one + dl[0]
    e = one + dl[4]
    i = one + dl[8]
    return (
        a * (e * i - dl[5] * dl[7])
        - dl[1] * (dl[3] * i - dl[5] * dl[6])
        + dl[2] * (dl[3] * dl[7] - e * dl[6])
    )


@point_function()
def determinant(kin, f):
    """det F."""


@determinant.on(Line)
def _(kin, f):
    return f[0]


@determinant.on(PlaneStrain)
def _(kin, f):
    return f[0] * f[3] - f[1] * f[2]


@determinant.on(Axisymmetric)
def _(kin, f):
    return (f[0] * f[3] - f[1] * f[2]) * f[4]


@determinant.on(Space)
def _(kin, f):
    return (
        f[0] * (f[4] * f[8] - f[5] * f[7])
        - f[1] * (f[3] * f[8] - f[5] * f[6])
        + f[2] * (f[3] * f[7] - f[4] * f[6])
    )


@point_function()
def left_cauchy_green(kin, f):
    """b = F F^T, as a symmetric tensor."""


@left_cauchy_green.on(Line)
def _(kin, f):
    one = real(1, f[0])
    return (f[0] * f[0], one, one)


@left_cauchy_green.on(PlaneStrain)
def _(kin, f):
    return (
        f[0] * f[0] + f[1] * f[1],
        f[2] * f[2] + f[3] * f[3],
        real(1, f[0]),
        f[0] * f[2] + f[1] * f[3],
    )


@left_cauchy_green.on(Axisymmetric)
def _(kin, f):
    return (
        f[0] * f[0] + f[1] * f[1],
        f[2] * f[2] + f[3] * f[3],
        f[4] * f[4],
        f[0] * f[2] + f[1] * f[3],
    )


@left_cauchy_green.on(Space)
def _(kin, f):
    return (
        f[0] * f[0] + f[1] * f[1] + f[2] * f[2],
        f[3] * f[3] + f[4] * f[4] + f[5] * f[5],
        f[6] * f[6] + f[7] * f[7] + f[8] * f[8],
        f[0] * f[3] + f[1] * f[4] + f[2] * f[5],
        f[0] * f[6] + f[1] * f[7] + f[2] * f[8],
        f[3] * f[6] + f[4] * f[7] + f[5] * f[8],
    )


@point_function()
def right_cauchy_green(kin, f):
    """C = F^T F, as a symmetric tensor."""


@right_cauchy_green.on(Line)
def _(kin, f):
    one = real(1, f[0])
    return (f[0] * f[0], one, one)


@right_cauchy_green.on(PlaneStrain)
def _(kin, f):
    return (
        f[0] * f[0] + f[2] * f[2],
        f[1] * f[1] + f[3] * f[3],
        real(1, f[0]),
        f[0] * f[1] + f[2] * f[3],
    )


@right_cauchy_green.on(Axisymmetric)
def _(kin, f):
    return (
        f[0] * f[0] + f[2] * f[2],
        f[1] * f[1] + f[3] * f[3],
        f[4] * f[4],
        f[0] * f[1] + f[2] * f[3],
    )


@right_cauchy_green.on(Space)
def _(kin, f):
    return (
        f[0] * f[0] + f[3] * f[3] + f[6] * f[6],
        f[1] * f[1] + f[4] * f[4] + f[7] * f[7],
        f[2] * f[2] + f[5] * f[5] + f[8] * f[8],
        f[0] * f[1] + f[3] * f[4] + f[6] * f[7],
        f[0] * f[2] + f[3] * f[5] + f[6] * f[8],
        f[1] * f[2] + f[4] * f[5] + f[7] * f[8],
    )


@point_function()
def stretch(kin, f):
    """Right stretch U = sqrt(F^T F), as a symmetric tensor, for det F other than 0.

    In the plane U = (C + |det F| I) / sqrt(tr C + 2 |det F|), from Cayley and Hamilton (Hoger &
    Carlson 1984, J. Elasticity 14). In space Newton's iteration X <- (g X + X^-T / g) / 2 takes F
    to its rotation R, then U = R^T F (Higham 1986, SIAM J. Sci. Stat. Comput. 7, with his scaling
    by Frobenius norms): right to round-off whether or not principal stretches are equal, which
    closed forms are not.
    """


@stretch.on(Line)
def _(kin, f):
    one = real(1, f[0])
    return (abs(f[0]), one, one)


@stretch.on(PlaneStrain)
def _(kin, f):
    c = right_cauchy_green(kin, f)
    j = abs(determinant(kin, f))
    k = real(1, j) / sqrt(c[0] + c[1] + j + j)
    return (k * (c[0] + j), k * (c[1] + j), real(1, j), k * c[3])


@stretch.on(Axisymmetric)
def _(kin, f):
    c = right_cauchy_green(kin, f)
    j = abs(f[0] * f[3] - f[1] * f[2])
    k = real(1, j) / sqrt(c[0] + c[1] + j + j)
    return (k * (c[0] + j), k * (c[1] + j), abs(f[4]), k * c[3])


# Round-off is reached after four steps for ratios of principal stretches up to 2, and after seven
# for whatever the inverse itself can bear.
_POLAR_STEPS = 7


@stretch.on(Space)
def _(kin, f):
    half = real(0.5, f[0])
    r = f
    for _ in range(_POLAR_STEPS):
        i = inverse(kin, r)
        g = sqrt(sqrt(_square(i) / _square(r)))
        k = half * g
        m = half / g
        r = (
            k * r[0] + m * i[0],
            k * r[1] + m * i[3],
            k * r[2] + m * i[6],
            k * r[3] + m * i[1],
            k * r[4] + m * i[4],
            k * r[5] + m * i[7],
            k * r[6] + m * i[2],
            k * r[7] + m * i[5],
            k * r[8] + m * i[8],
        )
    return (
        r[0] * f[0] + r[3] * f[3] + r[6] * f[6],
        r[1] * f[1] + r[4] * f[4] + r[7] * f[7],
        r[2] * f[2] + r[5] * f[5] + r[8] * f[8],
        half * (r[0] * f[1] + r[3] * f[4] + r[6] * f[7] + r[1] * f[0] + r[4] * f[3] + r[7] * f[6]),
        half * (r[0] * f[2] + r[3] * f[5] + r[6] * f[8] + r[2] * f[0] + r[5] * f[3] + r[8] * f[6]),
        half * (r[1] * f[2] + r[4] * f[5] + r[7] * f[8] + r[2] * f[1] + r[5] * f[4] + r[8] * f[7]),
    )


@shared
def _square(t):
    """t_ij t_ij of a tensor in space."""
    rows = t[0] * t[0] + t[1] * t[1] + t[2] * t[2] + t[3] * t[3] + t[4] * t[4]
    return rows + t[5] * t[5] + t[6] * t[6] + t[7] * t[7] + t[8] * t[8]
