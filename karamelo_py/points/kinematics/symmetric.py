"""Symmetric tensors such as stress and strain."""

from __future__ import annotations

from math import sqrt

from karamelo_py.compiler.compile import fma, point_function, real, shared
from karamelo_py.points.kinematics.deformation import inverse, zero_tensor
from karamelo_py.points.kinematics.tags import Axisymmetric, Line, PlaneStrain, Space


@point_function()
def symmetric_part(kin, dl):
    """Strain increment sym(dl), as a symmetric tensor."""


@symmetric_part.on(Line)
def _(kin, dl):
    zero = real(0, dl[0])
    return (dl[0], zero, zero)


@symmetric_part.on(PlaneStrain)
def _(kin, dl):
    half = real(0.5, dl[0])
    return (dl[0], dl[3], real(0, dl[0]), half * (dl[1] + dl[2]))


@symmetric_part.on(Axisymmetric)
def _(kin, dl):
    half = real(0.5, dl[0])
    return (dl[0], dl[3], dl[4], half * (dl[1] + dl[2]))


@symmetric_part.on(Space)
def _(kin, dl):
    half = real(0.5, dl[0])
    return (
        dl[0],
        dl[4],
        dl[8],
        half * (dl[1] + dl[3]),
        half * (dl[2] + dl[6]),
        half * (dl[5] + dl[7]),
    )


@shared
def zero_symmetric(kin, like):
    """The zero of symmetric tensors such as stress, in the number type of `like`."""
    return symmetric_part(kin, zero_tensor(kin, like))


@shared
def trace(s):
    """s_xx + s_yy + s_zz of a symmetric tensor."""
    return s[0] + s[1] + s[2]


@point_function()
def contract(kin, s, e):
    """s_ij e_ij of two symmetric tensors."""


@contract.on(Line)
def _(kin, s, e):
    return s[0] * e[0] + s[1] * e[1] + s[2] * e[2]


@contract.on(PlaneStrain)
@contract.on(Axisymmetric)
def _(kin, s, e):
    return s[0] * e[0] + s[1] * e[1] + s[2] * e[2] + real(2, s[0]) * s[3] * e[3]


@contract.on(Space)
def _(kin, s, e):
    shear = s[3] * e[3] + s[4] * e[4] + s[5] * e[5]
    return s[0] * e[0] + s[1] * e[1] + s[2] * e[2] + real(2, s[0]) * shear


@point_function()
def add_pressure(kin, factor, s, p):
    """factor s + p I of a symmetric tensor."""


@add_pressure.on(Line)
def _(kin, factor, s, p):
    return (factor * s[0] + p, factor * s[1] + p, factor * s[2] + p)


@add_pressure.on(PlaneStrain)
@add_pressure.on(Axisymmetric)
def _(kin, factor, s, p):
    return (factor * s[0] + p, factor * s[1] + p, factor * s[2] + p, factor * s[3])


@add_pressure.on(Space)
def _(kin, factor, s, p):
    return (
        factor * s[0] + p,
        factor * s[1] + p,
        factor * s[2] + p,
        factor * s[3],
        factor * s[4],
        factor * s[5],
    )


@shared
def deviator(kin, s):
    """s - tr(s)/3 I of a symmetric tensor."""
    return add_pressure(kin, real(1, s[0]), s, real(-1 / 3, s[0]) * trace(s))


@shared
def von_mises(kin, s):
    """sqrt(3/2 s:s) of a deviatoric tensor, which is |s_xx - s_yy| in uniaxial stress."""
    return sqrt(real(1.5, s[0]) * contract(kin, s, s))


@point_function()
def leading_symmetric(kin, values):
    """The symmetric tensor that `values` begin with."""


@leading_symmetric.on(Line)
def _(kin, values):
    return values[:3]


@leading_symmetric.on(PlaneStrain)
@leading_symmetric.on(Axisymmetric)
def _(kin, values):
    return values[:4]


@leading_symmetric.on(Space)
def _(kin, values):
    return values[:6]


@point_function()
def after_symmetric(kin, values):
    """What follows the symmetric tensor that `values` begin with, perhaps nothing."""


@after_symmetric.on(Line)
def _(kin, values):
    return values[3:]


@after_symmetric.on(PlaneStrain)
@after_symmetric.on(Axisymmetric)
def _(kin, values):
    return values[4:]


@after_symmetric.on(Space)
def _(kin, values):
    return values[6:]


@point_function()
def largest_row_sum(kin, s):
    """max_i sum_j |s_ij|: a bound of the largest eigenvalue (Gershgorin)."""


@largest_row_sum.on(Line)
def _(kin, s):
    return max(abs(s[0]), abs(s[1]), abs(s[2]))


@largest_row_sum.on(PlaneStrain)
@largest_row_sum.on(Axisymmetric)
def _(kin, s):
    shear = abs(s[3])
    return max(abs(s[0]) + shear, abs(s[1]) + shear, abs(s[2]))


@largest_row_sum.on(Space)
def _(kin, s):
    xy, xz, yz = abs(s[3]), abs(s[4]), abs(s[5])
    return max(abs(s[0]) + xy + xz, abs(s[1]) + xy + yz, abs(s[2]) + xz + yz)


