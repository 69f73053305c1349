"""MUSL: modified update stress last (Sulsky et al. 1995)."""

from typing import NamedTuple

from karamelo_py.kernels import table
from karamelo_py.kernels.equations.strain import Strain
from karamelo_py.kernels.equations.transfer_loss import TransferLoss
from karamelo_py.schemes.traits import SchemeTraits


class MUSL(NamedTuple):
    """Update the stress after the forces, with the new velocity mapped to the nodes again.

    The second mapping makes velocity gradients at nodes with very little mass harmless. This scheme
    is the default and conserves energy well.

    Example
    -------
    scheme(musl)
    """

    traits = SchemeTraits(
        maps_velocity_again=True,
        loss=TransferLoss,
        conserving=((0.9, 0.9), (0.4, 0.2), (0.2, 0.2)),  # docs/energy.md
    )
    rows = (
        table.BEGIN,
        table.SUMS,
        *table.UPDATE,
        table.SERIES,
        *table.MOVE,
        *table.MOMENTUM_AGAIN,
        table.Gather(Strain()),
        table.END,
    )
