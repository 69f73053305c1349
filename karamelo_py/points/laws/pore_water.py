"""Saturated soil: a law for the effective stress of the skeleton, and water in the pores.

The state also has the mass of the water and the pore volume, per initial volume: p = K ln S with S
= content / (rho pores). With a suction a < K, p = a ln S where the saturation S is below 1, and the
relative permeability is S (Gardner 1958). `advance` alone is undrained; in a run the flux through
the nodes changes the content (:mod:`karamelo_py.kernels.equations.pore_water`).
"""

from typing import Any, NamedTuple

from karamelo_py.compiler import point_function, where
from karamelo_py.compiler.powers import exponential, logarithm_near_one
from karamelo_py.points import laws


class ConstantPermeability(NamedTuple):
    in_lanes = True


class KozenyCarman(NamedTuple):
    """Permeability proportional to n^3 / (1 - n)^2."""

    in_lanes = True


class Saturated(NamedTuple):
    """The skeleton `law` with water in its pores."""

    law: Any
    n: float  # initial porosity
    drag: float  # force per pore volume and water velocity, rho g / permeability
    K: float  # bulk modulus of the water
    rho: float  # density of the water at zero pressure
    permeability: Any  # tag of a dependence on porosity
    suction: float  # suction at which the saturation is 1/e; K: pores remain full
    K_of_waves: float  # K, or 0 if the pressure is solved for and does not limit the step
    fades: float  # min(1, (M n / (2 K))^4), with the oedometric modulus M of the skeleton

    in_lanes = True


class State(NamedTuple):
    skeleton: Any
    content: Any
    pores: Any


@laws.initial_state.on(Saturated)
def _initial_state_saturated(law, kin, template):
    return State(laws.initial_state(law.law, kin, template), law.n * law.rho, law.n)


@laws.advance.on(Saturated)
def _advance_saturated(law, kin, state, dl, dt):
    old = laws.jacobian(law.law, kin, state.skeleton)
    skeleton = laws.advance(law.law, kin, state.skeleton, dl, dt)
    grown = laws.jacobian(law.law, kin, skeleton) - old
    return State(skeleton, state.content, state.pores + grown)


@laws.advance_fbar.on(Saturated)
def _advance_in_run(law, kin, state, step):
    return state._replace(skeleton=laws.advance_fbar(law.law, kin, state.skeleton, step))


laws.wraps(
    Saturated, "law", "skeleton", (
        laws.deformation, laws.jacobian, laws.kirchhoff_stress, laws.cauchy_stress,
        laws.elastic_strain, laws.dissipated_energy, laws.damage, laws.damage_initiation,
        laws.plastic_strain, laws.specific_volume, laws.shear_part, laws.by_rates, laws.with_stress,
    ),
)  # fmt: skip


@laws.energy_density.on(Saturated)
def _energy_density_saturated(law, kin, state):
    """Return the energy of skeleton and water; -p is its derivative in the pore volume."""
    x = _filled(law, state) - 1
    series = x * x * (0.5 - x * (1 / 3 - x * (0.25 - 0.2 * x)))
    compressed = where(abs(x) < 0.01, series, x - logarithm_near_one(1 + x))
    stiff = where(x < 0, law.suction, law.K)
    return laws.energy_density(law.law, kin, state.skeleton) + stiff * state.pores * compressed


def _fast_wave(law, kin, state, slow):
    """Return a bound of c^2 of two phases without drag, which grows with `slow`, the skeleton's."""
    # trace = slow + K / n ((1 - n)^2 / dry + n / rho), with one division
    dry = laws.specific_volume(law) * laws.jacobian(law, kin, state)
    grains, pores = 1 - law.n, state.pores * (state.pores + (1 - law.n))
    of_water = (grains * grains * law.rho * dry + pores) / (pores * law.rho)
    trace = slow + law.K_of_waves * of_water
    return trace - slow * law.K_of_waves / (law.rho * trace)


@laws.wave_speed_squared.on(Saturated)
def _wave_speed_squared_saturated(law, kin, state):
    return _fast_wave(law, kin, state, laws.wave_speed_squared(law.law, kin, state.skeleton))


@laws.wave_speed_bound.on(Saturated)
def _wave_speed_bound_saturated(law, kin, state):
    # The trace alone is so much larger that every point would compute the root.
    return _fast_wave(law, kin, state, laws.wave_speed_bound(law.law, kin, state.skeleton))


def _filled(law, state):
    return state.content / (law.rho * state.pores)


@laws.number
def pore_pressure(law, kin, state):
    ratio = _filled(law, state)
    return where(ratio < 1, law.suction, law.K) * logarithm_near_one(ratio)


@laws.number
def pore_stiffness(law, kin, state):
    """Return K/n, the bulk modulus of water / porosity."""
    return law.K / porosity(law, kin, state)


@laws.number
def saturation(law, kin, state):
    """Return the fraction of the pores that water fills; 1 without suction."""
    ratio = _filled(law, state)
    return where(law.suction < law.K, where(ratio < 1, ratio, 1), 1)


@laws.number
def porosity(law, kin, state):
    """Return the present porosity."""
    return state.pores / (state.pores + (1 - law.n))


@laws.number
def water_content(law, kin, state):
    """Return the water's mass per initial volume."""
    return state.content


def with_pore_pressure(law, kin, state, p):
    return state._replace(
        content=law.rho * state.pores * exponential(p / where(p < 0, law.suction, law.K))
    )


@point_function()
def drag_at(permeability, law, n):
    """Return n^2 rho g / k, the drag per unit volume and unit relative velocity at porosity n."""


@drag_at.on(ConstantPermeability)
def _drag_at_constant(permeability, law, n):
    return law.drag * n * n


@drag_at.on(KozenyCarman)
def _drag_at_kozeny(permeability, law, n):
    k = n * n * n / ((1 - n) * (1 - n)) * ((1 - law.n) * (1 - law.n) / (law.n * law.n * law.n))
    return law.drag * n * n / k


def drag_per_volume(law, kin, state):
    return drag_at(law.permeability, law, porosity(law, kin, state))


for _function in (pore_pressure, saturation, porosity, water_content):
    laws.column(Saturated, _function.__name__, _function)
