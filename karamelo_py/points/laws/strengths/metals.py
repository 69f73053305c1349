"""Strengths johnson_cook, swift and zerilli-armstrong."""

from typing import Any, NamedTuple

from karamelo_py.compiler import all_lanes, fma, real, round_off, where
from karamelo_py.compiler.powers import exponential, logarithm, power
from karamelo_py.language.rules import suggestion
from karamelo_py.points.laws import Absent
from karamelo_py.points.laws.parameters import (
    AboveZero,
    ByName,
    FromZero,
    Temperature,
    check_temperatures,
    reference_rate,
)
from karamelo_py.points.laws.strengths import remembers, shear_response
from karamelo_py.points.laws.strengths.hardening import (
    first_guess,
    flow_stress,
    precompute,
    radial_return,
)
from karamelo_py.points.laws.temperatures import homologous, temperature_or


class JohnsonCookConstants(NamedTuple):
    """Flow stress of metals by plastic strain, strain rate and temperature.

    Parameters
    ----------
    G
        Shear modulus.
    A
        Initial flow stress, at the reference rate and temperature.
    B, n
        Hardening: the flow stress increases by B ep^n, where ep is the equivalent plastic strain.
    epsdot0
        Reference plastic strain rate; it may be 0 if C is 0.
    C
        Rate coefficient; 0 for none.
    m
        Exponent of thermal softening; 0 for none.
    Tr
        Reference temperature, below which there is no softening.
    Tm
        Melting temperature, above which there is no strength.

    Example
    -------
    strength(copper, johnson_cook, 46e9, 90e6, 292e6, 0.31, 1, 0.025, 1.09, 298, 1356)

    Notes
    -----
    Y = (A + B ep^n) (1 + C ln(rate/epsdot0)) (1 - T*^m), T* = (T - Tr)/(Tm - Tr) (Johnson & Cook
    1983). The second factor is 1 up to the reference rate. The third is 1 without a temperature. In
    each step, the plastic strain is found for the flow stress at the end of the step, with the mean
    rate in the step and the temperature at its beginning; the solution is unique for any step size.

    See Also
    --------
    plastic, swift, eos shock, damage damage_johnson_cook, temperature plastic_work
    """

    G: AboveZero
    A: AboveZero
    B: FromZero
    n: FromZero
    epsdot0: FromZero
    C: FromZero
    m: FromZero
    Tr: float
    Tm: float

    def checked(self):
        """Return a law without factors that are 1, as each costs a logarithm or a power."""
        *hardening, epsdot0, C, m, Tr, Tm = self
        check_temperatures(Tr, Tm)
        epsdot0 = reference_rate(epsdot0, C, "C")
        rate = RateFactor(epsdot0, C) if C > 0 else Absent()
        return JohnsonCook(*hardening, rate, Softening(m, Tr, Tm) if m > 0 else Absent())


class JohnsonCook(NamedTuple):
    style = "johnson_cook"
    in_lanes = True

    G: float
    A: float
    B: float
    n: float
    rate: Any
    softening: Any


suggestion(
    JohnsonCook,
    when=lambda s, scene: s.B == 0 and all(isinstance(f, Absent) for f in (s.rate, s.softening)),
    cost="the strength of {owner.id} neither hardens nor depends on rate or heat",
    instead="strength(..., plastic, {part.G:g}, {part.A:g})",
)


class RateFactor(NamedTuple):
    in_lanes = True

    epsdot0: float
    C: float


class Softening(NamedTuple):
    in_lanes = True

    m: float
    Tr: float
    Tm: float


remembers(JohnsonCook, ep=0.0)
shear_response.on(JohnsonCook)(radial_return)


# For increments up to the fraction _NEAR of the strain, a series of _TERMS terms is used.
_NEAR, _TERMS = 1 / 32, 9


def power_of_strain(factor, exponent, strain):
    some = strain > 0
    return where(some, factor * power(where(some, strain, 1), exponent), 0)


