"""Convected domains: weights and gradients, how domains move, what is refused."""

import inspect
from textwrap import dedent
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from selection import parameters
from states import final_hub, same_bits, state_of

from karamelo_py.compiler import kernel
from karamelo_py.kernels.records import accumulate, row
from karamelo_py.points.basis import (
    affine_weight,
    carried,
    carrier,
    carry,
    deformed,
    entry,
    extent,
    locate,
    reach,
    support,
)
from karamelo_py.points.basis.cpdi import CUBE, SQUARE, AtCorners, domain
from karamelo_py.points.basis.cpdi.block import InBlock, block_of
from karamelo_py.points.basis.cpdi.domains import H8, Q4, R4, R8, T3, Tet4
from karamelo_py.points.kinematics import Axisymmetric, PlaneStrain, Space
from karamelo_py.scene.lattice import Lattice
from karamelo_py.scene.views import PointsView

LO, HI, H = (0.3, 0.5, 2.0), (1.35, 1.1, 2.6), 0.15
FLAT = [(R4, PlaneStrain()), (Q4, PlaneStrain()), (T3, PlaneStrain())]
ALL = [*FLAT, *((b, Axisymmetric()) for b, _ in FLAT), *((b, Space()) for b in (R8, H8, Tet4))]
every_domain = pytest.mark.parametrize(
    "basis, kin", ALL, ids=lambda item: getattr(item, "__name__", type(item).__name__)
)
every_flat_domain = pytest.mark.parametrize(
    "basis, kin", [pair for pair in ALL if pair[1].dimension == 2]
)
UNIT = {
    Q4: np.array(SQUARE), H8: np.array(CUBE), T3: np.array([(-1, -1), (1, -1), (0, 1)]),
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

    Six Gauss points per direction, more than the products need; written with loops over corners.
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
@given(seed=st.integers(0, 10**6), size=st.sampled_from([0.3, 1.0, 1.5]))
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
def test_corners_in_the_place_of_nodes(basis, kin):
    """What corners show and give, by N_I = sum_c w_c N_I^lin(x_c), is what the nodes do."""
    grid = lattice(kin).numbers(float)
    stencil, nodes, weights, gradients = stencil_of(basis, kin, grid, a_place(basis, kin, 7, 1.2))
    expected, found = np.zeros((2, lattice(kin).node_count, 1 + len(gradients[0])))
    by = AtCorners(basis())
    shares = np.column_stack([weights, gradients])
    np.add.at(expected, nodes.astype(int), shares)
    field = np.random.default_rng(2).normal(size=(len(expected), 3))
    shown = 0
    for c in range(support(by, kin)):
        corner, weight, gradient = entry(by, kin, grid, stencil, c)
        accumulate(found, corner, 0, (weight, *gradient))
        shown += np.outer((weight, *gradient), row(field, corner, 0, (0.0,) * 3))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(shares).sum())
    sums = shares.T @ field[nodes.astype(int)]
    np.testing.assert_allclose(shown, sums, rtol=0, atol=1e-12 * np.abs(shares).sum())


@every_flat_domain
@given(seed=st.integers(0, 10**6), size=st.sampled_from([0.3, 1.0, 1.5]))
def test_blocks_of_nodes(basis, kin, seed, size):
    """Where a block holds all corners, its nodes have what the corners' nodes have together."""
    grid = lattice(kin).numbers(float)
    place = a_place(basis, kin, seed, size)
    stencil, nodes, weights, gradients = stencil_of(basis, kin, grid, place)
    block, by = block_of(kin, grid, stencil), InBlock(basis())
    positions = lattice(kin).positions()[:, :2]
    corners = np.array([corner.at for corner in stencil.corners]) * H + LO[:2]
    first = np.floor((np.array(place[:2]) - LO[:2]) / H - 0.5) * H + LO[:2]
    there = (first > np.subtract(LO, H / 2)[:2]) & (first + 2 * H < np.add(HI, H / 2)[:2])
    assert block.holds == (there & (corners >= first) & (corners <= first + 2 * H)).all()
    if not block.holds:
        return
    found = np.zeros((len(positions), 1 + len(gradients[0]) + 4))
    expected = np.zeros_like(found)
    for k in range(support(by, kin)):
        i, weight, gradient = entry(by, kin, grid, block, k)
        arm = reach(by, kin, grid, block, k)
        assert arm == pytest.approx(positions[int(i)] - np.array(stencil.centre) * H - LO[:2])
        row = weight, *gradient, *affine_weight(by, kin, grid, block, k), *(weight * np.array(arm))
        found[int(i)] += row
    for k, (i, weight) in enumerate(zip(nodes, weights, strict=True)):
        affine = affine_weight(basis(), kin, grid, stencil, k)
        arm = np.array(reach(basis(), kin, grid, stencil, k))
        expected[int(i)] += weight, *gradients[k], *affine, *(weight * arm)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


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
    least = 0.5 if d == 2 else 0.0  # the nodes next to a point
    assert reaches[0] == pytest.approx(max(np.abs(UNIT[corners] @ r).max() / H, least))
    assert reaches[0] == pytest.approx(reaches[1])


