"""GIMP: hat functions averaged over a point's box."""

from types import MappingProxyType
from typing import NamedTuple

from karamelo_py.compiler import index
from karamelo_py.compiler.powers import power
from karamelo_py.language.rules import known_failure
from karamelo_py.points import basis as bases
from karamelo_py.points.basis import BasisTraits
from karamelo_py.points.basis.product import Along, along, node_number, register, warn_of_many_nodes
from karamelo_py.points.basis.weighted import Weighted
from karamelo_py.points.grid import cells_along, in_cells
from karamelo_py.points.kinematics import I, det, planar, product, stretch, tensor, total

LEAST = 1e-3
MOST = 1.0
STRETCHED = "half_size", "half_size", "deformation"  # present and initial half size, F


class _Box(NamedTuple):
    in_lanes = True
    traits = BasisTraits(
        cells=3, least_nodes=4, steady_moment=True, steep_edge=True, shape=("half_size",)
    )


class UGIMP(_Box):
    """Uniform GIMP: each point has a box of constant size (Bardenhagen & Kober 2004).

    Weights are means of the linear basis over [x - l, x + l] per direction, where l is the initial
    half size. At large stretch, gaps open between boxes, unlike with cpgimp. Walls cut boxes; the
    point then acts from the centre of the remaining part.

    Example
    -------
    method(ulmpm, FLIP, ugimp, 0.99)
    """


class _Following(_Box):
    pass


class CPGIMPDet(_Following):
    """Boxes of constant shape: l <- l (det(I + dl))^(1/d), with d directions that can stretch.

    Rotation does not change the boxes. Stretch in one direction is distributed to all directions.

    Example
    -------
    method(ulmpm, FLIP, cpgimp, 0.99, det)
    """

    __slots__ = ()


class CPGIMPDiagonal(_Following):
    """Boxes with half sizes l0 |F_ii|, for bodies that do not rotate.

    After a rotation by 90 degrees the boxes vanish, and the basis is linear.

    Example
    -------
    method(ulmpm, FLIP, cpgimp, 0.99, diagonal)
    """

    __slots__ = ()
    # D of affine transfers nearly vanishes with the box
    traits = _Box.traits._replace(steady_moment=False, shape=STRETCHED)


known_failure(
    CPGIMPDiagonal,
    "rotating boxes",
    when=lambda basis, scene: scene.turns,
    reason="bodies will rotate by about {scene.turn:.2g} rad, and boxes of the size |F_ii| shrink "
    "with the cosine of the angle",
    cure="variant stretch instead of diagonal",
)


class CPGIMPStretch(_Following):
    """Boxes with half sizes l0 U_ii, where U = sqrt(F^T F) is the right stretch.

    Rotation does not change the boxes (Charlton, Coombs & Augarde 2017, "iGIMP: An implicit
    generalised interpolation material point method for large deformations").

    Example
    -------
    method(ulmpm, FLIP, cpgimp, 0.99, stretch)
    """

    __slots__ = ()
    traits = _Box.traits._replace(shape=STRETCHED)


class CPGIMPCorners(_Following):
    """Boxes whose size is the mean distance between corners that move with the grid.

    l_i <- l_i + sum_c s_ci u_ci / 2^d, with displacements u of the 2^d corners c and sides s_ci =
    -1 or 1 (after Coombs et al. 2020, "On Lagrangian mechanics and the implicit material point
    method for large deformation elasto-plasticity"). Beyond a wall the velocity of the last cell is
    extrapolated.

    Example
    -------
    method(ulmpm, FLIP, cpgimp, 0.99, corners)
    """

    __slots__ = ()


class CPGIMP(_Box):
    """Contiguous-particle GIMP: ugimp with boxes that deform (Bardenhagen & Kober 2004).

    The size of the box follows ``det`` (the volume), ``diagonal`` (F_ii, which vanishes after a
    rotation by 90 degrees), ``stretch`` (U_ii of the right stretch, the default) or ``corners``
    (which move with the grid). Boxes remain aligned with the axes; for large shear use CPDI.

    Half sizes are limited to between 0.001 and 1 cell; more stretch causes numerical fracture. In
    total Lagrangian methods, cpgimp is the same as ugimp.

    Parameters
    ----------
    variant
        How the box deforms.

    Example
    -------
    method(ulmpm, FLIP, cpgimp, 0.99, stretch)
    """

    __slots__ = ()
    variants = MappingProxyType(
        {
            "det": CPGIMPDet,
            "diagonal": CPGIMPDiagonal,
            "stretch": CPGIMPStretch,
            "corners": CPGIMPCorners,
        }
    )
    default_variant = "stretch"


def box(grid, kin, location, direction, halves):
    """Return centre and ends of an uncut box along one direction, in cells, limited by `halves`."""
    a = in_cells(grid, direction, location[direction])
    half = location[kin.dimension + direction] * grid.inv_h
    half = min(max(half, halves[0]), halves[1])
    return a, a - half, a + half


