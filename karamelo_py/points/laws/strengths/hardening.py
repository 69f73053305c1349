"""What strengths of von Mises share: the radial return to a flow stress that hardens as it will."""

from __future__ import annotations

from math import sqrt

from karamelo_py.compiler.compile import point_function, real, round_off, shared
from karamelo_py.compiler.tuples import scale
from karamelo_py.points.kinematics import von_mises
from karamelo_py.points.laws.strengths import remembers, shear_response
from karamelo_py.points.laws.strengths.linear import elastic_trial


@point_function()
def flow_stress(strength, memory, increment, heat, dt):
    """Flow stress and its slope by `increment`, the part of the plastic strain of a step dt.

    `memory` is that before the step, memory[0] the plastic strain.
    """


@point_function()
def hardened(strength, memory, increment, dt):
    """The memory after a step, which may be without plastic strain."""


@hardened.otherwise
def _(strength, memory, increment, dt):
    return (memory[0] + increment,)


def hardening(strength: type, **own: float | str) -> None:
    """Give `strength` (with a field ``G`` and a `flow_stress`) the radial return.

    The deviatoric stress shrinks to flow/q of itself, q its von Mises stress (Wilkins 1964).

    Parameters
    ----------
    strength
        The class.
    **own
        What it remembers beside the plastic strain ``ep`` (`remembers`), changed by `hardened`.
    """
    remembers(strength, ep=0.0, **own)

    @shear_response.on(strength)
    def _(strength, kin, s, strain, memory, heat, dt):
        trial = elastic_trial(kin, strength.G, s, strain)
        q = von_mises(kin, trial)
        none = real(0, q)
        flow, slope = flow_stress(strength, memory, none, heat, dt)
        if q > flow:
            x = plastic_increment(strength, q, memory, heat, dt, flow, slope)
            flow = q - real(3, q) * strength.G * x
            return scale(flow / q, trial), hardened(strength, memory, x, dt), flow * x
        return trial, hardened(strength, memory, none, dt), none


# Newton's method takes two or three; bisection, where it has to step in, one for each bit.
_MOST_ITERATIONS = 80


@shared
def plastic_increment(strength, q, memory, heat, dt, first, hardening):
    """The plastic strain x of a step that solves q - 3 G x = flow stress, for q above it at 0.

    The left side falls with x and the flow stress does not: there is one solution, whatever the
    size of the step. Newton's method from the flow stress `first` at 0 and its slope, kept within
    bounds by bisection.
    """
    half = real(0.5, q)
    slope = real(3, q) * strength.G
    enough = real(4, q) * round_off(q) * q  # what the three terms are rounded to
    small = sqrt(round_off(q)) * q
    low = real(0, q)
    high = q / slope
    x = (q - first) / (slope + hardening)
    last = x
    for _ in range(_MOST_ITERATIONS):
        flow, hardening = flow_stress(strength, memory, x, heat, dt)
        excess = q - slope * x - flow
        if excess > 0:
            low = x
        else:
            high = x
        change = excess / (slope + hardening)
        x += change
        # Changes go like their squares, c_(n+1) = (c_n / c_(n-1))^2 c_n: is the next one round-off?
        # Beside a kink of the curve they do not: there the excess has to be small, too.
        next_is_small = abs(change * change * change) <= round_off(q) * x * last * last
        if abs(excess) <= enough or (next_is_small and abs(excess) <= small):
            break
        last = change
        if not (low < x < high):
            x = half * (low + high)
            if not (low < x < high):
                break
    return x
