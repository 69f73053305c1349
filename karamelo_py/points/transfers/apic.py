"""APIC: the point keeps the moment of the nodal velocity beside its mean (Jiang et al. 2015)."""

from typing import NamedTuple

from karamelo_py.points.transfers import Moment, affine, take_nodal_velocity


class APIC(NamedTuple):
    """v_p = v_pic, and B_p = sum N_I v*_I (X_I - x_p)^T travels with the point.

    Conserves linear and angular momentum to round-off, and damps what lies below a cell.

    With functions whose D vanishes at nodes (linear, Bernstein-quadratic) and a grid that the
    points move through, the velocity that deforms the points leaves the moments out, which needs
    musl; usl and usf are refused.

    Example
    -------
    method(ulmpm, APIC, quadratic-spline)
    """

    point_fields = (Moment,)
    inverts_spread = True
    in_lanes = True


affine.register(APIC)


take_nodal_velocity(APIC)
