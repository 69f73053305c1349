"""Tensors such as the deformation gradient F and the increment dl = dt grad v."""

from math import sqrt
from typing import Any

from karamelo_py.compiler import symbols
from karamelo_py.compiler.compile import real, shared
from karamelo_py.compiler.symbols import call
from karamelo_py.compiler.tuples import scale
from karamelo_py.points.kinematics.components import Components, Number, Tensor, formula
from karamelo_py.points.kinematics.tags import Axisymmetric, Line, PlaneStrain, Space


@formula()
def identity(kin, like: Number):
    """The unit tensor, in the number type of `like`."""
    return kin.tensor(lambda i, j: 1 if i == j else 0)


@shared
def zero_tensor(kin, like):
    """The zero of tensors such as grad v, in the number type of `like`."""
    return scale(real(0, like), identity(kin, like))


@formula()
def multiply(kin, a: Tensor, b: Tensor):
    """a_ik b_kj of two tensors."""
    return kin.tensor(lambda i, j: sum(a[i, k] * b[k, j] for k in kin.axes))


def inverse_of(kin: Components, f: Any) -> dict[tuple[int, int], Any]:
    """F^-1, the transposed cofactors over the determinant (Cramer), as symbols."""
    d = kin.dimension
    k = 1 / symbols.determinant(f, d)
    return {
        (i, j): k * symbols.cofactor(f, d, j, i) if max(i, j) < d else 1 / f[i, j]
        for i, j in kin.pairs
    }


@formula()
def inverse(kin, f: Tensor):
    """F^-1, of a tensor with det F other than 0."""
    return tuple(inverse_of(kin, f).values())


@formula()
def deform(kin, dl: Tensor, f: Tensor):
    """(I + dl) F: the deformation gradient after the increment dl = dt grad v."""
    return kin.tensor(lambda i, j: sum((dl[i, k] * f[k, j] for k in kin.axes), f[i, j]))


@shared
def increment_of(kin, change, f):
    """dl = (dt Fdot) F^-1, the increment that takes F to F + dt Fdot: deform(kin, dl, f) is that.

    `change` is dt Fdot, the step times the gradient of velocity by reference positions.
    """
    return multiply(kin, change, inverse(kin, f))


def _determinant(kin: Components, f: Any) -> Any:
    """The determinant in the plane, times the stretch around the axis."""
    plane = symbols.determinant(f, kin.dimension)
    return plane * f[2, 2] if kin.axes[kin.dimension :] else plane


@formula()
def volume_ratio(kin, dl: Tensor):
    """det(I + dl): by what factor the increment changes the volume."""
    return _determinant(kin, {(i, j): 1 + dl[i, j] if i == j else dl[i, j] for i, j in kin.pairs})


@formula()
def determinant(kin, f: Tensor):
    """det F."""
    return _determinant(kin, f)


# Where a kinematics has no component F_ii, F_ii is 1.


@formula()
def left_cauchy_green(kin, f: Tensor):
    """b = F F^T, as a symmetric tensor."""
    return kin.symmetric(lambda i, j: sum(f[i, k] * f[j, k] for k in kin.axes) or 1)


@formula()
def right_cauchy_green(kin, f: Tensor):
    """C = F^T F, as a symmetric tensor."""
    return kin.symmetric(lambda i, j: sum(f[k, i] * f[k, j] for k in kin.axes) or 1)


@formula(Line, PlaneStrain, Axisymmetric)
def stretch(kin, f: Tensor):
    """Right stretch U = sqrt(F^T F), as a symmetric tensor, for det F other than 0.

    In the plane U = (C + |det F| I) / sqrt(tr C + 2 |det F|), from Cayley and Hamilton (Hoger &
    Carlson 1984, J. Elasticity 14). In space Newton's iteration X <- (g X + X^-T / g) / 2 takes F
    to its rotation R, then U = R^T F (Higham 1986, SIAM J. Sci. Stat. Comput. 7, with his scaling
    by Frobenius norms): right to round-off whether or not principal stretches are equal, which
    closed forms are not.
    """
    along = {(i, i): abs(f[i, i] or 1) for i in range(3)}
    if kin.dimension == 1:
        return kin.symmetric(lambda i, j: along[i, j])
    c = {(i, j): sum(f[k, i] * f[k, j] for k in range(2)) for i in range(2) for j in range(2)}
    size = abs(symbols.determinant(f, 2))
    k = 1 / call(sqrt, c[0, 0] + c[1, 1] + size + size)
    within = {(0, 0): k * (c[0, 0] + size), (1, 1): k * (c[1, 1] + size), (0, 1): k * c[0, 1]}
    return kin.symmetric(lambda i, j: (along | within)[i, j])


# Round-off is reached after four steps for ratios of principal stretches up to 2, and after seven
# for whatever the inverse itself can bear.
_POLAR_STEPS = 7


@stretch.on(Space)
def _stretch_space(kin, f):
    r = f
    for _ in range(_POLAR_STEPS):
        r = _towards_rotation(kin, r)
    return _turned_back(kin, r, f)


@formula(Space)
def _towards_rotation(kin, r: Tensor):
    """A step of Newton's iteration from `r` to its rotation."""
    back = inverse_of(kin, r)
    squares = (sum(t[pair] * t[pair] for pair in kin.pairs) for t in (back, r))
    g = call(sqrt, call(sqrt, next(squares) / next(squares)))
    return kin.tensor(lambda i, j: (0.5 * g) * r[i, j] + (0.5 / g) * back[j, i])


@formula(Space)
def _turned_back(kin, r: Tensor, f: Tensor):
    """The symmetric part of R^T F."""

    def component(i, j):
        terms = [r[k, i] * f[k, j] for k in kin.axes]
        if i == j:
            return sum(terms)
        return 0.5 * sum([*terms, *(r[k, j] * f[k, i] for k in kin.axes)])

    return kin.symmetric(component)
