"""TPIC: the point keeps the gradient of the nodal velocity (Nakamura et al. 2023)."""

from typing import NamedTuple

from karamelo_py.points.transfers import Moment, take_nodal_velocity, taylor


class TPIC(NamedTuple):
    """v_p = v_pic, and the gradient of velocity L_p travels with the point.

    A Taylor expansion of the velocity around the point: less damping than PIC, and no D to invert
    (Nakamura, Matsumura & Mizutani 2023, "Taylor particle-in-cell transfer and kernel correction
    for material point method"). With functions whose D vanishes at nodes (linear,
    Bernstein-quadratic), in a grid that the points move through, a body that drifts gains energy
    without bounds.

    Example
    -------
    method(ulmpm, TPIC, quadratic-spline)
    """

    point_fields = (Moment,)
    inverts_spread = False
    in_lanes = True


taylor.register(TPIC)


take_nodal_velocity(TPIC)
