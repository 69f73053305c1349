"""material elastic-fluid: a law of its own, as functions of one point. Its state is det F."""

from typing import Annotated, Any, NamedTuple

from karamelo_py.language.signature import Positive
from karamelo_py.points.kinematics import I, det, nothing
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    elastic_strain,
    energy_density,
    initial_state,
    kirchhoff_stress,
    wave_speed_squared,
)


class ElasticFluid(NamedTuple):
    """A fluid without viscosity whose pressure follows its volume: p = K (1 - J).

    Parameters
    ----------
    rho
        Density.
    K
        Bulk modulus.

    Example
    -------
    material(water, elastic-fluid, 1000, 2e9)
    """

    rho: Annotated[float, Positive]
    K: Annotated[float, Positive]


class FluidState(NamedTuple):
    """State of a point."""

    J: Any  # det F


@initial_state.on(ElasticFluid)
def _initial_state_elastic_fluid(law, kin, template):
    return FluidState(1)


@advance.on(ElasticFluid)
def _advance_elastic_fluid(law, kin, state, dl, dt):
    return FluidState(state.J * det(I + dl))


@cauchy_stress.on(ElasticFluid)
def _cauchy_stress_elastic_fluid(law, kin, state):
    return nothing(kin) + law.K * (state.J - 1) * I  # no shear


@kirchhoff_stress.on(ElasticFluid)
def _kirchhoff_stress_elastic_fluid(law, kin, state):
    return state.J * cauchy_stress(law, kin, state)


@wave_speed_squared.on(ElasticFluid)
def _wave_speed_squared_elastic_fluid(law, kin, state):
    # dp/d(density), with density = rho0 / J
    return law.K / law.rho * state.J * state.J


@energy_density.on(ElasticFluid)
def _energy_density_elastic_fluid(law, kin, state):
    excess = state.J - 1
    return 0.5 * law.K * excess * excess


@elastic_strain.on(ElasticFluid)
def _elastic_strain_elastic_fluid(law, kin, state):
    return nothing(kin) + (state.J - 1) / 3 * I
