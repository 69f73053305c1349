"""Components of vectors and tensors in each kinematics, and the algebra on them.

================  ==============  =============================  =================================
tag               vector          velocity gradient, F           symmetric tensor (stress, strain)
================  ==============  =============================  =================================
``Line``          x               xx                             xx yy zz
``PlaneStrain``   x y             xx xy yx yy                    xx yy zz xy
``Axisymmetric``  r z             rr rz zr zz tt                 rr zz tt rz
``Twisted``       r z             rr rz zr zz tt tr tz rt zt     rr zz tt rz rt zt
``Cylindrical``   r               rr tt                          rr tt zz
``Spherical``     r               rr tt pp                       rr tt pp
``Space``         x y z           xx xy xz yx yy yz zx zy zz     xx yy zz xy xz yz
================  ==============  =============================  =================================

Gradients of basis functions end with N/r for each direction around an axis or centre (hoop strain
and force). Kernels are traced for each tag, so loops, classes and operators of this module cost
nothing at run time. a + dt * b of tensors is rounded once (`fma`).
"""

from collections import namedtuple
from math import sqrt
from typing import NamedTuple

from numba import config

from karamelo_py.compiler import algebra, fma, real

COMPILED = not config.DISABLE_JIT  # interpreted code rounds a `fma` twice


class Line(NamedTuple):
    word = "1D"
    per = ""  # unit of forces, masses and energies
    hoops = 0  # number of hoop directions, in which case x is the distance from axis or centre
    dimension = 1
    tensor_names = ("11",)


class PlaneStrain(NamedTuple):
    word = "plane-strain"
    per = " per thickness"
    hoops = 0
    dimension = 2
    tensor_names = ("11", "12", "21", "22")


class Axisymmetric(NamedTuple):
    """A body of revolution without torsion; x is the radius, y the axis."""

    word = "axisymmetric"
    per = " per radian"
    hoops = 1
    dimension = 2
    tensor_names = ("11", "12", "21", "22", "33")


class Cylindrical(NamedTuple):
    """1D plane strain: x is the distance from an axis, unit length along it."""

    word = "cylindrical"
    per = " per radian and length"
    hoops = 1
    dimension = 1
    tensor_names = ("11", "22")


class Spherical(NamedTuple):
    word = "spherical"
    per = " per steradian"
    hoops = 2
    dimension = 1
    tensor_names = ("11", "22", "33")


class Space(NamedTuple):
    word = "3D"
    per = ""
    hoops = 0
    dimension = 3
    tensor_names = ("11", "12", "13", "21", "22", "23", "31", "32", "33")


TAGS = (Line, PlaneStrain, Axisymmetric, Cylindrical, Spherical, Space)
KINEMATICS = {1: Line, 2: PlaneStrain, 3: Space}


def free_from(kin):
    return 1 if kin.hoops else 0


def planar(kin):
    return kin.plane


def total(terms):
    """Sum from left to right; since Python 3.12, `sum` rounds differently."""
    made = terms[0]
    for term in terms[1:]:
        made = made + term
    return made


def product(factors):
    made = factors[0]
    for factor in factors[1:]:
        made = made * factor
    return made


def dot(*vectors):
    return total([product(components) for components in zip(*vectors, strict=True)])


class Elements(tuple):
    """Components that exist in a kinematics.

    `places` are (row, column) from 0, for vectors twice the direction; `axes` are the row indices.
    Tensors also have `acting`, which is `places` with the direction in which a row acts (radial for
    hoop components), and `rows`, index and column of the components by direction, last first.
    """

    __slots__ = ()
    __array_ufunc__ = None  # products with NumPy numbers are made by these classes
    origin = None  # for a product: the function that adds it with one rounding, and the factors

    def __add__(self, other):
        if type(other) is Isotropic:
            return self.with_diagonal(other.p)
        if isinstance(other, Elements) and other.origin is not None:
            add, a, b = other.origin
            return add(self, a, b)
        return self._make([a + b for a, b in zip(self, other, strict=True)])

    def __sub__(self, other):
        if type(other) is Isotropic:
            return self.with_diagonal(-other.p)
        return self._make([a - b for a, b in zip(self, other, strict=True)])

    def __mul__(self, factor):
        if isinstance(factor, (Elements, Isotropic)):
            return NotImplemented
        out = self._make([factor * a for a in self])
        if COMPILED:
            out.origin = add_scaled, factor, self
        return out

    __rmul__ = __mul__

    def __truediv__(self, number):
        return (1 / number) * self

    def __neg__(self):
        return self._make([-a for a in self])

    def with_diagonal(self, p):
        """Return the tensor plus p I; p = 0 compiles to nothing."""
        pairs = zip(self, self.places, strict=True)
        return self._make([a + p if i == j else a for a, (i, j) in pairs])

    def at(self):
        return dict(zip(self.places, self, strict=True))


