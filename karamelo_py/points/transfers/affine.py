"""Affine transfers: the point stores the moment B = sum_I N_I v*_I (X_I - x_p)^T of velocity.

A point gives a node m_p (N_I v_p + B_p N_I D^-1 (X_I - x_p)). Unlike C = B D^-1, B conserves
angular momentum to round-off even if D varies within the cell (Jiang, Schroeder & Teran 2017, "An
angular momentum conserving affine-particle-in-cell method", eqs. 15 to 18).
"""

from typing import Annotated, NamedTuple

from karamelo_py.compiler import where
from karamelo_py.language.kinds import In
from karamelo_py.language.rules import known_failure
from karamelo_py.points import transfers
from karamelo_py.points.kinematics import outer, planar, zero
from karamelo_py.points.laws import jacobian
from karamelo_py.points.transfers import Moment, TransferTraits
from karamelo_py.points.transfers.flip import Share, blend, take_nodal_velocity, warn_of_vibrations

COMPRESSED = 1e-3  # volume strain above which a compressed point moves with the grid
SEPARATE = 0.1  # tolerated separation of elastic bodies


class APIC(NamedTuple):
    """APIC: v_p = v_pic, and the point stores B_p = sum N_I v*_I (X_I - x_p)^T.

    APIC conserves linear and angular momentum to round-off, and damps motion below the cell size
    (Jiang et al. 2015).

    In the updated frame, with bases whose D vanishes at nodes (linear, Bernstein-quadratic),
    moments are omitted from the velocity that strains points, which requires musl. With splines,
    points at less than h/6 from a wall lose a part of the velocity gradient normal to it.

    Example
    -------
    method(ulmpm, APIC, quadratic-spline)
    """

    point_fields = (Moment,)
    traits = TransferTraits(inverts_spread=True)
    in_lanes = True


class AFLIP(NamedTuple):
    """FLIP's mean velocity with APIC's moment.

    AFLIP has less noise than FLIP and less damping than APIC (Fei, Guo, Wu, Huang & Gao 2021,
    "Revisiting integration in the material point method", section 4).

    Parameters
    ----------
    alpha
        FLIP coefficient.

    Example
    -------
    method(ulmpm, AFLIP, quadratic-spline, 0.99)
    """

    alpha: Annotated[float, Share]

    point_fields = (Moment,)
    traits = TransferTraits(inverts_spread=True, retains=True)
    in_lanes = True


class ASFLIP(NamedTuple):
    """AFLIP in which points need not move with the grid velocity where the material separates.

    Use it for granular flow and splashes (Fei et al. 2021, section 5). Points compressed by more
    than 0.1 % of their volume move with the grid.

    Parameters
    ----------
    alpha
        FLIP coefficient.
    beta
        Separation: fraction of their velocity relative to the grid with which uncompressed points
        move. With 0 the transfer is AFLIP.

    Example
    -------
    method(ulmpm, ASFLIP, quadratic-spline, 0.97)
    method(ulmpm, ASFLIP, quadratic-spline, 0.97, 0.1)

    Notes
    -----
    In solids under tension, points become disordered. Two elastic rings that collide at 30 m/s
    rebound at 22.5 m/s with AFLIP; with ASFLIP and a FLIP coefficient of 0.97 at 22.2 (beta = 0.1),
    18.4 (0.3), 13.7 (0.5), 7.5 (0.7) and 2.7 m/s (1).
    """

    alpha: Annotated[float, Share]
    beta: Annotated[float, In(0, 1)] = 1.0

    point_fields = (Moment,)
    traits = TransferTraits(inverts_spread=True, retains=True)
    in_lanes = True


known_failure(
    ASFLIP,
    "loose points",
    when=lambda asflip, scene: asflip.beta > SEPARATE and scene.moves and bool(scene.elastic),
    reason="ASFLIP separates points that are not compressed, and solid '{scene.elastic[0].id}' "
    "sustains tension: its points become disordered (two bouncing rings retain 10 % of their "
    "speed; with beta = 0.1 as much as with AFLIP)",
    cure=f"AFLIP instead of ASFLIP, or beta = {SEPARATE:g} after the FLIP coefficient",
)


@transfers.known_volume.on(ASFLIP)
def _known_volume_asflip(transfer, law, kin, state):
    return jacobian(law, kin, state)


@transfers.displacing_velocity.on(ASFLIP)
def _displacing_velocity_asflip(transfer, v, v_pic, j):
    beta = where(1 - j < COMPRESSED, transfer.beta, 0)
    return v_pic + beta * (v - v_pic)


def nodal_momentum_affine(transfer, pt, node):
    return node.N * pt.mass * pt.v + pt.mass * (pt.moment @ node.affine_N)


def add_moment_affine(transfer, node, v, B):
    return B + outer(node.N * v, node.arm)


def affine_velocity_of_moment(transfer, B, inverse_d):
    return inverse_d[0] * B if len(inverse_d) else ()


def zero_planar(transfer, kin, template):
    return zero(planar(kin), template)


def by_arms_alone(transfer, inverse_d):
    return (1.0,)


for _transfer in (APIC, AFLIP, ASFLIP):
    transfers.nodal_momentum.on(_transfer)(nodal_momentum_affine)
    transfers.add_moment.on(_transfer)(add_moment_affine)
    transfers.affine_velocity.on(_transfer)(affine_velocity_of_moment)
    transfers.zero_moment.on(_transfer)(zero_planar)
    transfers.by_arms.on(_transfer)(by_arms_alone)

take_nodal_velocity(APIC)
blend(AFLIP)
blend(ASFLIP)
warn_of_vibrations(ASFLIP)