def nearby_displacements(kin, d, angle):
    """The increment dl of a turn in the plane of x and y."""
    dl = np.zeros((d, d))
    dl[:2, :2] = [[np.cos(angle) - 1, -np.sin(angle)], [np.sin(angle), np.cos(angle) - 1]]
    around = (0.0,) if isinstance(kin, Axisymmetric) else ()
    return kin.Tensor._make([*dl.ravel(), *around])


@pytest.mark.parametrize("basis, kin", [(R4, PlaneStrain()), (R8, Space())])
def test_edges_turn(basis, kin):
    """After a quarter turn in 90 steps a box is a box again: exact but for round-off."""
    d = kin.dimension
    box = (*LO[:d], *np.diag([0.03, 0.02, 0.01][:d]).ravel())
    place = box
    for _ in range(90):
        place = deformed(basis(), kin, place, nearby_displacements(kin, d, np.pi / 180))
    turned = np.array(place[d:]).reshape(d, d)
    expected = np.diag([0.0, 0.0, 0.01][:d])
    expected[0, 1], expected[1, 0] = 0.03, -0.02
    assert turned == pytest.approx(expected, abs=1e-15)
    assert place[:d] == box[:d]


@pytest.mark.parametrize("basis, kin", [(Q4, PlaneStrain()), (H8, Space()), (T3, PlaneStrain()),
                                        (Tet4, Space())])  # fmt: skip
def test_corners_go_with_the_grid(basis, kin):
    """A linear nodal velocity moves every corner by its own value; a fold is noticed."""
    d = kin.dimension
    grid = lattice(kin).numbers(float)
    place = a_place(basis, kin, 3)
    positions = lattice(kin).positions()[:, :d]
    slope = np.arange(1, d * d + 1).reshape(d, d)
    stencil = locate(basis(), kin, grid, place)
    new = place
    for corner in range(carried(basis(), kin)):
        by = carrier(basis(), kin, grid, stencil, corner)
        u = slope @ (np.array(by.weights) @ positions[np.array(by.rows, int)])
        new = carry(basis(), kin, new, corner, tuple(1e-3 * u))
    corners = np.array(place[d:]).reshape(-1, d)
    assert new[:d] == place[:d]
    assert np.array(new[d:]).reshape(-1, d) == pytest.approx(corners @ (np.eye(d) + 1e-3 * slope.T))
    assert np.isfinite(extent(basis(), kin, grid, place))
    flipped = np.array(place)
    flipped[d::d] *= -1
    assert extent(basis(), kin, grid, tuple(flipped)) == np.inf
    assert not np.isfinite(extent(basis(), kin, grid, (*place[:-1], np.nan)))


@kernel
def sums(basis, kin, grid, place):
    stencil = locate(basis, kin, grid, place)
    weight = slope = arm = nodes = 0.0
    for k in range(support(basis, kin)):
        i, w, g = entry(basis, kin, grid, stencil, k)
        away = reach(basis, kin, grid, stencil, k)[0]
        weight += w
        slope += g[0] * away
        arm += affine_weight(basis, kin, grid, stencil, k)[0] * away
        nodes += w * i
    return weight, slope, arm, nodes, extent(basis, kin, grid, place)


@pytest.mark.parametrize("basis, kin", [(Q4, PlaneStrain()), (R4, Axisymmetric()), (H8, Space())])
def test_compiled_is_the_same(basis, kin):
    grid = lattice(kin).numbers(float)
    place = tuple(float(a) for a in a_place(basis, kin, 5))
    compiled = sums(basis(), kin, grid, place)
    assert compiled == pytest.approx(inspect.unwrap(sums)(basis(), kin, grid, place), rel=1e-12)


# --- scenes -----------------------------------------------------------------------------------


def block(method, *lines, size="0.3, 0.6, 0.3, 0.5", ppc=2):
    return "\n".join([
        f"method({method})",
        "dimension(2, 0, 1.2, 0, 1.2, 0.1)",
        f"region(box, block, {size})",
        "material(rubber, linear, 2, 100, 0.3)",
        f"solid(body, region, box, {ppc}, rubber, 0.1, 0)",
        "set_output(1000)",
        *lines,
    ])  # fmt: skip


