"""strength johnson_cook: flow stress by strain, rate and temperature (Johnson & Cook 1983)."""

from __future__ import annotations

from math import inf, log
from typing import Annotated, NamedTuple

from karamelo_py.compiler.compile import point_function, real, shared
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.checks import check_temperatures, reference_rate
from karamelo_py.points.laws.strengths.hardening import flow_stress, hardening
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

    G: Annotated[float, Positive]
    A: Annotated[float, Positive]
    B: Annotated[float, NonNegative]
    n: Annotated[float, NonNegative]
    epsdot0: Annotated[float, NonNegative]
    C: Annotated[float, NonNegative]
    m: Annotated[float, NonNegative]
    Tr: float
    Tm: float

    def checked(self):
        """The law; without the rate where nothing depends on it."""
        check_temperatures(self.Tr, self.Tm)
        reference_rate(self.epsdot0, self.C, "C")
        # Without softening T* is to be 0 whatever T is: so it is for an infinite Tm.
        law = self if self.m > 0 else self._replace(m=1.0, Tm=inf)
        return law if self.C > 0 else StaticJohnsonCook(*law[:4], *law[6:])


class StaticJohnsonCook(NamedTuple):
    """(A + B ep^n) (1 - T*^m): the law where C is 0."""

    G: float
    A: float
    B: float
    n: float
    m: float
    Tr: float
    Tm: float


hardening(JohnsonCook)
hardening(StaticJohnsonCook)


@shared
def power_law(factor, exponent, strain):
    """factor strain^exponent and its slope; at no strain the slope is left out."""
    if strain > 0:
        value = factor * strain**exponent
        return value, exponent * value / strain
    return real(0, strain), real(0, strain)


@point_function()
def softening(heat, Tr, Tm, m):
    """1 - T*^m, and 1 without a temperature."""


@softening.otherwise
def _(heat, Tr, Tm, m):
    return real(1, m)


@softening.on(Warm)
def _(heat, Tr, Tm, m):
    return real(1, m) - homologous(heat, Tr, Tm) ** m


@flow_stress.on(StaticJohnsonCook)
def _(strength, memory, increment, heat, dt):
    hard, slope = power_law(strength.B, strength.n, memory[0] + increment)
    soft = softening(heat, strength.Tr, strength.Tm, strength.m)
    return (strength.A + hard) * soft, slope * soft


@flow_stress.on(JohnsonCook)
def _(strength, memory, increment, heat, dt):
    one = real(1, increment)
    hard, slope = power_law(strength.B, strength.n, memory[0] + increment)
    soft = softening(heat, strength.Tr, strength.Tm, strength.m)
    static, slope = (strength.A + hard) * soft, slope * soft
    rate = increment / (dt * strength.epsdot0)
    if rate > one:
        factor = one + strength.C * log(rate)
        return static * factor, slope * factor + static * strength.C / increment
    return static, slope
