"""Basis functions: partition of unity, linear functions reproduced, up to every wall."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tensors import ALL_KINEMATICS, every_kinematics, flat

from karamelo_py.compiler import kernel, shared
from karamelo_py.points.basis import (
    affine_weight,
    blank,
    carried,
    carrier,
    carry,
    deformed,
    entry,
    locate,
    reach,
    support,
)
from karamelo_py.points.basis.bernstein_quadratic import BernsteinQuadratic
from karamelo_py.points.basis.gimp import (
    UGIMP,
    CPGIMPCorners,
    CPGIMPDet,
    CPGIMPDiagonal,
    CPGIMPStretch,
)
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.basis.product import along
from karamelo_py.points.basis.splines import CubicSpline, QuadraticSpline
from karamelo_py.points.basis.surface import ENTRIES, profile, surface_table
from karamelo_py.points.grid import inside
from karamelo_py.points.kinematics import Axisymmetric, Line
from karamelo_py.scene.lattice import Lattice

H = 0.15
LO = (0.0, 0.5, -2.0)  # a radius starts at 0
# Sides in cells; some leave the last cell cut. The first has room for every function in its bulk.
SIZES = [(7, 4.3, 4), (1, 2, 3), (3, 1, 2), (2, 3, 1), (1.4, 2.5, 3.2), (0.6, 0.6, 0.6)]
# The weights of the other variants of cpgimp are the same function.
BASES = [Linear, QuadraticSpline, CubicSpline, BernsteinQuadratic, UGIMP, CPGIMPDet]
SMOOTH = [QuadraticSpline, CubicSpline, UGIMP, CPGIMPDet]
every_basis = pytest.mark.parametrize("basis", BASES, ids=lambda basis: basis.__name__)
sizes = st.sampled_from(SIZES)
enough = settings(max_examples=15)  # each of 24 pairs of a basis and kinematics has as many
# Half sizes of domains, in cells: of ppc = 1 and less.
halves = st.tuples(*[st.one_of(st.just(0.5), st.floats(0.01, 0.5))] * 3)
# Fractions of a side, with both walls among them; places of nodes and of middles come on top.
fractions = st.tuples(
    *[st.one_of(st.sampled_from([0.0, 1.0, 0.5, 1e-12, 1 - 1e-12]), st.floats(0, 1))] * 3
)
nodes_of_halves = st.tuples(*[st.one_of(st.none(), st.integers(0, 14))] * 3)


def made(basis, kin, size, real=float):
    """The grid under the basis: the lattice, and what kernels read."""
    d = kin.dimension
    hi = [lo + n * H for lo, n in zip(LO, size, strict=True)]
    lattice = Lattice(d, LO[:d], hi[:d], H, basis.traits.nodes_per_cell, basis.traits.least_nodes)
    return lattice, lattice.numbers(real)


def position(kin, size, fraction, halfway=(None, None, None)):
    """A position in the box: a fraction of each side, or a place in half cells."""
    x = []
    for lo, n, f, i in zip(LO, size, fraction, halfway, strict=True):
        x.append(lo + (f * n if i is None else min(i / 2, n)) * H)
    return tuple(x[: kin.dimension])


def place_of(basis, kin, x, half):
    """The place of a point, with the half sizes of its domain where the basis keeps them."""
    d = kin.dimension
    shape = [half[k % d] * H for k in range(len(blank(basis(), kin, x)) - d)]
    if len(shape) > d:
        shape[2 * d :] = np.eye(d).ravel().tolist()
    return x + tuple(shape)


def stencil_of(basis, kin, grid, place):
    """Stencil, and node numbers, weights, gradients, arms and affine weights of a point."""
    b = basis()
    stencil = locate(b, kin, grid, place)
    count = range(support(b, kin))
    entries = [entry(b, kin, grid, stencil, k) for k in count]
    nodes, weights, gradients = (np.array(a) for a in zip(*entries, strict=True))
    arms = np.array([reach(b, kin, grid, stencil, k) for k in count])
    affine = np.array([affine_weight(b, kin, grid, stencil, k) for k in count])
    return nodes, weights, gradients, arms, affine


def centre_of(kin, size, x, half, basis):
    """The centre of what the walls leave of a domain; the point itself where none is kept."""
    if len(place_of(basis, kin, x, half)) == len(x):
        return np.array(x)
    lo = np.array(LO[: len(x)])
    # The wall is the last node of the cells, beyond the end of a box that cuts its last cell.
    hi = lo + np.ceil(np.array(size[: len(x)]) - 1e-9) * H
    half = np.array(half[: len(x)]) * H
    return (np.maximum(np.array(x) - half, lo) + np.minimum(np.array(x) + half, hi)) / 2


@every_basis
@every_kinematics
@enough
@given(size=sizes, fraction=fractions, halfway=nodes_of_halves, half=halves)
def test_reproduces_linear_functions(basis, kin, size, fraction, halfway, half):
    """sum N = 1, sum N X = x, sum grad N = 0, sum X grad N = I: exact but for round-off.

    Node numbers are real nodes, weights are not negative, and nodes beyond the box get none.
    1e-12: gradients of 7 / h add to 0.
    """
    d = kin.dimension
    lattice, grid = made(basis, kin, size)
    x = position(kin, size, fraction, halfway)
    assert inside(grid, kin, x)
    place = place_of(basis, kin, x, half)
    nodes, weights, gradients, arms, affine = stencil_of(basis, kin, grid, place)
    assert (nodes >= 0).all()
    assert (nodes < lattice.node_count).all()
    assert len(set(nodes.tolist())) == len(nodes)
    assert (weights >= -1e-14).all()
    assert weights.sum() == pytest.approx(1, abs=1e-14)
    positions = lattice.positions()[nodes][:, :d]
    centre = centre_of(kin, size, x, half, basis)
    assert weights @ positions == pytest.approx(centre, abs=1e-12)
    slopes = gradients[:, :d]
    assert slopes.sum(axis=0) == pytest.approx(np.zeros(d), abs=1e-12)
    assert slopes.T @ positions == pytest.approx(np.eye(d), abs=1e-12)
    assert arms == pytest.approx(positions - centre, abs=1e-12)
    end = np.array(LO[:d]) + np.array(lattice.cells[:d]) * H
    beyond = (positions > end + 1e-9).any(axis=1)
    for values in (weights, gradients, affine):
        assert not values[beyond].any()


@every_basis
@every_kinematics
@enough
@given(size=sizes, fraction=fractions, halfway=nodes_of_halves, half=halves)
def test_affine_weights_carry_linear_velocities(basis, kin, size, fraction, halfway, half):
    """sum_I (N_I D^-1 (X_I - x)) (X_I - x)^T = I, and the weights add to no linear momentum.

    So a point that holds B = C D gives the nodes the velocity field v + C (X - x)
    (Jiang, Schroeder & Teran 2017, eqs. 15 to 18). So it is even where D vanishes.
    """
    d = kin.dimension
    _, grid = made(basis, kin, size)
    place = place_of(basis, kin, position(kin, size, fraction, halfway), half)
    _, weights, _, arms, affine = stencil_of(basis, kin, grid, place)
    assert weights @ arms == pytest.approx(np.zeros(d), abs=1e-13)
    assert affine.sum(axis=0) == pytest.approx(np.zeros(d), abs=1e-11)
    assert affine.T @ arms == pytest.approx(np.eye(d), abs=1e-11)
    spread = np.einsum("n,ni,nj->ij", weights, arms, arms)
    assert affine @ spread == pytest.approx(weights[:, None] * arms, abs=1e-12)


@every_basis
@every_kinematics
@enough
@given(size=sizes, fraction=st.tuples(*[st.floats(0.001, 0.999)] * 3))
def test_gradients_are_derivatives_of_the_weights(basis, kin, size, fraction):
    """Central differences, whatever nodes the stencils on both sides hold."""
    d = kin.dimension
    lattice, grid = made(basis, kin, size)
    x = position(kin, size, fraction)
    places = 2 * (np.array(x) - LO[:d]) / H
    if np.abs(places - np.round(places)).min() < 5e-3:
        return  # a cell's face or middle, where some derivative jumps
    # Domains cut at a wall change their size as they move: as far as they are whole.
    half = (0.001,) * 3
    all_nodes = np.zeros((lattice.node_count, d))
    nodes, _, gradients, _, _ = stencil_of(basis, kin, grid, place_of(basis, kin, x, half))
    all_nodes[nodes] = gradients[:, :d]
    e = 1e-5
    for k in range(d):
        sides = []
        for s in (1, -1):
            moved = tuple(np.array(x) + s * e * np.eye(d)[k])
            full = np.zeros(lattice.node_count)
            nodes, weights, *_ = stencil_of(basis, kin, grid, place_of(basis, kin, moved, half))
            full[nodes] = weights
            sides.append(full)
        # e^2 times a third derivative of 1 / h^3 over 6
        assert (sides[0] - sides[1]) / (2 * e) == pytest.approx(all_nodes[:, k], abs=1e-7)


@pytest.mark.parametrize("basis", BASES, ids=lambda basis: basis.__name__)
@pytest.mark.parametrize("size", [1, 2, 3, 4, 6, 2.5])
def test_continuous_across_faces(basis, size):
    """Weights on both sides of every half cell agree; those of smooth bases and slopes, too."""
    lattice, grid = made(basis, Line(), (size, 1, 1))
    for i in range(1, int(2 * size)):
        sides = []
        for e in (-1e-10, 1e-10):
            place = place_of(basis, Line(), (LO[0] + (i / 2 + e) * H,), (0.25,) * 3)
            full = np.zeros((lattice.node_count, 2))
            nodes, weights, gradients, *_ = stencil_of(basis, Line(), grid, place)
            full[nodes] = np.stack([weights, gradients[:, 0]], axis=1)
            sides.append(full)
        assert sides[0][:, 0] == pytest.approx(sides[1][:, 0], abs=1e-9)
        if basis in SMOOTH:
            assert sides[0][:, 1] == pytest.approx(sides[1][:, 1], abs=1e-7)


@every_basis
@pytest.mark.parametrize("size", [1, 2, 3, 5, 10, 4.5])
def test_nodes_lie_within_the_span_of_a_cell(basis, size):
    """Points of one cell see nodes that lie at most `cells` cells apart: what tiles count on."""
    _, grid = made(basis, Line(), (size, 1, 1))
    last = int(np.ceil(size)) - 1
    for cell in range(last + 1):
        seen = set()
        for f in (0, 1e-9, 0.25, 0.5, 0.75, 1 - 1e-9, 1 if cell == last else 0.9):
            x = (LO[0] + min(cell + f, size) * H,)
            for half in (0.01, 0.25, 0.5):
                place = place_of(basis, Line(), x, (half,) * 3)
                seen.update(stencil_of(basis, Line(), grid, place)[0].tolist())
        n = basis.traits.nodes_per_cell
        # Beside a wall the span is the same, but lies further inside.
        assert max(seen) - min(seen) <= max(basis.traits.cells, basis.traits.least_nodes - 1) * n
        if 2 <= cell <= last - 2:
            assert min(seen) >= (cell - (basis.traits.cells > 1)) * n
            assert max(seen) <= (cell - (basis.traits.cells > 1) + basis.traits.cells) * n


def types(basis, r, kind):
    """N of Karamelo's boundary types (r = (x - X) / h): reference notes, section 3.11."""
    q = abs(r)
    if basis is CubicSpline:
        if kind == -2 and 0 <= r <= 1:
            return r**3 / 6 - r + 1
        if kind == -1 and -1 <= r <= 0:
            return -(r**3) / 3 - r**2 + 2 / 3
        if kind == 1 and 0 <= r <= 1:
            return r**3 / 3 - r**2 + 2 / 3
        if kind == 2 and -1 <= r <= 0:
            return -(r**3) / 6 + r + 1
        if kind in (-1, 1) and (r < -1) == (kind == -1) and q > 1:
            return 0.0
        return (
            q**3 / 2 - q**2 + 2 / 3 if q < 1 else -(q**3) / 6 + q**2 - 2 * q + 4 / 3 if q < 2 else 0
        )
    if (kind == -2 and 0 <= r <= 0.5) or (kind == 2 and -0.5 <= r <= 0):
        return 1 - q
    if (kind == -1 and -1 <= r <= -0.5) or (kind == 1 and 0.5 <= r <= 1):
        return 1 - q
    return 0.75 - q**2 if q < 0.5 else q**2 / 2 - 1.5 * q + 9 / 8 if q < 1.5 else 0


