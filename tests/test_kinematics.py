"""Tensor algebra of one point against NumPy, and the rotation of stress against its properties.

Tolerances of 1e-12 are round-off of a dozen operations on numbers of order one.
"""

import builtins
import inspect
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import typeof
from tensors import (
    ALL_KINEMATICS,
    deformations,
    flat,
    gradients,
    matrix,
    numbers,
    rotation,
    symmetric_flat,
    symmetric_matrix,
    symmetric_tensors,
    tensors,
    vectors,
    with_spheres,
)

from karamelo_py.compiler import kernel, shared
from karamelo_py.points.frames import Total, Updated, of_places_before
from karamelo_py.points.kinematics import (
    Axisymmetric,
    Cylindrical,
    I,
    Line,
    PlaneStrain,
    Space,
    Spherical,
    det,
    dev,
    from_columns,
    inner,
    inv,
    nothing,
    outer,
    planar,
    stretch,
    sym,
    total,
    tr,
    unit,
    zero,
    zero_vector,
)

ROUND_OFF = 1e-12


def close(a, b, tolerance=ROUND_OFF):
    return np.allclose(a, b, rtol=tolerance, atol=tolerance)


def test_terms_are_added_one_after_another(monkeypatch):
    """As in kernels, with any Python: from 3.12 on `sum` keeps what floats lose, as fsum does."""
    monkeypatch.setattr(builtins, "sum", lambda terms, start=0: math.fsum([start, *terms]))
    assert total([1.0, 1e-16, 1e-16, 0.1]) == 1.0 + 1e-16 + 1e-16 + 0.1 != 1.1 + 2e-16


@with_spheres
@given(data=st.data())
def test_products_are_those_of_matrices(kin, data):
    d = kin.dimension
    t, a = data.draw(tensors(kin)), data.draw(vectors(kin))
    s, e = data.draw(symmetric_tensors(kin)), data.draw(symmetric_tensors(kin))
    full = symmetric_matrix(kin, s)
    plane = planar(kin).Tensor._make(t[: d * d])
    assert close(plane @ a, matrix(kin, t)[:d, :d] @ np.array(a))
    assert close(t.diagonal(), np.diag(matrix(kin, t))[:d])
    assert from_columns(plane.columns()) == plane
    assert close(inner(s, e), np.sum(full * symmetric_matrix(kin, e)))
    assert close(tr(s), np.trace(full))
    assert close(tr(dev(s)), 0)
    pressed = 0.7 * s + 0.3 * I
    assert close(symmetric_matrix(kin, pressed), 0.7 * full + 0.3 * np.eye(3))
    assert a.largest() == np.abs(np.array(a)).max()


@pytest.mark.parametrize("kin", ALL_KINEMATICS[:3], ids=lambda kin: type(kin).__name__)
@given(data=st.data())
def test_gradients_meet_tensors_as_in_space(kin, data):
    d = kin.dimension
    v, g = data.draw(vectors(kin)), data.draw(gradients(kin))
    t, s = data.draw(tensors(kin)), data.draw(symmetric_tensors(kin))
    assert close(t + outer(v, g), matrix(kin, t)[:d, :d].ravel() + np.outer(v, g).ravel())
    assert close(v + s.dot(g), np.array(v) + symmetric_matrix(kin, s)[:d, :d] @ np.array(g))
    assert close(v + t.dot(g), np.array(v) + matrix(kin, t)[:d, :d] @ np.array(g))


@pytest.mark.parametrize("kin", [Axisymmetric(), Cylindrical(), Spherical()])
@given(data=st.data())
def test_gradients_around_an_axis_or_a_centre(kin, data):
    """grad v has v_r/r around the axis or centre, and so power balances: f . v = s : grad v.

    The strain around the axis is u_r/r (Timoshenko & Goodier, Theory of Elasticity); the force of
    a node is what does the same power.
    """
    d = kin.dimension
    v, g = data.draw(vectors(kin)), data.draw(gradients(kin))
    t, s = data.draw(tensors(kin)), data.draw(symmetric_tensors(kin))
    grad = outer(v, g)
    expected = np.zeros((3, 3))
    expected[:d, :d] = np.outer(v, g[:d])
    for k in range(d, len(g)):
        expected[k, k] = v[0] * g[k]
    assert close(matrix(kin, grad), expected)
    power = np.dot(v, s.dot(g))
    assert close(power, np.sum(symmetric_matrix(kin, s) * expected))
    power = np.dot(v, t.dot(g))
    assert close(power, np.sum(matrix(kin, t) * expected))


