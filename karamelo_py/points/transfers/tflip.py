"""FLIP with the gradient-enhanced projection of Karamelo."""

from typing import Annotated, NamedTuple

from karamelo_py.points.transfers import Moment, taylor
from karamelo_py.points.transfers.flip import Share, blended


class TFLIP(NamedTuple):
    """FLIP's velocity, mapped to the nodes as N_I (v_p + L_p (X_I - x_p)).

    ``method(kind, FLIP, basis, alpha, gradient-enhanced)`` is the same thing.

    Parameters
    ----------
    alpha
        Share of FLIP.

    Example
    -------
    method(ulmpm, TFLIP, cubic-spline, 0.99)
    """

    alpha: Annotated[float, Share]

    point_fields = (Moment,)
    inverts_spread = False
    in_lanes = True


blended(TFLIP)
taylor.register(TFLIP)