TWIST = (
    "fix(v, initial_velocity_particles, all, 0.9+sin(4*x0), 0.5*cos(7*y0))",
    "compute(u, average_velocity, all)",
    "compute(L, angular_momentum, all)",
    "log_modify(custom, step, u_x, u_y)",
)
SHORT = "ulcpdi, FLIP, linear, 1, R4"


KEPT = [
    (SHORT, "musl"), ("ulcpdi, FLIP, linear, 1, mechanical, Q4", "usl"),
    ("tlcpdi, FLIP, linear, 1, Q4", "usf"), ("ulcpdi, APIC, linear, Q4", "musl"),
]  # fmt: skip
OTHERS = [(one, scheme) for one, _ in KEPT for scheme in ("musl", "usl", "usf")]


@pytest.mark.parametrize(
    ("method", "scheme"), parameters(KEPT, [way for way in OTHERS if way not in KEPT])
)
def test_momentum_is_kept(run_interpreted, method, scheme):
    """A block that flies and deforms: the sum is that of before to round-off."""
    log = run_interpreted(
        block(method, f"scheme({scheme})", *TWIST, "dt_factor(0.3)", "run(6)")
    ).log
    assert log.u_x[-1] == pytest.approx(log.u_x[0], rel=1e-9)  # ten digits in the log
    assert log.u_y[-1] == pytest.approx(log.u_y[0], rel=1e-9)


def test_angular_momentum_is_kept(run_interpreted):
    """APIC with parallelograms, whose centre is the point: constant to the digits of the log."""
    spin = "fix(v, initial_velocity_particles, all, 0.4*sin(9*x0*y0)-y0, x0)"
    lines = (spin, *TWIST[2:3], "log_modify(custom, step, L_z)", "dt_factor(0.3)", "run(8)")
    log = run_interpreted(block("ulcpdi, APIC, linear, R4", *lines)).log
    assert abs(log.L_z[0]) > 1e-3
    assert log.L_z[-1] == pytest.approx(log.L_z[0], rel=1e-9)


@pytest.mark.parametrize("variant", ["Q4", "R4"])
def test_domains_go_with_prescribed_points(state_interpreted, variant):
    """Points that are moved all alike take their domains with them, whatever the grid does."""
    script = block(
        f"ulcpdi, FLIP, linear, 1, {variant}",
        "fix(grip, velocity_particles, all, 40*time, -20*time)", "set_dt(1e-3)", "run({})",
    )  # fmt: skip
    before, after = (state_interpreted(script.format(n))["x"] for n in (0, 6))
    assert after[0, 0] - before[0, 0] == pytest.approx(40e-6 * 15, rel=1e-9)
    if variant == "Q4":
        before[:, 2:] -= np.tile(before[:, :2], 4)
        after[:, 2:] -= np.tile(after[:, :2], 4)
    assert after[:, 2:] == pytest.approx(before[:, 2:], abs=1e-13)


@pytest.mark.parametrize("method, corners", [
    ("ulcpdi, FLIP, linear, 1, Q4", 4), ("ulcpdi, FLIP, linear, 1, R4", 0),
    ("tlcpdi, FLIP, linear, 1, Q4", 0),
])  # fmt: skip
def test_domains_go_with_points_moved_in_python(tmp_path, method, corners):
    """Corners are moved as their point is; edges stay, and so do domains in the reference."""
    path = tmp_path / "in.script"
    path.write_text(block(method), encoding="utf-8")
    simulation = final_hub(path).simulation
    before = simulation.state().places.T
    group = SimpleNamespace(all=False, ids=np.array([3, 5]))
    view = PointsView(simulation, simulation.points.members(group), then=False)
    view.position = view.position + [0.01, -0.02]
    view.write_back()
    moved = simulation.state().places.T - before
    assert view.moved and np.flatnonzero(moved.any(axis=1)).tolist() == [3, 5]
    wanted = np.zeros(moved.shape[1])
    wanted[: 2 + 2 * corners] = np.tile([0.01, -0.02], 1 + corners)
    assert moved[[3, 5]] == pytest.approx(np.array([wanted, wanted]), abs=1e-15)


def test_a_tangled_domain_ends_the_run(run_interpreted):
    """The message names the point, what happened, and what to do."""
    wild = "fix(v, initial_velocity_particles, all, 3*sin(17*y0), 3*sin(13*x0))"
    script = block("ulcpdi, FLIP, linear, 1, Q4", wild, "run(50)").replace("2, 100", "2, 1")
    result = run_interpreted(script, status=1)
    assert "tangled" in result.err
    assert "R4 instead of Q4" in result.err