def add_scaled(start, factor, a):
    return start._make([fma(factor, b, t) for t, b in zip(start, a, strict=True)])


def add_outer(start, a, b):
    pairs = zip(start, start.acting, strict=True)
    return start._make([fma(a[i], b[j], t) for t, (i, j) in pairs])


def add_product(start, s, gradient):
    return s.vector._make(
        [add_row(s, terms, gradient, a) for a, terms in zip(start, s.rows, strict=True)]
    )


def add_row(s, terms, gradient, a):
    for k, j in terms:
        a = fma(s[k], gradient[j], a)
    return a


class Isotropic(namedtuple("Isotropic", "p")):
    __slots__ = ()
    __array_ufunc__ = None

    def __mul__(self, factor):
        return Isotropic(factor * self.p)

    __rmul__ = __mul__

    def __neg__(self):
        return Isotropic(-self.p)

    def __add__(self, other):
        return other + self

    def __sub__(self, other):
        return -other + self


algebra(Isotropic)
I = Isotropic(1)  # noqa: E741


class Vector(Elements):
    __slots__ = ()

    def planar(self):
        return self if self.vector is type(self) else self.vector._make(self[: self.kin.dimension])

    def squared(self):
        return total([a * a for a in self])

    def largest(self):
        return max(*map(abs, self)) if len(self) > 1 else abs(self[0])


class Matrix(Elements):
    __slots__ = ()

    def dot(self, gradient):
        """Return s_ij g_j, rounded once per term; hoop components act in the radial direction."""
        made = []
        for (k, j), *rest in self.rows:
            made.append(add_row(self, rest, gradient, self[k] * gradient[j]))
        out = self.vector._make(made)
        out.origin = add_product, self, gradient
        return out

    def columns(self):
        a, d = self.at(), self.kin.dimension
        return tuple([self.vector._make([a[i, j] for i in range(d)]) for j in range(d)])

    def diagonal(self):
        a = self.at()
        return self.vector._make([a[i, i] for i in range(self.kin.dimension)])


class Tensor(Matrix):
    __slots__ = ()

    def __matmul__(self, other):
        """Return a_ik b_kj, or a_ij b_j for a vector."""
        if isinstance(other, Vector):
            d = self.kin.dimension
            rows = [zip(self[d * i : d * i + d], other, strict=False) for i in range(d)]
            return self.vector._make([total([a * b for a, b in row]) for row in rows])
        a, b = self.at(), other.at()
        return self._make(
            [
                total([a[i, k] * b[k, j] for k in self.axes if (i, k) in a and (k, j) in b])
                for i, j in self.places
            ]
        )

    def transposed(self):
        a = self.at()
        return self._make([a[j, i] for i, j in self.places])

    def planar(self):
        made = self.vector.tensor
        return self if made is type(self) else made._make(self[: len(made.places)])

    def generator(self):
        return self

    def strain_at_end(self):
        """Return the strain of a small increment; its stress is added to the rotated old stress."""
        return sym(self)

    def after(self, dl):
        """Return (I + dl) F as F + dl F, in which small increments retain their digits."""
        a, b = dl.at(), self.at()
        return self._make(
            [
                total([f, *[a[i, k] * b[k, j] for k in self.axes if (i, k) in a and (k, j) in b]])
                for f, (i, j) in zip(self, self.places, strict=True)
            ]
        )

    # In 2D, the absent F_ii is 1.

    def left_cauchy_green(self):
        a = self.at()
        return self.symmetric._make([squares(a, self.axes, i, j) for i, j in self.symmetric.places])

    def right_cauchy_green(self):
        a = self.transposed().at()
        return self.symmetric._make([squares(a, self.axes, i, j) for i, j in self.symmetric.places])


def further_terms(squared):
    """Return tan(x) / x - 1 - x^2 / 3, with error x^8/46."""
    return squared * squared * (2 / 15 + squared * (17 / 315))


# Iterations that reach round-off for any ratio of principal stretches.
ROOT_STEPS = 6


