"""Bases: the nodes in a point's stencil, with weights and gradients. One file each.

A basis is a NamedTuple of parameters (its class is the tag) with `traits` and the point functions
declared here. `grid` is the point's :class:`~karamelo_py.points.grid.Grid`, `place` a flat tuple of
its position and the stored shape of its domain, `stencil` the result of `locate`. Products of one
function per direction only need `along` and :func:`karamelo_py.points.basis.product.register`;
bases with corners an `element` (:class:`~karamelo_py.points.basis.cpdi.Element`).
"""

from math import inf
from typing import NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.points.noise import DriftLimits


class BasisTraits(NamedTuple):
    cells: int  # spanned by the nodes of all points of a cell
    least_nodes: int  # per direction
    steady_moment: bool  # D of the affine transfers stays away from zero
    # |grad N|^2 / N exceeds 2 / h^2 where a weight vanishes: usl limits the strain by light nodes.
    steep_edge: bool
    nodes_per_cell: int = 1  # 2 with nodes between the corners of cells
    # At cell faces: crossing points then add energy, less with a smaller step.
    gradient_jumps: bool = False
    # Stable step over h/c of points at rest: updated frame, updated with the strain first (usf),
    # total.
    courant_still: float = 1.0
    courant_strained_first: float = inf
    courant_total: float = 1.0
    # h^2 / D, and the largest h^2 sum_I |grad N_I|^2 / N_I per direction, away from walls:
    # stiffness of a point alone at its nodes.
    lone: tuple[float, float] | None = None
    bears_drift: bool = False  # drifting bodies conserve energy with the step of bodies at rest
    drift_limits: DriftLimits | None = None  # None: as similar bases
    # Stored parts of a domain, in order: ``half_size`` (d numbers), ``half_edges`` (d vectors),
    # ``deformation`` (F in 2D or 3D), ``corners`` (of the basis's `element`).
    shape: tuple[str, ...] = ()


@point_function()
def locate(basis, kin, grid, place):
    """Stencil of a point: data for the functions below, computed once per point."""


@point_function()
def support(basis, kin):
    """Number of nodes of a stencil; constant when compiled."""


@point_function()
def entry(basis, kin, grid, stencil, k):
    """(node number, weight N, gradient of N) of the k-th node of a stencil.

    In axisymmetry N / r follows the gradient (`Gradient` of the kinematics). Parts of a repeated
    node are summed.
    """


@point_function()
def reach(basis, kin, grid, stencil, k):
    """X_I - x of the k-th node."""


@point_function()
def affine_weight(basis, kin, grid, stencil, k):
    """N_I D^-1 (X_I - x) of the affine transfers, with D = sum_I N_I (X_I - x)(X_I - x)^T."""


@point_function(otherwise=True)
def walled(basis, faces):
    """The basis, modified at walls inside the grid (`splines.AtWalls`)."""
    return basis


@point_function(otherwise=True)
def mapped_again(basis, grid, moment):
    """Part of the affine moment used in MUSL's second mapping."""
    return moment


def without_moment(basis, grid, moment):
    """No moment in MUSL's second mapping, because B D^-1 is unbounded where D vanishes.

    Points retain B, but their deformation omits it.
    """
    return (grid.h - grid.h) * moment


@point_function(otherwise=True)
def first_node(basis, like):
    """Offset to a position in cells whose integer part is then the first node."""
    return 0


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
    """`place` with its shape deformed by dl = dt grad v."""
    return place


@point_function(otherwise=True)
def extent(basis, kin, grid, place):
    """Cells that the domain's corners, or the nodes they scatter to, may reach."""
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
    """Nodes and weights that carry a corner: a :class:`Weighted`."""
    return ()


@point_function(otherwise=True)
def carry(basis, kin, place, corner, displacement):
    """`place` with one corner of the domain displaced."""
    return place