@pytest.mark.parametrize("basis", [QuadraticSpline, CubicSpline])
@pytest.mark.parametrize("size", [3, 4, 7])
def test_splines_are_those_of_karamelo(basis, size):
    """From four nodes per direction on, where Karamelo's are a partition of unity."""
    _, grid = made(basis, Line(), (size, 1, 1))
    for a in np.linspace(0, size, 97):
        nodes, weights, *_ = stencil_of(basis, Line(), grid, (LO[0] + a * H,))
        for i, weight in zip(nodes, weights, strict=True):
            kind = min(2, i) - min(2, size - i)
            assert weight == pytest.approx(types(basis, a - i, kind), abs=1e-13)


@every_basis
@given(fraction=st.one_of(st.sampled_from([0.0, 1e-300, 1e-25, 1e-9]), st.floats(0, 1)))
def test_hoop_strain_of_a_uniform_expansion(basis, fraction):
    """v_r = a r stretches along the radius and around the axis alike, down to the axis itself."""
    kin, size, half = Axisymmetric(), SIZES[0], (0.25,) * 3
    lattice, grid = made(basis, kin, size)
    place = place_of(basis, kin, position(kin, size, (fraction, 0.3, 0)), half)
    nodes, _, gradients, *_ = stencil_of(basis, kin, grid, place)
    v = 3 * lattice.positions()[nodes][:, 0]
    assert v @ gradients[:, 0] == pytest.approx(3, rel=1e-12)
    assert v @ gradients[:, 2] == pytest.approx(3, rel=1e-12)


