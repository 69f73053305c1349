"""What the affine transfers share: the moment of velocity B that a point keeps.

B_p = sum_I N_I v*_I (X_I - x_p)^T, and the point gives the node
m_p (N_I v_p + B_p N_I D^-1 (X_I - x_p)). Keeping B rather than C = B D^-1 conserves angular
momentum to round-off for functions whose D changes with the place in the cell, too
(Jiang, Schroeder & Teran 2017, "An angular momentum conserving affine-particle-in-cell method",
eqs. 15 to 18).
"""

from karamelo_py.compiler.tuples import add_scaled, scale
from karamelo_py.points.basis import affine_weight, reach
from karamelo_py.points.kinematics import add_outer, planar, tensor_dot, zero_tensor
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
    def _add_momentum_transfer(
        transfer, kin, basis, grid, stencil, k, weight, mass, v, moment, total
    ):
        affine = affine_weight(basis, kin, grid, stencil, k)
        mean = add_scaled(total, weight * mass, v)
        return add_scaled(mean, mass, tensor_dot(planar(kin), moment, affine))

    @affine_velocity.on(transfer)
    def _affine_velocity_transfer(transfer, moment, inverse_d):
        return scale(inverse_d[0], moment) if len(inverse_d) else ()

    @zero_moment.on(transfer)
    def _zero_moment_transfer(transfer, kin, like):
        return zero_tensor(planar(kin), like)

    @by_arms.on(transfer)
    def _by_arms_transfer(transfer, inverse_d):
        return (1.0,)

    @add_moment.on(transfer)
    def _add_moment_transfer(
        transfer, kin, basis, grid, stencil, k, weight, gradient, velocity, moment
    ):
        arm = reach(basis, kin, grid, stencil, k)
        return add_outer(planar(kin), moment, scale(weight, velocity), arm)