def cofactor(a, d, i, j):
    if d == 1:
        return 1
    if d == 2:
        return a[1 - i, 1 - j] if i == j else -a[1 - i, 1 - j]
    p, q, r, s = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
    return a[p, r] * a[q, s] - a[p, s] * a[q, r]


def determinant(a, d):
    return total([a[0, j] * cofactor(a, d, 0, j) for j in range(d)])


def squares(a, axes, i, j):
    terms = [a[i, k] * a[j, k] for k in axes if (i, k) in a and (j, k) in a]
    return total(terms) if len(terms) else 1


class LargeIncrement(namedtuple("LargeIncrement", "dl logarithm")):
    """Increment dl of a large rotation, with strain and rotation from ln(I + dl)."""

    __slots__ = ()

    def __add__(self, other):
        return self.dl + other

    def at(self):
        return self.dl.at()

    def generator(self):
        return self.logarithm

    def strain_at_end(self):
        """Return the strain in the axes at the end; its stress is rotated by half of the angle."""
        return sym(self).turned(self._replace(logarithm=0.5 * self.logarithm))


algebra(LargeIncrement)


def large(dl):
    """Return ln(I + dl) = 2 artanh(G / 2), with the midpoint gradient G = 2 dl (2 I + dl)^-1.

    Odd powers of G are skew for a pure rotation (Hughes & Winget 1980), so truncation causes no
    strain. The error is G^7/448.
    """
    G = dl @ inv(I + 0.5 * dl)
    squared = G @ G
    cubed = squared @ G
    return LargeIncrement(dl, G + (1 / 12) * cubed + (1 / 80) * (squared @ cubed))


class SymmetricTensor(Matrix):
    __slots__ = ()

    def at(self):
        a = dict(zip(self.places, self, strict=True))
        return a | {(j, i): value for (i, j), value in a.items()}

    def mean_of_stretching(self):
        axes = self.kin.Tensor.axes
        return total([self[i] for i in axes]) / len(axes)

    def turned(self, dl):
        """Return R s R^T with the rotation R of the increment (Jaumann, objective).

        R rotates about w = axial(skew(dl)) by Cayley's formula with tan(|w|/2) ~ |w|/2 (1 +
        |w|^2/12). R is orthogonal to round-off, with angle error |w|^5/120 (Hughes & Winget 1980,
        without the second term: |w|^3/12). A `LargeIncrement` has two more terms.
        """
        if self.kin.dimension == 1:
            return self
        return self.rotated_in_2d(dl) if self.kin.dimension == 2 else self.rotated_in_3d(dl)

    def rotated_in_2d(self, dl):
        turn = dl.generator().at()
        xx, yy, zz, xy = self
        half = 0.25 * (turn[1, 0] - turn[0, 1])
        t = fma(half * (half * half), 1 / 3, half)
        if isinstance(dl, LargeIncrement):
            t = t + half * further_terms(half * half)
        tt = t * t
        scale = 1 / (1 + tt)
        cosine = (1 - tt) * scale
        sine = (t + t) * scale
        # The in-plane deviator rotates by twice the angle. The change is added, so that zero
        # rotation is exact.
        double_sine = 2 * sine * cosine
        double_versine = -2 * sine * sine
        apart = 0.5 * (xx - yy)
        change = fma(double_versine, apart, -(double_sine * xy))
        shear = fma(double_sine, apart, double_versine * xy)
        return self._make([xx + change, yy - change, zz, xy + shear])

    def rotated_in_3d(self, dl):
        # R = I + k (T + T T), T being the cross product with the scaled w / 2
        turn, s, axes = dl.generator().at(), self.at(), range(3)
        w = [0.25 * (turn[(i + 2) % 3, (i + 1) % 3] - turn[(i + 1) % 3, (i + 2) % 3]) for i in axes]
        squared = total([x * x for x in w])
        longer = 1 + squared * (1 / 3)
        if isinstance(dl, LargeIncrement):
            longer = longer + further_terms(squared)
        w = [x * longer for x in w]
        k = 2 / total([1, *[x * x for x in w]])

        def rotation(i, j):
            if i == j:
                return 1 - k * total([w[m] * w[m] for m in axes if m != i])
            cross = w[3 - i - j]
            return k * (w[i] * w[j] - cross) if (j - i) % 3 == 1 else k * (w[i] * w[j] + cross)

        r = {(i, j): rotation(i, j) for i in axes for j in axes}
        a = {(i, j): total([r[i, m] * s[m, j] for m in axes]) for i in axes for j in axes}
        return self._make([total([a[i, m] * r[j, m] for m in axes]) for i, j in self.places])

    def carried(self, dl):
        """Return F s F^T with F = I + dl."""
        f, s = {(i, i): 1 for i in range(3)} | (I + dl).at(), self.at()

        def times_s(i, j):
            return total([f[i, k] * s[k, j] for k in range(3) if (i, k) in f and (k, j) in s])

        def component(i, j):
            terms = [times_s(i, k) * f[j, k] for k in range(3) if (i, k) in s and (j, k) in f]
            return total(terms)

        return self._make([component(i, j) for i, j in self.places])

    def largest_row_sum(self):
        """Return max_i sum_j |s_ij|, a bound of the largest eigenvalue (Gershgorin)."""
        a = self.at()
        rows = [[(i, i), *[(i, j) for j in range(3) if j != i]] for i in range(3)]
        return max(*[total([abs(a[pair]) for pair in row if pair in a]) for row in rows])

    def smallest_row_difference(self):
        """Return min_i (s_ii - sum_j |s_ij|), j != i, a bound of the smallest eigenvalue."""
        a = self.at()
        rows = [[abs(a[i, j]) for j in range(3) if j != i and (i, j) in a] for i in range(3)]
        return min(*[a[i, i] - total([0, *row]) for i, row in enumerate(rows)])

    def nominal(self, F):
        if self.kin.dimension == 1:
            return type(F)._make([s / f for s, f in zip(self, F, strict=False)])
        a, back = self.at(), inv(F).at()
        return type(F)._make(
            [
                total([a[i, k] * back[j, k] for k in F.axes if (i, k) in a and (j, k) in back])
                for i, j in F.places
            ]
        )


