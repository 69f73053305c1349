"""ASFLIP: AFLIP whose points come apart where they are not pressed together (Fei et al. 2021)."""

from typing import Annotated, NamedTuple

from karamelo_py.compiler.compile import choose, real
from karamelo_py.compiler.tuples import add_scaled, subtract
from karamelo_py.language.kinds import In
from karamelo_py.language.rules import known_failure
from karamelo_py.points.laws import jacobian
from karamelo_py.points.transfers import Moment, affine, displacing_velocity, known_volume
from karamelo_py.points.transfers.flip import Share, blended, swings

COMPRESSED = 1e-3  # share of its volume that a point has to lose to go with the grid
SEPARATE = 0.1  # strength of separation that elastic bodies bear


class ASFLIP(NamedTuple):
    """AFLIP whose points move with velocities of their own where they come apart.

    Points that the grid holds together come apart sooner: for granular flow and splashes
    (Fei et al. 2021, section 5). Where the material is compressed, by more than a thousandth of its
    volume, points go with the grid as in all other transfers, so that they keep their order.

    Parameters
    ----------
    alpha
        Share of FLIP.
    beta
        Strength of separation: the share of what a point's velocity has beyond the
        grid's, after the step, that moves it, too, where the material is not compressed. 0 is
        AFLIP.

    Example
    -------
    method(ulmpm, ASFLIP, quadratic-spline, 0.97)
    method(ulmpm, ASFLIP, quadratic-spline, 0.97, 0.1)

    Notes
    -----
    A solid that bears tension is not compressed, and does not come apart: its points lose their
    places. Two elastic rings that meet at 30 m/s rebound at 22.5 m/s with AFLIP, and with a share
    of 0.97 at 22.2 (beta = 0.1), 18.4 (0.3), 13.7 (0.5), 7.5 (0.7) and 2.7 (1).
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


@known_volume.on(ASFLIP)
def _known_volume_asflip(transfer, law, kin, state):
    return jacobian(law, kin, state)


@displacing_velocity.on(ASFLIP)
def _displacing_velocity_asflip(transfer, v, v_pic, j):
    one = real(1, j)
    beta = choose(one - j < real(COMPRESSED, j), transfer.beta * one, j - j)
    return add_scaled(v_pic, beta, subtract(v, v_pic))


blended(ASFLIP)
swings(ASFLIP)
affine.register(ASFLIP)
