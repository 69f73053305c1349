"""strength recovering: hardening that fades with time, a number that each point remembers."""

from typing import Annotated, NamedTuple

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.strengths import remembers, shear_response
from karamelo_py.points.laws.strengths.hardening import flow_stress, radial_return, updated_memory


class Recovering(NamedTuple):
    """Hardening R by plastic strain that recovers with time, as in hot metals.

    Parameters
    ----------
    G
        Shear modulus.
    A
        Flow stress without hardening.
    H
        Hardening modulus.
    rate
        Rate of recovery.

    Example
    -------
    strength(hot, recovering, 25e9, 20e6, 1e9, 50)

    Notes
    -----
    Y = A + R, dR/dt = H dep/dt - rate R, solved for at the end of a step. The column R of dumps
    shows the hardening.
    """

    in_lanes = True

    G: Annotated[float, Positive]
    A: Annotated[float, Positive]
    H: Annotated[float, NonNegative]
    rate: Annotated[float, NonNegative]


remembers(Recovering, ep=0.0, R=0.0)
shear_response.on(Recovering)(radial_return)


def hardening(strength, R, increment, dt):
    """R at the end of a step, and the share of it that a step leaves."""
    left = 1 / (1 + strength.rate * dt)
    return (R + strength.H * increment) * left, left


@flow_stress.on(Recovering)
def _flow_stress_recovering(strength, before, increment, dt):
    R, left = hardening(strength, before.memory.R, increment, dt)
    return strength.A + R, strength.H * left


@updated_memory.on(Recovering)
def _updated_memory_recovering(strength, memory, increment, dt):
    R, _ = hardening(strength, memory.R, increment, dt)
    return memory._replace(ep=memory.ep + increment, R=R)
