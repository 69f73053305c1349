"""material eos-strength: a law in parts, found by their names.

Pressure comes from an equation of state, deviatoric stress from a strength. Viscosity, damage and
temperature may be added. The parts are NamedTuples inside the law's, so that their types select
their point functions; `Absent` stands for those that are not there, which have no numbers in the
state. The state of a point is det F, the deviatoric stress of the intact material, what each part
remembers (`Memory`), and the dissipated energy where there is any. Parts of other kinds,
a plug-in's, are chained (`karamelo_py.points.laws.further`).
"""

from math import inf, isinf, log
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import where
from karamelo_py.compiler.tuples import added, increased, only
from karamelo_py.language.rules import suggestion
from karamelo_py.points.kinematics import I, det, dev, nothing, sym, symmetric_tensor, tr
from karamelo_py.points.laws import (
    Absent,
    advance,
    can,
    cauchy_stress,
    column,
    composed,
    conductivity,
    damage,
    damage_initiation,
    dissipated_energy,
    elastic_strain,
    energy_density,
    heat_capacity,
    initial_state,
    jacobian,
    kirchhoff_stress,
    plastic_strain,
    shown,
    specific_volume,
    strengths,
    temperature,
    warmed,
    wave_speed_squared,
    with_stress,
    with_temperature,
)
from karamelo_py.points.laws.damages import initial_damage, initiation
from karamelo_py.points.laws.eos import (
    at_pressure,
    bulk_modulus,
    compressed,
    compression_energy,
    initial_energy,
    stored_heat,
    taken_heat,
)
from karamelo_py.points.laws.further import (
    chained,
    further_after,
    further_pressure,
    initial_further,
)
from karamelo_py.points.laws.named import Eos, Option, Strength
from karamelo_py.points.laws.temperatures import (
    at_temperature,
    heated,
    initial_heat,
    thermal_pressure,
)
from karamelo_py.points.laws.viscosity import initial_viscous_pressure
from karamelo_py.script.errors import ScriptError


class EosStrength(NamedTuple):
    """Pressure from an equation of state, deviatoric stress from a strength.

    Parameters
    ----------
    eos
        ID of an equation of state, which has the density too.
    strength
        ID of a strength.
    parts
        ID of a damage, ID of a temperature, in either order; each may be left out.

    Example
    -------
    eos(bulk, linear, 7850, 160e9)
    strength(mild, plastic, 80e9, 400e6)
    material(body, eos-strength, bulk, mild)

    Notes
    -----
    sigma = s - p I. The deviatoric stress s turns with the point (Jaumann rate; Hughes & Winget
    1980). The elastic strain is that of s and, with J the volume over the reference volume,
    ln J / 3; of soils, J is its elastic part. The strain energy is what unloading would give back;
    plastic work is not in it, compute dissipated_energy measures it. Where fix initial_stress sets
    a pressure, the points get the volume that has this pressure.

    See Also
    --------
    eos, strength, damage, temperature, compute max_plastic_strain, compute dissipated_energy
    """

    in_lanes = True

    eos: Any
    strength: Any
    viscosity: Any = Absent()
    damage: Any = Absent()
    temperature: Any = Absent()
    further: Any = Absent()  # of other kinds

    syntax = "eos, strength[, damage][, temperature]"

    @classmethod
    def given(cls, eos: Eos, strength: Strength, *parts: Option):
        """The law of the parts that a script has named, each in the place of its kind."""
        kinds: dict[str, Any] = {}
        for part in parts:
            if part.kind in kinds:
                raise ScriptError(
                    f"'{kinds[part.kind].id}' and '{part.id}' are both a {part.kind}",
                    argument=2 + parts.index(part),
                    expected="one damage and one temperature at most",
                )
            kinds[part.kind] = part
        laws = {k: law for part in (eos, strength, *parts) for k, law in part.laws.items()}
        further = [laws.pop(kind) for kind in list(laws) if kind not in cls._fields]
        return cls(**laws, further=chained(further))


