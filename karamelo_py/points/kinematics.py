"""Kinematics: which components of vectors and tensors exist, and the algebra on them.

Every tensor of a point is a flat tuple with the components that its kinematics has:

==============  ==============  =============================  =================================
tag             vector          velocity gradient, F           symmetric tensor (stress, strain)
==============  ==============  =============================  =================================
``Line``        x               xx                             xx yy zz
``PlaneStrain`` x y             xx xy yx yy                    xx yy zz xy
``Space``       x y z           xx xy xz yx yy yz zx zy zz     xx yy zz xy xz yz
==============  ==============  =============================  =================================

The tags are empty NamedTuples: Numba compiles a kernel for each of them, without branches.
"""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compile import fma, point_function, real, shared
from karamelo_py.tensors import scale


class Line(NamedTuple):
    """One dimension: uniaxial strain, the limit that plane strain and space have too."""

    dimension = 1
    tensor_size = 1
    symmetric_names = ("11", "22", "33")


class PlaneStrain(NamedTuple):
    """Two dimensions, unit thickness, no strain out of the plane."""

    dimension = 2
    tensor_size = 4
    symmetric_names = ("11", "22", "33", "12")


class Space(NamedTuple):
    """Three dimensions."""

    dimension = 3
    tensor_size = 9
    symmetric_names = ("11", "22", "33", "12", "13", "23")


KINEMATICS = {1: Line, 2: PlaneStrain, 3: Space}


@point_function()
def vector_at(kin, array, i):
    """Row `i` of `array` (n, >= d) as a vector."""


@vector_at.on(Line)
def _(kin, array, i):
    return (array[i, 0],)


@vector_at.on(PlaneStrain)
def _(kin, array, i):
    return (array[i, 0], array[i, 1])


@vector_at.on(Space)
def _(kin, array, i):
    return (array[i, 0], array[i, 1], array[i, 2])


@point_function()
def add_outer(kin, total, a, b):
    """total_ij + a_i b_j, of a tensor and two vectors."""


@add_outer.on(Line)
def _(kin, total, a, b):
    return (fma(a[0], b[0], total[0]),)


@add_outer.on(PlaneStrain)
def _(kin, total, a, b):
    return (
        fma(a[0], b[0], total[0]),
        fma(a[0], b[1], total[1]),
        fma(a[1], b[0], total[2]),
        fma(a[1], b[1], total[3]),
    )


@add_outer.on(Space)
def _(kin, total, a, b):
    return (
        fma(a[0], b[0], total[0]),
        fma(a[0], b[1], total[1]),
        fma(a[0], b[2], total[2]),
        fma(a[1], b[0], total[3]),
        fma(a[1], b[1], total[4]),
        fma(a[1], b[2], total[5]),
        fma(a[2], b[0], total[6]),
        fma(a[2], b[1], total[7]),
        fma(a[2], b[2], total[8]),
    )


@point_function()
def tensor_dot(kin, t, a):
    """t_ij a_j of a tensor and a vector."""


@tensor_dot.on(Line)
def _(kin, t, a):
    return (t[0] * a[0],)


@tensor_dot.on(PlaneStrain)
def _(kin, t, a):
    return (t[0] * a[0] + t[1] * a[1], t[2] * a[0] + t[3] * a[1])


@tensor_dot.on(Space)
def _(kin, t, a):
    return (
        t[0] * a[0] + t[1] * a[1] + t[2] * a[2],
        t[3] * a[0] + t[4] * a[1] + t[5] * a[2],
        t[6] * a[0] + t[7] * a[1] + t[8] * a[2],
    )


@point_function()
def add_symmetric_dot(kin, total, s, a):
    """total_i + s_ij a_j of a symmetric tensor and a vector: the traction of a stress."""


@add_symmetric_dot.on(Line)
def _(kin, total, s, a):
    return (fma(s[0], a[0], total[0]),)


@add_symmetric_dot.on(PlaneStrain)
def _(kin, total, s, a):
    return (
        fma(s[0], a[0], fma(s[3], a[1], total[0])),
        fma(s[3], a[0], fma(s[1], a[1], total[1])),
    )


@add_symmetric_dot.on(Space)
def _(kin, total, s, a):
    return (
        fma(s[0], a[0], fma(s[3], a[1], fma(s[4], a[2], total[0]))),
        fma(s[3], a[0], fma(s[1], a[1], fma(s[5], a[2], total[1]))),
        fma(s[4], a[0], fma(s[5], a[1], fma(s[2], a[2], total[2]))),
    )


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


@identity.on(Space)
def _(kin, like):
    one = real(1, like)
    zero = real(0, like)
    return (one, zero, zero, zero, one, zero, zero, zero, one)


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


@determinant.on(Space)
def _(kin, f):
    return (
        f[0] * (f[4] * f[8] - f[5] * f[7])
        - f[1] * (f[3] * f[8] - f[5] * f[6])
        + f[2] * (f[3] * f[7] - f[4] * f[6])
    )


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


@shared
def zero_tensor(kin, like):
    """The zero of tensors such as grad v, in the number type of `like`."""
    return scale(real(0, like), identity(kin, like))


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


@point_function()
def largest_row_sum(kin, s):
    """max_i sum_j |s_ij|: a bound of the largest eigenvalue (Gershgorin)."""


@largest_row_sum.on(Line)
def _(kin, s):
    return max(abs(s[0]), abs(s[1]), abs(s[2]))


@largest_row_sum.on(PlaneStrain)
def _(kin, s):
    shear = abs(s[3])
    return max(abs(s[0]) + shear, abs(s[1]) + shear, abs(s[2]))


@largest_row_sum.on(Space)
def _(kin, s):
    xy, xz, yz = abs(s[3]), abs(s[4]), abs(s[5])
    return max(abs(s[0]) + xy + xz, abs(s[1]) + xy + yz, abs(s[2]) + xz + yz)


@point_function()
def largest_component(kin, a):
    """max_i |a_i| of a vector."""


@largest_component.on(Line)
def _(kin, a):
    return abs(a[0])


@largest_component.on(PlaneStrain)
def _(kin, a):
    return max(abs(a[0]), abs(a[1]))


@largest_component.on(Space)
def _(kin, a):
    return max(abs(a[0]), abs(a[1]), abs(a[2]))


@point_function()
def dimension(kin):
    """Number of components of a vector, a constant at compile time."""


@dimension.on(Line)
def _(kin):
    return 1


@dimension.on(PlaneStrain)
def _(kin):
    return 2


@dimension.on(Space)
def _(kin):
    return 3
