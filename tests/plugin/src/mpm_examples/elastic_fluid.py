"""material elastic-fluid: a law of its own, as functions of one point. Its state is (det F,)."""

from typing import Annotated, NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.compiler.tuples import scale
from karamelo_py.language.signature import Positive
from karamelo_py.points.kinematics import add_pressure, volume_ratio, zero_symmetric
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    elastic_strain,
    energy_density,
    initial_state,
    jacobian,
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

    specific_volume: float  # reference volume per mass
    K: float

    @classmethod
    def given(cls, rho: Annotated[float, Positive], K: Annotated[float, Positive]):
        """The law from density and bulk modulus."""
        return cls(1 / rho, K)


@initial_state.on(ElasticFluid)
def _initial_state_elastic_fluid(law, kin, like):
    return (real(1, like),)


@advance.on(ElasticFluid)
def _advance_elastic_fluid(law, kin, state, dl, dt):
    return (state[0] * volume_ratio(kin, dl),)


@cauchy_stress.on(ElasticFluid)
def _cauchy_stress_elastic_fluid(law, kin, state):
    # Without shear: sigma = K (J - 1) I.
    zero = zero_symmetric(kin, law.K)
    return add_pressure(kin, real(1, law.K), zero, law.K * (state[0] - real(1, law.K)))


@kirchhoff_stress.on(ElasticFluid)
def _kirchhoff_stress_elastic_fluid(law, kin, state):
    return scale(state[0], cauchy_stress(law, kin, state))


@jacobian.on(ElasticFluid)
def _jacobian_elastic_fluid(law, kin, state):
    return state[0]


@wave_speed_squared.on(ElasticFluid)
def _wave_speed_squared_elastic_fluid(law, kin, state):
    # dp/d(density), with density = rho0 / J
    return law.K * law.specific_volume * state[0] * state[0]


@energy_density.on(ElasticFluid)
def _energy_density_elastic_fluid(law, kin, state):
    excess = state[0] - real(1, law.K)
    return real(0.5, law.K) * law.K * excess * excess


@elastic_strain.on(ElasticFluid)
def _elastic_strain_elastic_fluid(law, kin, state):
    third = (state[0] - real(1, law.K)) / real(3, law.K)
    return add_pressure(kin, real(1, law.K), zero_symmetric(kin, law.K), third)