column(EosStrength, "dissipated", dissipated_energy)


# --- parts that never act, told by `check` ------------------------------------------------------


def _idle_damage(law, scene):
    yields = can(law.strength, plastic_strain) or any(
        name in law.strength._fields for name in ("yield_stress", "A", "cohesion", "phi")
    )
    return not isinstance(law.damage, Absent) and not yields


def _idle_heat(law, scene):
    """Tell that neither the strength nor the pressure nor the damage depends on the temperature."""
    softening = getattr(law.strength, "softening", Absent())
    softens = not isinstance(softening, Absent) or not isinf(getattr(law.strength, "Tm", inf))
    pressures = getattr(law.eos, "thermal", 0), getattr(law.temperature, "alpha", 1)
    presses = any(number != 0 for number in pressures)
    wears = getattr(law.damage, "D5", 0) != 0
    return not (isinstance(law.temperature, Absent) or softens or presses or wears)


suggestion(
    EosStrength,
    when=_idle_damage,
    cost="material {owner.id} has a damage by plastic strain, and never yields",
    instead="leave the damage out",
)
suggestion(
    EosStrength,
    when=_idle_heat,
    cost="the temperature of material {owner.id} changes nothing but its column T",
    instead="leave the temperature out",
)


@initial_state.on(EosStrength)
def _initial_state_eos_strength(law, kin, like):
    m = composed.Memory(
        initial_energy(law.eos, like),
        initial_viscous_pressure(law.viscosity, like),
        initial_damage(law.damage, like),
        initial_heat(law.temperature, like),
        composed.lossless(law, like),
        strengths.initial_memory(law.strength, like),
        initial_further(law.further, like),
    )
    return composed.State(1, nothing(kin), m)


@advance.on(EosStrength)
def _advance_eos_strength(law, kin, state, dl, dt):
    before, s, m = state
    J = before * det(I + dl)
    eps = sym(dl)
    s, memory, work = strengths.respond(law.strength, law, kin, s.turned(dl), eps, J, m, dt)
    work = J * work * composed.borne_share(law.damage, m.damage, work)
    viscous = composed.viscous_after(law.viscosity, law, J, m, tr(eps) / dt)
    viscous_work = only(viscous) * (before - J)
    energy = compressed(law.eos, m.energy, before, J, work + viscous_work)
    flow = strengths.equivalent_plastic_strain(law.strength, memory)
    flow -= strengths.equivalent_plastic_strain(law.strength, m.strength)
    now = composed.Memory(energy, viscous, m.damage, m.heat, m.loss, memory, m.further)
    broken = composed.broken_further(law.damage, law, kin, now, flow, s, J, dt)
    heat = heated(law.temperature, m.heat, work * specific_volume(law.eos))
    gone = work + viscous_work + composed.released(law.damage, law, kin, J, s, now, broken)
    loss = increased(m.loss, gone)
    further = further_after(law.further, m.further, law, kin, J, s, now, dt)
    return composed.State(
        J, s, composed.Memory(energy, viscous, broken, heat, loss, memory, further)
    )


def stress_left(law, state):
    """The deviatoric stress that damage leaves, (1 - D) s."""
    return composed.borne_share(law.damage, state.m.damage, state.J) * state.s


@cauchy_stress.on(EosStrength)
def _cauchy_stress_eos_strength(law, kin, state):
    return stress_left(law, state) - composed.full_pressure(law, state.J, state.m) * I


@kirchhoff_stress.on(EosStrength)
def _kirchhoff_stress_eos_strength(law, kin, state):
    J = state.J
    return J * stress_left(law, state) - J * composed.full_pressure(law, J, state.m) * I


@jacobian.on(EosStrength)
def _jacobian_eos_strength(law, kin, state):
    return state.J


