"""Basis functions: partition of unity, linear functions reproduced, up to every wall."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit
from tensors import KINEMATICS

from karamelo_py.domain import Domain
from karamelo_py.methods.ulmpm import ULMPM
from karamelo_py.points.basis import affine_weight, entry, inside, locate, reach, support
from karamelo_py.points.basis.linear import Linear

LO, HI, H = (-1.0, 0.5, 2.0), (0.05, 1.1, 2.6), 0.15  # 7, 4 and 4 cells; none of them rounds well
BASES = [Linear]
every_basis = pytest.mark.parametrize("basis", BASES, ids=lambda basis: basis.__name__)
every_kinematics = pytest.mark.parametrize("kin", KINEMATICS, ids=lambda kin: type(kin).__name__)


def made(basis, kin):
    """The domain, and the basis on its grid."""
    d = kin.dimension
    domain = Domain(d, LO[:d], HI[:d], H)
    return domain, ULMPM(None, basis).make_basis(domain, float)


def stencil_of(basis, kin, x):
    """Node numbers, weights and gradients of a point."""
    stencil = locate(basis, kin, x)
    entries = [entry(basis, kin, stencil, k) for k in range(support(basis, kin))]
    nodes, weights, gradients = zip(*entries, strict=True)
    return stencil, np.array(nodes), np.array(weights), np.array(gradients)


# Fractions of the domain, with both walls and the places of nodes among them.
fractions = st.one_of(st.sampled_from([0.0, 1.0, 0.5]), st.floats(0, 1), st.integers(0, 7).map(
    lambda i: min(i * H / (HI[0] - LO[0]), 1.0)))  # fmt: skip


def place(kin, fraction):
    d = kin.dimension
    x = [lo + f * (hi - lo) for lo, hi, f in zip(LO, HI, fraction, strict=False)]
    return tuple(min(a, hi) for a, hi in zip(x, HI, strict=False))[:d]


@every_basis
@every_kinematics
@given(fraction=st.tuples(fractions, fractions, fractions))
def test_reproduces_linear_functions(basis, kin, fraction):
    """sum N = 1, sum N X = x, sum grad N = 0, sum X grad N = I: exact but for round-off.

    Node numbers are real nodes, weights are not negative. 1e-12: gradients of 7 / h add to 0.
    """
    domain, b = made(basis, kin)
    d = kin.dimension
    x = place(kin, fraction)
    assert inside(b, kin, x)
    stencil, nodes, weights, gradients = stencil_of(b, kin, x)
    assert (nodes >= 0).all()
    assert (nodes < domain.node_count).all()
    assert len(set(nodes.tolist())) == len(nodes)
    assert (weights >= -1e-14).all()
    positions = domain.node_positions()[nodes][:, :d]
    assert weights.sum() == pytest.approx(1, abs=1e-14)
    assert weights @ positions == pytest.approx(x, abs=1e-12)
    assert gradients.sum(axis=0) == pytest.approx(np.zeros(d), abs=1e-12)
    assert gradients.T @ positions == pytest.approx(np.eye(d), abs=1e-12)
    arms = np.array([reach(b, kin, stencil, k) for k in range(len(nodes))])
    assert arms == pytest.approx(positions - np.array(x), abs=1e-12)


@every_basis
@every_kinematics
@given(fraction=st.tuples(*[st.floats(0.001, 0.999)] * 3))
def test_gradients_are_derivatives_of_the_weights(basis, kin, fraction):
    """Central differences, exact for a product of linear functions while in one cell."""
    _, b = made(basis, kin)
    x = place(kin, fraction)
    cells = (np.array(x) - LO[: kin.dimension]) / H
    if np.abs(cells - np.round(cells)).min() < 1e-4:
        return  # a cell's face, where the gradient of the hat functions jumps
    _, nodes, _, gradients = stencil_of(b, kin, x)
    e = 1e-6
    for k in range(kin.dimension):
        step = np.eye(kin.dimension)[k] * e
        ahead, back = (stencil_of(b, kin, tuple(np.array(x) + s * step)) for s in (1, -1))
        assert (ahead[1] == nodes).all()
        slope = (ahead[2] - back[2]) / (2 * e)
        assert slope == pytest.approx(gradients[:, k], abs=1e-8)  # 1e-16 / 1e-6 of rounding


@every_basis
@every_kinematics
@given(fraction=st.tuples(fractions, fractions, fractions))
def test_affine_weights_carry_linear_velocities(basis, kin, fraction):
    """sum_I (N_I D^-1 (X_I - x)) (X_I - x)^T = I, and the weights add to no linear momentum.

    So a point that holds B = C D gives the nodes the velocity field v + C (X - x)
    (Jiang, Schroeder & Teran 2017, eqs. 15 to 18).
    """
    _, b = made(basis, kin)
    x = place(kin, fraction)
    stencil = locate(b, kin, x)
    count = support(b, kin)
    affine = np.array([affine_weight(b, kin, stencil, k) for k in range(count)])
    arms = np.array([reach(b, kin, stencil, k) for k in range(count)])
    assert affine.sum(axis=0) == pytest.approx(np.zeros(kin.dimension), abs=1e-12)
    assert affine.T @ arms == pytest.approx(np.eye(kin.dimension), abs=1e-12)


@every_basis
@every_kinematics
def test_walls(basis, kin):
    """Both faces of the domain are inside; beyond them, and NaN, is outside."""
    _, b = made(basis, kin)
    d = kin.dimension
    centre = tuple((lo + hi) / 2 for lo, hi in zip(LO, HI, strict=True))[:d]
    assert inside(b, kin, centre)
    for axis in range(d):
        within = [LO[axis], HI[axis]]
        beyond = [LO[axis] - 1e-3 * H, HI[axis] + 1e-3 * H, np.nan, np.inf]
        for at in within + beyond:
            x = tuple(at if k == axis else centre[k] for k in range(d))
            assert bool(inside(b, kin, x)) == (at in within)


@njit
def sums(b, kin, x):
    stencil = locate(b, kin, x)
    weight = 0.0
    slope = 0.0
    arm = 0.0
    nodes = 0.0
    for k in range(support(b, kin)):
        i, w, g = entry(b, kin, stencil, k)
        weight += w
        slope += g[0] * reach(b, kin, stencil, k)[0]
        arm += affine_weight(b, kin, stencil, k)[0] * reach(b, kin, stencil, k)[0]
        nodes += w * i
    return weight, slope, arm, nodes


@every_basis
@every_kinematics
def test_compiled_is_the_same(basis, kin):
    _, b = made(basis, kin)
    for fraction in [(0, 0, 0), (1, 1, 1), (0.3, 0.6, 0.9)]:
        x = tuple(float(a) for a in place(kin, fraction))
        assert sums(b, kin, x) == pytest.approx(sums.py_func(b, kin, x), rel=1e-12)