for _kind in (Elements, Vector, Matrix, Tensor, SymmetricTensor):
    algebra(_kind)


def tensor_class(kind: type, tag: type, names: tuple, around: tuple = ()) -> type:
    words = [name.translate(_WORDS) for name in names] + [f"around_{k + 1}" for k in around]
    name = f"{tag.__name__}{kind.__name__}" + ("Gradient" if around else "")
    one = type(name, (kind, namedtuple(name, words)), {"__module__": __name__})
    one._make = classmethod(tuple.__new__)
    one.kin = tag()
    one.places = tuple((int(n[0]) - 1, int(n[-1]) - 1) for n in names)
    one.places += tuple((k, k) for k in around)
    one.axes = tuple(sorted({i for i, _ in one.places}))
    globals()[name] = one
    return one


def set_rows(one: type, whole: type) -> None:
    d = one.kin.dimension
    one.acting = tuple((i if i < d else 0, j) for i, j in one.places)
    number = {(j, i): k for k, (i, j) in enumerate(one.places)}
    number |= {index: k for k, index in enumerate(one.places)}
    acting = [(i if i < d else 0, number[i, j], j) for i, j in reversed(whole.places)]
    one.rows = tuple(tuple((k, j) for i, k, j in acting if i == n) for n in range(d))


_WORDS = str.maketrans("123", "xyz")
_SYMMETRIC = ("11", "22", "33", "12", "13", "23")
for _tag in TAGS:
    _tag.plane = KINEMATICS[_tag.dimension]()
    _tag.tensor_size = len(_tag.tensor_names)
    _tag.symmetric_names = _SYMMETRIC[: {1: 3, 2: 4, 3: 6}[_tag.dimension]]
    _tag.Symmetric = tensor_class(SymmetricTensor, _tag, _tag.symmetric_names)
    _tag.Tensor = tensor_class(Tensor, _tag, _tag.tensor_names)
    _tag.Tensor.symmetric = _tag.Symmetric
    _names = "123"[: _tag.dimension]
    if _tag.hoops:
        _tag.Vector = KINEMATICS[_tag.dimension].Vector
        _tag.Gradient = tensor_class(Vector, _tag, _names, _tag.Tensor.axes[_tag.dimension :])
    else:
        _tag.Vector = _tag.Gradient = tensor_class(Vector, _tag, _names)
    _tag.Gradient.tensor = _tag.Tensor
    _tag.Unknown = _tag.Vector  # unknowns of a node in implicit steps
    for _one in (_tag.Tensor, _tag.Symmetric):
        set_rows(_one, _tag.Tensor)
    for _one in (_tag.Vector, _tag.Gradient, _tag.Tensor, _tag.Symmetric):
        _one.vector = _tag.Vector


def vector(kin, numbers):
    return kin.Vector._make(numbers)


