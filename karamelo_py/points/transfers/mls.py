"""MLS: APIC with strains and forces from the same moments (Hu et al. 2018)."""

from typing import NamedTuple

from karamelo_py.points.basis import affine_weight
from karamelo_py.points.kinematics import Line, PlaneStrain, Space
from karamelo_py.points.kinematics import gradient as as_gradient
from karamelo_py.points.transfers import (
    Moment,
    by_arms,
    forces_by_arms,
    gradient_weight,
    kept_gradient,
    straining,
    take_nodal_velocity,
    taylor,
)


class MLS(NamedTuple):
    """APIC; N_I D^-1 (X_I - x), a moving least squares fit, stands for the gradient everywhere.

    The point keeps the velocity gradient C = B D^-1, and its force on a node is
    -V sigma N_I D^-1 (X_I - x) (Hu et al. 2018, "A moving least squares material point method",
    eqs. 16 to 18). Angular momentum is conserved to round-off where D is constant: with splines,
    more than a cell away from the walls.

    Example
    -------
    method(ulmpm, MLS, quadratic-spline)
    """

    point_fields = (Moment,)
    inverts_spread = True
    in_lanes = True


@gradient_weight.on(MLS)
def _gradient_weight_mls(transfer, basis, kin, grid, stencil, k, gradient):
    # The hoop part N / r of an axisymmetric one stays.
    moved = affine_weight(basis, kin, grid, stencil, k)
    return as_gradient(kin, [*moved, *gradient[len(moved) :]])


@forces_by_arms.on(MLS, Line)
@forces_by_arms.on(MLS, PlaneStrain)
@forces_by_arms.on(MLS, Space)
def _forces_by_arms_mls_space(transfer, kin):
    return True


@by_arms.on(MLS)
def _by_arms_mls(transfer, inverse_d):
    return inverse_d


# The velocity gradient is what the point keeps: gathered once where both come from v*.
# Axisymmetric, the hoop part is missing in it.
@straining.on(MLS, Line)
@straining.on(MLS, PlaneStrain)
@straining.on(MLS, Space)
def _straining_mls_space(transfer, kin, gradient):
    return ()


@kept_gradient.on(MLS, Line)
@kept_gradient.on(MLS, PlaneStrain)
@kept_gradient.on(MLS, Space)
def _kept_gradient_mls_space(transfer, kin, moment, gradient):
    return moment


taylor.register(MLS)


take_nodal_velocity(MLS)
