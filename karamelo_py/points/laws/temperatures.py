"""Temperature of a point as changed by its law, a part of `eos_strength`.

A temperature is a NamedTuple of parameters. The history of a temperature is `Warm`, which other
parts get as `heat`; without a temperature they get ().
"""

from typing import Annotated, NamedTuple

from karamelo_py.compiler import point_function, where
from karamelo_py.language.signature import In
from karamelo_py.points.laws import column, conductivity, heat_capacity, temperature
from karamelo_py.points.laws.parameters import AboveZero, FromZero, check_temperatures


class Warm(NamedTuple):
    T: float


@point_function(otherwise=True)
def initial_heat(temperature, template):
    return ()


@point_function(otherwise=True)
def heated(temperature, heat, work):
    return heat


@point_function(otherwise=True)
def thermal_pressure(temperature, heat):
    """Return (p,), the thermal pressure, or ()."""
    return ()


def temperature_or(heat, otherwise):
    return heat.T if len(heat) else otherwise


def at_temperature(heat, T):
    return Warm(T) if len(heat) else ()


def homologous(heat, Tr, Tm):
    """Return (T - Tr) / (Tm - Tr), limited to 0 to 1."""
    return min(max((heat.T - Tr) / (Tm - Tr), 0), 1)


class PlasticWork(NamedTuple):
    """Heating by plastic work, and thermal pressure.

    Parameters
    ----------
    chi
        Fraction of plastic work converted to heat (Taylor & Quinney 1934), often 0.9.
    cp
        Heat capacity per unit mass.
    kappa
        Conductivity, used with ``method(..., thermo-mechanical)`` only.
    alpha
        Pressure per kelvin: 3 K times the linear expansion coefficient, with the bulk modulus K.
    T0
        Temperature without thermal pressure; the initial temperature unless the solid sets one.
    Tm
        Melting temperature, above which there is no heating.

    Example
    -------
    temperature(warm, plastic_work, 0.9, 385, 0, 0, 298, 1356)

    Notes
    -----
    T increases by chi/(rho0 cp) times the plastic work per reference volume. The thermal pressure
    is alpha (T - T0). Dump column: T.

    See Also
    --------
    strength johnson_cook, eos shock, material eos-strength, solid
    """

    in_lanes = True

    chi: Annotated[float, In(0, 1)]
    cp: AboveZero
    kappa: FromZero
    alpha: float
    T0: float
    Tm: float

    def checked(self):
        check_temperatures(self.T0, self.Tm, "T0")
        return self


column(PlasticWork, "T", temperature)


@initial_heat.on(PlasticWork)
def _initial_heat_plastic_work(temperature, template):
    return Warm(temperature.T0)


@heat_capacity.on(PlasticWork)
def _heat_capacity_plastic_work(law, template):
    return law.cp


@conductivity.on(PlasticWork)
def _conductivity_plastic_work(law, template):
    return law.kappa


@heated.on(PlasticWork)
def _heated_plastic_work(temperature, heat, work):
    warmer = heat.T + temperature.chi / temperature.cp * work
    return Warm(where(temperature.Tm > heat.T, warmer, heat.T))


@thermal_pressure.on(PlasticWork)
def _thermal_pressure_plastic_work(temperature, heat):
    return (temperature.alpha * (heat.T - temperature.T0),)
