"""USF: update stress first (Burgess, Sulsky & Brackbill 1992; Bardenhagen 2002)."""

from typing import NamedTuple

from karamelo_py.kernels import table
from karamelo_py.kernels.equations.strain import Strain
from karamelo_py.kernels.equations.transfer_loss import LossByUpdate
from karamelo_py.schemes.traits import SchemeTraits


class USF(NamedTuple):
    """Update the stress before the forces, with the nodal velocity at the start of the step.

    Points have already moved with this velocity, so F is multiplied by (I - dt grad v)^-1, with
    gradients at present positions. The published I + dt grad v adds energy and shrinks rotating
    bodies.

    The log shows stress, volume and strain at the beginning of a step (usavg: with half of the
    increment). With rate-form laws, a rotation by w dt in a step causes a volume strain of -(w
    dt)^2/2, as in musl; usavg halves this error.

    Example
    -------
    scheme(usf)
    """

    traits = SchemeTraits(
        strained_before=1.0,
        loss=LossByUpdate,
        conserving=((0.9, 0.6), (0.4, 0.2), (0.2, 0.2)),  # docs/energy.md
    )
    rows = (
        table.BEGIN,
        *table.VELOCITY_BEFORE,
        table.Gather(Strain(), of_last_step=True),
        table.FORCE,
        *table.ACCELERATE,
        table.SERIES,
        *table.MOVE,
        table.END,
    )
