"""ASFLIP: AFLIP whose points may move against each other (Fei et al. 2021)."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from karamelo_py.points.transfers import Moment, affine, displacing_velocity
from karamelo_py.points.transfers.flip import Share, blended


class ASFLIP(NamedTuple):
    """AFLIP whose points move with their own velocity after the step, not with that of the grid.

    Points that the grid holds together come apart sooner: for granular flow and splashes
    (Fei et al. 2021, section 5; here, as in Karamelo, without their factor for separation only).

    Parameters
    ----------
    alpha
        Share of FLIP.

    Example
    -------
    method(ulmpm, ASFLIP, quadratic-spline, 0.97)
    """

    alpha: Annotated[float, Share]

    point_fields = (Moment,)
    inverts_spread = True
    in_lanes = True


@displacing_velocity.on(ASFLIP)
def _(transfer, v, v_pic):
    return v


blended(ASFLIP)
affine.register(ASFLIP)
