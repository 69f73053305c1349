"""strength johnson_cook: flow stress by strain, rate and temperature (Johnson & Cook 1983)."""

from typing import Annotated, Any, NamedTuple

from karamelo_py.compiler.compile import all_lanes, fma, point_function, real, round_off, where
from karamelo_py.compiler.powers import logarithm, power
from karamelo_py.language.rules import suggestion
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws import Absent
from karamelo_py.points.laws.checks import check_temperatures, reference_rate
from karamelo_py.points.laws.strengths import remembers, shear_response
from karamelo_py.points.laws.strengths.hardening import (
    first_guess,
    flow_stress,
    precompute,
    radial_return,
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


suggestion(
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


remembers(JohnsonCook, ep=0.0)
shear_response.on(JohnsonCook)(radial_return)


# Increments of strain up to this share of it are a series of so many terms.
_NEAR, _TERMS = 1 / 32, 9


def power_of_strain(factor, exponent, strain):
    """factor strain^exponent, 0 at no strain."""
    some = strain > 0
    return where(some, factor * power(where(some, strain, 1), exponent), 0)


def power_law(factor, exponent, strain, value, increment):
    """factor (strain + increment)^exponent and its slope; at no strain the slope is left out.

    `value` is that without the increment: (1 + x)^n times as much is a short series for small x.
    """
    near = max(exponent, 1) * increment <= _NEAR * strain
    x = increment / where(strain > 0, strain, 1)
    series = real(1, x)
    for k in range(_TERMS, 0, -1):
        series = fma(x * ((exponent - (k - 1)) * real(1 / k, x)), series, 1)
    after = strain + increment
    value = value * series
    if not all_lanes(near):
        value = where(near, value, power_of_strain(factor, exponent, after))
    return value, value * (exponent / where(after > 0, after, 1))


def power_law_guess(exponent, strain, hard, excess, slope):
    """A `first_guess` from the first two derivatives of the power law `hard` (Chebyshev's method).

    `excess` is how far the stress lies above the flow stress; it falls by `slope` with the strain.
    """
    some = strain > round_off(strain)
    inverse = where(some, 1 / where(some, strain, 1), 0)
    steeper = hard * exponent * inverse
    flatter = 1 / (slope + steeper)
    curved = 0.5 * (1 - exponent) * steeper * inverse * flatter
    x = max(excess, 0) * flatter
    return x + x * max(min(curved * x, 1), -0.5), abs(curved)


class Hardened(NamedTuple):
    """Known at the beginning of a step: the hardening, and the factor of the temperature."""

    hard: Any
    soft: Any


@point_function(tags=2, otherwise=True)
def thermal_factor(softening, heat):
    """Factor of the temperature: 1 where there is none."""
    return 1


@thermal_factor.on(Softening, Warm)
def _thermal_factor_softening_warm(softening, heat):
    return 1 - power(homologous(heat, softening.Tr, softening.Tm), softening.m)


@point_function(otherwise=True)
def with_rate_factor(rate, flow, slope, increment, dt):
    """Flow stress and slope with the factor of the rate."""
    return flow, slope


@with_rate_factor.on(RateFactor)
def _with_rate_factor_rate_factor(rate, flow, slope, increment, dt):
    relative = increment / (dt * rate.epsdot0)
    faster = relative > 1
    factor = 1 + where(faster, rate.C * logarithm(where(faster, relative, 1)), 0)
    steeper = where(faster, flow * rate.C / where(faster, increment, 1), 0)
    return flow * factor, slope * factor + steeper


@precompute.on(JohnsonCook)
def _precompute_johnson_cook(strength, memory, heat):
    hard = power_of_strain(strength.B, strength.n, memory.ep)
    return Hardened(hard, thermal_factor(strength.softening, heat))


@first_guess.on(JohnsonCook)
def _first_guess_johnson_cook(strength, memory, known, q, slope):
    if not isinstance(strength.rate, Absent):
        return real(0, q), real(0, q)  # the rate rises with the strain: what is known is for none
    hard, soft = known
    excess = q - (strength.A + hard) * soft
    return power_law_guess(strength.n, memory.ep, hard * soft, excess, slope)


@flow_stress.on(JohnsonCook)
def _flow_stress_johnson_cook(strength, memory, known, increment, heat, dt):
    hard, slope = power_law(strength.B, strength.n, memory.ep, known.hard, increment)
    flow = (strength.A + hard) * known.soft
    return with_rate_factor(strength.rate, flow, slope * known.soft, increment, dt)
