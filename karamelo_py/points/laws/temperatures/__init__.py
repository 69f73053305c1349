"""Temperature of one point, as far as the law itself changes it. One file each.

A temperature is a NamedTuple of parameters (its class is the tag), a part of a composed law
(`karamelo_py.points.laws.eos_strength`). Its memory is the temperature itself (`Warm`), which the
other parts see as `heat`: () where the law has no temperature.
"""

from typing import NamedTuple

from karamelo_py.compiler.compile import point_function


class Warm(NamedTuple):
    """Temperature of a point, and the tag of laws that have one."""

    T: float


@point_function(otherwise=True)
def initial_heat(temperature, like):
    """Warm(T) at the start, or ()."""
    return ()


@point_function(otherwise=True)
def heated(temperature, heat, work):
    """`heat` after plastic work per mass."""
    return heat


@point_function(otherwise=True)
def thermal_pressure(temperature, heat):
    """(p,), the pressure of the temperature, or ()."""
    return ()


@point_function(otherwise=True)
def temperature_or(heat, otherwise):
    """The temperature, or `otherwise` where the law has none."""
    return otherwise


@temperature_or.on(Warm)
def _temperature_or_warm(heat, otherwise):
    return heat.T


@point_function(otherwise=True)
def at_temperature(heat, T):
    """Warm(T), or () where the law has no temperature."""
    return ()


@at_temperature.on(Warm)
def _at_temperature_warm(heat, T):
    return Warm(T)


def homologous(heat, Tr, Tm):
    """(T - Tr) / (Tm - Tr), between 0 and 1."""
    return min(max((heat.T - Tr) / (Tm - Tr), 0), 1)
