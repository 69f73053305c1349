"""What the Taylor transfers share: the gradient of velocity that a point keeps.

The point gives the node m_p N_I (v_p + L_p (X_I - x_p)), with L_p = sum_I v*_I (x) grad N_I: no D
is inverted, so that every basis will do. Where D^-1 N_I (X_I - x) is the gradient (linear,
Bernstein-quadratic) this is APIC in another form, and angular momentum is conserved as far as D
stays the same; for splines as far as velocity is linear over their support.
"""

from karamelo_py.compiler.tuples import add, add_scaled
from karamelo_py.points.basis import reach
from karamelo_py.points.kinematics import add_outer, planar, tensor_dot, zero_tensor
from karamelo_py.points.transfers import add_moment, add_momentum, affine_velocity, zero_moment


def register(transfer: type) -> None:
    """Let the points of `transfer` keep the gradient of velocity and map it with their velocity."""
    transfer.keeps_gradient = True

    @add_momentum.on(transfer)
    def _add_momentum_transfer(
        transfer, kin, basis, grid, stencil, k, weight, mass, v, moment, total
    ):
        arm = reach(basis, kin, grid, stencil, k)
        return add_scaled(total, weight * mass, add(v, tensor_dot(planar(kin), moment, arm)))

    @affine_velocity.on(transfer)
    def _affine_velocity_transfer(transfer, moment, inverse_d):
        return moment

    @zero_moment.on(transfer)
    def _zero_moment_transfer(transfer, kin, like):
        return zero_tensor(planar(kin), like)

    @add_moment.on(transfer)
    def _add_moment_transfer(
        transfer, kin, basis, grid, stencil, k, weight, gradient, velocity, moment
    ):
        return add_outer(planar(kin), moment, velocity, gradient)
