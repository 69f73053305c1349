"""strength swift: hardening by a power of plastic strain, after a plateau."""

from typing import Annotated, NamedTuple

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.strengths import remembers, shear_response
from karamelo_py.points.laws.strengths.hardening import (
    first_guess,
    flow_stress,
    precompute,
    radial_return,
)
from karamelo_py.points.laws.strengths.johnson_cook import (
    power_law,
    power_law_guess,
    power_of_strain,
)


class Swift(NamedTuple):
    """Hardening by a power of plastic strain, after a plateau.

    Parameters
    ----------
    G
        Shear modulus.
    A
        Flow stress on the plateau.
    B, n
        Hardening.
    C
        Plastic strain at the end of the plateau. A negative one is a strain that the material has
        been given before.

    Example
    -------
    strength(steel, swift, 80e9, 400e6, 500e6, 0.01, 0.5)

    Notes
    -----
    Y = A + B (ep - C)^n where the plastic strain ep is above C, else A (after Swift 1952). Each
    step solves for the plastic strain with the flow stress at its end.

    See Also
    --------
    plastic, johnson_cook, material eos-strength
    """

    in_lanes = True

    G: Annotated[float, Positive]
    A: Annotated[float, Positive]
    B: Annotated[float, NonNegative]
    C: float
    n: Annotated[float, NonNegative]


remembers(Swift, ep=0.0)
shear_response.on(Swift)(radial_return)


@precompute.on(Swift)
def _precompute_swift(strength, memory, heat):
    return power_of_strain(strength.B, strength.n, memory.ep - strength.C)


@first_guess.on(Swift)
def _first_guess_swift(strength, memory, hard, q, slope):
    excess = q - strength.A - hard
    return power_law_guess(strength.n, memory.ep - strength.C, hard, excess, slope)


@flow_stress.on(Swift)
def _flow_stress_swift(strength, memory, before, increment, heat, dt):
    hard, slope = power_law(strength.B, strength.n, memory.ep - strength.C, before, increment)
    return strength.A + hard, slope