def in_cell(lo, hi, j):
    """Integrate 1 and the function of node j + 1 over [lo, hi] within the cell after node j."""
    p = max(lo - j, 0)
    q = min(hi - j, 1)
    length = max(q - p, 0)
    return length, length * (0.5 * (p + q))


def averaged_hats(cells, grid, first, lo, hi):
    """Average hats from node `first` over [lo, hi], in cells from that node."""
    lengths, ahead = zip(*[in_cell(lo, hi, j) for j in range(cells)], strict=True)
    behind = [length - weight for length, weight in zip(lengths, ahead, strict=True)]
    between = [a + b for a, b in zip(ahead[:-1], behind[1:], strict=True)]
    falls = [lengths[j] - lengths[j + 1] for j in range(cells - 1)]
    k = 1 / total(lengths)
    slope = k * grid.inv_h
    weights = tuple([k * w for w in (behind[0], *between, ahead[-1])])
    gradients = tuple([slope * g for g in (-lengths[0], *falls, lengths[-1])])
    r = 0.5 * (lo + hi)
    arms = [j - r if j else -r for j in range(cells + 1)]
    pairs = list(zip(weights, arms, strict=True))
    k = grid.inv_h / total([w * arm * arm for w, arm in pairs])
    return Along(first, r, weights, gradients, tuple([k * arm * w for w, arm in pairs]))


@along.on(UGIMP)
def _along_ugimp(basis, kin, grid, location, direction):
    _, lo, hi = box(grid, kin, location, direction, (LEAST, 0.5))
    last = cells_along(grid, direction)
    lo, hi = max(lo, 0), min(hi, last)
    first = max(min(int(lo), last - 2), 0)
    return averaged_hats(2, grid, first, lo - first, hi - first)


@along.on(_Following)
def _along_box(basis, kin, grid, location, direction):
    a, lo, hi = box(grid, kin, location, direction, (LEAST, MOST))
    last = cells_along(grid, direction)
    first = max(min(min(int(a), last - 1) - 1, last - 3), 0)
    return averaged_hats(3, grid, first, max(lo, 0) - first, min(hi, last) - first)


@along.on(CPGIMPCorners)
def _along_cpgimp_corners(basis, kin, grid, location, direction):
    line = _along_box(basis, kin, grid, location, direction)
    _, lo, hi = box(grid, kin, location, direction, (LEAST, MOST))
    top = cells_along(grid, direction) - 1 - line.first
    return line._replace(ends=tuple([_end(at, line.first, top) for at in (lo, hi)]))


def _end(at, first, top):
    b = at - first
    i = min(max(int(b), 0), min(top, 2))
    return i, b - i


# Small boxes approach the linear basis.
bases.mapped_again.on(CPGIMPDiagonal)(bases.without_moment)


# Axisymmetric points need only the F of 2D.


@bases.deformed.on(CPGIMPDet)
def _deformed_cpgimp_det(basis, kin, location, dl):
    factor = power(det(I + dl), 1 / len(dl.axes))
    d = kin.dimension
    return (*location[:d], *[factor * half for half in location[d : 2 * d]])


@bases.deformed.on(CPGIMPDiagonal)
@bases.deformed.on(CPGIMPStretch)
def _deformed_cpgimp_stretch(basis, kin, location, dl):
    d = kin.dimension
    start, F = location[2 * d : 3 * d], tensor(planar(kin), location[3 * d :]).after(dl.planar())
    stretches = F.diagonal() if isinstance(basis, CPGIMPDiagonal) else stretch(F)
    half = [size * abs(factor) for size, factor in zip(start, stretches[:d], strict=True)]
    return (*location[:d], *half, *start, *F)


# Bit k of a corner's number is its side of the box along axis k; of a node's, its side of the cell.


@bases.carried.on(CPGIMPCorners)
def _carried_cpgimp_corners(basis, kin):
    return 1 << kin.dimension


def _side(line, corner, j):
    i, b = line.ends[1] if corner else line.ends[0]
    return (i + 1, b) if j else (i, 1 - b)


@bases.carrier.on(CPGIMPCorners)
def _carrier_cpgimp_corners(basis, kin, grid, stencil, corner):
    first = node_number(grid, grid.first, [line.first for line in stencil.lines])
    rows, weights = [], []
    for j in range(2**kin.dimension):
        lines = enumerate(stencil.lines)
        sides = [_side(line, corner & (1 << i), j & (1 << i)) for i, line in lines]
        rows.append(index(node_number(grid, first, [side[0] for side in sides])))
        weights.append(product([side[1] for side in sides]))
    return Weighted(tuple(rows), tuple(weights))


@bases.carry.on(CPGIMPCorners)
def _carry_cpgimp_corners(basis, kin, location, corner, displacement):
    d = kin.dimension
    moves = enumerate(zip(location[d : 2 * d], displacement, strict=True))
    half = [size + 0.5**d * (u if corner & (1 << i) else -u) for i, (size, u) in moves]
    return (*location[:d], *half)


register(UGIMP, 3)
for _basis in (CPGIMPDet, CPGIMPDiagonal, CPGIMPStretch, CPGIMPCorners):
    register(_basis, 4)
warn_of_many_nodes(_Box)
