"""Several points at once: each lane gives the bits of a point alone; nothing is beyond the last."""

from math import log1p, sin
from typing import NamedTuple

import numpy as np
import pytest

from karamelo_py.compiler import (
    CannotCompile,
    all_lanes,
    fma,
    kernel,
    point_function,
    real,
    shared,
    where,
)
from karamelo_py.compiler.fields import field, load, load_vector, store
from karamelo_py.compiler.lanes import EightLanes, FourLanes, beside, group, of_present
from karamelo_py.compiler.powers import exponential, logarithm, logarithm_near_one, power
from karamelo_py.compiler.threads import Serial
from karamelo_py.compiler.tuples import flat, nested_as
from karamelo_py.kernels.arrays import arrays_of, with_items
from karamelo_py.kernels.equations import Task
from karamelo_py.kernels.equations.fbar import NodalMean
from karamelo_py.kernels.equations.heat import HeatContent, HeatFlow, TemperatureGradient, Warming
from karamelo_py.kernels.records import accumulate, accumulate_affine, row
from karamelo_py.kernels.sweep import Extent, OldWeights, Visit, context_of, sweep_points
from karamelo_py.kernels.views import location_at
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.points.basis import (
    carried,
    carrier,
    carry,
    deformed,
    entry,
    extent,
    locate,
    support,
)
from karamelo_py.points.basis.bernstein_quadratic import BernsteinQuadratic
from karamelo_py.points.basis.cpdi import SQUARE, AtCorners
from karamelo_py.points.basis.cpdi.block import InBlock, block_of, of_one
from karamelo_py.points.basis.cpdi.domains import Q4, R4, T3
from karamelo_py.points.basis.gimp import (
    UGIMP,
    CPGIMPCorners,
    CPGIMPDet,
    CPGIMPDiagonal,
    CPGIMPStretch,
)
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.basis.splines import (
    CubicSpline,
    CubicSplineAtWalls,
    QuadraticSpline,
    QuadraticSplineAtWalls,
)
from karamelo_py.points.grid import Grid, ReflectingGrid, reflected
from karamelo_py.points.kinematics import PlaneStrain, Space, vector, zero
from karamelo_py.points.laws import Absent, advance, initial_state, law_kind, plastic_strain
from karamelo_py.points.laws.damages import JohnsonCookDamage
from karamelo_py.points.laws.eos import LinearPressure
from karamelo_py.points.laws.eos.fluid import Tait
from karamelo_py.points.laws.eos.shock import Shock
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.further import Further, PlasticRate
from karamelo_py.points.laws.linear import LinearElastic
from karamelo_py.points.laws.neo_hookean import NeoHookean
from karamelo_py.points.laws.strengths.drucker_prager import DruckerPrager
from karamelo_py.points.laws.strengths.hardening import LinearHardening
from karamelo_py.points.laws.strengths.linear import Viscous
from karamelo_py.points.laws.strengths.metals import JohnsonCookConstants, ZerilliArmstrong
from karamelo_py.points.laws.strengths.mu_i import MuI
from karamelo_py.points.laws.temperatures import PlasticWork
from karamelo_py.points.laws.viscosity import ArtificialViscosity
from karamelo_py.run.lower.build import lower
from karamelo_py.scene.hub import Hub

pytestmark = pytest.mark.xdist_group("lanes")
KIN = PlaneStrain()
WIDTHS = {np.float64: (4, FourLanes()), np.float32: (8, EightLanes())}


@kernel
def _numbers_alone(a, b, out, n):
    for p in range(n):
        _number(a, b, out, p, n)


@kernel
def _number(a, b, out, p, n):
    x, y = a[p], b[0, p]
    out[0, p] = fma(x, y, real(2, x)) / (x * x + real(1, x))
    out[1, p] = where(x > y, min(x, real(0.5, x)), max(x, y, -y)) - abs(y)
    out[3, p] = sin(x) // real(0.3, x) + log1p(abs(y)) % real(0.25, y)
    out[2, p] = real(int(x + real(3, x)), x) + real(all_lanes(x < real(9, x)), y)
    out[2, p] += where(n > 8, x, 2) - where(n > 8, 0.5, y)


