"""Convected particle domain interpolation: a point sees the nodes around the corners of its domain.

Over the domain of a point, each basis function is replaced by a simple function through its values
at the corners x_c (Sadeghirad, Brannon & Burghardt 2011; Sadeghirad, Brannon & Guilkey 2013):

    N_I = sum_c w_c N_I^lin(x_c),    grad N_I = sum_c g_c N_I^lin(x_c)

with the means w_c and g_c, over the domain, of the function of corner c and of its gradient. The
domains tile the body however far it stretches, so that it does not break between points.

A family of domains is one file; it gives only :func:`domain`, its place, and calls
:func:`karamelo_py.points.basis.cpdi.corners.register`.
"""

from karamelo_py.compiler.compile import point_function


@point_function(tags=2)
def domain(basis, kin, place):
    """Corners x_c, weights w_c and gradients g_c of the domain of a point, a tuple each."""
