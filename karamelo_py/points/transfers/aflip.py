"""AFLIP: FLIP with the moment of velocity (Fei et al. 2021)."""

from typing import Annotated, NamedTuple

from karamelo_py.points.transfers import Moment, affine
from karamelo_py.points.transfers.flip import Share, blended


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


blended(AFLIP)
affine.register(AFLIP)