@with_spheres
@given(data=st.data())
def test_strains_are_those_of_matrices(kin, data):
    f, dl = data.draw(tensors(kin)), data.draw(tensors(kin))
    full = matrix(kin, f, 1.0)
    increment = np.eye(3) + matrix(kin, dl)
    assert close(matrix(kin, f.after(dl), 1.0), increment @ full)
    assert close(det(f), np.linalg.det(full))
    assert close(det(I + dl), np.linalg.det(increment))
    assert close(symmetric_matrix(kin, f.left_cauchy_green()), full @ full.T)
    assert close(symmetric_matrix(kin, f.right_cauchy_green()), full.T @ full)
    gradient = matrix(kin, dl)
    assert close(symmetric_matrix(kin, sym(dl)), (gradient + gradient.T) / 2)


@with_spheres
@given(data=st.data())
def test_increments_multiply_the_volume(kin, data):
    """det((I + dl) F) = det(I + dl) det F."""
    f, dl = data.draw(deformations(kin)), data.draw(tensors(kin))
    assert close(det(f.after(dl)), det(I + dl) * det(f))


@with_spheres
@given(data=st.data())
def test_total_lagrangian_algebra_is_that_of_matrices(kin, data):
    """F^-1, P = tau F^-T; and an increment (dt Fdot) F^-1 takes F to F + dt Fdot."""
    a, b, f = data.draw(tensors(kin)), data.draw(tensors(kin)), data.draw(deformations(kin))
    tau = data.draw(symmetric_tensors(kin))
    full = matrix(kin, f, 1.0)
    assert close(matrix(kin, a @ b), matrix(kin, a) @ matrix(kin, b))
    assert close(matrix(kin, inv(f), 1.0), np.linalg.inv(full))
    p = symmetric_matrix(kin, tau) @ np.linalg.inv(full).T
    assert close(tau.nominal(f), flat(kin, p))
    dl = b @ inv(f)
    assert close(matrix(kin, dl), matrix(kin, b) @ np.linalg.inv(full))
    assert close(f.after(dl), f + b)


@with_spheres
@given(data=st.data())
def test_an_increment_of_the_places_after_a_motion(kin, data):
    """dl = I - F^-1 at the places that a motion F has led to makes I + dl' = F.

    Half of such an increment behind half of one of the places before is the whole: usavg.
    """
    motion = data.draw(deformations(kin))
    one = np.eye(3)
    full = matrix(kin, motion, 1.0)
    after = one - np.linalg.inv(full)
    before = of_places_before(Updated(), kin, flat(kin, after))
    assert close(one + matrix(kin, before), full)
    half = of_places_before(Updated(), kin, flat(kin, after / 2))
    ahead = one + matrix(kin, before) / 2
    assert close((one + matrix(kin, half)) @ ahead, full, 1e-10)
    assert of_places_before(Total(), kin, before) == before


@with_spheres
def test_small_increments_keep_their_digits(kin):
    """dl (I + dl + ...), in single precision too: I added and taken away leaves none of 1e-9."""
    dl = kin.Tensor._make([np.float32(1e-9 * (k + 1)) for k in range(kin.tensor_size)])
    assert of_places_before(Updated(), kin, dl) == pytest.approx(dl, rel=1e-6)


# --- right stretch ----------------------------------------------------------------------------


def exact_stretch(kin, f):
    """sqrt(F^T F) by the singular values of F, in double precision."""
    _, values, vt = np.linalg.svd(matrix(kin, [float(a) for a in f], 1.0))
    return vt.T @ np.diag(values) @ vt


@with_spheres
@given(data=st.data())
def test_stretch_is_the_root_of_cauchy_green(kin, data):
    f = data.draw(deformations(kin))
    u = symmetric_matrix(kin, stretch(f))
    assert close(u, exact_stretch(kin, f))
    assert close(u @ u, symmetric_matrix(kin, f.right_cauchy_green()))


