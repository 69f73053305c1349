"""A law in parts: pressure from an equation of state, deviatoric stress from a strength.

Viscosity, damage and temperature may be added. The parts are NamedTuples inside the law's, so that
their types select their point functions; those that are absent are tags without parameters, and
have no numbers in the state. The state of a point is det F, the deviatoric stress of the intact
material, what each part remembers (`Memory`), and the dissipated energy where there is any.
"""

from __future__ import annotations

from math import log, sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import by_type, point_function, real, shared
from karamelo_py.compiler.tuples import (
    either,
    following,
    increased,
    leading,
    plus,
    scale,
    subtract,
    times,
)
from karamelo_py.points.kinematics import (
    add_pressure,
    after_symmetric,
    contract,
    deviator,
    leading_symmetric,
    spin,
    symmetric_part,
    trace,
    volume_ratio,
    von_mises,
    zero_symmetric,
)
from karamelo_py.points.laws import (
    advance,
    assemble,
    cauchy_stress,
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
    separate,
    specific_volume,
    temperature,
    wave_speed_squared,
    with_stress,
    with_temperature,
)
from karamelo_py.points.laws.damages import (
    NoDamage,
    damage_after,
    damage_begun,
    initial_damage,
    integrity,
)
from karamelo_py.points.laws.eos import (
    at_pressure,
    bulk_modulus,
    compressed,
    compression_energy,
    initial_energy,
    kept_heat,
    pressure,
    ratio_at_pressure,
)
from karamelo_py.points.laws.strength import (
    elastic_ratio,
    equivalent_plastic_strain,
    initial_loss,
    initial_memory,
    pressure_response,
    shear_energy,
    shear_modulus,
    shear_response,
    shear_strain,
    viscosity_of,
    with_elastic_ratio,
)
from karamelo_py.points.laws.strength.drucker_prager import DruckerPrager
from karamelo_py.points.laws.strength.elastic import elastic_trial
from karamelo_py.points.laws.strength.mohr_coulomb import MohrCoulomb
from karamelo_py.points.laws.temperatures import (
    Isothermal,
    heated,
    initial_heat,
    thermal_pressure,
)
from karamelo_py.points.laws.viscosity import (
    NoViscosity,
    initial_viscous_pressure,
    viscous_pressure,
    viscous_speed,
)


class EosStrength(NamedTuple):
    """sigma = (1 - D) s - p I."""

    eos: Any  # parameters of an equation of state (karamelo_py.points.laws.eos)
    strength: Any  # parameters of a strength (karamelo_py.points.laws.strength)
    viscosity: Any = NoViscosity()  # (karamelo_py.points.laws.viscosity)
    damage: Any = NoDamage()  # (karamelo_py.points.laws.damages)
    temperature: Any = Isothermal()  # (karamelo_py.points.laws.temperatures)


class EosStrengthParts(NamedTuple):
    """Tag of the law while its parts travel one by one."""


class Memory(NamedTuple):
    """What the parts of a law remember at one point: flat tuples, empty for parts without."""

    energy: Any  # of the equation of state
    viscous: Any  # viscous pressure
    damage: Any
    heat: Any  # temperature
    loss: Any  # dissipated energy per reference volume
    strength: Any


@separate.on(EosStrength)
def _(law):
    parts = (law.eos, law.strength, law.viscosity, law.damage, law.temperature)
    return EosStrengthParts(), parts


@assemble.on(EosStrengthParts)
def _(tag, first, second, third, fourth, fifth):
    return EosStrength(first, second, third, fourth, fifth)


@shared
def lossless(law, like):
    """(0,) where a part dissipates energy, else ()."""
    return either(initial_loss(law.strength, like), initial_viscous_pressure(law.viscosity, like))


@initial_state.on(EosStrength)
def _(law, kin, like):
    at_rest = (real(1, like),) + zero_symmetric(kin, like) + initial_energy(law.eos, like)
    at_rest = at_rest + initial_viscous_pressure(law.viscosity, like)
    at_rest = at_rest + initial_damage(law.damage, like) + initial_heat(law.temperature, like)
    return at_rest + lossless(law, like) + initial_memory(law.strength, like)


@shared
def memory_of(law, kin, state):
    """What the parts remember."""
    like = state[0]
    rest = after_symmetric(kin, state[1:])
    energy = leading(rest, initial_energy(law.eos, like))
    rest = following(rest, energy)
    viscous = leading(rest, initial_viscous_pressure(law.viscosity, like))
    rest = following(rest, viscous)
    broken = leading(rest, initial_damage(law.damage, like))
    rest = following(rest, broken)
    heat = leading(rest, initial_heat(law.temperature, like))
    rest = following(rest, heat)
    loss = leading(rest, lossless(law, like))
    return Memory(energy, viscous, broken, heat, loss, following(rest, loss))


