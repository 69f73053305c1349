"""Elastic laws with a temperature: thermal expansion, and constants for conduction."""

from typing import Any, NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.language.rules import suggestion
from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, symmetric_tensor
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.temperatures import Warm, initial_heat, thermal_pressure
from karamelo_py.script.errors import ScriptError


class Expansion(NamedTuple):
    """Heat constants of an elastic law; its stress is -3 K alpha (T - T0)."""

    in_lanes = True

    cp: float
    kappa: float
    alpha: float  # coefficient alpha of linear expansion
    pressure: float  # 3 K alpha, per kelvin
    initial_temperature: float  # T0 of the solid, set when the scene is lowered


class Thermoelastic(NamedTuple):
    """An elastic law with a temperature; T follows the elastic state in the state."""

    in_lanes = True
    traits = LawTraits(rebounds=True)

    elastic: Any
    heat: Any


suggestion(
    Thermoelastic,
    when=lambda law, scene: (
        not (scene.hub.update.thermal or scene.reads_temperature or law.heat.alpha)
    ),
    cost="material {owner.id} has a temperature, but no heat flows and no output uses it",
    instead="leave cp and kappa out, or method(..., thermo-mechanical)",
)


def expanding(
    law: Any, cp: float | None, kappa: float | None, alpha: float, T: float = 0.0
) -> NamedTuple:
    """If cp is given, add a temperature to `law`, initially `T` unless the solid sets one."""
    if cp is None or kappa is None:
        if cp is not None:
            raise ScriptError(
                "with the heat capacity cp the conductivity kappa is needed",
                argument="cp",
                expected="cp and kappa, or neither",
            )
        return law
    bulk = law.lam + 2 / 3 * law.G
    return Thermoelastic(law, Expansion(cp, kappa, alpha, 3 * bulk * alpha, T))


laws.column(Expansion, "T", laws.temperature)


@initial_heat.on(Expansion)
def _initial_heat_expansion(heat, template):
    return Warm(heat.initial_temperature)


@thermal_pressure.on(Expansion)
def _thermal_pressure_expansion(heat, T):
    return (heat.pressure * (T[0] - heat.initial_temperature),)


class State(NamedTuple):
    elastic: Any
    T: Any


@point_function(otherwise=True)
def warmed_elastic(elastic, T):
    """Return the elastic law at the temperature T."""
    return elastic


def expansion_pressure(law, state):
    return thermal_pressure(law.heat, (state.T,))[0]


@point_function(otherwise=True)
def is_warm(law):
    """Return True, known when compiled, if an elastic law has a temperature."""
    return False


laws.answers(Thermoelastic, {is_warm: True, laws.temperature: "T"})


def heated_by(law, kin, state, loss):
    """Warm the state by an energy `loss` per reference volume, if it has a temperature."""
    if not is_warm(law):
        return state
    warmer = loss * laws.specific_volume(law) / laws.heat_capacity(law, loss)
    return laws.with_temperature(law, kin, state, laws.temperature(law, kin, state) + warmer)


def of_elastic(function, law, kin, state):
    return function(warmed_elastic(law.elastic, state.T), kin, state.elastic)


@laws.law_here.on(Thermoelastic)
def _law_here_thermoelastic(law, within, state):
    return warmed_elastic(within, state.T)


@laws.initial_state.on(Thermoelastic)
def _initial_state_thermoelastic(law, kin, template):
    return State(laws.initial_state(law.elastic, kin, template), initial_heat(law.heat, template).T)


@laws.cauchy_stress.on(Thermoelastic)
def _cauchy_stress_thermoelastic(law, kin, state):
    return of_elastic(laws.cauchy_stress, law, kin, state) - expansion_pressure(law, state) * I


@laws.kirchhoff_stress.on(Thermoelastic)
def _kirchhoff_stress_thermoelastic(law, kin, state):
    p = laws.jacobian(law, kin, state) * expansion_pressure(law, state)
    return of_elastic(laws.kirchhoff_stress, law, kin, state) - p * I


laws.delegate(
    Thermoelastic, "elastic", "elastic", (
        laws.advance, laws.jacobian, laws.deformation, laws.by_rates, laws.specific_volume,
        laws.wave_speed_squared, laws.wave_speed_bound,
    ),
)  # fmt: skip


@laws.energy_density.on(Thermoelastic)
def _energy_density_thermoelastic(law, kin, state):
    j = laws.jacobian(law, kin, state)
    elastic = of_elastic(laws.energy_density, law, kin, state)
    return elastic + expansion_pressure(law, state) * (1 - j)


@laws.elastic_strain.on(Thermoelastic)
def _elastic_strain_thermoelastic(law, kin, state):
    warmer = state.T - law.heat.initial_temperature
    return laws.elastic_strain(law.elastic, kin, state.elastic) - law.heat.alpha * warmer * I


@laws.delegating(laws.with_stress, Thermoelastic)
def _with_stress_thermoelastic(law, kin, state, stress):
    elastic = symmetric_tensor(kin, stress) + expansion_pressure(law, state) * I
    return State(laws.with_stress(law.elastic, kin, state.elastic, elastic), state.T)


@laws.heat_capacity.on(Thermoelastic)
def _heat_capacity_thermoelastic(law, template):
    return law.heat.cp


@laws.conductivity.on(Thermoelastic)
def _conductivity_thermoelastic(law, template):
    return law.heat.kappa


@laws.with_temperature.on(Thermoelastic)
def _with_temperature_thermoelastic(law, kin, state, T):
    return State(state.elastic, T)
