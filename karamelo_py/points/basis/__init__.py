"""Bases: which nodes a point sees, with what weights and gradients. One file each.

A basis is a NamedTuple of its own numbers, often empty (its class is the tag), with the point
functions declared here. What they work on:

grid
    the :class:`~karamelo_py.points.grid.Grid` under the point;
place
    a flat tuple: the position of the point, then what the basis keeps of the shape of its domain
    (nothing, half sizes, corners ...);
stencil
    whatever `locate` returned.

A basis that is a product of one function per direction gives only `along` and calls
:func:`karamelo_py.points.basis.product.register`. This also sets the defaults of these attributes:

cells
    number of cells that the nodes of all points of a cell span (1: the corners of the cell only);
nodes_per_cell
    1, or 2 where there are nodes between the corners of cells;
least_nodes
    smallest number of nodes of the grid per direction;
steady_moment
    whether D of the affine transfers stays away from zero everywhere;
gradient_jumps
    whether gradients jump at the faces of cells (default: no). Points that cross cells then add
    energy to a body. A smaller step adds less;
courant_still, courant_total
    the stable step over h/c while points stay at their places, in the updated frame, and in the
    total frame (default: 1);
courant_strained_first
    bound of `courant_still` where the strain comes before the forces, as in usf (default: none);
lone
    stiffness of a point with no other point at its nodes, for functions with smooth gradients: h^2
    / D and the largest h^2 sum_I |grad N_I|^2 / N_I per direction, away from walls;
bears_drift
    whether drifting bodies keep their energy with the step of bodies at rest, also with musl and
    usf (default: no);
borne
    how far bodies may drift and turn and keep their energy (`noise.Borne`; default: that of similar
    functions);
steep_edge
    whether |grad N|^2 / N exceeds 2 / h^2 per direction where a weight vanishes. usl then limits
    the effect of light nodes on the strain.

A basis whose points have domains lists what a place keeps of them, and thus the initial arrays:

shape
    names of its parts, in their order: ``half_size`` (d numbers), ``half_edges`` (d vectors),
    ``deformation`` (F in the plane or in space) and ``corners`` (of its `element`, an
    :class:`~karamelo_py.points.basis.cpdi.Element`).
"""

from karamelo_py.compiler.compile import point_function


@point_function()
def locate(basis, kin, grid, place):
    """The stencil of a point: whatever the functions below need, computed once per point."""


@point_function()
def support(basis, kin):
    """The number of nodes a point sees; a constant at compile time."""


@point_function()
def entry(basis, kin, grid, stencil, k):
    """(node number, weight N, gradient of N) of the k-th node of a stencil.

    The gradient is a vector; axisymmetric with N / r behind (`Gradient` of the kinematics). A node
    may come more than once: its parts add up.
    """


@point_function()
def reach(basis, kin, grid, stencil, k):
    """X_I - x, the vector from the point to the k-th node of its stencil."""


@point_function()
def affine_weight(basis, kin, grid, stencil, k):
    """N_I D^-1 (X_I - x) of the affine transfers, with D = sum_I N_I (X_I - x)(X_I - x)^T."""


@point_function(otherwise=True)
def walled(basis, faces):
    """The same basis, modified at walls inside the grid (see `splines.AtWalls`), too."""
    return basis


@point_function(otherwise=True)
def mapped_again(basis, grid, moment):
    """The part of a point's moment of velocity that MUSL maps to the nodes the second time."""
    return moment


def leave_moment_out(basis, grid, moment):
    """Map no moment again: B D^-1 grows without bound where D vanishes.

    The velocity that deforms the points leaves it out; they keep B, so that nothing is lost.
    """
    return (grid.h - grid.h) * moment


@point_function(otherwise=True)
def first_node(basis, like):
    """Return the offset of a position in cells after which its whole part is its first node."""
    return 0


# --- the shape of a point's domain ------------------------------------------------------------


def shape_size(basis: type, d: int) -> int:
    """Count the numbers that a place has behind the position, in `d` dimensions."""
    shape = getattr(basis, "shape", ())
    corners = basis.element.corners if "corners" in shape else 0
    sizes = {"half_size": d, "half_edges": d * d, "deformation": d * d, "corners": corners * d}
    return sum(sizes[part] for part in shape)


def blank(basis, kin, x):
    """A place at position `x` with a shape of zeros."""
    return (*x, *((x[0] - x[0],) * shape_size(type(basis), len(x))))


@point_function(otherwise=True)
def deformed(basis, kin, place, dl):
    """`place` after the increment dl = dt grad v: its shape changes, not its position."""
    return place


@point_function(otherwise=True)
def extent(basis, kin, grid, place):
    """Return the reach of the corners of the point's domain, in cells; 0 where none are kept.

    Or how far the nodes lie that they may give to, if that is further.
    """
    return grid.h - grid.h


@point_function(otherwise=True)
def carried(basis, kin):
    """Count the corners of the domain that move with the grid; constant at compile time."""
    return 0


@point_function(otherwise=True)
def placed(basis, kin):
    """Count the corners that a place keeps by their positions, right behind the point's own."""
    return 0


@point_function(otherwise=True)
def carrier(basis, kin, grid, stencil, corner):
    """The nodes that carry a corner, and their weights: a :class:`Weighted`."""
    return ()


@point_function(otherwise=True)
def carry(basis, kin, place, old, corner, displacement):
    """`place` with the displacement of one corner of the domain; `old` is the place before all."""
    return place
