"""USAVG: half of the stress update first, half last (Nairn 2003)."""

from typing import NamedTuple

from karamelo_py.kernels import table
from karamelo_py.kernels.equations.strain import SecondStrain, Strain
from karamelo_py.kernels.equations.transfer_loss import TransferLoss
from karamelo_py.schemes.traits import SchemeTraits


class USAVG(NamedTuple):
    """Do half of the stress update before the forces, and half after them as in musl.

    USAVG conserves energy best, at the cost of two stress updates per step (Nairn 2003, "Material
    point method calculations with explicit cracks"). The halves add up to the whole increment of F.

    Example
    -------
    scheme(usavg)
    """

    traits = SchemeTraits(
        strained_before=0.5,
        loss=TransferLoss,
        allows_drift=True,
        conserving=((0.9, 0.9), (0.9, 0.5), (0.45, 0.45)),  # docs/energy.md
    )
    rows = (
        table.BEGIN,
        *table.VELOCITY_BEFORE,
        table.Gather(Strain(), 0.5, of_last_step=True),
        table.FORCE,
        *table.UPDATE,
        table.SERIES,
        *table.MOVE,
        *table.MOMENTUM_AGAIN,
        table.Gather(SecondStrain(), 0.5),
        table.END,
    )
