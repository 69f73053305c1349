"""Adiabatic heating by plastic work, and the pressure of a temperature."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.points.laws import conductivity, heat_capacity
from karamelo_py.points.laws.temperatures import heated, initial_heat, thermal_pressure


class PlasticWork(NamedTuple):
    """dT = chi dW / cp below Tm, W the plastic work per mass; p = alpha (T - T0)."""

    chi: float  # share of plastic work that becomes heat (Taylor & Quinney)
    cp: float  # heat capacity per mass
    kappa: float  # conductivity
    alpha: float  # pressure per kelvin
    T0: float  # temperature without thermal pressure
    Tm: float  # melting temperature


@initial_heat.on(PlasticWork)
def _(temperature, like):
    return (temperature.T0,)


@heated.on(PlasticWork)
def _(temperature, heat, work):
    if heat[0] < temperature.Tm:
        return (heat[0] + temperature.chi / temperature.cp * work,)
    return heat


@thermal_pressure.on(PlasticWork)
def _(temperature, heat):
    return (temperature.alpha * (heat[0] - temperature.T0),)


@heat_capacity.on(PlasticWork)
def _(law, like):
    return law.cp


@conductivity.on(PlasticWork)
def _(law, like):
    return law.kappa
