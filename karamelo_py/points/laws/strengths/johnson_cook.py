"""strength johnson_cook: flow stress by strain, rate and temperature (Johnson & Cook 1983)."""

from typing import Annotated, Any, NamedTuple

from karamelo_py.compiler.compile import (
    choose,
    fma,
    in_all,
    point_function,
    real,
    round_off,
    shared,
)
from karamelo_py.compiler.powers import logarithm, power
from karamelo_py.language.rules import saving
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws import Absent
from karamelo_py.points.laws.checks import check_temperatures, reference_rate
from karamelo_py.points.laws.strengths.hardening import (
    first_guess,
    flow_stress,
    foreseen,
    hardening,
)
from karamelo_py.points.laws.temperatures import Warm, homologous


class JohnsonCook(NamedTuple):
    """Flow stress of metals that depends on plastic strain, its rate, and temperature.

    Parameters
    ----------
    G
        Shear modulus.
    A
        Flow stress at first, at the reference rate and temperature.
    B, n
        Hardening: the flow stress rises by B ep^n with the plastic strain ep.
    epsdot0
        Reference rate of plastic strain; may be 0 where C is.
    C
        Coefficient of the rate; 0 for none.
    m
        Exponent of thermal softening; 0 for none.
    Tr
        Reference temperature, up to which there is no softening.
    Tm
        Melting temperature, from which on there is no strength.

    Example
    -------
    strength(copper, johnson_cook, 46e9, 90e6, 292e6, 0.31, 1, 0.025, 1.09, 298, 1356)

    Notes
    -----
    Y = (A + B ep^n) (1 + C ln(rate/epsdot0)) (1 - T*^m), T* = (T - Tr)/(Tm - Tr) (Johnson & Cook
    1983). At and below the reference rate the second factor is 1; without a temperature the third
    one is. Each step solves for the plastic strain with the flow stress at its end and the rate of
    the step, which has one solution whatever the size of the step; the temperature is that of its
    beginning.

    See Also
    --------
    plastic, swift, eos shock, damage damage_johnson_cook, temperature plastic_work
    """

    in_lanes = True

    G: float
    A: float
    B: float
    n: float
    rate: Any  # `RateFactor` or `Absent`
    softening: Any  # `Softening` or `Absent`

    @classmethod
    def given(
        cls,
        G: Annotated[float, Positive],
        A: Annotated[float, Positive],
        B: Annotated[float, NonNegative],
        n: Annotated[float, NonNegative],
        epsdot0: Annotated[float, NonNegative],
        C: Annotated[float, NonNegative],
        m: Annotated[float, NonNegative],
        Tr: float,
        Tm: float,
    ):
        """The law with the factors that are not 1 anyway: others cost no logarithm and no power."""
        check_temperatures(Tr, Tm)
        epsdot0 = reference_rate(epsdot0, C, "C")
        rate = RateFactor(epsdot0, C) if C > 0 else Absent()
        return cls(G, A, B, n, rate, Softening(m, Tr, Tm) if m > 0 else Absent())


saving(
    JohnsonCook,
    when=lambda s, scene: s.B == 0 and all(isinstance(f, Absent) for f in (s.rate, s.softening)),
    cost="the strength of {owner.id} neither hardens nor depends on rate or heat",
    instead="strength(..., plastic, {part.G:g}, {part.A:g})",
)


class RateFactor(NamedTuple):
    """1 + C ln(rate/epsdot0) above the reference rate."""

    in_lanes = True

    epsdot0: float
    C: float


class Softening(NamedTuple):
    """1 - T*^m."""

    in_lanes = True

    m: float
    Tr: float
    Tm: float


hardening(JohnsonCook)


# Increments of strain up to this share of it are a series of so many terms.
_NEAR, _TERMS = 1 / 32, 9


@shared
def power_of_strain(factor, exponent, strain):
    """factor strain^exponent, 0 at no strain."""
    some = strain > 0
    base = choose(some, strain, real(1, strain))
    return choose(some, factor * power(base, exponent), real(0, strain))


@shared
def power_law(factor, exponent, strain, value, increment):
    """factor (strain + increment)^exponent and its slope; at no strain the slope is left out.

    `value` is that without the increment: (1 + x)^n times as much is a short series for small x.
    """
    one = real(1, strain)
    near = max(exponent, one) * increment <= real(_NEAR, strain) * strain
    x = increment / choose(strain > 0, strain, one)
    series = one
    for k in range(_TERMS, 0, -1):
        series = fma(x * ((exponent - real(k - 1, x)) * real(1 / k, x)), series, one)
    after = strain + increment
    value = value * series
    if not in_all(near):
        value = choose(near, value, power_of_strain(factor, exponent, after))
    return value, value * (exponent / choose(after > 0, after, one))


@shared
def power_law_guess(exponent, strain, hard, excess, slope):
    """A `first_guess` from the first two derivatives of the power law `hard` (Chebyshev's method).

    `excess` is how far the stress lies above the flow stress; it falls by `slope` with the strain.
    Strains so small that the derivatives may overflow count as none.
    """
    zero, one = real(0, strain), real(1, strain)
    some = strain > round_off(strain)
    inverse = choose(some, one / choose(some, strain, one), zero)
    steeper = hard * exponent * inverse
    flatter = one / (slope + steeper)
    curved = real(0.5, strain) * (one - exponent) * steeper * inverse * flatter
    x = max(excess, zero) * flatter
    return x + x * max(min(curved * x, one), real(-0.5, x)), abs(curved)


@point_function(tags=2, otherwise=True)
def softened(softening, heat, like):
    """The factor of the temperature: 1 where there is none."""
    return real(1, like)


@softened.on(Softening, Warm)
def _softened_softening_warm(softening, heat, like):
    return real(1, like) - power(homologous(heat, softening.Tr, softening.Tm), softening.m)


@point_function(otherwise=True)
def quickened(rate, flow, slope, increment, dt):
    """Flow stress and slope with the factor of the rate."""
    return flow, slope


@quickened.on(RateFactor)
def _quickened_rate_factor(rate, flow, slope, increment, dt):
    one = real(1, increment)
    relative = increment / (dt * rate.epsdot0)
    faster = relative > one
    factor = one + choose(faster, rate.C * logarithm(choose(faster, relative, one)), real(0, one))
    steeper = choose(faster, flow * rate.C / choose(faster, increment, one), real(0, one))
    return flow * factor, slope * factor + steeper


@foreseen.on(JohnsonCook)
def _foreseen_johnson_cook(strength, memory, heat):
    hard = power_of_strain(strength.B, strength.n, memory[0])
    return hard, softened(strength.softening, heat, hard)


@first_guess.on(JohnsonCook)
def _first_guess_johnson_cook(strength, memory, q, slope):
    ep, hard, soft = memory
    if not isinstance(strength.rate, Absent):
        return real(0, q), real(0, q)  # the rate rises with the strain: what is known is for none
    excess = q - (strength.A + hard) * soft
    return power_law_guess(strength.n, ep, hard * soft, excess, slope)


@flow_stress.on(JohnsonCook)
def _flow_stress_johnson_cook(strength, memory, increment, heat, dt):
    ep, before, soft = memory
    hard, slope = power_law(strength.B, strength.n, ep, before, increment)
    return quickened(strength.rate, (strength.A + hard) * soft, slope * soft, increment, dt)