@point_function()
def spin(kin, dl, s):
    """R s R^T, with R the rotation of the increment dl: the objective (Jaumann) turn of a stress.

    R is the rotation by the vector w = axial(skew(dl)), built by Cayley's formula from
    tan(|w|/2) ~ |w|/2 (1 + |w|^2/12): orthogonal to round-off, its angle right to |w|^5/120
    (Hughes & Winget 1980 use tan(|w|/2) ~ |w|/2, right to |w|^3/12).
    """


@spin.on(Line)
def _(kin, dl, s):
    return s


@spin.on(PlaneStrain)
@spin.on(Axisymmetric)
def _(kin, dl, s):
    one = real(1, dl[0])
    t = real(0.25, dl[0]) * (dl[2] - dl[1])
    tt = t * t
    t = fma(t * tt, real(1 / 3, dl[0]), t)
    tt = t * t
    scale = one / (one + tt)
    cosine = (one - tt) * scale
    sine = (t + t) * scale
    # The deviator in the plane turns by twice the angle; written as a change, which is exactly
    # nothing where nothing turns.
    double_sine = real(2, dl[0]) * sine * cosine
    double_versine = real(-2, dl[0]) * sine * sine
    apart = real(0.5, dl[0]) * (s[0] - s[1])
    change = fma(double_versine, apart, -(double_sine * s[3]))
    shear = fma(double_sine, apart, double_versine * s[3])
    return (s[0] + change, s[1] - change, s[2], s[3] + shear)


@spin.on(Space)
def _(kin, dl, s):
    quarter = real(0.25, dl[0])
    one = real(1, dl[0])
    two = real(2, dl[0])
    x = quarter * (dl[7] - dl[5])
    y = quarter * (dl[2] - dl[6])
    z = quarter * (dl[3] - dl[1])
    longer = one + (x * x + y * y + z * z) * real(1 / 3, dl[0])
    x = x * longer
    y = y * longer
    z = z * longer
    k = two / (one + x * x + y * y + z * z)
    # R = I + k (T + T T), T the cross product with (x, y, z)
    r0 = one - k * (y * y + z * z)
    r1 = k * (x * y - z)
    r2 = k * (x * z + y)
    r3 = k * (x * y + z)
    r4 = one - k * (x * x + z * z)
    r5 = k * (y * z - x)
    r6 = k * (x * z - y)
    r7 = k * (y * z + x)
    r8 = one - k * (x * x + y * y)
    # a = R s, then a R^T
    a0 = r0 * s[0] + r1 * s[3] + r2 * s[4]
    a1 = r0 * s[3] + r1 * s[1] + r2 * s[5]
    a2 = r0 * s[4] + r1 * s[5] + r2 * s[2]
    a3 = r3 * s[0] + r4 * s[3] + r5 * s[4]
    a4 = r3 * s[3] + r4 * s[1] + r5 * s[5]
    a5 = r3 * s[4] + r4 * s[5] + r5 * s[2]
    a6 = r6 * s[0] + r7 * s[3] + r8 * s[4]
    a7 = r6 * s[3] + r7 * s[1] + r8 * s[5]
    a8 = r6 * s[4] + r7 * s[5] + r8 * s[2]
    return (
        a0 * r0 + a1 * r1 + a2 * r2,
        a3 * r3 + a4 * r4 + a5 * r5,
        a6 * r6 + a7 * r7 + a8 * r8,
        a0 * r3 + a1 * r4 + a2 * r5,
        a0 * r6 + a1 * r7 + a2 * r8,
        a3 * r6 + a4 * r7 + a5 * r8,
    )


@point_function()
def nominal(kin, tau, f):
    """First Piola-Kirchhoff stress P = tau F^-T of a Kirchhoff stress, in the layout of F.

    P times the reference volume and the gradient by reference positions makes nodal forces
    (`add_tensor_dot`).
    """


@nominal.on(Line)
def _(kin, tau, f):
    return (tau[0] / f[0],)


@nominal.on(PlaneStrain)
def _(kin, tau, f):
    i = inverse(kin, f)
    return (
        tau[0] * i[0] + tau[3] * i[1],
        tau[0] * i[2] + tau[3] * i[3],
        tau[3] * i[0] + tau[1] * i[1],
        tau[3] * i[2] + tau[1] * i[3],
    )


@nominal.on(Axisymmetric)
def _(kin, tau, f):
    i = inverse(kin, f)
    return (
        tau[0] * i[0] + tau[3] * i[1],
        tau[0] * i[2] + tau[3] * i[3],
        tau[3] * i[0] + tau[1] * i[1],
        tau[3] * i[2] + tau[1] * i[3],
        tau[2] * i[4],
    )


@nominal.on(Space)
def _(kin, tau, f):
    i = inverse(kin, f)
    return (
        tau[0] * i[0] + tau[3] * i[1] + tau[4] * i[2],
        tau[0] * i[3] + tau[3] * i[4] + tau[4] * i[5],
        tau[0] * i[6] + tau[3] * i[7] + tau[4] * i[8],
        tau[3] * i[0] + tau[1] * i[1] + tau[5] * i[2],
        tau[3] * i[3] + tau[1] * i[4] + tau[5] * i[5],
        tau[3] * i[6] + tau[1] * i[7] + tau[5] * i[8],
        tau[4] * i[0] + tau[5] * i[1] + tau[2] * i[2],
        tau[4] * i[3] + tau[5] * i[4] + tau[2] * i[5],
        tau[4] * i[6] + tau[5] * i[7] + tau[2] * i[8],
    )
