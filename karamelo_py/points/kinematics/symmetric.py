"""Symmetric tensors such as stress and strain."""

from math import sqrt

from karamelo_py.compiler.compile import fma, real, shared
from karamelo_py.compiler.symbols import call
from karamelo_py.points.kinematics.components import Components, Number, Symmetric, Tensor, formula
from karamelo_py.points.kinematics.deformation import inverse_of, zero_tensor


@formula()
def symmetric_part(kin, dl: Tensor):
    """Strain increment sym(dl), as a symmetric tensor."""
    return kin.symmetric(lambda i, j: dl[i, i] if i == j else 0.5 * (dl[i, j] + dl[j, i]))


@shared
def zero_symmetric(kin, like):
    """The zero of symmetric tensors such as stress, in the number type of `like`."""
    return symmetric_part(kin, zero_tensor(kin, like))


@shared
def trace(s):
    """s_xx + s_yy + s_zz of a symmetric tensor."""
    return s[0] + s[1] + s[2]


@formula()
def contract(kin, s: Symmetric, e: Symmetric):
    """s_ij e_ij of two symmetric tensors."""
    shear = sum(s[i, j] * e[i, j] for i, j in kin.symmetric_pairs if i != j)
    return sum(s[i, i] * e[i, i] for i in range(3)) + 2 * shear


@formula()
def add_pressure(kin, factor: Number, s: Symmetric, p: Number):
    """factor s + p I of a symmetric tensor."""
    return kin.symmetric(lambda i, j: factor * s[i, j] + (p if i == j else 0))


@formula()
def stretching_mean(kin, s: Symmetric):
    """Mean of a symmetric tensor over the directions that can stretch."""
    return sum(s[i, i] for i in kin.axes) / len(kin.axes)


@shared
def deviator(kin, s):
    """s - tr(s)/3 I of a symmetric tensor."""
    return add_pressure(kin, real(1, s[0]), s, real(-1 / 3, s[0]) * trace(s))


@shared
def von_mises(kin, s):
    """sqrt(3/2 s:s) of a deviatoric tensor, which is |s_xx - s_yy| in uniaxial stress."""
    return sqrt(real(1.5, s[0]) * contract(kin, s, s))


@formula()
def leading_symmetric(kin, values: Number):
    """The symmetric tensor that `values` begin with."""
    return values[f":{len(kin.symmetric_pairs)}"]


@formula()
def after_symmetric(kin, values: Number):
    """What follows the symmetric tensor that `values` begin with, perhaps nothing."""
    return values[f"{len(kin.symmetric_pairs)}:"]


@formula()
def largest_row_sum(kin, s: Symmetric):
    """max_i sum_j |s_ij|: a bound of the largest eigenvalue (Gershgorin)."""
    order = ([i, *(j for j in range(3) if j != i)] for i in range(3))
    return call(max, *(sum(abs(s[row[0], j]) for j in row) for row in order))


def _spin_in_plane(kin: Components, dl: Tensor, s: Symmetric) -> tuple:
    t = 0.25 * (dl[1, 0] - dl[0, 1])
    t = call(fma, t * (t * t), 1 / 3, t)
    tt = t * t
    scale = 1 / (1 + tt)
    cosine = (1 - tt) * scale
    sine = (t + t) * scale
    # The deviator in the plane turns by twice the angle; written as a change, which is exactly
    # nothing where nothing turns.
    double_sine = 2 * sine * cosine
    double_versine = -2 * sine * sine
    apart = 0.5 * (s[0, 0] - s[1, 1])
    change = call(fma, double_versine, apart, -(double_sine * s[0, 1]))
    shear = call(fma, double_sine, apart, double_versine * s[0, 1])
    return (s[0, 0] + change, s[1, 1] - change, s[2, 2], s[0, 1] + shear)


def _spin_in_space(kin: Components, dl: Tensor, s: Symmetric) -> tuple:
    # R = I + k (T + T T), T the cross product with the scaled w / 2
    w = []
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        w.append(0.25 * (dl[k, j] - dl[j, k]))
    longer = 1 + sum(x * x for x in w) * (1 / 3)
    w = [x * longer for x in w]
    k = 2 / sum((x * x for x in w), 1)

    def rotation(i, j):
        if i == j:
            return 1 - k * sum(w[m] * w[m] for m in range(3) if m != i)
        cross = w[3 - i - j]
        return k * (w[i] * w[j] - cross) if (j - i) % 3 == 1 else k * (w[i] * w[j] + cross)

    r = {(i, j): rotation(i, j) for i, j in kin.pairs}
    a = {(i, j): sum(r[i, m] * s[m, j] for m in range(3)) for i, j in kin.pairs}
    return kin.symmetric(lambda i, j: sum(a[i, m] * r[j, m] for m in range(3)))


@formula()
def spin(kin, dl: Tensor, s: Symmetric):
    """R s R^T, with R the rotation of the increment dl: the objective (Jaumann) turn of a stress.

    R is the rotation by the vector w = axial(skew(dl)), built by Cayley's formula from
    tan(|w|/2) ~ |w|/2 (1 + |w|^2/12): orthogonal to round-off, its angle right to |w|^5/120
    (Hughes & Winget 1980 use tan(|w|/2) ~ |w|/2, right to |w|^3/12).
    """
    if kin.dimension == 1:
        return kin.symmetric(lambda i, j: s[i, j])
    return (_spin_in_plane if kin.dimension == 2 else _spin_in_space)(kin, dl, s)


@formula()
def nominal(kin, tau: Symmetric, f: Tensor):
    """First Piola-Kirchhoff stress P = tau F^-T of a Kirchhoff stress, in the layout of F.

    P times the reference volume and the gradient by reference positions makes nodal forces
    (`add_tensor_dot`).
    """
    if kin.dimension == 1:
        return (tau[0, 0] / f[0, 0],)
    back = inverse_of(kin, f)
    return kin.tensor(lambda i, j: sum(tau[i, k] * back.get((j, k), 0) for k in kin.axes))
