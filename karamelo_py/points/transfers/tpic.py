"""TPIC: the point keeps the gradient of the nodal velocity (Nakamura et al. 2023)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.points.transfers import Moment, take_nodal_velocity, taylor


class TPIC(NamedTuple):
    """v_p = v_pic, and the gradient of velocity L_p travels with the point.

    A Taylor expansion of the velocity around the point: less damping than PIC, and no D to invert,
    so that it goes with every basis (Nakamura, Matsumura & Mizutani 2023, "Taylor particle-in-cell
    transfer and kernel correction for material point method").

    Example
    -------
    method(ulmpm, TPIC, quadratic-spline)
    """

    point_fields = (Moment,)
    inverts_spread = False
    in_lanes = True


taylor.register(TPIC)


take_nodal_velocity(TPIC)
