"""Convected particle domain interpolation: a point sees the nodes around the corners of its domain.

Over the domain of a point, each basis function is replaced by a simple function through its values
at the corners x_c (Sadeghirad, Brannon & Burghardt 2011; Sadeghirad, Brannon & Guilkey 2013):

    N_I = sum_c w_c N_I^lin(x_c),    grad N_I = sum_c g_c N_I^lin(x_c)

with the means w_c and g_c, over the domain, of the function of corner c and of its gradient. The
domains tile the body however far it stretches, so that it does not break between points.

A family of domains is one file; it gives only :func:`domain`, its place, and calls
:func:`karamelo_py.points.basis.cpdi.corners.register`.
"""

from typing import NamedTuple

from karamelo_py.compiler.compile import point_function


class Element(NamedTuple):
    """The kind of element whose corners a family of domains keeps."""

    kind: str  # what meshes call it
    corners: int
    edges: tuple[tuple[int, int], ...]  # between corners; their determinant must be positive
    mirrored: tuple[int, ...]  # the order of corners for elements of which it is negative
    box: tuple[tuple[int, ...], ...] = ()  # corners of the box of side 2 around 0, where it is one


class ConvectedDomain(NamedTuple):
    """Base of these bases; they add `dimension`, `shape` and, for `corners`, `element`."""

    cells = 3
    nodes_per_cell = 1
    least_nodes = 2
    steady_moment = True
    steep_edge = False
    in_lanes = True
    element = None


# By dimension, the cells that domains count as reaching at least: in the plane points give to the
# nodes next to them at once.
LEAST = (0.0, 0.0, 0.5, 0.0)
# Corners in the order of a mesh: around the square; around the lower face of the cube and the upper
SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1))
CUBE = tuple((*corner, z) for z in (-1, 1) for corner in SQUARE)


@point_function(tags=2)
def domain(basis, kin, place):
    """Corners x_c, weights w_c and gradients g_c of the domain of a point, a tuple each."""


@point_function()
def upright(basis, kin, place):
    """Check that the domain is nowhere folded over: the Jacobian is positive at every corner."""
