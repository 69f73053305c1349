"""Bases: the nodes in a point's stencil, with weights and gradients. One file each.

A basis is a NamedTuple of parameters (its class is the tag), with `traits` and the point functions
declared here. `grid` is the point's :class:`~karamelo_py.points.grid.Grid`; `place` a flat tuple of
its position and the stored shape of its domain (nothing, half sizes, corners ...); `stencil` the
result of `locate`. A product of one function per direction only needs `along` and
:func:`karamelo_py.points.basis.product.register`. A basis with corners has an `element`
(:class:`~karamelo_py.points.basis.cpdi.Element`).
"""

from math import inf
from typing import NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.points.noise import DriftLimits


class BasisTraits(NamedTuple):
    cells: int  # spanned by the nodes of all points of a cell; 1: the cell's corners only
    least_nodes: int  # of the grid per direction
    steady_moment: bool  # D of the affine transfers is nowhere near zero
    # |grad N|^2 / N exceeds 2 / h^2 per direction where a weight vanishes: usl limits the effect of
    # light nodes on the strain.
    steep_edge: bool
    nodes_per_cell: int = 1  # 2 with nodes between the corners of cells
    # At cell faces. Points that cross cells then add energy to a body, less with a smaller step.
    gradient_jumps: bool = False
    # Stable step over h/c while points stay at their positions: in the updated frame, its bound if
    # the strain comes before the forces (usf), in the total frame.
    courant_still: float = 1.0
    courant_strained_first: float = inf
    courant_total: float = 1.0
    # Stiffness of a point alone at its nodes, for smooth gradients: h^2 / D, and the largest h^2
    # sum_I |grad N_I|^2 / N_I per direction, away from walls.
    lone: tuple[float, float] | None = None
    bears_drift: bool = False  # drifting bodies conserve energy with the step of bodies at rest
    drift_limits: DriftLimits | None = (
        None  # limits of drift and rotation; None: as similar functions
    )
    # Stored parts of a point's domain, in order: ``half_size`` (d numbers), ``half_edges`` (d
    # vectors), ``deformation`` (F in 2D or 3D), ``corners`` (of the basis's `element`).
    shape: tuple[str, ...] = ()


@point_function()
def locate(basis, kin, grid, place):
    """Stencil of a point: what the functions below need, computed once per point."""


@point_function()
def support(basis, kin):
    """Number of nodes of a stencil; constant when compiled."""


@point_function()
def entry(basis, kin, grid, stencil, k):
    """(node number, weight N, gradient of N) of the k-th node of a stencil.

    The gradient is a vector; in axisymmetry followed by N / r (`Gradient` of the kinematics). A
    node may occur more than once: its parts are summed.
    """


@point_function()
def reach(basis, kin, grid, stencil, k):
    """X_I - x, from the point to the k-th node of its stencil."""


@point_function()
def affine_weight(basis, kin, grid, stencil, k):
    """N_I D^-1 (X_I - x) of the affine transfers, with D = sum_I N_I (X_I - x)(X_I - x)^T."""


@point_function(otherwise=True)
def walled(basis, faces):
    """The basis, modified at walls inside the grid, too (`splines.AtWalls`)."""
    return basis


@point_function(otherwise=True)
def mapped_again(basis, grid, moment):
    """The part of the affine moment in MUSL's second mapping to the nodes."""
    return moment


def without_moment(basis, grid, moment):
    """No moment in the second mapping: B D^-1 is unbounded where D vanishes.

    The velocity that deforms the points omits it; the points retain B.
    """
    return (grid.h - grid.h) * moment


@point_function(otherwise=True)
def first_node(basis, like):
    """Offset to a position in cells whose integer part is then the first node."""
    return 0


# --- the shape of a point's domain ------------------------------------------------------------


def shape_size(basis: type, d: int) -> int:
    """Count of numbers in a place after the position, in `d` dimensions."""
    shape = basis.traits.shape
    corners = basis.element.corners if "corners" in shape else 0
    sizes = {"half_size": d, "half_edges": d * d, "deformation": d * d, "corners": corners * d}
    return sum(sizes[part] for part in shape)


def blank(basis, kin, x):
    return (*x, *((x[0] - x[0],) * shape_size(type(basis), len(x))))


@point_function(otherwise=True)
def deformed(basis, kin, place, dl):
    """`place` after dl = dt grad v: its shape changes, not its position."""
    return place


@point_function(otherwise=True)
def extent(basis, kin, grid, place):
    """Reach in cells of the domain's corners, or of the nodes they scatter to; or 0."""
    return grid.h - grid.h


@point_function(otherwise=True)
def carried(basis, kin):
    """Count of domain corners that move with the grid; constant when compiled."""
    return 0


@point_function(otherwise=True)
def placed(basis, kin):
    """Count of corners stored by position, right after the point's."""
    return 0


@point_function(otherwise=True)
def carrier(basis, kin, grid, stencil, corner):
    """Nodes that carry a corner, and their weights: a :class:`Weighted`."""
    return ()


@point_function(otherwise=True)
def carry(basis, kin, place, corner, displacement):
    """`place` with one corner of the domain displaced."""
    return place
