"""Base of the affine transfers: the moment of velocity B that a point keeps.

B_p = sum_I N_I v*_I (X_I - x_p)^T, and the point gives the node
m_p (N_I v_p + B_p N_I D^-1 (X_I - x_p)). Keeping B rather than C = B D^-1 conserves angular
momentum to round-off for functions whose D changes with the place in the cell, too
(Jiang, Schroeder & Teran 2017, "An angular momentum conserving affine-particle-in-cell method",
eqs. 15 to 18).
"""

from karamelo_py.points.basis import affine_weight, reach
from karamelo_py.points.kinematics import outer, planar, zero
from karamelo_py.points.transfers import (
    add_moment,
    affine_velocity,
    by_arms,
    nodal_momentum,
    zero_moment,
)


def nodal_momentum_affine(transfer, kin, basis, grid, stencil, k, weight, mass, v, B):
    """See `nodal_momentum`."""
    return weight * mass * v + mass * (B @ affine_weight(basis, kin, grid, stencil, k))


def add_moment_affine(transfer, kin, basis, grid, stencil, k, weight, gradient, v, B):
    """See `add_moment`."""
    return B + outer(weight * v, reach(basis, kin, grid, stencil, k))


def affine_velocity_of_moment(transfer, B, inverse_d):
    """See `affine_velocity`."""
    return inverse_d[0] * B if len(inverse_d) else ()


def zero_planar(transfer, kin, like):
    """See `zero_moment`."""
    return zero(planar(kin), like)


def by_arms_alone(transfer, inverse_d):
    """See `by_arms`."""
    return (1.0,)


def register(transfer: type) -> None:
    """Let the points of `transfer` keep the moment of velocity and map it with their velocity."""
    transfer.keeps_gradient = False
    nodal_momentum.on(transfer)(nodal_momentum_affine)
    add_moment.on(transfer)(add_moment_affine)
    affine_velocity.on(transfer)(affine_velocity_of_moment)
    zero_moment.on(transfer)(zero_planar)
    by_arms.on(transfer)(by_arms_alone)
