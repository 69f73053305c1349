"""strength johnson_cook: flow stress by strain, rate and temperature."""

from __future__ import annotations

from typing import Annotated

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws.strength.johnson_cook import JohnsonCook as JohnsonCookLaw
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.part import check_temperatures, reference_rate
from karamelo_py.styles.strengths.base import Strength


class JohnsonCook(Strength):
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

    def __init__(
        self,
        hub: Hub,
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
        check_temperatures(Tr, Tm)
        epsdot0 = reference_rate(epsdot0, C, "C")
        self.law = JohnsonCookLaw(G, A, B, n, epsdot0, C, m, Tr, Tm)
