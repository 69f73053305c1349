"""Material eos-strength: a law composed of parts named in the script.

An equation of state gives the pressure, a strength the deviatoric stress. Viscosity, damage and
temperature are optional (`Absent`, without numbers in the state). Plug-ins may chain further parts
(`karamelo_py.points.laws.further`).
"""

from math import log, sqrt
from typing import Any, ClassVar, Literal, NamedTuple

from karamelo_py.compiler import real, where
from karamelo_py.language.arguments import Argument, look_up
from karamelo_py.language.rules import known_failure, suggestion
from karamelo_py.language.scene import Scene
from karamelo_py.points import laws
from karamelo_py.points.kinematics import (
    I,
    Space,
    det,
    dev,
    nothing,
    sym,
    symmetric_tensor,
    tr,
    von_mises,
)
from karamelo_py.points.laws import Absent, can, eos, law_traits, parameter, strengths
from karamelo_py.points.laws.damages import (
    FlowStep,
    JohnsonCookDamage,
    damage_after,
    initial_damage,
    initiation,
    integrity,
)
from karamelo_py.points.laws.eos import ratio_at_pressure
from karamelo_py.points.laws.further import (
    chained,
    further_after,
    further_pressure,
    initial_further,
)
from karamelo_py.points.laws.logarithmic import Logarithmic, elastic_trial
from karamelo_py.points.laws.strengths import StrainStep
from karamelo_py.points.laws.strengths.hardening import before_flow, flow_stress
from karamelo_py.points.laws.temperatures import (
    at_temperature,
    heated,
    initial_heat,
    thermal_pressure,
)
from karamelo_py.points.laws.thermoelastic import is_warm
from karamelo_py.points.laws.viscosity import (
    ViscosityWithFlux,
    damped,
    diffuses_energy,
    energy_diffusivity,
    inviscid,
    viscous_pressure,
    viscous_speed,
)
from karamelo_py.script.errors import ScriptError, unknown

LEAST_LEFT = 0.1  # fraction of its energy that a point retains when heat flows
WARMER = 1.0, 100.0, 1000.0  # temperatures in kelvin above the present one, for a test


class Eos:
    script_kind: ClassVar[str] = "the ID of an equation of state"
    kind: ClassVar[str] = "eos"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        return look_up(hub.parts[cls.kind], argument)


class Strength(Eos):
    script_kind = "the ID of a strength"
    kind = "strength"


class Option:
    script_kind: ClassVar[str] = "the ID of a damage or of a temperature"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        word = argument.word()
        optional = {
            kind: named for kind, named in hub.parts.items() if kind not in ("eos", "strength")
        }
        parts = {ID: component for named in optional.values() for ID, component in named.items()}
        several = [kind for kind, named in optional.items() if word in named]
        if len(several) > 1:
            raise ScriptError(
                f"'{word}' is the ID of {' and of '.join(f'a {kind}' for kind in several)}",
                mark=argument.mark,
                expected="an ID that only one of them has",
                hint=" and ".join(f"{kind}({word}_{kind}, ...)" for kind in several),
            )
        if word in parts:
            return parts[word]
        said = f"unknown {' or '.join(optional)} '{argument.text}'"
        raise unknown(said, word or "", parts, mark=argument.mark)


