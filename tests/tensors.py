"""Tensors of a kinematics as NumPy matrices (3, 3), and back; strategies for Hypothesis."""

import numpy as np
import pytest
from hypothesis import strategies as st

from karamelo_py.points.kinematics import Axisymmetric, Line, PlaneStrain, Space, Spherical

KINEMATICS = [Line(), PlaneStrain(), Space()]  # those of a dimension
ALL_KINEMATICS = [*KINEMATICS, Axisymmetric()]
every_kinematics = pytest.mark.parametrize(
    "kin", ALL_KINEMATICS, ids=lambda kin: type(kin).__name__
)
with_spheres = pytest.mark.parametrize(
    "kin", [*ALL_KINEMATICS, Spherical()], ids=lambda kin: type(kin).__name__
)
# Places of the symmetric components xx yy zz xy xz yz in a matrix.
SYMMETRIC = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]


def matrix(kin, flat, rest=0.0):
    """(3, 3) of a tensor; the diagonal out of the kinematics is `rest` (1 for F, 0 for grad v)."""
    d = kin.dimension
    out = np.eye(3) * rest
    out[:d, :d] = np.reshape(flat[: d * d], (d, d))
    for place, value in zip(kin.Tensor.places[d * d :], flat[d * d :], strict=True):
        out[place] = value
    return out


def flat(kin, full):
    """The tensor with the components that the kinematics has, of a (3, 3) one."""
    return kin.Tensor._make([float(full[place]) for place in kin.Tensor.places])


def symmetric_matrix(kin, components):
    """(3, 3) of a symmetric tensor."""
    out = np.zeros((3, 3))
    for (i, j), value in zip(SYMMETRIC, components, strict=False):
        out[i, j] = out[j, i] = value
    return out


def symmetric_flat(kin, full):
    """The tensor with the components that the kinematics has, of a symmetric (3, 3) one."""
    return kin.Symmetric._make([float(full[place]) for place in kin.Symmetric.places])


def gradients(kin):
    """Gradients of a basis function: a vector, and N/r where there is a radius."""
    return numbers(len(kin.Gradient._fields)).map(kin.Gradient._make)


def vectors(kin, low=-1.0, high=1.0):
    """Vectors."""
    return numbers(kin.dimension, low, high).map(kin.Vector._make)


def numbers(size, low=-1.0, high=1.0):
    """Tuples of `size` ordinary numbers (no denormals: their rounding errors are relative to 1)."""
    one = st.floats(low, high, allow_subnormal=False)
    return st.tuples(*[one] * size)


def tensors(kin, size=1.0):
    """Tensors such as grad v."""
    return numbers(kin.tensor_size, -size, size).map(kin.Tensor._make)


def symmetric_tensors(kin, size=1.0):
    """Tensors such as stress."""
    return numbers(len(kin.symmetric_names), -size, size).map(kin.Symmetric._make)


def deformations(kin):
    """F with det F well above 0: the identity and something smaller."""
    d = kin.dimension
    unit = flat(kin, np.eye(3))
    return numbers(kin.tensor_size, -0.3 / d, 0.3 / d).map(
        lambda a: kin.Tensor._make([x + y for x, y in zip(unit, a, strict=True)])
    )


def rotation(w):
    """exp of the cross product with w (Rodrigues)."""
    angle = np.linalg.norm(w)
    x, y, z = np.asarray(w) / (angle or 1.0)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
