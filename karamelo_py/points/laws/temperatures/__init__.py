"""Temperature of one point, as far as the law itself changes it. One file each.

A temperature is a NamedTuple of parameters (its class is the tag), a part of a composed law
(`karamelo_py.points.laws.eos_strength`). Its memory `heat` is (T,), or () where the law has
no temperature, which the other parts see.
"""

from typing import NamedTuple

from karamelo_py.compiler.compile import by_type, point_function, real


class Isothermal(NamedTuple):
    """Tag of laws without temperature."""


@point_function()
def initial_heat(temperature, like):
    """(T,) at the start, or ()."""


@initial_heat.otherwise
def _(temperature, like):
    return ()


@point_function()
def heated(temperature, heat, work):
    """`heat` after plastic work per mass."""


@heated.otherwise
def _(temperature, heat, work):
    return heat


@point_function()
def thermal_pressure(temperature, heat):
    """(p,), the pressure of the temperature, or ()."""


@thermal_pressure.otherwise
def _(temperature, heat):
    return ()


def excess(heat, Tr, factor):
    """(factor (T - Tr),) above the temperature Tr, () without a temperature."""
    return (max(heat[0] - Tr, real(0, Tr)) * factor,) if len(heat) else ()


@by_type(excess)
def _excess(heat, Tr, factor):
    if len(heat) == 0:
        return lambda heat, Tr, factor: ()
    return lambda heat, Tr, factor: (max(heat[0] - Tr, real(0, Tr)) * factor,)


def homologous(heat, Tr, Tm):
    """((T - Tr) / (Tm - Tr),) between 0 and 1, () without a temperature."""
    if len(heat) == 0:
        return ()
    return (min(max((heat[0] - Tr) / (Tm - Tr), real(0, Tr)), real(1, Tr)),)


@by_type(homologous)
def _homologous(heat, Tr, Tm):
    if len(heat) == 0:
        return lambda heat, Tr, Tm: ()
    return lambda heat, Tr, Tm: (min(max((heat[0] - Tr) / (Tm - Tr), real(0, Tr)), real(1, Tr)),)