@every_kinematics
def test_walls(kin):
    """Both faces of the box are inside; beyond them, and NaN, is outside."""
    size = SIZES[0]
    _, grid = made(Linear, kin, size)
    centre = position(kin, size, (0.5, 0.5, 0.5))
    for axis in range(kin.dimension):
        within = [LO[axis], LO[axis] + size[axis] * H]
        beyond = [within[0] - 1e-3 * H, within[1] + 1e-3 * H, np.nan, np.inf]
        for at in within + beyond:
            x = tuple(at if k == axis else centre[k] for k in range(kin.dimension))
            assert bool(inside(grid, kin, x)) == (at in within)


@every_basis
@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_a_little_beyond_the_wall(basis, size):
    """Within the slack of a wall everything goes on smoothly."""
    _, grid = made(basis, Line(), (size, 1, 1))
    for a in (-1e-9, size + 1e-9):
        place = place_of(basis, Line(), (LO[0] + a * H,), (0.25,) * 3)
        nodes, weights, gradients, _, affine = stencil_of(basis, Line(), grid, place)
        assert (nodes >= 0).all()
        assert weights.sum() == pytest.approx(1, abs=1e-14)
        assert gradients.sum() == pytest.approx(0, abs=1e-12)
        assert np.isfinite(affine).all()