class EosStrength(NamedTuple):
    """Pressure from an equation of state, deviatoric stress from a strength.

    Parameters
    ----------
    eos
        ID of an equation of state, which also sets the density.
    strength
        ID of a strength.
    parts
        ID of a damage, ID of a temperature, in either order; both optional.
    strain
        ``rate`` (default): the symmetric part of dt grad v is the strain increment, the skew part
        rotates s. ``logarithmic``: s is computed from the logarithmic elastic strain, which is
        exact for steps of any size.

    Example
    -------
    eos(bulk, linear, 7850, 160e9)
    strength(mild, plastic, 80e9, 400e6)
    material(body, eos-strength, bulk, mild)
    material(bar, eos-strength, bulk, mild, strain=logarithmic)

    Notes
    -----
    sigma = s - p I. The deviatoric stress s rotates with the point (Jaumann rate; Hughes & Winget
    1980), or is 2 G dev of the logarithmic elastic strain (Simo 1992); in small steps, both differ
    only at large elastic shear. The elastic strain is the strain due to s plus ln J / 3 (for soils,
    with the elastic part of J). The strain energy does not include plastic work (see compute
    dissipated_energy). Fix initial_stress changes the volume of points by its pressure.

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
    strain: Any = Absent()  # default: rates
    further: Any = Absent()

    syntax = "eos, strength[, damage][, temperature][, strain=logarithmic]"

    @classmethod
    def given(
        cls,
        eos: Eos,
        strength: Strength,
        *parts: Option,
        strain: Literal["rate", "logarithmic"] = "rate",
    ):
        kinds: dict[str, Any] = {}
        for component in parts:
            if component.kind in kinds:
                raise ScriptError(
                    f"'{kinds[component.kind].id}' and '{component.id}' are both a "
                    f"{component.kind}",
                    argument=2 + parts.index(component),
                    expected="one damage and one temperature at most",
                )
            kinds[component.kind] = component
        laws = {
            k: law for component in (eos, strength, *parts) for k, law in component.laws.items()
        }
        volumes = strengths.elastic_ratio, strengths.inelastic_ratio
        if any(one.defined(type(laws["strength"])) for one in volumes) and not (
            ratio_at_pressure.defined(type(laws["eos"]))
        ):
            raise ScriptError(
                f"pressure makes strength '{strength.id}' flow, which a gas cannot do",
                argument="eos",
                expected="the eos of a solid or of a liquid",
            )
        further = [laws.pop(kind) for kind in list(laws) if kind not in cls._fields]
        elastic = Absent() if strain == "rate" else Logarithmic()
        return cls(**laws, strain=elastic, further=chained(further))


def _idle_damage(law, scene):
    yields = strengths.equivalent_plastic_strain.defined(type(law.strength))
    return isinstance(law.damage, JohnsonCookDamage) and not yields


def _idle_heat(law, scene):
    pressures = parameter(law.eos, "thermal"), parameter(law.temperature, "alpha", 1)
    presses = any(number != 0 for number in pressures)
    heat = initial_heat(law.temperature, 1.0)
    if presses or not heat or scene.reads_temperature:
        return False
    present = _strained(law, heat)
    return all(_strained(law, heat._replace(T=heat.T + more)) == present for more in WARMER)


def _strained(law, heat):
    strength, damage, results = law.strength, law.damage, []
    if damage_after.defined(type(damage)):
        step = FlowStep(0.1, 1.0, heat, 1.0, nothing(Space()), 0.0)
        results.append(damage_after(damage, initial_damage(damage, 1.0), step))
    if flow_stress.defined(type(strength)):
        before = before_flow(strength, strengths.initial_memory(strength, 1.0), heat)
        results.append(flow_stress(strength, before, 0.1, 1.0))
    return results


suggestion(
    EosStrength,
    when=_idle_damage,
    cost="material {owner.id} has a damage by plastic strain, but never yields",
    instead="leave the damage out",
)
suggestion(
    EosStrength,
    when=_idle_heat,
    cost="the temperature of material {owner.id} only affects its column T",
    instead="leave the temperature out",
)


known_failure(
    EosStrength,
    "heat flux of material '{owner.id}'",
    when=lambda law, scene: diffuses_energy(law) and not scene.hub.update.thermal,
    reason="Qh has no effect, because no heat flows in a mechanical method",
    cure="method(..., thermo-mechanical), or no Qh",
)


def _supersonic(law, scene):
    return can(law, eos.taken_heat) and scene.speed > 1


known_failure(
    EosStrength,
    "shocks of material '{owner.id}'",
    when=lambda law, scene: (
        _supersonic(law, scene) and isinstance(law.viscosity, Absent) and scene.kept > 0.9
    ),
    reason="points move at {scene.speed:.2g} times the speed of sound, and with "
    "{scene.transfer_name} and no artificial viscosity there are no shocks: colliding gas "
    "passes through itself",
    cure="Q1=2, Q2=0.2 in eos ideal-gas, or TPIC with quadratic-spline",
)
known_failure(
    EosStrength,
    "wall heating in material '{owner.id}'",
    when=lambda law, scene: (
        _supersonic(law, scene)
        and not isinstance(law.viscosity, Absent)
        and not diffuses_energy(law)
    ),
    reason="artificial viscosity initially overheats a gas that hits a wall, an axis or a "
    "point: its density there stays too low, around a point by half at four cells and by a "
    "quarter at ten cells, with any basis, transfer and step",
    cure="Q1=0.1, Q2=0.1 and Qh=3 in eos ideal-gas, with method(ulmpm, APIC, cubic-spline, "
    "thermo-mechanical) and scheme(usavg)",
)
known_failure(
    EosStrength,
    "shocks of material '{owner.id}'",
    when=lambda law, scene: (
        (_supersonic(law, scene) and diffuses_energy(law) and scene.hub.update.thermal)
        and (scene.linear or not scene.moments)
    ),
    reason="with {scene.transfer_name} and the basis {scene.basis_name}, densities of points "
    "behind a shock scatter by half or more of their mean",
    cure="method(ulmpm, APIC, cubic-spline, thermo-mechanical) and scheme(usavg)",
)


FAST = 0.02  # fraction of the wave speed above which impacts make metals yield


def _locks(law, scene):
    """Return True if isochoric flow in load steps locks cells of a linear basis."""
    slow = not scene.scheme.traits.inertia and not scene.hub.domain.kin.hoops
    return scene.locks and slow and _flows_by_shear(law) and {"mark": scene.method.mark}


def _locks_at_impact(law, scene):
    """Return True if cells lock at impact in the total frame, where points stay in their cells."""
    fast = scene.scheme.traits.inertia and not scene.moves and scene.speed > FAST
    return scene.locks and fast and _flows_by_shear(law) and {"mark": scene.method.mark}


def _flows_by_shear(law):
    flows = strengths.equivalent_plastic_strain.defined(type(law.strength))
    return flows and not strengths.pressure_response.defined(type(law.strength))


known_failure(
    EosStrength,
    "locking",
    when=_locks,
    reason="material '{owner.id}' flows at constant volume, which the basis {scene.basis_name} "
    "without F-bar cannot represent around a corner: the load rises past the limit load (a footing "
    "carries 6.3 to 6.7 c B instead of 5.1)",
    cure="anti_volumetric_locking(true), or quadratic-spline",
)
known_failure(
    EosStrength,
    "locking",
    when=_locks_at_impact,
    reason="material '{owner.id}' flows at constant volume, which the basis {scene.basis_name} "
    "without F-bar cannot represent in the total frame: the body is too stiff (the foot of a "
    "copper bar that hits a wall is 11 % too narrow)",
    cure="anti_volumetric_locking(true), or method ulmpm",
)


class Memory(NamedTuple):
    energy: Any  # history variables of the equation of state
    viscous: Any
    damage: Any
    heat: Any
    loss: Any  # dissipated energy per reference volume
    strength: Any
    further: Any


class State(NamedTuple):
    J: Any
    s: Any  # deviatoric stress of the intact material
    m: Memory


@laws.initial_state.on(EosStrength)
def _initial_state_eos_strength(law, kin, template):
    viscous = () if isinstance(law.viscosity, Absent) else (0.0,)
    m = Memory(
        eos.initial_energy(law.eos, template),
        viscous,
        initial_damage(law.damage, template),
        initial_heat(law.temperature, template),
        # (0,) if a part dissipates energy
        strengths.initial_loss(law.strength, template)
        or viscous
        or eos.initial_loss(law.eos, template),
        strengths.initial_memory(law.strength, template),
        initial_further(law.further, template),
    )
    return State(1, nothing(kin), m)


@laws.advance.on(EosStrength)
def _advance_eos_strength(law, kin, state, dl, dt):
    return laws.advance_fbar(law, kin, state, laws.FbarStep(dl, dt, 0))


@laws.advance_fbar.on(EosStrength)
def _advance_fbar_eos_strength(law, kin, state, step):
    dl, dt, extra = step
    before, s, m = state
    J = before * det(I + dl)
    s, strain = rotated_with_point(law, kin, state, dl)
    step = StrainStep(s, strain, J, dt, extra)
    s, memory, work = strengths.respond(law.strength, law, kin, step, m)
    work = J * work * integrity_of(law, m.damage)
    viscous = viscous_after(law, J, m, tr(strain) / dt)
    viscous_work = sum(viscous) * (before - J)
    volumes = eos.VolumeStep(before, J, dt)
    memories = zip((m.strength, memory), volumes, strict=False)
    elastic = [strengths.elastic_ratio(law.strength, old, j) for old, j in memories]
    elastic = eos.VolumeStep(*elastic, dt)
    heating = work + viscous_work
    for inelastic in strengths.inelastic_ratio(law.strength, memory):
        heating /= inelastic
    energy = eos.compressed(law.eos, m.energy, elastic, heating)
    crushed = eos.crush_work(law.eos, m.energy, energy, elastic)
    for inelastic in strengths.inelastic_ratio(law.strength, memory):
        crushed = inelastic * crushed
    flow = strengths.equivalent_plastic_strain(law.strength, memory)
    flow -= strengths.equivalent_plastic_strain(law.strength, m.strength)
    now = m._replace(energy=energy, viscous=viscous, strength=memory)
    work -= energy_of_swelling(law, J, m.strength, now)
    intact = State(J, s, now)
    damage = damage_after_flow(law, intact, flow, volumes)
    heat = heated(law.temperature, m.heat, (work + crushed) * laws.specific_volume(law.eos))
    gone = work + crushed + viscous_work + released(law, kin, intact, damage)
    loss = tuple([lost + gone for lost in m.loss])
    further = further_after(law.further, m.further, law, step._replace(s=s), now)
    return State(J, s, now._replace(damage=damage, heat=heat, loss=loss, further=further))


def present(law, m):
    return strengths.present(law.strength, m.strength)


def rotated_with_point(law, kin, state, dl):
    s = state.s
    if isinstance(law.strain, Absent):
        # The stress of a fluid follows from the strain at the end of the step and is not rotated.
        elastic = law_traits(law.strength).rebounds
        return s.turned(dl), dl.strain_at_end() if elastic else sym(dl)
    e = symmetric_tensor(kin, strengths.shear_strain(present(law, state.m), kin, s))
    return s, elastic_trial(law.strain, e, dl) - e


def intact_pressure(law, j, m):
    elastic = strengths.elastic_ratio(law.strength, m.strength, j)
    p = eos.pressure(law.eos, elastic, m.energy, m.heat)
    p += strengths.added_pressure(law.strength, m.strength)
    p += sum(thermal_pressure(law.temperature, m.heat))
    return further_pressure(law.further, m.further, p)


def energy_of_swelling(law, j, before, m):
    """Return the change of elastic energy by a plastic volume change."""
    ratios = [strengths.inelastic_ratio(law.strength, memory) for memory in (before, m.strength)]
    elastic, energy = strengths.elastic_ratio(law.strength, m.strength, j), 0
    for old, new in zip(*ratios, strict=True):
        energy += (new - old) * energy_to_unload(law, elastic, m)
    return energy


def volume_energy(law, j, m):
    """Return the volumetric energy of the intact material at its temperature."""
    elastic = strengths.elastic_ratio(law.strength, m.strength, j)
    energy = energy_of_elastic_volume(law, elastic, m)
    for inelastic in strengths.inelastic_ratio(law.strength, m.strength):
        energy += (inelastic - 1) * energy_to_unload(law, elastic, m)
    return energy


def energy_to_unload(law, elastic, m):
    """Return the energy per elastic volume that is released with the pressure."""
    energy = energy_of_elastic_volume(law, elastic, m)
    if len(m.heat):
        # Thermal expansion: a warm point without pressure is larger than its rest volume.
        warm = warm_pressure(law, elastic, m)
        K = eos.bulk_modulus(law.eos, elastic, m.energy, m.heat)
        energy += 0.5 * warm * warm * elastic / K
    return energy


def warm_pressure(law, elastic, m):
    warm = sum(thermal_pressure(law.temperature, m.heat))
    if len(m.heat):  # the eos has a thermal pressure
        warm += eos.pressure(law.eos, elastic, m.energy, m.heat)
        warm -= eos.pressure(law.eos, elastic, m.energy, ())
    return warm


def energy_of_elastic_volume(law, elastic, m):
    energy = eos.compression_energy(law.eos, elastic, m.energy)
    energy += strengths.added_energy(law.strength, law, elastic, m)
    energy -= eos.stored_heat(law.eos, sum(m.loss))
    return energy + warm_pressure(law, elastic, m) * (1 - elastic)


def full_pressure(law, j, m):
    """Return the pressure in the stress; damage reduces only tension."""
    p = intact_pressure(law, j, m)
    return where(p < 0, p * integrity_of(law, m.damage), p) + sum(m.viscous)


def sound(law, j, m):
    elastic = strengths.elastic_ratio(law.strength, m.strength, j)
    K = eos.bulk_modulus(law.eos, elastic, m.energy, m.heat)
    return sqrt(K * laws.specific_volume(law.eos) * j - sound_lost_to_damage(law, j, m))


def sound_lost_to_damage(law, j, m):
    """Return the decrease of the squared wave speed due to damage.

    A broken point in tension has no waves, but its cracks may soon close, so the wave speed of
    rubble at its initial volume is a lower bound.
    """
    if isinstance(law.damage, Absent):
        return 0
    closed = min(j, 1)
    elastic = strengths.elastic_ratio(law.strength, m.strength, j)
    whole = eos.bulk_modulus(law.eos, elastic, m.energy, m.heat) * j
    rubble = eos.bulk_modulus(law.eos, elastic * (closed / j), m.energy, m.heat) * closed
    gone = max(whole - max(integrity_of(law, m.damage) * whole, rubble), 0)
    tension = intact_pressure(law, j, m) < 0
    return where(tension, gone * laws.specific_volume(law.eos), 0)


def viscous_after(law, j, m, rate):
    if isinstance(law.viscosity, Absent):
        return ()
    density = 1 / (laws.specific_volume(law.eos) * j)
    return (viscous_pressure(law.viscosity, rate, density, sound(law, j, m)),)


def integrity_of(law, memory):
    return 1 if isinstance(law.damage, Absent) else integrity(law.damage, memory)


def damage_after_flow(law, state, strain, volumes):
    if isinstance(law.damage, Absent):
        return ()
    J, s, m = state
    p = intact_pressure(law, J, m)
    bound = von_mises(s) + 1e-3 * abs(p)
    stressed = bound > 0
    triaxiality = where(stressed, -p / where(stressed, bound, 1), 0)
    expansion = volumes.j / volumes.before - 1
    step = FlowStep(strain, triaxiality, m.heat, volumes.dt, s - p * I, expansion)
    return damage_after(law.damage, m.damage, step)


def released(law, kin, state, damage):
    if isinstance(law.damage, Absent):
        return 0
    J, s, m = state
    shear = J * strengths.shear_energy(present(law, m), kin, s)
    tension = intact_pressure(law, J, m) < 0
    energy = shear + where(tension, volume_energy(law, J, m), 0)
    return (integrity(law.damage, m.damage) - integrity(law.damage, damage)) * energy


def stress_left(law, state):
    return integrity_of(law, state.m.damage) * state.s


@laws.cauchy_stress.on(EosStrength)
def _cauchy_stress_eos_strength(law, kin, state):
    return stress_left(law, state) - full_pressure(law, state.J, state.m) * I


@laws.kirchhoff_stress.on(EosStrength)
def _kirchhoff_stress_eos_strength(law, kin, state):
    J = state.J
    return J * stress_left(law, state) - J * full_pressure(law, J, state.m) * I


@laws.by_rates.on(EosStrength)
def _by_rates_eos_strength(law):
    return isinstance(law.strain, Absent)


@laws.dissipated_energy.on(EosStrength)
def _dissipated_energy_eos_strength(law, kin, state):
    return sum(state.m.loss)


@laws.temperature.on(EosStrength)
def _temperature_eos_strength(law, kin, state):
    """Return the temperature or, if artificial heat flows, the internal energy per mass."""
    if isinstance(law.viscosity, ViscosityWithFlux):
        return state.m.energy[0] * laws.specific_volume(law.eos)
    return sum(state.m.heat)


laws.delegate(EosStrength, "eos", "", (laws.specific_volume,))
laws.delegate(EosStrength, "temperature", "", (laws.conductivity,))


@laws.delegating(laws.heat_capacity, EosStrength)
def _heat_capacity_eos_strength(law, template):
    if isinstance(law.viscosity, ViscosityWithFlux):
        return real(1, template)
    return laws.heat_capacity(law.temperature, template)


@laws.conductivity_now.on(EosStrength)
def _conductivity_now_eos_strength(law, kin, state, most):
    if not isinstance(law.viscosity, ViscosityWithFlux):
        return laws.conductivity(law, most)
    J, _, m = state
    density = 1 / (laws.specific_volume(law.eos) * J)
    flux = energy_diffusivity(law.viscosity, m.viscous[0], density, sound(law, J, m))
    return density * min(flux, most)


@laws.wave_speed_squared.on(EosStrength)
def _wave_speed_squared_eos_strength(law, kin, state):
    # Squared speed of elastic waves, (K + 4/3 G) / rho; plastic waves are slower.
    J, _, m = state
    elastic = strengths.elastic_ratio(law.strength, m.strength, J)
    modulus = eos.bulk_modulus(law.eos, elastic, m.energy, m.heat)
    volume = laws.specific_volume(law.eos) * J
    shear = 4 / 3 * strengths.shear_modulus(present(law, m)) * integrity_of(law, m.damage)
    squared = (modulus + shear) * volume - sound_lost_to_damage(law, J, m)
    squared = strengths.damped_speed_squared(law.strength, squared, 1 / volume)
    if isinstance(law.viscosity, Absent):
        return squared
    viscous = viscous_speed(law.viscosity, m.viscous[0], 1 / volume, sound(law, J, m))
    return damped(squared, viscous)


@laws.meeting.on(EosStrength)
def _meeting_eos_strength(law, state, speed):
    J, _, m = state
    if isinstance(law.viscosity, Absent):
        return state
    at_once = viscous_after(law, J, m, -speed / law.viscosity.cell_size)
    return state._replace(m=m._replace(viscous=(max(at_once[0], m.viscous[0]),)))


@inviscid.on(EosStrength)
def _inviscid_eos_strength(law):
    return law._replace(viscosity=Absent(), strength=inviscid(law.strength))


@is_warm.on(EosStrength)
def _is_warm_eos_strength(law):
    return not isinstance(law.temperature, Absent)


@laws.shear_part.on(EosStrength)
def _shear_part_eos_strength(law, kin, state):
    shear = 2 * strengths.shear_modulus(present(law, state.m)) * integrity_of(law, state.m.damage)
    return shear * laws.specific_volume(law.eos) * state.J


@laws.energy_density.on(EosStrength)
def _energy_density_eos_strength(law, kin, state):
    """Return the energy released by unloading at this temperature, without plastic work."""
    J, s, m = state
    volume = volume_energy(law, J, m)
    tension = intact_pressure(law, J, m) < 0
    fraction = integrity_of(law, m.damage)
    volume = where(tension, fraction * volume, volume)
    return volume + J * (fraction * strengths.shear_energy(present(law, m), kin, s))


@laws.elastic_strain.on(EosStrength)
def _elastic_strain_eos_strength(law, kin, state):
    strain = symmetric_tensor(kin, strengths.shear_strain(present(law, state.m), kin, state.s))
    elastic = strengths.elastic_ratio(law.strength, state.m.strength, state.J)
    return strain + 1 / 3 * log(elastic) * I


@laws.plastic_strain.on(EosStrength)
def _plastic_strain_eos_strength(law, kin, state):
    return strengths.equivalent_plastic_strain(law.strength, state.m.strength)


@laws.shown.on(strengths.Remembered)
def _shown_remembered(tag, law, kin, state):
    return state.m.strength[tag.index]


@laws.with_stress.on(EosStrength)
def _with_stress_eos_strength(law, kin, state, stress):
    J, _, m = state
    stress = symmetric_tensor(kin, stress)
    elastic = strengths.elastic_ratio(law.strength, m.strength, J)
    beside = sum(thermal_pressure(law.temperature, m.heat)) + sum(m.viscous)
    p = -tr(stress) * (1 / 3) - further_pressure(law.further, m.further, beside)
    after, energy = eos.at_pressure(law.eos, elastic, m.energy, p, m.heat)
    return State(J * (after / elastic), dev(stress), m._replace(energy=energy))


@laws.damage.on(EosStrength)
def _damage_eos_strength(law, kin, state):
    return 1 - integrity_of(law, state.m.damage)


@laws.damage_initiation.on(EosStrength)
def _damage_initiation_eos_strength(law, kin, state):
    return initiation(law.damage, state.m.damage)


@laws.with_temperature.on(EosStrength)
def _with_temperature_eos_strength(law, kin, state, T):
    if isinstance(law.viscosity, ViscosityWithFlux):
        before = state.m.energy[0]
        after = max(T / laws.specific_volume(law.eos), LEAST_LEFT * before)
        return _heated_by(state, after - before)
    heat = at_temperature(state.m.heat, T)
    return state._replace(m=state.m._replace(heat=heat))


@laws.warmed.on(EosStrength)
def _warmed_eos_strength(law, kin, state, heat):
    taken = eos.taken_heat(law.eos, state.m.energy, heat)
    return _heated_by(state, taken[0]) if len(taken) else state


def _heated_by(state, heat):
    m = state.m
    energy, loss = m.energy[0] + heat, tuple([lost + heat for lost in m.loss])
    return state._replace(m=m._replace(energy=(energy, *m.energy[1:]), loss=loss))


@laws.lit.on(EosStrength)
def _lit_eos_strength(law, kin, state, since):
    for memory in eos.ignited(law.eos, state.m.energy, since):
        state = state._replace(m=state.m._replace(energy=memory))
    return state
