"""A temperature, a part of eos-strength."""

from typing import Annotated, NamedTuple

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.points.laws import column, temperature
from karamelo_py.points.laws.temperatures import Warm, heated, initial_heat


class Heating(NamedTuple):
    """All plastic work becomes heat, which stays where it is made.

    Parameters
    ----------
    cp
        Heat capacity per mass.
    T0
        Temperature at the start.

    Example
    -------
    temperature(warm, heating, 385, 298)
    """

    cp: Annotated[float, Positive]
    T0: Annotated[float, NonNegative]


column(Heating, "T", temperature)


@initial_heat.on(Heating)
def _initial_heat_heating(temperature, template):
    return Warm(temperature.T0)


@heated.on(Heating)
def _heated_heating(temperature, heat, work):
    return Warm(heat.T + work / temperature.cp)
