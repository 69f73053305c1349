"""Taylor transfers: the point stores the velocity gradient L_p = sum_I v*_I (x) grad N_I.

The momentum given to a node is m_p N_I (v_p + L_p (X_I - x_p)), without the inverse of D, so that
any basis can be used. If D^-1 N_I (X_I - x) is the gradient (linear, Bernstein-quadratic), this is
the same as APIC; otherwise angular momentum is conserved where velocity is linear over the support.
"""

from typing import Annotated, NamedTuple

from karamelo_py.points import transfers
from karamelo_py.points.kinematics import gradient as as_gradient
from karamelo_py.points.kinematics import outer
from karamelo_py.points.transfers import Moment, TransferTraits
from karamelo_py.points.transfers.affine import zero_planar
from karamelo_py.points.transfers.flip import Share, blend, take_nodal_velocity


class TPIC(NamedTuple):
    """TPIC: v_p = v_pic, and the point stores the velocity gradient L_p.

    TPIC damps less than PIC and does not need D (Nakamura, Matsumura & Mizutani 2023, "Taylor
    particle-in-cell transfer and kernel correction for material point method"). With bases whose D
    vanishes at nodes (linear, Bernstein-quadratic), a drifting body in the updated frame gains
    energy without bounds.

    Example
    -------
    method(ulmpm, TPIC, quadratic-spline)
    """

    point_fields = (Moment,)
    traits = TransferTraits(keeps_gradient=True)
    in_lanes = True


class TFLIP(NamedTuple):
    """FLIP in which the velocity mapped to nodes is v_p + L_p (X_I - x_p), as in Karamelo.

    ``method(kind, FLIP, basis, alpha, gradient-enhanced)`` is equivalent.

    Parameters
    ----------
    alpha
        FLIP coefficient.

    Example
    -------
    method(ulmpm, TFLIP, cubic-spline, 0.99)
    """

    alpha: Annotated[float, Share]

    point_fields = (Moment,)
    traits = TransferTraits(retains=True, keeps_gradient=True)
    in_lanes = True


class MLS(NamedTuple):
    """APIC with N_I D^-1 (X_I - x), a moving least squares fit, instead of the gradient.

    The point stores the velocity gradient C = B D^-1. Nodes get the force -V sigma N_I D^-1 (X_I -
    x) (Hu et al. 2018, "A moving least squares material point method", eqs. 16 to 18). MLS
    conserves angular momentum to round-off if D is constant (splines, more than a cell from walls).

    Example
    -------
    method(ulmpm, MLS, quadratic-spline)
    """

    point_fields = (Moment,)
    traits = TransferTraits(inverts_spread=True, keeps_gradient=True)
    in_lanes = True


def nodal_momentum_taylor(transfer, pt, node):
    return node.N * pt.mass * (pt.v + pt.moment @ node.arm)


def add_moment_taylor(transfer, node, v, L):
    return L + outer(v, node.strain_N.planar())


def kept_velocity_gradient(transfer, L, inverse_d):
    return L


for _transfer in (TPIC, TFLIP, MLS):
    transfers.nodal_momentum.on(_transfer)(nodal_momentum_taylor)
    transfers.add_moment.on(_transfer)(add_moment_taylor)
    transfers.affine_velocity.on(_transfer)(kept_velocity_gradient)
    transfers.zero_moment.on(_transfer)(zero_planar)

take_nodal_velocity(TPIC)
blend(TFLIP)
take_nodal_velocity(MLS)


@transfers.gradient_weight.on(MLS)
def _gradient_weight_mls(transfer, node):
    moved = node.affine_N
    return as_gradient(node.kin, [*moved, *node.grad_N[len(moved) :]])


@transfers.by_arms.on(MLS)
def _by_arms_mls(transfer, inverse_d):
    return inverse_d


# C is the velocity gradient except for the hoop part; one gather serves both if both use v*.


@transfers.forces_by_arms.on(MLS)
def _forces_by_arms_mls(transfer, kin):
    return not kin.hoops


@transfers.straining.on(MLS)
def _straining_mls(transfer, kin, gradient):
    return gradient if kin.hoops else ()
