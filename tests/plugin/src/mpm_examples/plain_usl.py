"""scheme plain-usl: a step as a table of rows."""

from typing import NamedTuple

from karamelo_py.compiler import real, shared
from karamelo_py.kernels.arrays import FINAL_INTEGRATE, INITIAL_INTEGRATE, MASS
from karamelo_py.kernels.equations.node_updates import UpdateToVelocity
from karamelo_py.kernels.equations.strain import Strain
from karamelo_py.kernels.table import ACCELERATE, MOVE, SERIES, SUMS, AtPoints, Gather, NodeTask
from karamelo_py.schemes.traits import SchemeTraits


@shared
def updated(s):
    """The task that makes v* the velocity which deforms the points: no node counts as light."""
    return UpdateToVelocity(real(0, s.nodes.sums[0, MASS]))


class PlainUSL(NamedTuple):
    """Update stress last, as in the textbook: nothing is done about nodes with little mass.

    Example
    -------
    scheme(plain-usl)
    """

    traits = SchemeTraits(courant=(0.65, 0.4))
    rows = (
        AtPoints(INITIAL_INTEGRATE, 0),
        SUMS,  # mass, momentum and force to the nodes
        *ACCELERATE,  # their update, and the fixes on nodes
        NodeTask(UpdateToVelocity, make=updated),
        SERIES,
        *MOVE,  # velocities back to the points, which move
        Gather(Strain()),  # their stress, from the same velocity of the nodes
        AtPoints(FINAL_INTEGRATE, 1),
    )