@shared
def state_of(j, s, m):
    """The state of a point from its numbers."""
    return (j,) + s + m.energy + m.viscous + m.damage + m.heat + m.loss + m.strength


@shared
def intact_pressure(law, j, m):
    """Pressure of the intact material, without viscous pressure."""
    elastic = elastic_ratio(law.strength, m.strength, j)
    p = pressure(law.eos, elastic, m.energy, m.heat)
    return plus(p, thermal_pressure(law.temperature, m.heat))


def open_pressure(p, whole):
    """Pressure after damage: tension is lost with integrity (1 - D,), compression is not."""
    if len(whole) == 0:
        return p
    return p * whole[0] if p < 0 else p


@by_type(open_pressure)
def _open_pressure(p, whole):
    if len(whole) == 0:
        return lambda p, whole: p
    return lambda p, whole: p * whole[0] if p < 0 else p


@shared
def full_pressure(law, j, m):
    """The pressure in the stress."""
    p = open_pressure(intact_pressure(law, j, m), integrity(law.damage, m.damage))
    return plus(p, m.viscous)


@point_function()
def respond(strength, law, kin, s, strain, j, m, dt):
    """Deviatoric stress, memory of the strength, and plastic work per volume after a step."""


@respond.otherwise
def _(strength, law, kin, s, strain, j, m, dt):
    return shear_response(strength, kin, s, strain, m.strength, m.heat, dt)


@respond.on(MohrCoulomb)
@respond.on(DruckerPrager)
def _(strength, law, kin, s, strain, j, m, dt):
    trial = elastic_trial(kin, strength.G, s, strain)
    elastic = elastic_ratio(strength, m.strength, j)
    warm = plus(real(0, j), thermal_pressure(law.temperature, m.heat))
    p = pressure(law.eos, elastic, m.energy, m.heat) + warm
    K = bulk_modulus(law.eos, elastic, m.energy, m.heat)
    new, reached = pressure_response(strength, kin, trial, p, K, m.strength[0])
    plastic = scale(real(0.5, j) / strength.G, subtract(trial, new))
    increment = sqrt(real(2 / 3, j) * contract(kin, plastic, plastic))
    memory = (m.strength[0] + increment,) + m.strength[1:]
    work = contract(kin, new, plastic)
    if reached != p:
        # The volume that bears the new pressure is elastic; the rest is plastic.
        after = ratio_at_pressure(law.eos, reached - warm, m.heat)
        memory = with_elastic_ratio(strength, memory, j, after)
        work -= reached * log(elastic / after)
    return new, memory, work


def broken_further(law, kin, m, strain, s, j, dt):
    """Memory of the damage after an increment of plastic strain; () where nothing breaks."""
    if len(m.damage) == 0:
        return ()
    return _broken_further(law, kin, m, strain, s, j, dt)


@shared
def _broken_further(law, kin, m, strain, s, j, dt):
    p = intact_pressure(law, j, m)
    q = von_mises(kin, s)
    bound = q + real(1e-3, p) * abs(p)
    triaxiality = -p / bound if bound > 0 else real(0, p)
    return damage_after(law.damage, m.damage, strain, triaxiality, m.heat, dt)


@by_type(broken_further)
def _choose_broken_further(law, kin, m, strain, s, j, dt):
    if len(m[2]) == 0:
        return lambda law, kin, m, strain, s, j, dt: ()
    return lambda law, kin, m, strain, s, j, dt: _broken_further(law, kin, m, strain, s, j, dt)


@shared
def sound(law, j, m):
    """Speed of sound without shear."""
    elastic = elastic_ratio(law.strength, m.strength, j)
    K = bulk_modulus(law.eos, elastic, m.energy, m.heat)
    return sqrt(K * specific_volume(law.eos) * j)


def viscous_after(law, j, m, rate):
    """Viscous pressure (q,) at a rate of volume change, or ()."""
    if len(m.viscous) == 0:
        return ()
    return _viscous_after(law, j, m, rate)


@shared
def _viscous_after(law, j, m, rate):
    density = real(1, j) / (specific_volume(law.eos) * j)
    return viscous_pressure(law.viscosity, rate, density, sound(law, j, m))


@by_type(viscous_after)
def _choose_viscous_after(law, j, m, rate):
    if len(m[1]) == 0:
        return lambda law, j, m, rate: ()
    return lambda law, j, m, rate: _viscous_after(law, j, m, rate)


