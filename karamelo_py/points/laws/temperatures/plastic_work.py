"""temperature plastic_work: heating by plastic work."""

from typing import Annotated, NamedTuple

from karamelo_py.compiler.compile import where
from karamelo_py.language.signature import In, NonNegative, Positive
from karamelo_py.points.laws import column, conductivity, heat_capacity, temperature
from karamelo_py.points.laws.checks import check_temperatures
from karamelo_py.points.laws.temperatures import Warm, heated, initial_heat, thermal_pressure


class PlasticWork(NamedTuple):
    """Heating by plastic work, and the pressure that heat makes.

    Parameters
    ----------
    chi
        Share of plastic work that becomes heat (Taylor & Quinney 1934), often 0.9.
    cp
        Heat capacity per mass.
    kappa
        Conductivity, by which heat flows with ``method(..., thermo-mechanical)``; without, heat
        stays where it is made.
    alpha
        Pressure per kelvin: 3 K times the coefficient of linear expansion, with the bulk modulus K.
    T0
        Temperature without thermal pressure, at which points start where their solid does not
        say otherwise.
    Tm
        Melting temperature, from which on there is no heating.

    Example
    -------
    temperature(warm, plastic_work, 0.9, 385, 0, 0, 298, 1356)

    Notes
    -----
    T grows by chi/(rho0 cp) times the plastic work per volume before deformation; the pressure
    grows by alpha (T - T0): a warm body that cannot expand is under pressure. The column T of dumps
    shows the temperature.

    See Also
    --------
    strength johnson_cook, eos shock, material eos-strength, solid
    """

    in_lanes = True

    chi: Annotated[float, In(0, 1)]
    cp: Annotated[float, Positive]
    kappa: Annotated[float, NonNegative]
    alpha: float
    T0: float
    Tm: float

    def checked(self):
        """The law, after a look at its temperatures."""
        check_temperatures(self.T0, self.Tm, "T0")
        return self


column(PlasticWork, "T", temperature)


@initial_heat.on(PlasticWork)
def _initial_heat_plastic_work(temperature, like):
    return Warm(temperature.T0)


@heated.on(PlasticWork)
def _heated_plastic_work(temperature, heat, work):
    warmer = heat.T + temperature.chi / temperature.cp * work
    return Warm(where(temperature.Tm > heat.T, warmer, heat.T))


@thermal_pressure.on(PlasticWork)
def _thermal_pressure_plastic_work(temperature, heat):
    return (temperature.alpha * (heat.T - temperature.T0),)


@heat_capacity.on(PlasticWork)
def _heat_capacity_plastic_work(law, like):
    return law.cp


@conductivity.on(PlasticWork)
def _conductivity_plastic_work(law, like):
    return law.kappa
