"""USF: update stress first (Burgess, Sulsky & Brackbill 1992; Bardenhagen 2002)."""

from typing import NamedTuple

from karamelo_py.kernels import table
from karamelo_py.kernels.g2p import Strain


class USF(NamedTuple):
    """The stress follows from the nodal velocity at the start of the step, before the forces.

    That velocity has led the points to where they are, so that in the updated frame F grows by
    (I - dt grad v)^-1; as first published, by I + dt grad v, it gains energy and turning bodies
    shrink. Stress, volume and strain that are shown after a step are those of the places that it
    began with; of usavg, half of that. A law of rate (linear, the strengths) takes what turns by an
    angle w dt in a step for a compression by (w dt)^2/2, as with musl; with usavg, by half of that.

    Example
    -------
    scheme(usf)
    """

    courant = (1.0, 1.0)
    keeping = ((0.9, 0.6), (0.4, 0.2), (0.2, 0.2))  # as in musl
    strained_before = 1.0
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
