"""XPIC: PIC of higher order, damping only what the grid cannot see (Hammerquist & Nairn 2017)."""

from typing import Annotated, Any, NamedTuple

from karamelo_py.compiler.fields import StepField, SummedField, vector
from karamelo_py.language.kinds import In
from karamelo_py.points.laws import can
from karamelo_py.points.laws.eos import taken_heat
from karamelo_py.points.transfers import terms, updated_velocity


class TermOfSeries(StepField):
    """Term of the series at a point."""

    shape = vector


class Reflected(StepField):
    """Energy per mass that XPIC has taken of a point so far; velocity not in the series yet."""

    @staticmethod
    def shape(kin: Any) -> int:
        """A number and a vector."""
        return 1 + kin.dimension

    @staticmethod
    def needed(law: NamedTuple) -> bool:
        """Check that points of a law take the transfer's loss of energy as heat."""
        return can(law, taken_heat)


class Series(SummedField):
    """Term of the series at a node, and the sum for the next."""

    @staticmethod
    def shape(kin: Any) -> int:
        """Two vectors."""
        return 2 * kin.dimension


class XPIC(NamedTuple):
    """v_p = (I - (I - S S+)^m) v_p + sum N_I (v*_I - v_I): m = 1 is PIC, m without end is FLIP.

    S maps nodes to points and S+ points to nodes by mass. A few steps remove noise in the null
    space. The motion that the grid sees stays (Hammerquist & Nairn 2017, "A new method for material
    point method particle updates that reduces noise and enhances stability", eq. 24). The terms w_0
    = S+ v, w_k = w_(k-1) - S+ S w_(k-1) are summed at the nodes. Every order beyond the first
    visits the points once more per step.

    Parameters
    ----------
    order
        m.

    Example
    -------
    method(ulmpm, XPIC, quadratic-spline, 5)
    """

    order: Annotated[int, In(1, 20)]

    point_fields = (TermOfSeries, Reflected)
    node_fields = (Series,)
    inverts_spread = False
    in_lanes = True


# kernels.table.sum_series has put the sum of the series, with the change, in the place of dv.
updated_velocity.on(XPIC)(lambda transfer, v, v_pic, dv: dv)
terms.on(XPIC)(lambda transfer: transfer.order)