def released(law, kin, j, s, m, broken):
    """Stored energy that an increment of damage sets free."""
    if len(m.damage) == 0:
        return j - j
    return _released(law, kin, j, s, m, broken)


@shared
def _released(law, kin, j, s, m, broken):
    before = integrity(law.damage, m.damage)
    after = integrity(law.damage, broken)
    energy = j * shear_energy(law.strength, kin, s)
    if intact_pressure(law, j, m) < 0:
        energy += compression_energy(law.eos, j, m.energy)
    return (before[0] - after[0]) * energy


@by_type(released)
def _choose_released(law, kin, j, s, m, broken):
    if len(m[2]) == 0:
        return lambda law, kin, j, s, m, broken: j - j
    return lambda law, kin, j, s, m, broken: _released(law, kin, j, s, m, broken)


@advance.on(EosStrength)
def _(law, kin, state, dl, dt):
    m = memory_of(law, kin, state)
    before = state[0]
    j = before * volume_ratio(kin, dl)
    strain = symmetric_part(kin, dl)
    old = spin(kin, dl, leading_symmetric(kin, state[1:]))
    s, memory, work = respond(law.strength, law, kin, old, strain, j, m, dt)
    work = times(j * work, integrity(law.damage, m.damage))
    viscous = viscous_after(law, j, m, trace(strain) / dt)
    viscous_work = plus(j - j, viscous) * (before - j)
    energy = compressed(law.eos, m.energy, before, j, work + viscous_work)
    flow = equivalent_plastic_strain(law.strength, memory)
    flow -= equivalent_plastic_strain(law.strength, m.strength)
    now = Memory(energy, viscous, m.damage, m.heat, m.loss, memory)
    broken = broken_further(law, kin, now, flow, s, j, dt)
    heat = heated(law.temperature, m.heat, work * specific_volume(law.eos))
    gone = work + viscous_work + released(law, kin, j, s, now, broken)
    return state_of(j, s, Memory(energy, viscous, broken, heat, increased(m.loss, gone), memory))


@shared
def _nominal_deviator(law, kin, state, m):
    """The deviatoric stress that damage leaves."""
    s = leading_symmetric(kin, state[1:])
    return damaged(s, integrity(law.damage, m.damage))


def damaged(s, whole):
    """(1 - D) s."""
    return scale(whole[0], s) if len(whole) else s


@by_type(damaged)
def _damaged(s, whole):
    if len(whole) == 0:
        return lambda s, whole: s
    return lambda s, whole: scale(whole[0], s)


@cauchy_stress.on(EosStrength)
def _(law, kin, state):
    m = memory_of(law, kin, state)
    s = _nominal_deviator(law, kin, state, m)
    return add_pressure(kin, real(1, state[0]), s, -full_pressure(law, state[0], m))


@kirchhoff_stress.on(EosStrength)
def _(law, kin, state):
    j = state[0]
    m = memory_of(law, kin, state)
    s = _nominal_deviator(law, kin, state, m)
    return add_pressure(kin, j, s, -j * full_pressure(law, j, m))


@jacobian.on(EosStrength)
def _(law, kin, state):
    return state[0]


def slowed(squared, a):
    """Square of c' = sqrt(c^2 + a^2) + a, from c^2 and (a,); c^2 for ()."""
    if len(a) == 0:
        return squared
    return _slowed(squared, a[0])


@shared
def _slowed(squared, a):
    speed = sqrt(squared + a * a) + a
    return speed * speed


@by_type(slowed)
def _choose_slowed(squared, a):
    if len(a) == 0:
        return lambda squared, a: squared
    return lambda squared, a: _slowed(squared, a[0])


def shear_speed(strength, density):
    """(nu / h,) of a viscous strength, nu = 4/3 mu/rho, or ()."""
    fluid = viscosity_of(strength)
    return (4 / 3 * fluid[0] / (density * fluid[1]),) if len(fluid) else ()


@by_type(shear_speed)
def _shear_speed(strength, density):
    if not viscosity_of.defined(getattr(strength, "instance_class", None)):
        return lambda strength, density: ()

    def speed(strength, density):
        fluid = viscosity_of(strength)
        return (real(4 / 3, density) * fluid[0] / (density * fluid[1]),)

    return speed