def special(kin):
    """Deformations at which closed forms may fail, as matrices (3, 3)."""
    yield "identity", np.eye(3)
    yield "equal stretches", 2.5 * np.eye(3)
    yield "nearly equal stretches", np.diag([1.0, 1.0 + 1e-9, 1.0 - 1e-9])
    yield "large stretch", np.diag([100.0, 0.01, 1.0])
    if kin.dimension > 1:
        turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        shear = np.array([[1.0, 3.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        yield "right angle", turn
        yield "right angle and stretch", turn @ np.diag([1.5, 1.5, 0.7])
        yield "half a turn", np.diag([-1.0, -1.0, 1.0])
        yield "pure shear", np.diag([2.0, 0.5, 1.0])
        yield "simple shear", shear
        yield "turned simple shear", turn @ shear
        yield "mirror", np.diag([-2.0, 1.0, 1.0])
    if kin.dimension == 3:
        about = rotation(np.array([1.0, -2.0, 0.5]))
        yield "two equal stretches", about @ np.diag([3.0, 3.0, 0.2]) @ about.T
        yield "flat", about @ np.diag([10.0, 1.0, 1e-3])


@with_spheres
@pytest.mark.parametrize("number, tolerance", [(np.float64, 1e-13), (np.float32, 1e-6)])
def test_stretch_of_special_deformations(kin, number, tolerance):
    """In either precision; errors are relative to the largest stretch. Single stays single."""
    for name, full in special(kin):
        f = kin.Tensor._make([number(a) for a in flat(kin, full)])
        u = stretch(f)
        assert all(type(a) in (number, int) for a in u), name
        exact = exact_stretch(kin, f)
        error = np.abs(symmetric_matrix(kin, u) - exact).max()
        assert error <= tolerance * np.abs(exact).max(), name


@given(angles=numbers(6, -3, 3), logs=numbers(3, -2.5, 2.5))
def test_stretch_of_any_rotation_and_stretch(angles, logs):
    """R U of random rotations and principal stretches up to e^2.5 = 12 and down to its inverse."""
    kin = Space()
    axes, turn = (rotation(np.add(a, 1e-6)) for a in (angles[:3], angles[3:]))
    u = axes @ np.diag(np.exp(logs)) @ axes.T
    found = symmetric_matrix(kin, stretch(flat(kin, turn @ u)))
    assert close(found, u, 1e-12 * np.exp(max(logs)) + 1e-12)


@with_spheres
def test_units_and_zeros(kin):
    assert close(matrix(kin, unit(kin), 1.0), np.eye(3))
    assert zero(kin, 1.0) == (0.0,) * kin.tensor_size
    assert nothing(kin) == (0.0,) * len(kin.symmetric_names)
    plane = planar(kin)
    assert (plane.dimension, plane.tensor_size) == (kin.dimension, kin.dimension**2)
    assert zero_vector(kin, 1.0) == (0.0,) * kin.dimension


@with_spheres
@given(data=st.data())
def test_row_sums_bound_the_eigenvalues(kin, data):
    """Gershgorin 1931; the wave speed of hyperelastic laws relies on it."""
    s = data.draw(symmetric_tensors(kin))
    largest = np.abs(np.linalg.eigvalsh(symmetric_matrix(kin, s))).max()
    assert s.largest_row_sum() >= largest - ROUND_OFF


# --- the turn of a stress ---------------------------------------------------------------------


def invariants(full):
    return np.array([np.trace(full), np.sum(full * full), np.linalg.det(full)])


@with_spheres
@given(data=st.data())
def test_spin_keeps_the_invariants(kin, data):
    """Whatever the increment, the turn is a rotation to round-off, however large."""
    s, dl = data.draw(symmetric_tensors(kin)), data.draw(tensors(kin, 2.0))
    before = symmetric_matrix(kin, s)
    after = symmetric_matrix(kin, s.turned(dl))
    assert close(invariants(after), invariants(before))


def axial(w):
    """The velocity gradient of the rotation vector w, (3, 3)."""
    x, y, z = w
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


@given(angle=st.floats(-0.02, 0.02), s=symmetric_tensors(PlaneStrain()))
def test_spin_turns_by_the_angle_in_the_plane(angle, s):
    """The error of the angle is |w|^5/120: 3e-11 at |w| = 0.02, a large turn for a step."""
    kin = PlaneStrain()
    turn = rotation([0, 0, angle])
    exact = turn @ symmetric_matrix(kin, s) @ turn.T
    turned = s.turned(flat(kin, axial((0, 0, angle))))
    assert close(turned, symmetric_flat(kin, exact), 1e-9)


@given(w=numbers(3, -0.01, 0.01).filter(lambda w: np.linalg.norm(w) > 1e-9),
       s=symmetric_tensors(Space()))  # fmt: skip
def test_spin_turns_by_the_angle_in_space(w, s):
    kin = Space()
    turn = rotation(np.array(w))
    exact = turn @ symmetric_matrix(kin, s) @ turn.T
    turned = s.turned(flat(kin, axial(w)))
    assert close(turned, symmetric_flat(kin, exact), 1e-9)


@pytest.mark.parametrize("angle", [0.4, 0.2, 0.1])
def test_error_of_the_angle_falls_with_its_fifth_power(angle):
    """tan(w/2) ~ (w/2)(1 + w^2/12) leaves w^5/120: against 1/80 of Hughes & Winget's w^3/12."""
    kin = PlaneStrain()
    turned = kin.Symmetric(1.0, 0.0, 0.0, 0.0).turned(flat(kin, axial((0, 0, angle))))
    reached = np.arctan2(np.sqrt(turned[1]), np.sqrt(turned[0]))
    # The next term of the series is 17 w^7 / 20160 of the tangent's half: a tenth at 0.4.
    assert abs(reached - angle) == pytest.approx(angle**5 / 120, rel=0.15)


def test_spin_leaves_out_the_strain():
    """Stretching without turning changes nothing."""
    s = PlaneStrain.Symmetric(1.0, 2.0, 3.0, 4.0)
    assert s.turned(PlaneStrain.Tensor(0.3, 0.1, 0.1, -0.2)) == s
    s = Space.Symmetric(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert s.turned(Space.Tensor(0.3, 0.1, 0.2, 0.1, -0.1, 0.4, 0.2, 0.4, 0.5)) == s
    s = Line.Symmetric(1.0, 2.0, 3.0)
    assert s.turned(Line.Tensor(0.3)) == s


@pytest.mark.parametrize("plane", [PlaneStrain(), Axisymmetric()])
@given(data=st.data())
def test_plane_and_space_turn_alike(plane, data):
    space = Space()
    dl, s = data.draw(tensors(plane, 0.5)), data.draw(symmetric_tensors(plane))
    in_space = Space.Symmetric(*s, 0.0, 0.0).turned(flat(space, matrix(plane, dl)))
    assert close(in_space, (*s.turned(dl), 0.0, 0.0))


# --- compiled ---------------------------------------------------------------------------------


@shared
def of_all(kin, f, dl, s, a, g):
    moved = (f.planar() @ dl.planar()).after((dl @ inv(f)).planar())
    rate = f + outer(a, g)
    return (
        det(f.after(dl)),
        det(I + dl),
        inner(s.turned(dl), f.left_cauchy_green()),
        inner(s, f.right_cauchy_green()),
        tr(sym(dl)),
        s.largest_row_sum(),
        (rate.planar() @ a + s.dot(g)).largest(),
        inner(0.5 * s + 0.25 * I, nothing(kin)),
        inner(stretch(f), s),
        (moved.diagonal() + s.nominal(f).dot(g)).largest(),
        planar(kin).dimension,
    )


@kernel
def everything(kin, f, dl, s, a, g):
    return of_all(kin, f, dl, s, a, g)


@with_spheres
@settings(max_examples=20)
@given(data=st.data())
def test_compiled_is_the_same(kin, data):
    f, dl = data.draw(deformations(kin)), data.draw(tensors(kin))
    s, a = data.draw(symmetric_tensors(kin)), data.draw(vectors(kin))
    g = data.draw(gradients(kin))
    assert close(everything(kin, f, dl, s, a, g), inspect.unwrap(everything)(kin, f, dl, s, a, g))


@shared
def made(kin, f, dl, s, a, g):
    return (
        stretch(f) + dev(s),
        s.nominal(f),
        f @ inv(f),
        dl.after(dl @ inv(f)),
        s.turned(dl),
        zero(kin, a[0]) + outer(a, g),
        a + dl.dot(g) + s.dot(g),
        f.left_cauchy_green(),
        dl.right_cauchy_green() - a[0] * I,
        sym(dl),
        (det(f), det(I + dl), s.largest_row_sum()),
        (inner(s, a[0] * s + a[0] * I), tr(s)),
    )


@kernel
def all_tensors(kin, f, dl, s, a, g):
    return made(kin, f, dl, s, a, g)


@with_spheres
def test_single_precision_stays_single(kin):
    """One double literal would make every number of a kernel double."""

    def single(one, numbers):
        return one._make([np.float32(a) for a in numbers][: len(one._fields)])

    f, dl = single(kin.Tensor, flat(kin, np.eye(3) + 0.1)), single(kin.Tensor, (0.01,) * 9)
    s, a = single(kin.Symmetric, range(6)), single(kin.Vector, range(3))
    arguments = kin, f, dl, s, a, single(kin.Gradient, (0.1, 0.2, 0.3))
    results = all_tensors(*arguments)
    (unit,) = [u for k, u in all_tensors.units.items() if k[0] == typeof(kin)]
    assert "float64" not in str(unit.result)
    for found, exact in zip(results, inspect.unwrap(all_tensors)(*arguments), strict=True):
        assert all(type(a) in (np.float32, int) for a in exact)
        assert np.allclose(found, exact, rtol=1e-5, atol=1e-6)
