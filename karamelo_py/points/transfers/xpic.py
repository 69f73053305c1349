"""XPIC: PIC of higher order, which damps only null-space noise (Hammerquist & Nairn 2017)."""

from typing import Annotated, NamedTuple

from karamelo_py.compiler.fields import StepField, SummedField, numbers, vector
from karamelo_py.language.kinds import In
from karamelo_py.points.laws import can
from karamelo_py.points.laws.eos import taken_heat
from karamelo_py.points.transfers import TransferTraits, terms, updated_velocity


class TermOfSeries(StepField):
    shape = vector


class Reflected(StepField):
    """Energy per unit mass that XPIC has removed, and velocity that is not yet in the series."""

    shape = numbers(1, 1)

    @staticmethod
    def needed(law: NamedTuple) -> bool:
        return can(law, taken_heat)


class Series(SummedField):
    """Term k of the series at a node, and the sum that becomes term k + 1."""

    shape = numbers(0, 2)


class XPIC(NamedTuple):
    """XPIC: v_p = (I - (I - S S+)^m) v_p + sum N_I (v*_I - v_I), from PIC (m = 1) towards FLIP.

    S maps nodes to points, and S+ maps points to nodes, weighted by mass. A low order m removes
    null-space noise and retains what the grid resolves (Hammerquist & Nairn 2017, "A new method for
    material point method particle updates that reduces noise and enhances stability", eq. 24). The
    sum w_0 + w_1 + ... is taken at the nodes, with w_0 = S+ v and w_k = w_(k-1) - S+ S w_(k-1).
    Each order costs one more pass over the points per step.

    Parameters
    ----------
    order
        Order m of the series.

    Example
    -------
    method(ulmpm, XPIC, quadratic-spline, 5)
    """

    order: Annotated[int, In(1, 20)]

    point_fields = (TermOfSeries, Reflected)
    node_fields = (Series,)
    traits = TransferTraits(series=True)
    in_lanes = True


# kernels.table.sum_series has replaced dv by the series plus the change.


@updated_velocity.on(XPIC)
def _updated_velocity_xpic(transfer, v, v_pic, dv):
    return dv


@terms.on(XPIC)
def _terms_xpic(transfer):
    return transfer.order