@pytest.mark.parametrize("method, message", [
    ("ulcpdi, FLIP, Q4", "method(ulcpdi, FLIP, linear, 1, Q4)"),
    ("ulcpdi, FLIP, linear, 1", "R4"),
    ("ulcpdi, FLIP, linear, 1, R8", "one of R4, Q4, T3"),
    ("tlcpdi, FLIP, linear, 1, T3", "a mesh of triangles"),
    ("ulcpdi, ASFLIP, linear, 1, Q4", "R4"),
])  # fmt: skip
def test_what_does_not_go_together(run_interpreted, method, message):
    result = run_interpreted(block(method, "run(1)"), status=1)
    assert message in result.err


@pytest.mark.parametrize("d, typed, wanted", [
    (2, "ulcpdi, FLIP, linear, 0.9", "method(ulcpdi, FLIP, linear, 0.9, R4)"),
    (3, "ulcpdi, APIC, linear", "method(ulcpdi, APIC, linear, R8)"),
    (3, "tlcpdi, XPIC, linear, 2, mechanical", "method(tlcpdi, XPIC, linear, 2, mechanical, R8)"),
    (3, "ulcpdi, FLIP, R4, 0.5", "method(ulcpdi, FLIP, linear, 0.5, R8)"),
    (2, "ulcpdi, PIC, Q4", "method(ulcpdi, PIC, linear, Q4)"),
    (1, "ulcpdi, FLIP, linear, 0.9, R4", "method(ulmpm, FLIP, cpgimp, 0.9)"),
])  # fmt: skip
def test_hints_can_be_typed(run_interpreted, d, typed, wanted):
    """What a message says to write instead goes with the rest of what was typed, and runs."""
    script = "\n".join([
        f"dimension({d}, {'0, 1, ' * d}0.25)", "method({})",
        f"region(box, block, {', '.join(['0.25, 0.75'] * d)})", "material(m, linear, 2, 100, 0.3)",
        "solid(body, region, box, 1, m, 0.25, 0)", "run(1)",
    ])  # fmt: skip
    assert wanted in run_interpreted(script.format(typed), status=1).err
    run_interpreted(script.format(wanted[len("method(") : -1]))


@pytest.mark.parametrize("d, shape, fit", [(2, "H8", "R4, Q4, T3"), (3, "Q4", "R8, H8, Tet4")])
def test_shapes_for_another_dimension(run_interpreted, d, shape, fit):
    """The word is marked where it is typed, and only what fits is offered, also for a wrong one."""
    script = f"dimension({d}, {'0, 1, ' * d}0.25)\nmethod(ulcpdi, FLIP, linear, 1, {{}})\nrun(1)"
    err = run_interpreted(script.format(shape), status=1).err
    assert f"in.script:2:33: error: method: domains of the shape {shape}" in err
    assert f"one of {fit}" in err
    err = run_interpreted(script.format(f"{fit[:2]}, no-such"), status=1).err
    assert f"gradient-enhanced, {fit}\n" in err


def test_a_missing_share_of_flip(run_interpreted):
    """The rest of what was typed stays in the example."""
    err = run_interpreted("method(ulcpdi, FLIP, linear, 1)", status=1).err
    assert "in 2D one of R4, Q4, T3; in 3D one of R8, H8, Tet4; at the end" in err
    err = run_interpreted("method(ulcpdi, FLIP, linear, Q4)", status=1).err
    assert "method(ulcpdi, FLIP, linear, alpha, Q4) with alpha" in err


def test_one_dimension(run_interpreted):
    script = block(SHORT, "run(1)", size="0.3, 0.6").replace("(2, 0, 1.2,", "(1,")
    assert "cpgimp" in run_interpreted(script, status=1).err


@pytest.fixture
def meshes(tmp_path):
    """A square of two triangles and one quadrilateral in it; a cube of five tetrahedra."""
    square = np.array([(0.3, 0.3, 0), (0.5, 0.3, 0), (0.5, 0.5, 0), (0.3, 0.5, 0)])
    cube = np.array([(x, y, z) for x in (0.3, 0.5) for y in (0.3, 0.5) for z in (0.3, 0.5)])
    # Some of them the wrong way round, as meshes come.
    cells = {
        "triangle": (square, [(0, 1, 2), (0, 3, 2)]),
        "quad": (square, [(3, 2, 1, 0)]),
        "tetra": (cube, [(0, 4, 2, 1), (6, 2, 4, 7), (5, 7, 4, 1), (3, 1, 2, 7), (1, 2, 4, 7)]),
    }
    for name, (points, elements) in cells.items():
        mesh = meshio.Mesh(points, [(name, np.array(elements))])
        meshio.write(tmp_path / f"{name}.vtk", mesh)
    return tmp_path