@kernel
def _numbers_in_lanes(tag, width, a, b, out, n):
    for q in range(0, n, width):
        _number(a, b, out, group(tag, q, min(width, n - q)), n)


@pytest.mark.parametrize("real_type", WIDTHS)
@pytest.mark.parametrize("n", [1, 8, 13])
def test_arithmetic(real_type, n):
    """All that numbers can do, with a last group that is not full; what is behind it stays."""
    width, tag = WIDTHS[real_type]
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=n).astype(real_type), rng.normal(size=(1, n)).astype(real_type)
    a[: n // 4], b[0, : n // 2 : 2] = 0.0, -0.0
    alone, together = np.full((2, 4, n + 8), 7, real_type)
    _numbers_alone(a, b, alone, n)
    _numbers_in_lanes(tag, width, a, b, together, n)
    assert together.tobytes() == alone.tobytes()
    assert (together[:, n:] == 7).all()


@kernel
def _extremes_alone(a, b, out, n):
    for p in range(n):
        out[0, p] = max(a[p], b[0, p])
        out[1, p] = min(a[p], b[0, p])


@kernel
def _extremes_in_lanes(a, b, out, n):
    for q in range(0, n, 4):
        p = group(FourLanes(), q, min(4, n - q))
        out[0, p] = max(a[p], b[0, p])
        out[1, p] = min(a[p], b[0, p])


def test_extremes_of_what_is_no_number():
    """NaN on either side and zeros of both signs, as alone."""
    values = np.array([np.nan, 1.0, -0.0, 0.0, np.inf])
    a, b = (np.ascontiguousarray(v.ravel()) for v in np.meshgrid(values, values))
    alone, together = np.zeros((2, 2, 25))
    _extremes_alone(a, b[None], alone, 25)
    _extremes_in_lanes(a, b[None], together, 25)
    assert together.tobytes() == alone.tobytes()


@shared
def _larger(a):
    return a if a > 0 else -a


@kernel
def _branches(a, out):
    p = group(FourLanes(), 0, 4)
    out[0, p] = _larger(a[p])


def test_a_branch_says_what_to_write():
    with pytest.raises(CannotCompile, match="use where, all_lanes or any_lane"):
        _branches(np.ones(4), np.zeros((1, 4)))


@kernel
def _whole_times_half(a, out):
    p = group(FourLanes(), 0, 4)
    out[0, p] = int(a[p]) * 0.5


def test_whole_numbers_are_not_cut_off():
    """Cells times a real number would lose what is behind the point: that does not compile."""
    with pytest.raises(CannotCompile):
        _whole_times_half(np.ones(4), np.zeros((1, 4)))


class Branching(NamedTuple):
    """Its numbers are found for one lane after another."""

    scalarised = ("_with_a_literal",)


@point_function()
def _with_a_literal(tag, x):
    pass


@_with_a_literal.on(Branching)
def _with_a_literal_of_branching(tag, x):
    return x * x, 0.5


@kernel
def _literal(tag, lanes, a, out):
    p = group(lanes, 0, 8)
    square, literal = _with_a_literal(tag, a[p])
    out[0, p] = square * literal


def test_literals_of_single_lanes_are_single():
    """Found lane by lane, too, as the stretch across a plane is."""
    a, out = np.arange(8, dtype=np.float32), np.zeros((1, 8), np.float32)
    _literal(Branching(), EightLanes(), a, out)
    assert (out[0] == a * a / 2).all()


@shared
def _advanced(law, kin, state, dl, dt, p):
    like = state[0, p]
    old = load(state, p, initial_state(law, kin, like))
    store(state, p, advance(law, kin, old, load(dl, p, zero(kin, like)), dt))


@kernel
def _advance(law, kin, state, dl, dt, p):
    _advanced(law, kin, state, dl, dt, p)


@kernel
def _advance_alone(law, kin, state, dl, dt, n):
    for p in range(n):
        _advance(law, kin, state, dl, dt, p)


@kernel
def _advance_in_lanes(law, kin, state, dl, dt, n):
    for q in range(0, n, 4):
        _advance(law, kin, state, dl, dt, group(FourLanes(), q, min(4, n - q)))


COPPER = Shock(1 / 8940, 1.38e11, 1.5, 0.0, 298.0, tension=1e9)
COOK = JohnsonCookConstants(43.9e9, 65e6, 356e6, 0.37, 1.0, 0.02, 1.1, 298.0, 1356.0).checked()
WEAR = JohnsonCookDamage(0.002, 0.1, -3.0, 0.014, 1.12, 1.0, 298.0, 1356.0)
LAWS = [
    LinearElastic(1e-3, 500.0, 400.0),
    NeoHookean(1e-3, 500.0, 400.0),
    EosStrength(Tait(1e-3, 1e3, 7.0, 0.0), Viscous(1e-3, 0.1)),
    EosStrength(LinearPressure(1e-3, 1e3), LinearHardening(400.0, 0.5, 20.0)),
    # Pressure, damage, heat, rate; at first no point yields, then some do.
    EosStrength(
        COPPER,
        COOK,
        ArtificialViscosity(1.5, 0.06, 1e-3),
        WEAR,
        PlasticWork(0.9, 385.0, 0.0, 1e5, 298.0, 1356.0),
    ),
    EosStrength(
        LinearPressure(1e-3, 1e3),
        ZerilliArmstrong(400.0, 0.1, 1.0, 0.5, 0.003, 1e-4, 0.2, 0.3),
    ),
    EosStrength(
        LinearPressure(1e-3, 1e3),
        MuI(400.0, 0.4, 0.6, 0.3, 1e-3, 2e3),
        further=Further(PlasticRate(1e-3), Absent()),
    ),
    # Its response is computed for one lane after another.
    EosStrength(LinearPressure(1e-3, 1e3), DruckerPrager.given(400.0, 0.1, 30.0, 5.0)),
]


def named(law):
    return "-".join(kind.__name__ for kind in law_kind(law))


# In space: a law of rates, and the one that is taken by lanes.
@pytest.mark.parametrize(
    ("law", "kin"),
    [
        *(pytest.param(law, PlaneStrain(), id=f"{named(law)}-plane") for law in LAWS),
        *(
            pytest.param(
                law, Space(), id=f"{named(law)}-space",
                marks=[pytest.mark.full] * (k not in (0, 7)),
            )
            for k, law in enumerate(LAWS)
        ),
    ],
)  # fmt: skip
def test_laws_unchanged(law, kin):
    """The same function of a law, four points at once; eleven points end within a group."""
    n = 11
    begin = initial_state(law, kin, 1.0)
    start = np.array(flat(begin), float)
    dl = np.linspace(1e-4, 2e-3, n) * np.random.default_rng(2).normal(size=(kin.tensor_size, n))
    alone = np.repeat(start[:, None], n, axis=1)
    together = alone.copy()
    for _ in range(3):
        _advance_alone(law, kin, alone, dl, 1e-6, n)
        _advance_in_lanes(law, kin, together, dl, 1e-6, n)
    assert (alone != start[:, None]).any()
    assert together.tobytes() == alone.tobytes()
    if isinstance(law, EosStrength) and not isinstance(law.strength, Viscous):
        states = [nested_as(begin, tuple(state)) for state in alone.T]
        strain = [plastic_strain(law, kin, state) for state in states]
        assert max(strain) > 0  # something yields


@kernel
def _powers(x, y, out, p):
    out[0, p] = power(x[p], y[p])
    out[1, p] = logarithm(x[p])
    out[3, p] = logarithm_near_one(x[p])
    out[2, p] = exponential(y[p])


@kernel
def _powers_alone(x, y, out, n):
    for p in range(n):
        _powers(x, y, out, p)


@kernel
def _powers_in_lanes(tag, width, x, y, out, n):
    for q in range(0, n, width):
        _powers(x, y, out, group(tag, q, min(width, n - q)))


@pytest.mark.parametrize("real_type", WIDTHS)
def test_powers(real_type):
    """Against the C library in more digits: two operations, and |y ln x| of them in a power."""
    width, tag = WIDTHS[real_type]
    rng = np.random.default_rng(4)
    x = (10 ** rng.uniform(-4, 4, 2000)).astype(real_type)
    x[:1000] = rng.uniform(0.9, 1.1, 1000)
    x[:400] = 1 + rng.choice([-1, 1], 400) * 10 ** rng.uniform(-8, np.log10(1 / 16), 400)
    y = rng.uniform(-8, 8, 2000).astype(real_type)
    alone, together = np.zeros((2, 4, 2000), real_type)
    _powers_alone(x, y, alone, 2000)
    _powers_in_lanes(tag, width, x, y, together, 2000)
    assert together.tobytes() == alone.tobytes()
    a, b = x.astype(np.longdouble), y.astype(np.longdouble)
    eps = np.finfo(real_type).eps
    growth = 2 + np.abs(b * np.log(a))
    off = np.abs(alone - np.stack([a**b, np.log(a), np.exp(b), np.log(a)]))
    assert (off[0] <= eps * growth * a**b).all()
    assert (off[1] <= 2 * eps * np.abs(np.log(a))).all()
    near = np.abs(a - 1) <= 1 / 16
    assert (off[3] <= np.where(near, 0.6, 2) * eps * np.abs(np.log(a))).all()
    assert (off[2] <= 2 * eps * np.exp(b)).all()


@pytest.mark.parametrize("real_type", WIDTHS)
def test_powers_at_the_ends(real_type):
    """Nothing, one, too much and too little, and the smallest numbers."""
    width, tag = WIDTHS[real_type]
    last = np.log2(np.finfo(real_type).smallest_subnormal) + 4
    x = np.array([0.0, 0.0, 1.0, 2.0, 2.0, 2.0, -1.0, np.nan, 0.0, 0.0], real_type)
    y = np.array([0.4, 0.0, 1e3, 2e3, -2e3, last, 0.5, 0.5, -0.5, -2.0], real_type)
    out, alone = np.zeros((2, 4, 10), real_type)
    _powers_in_lanes(tag, width, x, y, out, 10)
    _powers_alone(x, y, alone, 10)
    np.testing.assert_array_equal(out, alone)
    np.testing.assert_array_equal(out[0, :5], [0, 1, 1, np.inf, 0])
    np.testing.assert_array_equal(out[0, 8:], [np.inf, np.inf])
    assert power(0.0, -0.5) == power(0.0, -2.0) == np.inf  # interpreted
    assert out[0, 5] == pytest.approx(2.0**last, rel=1 / 16)
    assert np.isnan(out[0, 6:8]).all()
    np.testing.assert_array_equal(out[1, :3], [-np.inf, -np.inf, 0])
    np.testing.assert_array_equal(out[3], out[1])


GRID = Grid(
    x0=0.0, y0=0.0, z0=0.0, h=0.5, inv_h=2.0, spacing=0.5, nx=6, ny=5, nz=1, lx=6.0, ly=5.0,
    lz=1.0, slack=1e-9, step_x=6, step_y=1, first=0, first_cell=0,
)  # fmt: skip


@shared
def _grown(basis, grid, stencil, here, seen):
    """The place behind a step in which `seen` is the displacement of the nodes."""
    dl = KIN.Tensor._make([real(c, here[0]) for c in (0.1, 0.2, -0.1, 0.05)])
    new = deformed(basis, KIN, here, dl)
    for corner in range(carried(basis, KIN)):
        u = vector(KIN, row(seen, carrier(basis, KIN, grid, stencil, corner), 0, here[:2]))
        new = carry(basis, KIN, new, corner, 1e-3 * u)
    return (*new, extent(basis, KIN, grid, new) + real(0, here[0]))


@shared
def _nodes_of(by, grid, stencil):
    return of_one(block_of(KIN, grid, stencil)) if isinstance(by, InBlock) else stencil


@kernel
def _map(basis, by, grid, x, mass, nodes, seen, out, p):
    """Mass and position to the nodes, and a field of the nodes to the points and their domains.

    `by` is the basis, or what takes its place at the corners of domains, or in a block of nodes.
    """
    here = location_at(basis, KIN, x, p)
    stencil = locate(basis, KIN, grid, here)
    nodes_of = _nodes_of(by, grid, stencil)
    total = real(0, here[0]), real(0, here[0]), real(0, here[0])
    for k in range(support(by, KIN)):
        i, weight, gradient = entry(by, KIN, grid, nodes_of, k)
        part = of_present(p, mass[p]) * weight
        accumulate(nodes, i, 0, (part, part * here[0], part * here[1]))
        found = row(seen, i, 0, total)
        total = (
            fma(weight, found[0], total[0]),
            fma(gradient[0], found[1], total[1]),
            fma(gradient[1], found[2], total[2]),
        )
    store(out, p, total + _grown(basis, grid, stencil, here, seen))


@kernel
def _map_alone(basis, by, grid, x, mass, nodes, seen, out, n):
    for p in range(n):
        _map(basis, by, grid, x, mass, nodes, seen, out, p)


@kernel
def _map_in_lanes(basis, by, grid, x, mass, nodes, seen, out, n):
    for q in range(0, n, 4):
        _map(basis, by, grid, x, mass, nodes, seen, out, group(FourLanes(), q, min(4, n - q)))


HALF = (0.125, 0.125)
FACES = np.random.default_rng(5).integers(0, 4, (30, 2), np.int8)


def quadratic_at_walls():
    return QuadraticSplineAtWalls(FACES)


def cubic_at_walls():
    return CubicSplineAtWalls(FACES)


DOMAINS = {
    quadratic_at_walls: (),
    cubic_at_walls: (),
    Linear: (),
    QuadraticSpline: (),
    CubicSpline: (),
    BernsteinQuadratic: (),
    UGIMP: HALF,
    CPGIMPDet: HALF,
    CPGIMPDiagonal: (*HALF, *HALF, 1.0, 0.0, 0.0, 1.0),
    CPGIMPStretch: (*HALF, *HALF, 1.0, 0.0, 0.0, 1.0),
    CPGIMPCorners: HALF,
    R4: (0.125, 0.01, 0.02, 0.125),
    Q4: [np.array(corner) / 8 for corner in SQUARE],
    T3: [np.array(corner) / 8 for corner in ((-1, -1), (1, -1), (0, 2))],
}
# Another of these is found in the same way.
ALIKE = {cubic_at_walls, CPGIMPDet, CPGIMPDiagonal, T3}


@pytest.mark.parametrize(
    "kind, by, spread",
    [
        *(
            pytest.param(kind, kind(), spread, marks=[pytest.mark.full] * (kind in ALIKE))
            for kind in DOMAINS
            for spread in (0.1, 2.4)
        ),
        *((Q4, AtCorners(Q4()), spread) for spread in (0.1, 2.4)),
        (Q4, InBlock(Q4()), 0.1),
        *(
            pytest.param(kind, by(kind()), 0.1, marks=pytest.mark.full)
            for kind in (R4, T3)
            for by in (AtCorners, InBlock)
        ),
    ],
    ids=lambda item: getattr(item, "__name__", str(item)),
)
def test_weights_gather_and_scatter(kind, by, spread):
    """Points of one cell take the short way; sums at nodes differ by the order of additions."""
    n, basis = 14, kind()
    rng = np.random.default_rng(3)
    mass = rng.uniform(1, 2, n)
    x = (0.8 if isinstance(by, InBlock) else 0.2) + spread * rng.uniform(size=(2, n))
    domain = np.array(DOMAINS[kind])
    if domain.ndim == 2:  # corners
        x = np.concatenate([x, *(x + corner[:, None] for corner in domain)])
    else:
        x = np.concatenate([x, np.repeat(domain[:, None], n, axis=1)])
    x[2:] *= 1 + 0.1 * rng.uniform(size=(len(x) - 2, n))
    per_cell = basis.traits.nodes_per_cell
    step = per_cell * GRID.ny + 1
    grid = GRID._replace(step_x=step)
    count = (per_cell * GRID.nx + 1) * step
    seen = rng.normal(size=(count, 4))
    alone, together = np.zeros((2, count, 4))
    of_alone, of_together = np.zeros((2, 3 + len(x) + 1, n))
    _map_alone(basis, by, grid, x, mass, alone, seen, of_alone, n)
    _map_in_lanes(basis, by, grid, x, mass, together, seen, of_together, n)
    assert of_together.tobytes() == of_alone.tobytes()
    assert np.isfinite(of_alone).all()
    assert alone[:, 0].sum() == pytest.approx(mass.sum(), rel=1e-14)
    np.testing.assert_allclose(together[:, :3], alone[:, :3], rtol=0, atol=1e-14 * mass.sum())
    assert (together[:, 3] == 0).all()  # what lies behind the components of a record


@shared
def _give_affine(array, at, weights, field, p):
    """Nodes of a square of three by three, whose first node is `at`."""
    nodes = tuple([beside(at, k // 3 * 7 + k % 3) for k in range(9)])
    given = load(weights, p, (0.0,) * 9)
    value, by_row, by_node = (
        tuple([of_present(p, field[3 * k + c, p]) for c in range(3)]) for k in range(3)
    )
    parts = (array, 1, value, (by_row, by_node)), (array, 4, value[:2], ())
    accumulate_affine(parts, nodes, given)
    # More than the widest register takes: eleven, and nine that do not grow.
    wide, along, across = (3 * part + part[:2] for part in (value, by_row, by_node))
    parts = (array, 8, wide, (along, across)), (array, 20, 3 * value, ())
    accumulate_affine(parts, nodes, given)
    accumulate_affine(((array, 32, wide, (along, across)),), nodes, ())


@kernel
def _give_affine_in_lanes(tag, width, at, weights, field, array, n):
    for q in range(0, n, width):
        p = group(tag, q, min(width, n - q))
        _give_affine(array, at[p], weights, field, p)


@kernel
def _give_affine_to_one(tag, width, at, weights, field, array, n):
    for q in range(0, n, width):
        p = group(tag, q, min(width, n - q))
        _give_affine(array, at[0], weights, field, p)


@pytest.mark.parametrize("real_type", WIDTHS)
@pytest.mark.parametrize("give", [_give_affine_in_lanes, _give_affine_to_one])
def test_affine_fields_at_the_nodes(real_type, give):
    """The sums are those of the same function on numbers, point after point."""
    width, tag = WIDTHS[real_type]
    n = 2 * width + 3
    rng = np.random.default_rng(8)
    at = rng.integers(0, 20, n)
    at[:width] = at[0]
    weights, field = rng.uniform(size=(9, n)), rng.normal(size=(9, n))
    array, expected = np.zeros((40, 44), real_type), np.zeros((40, 44))
    give(tag, width, at, weights.astype(real_type), field.astype(real_type), array, n)
    for p in range(n):
        first = at[p] if give is _give_affine_in_lanes else at[0]
        nodes = [first + k // 3 * 7 + k % 3 for k in range(9)]
        value, *slopes = field[:3, p], field[3:6, p], field[6:, p]
        wide, *growths = (np.append(np.tile(part, 3), part[:2]) for part in (value, *slopes))
        constant = (expected, 4, value[:2], ()), (expected, 20, np.tile(value, 3), ())
        parts = (expected, 1, value, slopes), (expected, 8, wide, growths), *constant
        accumulate_affine(parts, nodes, weights[:, p])
        accumulate_affine(((expected, 32, wide, growths),), nodes, ())
    np.testing.assert_allclose(array, expected, rtol=0, atol=200 * np.finfo(real_type).eps)


@shared
def _reflected(grid, x, v, moment, out, p):
    place, velocity = load_vector(KIN, x, p), load_vector(KIN, v, p)
    kept = load(moment, p, zero(KIN, x[0, p]))
    y, v, moment, met = reflected(grid, KIN, place, velocity, kept)
    store(out, p, (*y, *v, *moment, *met))


@kernel
def _reflect(grid, x, v, moment, out, p):
    _reflected(grid, x, v, moment, out, p)


@kernel
def _reflect_alone(grid, x, v, moment, out, n):
    for p in range(n):
        _reflect(grid, x, v, moment, out, p)


@kernel
def _reflect_in_lanes(grid, x, v, moment, out, n):
    for q in range(0, n, 4):
        _reflect(grid, x, v, moment, out, group(FourLanes(), q, min(4, n - q)))


def test_edges_that_reflect():
    n = 30
    rng = np.random.default_rng(6)
    x = rng.uniform(-0.5, 3.5, (2, n))  # from 0 to 3 in x, to 2.5 in y
    v, moment = rng.normal(size=(2, n)), rng.normal(size=(4, n))
    alone, together = np.zeros((2, 10, n))
    _reflect_alone(ReflectingGrid(*GRID), x, v, moment, alone, n)
    _reflect_in_lanes(ReflectingGrid(*GRID), x, v, moment, together, n)
    assert together.tobytes() == alone.tobytes()
    assert 0 < alone[8:].sum() < 2 * n


@kernel
def _parameters_in_lanes(table, material, out, n):
    for q in range(0, n, 4):
        p = group(FourLanes(), q, min(4, n - q))
        store(out, p, (table[material[p]],))


def test_parameters_of_one_material_and_of_several():
    table = np.array([0.5, 1.5, 2.5])
    material = np.array([1, 1, 1, 1, 0, 2, 1, 0, 2, 2], np.int32)
    out = np.zeros((1, len(material)))
    _parameters_in_lanes(table, material, out, len(material))
    assert out[0].tolist() == table[material].tolist()


class Alone(Task):
    """A task that does nothing and knows no lanes."""

    in_lanes = False

    def empty(task, w, x):
        return ()

    def gathered(task, node, total):
        return total

    def updated(task, pt, total, totals, fastest):
        return real(0, pt.dt), fastest


WARM_DISK = """
method(tlmpm, FLIP, linear, 1, thermo-mechanical)
dimension(2, 0, 1, 0, 1, 0.2)
region(disk, cylinder, 0.5, 0.5, 0.4)
material(rubber, linear, 1000, 1000, 0.3, 385, 0.1)
solid(disk, region, disk, 2, rubber, 0.2, 300)
"""


def _visited(*more):
    """All arrays behind one visit of heat, with these tasks too."""
    hub = Hub(Console(quiet=True))
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(WARM_DISK)
    setup, tiles = lower(hub)
    tiles.sort(setup)
    heat = setup.heat
    mean = NodalMean(np.zeros_like(field(heat.nodes.fields, NodalMean)))
    to = heat.buffers.nodes._replace(sums=np.zeros_like(heat.nodes.sums), fields=(mean,))
    s = with_items(setup, nodes=heat.nodes, buffers=heat.buffers._replace(nodes=to))
    rng = np.random.default_rng(5)
    points = s.blocks[0].points
    given = [one.array for one in (*points.fields, *s.nodes.fields)]
    for array in (points.v, s.nodes.velocity, s.nodes.update, *given):
        array[:] = 1 + 0.1 * rng.uniform(size=array.shape)
    tasks = (TemperatureGradient(), Warming(), *more)
    visit = Visit(tasks, (HeatContent(), HeatFlow()), OldWeights())
    sweep_points(Serial(), visit, context_of(s, Extent(1e-3, True, True, True)), s.blocks[0])
    assert (s.blocks[0].tiling.report[:, 2] == 0).all()
    return dict(arrays_of(points)), (to.sums, mean.array)


def test_heat():
    """Points have the bits of points alone; sums at nodes differ by the order of additions."""
    together, nodes = _visited()
    alone, nodes_alone = _visited(Alone())
    for name, array in alone.items():
        assert together[name].tobytes() == array.tobytes(), name
    assert np.ptp(alone["heat gradient"]) > 0
    for array, expected in zip(nodes, nodes_alone, strict=True):
        np.testing.assert_allclose(array, expected, rtol=1e-13)
