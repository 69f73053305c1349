"""Base of the Taylor transfers: the gradient of velocity that a point keeps.

The point gives the node m_p N_I (v_p + L_p (X_I - x_p)), with L_p = sum_I v*_I (x) grad N_I: no D
is inverted, so that every basis will do. Where D^-1 N_I (X_I - x) is the gradient (linear,
Bernstein-quadratic) this is APIC in another form, and angular momentum is conserved as far as D
stays the same; for splines as far as velocity is linear over their support.
"""

from karamelo_py.points.basis import reach
from karamelo_py.points.kinematics import outer
from karamelo_py.points.transfers import add_moment, affine_velocity, nodal_momentum, zero_moment
from karamelo_py.points.transfers.affine import zero_planar


def nodal_momentum_taylor(transfer, kin, basis, grid, stencil, k, weight, mass, v, L):
    """See `nodal_momentum`."""
    return weight * mass * (v + L @ reach(basis, kin, grid, stencil, k))


def add_moment_taylor(transfer, kin, basis, grid, stencil, k, weight, gradient, v, L):
    """See `add_moment`."""
    return L + outer(v, gradient.planar())


def kept_velocity_gradient(transfer, L, inverse_d):
    """See `affine_velocity`."""
    return L


def register(transfer: type) -> None:
    """Let the points of `transfer` keep the gradient of velocity and map it with their velocity."""
    transfer.keeps_gradient = True
    nodal_momentum.on(transfer)(nodal_momentum_taylor)
    add_moment.on(transfer)(add_moment_taylor)
    affine_velocity.on(transfer)(kept_velocity_gradient)
    zero_moment.on(transfer)(zero_planar)
