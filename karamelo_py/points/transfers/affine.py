"""What the affine transfers share: the moment of velocity B that a point keeps.

B_p = sum_I N_I v*_I (X_I - x_p)^T, and the point gives the node
m_p (N_I v_p + B_p N_I D^-1 (X_I - x_p)). Keeping B rather than C = B D^-1 conserves angular
momentum to round-off for functions whose D changes with the place in the cell, too
(Jiang, Schroeder & Teran 2017, "An angular momentum conserving affine-particle-in-cell method",
eqs. 15 to 18).
"""

from karamelo_py.points.basis import affine_weight, reach
from karamelo_py.points.kinematics import planar
from karamelo_py.points.kinematics.tensors import outer, vector, zero
from karamelo_py.points.transfers import (
    add_moment,
    add_momentum,
    affine_velocity,
    by_arms,
    zero_moment,
)


def register(transfer: type) -> None:
    """Let the points of `transfer` keep the moment of velocity and map it with their velocity."""
    transfer.keeps_gradient = False

    @add_momentum.on(transfer)
    def _add_momentum_transfer(transfer, kin, basis, grid, stencil, k, weight, mass, v, B, total):
        flat = planar(kin)
        affine = vector(flat, affine_weight(basis, kin, grid, stencil, k))
        return vector(flat, total) + weight * mass * vector(flat, v) + mass * (B @ affine)

    @affine_velocity.on(transfer)
    def _affine_velocity_transfer(transfer, B, inverse_d):
        return inverse_d[0] * B if len(inverse_d) else ()

    @zero_moment.on(transfer)
    def _zero_moment_transfer(transfer, kin, like):
        return zero(planar(kin), like)

    @by_arms.on(transfer)
    def _by_arms_transfer(transfer, inverse_d):
        return (1.0,)

    @add_moment.on(transfer)
    def _add_moment_transfer(transfer, kin, basis, grid, stencil, k, weight, gradient, v, B):
        arm = vector(planar(kin), reach(basis, kin, grid, stencil, k))
        return B + outer(weight * vector(planar(kin), v), arm)
