"""Vectors, and what makes them from tensors: velocities and nodal forces."""

from karamelo_py.compiler.compile import shared
from karamelo_py.compiler.symbols import add_product, call
from karamelo_py.compiler.tuples import row
from karamelo_py.points.kinematics import components


@shared
def vector_at(kin, array, i):
    """Row `i` of `array` (n, >= d) as a vector."""
    return row(array, i, 0, (0,) * kin.dimension)


@components.formula()
def add_outer(kin, total: components.Tensor, a: components.Vector, b: components.Vector):
    """total_ij + a_i b_j, of a tensor, a vector and a gradient: grad v of a node's share."""
    return kin.tensor(lambda i, j: add_product(a[kin.moved(i)], b[j], total[i, j]))


@components.formula()
def tensor_dot(kin, t: components.Tensor, a: components.Vector):
    """t_ij a_j of a tensor and a vector (in the plane of an axisymmetric point)."""
    return kin.vector(lambda i: sum(t[i, j] * a[j] for j in kin.directions))


def _add_dot(
    kin: components.Components,
    total: components.Vector,
    stress: components.Tensor,
    a: components.Vector,
) -> tuple:
    """total_i + stress_ij a_j, with what the part around the axis does along the radius."""

    def component(n):
        force = total[n]
        for i, j in reversed(kin.pairs):
            if kin.moved(i) == n:
                force = add_product(stress[i, j], a[j], force)
        return force

    return kin.vector(component)


@components.formula()
def add_symmetric_dot(kin, total: components.Vector, s: components.Symmetric, a: components.Vector):
    """total_i + s_ij a_j of a symmetric tensor and a gradient: the force of a stress on a node."""
    return _add_dot(kin, total, s, a)


@components.formula()
def add_tensor_dot(kin, total: components.Vector, p: components.Tensor, a: components.Vector):
    """total_i + p_ij a_j of a tensor and a gradient: the force of a nominal stress on a node."""
    return _add_dot(kin, total, p, a)


@components.formula()
def columns(kin, t: components.Tensor):
    """The columns of a tensor, vectors (in the plane of an axisymmetric point)."""
    return tuple(kin.vector(lambda i, j=j: t[i, j]) for j in kin.directions)


@components.formula()
def from_columns(kin, c: components.Number):
    """The tensor with these columns."""
    return kin.tensor(lambda i, j: c[j][i])


@components.formula()
def symmetric_columns(kin, s: components.Symmetric):
    """The same of a symmetric tensor."""
    return tuple(kin.vector(lambda i, j=j: s[i, j]) for j in kin.directions)


@components.formula()
def diagonal(kin, t: components.Tensor):
    """(t_xx, t_yy, t_zz) of a tensor, as far as vectors go.

    Of a symmetric tensor these are its first components.
    """
    return kin.vector(lambda i: t[i, i])


@components.formula()
def largest_component(kin, a: components.Vector):
    """max_i |a_i| of a vector."""
    sizes = [abs(a[i]) for i in kin.directions]
    return call(max, *sizes) if len(sizes) > 1 else sizes[0]