@wave_speed_squared.on(EosStrength)
def _wave_speed_squared_eos_strength(law, kin, state):
    # (K + 4/3 G) / rho, with the elastic moduli: plastic waves are slower.
    J, _, m = state
    elastic = strengths.elastic_ratio(law.strength, m.strength, J)
    modulus = bulk_modulus(law.eos, elastic, m.energy, m.heat)
    volume = specific_volume(law.eos) * J
    squared = (modulus + 4 / 3 * strengths.shear_modulus(law.strength)) * volume
    squared = strengths.damped_speed_squared(law.strength, squared, 1 / volume)
    return composed.slowed_by_viscosity(law.viscosity, law, J, m, squared, 1 / volume)


@energy_density.on(EosStrength)
def _energy_density_eos_strength(law, kin, state):
    """Return the energy that unloading at this temperature frees: plastic work is not stored."""
    J, s, m = state
    elastic = strengths.elastic_ratio(law.strength, m.strength, J)
    volume = compression_energy(law.eos, elastic, m.energy)
    volume -= stored_heat(law.eos, only(m.loss))
    volume += only(thermal_pressure(law.temperature, m.heat)) * (1 - J)
    tension = composed.intact_pressure(law, J, m) < 0
    share = composed.borne_share(law.damage, m.damage, J)
    volume = where(tension, share * volume, volume)
    return volume + J * (share * strengths.shear_energy(law.strength, kin, s))


@dissipated_energy.on(EosStrength)
def _dissipated_energy_eos_strength(law, kin, state):
    return only(state.m.loss)


@elastic_strain.on(EosStrength)
def _elastic_strain_eos_strength(law, kin, state):
    """ln J / 3, the mean of the elastic strain increments, and the elastic shear."""
    strain = symmetric_tensor(kin, strengths.shear_strain(law.strength, kin, state.s))
    elastic = strengths.elastic_ratio(law.strength, state.m.strength, state.J)
    return strain + 1 / 3 * log(elastic) * I


@plastic_strain.on(EosStrength)
def _plastic_strain_eos_strength(law, kin, state):
    return strengths.equivalent_plastic_strain(law.strength, state.m.strength)


@shown.on(strengths.Remembered)
def _shown_remembered(what, law, kin, state):
    return state.m.strength[what.place]


@with_stress.on(EosStrength)
def _with_stress_eos_strength(law, kin, state, stress):
    # Pressure follows from volume, so the point gets the volume that has this pressure.
    J, _, m = state
    stress = symmetric_tensor(kin, stress)
    elastic = strengths.elastic_ratio(law.strength, m.strength, J)
    beside = only(thermal_pressure(law.temperature, m.heat)) + only(m.viscous)
    p = -tr(stress) * (1 / 3) - further_pressure(law.further, m.further, beside)
    after, energy = at_pressure(law.eos, elastic, m.energy, p, m.heat)
    return composed.State(J * (after / elastic), dev(stress), m._replace(energy=energy))


@specific_volume.on(EosStrength)
def _specific_volume_eos_strength(law):
    return specific_volume(law.eos)


@damage.on(EosStrength)
def _damage_eos_strength(law, kin, state):
    return 1 - composed.borne_share(law.damage, state.m.damage, state.J)


@damage_initiation.on(EosStrength)
def _damage_initiation_eos_strength(law, kin, state):
    return initiation(law.damage, state.m.damage)


@temperature.on(EosStrength)
def _temperature_eos_strength(law, kin, state):
    return only(state.m.heat)


@with_temperature.on(EosStrength)
def _with_temperature_eos_strength(law, kin, state, T):
    heat = at_temperature(state.m.heat, T)
    return state._replace(m=state.m._replace(heat=heat))


@heat_capacity.on(EosStrength)
def _heat_capacity_eos_strength(law, like):
    return heat_capacity(law.temperature, like)


@warmed.on(EosStrength)
def _warmed_eos_strength(law, kin, state, heat):
    m = state.m
    taken = taken_heat(law.eos, m.energy, heat)
    m = m._replace(energy=added(m.energy, taken), loss=added(m.loss, taken))
    return state._replace(m=m)


@conductivity.on(EosStrength)
def _conductivity_eos_strength(law, like):
    return conductivity(law.temperature, like)
