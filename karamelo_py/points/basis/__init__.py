"""Bases: the nodes in a point's stencil, with weights and gradients, one file each.

A basis is a NamedTuple of parameters with `traits` and the point functions declared here. `grid` is
the point's :class:`~karamelo_py.points.grid.Grid`, `location` a flat tuple of position and stored
domain shape, `stencil` the result of `locate`. A basis that is a product of one function per
direction needs only `along` and :func:`karamelo_py.points.basis.product.register`. A basis with
corners needs an `element` (:class:`~karamelo_py.points.basis.cpdi.Element`).
"""

from math import inf
from typing import NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.points.noise import DriftLimits


class BasisTraits(NamedTuple):
    cells: int  # number of cells between the outermost nodes of points in one cell
    least_nodes: int  # least number of nodes per direction of a grid
    steady_moment: bool  # D of affine transfers never vanishes
    # |grad N|^2 / N exceeds 2 / h^2 as the weight vanishes: usl limits the strain of light nodes.
    steep_edge: bool
    nodes_per_cell: int = 1  # 2 for a basis with mid-nodes
    # gradients jump at cell faces; points that cross add energy, less with smaller steps
    gradient_jumps: bool = False
    # Stable c dt / h at low speed: updated frame, updated frame with usf, total frame.
    courant_still: float = 1.0
    courant_strained_first: float = inf
    courant_total: float = 1.0
    # For the stiffness of an isolated point, away from walls: h^2 / D, max h^2 sum_I |grad N_I|^2 /
    # N_I per direction, and a number from the eigenvalues of a usl step with D.
    lone: tuple[float, float, float] | None = None
    # D / h^2, or None if it varies. Mapping to the nodes and back damps waves in proportion to D.
    spread: float | None = None
    # Fraction of the stable step with corrected accelerations (updated frame).
    corrected_fraction: float = 0.8
    allows_drift: bool = False  # drifting bodies conserve energy at the full stable step
    drift_limits: DriftLimits | None = None  # None: the limits of similar bases
    # Stored domain data, in order: ``half_size`` (d numbers), ``half_edges`` (d vectors),
    # ``deformation`` (F in 2D or 3D), ``corners`` (of the `element`)
    shape: tuple[str, ...] = ()


@point_function()
def locate(basis, kin, grid, location):
    """Return the stencil of a point, for the functions below."""


@point_function()
def support(basis, kin):
    """Return the number of nodes in a stencil, constant when compiled."""


@point_function()
def entry(basis, kin, grid, stencil, k):
    """Return (node number, weight N, gradient of N) of a stencil's k-th node.

    Around an axis or centre the gradient is followed by N / r. If a node occurs more than once, its
    entries must be added.
    """


@point_function()
def reach(basis, kin, grid, stencil, k):
    """Return X_I - x of the k-th node."""


@point_function()
def affine_weight(basis, kin, grid, stencil, k):
    """Return N_I D^-1 (X_I - x), where D = sum_I N_I (X_I - x)(X_I - x)^T."""


@point_function(otherwise=True)
def walled(basis, faces):
    """Return the basis modified at walls inside the grid (`splines.AtWalls`)."""
    return basis


@point_function(otherwise=True)
def mapped_again(basis, grid, moment):
    """Return the affine moment for MUSL's second mapping."""
    return moment


def without_moment(basis, grid, moment):
    """For MUSL's second mapping, return no moment, as B D^-1 is unbounded where D vanishes.

    Points retain B, but their deformation does not include B.
    """
    return (grid.h - grid.h) * moment


@point_function(otherwise=True)
def first_node(basis, template):
    """Return an offset: the index of the first node is the integer part of position + offset."""
    return 0


def shape_size(basis: type, d: int) -> int:
    shape = basis.traits.shape
    corners = basis.element.corners if "corners" in shape else 0
    sizes = {"half_size": d, "half_edges": d * d, "deformation": d * d, "corners": corners * d}
    return sum(sizes[name] for name in shape)


def blank(basis, kin, x):
    return (*x, *((x[0] - x[0],) * shape_size(type(basis), len(x))))


@point_function(otherwise=True)
def deformed(basis, kin, location, dl):
    """Return `location` with its shape deformed by dl = dt grad v."""
    return location


@point_function(otherwise=True)
def extent(basis, kin, grid, location):
    """Return the distance in cells from a point to its domain's corners, or to their nodes."""
    return grid.h - grid.h


@point_function(otherwise=True)
def carried(basis, kin):
    """Return the number of corners that the grid moves, constant when compiled."""
    return 0


@point_function(otherwise=True)
def placed(basis, kin):
    """Return the number of corners stored as positions."""
    return 0


@point_function(otherwise=True)
def carrier(basis, kin, grid, stencil, corner):
    """Return the nodes and weights that move a corner, a :class:`Weighted`."""
    return ()


@point_function(otherwise=True)
def carry(basis, kin, location, corner, displacement):
    """Return `location` with one displaced corner."""
    return location
