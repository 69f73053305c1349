"""XPIC: PIC of higher order, damping only what the grid cannot see (Hammerquist & Nairn 2017)."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from karamelo_py.compiler.fields import vector
from karamelo_py.language.kinds import In
from karamelo_py.points.transfers import terms, updated_velocity


class TermOfSeries(NamedTuple):
    """Term of the series at a point."""

    array: Any

    shape = vector
    kept = False


class Series(NamedTuple):
    """Term of the series at a node, and the sum for the next."""

    array: Any

    kept = False
    summed = True

    @staticmethod
    def shape(kin: Any) -> int:
        """Two vectors."""
        return 2 * kin.dimension


class XPIC(NamedTuple):
    """v_p = (I - (I - S S+)^m) v_p + sum N_I (v*_I - v_I): m = 1 is PIC, m without end is FLIP.

    S maps nodes to points and S+ points to nodes by mass. Noise in the null space goes in a few
    steps, the motion that the grid sees stays (Hammerquist & Nairn 2017, "A new method for material
    point method particle updates that reduces noise and enhances stability", eq. 24). Every order
    beyond the first visits the points once more a step.

    Parameters
    ----------
    order
        m.

    Example
    -------
    method(ulmpm, XPIC, quadratic-spline, 5)
    """

    order: Annotated[int, In(1, 20)]

    point_fields = (TermOfSeries,)
    node_fields = (Series,)
    inverts_spread = False
    in_lanes = True


@updated_velocity.on(XPIC)
def _(transfer, v, v_pic, dv):
    # kernels.step.sum_series has put the sum of the series, with the change, in the place of dv.
    return dv


@terms.on(XPIC)
def _(transfer):
    return transfer.order