@wave_speed_squared.on(EosStrength)
def _(law, kin, state):
    # (K + 4/3 G) / rho, with the elastic moduli: plastic waves are slower. Viscosity nu damps
    # the shortest wave of a cell by xi = nu / (c h), which takes c dt / h down to
    # sqrt(1 + xi^2) - xi (Belytschko et al. 2014, eq. 6.3.10): as if c were c', see `slowed`.
    j = state[0]
    m = memory_of(law, kin, state)
    elastic = elastic_ratio(law.strength, m.strength, j)
    modulus = bulk_modulus(law.eos, elastic, m.energy, m.heat)
    volume = specific_volume(law.eos) * j
    squared = (modulus + real(4 / 3, j) * shear_modulus(law.strength)) * volume
    density = real(1, j) / volume
    squared = slowed(squared, shear_speed(law.strength, density))
    return slowed(squared, bulk_damping(law, j, m, density))


def bulk_damping(law, j, m, density):
    """(nu / h,) of the viscosity, or ()."""
    if len(m.viscous) == 0:
        return ()
    return viscous_speed(law.viscosity, m.viscous, density, sound(law, j, m))


@by_type(bulk_damping)
def _bulk_damping(law, j, m, density):
    if len(m[1]) == 0:
        return lambda law, j, m, density: ()

    def damping(law, j, m, density):
        return viscous_speed(law.viscosity, m.viscous, density, sound(law, j, m))

    return damping


@energy_density.on(EosStrength)
def _(law, kin, state):
    """What unloading gives back at this temperature: plastic work is not stored."""
    j = state[0]
    m = memory_of(law, kin, state)
    whole = integrity(law.damage, m.damage)
    elastic = elastic_ratio(law.strength, m.strength, j)
    volume = compression_energy(law.eos, elastic, m.energy)
    volume -= kept_heat(law.eos, plus(j - j, m.loss))
    volume += plus(j - j, thermal_pressure(law.temperature, m.heat)) * (real(1, j) - j)
    if intact_pressure(law, j, m) < 0:
        volume = times(volume, whole)
    shear = shear_energy(law.strength, kin, leading_symmetric(kin, state[1:]))
    return volume + j * times(shear, whole)


@dissipated_energy.on(EosStrength)
def _(law, kin, state):
    return plus(state[0] - state[0], memory_of(law, kin, state).loss)


@elastic_strain.on(EosStrength)
def _(law, kin, state):
    """ln J / 3, the mean of the elastic strain increments, and the elastic shear."""
    m = memory_of(law, kin, state)
    strain = shear_strain(law.strength, kin, leading_symmetric(kin, state[1:]))
    elastic = elastic_ratio(law.strength, m.strength, state[0])
    return add_pressure(kin, real(1, state[0]), strain, real(1 / 3, state[0]) * log(elastic))


@plastic_strain.on(EosStrength)
def _(law, kin, state):
    return equivalent_plastic_strain(law.strength, memory_of(law, kin, state).strength)


@with_stress.on(EosStrength)
def _(law, kin, state, stress):
    # Pressure follows from volume, so the point gets the volume that has this pressure.
    m = memory_of(law, kin, state)
    elastic = elastic_ratio(law.strength, m.strength, state[0])
    beside = plus(plus(elastic - elastic, thermal_pressure(law.temperature, m.heat)), m.viscous)
    p = -trace(stress) * real(1 / 3, elastic) - beside
    after, energy = at_pressure(law.eos, elastic, m.energy, p, m.heat)
    now = Memory(energy, m.viscous, m.damage, m.heat, m.loss, m.strength)
    return state_of(state[0] * (after / elastic), deviator(kin, stress), now)


@specific_volume.on(EosStrength)
def _(law):
    return specific_volume(law.eos)


@damage.on(EosStrength)
def _(law, kin, state):
    m = memory_of(law, kin, state)
    one = real(1, state[0])
    return one - times(one, integrity(law.damage, m.damage))


@damage_initiation.on(EosStrength)
def _(law, kin, state):
    return damage_begun(law.damage, memory_of(law, kin, state).damage)


@temperature.on(EosStrength)
def _(law, kin, state):
    return plus(state[0] - state[0], memory_of(law, kin, state).heat)


def set_heat(heat, T):
    """(T,) in the place of a temperature, () in that of none."""
    return (T,) if len(heat) else ()


@by_type(set_heat)
def _set_heat(heat, T):
    if len(heat) == 0:
        return lambda heat, T: ()
    return lambda heat, T: (T,)


@with_temperature.on(EosStrength)
def _(law, kin, state, T):
    m = memory_of(law, kin, state)
    now = Memory(m.energy, m.viscous, m.damage, set_heat(m.heat, T), m.loss, m.strength)
    return state_of(state[0], leading_symmetric(kin, state[1:]), now)


@heat_capacity.on(EosStrength)
def _(law, like):
    return heat_capacity(law.temperature, like)


@conductivity.on(EosStrength)
def _(law, like):
    return conductivity(law.temperature, like)
