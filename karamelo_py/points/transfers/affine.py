"""Affine transfers: the point keeps the moment of velocity B beside its velocity.

B_p = sum_I N_I v*_I (X_I - x_p)^T, and the point gives the node
m_p (N_I v_p + B_p N_I D^-1 (X_I - x_p)). Keeping B rather than C = B D^-1 conserves angular
momentum to round-off for functions whose D changes with the place in the cell, too
(Jiang, Schroeder & Teran 2017, "An angular momentum conserving affine-particle-in-cell method",
eqs. 15 to 18).
"""

from typing import Annotated, NamedTuple

from karamelo_py.compiler.compile import where
from karamelo_py.language.kinds import In
from karamelo_py.language.rules import known_failure
from karamelo_py.points import transfers
from karamelo_py.points.basis import affine_weight, reach
from karamelo_py.points.kinematics import outer, planar, zero
from karamelo_py.points.laws import jacobian
from karamelo_py.points.transfers import Moment
from karamelo_py.points.transfers.flip import Share, blend, swings, take_nodal_velocity

COMPRESSED = 1e-3  # share of its volume that a point has to lose to go with the grid
SEPARATE = 0.1  # strength of separation that elastic bodies bear


class APIC(NamedTuple):
    """v_p = v_pic, and B_p = sum N_I v*_I (X_I - x_p)^T travels with the point.

    Conserves linear and angular momentum to round-off, and damps what lies below a cell (Jiang et
    al. 2015).

    With functions whose D vanishes at nodes (linear, Bernstein-quadratic) in the updated frame, the
    velocity that deforms the points omits the moments. This needs musl. usl and usf are refused.

    Example
    -------
    method(ulmpm, APIC, quadratic-spline)
    """

    point_fields = (Moment,)
    inverts_spread = True
    in_lanes = True


class AFLIP(NamedTuple):
    """FLIP's mean velocity, and the moment of velocity of APIC.

    Less noise than FLIP and less damping than APIC (Fei, Guo, Wu, Huang & Gao 2021, "Revisiting
    integration in the material point method", section 4).

    Parameters
    ----------
    alpha
        Share of FLIP.

    Example
    -------
    method(ulmpm, AFLIP, quadratic-spline, 0.99)
    """

    alpha: Annotated[float, Share]

    point_fields = (Moment,)
    inverts_spread = True
    in_lanes = True


class ASFLIP(NamedTuple):
    """AFLIP whose points move with velocities of their own where they come apart.

    For granular flow and splashes: points that the grid holds together separate sooner (Fei et al.
    2021, section 5). Where the material is compressed by more than a thousandth of its volume,
    points move with the grid and keep their order.

    Parameters
    ----------
    alpha
        Share of FLIP.
    beta
        Strength of separation: the share of a point's velocity relative to the grid that also moves
        it, where the material is not compressed. 0 is AFLIP.

    Example
    -------
    method(ulmpm, ASFLIP, quadratic-spline, 0.97)
    method(ulmpm, ASFLIP, quadratic-spline, 0.97, 0.1)

    Notes
    -----
    The points of a solid under tension lose their order, although it does not come apart. Two
    elastic rings that meet at 30 m/s rebound at 22.5 m/s with AFLIP. With a share of 0.97 they
    rebound at 22.2 (beta = 0.1), 18.4 (0.3), 13.7 (0.5), 7.5 (0.7) and 2.7 m/s (1).
    """

    alpha: Annotated[float, Share]
    beta: Annotated[float, In(0, 1)] = 1.0

    point_fields = (Moment,)
    inverts_spread = True
    in_lanes = True


known_failure(
    ASFLIP,
    "loose points",
    when=lambda asflip, scene: asflip.beta > SEPARATE and scene.moves and bool(scene.elastic),
    reason="ASFLIP moves points apart where they are not pressed together, and solid "
    "'{scene.elastic[0].id}' bears tension: its points lose their places (two rings that bounce "
    "keep a tenth of their speed, with beta = 0.1 as much as with AFLIP)",
    cure=f"AFLIP in the place of ASFLIP, or beta = {SEPARATE:g} behind its share",
)


transfers.known_volume.on(ASFLIP)(lambda transfer, law, kin, state: jacobian(law, kin, state))


@transfers.displacing_velocity.on(ASFLIP)
def _displacing_velocity_asflip(transfer, v, v_pic, j):
    beta = where(1 - j < COMPRESSED, transfer.beta, 0)
    return v_pic + beta * (v - v_pic)


def nodal_momentum_affine(transfer, kin, basis, grid, stencil, k, weight, mass, v, B):
    return weight * mass * v + mass * (B @ affine_weight(basis, kin, grid, stencil, k))


def add_moment_affine(transfer, kin, basis, grid, stencil, k, weight, gradient, v, B):
    return B + outer(weight * v, reach(basis, kin, grid, stencil, k))


def affine_velocity_of_moment(transfer, B, inverse_d):
    return inverse_d[0] * B if len(inverse_d) else ()


def zero_planar(transfer, kin, like):
    return zero(planar(kin), like)


def by_arms_alone(transfer, inverse_d):
    return (1.0,)


for _transfer in (APIC, AFLIP, ASFLIP):
    _transfer.keeps_gradient = False
    transfers.nodal_momentum.on(_transfer)(nodal_momentum_affine)
    transfers.add_moment.on(_transfer)(add_moment_affine)
    transfers.affine_velocity.on(_transfer)(affine_velocity_of_moment)
    transfers.zero_moment.on(_transfer)(zero_planar)
    transfers.by_arms.on(_transfer)(by_arms_alone)

take_nodal_velocity(APIC)
blend(AFLIP)
blend(ASFLIP)
swings(ASFLIP)