def gradient(kin, numbers):
    return kin.Gradient._make(numbers)


def tensor(kin, numbers):
    return kin.Tensor._make(numbers)


def symmetric_tensor(kin, numbers):
    return kin.Symmetric._make(numbers)


def unit(kin):
    return kin.Tensor._make([1 if i == j else 0 for i, j in kin.Tensor.places])


def nothing(kin):
    return kin.Symmetric._make([0 for _ in kin.Symmetric.places])


def zero(kin, template):
    return kin.Tensor._make([real(0, template) for _ in kin.Tensor.places])


def zero_vector(kin, template):
    return kin.Vector._make([real(0, template) for _ in kin.Vector.places])


def det(f):
    a, d = f.at(), f.kin.dimension
    return product([determinant(a, d), *[a[i, i] for i in f.axes[d:]]])


def inv(f):
    a, d = f.at(), f.kin.dimension
    k = 1 / determinant(a, d)
    return f._make(
        [k * cofactor(a, d, j, i) if max(i, j) < d else 1 / a[i, j] for i, j in f.places]
    )


def stretch(f):
    """Return U = sqrt(F^T F) for det F != 0.

    2D: U = (C + |det F| I) / sqrt(tr C + 2 |det F|) (Hoger & Carlson 1984, J. Elasticity 14). 3D: U
    = (C + i2 I)^-1 (i1 C + i3 I) with the invariants of U, i1^2 = tr C + 2 i2 and i2^2 = c2 + 2 i1
    i3. Newton's method for i1 starts from the upper bound sqrt(3 tr C), which exceeds i1 by a term
    of second order in the strains.
    """
    if f.kin.dimension == 3:
        return stretch_in_space(f)
    a = f.at()
    if f.kin.dimension == 1:
        return f.symmetric._make([abs(a.get((i, i), 1)) for i in range(3)])
    size = abs(a[0, 0] * a[1, 1] + a[0, 1] * -a[1, 0])
    c = {(i, j): a[0, i] * a[0, j] + a[1, i] * a[1, j] for i in (0, 1) for j in (0, 1)}
    k = 1 / sqrt(c[0, 0] + c[1, 1] + size + size)
    around = abs(a.get((2, 2), 1))
    return f.symmetric._make([k * (c[0, 0] + size), k * (c[1, 1] + size), around, k * c[0, 1]])


def stretch_in_space(f):
    C = f.right_cauchy_green()
    xx, yy, zz, xy, xz, yz = C
    first, third = xx + yy + zz, abs(determinant(f.at(), 3))
    second = xx * yy + yy * zz + zz * xx - (xy * xy + xz * xz + yz * yz)
    i1 = sqrt(3 * first)
    for _ in range(ROOT_STEPS):
        i2 = sqrt(second + 2 * third * i1)
        i1 = i1 - 0.5 * (i1 * i1 - first - 2 * i2) / (i1 - third / i2)
    i2 = sqrt(second + 2 * third * i1)
    a, b = (C + i2 * I).at(), (i1 * C + third * I).at()
    k = 1 / determinant(a, 3)
    back = {(i, j): cofactor(a, 3, i, j) for i in range(3) for j in range(3)}
    return C._make([k * total([back[i, m] * b[m, j] for m in range(3)]) for i, j in C.places])


def sym(a):
    a = a.generator()
    made, a = a.symmetric, a.at()
    return made._make(
        [0.5 * (a[i, j] + a[j, i]) if i != j else a.get((i, i), 0) for i, j in made.places]
    )


def tr(s):
    return s[0] + s[1] + s[2]


def dev(s):
    return s + (-1 / 3 * tr(s)) * I


def inner(s, e):
    normal = s[0] * e[0] + s[1] * e[1] + s[2] * e[2]
    shears = [a * b for a, b in zip(s[3:], e[3:], strict=True)]
    return normal + 2 * total(shears) if len(shears) else normal


def von_mises(s):
    """Return sqrt(3/2 s:s) of a deviator s: |s_xx - s_yy| in uniaxial stress."""
    return sqrt(1.5 * inner(s, s))


def outer(a, b):
    """Return a_i b_j, with the hoop component a_r N/r if b has N/r."""
    out = b.tensor._make([a[i] * b[j] for i, j in b.tensor.acting])
    if COMPILED:
        out.origin = add_outer, a, b
    return out


def from_columns(columns):
    made = columns[0].tensor
    return made._make([columns[j][i] for i, j in made.places])
