"""Tensor algebra of one point against NumPy, and the rotation of stress against its properties.

Tolerances of 1e-12 are round-off of a dozen operations on numbers of order one.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from tensors import (
    KINEMATICS,
    deformations,
    flat,
    matrix,
    numbers,
    symmetric_flat,
    symmetric_matrix,
    symmetric_tensors,
    tensors,
)

from karamelo_py.points.kinematics import (
    Line,
    PlaneStrain,
    Space,
    add_outer,
    add_pressure,
    add_symmetric_dot,
    contract,
    deform,
    determinant,
    dimension,
    identity,
    largest_component,
    largest_row_sum,
    left_cauchy_green,
    right_cauchy_green,
    spin,
    symmetric_part,
    tensor_dot,
    trace,
    vector_at,
    volume_ratio,
    zero_symmetric,
    zero_tensor,
)

ROUND_OFF = 1e-12
every_kinematics = pytest.mark.parametrize("kin", KINEMATICS, ids=lambda kin: type(kin).__name__)


def close(a, b, tolerance=ROUND_OFF):
    return np.allclose(a, b, rtol=tolerance, atol=tolerance)


@every_kinematics
@given(data=st.data())
def test_products_are_those_of_matrices(kin, data):
    d = kin.dimension
    t, a, b = data.draw(tensors(kin)), data.draw(numbers(d)), data.draw(numbers(d))
    s, e = data.draw(symmetric_tensors(kin)), data.draw(symmetric_tensors(kin))
    full = symmetric_matrix(kin, s)
    zero = (0.0,) * (d * d)
    assert close(add_outer(kin, zero, a, b), np.outer(a, b).ravel())
    assert close(tensor_dot(kin, t, a), np.reshape(t, (d, d)) @ a)
    assert close(add_symmetric_dot(kin, b, s, a), b + full[:d, :d] @ a)
    assert close(contract(kin, s, e), np.sum(full * symmetric_matrix(kin, e)))
    assert close(trace(s), np.trace(full))
    pressed = add_pressure(kin, 0.7, s, 0.3)
    assert close(symmetric_matrix(kin, pressed), 0.7 * full + 0.3 * np.eye(3))
    assert largest_component(kin, a) == np.abs(a).max()


@every_kinematics
@given(data=st.data())
def test_strains_are_those_of_matrices(kin, data):
    f, dl = data.draw(tensors(kin)), data.draw(tensors(kin))
    full = matrix(kin, f, 1.0)
    increment = np.eye(3) + matrix(kin, dl)
    assert close(matrix(kin, deform(kin, dl, f), 1.0), increment @ full)
    assert close(determinant(kin, f), np.linalg.det(full))
    assert close(volume_ratio(kin, dl), np.linalg.det(increment))
    assert close(symmetric_matrix(kin, left_cauchy_green(kin, f)), full @ full.T)
    assert close(symmetric_matrix(kin, right_cauchy_green(kin, f)), full.T @ full)
    gradient = matrix(kin, dl)
    assert close(symmetric_matrix(kin, symmetric_part(kin, dl)), (gradient + gradient.T) / 2)


@every_kinematics
@given(data=st.data())
def test_increments_multiply_the_volume(kin, data):
    """det((I + dl) F) = det(I + dl) det F."""
    f, dl = data.draw(deformations(kin)), data.draw(tensors(kin))
    together = determinant(kin, deform(kin, dl, f))
    assert close(together, volume_ratio(kin, dl) * determinant(kin, f))


@every_kinematics
def test_units_and_zeros(kin):
    assert close(matrix(kin, identity(kin, 1.0), 1.0), np.eye(3))
    assert zero_tensor(kin, 1.0) == (0.0,) * kin.tensor_size
    assert zero_symmetric(kin, 1.0) == (0.0,) * len(kin.symmetric_names)
    assert dimension(kin) == kin.dimension
    rows = np.arange(12.0).reshape(3, 4)
    assert vector_at(kin, rows, 1) == tuple(rows[1, : kin.dimension])


@every_kinematics
@given(data=st.data())
def test_row_sums_bound_the_eigenvalues(kin, data):
    """Gershgorin 1931; the wave speed of hyperelastic laws relies on it."""
    s = data.draw(symmetric_tensors(kin))
    largest = np.abs(np.linalg.eigvalsh(symmetric_matrix(kin, s))).max()
    assert largest_row_sum(kin, s) >= largest - ROUND_OFF


# --- the turn of a stress ---------------------------------------------------------------------


def invariants(full):
    return np.array([np.trace(full), np.sum(full * full), np.linalg.det(full)])


@every_kinematics
@given(data=st.data())
def test_spin_keeps_the_invariants(kin, data):
    """Whatever the increment, the turn is a rotation to round-off, however large."""
    s, dl = data.draw(symmetric_tensors(kin)), data.draw(tensors(kin, 2.0))
    before = symmetric_matrix(kin, s)
    after = symmetric_matrix(kin, spin(kin, dl, s))
    assert close(invariants(after), invariants(before))


def rotation(w):
    """exp of the cross product with w (Rodrigues)."""
    angle = np.linalg.norm(w)
    x, y, z = w / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def axial(w):
    """The velocity gradient of the rotation vector w, (3, 3)."""
    x, y, z = w
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


@given(angle=st.floats(-0.02, 0.02), s=symmetric_tensors(PlaneStrain()))
def test_spin_turns_by_the_angle_in_the_plane(angle, s):
    """The error of the angle is |w|^5/120: 3e-11 at |w| = 0.02, a large turn for a step."""
    kin = PlaneStrain()
    turn = rotation(np.array([0, 0, angle])) if abs(angle) > 1e-12 else np.eye(3)
    exact = turn @ symmetric_matrix(kin, s) @ turn.T
    turned = spin(kin, flat(kin, axial((0, 0, angle))), s)
    assert close(turned, symmetric_flat(kin, exact), 1e-9)


@given(w=numbers(3, -0.01, 0.01).filter(lambda w: np.linalg.norm(w) > 1e-9),
       s=symmetric_tensors(Space()))  # fmt: skip
def test_spin_turns_by_the_angle_in_space(w, s):
    kin = Space()
    turn = rotation(np.array(w))
    exact = turn @ symmetric_matrix(kin, s) @ turn.T
    turned = spin(kin, flat(kin, axial(w)), s)
    assert close(turned, symmetric_flat(kin, exact), 1e-9)


@pytest.mark.parametrize("angle", [0.4, 0.2, 0.1])
def test_error_of_the_angle_falls_with_its_fifth_power(angle):
    """tan(w/2) ~ (w/2)(1 + w^2/12) leaves w^5/120: against 1/80 of Hughes & Winget's w^3/12."""
    kin = PlaneStrain()
    turned = spin(kin, flat(kin, axial((0, 0, angle))), (1.0, 0.0, 0.0, 0.0))
    reached = np.arctan2(np.sqrt(turned[1]), np.sqrt(turned[0]))
    # The next term of the series is 17 w^7 / 20160 of the tangent's half: a tenth at 0.4.
    assert abs(reached - angle) == pytest.approx(angle**5 / 120, rel=0.15)