def sums(b, kin, grid, place):
    stencil = locate(b, kin, grid, place)
    weight = 0.0
    slope = 0.0
    arm = 0.0
    nodes = 0.0
    for k in range(support(b, kin)):
        i, w, g = entry(b, kin, grid, stencil, k)
        weight += w * (k + 1)
        slope += g[0] * reach(b, kin, grid, stencil, k)[0]
        arm += affine_weight(b, kin, grid, stencil, k)[0] * reach(b, kin, grid, stencil, k)[0]
        nodes += w * i
    return weight, slope, arm, nodes


def numbers_along(b, kin, grid, place):
    _, r, weights, gradients, affine = along(b, kin, grid, place, 0)[:5]
    return (r,) + weights + gradients + affine


@pytest.mark.full
@every_basis
@every_kinematics
def test_compiled_is_the_same(basis, kin):
    compiled = kernel(sums)
    size = SIZES[0]
    _, grid = made(basis, kin, size)
    for fraction in [(0, 0, 0), (1, 1, 1), (0.3, 0.6, 0.9)]:
        x = tuple(float(a) for a in position(kin, size, fraction))
        place = place_of(basis, kin, x, (0.25, 0.2, 0.1))
        expected = sums(basis(), kin, grid, place)
        assert compiled(basis(), kin, grid, place) == pytest.approx(expected, rel=1e-12)


