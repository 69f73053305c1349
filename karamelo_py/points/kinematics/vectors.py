"""Vectors, and what makes them from tensors: velocities and nodal forces."""

from __future__ import annotations

from karamelo_py.compiler.compile import fma, point_function
from karamelo_py.points.kinematics.tags import Axisymmetric, Line, PlaneStrain, Space


@point_function()
def vector_at(kin, array, i):
    """Row `i` of `array` (n, >= d) as a vector."""


@vector_at.on(Line)
def _(kin, array, i):
    return (array[i, 0],)


@vector_at.on(PlaneStrain)
@vector_at.on(Axisymmetric)
def _(kin, array, i):
    return (array[i, 0], array[i, 1])


@vector_at.on(Space)
def _(kin, array, i):
    return (array[i, 0], array[i, 1], array[i, 2])


@point_function()
def add_outer(kin, total, a, b):
    """total_ij + a_i b_j, of a tensor, a vector and a gradient: grad v of a node's share."""


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


@add_outer.on(Axisymmetric)
def _(kin, total, a, b):
    return (
        fma(a[0], b[0], total[0]),
        fma(a[0], b[1], total[1]),
        fma(a[1], b[0], total[2]),
        fma(a[1], b[1], total[3]),
        fma(a[0], b[2], total[4]),
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
    """t_ij a_j of a tensor and a vector (in the plane of an axisymmetric point)."""


@tensor_dot.on(Line)
def _(kin, t, a):
    return (t[0] * a[0],)


@tensor_dot.on(PlaneStrain)
@tensor_dot.on(Axisymmetric)
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
    """total_i + s_ij a_j of a symmetric tensor and a gradient: the force of a stress on a node."""


@add_symmetric_dot.on(Line)
def _(kin, total, s, a):
    return (fma(s[0], a[0], total[0]),)


@add_symmetric_dot.on(PlaneStrain)
def _(kin, total, s, a):
    return (
        fma(s[0], a[0], fma(s[3], a[1], total[0])),
        fma(s[3], a[0], fma(s[1], a[1], total[1])),
    )


@add_symmetric_dot.on(Axisymmetric)
def _(kin, total, s, a):
    return (
        fma(s[0], a[0], fma(s[3], a[1], fma(s[2], a[2], total[0]))),
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
def add_tensor_dot(kin, total, p, a):
    """total_i + p_ij a_j of a tensor and a gradient: the force of a nominal stress on a node."""


@add_tensor_dot.on(Line)
def _(kin, total, p, a):
    return (fma(p[0], a[0], total[0]),)


@add_tensor_dot.on(PlaneStrain)
def _(kin, total, p, a):
    return (
        fma(p[0], a[0], fma(p[1], a[1], total[0])),
        fma(p[2], a[0], fma(p[3], a[1], total[1])),
    )


@add_tensor_dot.on(Axisymmetric)
def _(kin, total, p, a):
    return (
        fma(p[0], a[0], fma(p[1], a[1], fma(p[4], a[2], total[0]))),
        fma(p[2], a[0], fma(p[3], a[1], total[1])),
    )


@add_tensor_dot.on(Space)
def _(kin, total, p, a):
    return (
        fma(p[0], a[0], fma(p[1], a[1], fma(p[2], a[2], total[0]))),
        fma(p[3], a[0], fma(p[4], a[1], fma(p[5], a[2], total[1]))),
        fma(p[6], a[0], fma(p[7], a[1], fma(p[8], a[2], total[2]))),
    )


@point_function()
def diagonal(kin, t):
    """(t_xx, t_yy, t_zz) of a tensor, as far as vectors go.

    Of a symmetric tensor these are its first components.
    """


@diagonal.on(Line)
def _(kin, t):
    return (t[0],)


@diagonal.on(PlaneStrain)
@diagonal.on(Axisymmetric)
def _(kin, t):
    return (t[0], t[3])


@diagonal.on(Space)
def _(kin, t):
    return (t[0], t[4], t[8])


@point_function()
def largest_component(kin, a):
    """max_i |a_i| of a vector."""


@largest_component.on(Line)
def _(kin, a):
    return abs(a[0])


@largest_component.on(PlaneStrain)
@largest_component.on(Axisymmetric)
def _(kin, a):
    return max(abs(a[0]), abs(a[1]))


@largest_component.on(Space)
def _(kin, a):
    return max(abs(a[0]), abs(a[1]), abs(a[2]))
