"""strength recovering: hardening that fades with time, a number that each point remembers."""

from typing import Annotated, NamedTuple

from karamelo_py.compiler.compile import real, shared
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.strengths.hardening import flow_stress, hardened, hardening


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


hardening(Recovering, R=0.0)


@shared
def fading(strength, dt):
    """The share of the hardening that a step leaves."""
    return real(1, dt) / (real(1, dt) + strength.rate * dt)


@flow_stress.on(Recovering)
def _flow_stress_recovering(strength, memory, increment, heat, dt):
    R = (memory[1] + strength.H * increment) * fading(strength, dt)
    return strength.A + R, strength.H * fading(strength, dt)


@hardened.on(Recovering)
def _hardened_recovering(strength, memory, increment, dt):
    R = (memory[1] + strength.H * increment) * fading(strength, dt)
    return (memory[0] + increment, R)
