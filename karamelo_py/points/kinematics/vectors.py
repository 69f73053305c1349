"""Vectors, and what makes them from tensors: velocities and nodal forces."""

from karamelo_py.compiler.compile import shared
from karamelo_py.compiler.symbols import add_product, call
from karamelo_py.compiler.tuples import row
from karamelo_py.points.kinematics.components import (
    Components,
    Number,
    Symmetric,
    Tensor,
    Vector,
    formula,
)


@shared
def vector_at(kin, array, i):
    """Row `i` of `array` (n, >= d) as a vector."""
    return row(array, i, 0, (0,) * kin.dimension)


@formula()
def add_outer(kin, total: Tensor, a: Vector, b: Vector):
    """total_ij + a_i b_j, of a tensor, a vector and a gradient: grad v of a node's share."""
    return kin.tensor(lambda i, j: add_product(a[kin.moved(i)], b[j], total[i, j]))


@formula()
def tensor_dot(kin, t: Tensor, a: Vector):
    """t_ij a_j of a tensor and a vector (in the plane of an axisymmetric point)."""
    return kin.vector(lambda i: sum(t[i, j] * a[j] for j in kin.directions))


def _add_dot(kin: Components, total: Vector, stress: Tensor, a: Vector) -> tuple:
    """total_i + stress_ij a_j, with what the part around the axis does along the radius."""

    def component(n):
        force = total[n]
        for i, j in reversed(kin.pairs):
            if kin.moved(i) == n:
                force = add_product(stress[i, j], a[j], force)
        return force

    return kin.vector(component)


@formula()
def add_symmetric_dot(kin, total: Vector, s: Symmetric, a: Vector):
    """total_i + s_ij a_j of a symmetric tensor and a gradient: the force of a stress on a node."""
    return _add_dot(kin, total, s, a)


@formula()
def add_tensor_dot(kin, total: Vector, p: Tensor, a: Vector):
    """total_i + p_ij a_j of a tensor and a gradient: the force of a nominal stress on a node."""
    return _add_dot(kin, total, p, a)


@formula()
def columns(kin, t: Tensor):
    """The columns of a tensor, vectors (in the plane of an axisymmetric point)."""
    return tuple(kin.vector(lambda i, j=j: t[i, j]) for j in kin.directions)


@formula()
def from_columns(kin, c: Number):
    """The tensor with these columns."""
    return kin.tensor(lambda i, j: c[j][i])


@formula()
def symmetric_columns(kin, s: Symmetric):
    """The same of a symmetric tensor."""
    return tuple(kin.vector(lambda i, j=j: s[i, j]) for j in kin.directions)


@formula()
def diagonal(kin, t: Tensor):
    """(t_xx, t_yy, t_zz) of a tensor, as far as vectors go.

    Of a symmetric tensor these are its first components.
    """
    return kin.vector(lambda i: t[i, i])


@formula()
def largest_component(kin, a: Vector):
    """max_i |a_i| of a vector."""
    sizes = [abs(a[i]) for i in kin.directions]
    return call(max, *sizes) if len(sizes) > 1 else sizes[0]
