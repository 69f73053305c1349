"""Bases: which nodes a point sees, with what weights and gradients. One file each.

A basis is a NamedTuple of numbers (its class is the tag) with the point functions declared here.
A basis that is the product of one function a direction gives only `along` and calls
:func:`karamelo_py.points.basis.product.register`.
"""

from karamelo_py.compile import point_function


@point_function(tags=2)
def locate(basis, kin, x):
    """The stencil of a point at `x`: whatever the functions below need, computed once a point."""


@point_function(tags=2)
def inside(basis, kin, x):
    """Whether a point at `x` lies on the grid, so that all nodes of its stencil exist."""


@point_function(tags=2)
def support(basis, kin):
    """The number of nodes a point sees; a constant at compile time."""


@point_function(tags=2)
def entry(basis, kin, stencil, k):
    """(node number, weight N, gradient dN/dx as a vector) of the k-th node of a stencil."""


@point_function(tags=2)
def reach(basis, kin, stencil, k):
    """X_I - x, the vector from the point to the k-th node of its stencil."""


@point_function(tags=2)
def affine_weight(basis, kin, stencil, k):
    """N_I D^-1 (X_I - x) of the affine transfers, with D = sum_I N_I (X_I - x)(X_I - x)^T."""


@point_function()
def mapped_again(basis, moment):
    """The part of a point's moment of velocity that MUSL maps to the nodes the second time."""
