"""APIC: the point keeps the moment of the nodal velocity beside its mean (Jiang et al. 2015)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.points.basis import affine_weight, reach
from karamelo_py.points.kinematics import add_outer, tensor_dot, zero_tensor
from karamelo_py.points.transfers import (
    add_moment,
    add_momentum,
    updated_velocity,
    zero_moment,
)
from karamelo_py.tensors import add_scaled, scale


class APIC(NamedTuple):
    """v_p = v_pic, and B_p = sum N_I v*_I (X_I - x_p)^T travels with the point.

    Conserves linear and angular momentum to round-off. The point gives the node
    m_p (N_I v_p + B_p N_I D^-1 (X_I - x_p)); keeping B rather than B D^-1 makes that exact for
    linear functions too, whose D changes with the place in the cell
    (Jiang, Schroeder & Teran 2017, eqs. 15 to 18).

    With linear functions D vanishes at the nodes: the velocity that deforms the points leaves the
    moments out under musl; usl and usf are unstable with it, and a run says so.

    Example
    -------
    method(ulmpm, APIC, linear)
    """

    keeps_moment = True


@updated_velocity.on(APIC)
def _(transfer, v, v_pic, dv):
    return v_pic


@add_momentum.on(APIC)
def _(transfer, kin, basis, stencil, k, weighted_mass, mass, v, moment, total):
    affine = affine_weight(basis, kin, stencil, k)
    mean = add_scaled(total, weighted_mass, v)
    return add_scaled(mean, mass, tensor_dot(kin, moment, affine))


@zero_moment.on(APIC)
def _(transfer, kin, like):
    return zero_tensor(kin, like)


@add_moment.on(APIC)
def _(transfer, kin, basis, stencil, k, weight, velocity, moment):
    arm = reach(basis, kin, stencil, k)
    return add_outer(kin, moment, scale(weight, velocity), arm)
