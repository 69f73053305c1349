"""Viscosity newtonian: a viscous stress added to a solid law."""

from math import inf
from typing import Any, NamedTuple

from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, LargeIncrement, dev, inner, inv, nothing, sym, tr
from karamelo_py.points.laws import law_parts, law_traits
from karamelo_py.points.laws.parameters import FromZero, MaterialArgument
from karamelo_py.points.laws.strengths.linear import Viscous
from karamelo_py.points.laws.thermoelastic import heated_by, is_warm
from karamelo_py.points.laws.viscosity import damped, inviscid


class SolidMaterial(MaterialArgument):
    @classmethod
    def refusal(cls, law: Any) -> tuple[str, str] | None:
        parts = [*law_parts(law)]
        if laws.is_rigid(law):
            return "is rigid", "a material that deforms"
        if any(isinstance(one, Newtonian) for one in parts):
            return "has this viscosity already", "one viscosity(newtonian, ...)"
        if any(isinstance(one, Viscous) or law_traits(one).any_speed for one in parts):
            return "is a fluid", "its viscosity in strength(ID, fluid, mu)"
        return None


class Newtonian(NamedTuple):
    """Viscous stress proportional to the strain rate, in parallel with a solid law.

    Parameters
    ----------
    material
        ID of a solid material.
    mu
        Dynamic viscosity of shear.
    bulk
        Viscosity of volume changes.

    Example
    -------
    material(rubber, neo-hookean, 1000, 1e6, 0.4)
    viscosity(newtonian, rubber, 20)

    Notes
    -----
    sigma = sigma_s + 2 mu dev(D) + bulk tr(D) I, with the strain rate D in the middle of the step,
    which is 0 in a rotation (Kelvin-Voigt solid). The viscous work is dissipated, and heats a
    material with a temperature. The stable step is shorter, as for the wave speed sqrt(c^2 + a^2) +
    a, where c is the elastic wave speed and a = (4/3 mu + bulk)/(rho h).

    See Also
    --------
    viscosity prony, strength fluid, compute dissipated_energy
    """

    in_lanes = True

    law: Any
    mu: float
    bulk: float
    cell_size: float  # h, set when the scene is lowered

    @classmethod
    def given(cls, material: SolidMaterial, mu: FromZero, bulk: FromZero = 0.0):
        return cls(material.whole, mu, bulk, inf)


class State(NamedTuple):
    solid: Any
    viscous: Any  # Cauchy stress
    loss: Any  # dissipated energy per reference volume


@laws.initial_state.on(Newtonian)
def _initial_state_newtonian(law, kin, template):
    return State(laws.initial_state(law.law, kin, template), nothing(kin), 0.0)


@laws.advance.on(Newtonian)
def _advance_newtonian(law, kin, state, dl, dt):
    return laws.advance_fbar(law, kin, state, laws.FbarStep(dl, dt, 0))


@laws.advance_fbar.on(Newtonian)
def _advance_fbar_newtonian(law, kin, state, step):
    solid = laws.advance_fbar(law.law, kin, state.solid, step)
    dl = step.dl.dl if isinstance(step.dl, LargeIncrement) else step.dl
    strain = sym(dl @ inv(I + 0.5 * dl))
    viscous = 1 / step.dt * (2 * law.mu * dev(strain) + law.bulk * tr(strain) * I)
    loss = laws.jacobian(law.law, kin, solid) * inner(viscous, strain)
    return State(heated_by(law.law, kin, solid, loss), viscous, state.loss + loss)


laws.wraps(
    Newtonian, "law", "solid", (
        laws.jacobian, laws.deformation, laws.elastic_strain, laws.temperature, laws.by_rates,
        laws.specific_volume, laws.heat_capacity, laws.conductivity, laws.with_temperature,
        laws.energy_density, laws.plastic_strain, laws.damage, laws.damage_initiation,
        laws.shear_part, laws.is_round, laws.warmed, is_warm,
    ),
)  # fmt: skip


@inviscid.on(Newtonian)
def _inviscid_newtonian(law):
    return inviscid(law.law)


@laws.cauchy_stress.on(Newtonian)
def _cauchy_stress_newtonian(law, kin, state):
    return laws.cauchy_stress(law.law, kin, state.solid) + state.viscous


@laws.kirchhoff_stress.on(Newtonian)
def _kirchhoff_stress_newtonian(law, kin, state):
    J = laws.jacobian(law.law, kin, state.solid)
    return laws.kirchhoff_stress(law.law, kin, state.solid) + J * state.viscous


@laws.dissipated_energy.on(Newtonian)
def _dissipated_energy_newtonian(law, kin, state):
    return state.loss + laws.dissipated_energy(law.law, kin, state.solid)


def _damp(function):
    @function.on(Newtonian)
    def _damped_by_viscosity(law, kin, state):
        volume = laws.specific_volume(law) * laws.jacobian(law, kin, state)
        a = (4 / 3 * law.mu + law.bulk) * volume / law.cell_size
        return damped(function(law.law, kin, state.solid), a)


for _function in (laws.wave_speed_squared, laws.wave_speed_bound):
    _damp(_function)


@laws.delegating(laws.with_stress, Newtonian)
def _with_stress_newtonian(law, kin, state, stress):
    return state._replace(solid=laws.with_stress(law.law, kin, state.solid, stress))