def test_spin_leaves_out_the_strain():
    """Stretching without turning changes nothing."""
    assert spin(PlaneStrain(), (0.3, 0.1, 0.1, -0.2), (1.0, 2.0, 3.0, 4.0)) == (1.0, 2.0, 3.0, 4.0)
    stretch = (0.3, 0.1, 0.2, 0.1, -0.1, 0.4, 0.2, 0.4, 0.5)
    s = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert spin(Space(), stretch, s) == s
    assert spin(Line(), (0.3,), (1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)


@given(dl=tensors(PlaneStrain(), 0.5), s=symmetric_tensors(PlaneStrain()))
def test_plane_and_space_turn_alike(dl, s):
    plane, space = PlaneStrain(), Space()
    in_space = spin(space, flat(space, matrix(plane, dl)), (*s, 0.0, 0.0))
    assert close(in_space, (*spin(plane, dl, s), 0.0, 0.0))


# --- compiled ---------------------------------------------------------------------------------


@njit
def everything(kin, f, dl, s, a):
    turned = spin(kin, dl, s)
    return (
        determinant(kin, deform(kin, dl, f)),
        volume_ratio(kin, dl),
        contract(kin, turned, left_cauchy_green(kin, f)),
        contract(kin, s, right_cauchy_green(kin, f)),
        trace(symmetric_part(kin, dl)),
        largest_row_sum(kin, s),
        largest_component(
            kin, add_symmetric_dot(kin, a, s, tensor_dot(kin, add_outer(kin, f, a, a), a))
        ),
        contract(kin, add_pressure(kin, 0.5, s, 0.25), zero_symmetric(kin, 1.0)),
    )


@every_kinematics
@settings(max_examples=20)
@given(data=st.data())
def test_compiled_is_the_same(kin, data):
    f, dl = data.draw(deformations(kin)), data.draw(tensors(kin))
    s, a = data.draw(symmetric_tensors(kin)), data.draw(numbers(kin.dimension))
    assert close(everything(kin, f, dl, s, a), everything.py_func(kin, f, dl, s, a))
