"""Convected domains: weights and gradients, how domains move, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from karamelo_py.lattice import Lattice
from karamelo_py.points.basis import (
    affine_weight,
    entry,
    extent,
    locate,
    reach,
    support,
)
from karamelo_py.points.basis.cpdi import domain
from karamelo_py.points.basis.cpdi.hexahedron import H8
from karamelo_py.points.basis.cpdi.hexahedron import SIGNS as CUBE
from karamelo_py.points.basis.cpdi.parallel import R4, R8
from karamelo_py.points.basis.cpdi.quadrilateral import Q4
from karamelo_py.points.basis.cpdi.quadrilateral import SIGNS as SQUARE
from karamelo_py.points.basis.cpdi.simplex import T3, Tet4
from karamelo_py.points.kinematics import Axisymmetric, PlaneStrain, Space

LO, HI, H = (0.3, 0.5, 2.0), (1.35, 1.1, 2.6), 0.15
FLAT = [(R4, PlaneStrain()), (Q4, PlaneStrain()), (T3, PlaneStrain())]
ALL = [*FLAT, *((b, Axisymmetric()) for b, _ in FLAT), *((b, Space()) for b in (R8, H8, Tet4))]
every_domain = pytest.mark.parametrize(
    "basis, kin", ALL, ids=lambda item: getattr(item, "__name__", type(item).__name__)
)
UNIT = {
    Q4: SQUARE, H8: CUBE, T3: np.array([(-1, -1), (1, -1), (0, 1)]),
    Tet4: np.array([(-1, -1, -1), (1, -1, -1), (0, 1, -1), (0, 0, 1)]),
}  # fmt: skip


def lattice(kin):
    d = kin.dimension
    return Lattice(d, LO[:d], HI[:d], H)


def a_place(basis, kin, seed, size=0.4, skew=0.4):
    """A random domain around a random point, `size` cells wide, sheared and not parallel."""
    rng = np.random.default_rng(seed)
    d = kin.dimension
    x = rng.uniform(np.add(LO, 1.2 * size * H)[:d], np.subtract(HI, 1.2 * size * H)[:d])
    stretch = (np.eye(d) + skew * rng.uniform(-0.7, 0.7, (d, d))) * size * H / 2
    if basis in (R4, R8):
        return (*x, *stretch.T.ravel())
    unit = UNIT[basis] + skew * rng.uniform(-0.4, 0.4, UNIT[basis].shape)
    return (*x, *(x + unit @ stretch.T).ravel())


def stencil_of(basis, kin, grid, place):
    """Stencil, node numbers, weights and gradients."""
    stencil = locate(basis(), kin, grid, place)
    entries = [entry(basis(), kin, grid, stencil, k) for k in range(support(basis(), kin))]
    nodes, weights, gradients = zip(*entries, strict=True)
    return stencil, np.array(nodes), np.array(weights), np.array(gradients)


def gauss_means(corners, signs):
    """Means of the multilinear functions of the corners and of their gradients, by quadrature.

    Six Gauss points a direction, more than the products need; written with loops over corners.
    """
    d = corners.shape[1]
    at, weight = np.polynomial.legendre.leggauss(6)
    points = np.stack(np.meshgrid(*[at] * d, indexing="ij"), axis=-1).reshape(-1, d)
    total = np.prod(np.stack(np.meshgrid(*[weight] * d, indexing="ij")), axis=0).ravel()
    volume, means, slopes = 0.0, np.zeros(len(signs)), np.zeros_like(corners)
    for xi, w in zip(points, total, strict=True):
        factors = (1 + signs * xi) / 2
        n = factors.prod(axis=1)
        dn = np.stack([
            signs[:, k] / 2 * np.delete(factors, k, axis=1).prod(axis=1) for k in range(d)
        ], axis=1)  # fmt: skip
        jacobian = dn.T @ corners  # rows: d x / d xi_k
        dv = w * np.linalg.det(jacobian)
        volume += dv
        means += dv * n
        slopes += dv * (dn @ np.linalg.inv(jacobian).T)
    return volume, means / volume, slopes / volume


@pytest.mark.parametrize("basis, kin", [(Q4, PlaneStrain()), (H8, Space())])
@given(seed=st.integers(0, 10**6))
def test_weights_are_means_over_the_domain(basis, kin, seed):
    """The exact integrals of Sadeghirad et al. 2013, against quadrature."""
    place = a_place(basis, kin, seed)
    corners = np.array(place[kin.dimension :]).reshape(-1, kin.dimension)
    _, means, slopes = gauss_means(corners, UNIT[basis])
    _, weights, gradients = domain(basis(), kin, place)
    assert np.array(weights) == pytest.approx(means, abs=1e-12)
    assert np.array(gradients) == pytest.approx(slopes, abs=1e-10 / H)


@every_domain
@given(seed=st.integers(0, 10**6), size=st.sampled_from([0.3, 1.0, 2.5]))
def test_linear_functions(basis, kin, seed, size):
    """sum N = 1, sum grad N = 0, sum X grad N = 1; sum N X is the centre that arms begin at."""
    d = kin.dimension
    grid = lattice(kin).numbers(float)
    place = a_place(basis, kin, seed, size)
    stencil, nodes, weights, gradients = stencil_of(basis, kin, grid, place)
    positions = lattice(kin).positions()[nodes.astype(int)][:, :d]
    assert weights.sum() == pytest.approx(1, abs=1e-14)
    centre = weights @ positions
    if basis in (R4, R8):
        assert centre == pytest.approx(place[:d], abs=1e-13)
    bound = 1e-13 * np.abs(gradients).sum()
    assert gradients[:, :d].sum(axis=0) == pytest.approx(np.zeros(d), abs=bound)
    assert gradients[:, :d].T @ positions == pytest.approx(np.eye(d), abs=3 * bound)
    if isinstance(kin, Axisymmetric):
        assert gradients[:, 2] == pytest.approx(weights / centre[0], rel=1e-12)
    count = len(nodes)
    arms = np.array([reach(basis(), kin, grid, stencil, k) for k in range(count)])
    assert arms == pytest.approx(positions - centre, abs=1e-13)
    affine = np.array([affine_weight(basis(), kin, grid, stencil, k) for k in range(count)])
    assert affine.sum(axis=0) == pytest.approx(np.zeros(d), abs=1e-11)
    assert affine.T @ arms == pytest.approx(np.eye(d), abs=1e-11)


@every_domain
@given(seed=st.integers(0, 10**6), push=st.integers(0, 5))
def test_corners_beyond_the_grid(basis, kin, seed, push):
    """They count as lying on its face: weights are those of a partition of unity still."""
    d = kin.dimension
    grid = lattice(kin).numbers(float)
    place = np.array(a_place(basis, kin, seed, 0.8))
    axis = push % d
    to = (LO if push < d else HI)[axis]
    shift = to - place[axis]
    place[axis::d][: None if basis not in (R4, R8) else 1] += shift
    _, nodes, weights, gradients = stencil_of(basis, kin, grid, tuple(place))
    assert (nodes >= 0).all()
    assert (nodes < lattice(kin).node_count).all()
    assert weights.sum() == pytest.approx(1, abs=1e-14)
    bound = 1e-13 * np.abs(gradients).sum()
    assert gradients[:, :d].sum(axis=0) == pytest.approx(np.zeros(d), abs=bound)


@pytest.mark.parametrize("edges, corners, kin", [(R4, Q4, PlaneStrain()), (R8, H8, Space())])
@given(seed=st.integers(0, 10**6))
def test_parallel_domains_are_one_thing(edges, corners, kin, seed):
    """Q4 on a parallelogram is R4, H8 on a parallelepiped is R8."""
    d = kin.dimension
    grid = lattice(kin).numbers(float)
    place = a_place(edges, kin, seed)
    x, r = np.array(place[:d]), np.array(place[d:]).reshape(d, d)
    other = (*x, *(x + UNIT[corners] @ r).ravel())
    a, b = stencil_of(edges, kin, grid, place), stencil_of(corners, kin, grid, other)
    assert (a[1] == b[1]).all()
    assert a[2] == pytest.approx(b[2], abs=1e-13)
    assert a[3] == pytest.approx(b[3], abs=1e-11)
    reaches = [extent(edges(), kin, grid, place), extent(corners(), kin, grid, other)]
    assert reaches[0] == pytest.approx(np.abs(UNIT[corners] @ r).max() / H)
    assert reaches[0] == pytest.approx(reaches[1])