@pytest.mark.parametrize("variant, element, d", [
    ("T3", "triangle", 2), ("Q4", "quad", 2), ("Tet4", "tetra", 3), ("R4", "quad", 2),
    ("Q4", "triangle", 2),
])  # fmt: skip
def test_domains_of_a_mesh(run_interpreted, state_interpreted, meshes, variant, element, d):
    """Elements become domains whichever way round they are; others are refused with the right."""
    domain = ", ".join(["0, 1.2"] * d)
    velocity = ", ".join(["0.9+sin(4*x0)", "0.5", "cos(y0)"][:d])
    script = f"""
        method(ulcpdi, FLIP, linear, 1, {variant})
        dimension({d}, {domain}, 0.1)
        material(rubber, linear, 2, 100, 0.3)
        solid(body, mesh, {meshes / element}.vtk, rubber, 0.1, 0)
        fix(v, initial_velocity_particles, all, {velocity})
    """
    right = {"triangle": "T3", "quad": "Q4", "tetra": "Tet4"}[element]
    if variant != right:
        result = run_interpreted(script + "    run(1)\n", status=1)
        assert f"{right} instead of {variant}" in result.err
        return
    masses = {"T3": [1, 1], "Q4": [1], "Tet4": [1, 1, 1, 1, 2]}[variant]
    before, after = (state_interpreted(dedent(script) + f"run({n})\n") for n in (0, 3))
    assert masses @ after["v"] == pytest.approx(masses @ before["v"], rel=1e-13)
    assert (after["x"] != before["x"]).all()


# A body of 20 x 4 points that is torn apart almost freely: domains come to reach five cells.
TORN = """
method(ulcpdi, FLIP, linear, 1, {})
dimension(2, 3, 13, 0.5, 1.5, 0.1)
region(box, block, 7.5, 8.5, 0.8, 1.2)
material(putty, linear, 1, 1e-3, 0.3)
solid(body, region, box, 1, putty, 0.1, 0)
fix(v, initial_velocity_particles, all, 8*(x0-8), 0.3*sin(9*x0))
dt_factor(0.9)
set_output(1000)
"""


def seen_along_x(state):
    """How far the nodes of a point lie apart along x at most, in cells."""
    return np.abs(state["x"][:, 2::2] - state["x"][:, :1]).max() / 0.1


@pytest.mark.full
def test_boxes_grow_with_domains(tmp_path, monkeypatch):
    """Domains stretch to six times their length: tiles give to nodes as far away as these reach.

    Compiled: one thread and two, and a run in pieces, give the same bits.
    """
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "in.script"

    monkeypatch.setattr("karamelo_py.run.tiles.DIRECT_UP_TO", 0)

    def run(threads, *lines):
        path.write_text("\n".join([TORN.format("Q4"), *lines]), encoding="utf-8")
        hub = final_hub(path, threads)
        return state_of(hub)

    whole = run(1, "run(26)")
    assert seen_along_x(whole) > 2.5
    assert same_bits(whole, run(2, "run(26)"))
    assert same_bits(whole, run(1, "run(13)", "run(13)"))


# Four points, torn faster, reach as far in ten steps.
FASTER = {"7.5, 8.5, 0.8, 1.2": "7.8, 8.2, 0.9, 1.0", "8*(x0-8)": "20*(x0-8)"}


@pytest.mark.parametrize(
    ("changes", "steps"),
    parameters([(FASTER, 10)], [({"0.8, 1.2": "0.9, 1.1"}, 26)]),  # half as many points
)
def test_torn_apart_in_any_way(state_interpreted, changes, steps):
    """The same interpreted, in pieces and whole; with edges instead of corners, too.

    In boxes of small tiles nothing is missing that points give far away: mass is kept.
    """
    torn = TORN
    for old, new in changes.items():
        assert old in torn
        torn = torn.replace(old, new)
    whole = state_interpreted(torn.format("Q4") + f"run({steps})", boxes=True)
    assert seen_along_x(whole) > 2.5
    assert whole["nodal mass"] == pytest.approx(whole["mass"].sum(), rel=1e-13)
    pieces = torn.format("Q4") + f"run({steps // 2})\nrun({steps // 2})"
    assert same_bits(whole, state_interpreted(pieces, boxes=True))
    whole = state_interpreted(torn.format("R4") + "run(6)")
    assert same_bits(whole, state_interpreted(torn.format("R4") + "run(3)\nrun(3)"))