def power_law(factor, exponent, strain, value, increment):
    """Return factor (strain + increment)^exponent and its slope, 0 at zero strain.

    `value` is the power without the increment; for small x = increment / strain it is multiplied by
    a series of (1 + x)^n.
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
    """Return `first_guess` from two derivatives of the power law `hard` (Chebyshev's method).

    `excess` is stress minus flow stress, which decreases by `slope` per unit of strain.
    """
    some = strain > round_off(strain)
    inverse = where(some, 1 / where(some, strain, 1), 0)
    steeper = hard * exponent * inverse
    flatter = 1 / (slope + steeper)
    curved = 0.5 * (1 - exponent) * steeper * inverse * flatter
    x = max(excess, 0) * flatter
    return x + x * max(min(curved * x, 1), -0.5), abs(curved)


@precompute.on(JohnsonCook)
def _precompute_johnson_cook(strength, memory, heat):
    hard, softening = power_of_strain(strength.B, strength.n, memory.ep), strength.softening
    if isinstance(softening, Absent) or not len(heat):
        return hard, 1
    return hard, 1 - power(homologous(heat, softening.Tr, softening.Tm), softening.m)


@first_guess.on(JohnsonCook)
def _first_guess_johnson_cook(strength, before, q, slope):
    if not isinstance(strength.rate, Absent):
        return real(0, q), real(0, q)  # without a precomputed part, which does not include the rate
    hard, soft = before.precomputed
    excess = q - (strength.A + hard) * soft
    return power_law_guess(strength.n, before.memory.ep, hard * soft, excess, slope)


@flow_stress.on(JohnsonCook)
def _flow_stress_johnson_cook(strength, before, increment, dt):
    hard, soft = before.precomputed
    hard, slope = power_law(strength.B, strength.n, before.memory.ep, hard, increment)
    flow, slope = (strength.A + hard) * soft, slope * soft
    if isinstance(strength.rate, Absent):
        return flow, slope
    C, relative = strength.rate.C, increment / (dt * strength.rate.epsdot0)
    faster = relative > 1
    factor = 1 + where(faster, C * logarithm(where(faster, relative, 1)), 0)
    steeper = where(faster, flow * C / where(faster, increment, 1), 0)
    return flow * factor, slope * factor + steeper


class Swift(NamedTuple):
    """Power-law hardening after a plateau.

    Parameters
    ----------
    G
        Shear modulus.
    A
        Flow stress on the plateau.
    B, n
        Hardening constants (see notes).
    C
        Plastic strain at the end of the plateau. If negative, -C is an initial plastic strain.

    Example
    -------
    strength(steel, swift, 80e9, 400e6, 500e6, 0.01, 0.5)

    Notes
    -----
    Y = A + B (ep - C)^n for plastic strains ep above C, else A (after Swift 1952). In each step,
    the plastic strain is found for the flow stress at the end of the step.

    See Also
    --------
    plastic, johnson_cook, material eos-strength
    """

    in_lanes = True

    G: AboveZero
    A: AboveZero
    B: FromZero
    C: float
    n: FromZero


remembers(Swift, ep=0.0)
shear_response.on(Swift)(radial_return)


@precompute.on(Swift)
def _precompute_swift(strength, memory, heat):
    return power_of_strain(strength.B, strength.n, memory.ep - strength.C)


@first_guess.on(Swift)
def _first_guess_swift(strength, before, q, slope):
    hard = before.precomputed
    excess = q - strength.A - hard
    return power_law_guess(strength.n, before.memory.ep - strength.C, hard, excess, slope)


@flow_stress.on(Swift)
def _flow_stress_swift(strength, before, increment, dt):
    strain = before.memory.ep - strength.C
    hard, slope = power_law(strength.B, strength.n, strain, before.precomputed, increment)
    return strength.A + hard, slope


class ZerilliArmstrong(NamedTuple):
    """Flow stress of metals from dislocation motion: strain, strain rate and temperature.

    Parameters
    ----------
    G
        Shear modulus.
    C0
        Constant, athermal part of the flow stress (impurities, grain size).
    C1
        Coefficient of the thermal term (bcc metals).
    C2
        Coefficient of the thermal term proportional to sqrt(plastic strain) (fcc metals).
    C3
        Thermal softening of the thermal terms, 1/K.
    C4
        Rate sensitivity: reduction of C3 per unit of ln(rate), 1/K.
    C5, n
        Hardening C5 ep^n that depends on strain alone (bcc metals).
    epsdot0
        Reference plastic strain rate: 1/s, in the units of the script.
    T
        Absolute temperature, if neither the material nor its solid has one.

    Example
    -------
    strength(copper, zerilli-armstrong, 46e9, 65e6, 0, 890e6, 0.0028, 0.000115, 0, 1)
    strength(iron, zerilli-armstrong, 80e9, 65e6, 1033e6, 0, 0.00698, 0.000415, 266e6, 0.289)

    Notes
    -----
    Y = C0 + (C1 + C2 sqrt(ep)) exp(-C3 T + C4 T ln(rate/epsdot0)) + C5 ep^n (Zerilli & Armstrong
    1987). C2 is 0 for bcc metals, C1 and C5 are 0 for fcc metals. At rest the strength is C0 + C5
    ep^n. The plastic strain of a step uses the final flow stress and mean rate.

    See Also
    --------
    johnson_cook, plastic, temperature plastic_work
    """

    in_lanes = True

    G: AboveZero
    C0: FromZero
    C1: FromZero
    C2: FromZero
    C3: FromZero
    C4: FromZero
    C5: FromZero
    n: FromZero
    epsdot0: ByName[AboveZero] = 1.0
    initial_temperature: Temperature[FromZero] = 293.0


remembers(ZerilliArmstrong, ep=0.0)
shear_response.on(ZerilliArmstrong)(radial_return)


@precompute.on(ZerilliArmstrong)
def _precompute_zerilli_armstrong(strength, memory, heat):
    T = temperature_or(heat, strength.initial_temperature)
    athermal = power_of_strain(strength.C5, strength.n, memory.ep)
    return athermal, power_of_strain(strength.C2, 0.5, memory.ep), exponential(-strength.C3 * T)


@flow_stress.on(ZerilliArmstrong)
def _flow_stress_zerilli_armstrong(strength, before, increment, dt):
    athermal, root, thermal = before.precomputed
    ep = before.memory.ep
    athermal, slope = power_law(strength.C5, strength.n, ep, athermal, increment)
    root, root_slope = power_law(strength.C2, 0.5, ep, root, increment)
    # exp(C4 T ln(rate)) is computed as a power of the rate.
    exponent = strength.C4 * temperature_or(before.heat, strength.initial_temperature)
    rate = increment / (dt * strength.epsdot0)
    at_rate = power_of_strain(1, exponent, rate)
    rate, rate_slope = power_law(1, exponent, rate, at_rate, 0)
    rate = where(exponent > 0, rate, real(1, rate))
    factor = strength.C1 + root
    slope += thermal * (rate * root_slope + factor * rate_slope / (dt * strength.epsdot0))
    return strength.C0 + thermal * rate * factor + athermal, slope
