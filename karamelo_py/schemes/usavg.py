"""USAVG: half of the stress update first, half last (Nairn 2003)."""

from typing import NamedTuple

from karamelo_py.kernels.arrays import (
    FINAL_INTEGRATE,
    INITIAL_INTEGRATE,
    ON_VELOCITY,
    POST_UPDATE_GRID_STATE,
    POST_VELOCITIES_TO_GRID,
)
from karamelo_py.kernels.g2p import SecondStrain, Strain
from karamelo_py.kernels.table import (
    ACCELERATE,
    CONTACT_AFTER,
    CONTACT_BEFORE,
    FORCE,
    MOMENTUM_AGAIN,
    MOVE,
    SERIES,
    VELOCITY_BEFORE,
    AtNodes,
    AtPoints,
    Gather,
)


class USAVG(NamedTuple):
    """Half of the strain from the nodal velocity before the forces, half from the one of musl.

    Energy is kept best, for two updates of the stress a step (Nairn 2003, "Material point method
    calculations with explicit cracks"). The two halves make the whole increment of F.

    Example
    -------
    scheme(usavg)
    """

    courant = (1.0, 1.0)
    keeping = ((0.9, 0.9), (0.9, 0.5), (0.45, 0.45))  # as in musl
    bears_drift = True
    strained_before = 0.5
    rows = (
        AtPoints(INITIAL_INTEGRATE, 0),
        *VELOCITY_BEFORE,
        AtNodes(POST_UPDATE_GRID_STATE, ON_VELOCITY),
        CONTACT_BEFORE,
        Gather(Strain(), 0.5, of_last_step=True),
        FORCE,
        *ACCELERATE,
        SERIES,
        *MOVE,
        *MOMENTUM_AGAIN,
        AtNodes(POST_VELOCITIES_TO_GRID, ON_VELOCITY),
        CONTACT_AFTER,
        Gather(SecondStrain(), 0.5),
        AtPoints(FINAL_INTEGRATE, 1),
    )