@pytest.mark.full
@every_basis
def test_single_precision_stays_single(basis):
    """To 6 digits the same, and no number of it is double: a bare literal would make it so."""
    compiled = kernel(numbers_along)
    size, kin = SIZES[0], Line()
    _, double = made(basis, kin, size)
    _, single = made(basis, kin, size, np.float32)
    for fraction in (0.0, 0.31, 1.0):
        place = place_of(basis, kin, position(kin, size, (fraction, 0, 0)), (0.25,) * 3)
        small = tuple(np.float32(a) for a in place)
        found = compiled(basis(), kin, single, small)
        assert found == pytest.approx(numbers_along(basis(), kin, double, place), abs=3e-5)
    if compiled is not numbers_along:
        assert "float64" not in str([unit.result for unit in compiled.units.values()])


# --- domains that deform ----------------------------------------------------------------------


VARIANTS = [CPGIMPDet, CPGIMPDiagonal, CPGIMPStretch, CPGIMPCorners]


def box_of(kin, place):
    return np.array(place[kin.dimension : 2 * kin.dimension])


@pytest.mark.parametrize("basis", VARIANTS[:3], ids=lambda basis: basis.__name__)
@pytest.mark.parametrize("kin", ALL_KINEMATICS[1:], ids=lambda kin: type(kin).__name__)
def test_box_after_a_turn_by_90_degrees(basis, kin):
    """Of the original size, but for the variant `diagonal`, whose box vanishes."""
    half = (0.25, 0.2, 0.1)
    place = place_of(basis, kin, position(kin, SIZES[0], (0.5, 0.5, 0.5)), half)
    start = box_of(kin, place)
    angle = np.pi / 2 / 30
    turn = np.eye(3)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    for _ in range(30):
        place = deformed(basis(), kin, place, flat(kin, turn - np.eye(3)))
    end = box_of(kin, place)
    if basis is CPGIMPDiagonal:
        assert end[:2] == pytest.approx(np.zeros(2), abs=1e-15)
        assert end[2:] == pytest.approx(start[2:], rel=1e-12)
    else:
        assert end == pytest.approx(start, rel=1e-12)


@pytest.mark.parametrize("basis", VARIANTS[:3], ids=lambda basis: basis.__name__)
@every_kinematics
def test_box_after_stretches_along_the_axes(basis, kin):
    """`det` keeps the volume right (with the stretch around the axis), the others each side."""
    half = (0.25, 0.2, 0.1)
    place = place_of(basis, kin, position(kin, SIZES[0], (0.5, 0.5, 0.5)), half)
    start = box_of(kin, place)
    stretches = np.array([0.1, -0.05, 0.02])
    for _ in range(3):
        place = deformed(basis(), kin, place, flat(kin, np.diag(stretches)))
    d = kin.dimension
    ratios = (1 + stretches[:d]) ** 3
    if basis is CPGIMPDet:
        directions = 3 if isinstance(kin, Axisymmetric) else d
        ratios = np.full(d, np.prod(1 + stretches[:directions]) ** (3 / directions))
    assert box_of(kin, place) == pytest.approx(start * ratios, rel=1e-12)


@every_kinematics
@pytest.mark.parametrize("fraction", [(0.5, 0.5, 0.5), (0.0, 0.03, 1.0), (0.31, 1.0, 0.0)])
@pytest.mark.parametrize("size", SIZES[:4])
def test_box_between_carried_corners(kin, fraction, size):
    """Of velocities that are linear in space, only the stretch along each axis counts, exactly."""
    basis, b, d = CPGIMPCorners, CPGIMPCorners(), kin.dimension
    lattice, grid = made(basis, kin, size)
    old = place_of(basis, kin, position(kin, size, fraction), (0.25, 0.4, 0.1))
    stencil = locate(b, kin, grid, old)
    gradient = np.array([[0.1, 0.4, -0.2], [-0.3, 0.05, 0.1], [0.2, 0.1, -0.1]])[:d, :d]
    displacements = 0.01 + lattice.positions()[:, :d] @ gradient.T
    new = old
    for corner in range(carried(b, kin)):
        by = carrier(b, kin, grid, stencil, corner)
        u = np.array(by.weights) @ displacements[np.array(by.rows, int)]
        new = carry(b, kin, new, corner, tuple(u))
    assert new[:d] == old[:d]
    expected = box_of(kin, old) * (1 + np.diag(gradient))
    assert box_of(kin, new) == pytest.approx(expected, rel=1e-12)


@pytest.mark.full
@pytest.mark.parametrize("kin", ALL_KINEMATICS[2:], ids=lambda kin: type(kin).__name__)
@pytest.mark.parametrize("basis", VARIANTS, ids=lambda basis: basis.__name__)
def test_boxes_stay_single(basis, kin):
    """The compiled functions keep the types of a place, and give what plain Python gives."""
    real = np.float32
    _, grid = made(basis, kin, SIZES[0], real)
    x = position(kin, SIZES[0], (0.5, 0.4, 0.6))
    place = tuple(real(a) for a in place_of(basis, kin, x, (0.25, 0.2, 0.1)))
    dl = flat(kin, 0.01 * np.arange(1, 10).reshape(3, 3))
    dl = type(dl)(*map(real, dl))
    compiled = kernel(after_box)
    found = compiled(basis(), kin, grid, place, dl)
    assert found == pytest.approx(after_box(basis(), kin, grid, place, dl), rel=1e-5)
    if compiled is not after_box:
        assert "float64" not in str([unit.result for unit in compiled.units.values()])


def after_box(basis, kin, grid, place, dl):
    return moved_box(basis, kin, grid, place, dl)


@shared
def moved_box(basis, kin, grid, place, dl):
    new = deformed(basis, kin, place, dl)
    if carried(basis, kin) > 0:
        stencil = locate(basis, kin, grid, place)
        for corner in range(carried(basis, kin)):
            for weight in carrier(basis, kin, grid, stencil, corner).weights:
                u = weight * dl.diagonal()
                new = carry(basis, kin, new, corner, u)
    return new


@pytest.mark.parametrize("basis", [Linear(), QuadraticSpline(), CubicSpline()], ids=str)
@pytest.mark.parametrize("half", [0.5, 0.25, 1 / 6])
def test_the_surface_of_a_body_follows_from_the_mean_place_of_its_points(basis, half):
    """Layers of points below a plane surface, at random distances from the node: to 1 % of a cell.

    From where the node sees the first layer to half of its reach: once the body fills that, its
    mean place tells nothing.
    """
    table = surface_table(basis, half)
    x, weights = profile(basis, half)
    reach = np.abs(x[weights > 1e-9]).max()
    for place in np.random.default_rng(1).uniform(half - reach + 0.05, reach / 2, 20):
        layers = place - half - 2 * half * np.arange(20)
        seen = np.interp(layers, x, weights)
        mean = (seen * layers).sum() / seen.sum()
        found = np.interp(mean, np.arange(len(table)) / ENTRIES - 3, table)
        assert found == pytest.approx(place, abs=0.01)


@pytest.mark.parametrize("basis", [Linear(), QuadraticSpline()], ids=str)
def test_the_surface_of_a_cut_body_is_known_less_well(basis):
    """Where the outermost layer is thinner: to 0.07 cells (rms), as the documentation says."""
    half = 0.25
    table = surface_table(basis, half)
    x, weights = profile(basis, half)
    reach = np.abs(x[weights > 1e-9]).max()
    worst = 0.0
    for share in (0.1, 0.3, 0.5, 0.7, 0.9):
        errors = []
        for place in np.linspace(half - reach + 0.05, reach / 2, 40):
            inner = place - 2 * half * (share + 0.5 + np.arange(20))
            layers = np.append(inner, place - half * share)
            seen = np.interp(layers, x, weights) * np.append(np.ones(20), share)
            mean = (seen * layers).sum() / seen.sum()
            errors.append(np.interp(mean, np.arange(len(table)) / ENTRIES - 3, table) - place)
        worst = max(worst, np.sqrt(np.mean(np.square(errors))))
    assert worst == pytest.approx(0.067, abs=0.006)
